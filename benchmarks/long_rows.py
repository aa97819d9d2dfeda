"""Long records and large searches, each in a process of its own, beside peers where there are any: seconds of the
processor and the largest memory.

    python benchmarks/long_rows.py [--quick]

Ten million rows of seven numbers as text and as HDF5; whole commands on two hours of a platform at 100 Hz; a day of a
channel with gaps; 500 positions chosen; a sampled sensitivity. Kernels are compiled and kept by a first, small run.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("POLARS_MAX_THREADS", "1")

from measure import Row, alone, named, row, spread

from inercal.examples import FOLDER

#: files are made in processes of their own: the largest memory of a process begins with that of who starts it
TEXT = "from pathlib import Path; from reading import recording; Path({path!r}).write_text(recording({n}))"
MATRIX = "from pathlib import Path; from reading import stored; stored(Path({path!r}), {n})"

OURS = "from inercal.foundation.records.read import read; read({path!r}{map})"
PEERS = {
    "pandas": "import pandas; pandas.read_csv({path!r})",
    "pyarrow": "from pyarrow import csv; csv.read_csv({path!r}, read_options=csv.ReadOptions(use_threads=False))",
    "polars": "import polars; polars.read_csv({path!r})",
}
H5PY = "import h5py; h5py.File({path!r})['data'][()]"

ALLAN = """
import numpy as np
from allan import INTERVAL, lengths, noise
from inercal.foundation.noise.deviation import allan_deviation
x = noise({n})
if {holes}:
    x[np.random.default_rng(2).choice(len(x), len(x) // 10_000, replace=False)] = np.nan
allan_deviation(x, INTERVAL, lengths(len(x), 50) * INTERVAL)
"""

SAMPLED = """
import numpy as np
from sensitivity import CHAIN, OUTPUTS
from inercal.foundation.sensitivities.sampled import analyse
angles = np.radians(np.random.default_rng(0).uniform(0.0, 360.0, ({n}, 2)))
analyse(CHAIN, OUTPUTS, angles, 1024, np.random.default_rng(1))
"""


def used(words: list[str], ended: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """Run a process to its end, with its children: seconds of the processor, and its largest memory [MiB]; ``ended``
    are the exit codes it may have."""
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, env=dict(os.environ, PYTHONPATH=paths))
    _, status, use = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in ended:
        raise RuntimeError(f"{words} ended with {process.returncode}")
    return use.ru_utime + use.ru_stime, use.ru_maxrss / 1024.0


def python(code: str) -> tuple[float, float]:
    """Seconds and memory of a piece of Python."""
    return used([sys.executable, "-c", code])


def inercal(*words: str) -> tuple[float, float]:
    """Seconds and memory of a command, whatever its verdict."""
    return used([sys.executable, "-m", "inercal", *words, "--quiet"], (0, 1))


def pair(
    what: str, size: str, found: tuple[float, float], most: tuple[float, float] | None = None
) -> list[Row]:
    """Rows of seconds and of memory."""
    return [
        row(what, size, ("s", 1.0), [found[0]], **({"at_most": most[0]} if most else {})),
        Row(f"{what}, memory", size, "MiB", spread([found[1]]), **({"at_most": most[1]} if most else {})),
    ]


def files(folder: Path, n: int) -> list[Row]:
    """Reading beside the peers, which check nothing."""
    text, found, size = folder / "a.csv", [], f"{n} rows of 7 numbers"
    whole, place = folder / "a.h5", folder / "a.toml"
    python(TEXT.format(path=str(text), n=n))
    python(MATRIX.format(path=str(whole), n=n))
    of = {
        "A process that reads text": (OURS.format(path=str(text), map=""), PEERS, text),
        "A process that reads HDF5": (
            OURS.format(path=str(whole), map=f", {str(place)!r}"),
            {"h5py": H5PY},
            whole,
        ),
    }
    for what, (code, peers, path) in of.items():
        ours = python(code)
        for name, peer in peers.items():
            theirs = python(peer.format(path=str(path)))
            found.append(row(what, size, ("s", 1.0), [ours[0]], named(name), [theirs[0]]))
            found.append(row(f"{what}, memory", size, ("MiB", 1.0), [ours[1]], named(name), [theirs[1]]))
        path.unlink()
    return found


def platform(folder: Path, times: int) -> list[Row]:
    """`selfcal` on a recording of the shipped platform that turns through its path again and again, at 100 Hz."""
    record, study = str(folder / "long.npz"), str(FOLDER / "selfcal.toml")
    path = '["z", "180 deg"], ["x", "90 deg"], ["z", "-180 deg"], ["x", "90 deg"]'
    step = "0.01 s" if times > 1 else "0.2 s"
    keys = ("--set", f"plan.turns=[{', '.join([path] * times)}]", "--set", f"plan.step={step}")
    inercal("simulate", "selfcal", study, *keys, "--out", record)
    size, found = f"{54_000 * times if times > 1 else 2700} rows", []
    for states, most in {"extended": (30.0, 1024.0), "rig": (90.0, 1536.0)}.items():
        got = inercal("selfcal", record, "--study", study, "--set", f"model.states={states}")
        found += pair(f"`selfcal`, states {states}", size, got, most)
    return found


def searches(folder: Path, positions: int, sampled: int) -> list[Row]:
    """Positions that are chosen, and sampled sensitivities less their start."""
    study, latitude = str(folder / "table.toml"), "site.latitude=48 deg"
    inercal("new", "turntable", "--out", study)
    got = inercal("design", "positions", study, "--set", latitude, "--set", f"design.positions={positions}")
    found = pair("`design positions`", f"{positions} positions", got)
    some, more = (python(SAMPLED.format(n=n)) for n in (2, 2 + sampled))
    each = (more[0] - some[0]) / sampled
    size = f"{sampled} positions, 5 outputs, 11 errors"
    return [*found, row("Sampled sensitivity, N = 1024, a position", size, ("ms", 1e3), [each])]


def rows(quick: bool) -> list[Row]:
    n, day, times, positions, sampled = (
        (20_000, 20_000, 1, 24, 2) if quick else (10_000_000, 8_600_000, 13, 500, 40)
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not quick:
            rows(quick=True)  # compiles what is not yet compiled
        found = files(folder, n) + platform(folder, times) + searches(folder, positions, sampled)
    for holes in (False, True):
        what = f"A process with an Allan deviation{', 1 in 10⁴ lost' if holes else ''}"
        found += pair(what, f"{day} samples, 50 averaging times", python(ALLAN.format(n=day, holes=holes)))
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
