"""All benchmarks in one run: each script in a process of its own, then the table, its objects and the picture.

    python benchmarks/run.py [--quick] [--out build/bench]

Writes results.md and results.json, anew after each part, and cost.svg at the end. The long campaigns are not in it but
for the short ones of `accuracy.py`; each is run alone, as its first lines say: `imu_coverage.py`, `noise_coverage.py`,
`turntable_coverage.py`, `selfcal_coverage.py`, `selfcal_robustness.py`, `strapdown_coverage.py`, `aoa_bands.py`,
`aoa_endless.py`, `dialect_files.py`, `faults.py`; so are `compiled_kernels.py` (two environments), `long_rows.py`,
`workbench_speed.py`, and `fleets.py`, `workbench_browser.py`,
`stream_latency.py` and `live.py`, whose figures are of the clock on the wall.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from textwrap import fill

from measure import Row, Spread, machine, spread, table, yardstick

FOLDER = Path(__file__).parent

#: title of each part -> its script
PARTS = {
    "Reading": "reading",
    "IMU by hand": "imu_calibration",
    "Ferraris": "ferraris",
    "Strapdown": "strapdown_record",
    "Noise": "allan",
    "Sensitivity": "sensitivity",
    "Self-calibration": "selfcal_filters",
    "Angle of attack": "aoa_fusion",
    "Streams": "streaming",
    "Commands": "commands",
    "Laboratory": "laboratory",
    "Errors": "accuracy",
}


def objects_of(script: str, quick: bool, moments: list[float]) -> list[dict]:
    """What a script says as JSON; it is told on standard error that it runs, and for how long it did.

    ``moments`` receives what the yardstick is before it.
    """
    moments.append(yardstick())
    began = time.perf_counter()
    print(f"{script:16s}", end="", file=sys.stderr, flush=True)
    command = [sys.executable, str(FOLDER / f"{script}.py"), *(["--quick"] if quick else [])]
    if script != "scaling":
        command.append("--json")
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
    print(f" {time.perf_counter() - began:6.0f} s", file=sys.stderr)
    return json.loads(done.stdout)


def row_of(told: dict) -> Row:
    """A row from its object."""
    spreads = {name: told[name] and Spread(**told[name]) for name in ("ours", "theirs", "ratio")}
    return Row(**{name: value for name, value in told.items() if name != "holds"} | spreads)


def as_markdown(results: dict) -> str:
    """Machine, tables of all parts, and slopes."""
    made = results["machine"]
    versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
    load = "unknown" if made["load"] is None else f"{made['load']:.1f}"
    lines = [
        "# Benchmarks",
        fill(
            f"{results['date']}; {made['system']}, {made['processors']} processors, load {load}, "
            f"Python {made['python']}, {versions}. Median (least to largest) of the rounds. Between the parts a fixed "
            f"piece of work took {Spread(**results['yardstick'])} ms: so much does the machine vary by itself.",
            120,
        ),
    ]
    for title, rows in results["rows"].items():
        lines += [f"## {title}", table([row_of(told) for told in rows])]
    slopes = ["| Cost of | Against | Of | Slope |", "|---|---|---|---|"]
    for curve in results["curves"]:
        slope = "" if curve["slope"] is None else f"{curve['slope']:.2f}"
        slopes.append(f"| {curve['panel']} | {curve['variable']} | {curve['name']} | {slope} |")
    return "\n\n".join([*lines, "## Cost against size", "\n".join(slopes)]) + "\n"


def written(results: dict, folder: Path) -> None:
    """Write the table and the objects."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "results.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    (folder / "results.md").write_text(as_markdown(results), encoding="utf-8")


def pictured(results: dict, folder: Path) -> None:
    """Draw the cost against size."""
    from scaling import Curve, drawn

    curves = [Curve(**{k: v for k, v in told.items() if k != "slope"}) for told in results["curves"]]
    (folder / "cost.svg").write_text(drawn(curves), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="little work, once; no figure is to be judged")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    options = parser.parse_args()
    moments: list[float] = []
    results: dict = {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "machine": machine(),
        "rows": {},
        "curves": [],
    }
    for title, script in PARTS.items():
        results["rows"][title] = objects_of(script, options.quick, moments)
        results["yardstick"] = asdict(spread([*moments, yardstick()]))
        written(results, options.out)  # the next part may take minutes, or fail
    results["curves"] = objects_of("scaling", options.quick, moments)
    results["yardstick"] = asdict(spread([*moments, yardstick()]))
    written(results, options.out)
    pictured(results, options.out)
    broken = [told["what"] for rows in results["rows"].values() for told in rows if told["holds"] is False]
    print(
        f"{options.out / 'results.md'}: {'all that is promised holds' if not broken else 'does not hold: '}",
        end="",
    )
    print("; ".join(broken))


if __name__ == "__main__":
    main()
