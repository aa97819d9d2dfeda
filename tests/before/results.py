"""Results of every shipped example and published study, before and after the house is rebuilt; gone with that issue.

python tests/before/results.py make FOLDER     run every case of the present tree, one JSON file each
python tests/before/results.py compare A B     say where two folders differ: values by 1e-6 u, u by 1e-6, texts at all
"""

import contextlib
import csv
import gzip
import io
import json
import math
import os
import re
import sys
import traceback
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["COLUMNS"] = "200"

import numpy as np

HERE = Path(__file__).resolve().parent
CLOSE = 1e-6
#: keys whose values tell of the machine, the moment or the version
PASSING = {
    "timing_s",
    "step_us",
    "sample_share",
    "versions",
    "inercal",
    "sha256",
    "path",
    "seconds",
    "checksum",
    "sources_sha256",
    "date",
}


def rows_of(path):
    opened = gzip.open(path, "rt") if str(path).endswith(".gz") else open(path)
    with opened as file:
        table = list(csv.reader(file))
    return table[0], table[1:]


def changed(source, target, change):
    """A copy of a CSV file, its columns (dict of name -> list of floats) changed."""
    head, rows = rows_of(source)
    columns = {
        name.split(" ")[0]: np.array([float(r[k] or "nan") for r in rows]) for k, name in enumerate(head)
    }
    change(columns)
    with open(target, "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        values = [columns[name.split(" ")[0]] for name in head]
        writer.writerows(["" if math.isnan(x) else repr(float(x)) for x in row] for row in zip(*values))


def negate(name):
    def change(c):
        c[name] = -c[name]

    return change


def exchange(a, b):
    def change(c):
        c[a], c[b] = c[b], c[a]

    return change


def scaled(name, by):
    def change(c):
        c[name] = c[name] * by

    return change


def added(name, by):
    def change(c):
        c[name] = c[name] + by

    return change


def late(name, rows):
    def change(c):
        c[name] = np.concatenate([np.repeat(c[name][:1], rows), c[name][:-rows]])

    return change


def harmonic(name, amplitude, order):
    def change(c):
        c[name] = c[name] + amplitude * np.sin(order * np.radians(c[name]))

    return change


def cut(a, b):
    def change(c):
        for name in c:
            c[name] = np.delete(c[name], slice(a, b))

    return change


def frozen(name, a, b):
    def change(c):
        c[name][a:b] = c[name][a]

    return change


SELFCAL_FAULTS = {
    "sign": negate("acc_y"),
    "swap": exchange("acc_x", "acc_y"),
    "unit": scaled("acc_z", 1.02),
    "harmonic": harmonic("th_z", 20.0 / 3600, 2),
    "late": late("wc_z", 2),
    "gap": cut(900, 940),
    "stuck": frozen("th_x", 400, 700),
    "zero": added("th_x", 0.02),
    "scale": scaled("wc_z", 1.0005),
    "encoder": late("th_z", 1),
    "rates": scaled("wc_z", math.pi / 180),
}
STING_FAULTS = {
    "sign": negate("gyro"),
    "sign_a": negate("a2"),
    "swap": exchange("a1", "a3"),
    "unit": scaled("a2", 9.80665),
    "late": late("gyro", 3),
    "scale": scaled("a1", 1.01),
    "bias": added("a2", 0.05),
    "gap": cut(3000, 3100),
    "stuck": frozen("gyro", 2000, 5000),
}


def cases(folder):
    """(name, argv) of every case; files are written to ``folder`` first."""
    from inercal.examples import EXAMPLES, FOLDER

    shipped = {}
    for name, example in EXAMPLES.items():
        argv = example.verb.split() + [str(FOLDER / f) for f in example.records]
        argv += ["--map", str(FOLDER / example.map)] if example.map else []
        study = HERE / "xsens.toml" if name == "xsens" else example.study and FOLDER / example.study
        argv += ["--study", str(study)] if study else []
        shipped[name] = argv
        yield name, argv
    selfcal, sting = FOLDER / "selfcal.csv.gz", FOLDER / "sting.csv.gz"
    selfcal_study, sting_study = str(FOLDER / "selfcal.toml"), str(FOLDER / "sting.toml")
    for kind in ("svd-qukf", "gimbal-ukf", "mukf", "map", "lm"):
        yield f"selfcal-{kind}", [*shipped["selfcal"], "--filter", kind]
    yield "selfcal-compare", [*shipped["selfcal"], "--compare"]
    yield "selfcal-extended", [*shipped["selfcal"], "--set", "filter.extended=true"]
    yield "selfcal-site", [*shipped["selfcal"], "--set", "site.latitude=40.02(1) deg"]
    yield "selfcal-wrong-site", [*shipped["selfcal"], "--set", "site.latitude=40.5 deg"]
    yield "selfcal-noise", [*shipped["selfcal"], "--set", "noise.accelerometer=2 ug"]
    for name, change in SELFCAL_FAULTS.items():
        changed(selfcal, folder / f"selfcal-{name}.csv", change)
        yield f"selfcal-{name}", ["selfcal", str(folder / f"selfcal-{name}.csv"), "--study", selfcal_study]
    for name, change in STING_FAULTS.items():
        changed(sting, folder / f"sting-{name}.csv", change)
        yield f"sting-{name}", ["aoa", str(folder / f"sting-{name}.csv"), "--study", sting_study]
    for words in (
        "--static segmented",
        "--static complementary",
        "--static improved",
        "--static difference",
        "--static gls",
        "--centrifugal low-pass",
        "--centrifugal mechanical",
        "--centrifugal decision",
        "--tangential differentiated",
        "--states 8",
        "--states 11",
        "--states 15",
        "--smooth",
        "--compare",
        "--points",
    ):
        yield f"sting{words.replace(' ', '-').replace('--', '-')}", [*shipped["sting"], *words.split()]
    for name, position in (
        ("r", "sensors.a1.r=-0.27 m"),
        ("axis", "sensors.a2.angle=1 deg"),
        ("noise", "noise.accelerometer=2e-5 g"),
    ):
        key = ["--set", position] if name != "axis" else ["--set", "sensors.a1.axis=-x"]
        yield f"sting-study-{name}", [*shipped["sting"], *key]
    for study in ("turntable", "imu-table", "rate"):
        path = str(HERE / f"{study}.toml")
        run = str(folder / f"{study}.csv")
        yield f"{study}-simulate", ["simulate", "turntable", path, "--seed", "1", "--out", run]
        yield f"{study}-calibrate", ["calibrate", "turntable", run, "--study", path]
    path = str(HERE / "turntable.toml")
    for words in (
        ["sensitivity", path],
        ["sensitivity", path, "--set", "analysis.method=sampled"],
        ["design", "positions", path],
        ["design", "selfcal", selfcal_study],
    ):
        yield "-".join(w for w in words[:-1] if "/" not in w and "=" not in w) + str(len(words)), words
    for kind, study in (("selfcal", selfcal_study), ("aoa", str(HERE / "aoa.toml"))):
        out = str(folder / f"{kind}-made.csv")
        yield f"simulate-{kind}", ["simulate", kind, study, "--seed", "3", "--out", out]
        yield f"{kind}-made", [kind, out, "--study", study]
    yield (
        "aoa-made-smooth",
        ["aoa", str(folder / "aoa-made.csv"), "--study", str(HERE / "aoa.toml"), "--smooth"],
    )
    head, rows = rows_of(folder / "imu-table.csv") if (folder / "imu-table.csv").exists() else (None, None)
    for name in ("xsens", "ferraris", "table"):
        yield f"{name}-saved", [*shipped[name], "--out", str(folder / f"{name}.saved.json")]
    for tool in ("imu_tk", "imucal", "kalibr", "psins"):
        yield f"convert-{tool}", ["convert", str(folder / "ferraris.saved.json"), "--to", tool]
    yield "compare", ["compare", str(folder / "xsens.saved.json"), str(folder / "xsens.saved.json")]
    yield "inspect", ["inspect", str(folder / "selfcal-gap.csv")]
    yield "validate", ["validate"]


def run(argv):
    from inercal.cli import run as command

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = command([*argv, "--json"])
    text = out.getvalue()
    try:
        return {"exit": code, "json": json.loads(text)}
    except json.JSONDecodeError:
        return {"exit": code, "text": text, "error": re.sub(r"\S*/", "", err.getvalue())[-600:]}


def make(target):
    from inercal.examples import FOLDER

    folder = Path("/tmp") / f"inercal-before-{os.getpid()}"
    folder.mkdir(parents=True, exist_ok=True)
    target.mkdir(parents=True, exist_ok=True)
    for name, argv in cases(folder):
        try:
            found = run(argv)
        except Exception:
            found = {"exit": -1, "error": traceback.format_exc()[-600:]}
        text = (
            json.dumps(found, indent=1).replace(str(folder), "FOLDER").replace(str(FOLDER.parent), "PACKAGE")
        )
        text = text.replace(str(HERE), "HERE")
        with gzip.GzipFile(target / f"{name}.json.gz", "wb", mtime=0) as file:
            file.write(text.encode())
        print(
            name,
            found["exit"],
            found.get("json", {}).get("status", {}).get("code", found.get("error", "")[:150]),
            flush=True,
        )


def differences(a, b, where="", u=None):
    """Where two results differ; numbers by their u where that is known, else by 1e-6 of their size."""
    if isinstance(a, dict) and isinstance(b, dict):
        scale = a.get("u") if isinstance(a.get("u"), (int, float)) else None
        for key in [*a, *(k for k in b if k not in a)]:
            if key in PASSING:
                continue
            if key not in a or key not in b:
                yield f"{where}.{key}: only in the {'second' if key not in a else 'first'}"
            else:
                yield from differences(a[key], b[key], f"{where}.{key}", scale if key == "value" else None)
    elif isinstance(a, list) and isinstance(b, list):
        if len(a) != len(b):
            yield f"{where}: {len(a)} and {len(b)} items: {str(a)[:200]} | {str(b)[:200]}"
            return
        flat = [x for x in a if isinstance(x, float)]
        size = max((abs(x) for x in flat), default=None)
        for k, (x, y) in enumerate(zip(a, b)):
            yield from differences(x, y, f"{where}[{k}]", size)
    elif isinstance(a, (int, float)) and isinstance(b, (int, float)) and not isinstance(a, bool):
        if abs(a - b) > CLOSE * max(abs(a), u or 0.0):
            yield f"{where}: {a!r} and {b!r}"
    elif a != b:
        yield f"{where}: {str(a)[:300]!r} and {str(b)[:300]!r}"


def compare(first, second):
    total = 0
    for path in sorted(first.glob("*.json.gz")):
        other = second / path.name
        if not other.exists():
            print(f"{path.stem}: missing")
            total += 1
            continue
        a, b = (json.loads(gzip.decompress(p.read_bytes())) for p in (path, other))
        for line in differences(a, b):
            print(f"{path.name.removesuffix('.json.gz')}{line}")
            total += 1
    print(f"{total} differences")
    return total


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(Path(sys.argv[2]))
    else:
        sys.exit(compare(Path(sys.argv[2]), Path(sys.argv[3])) > 0)
