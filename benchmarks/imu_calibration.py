"""Time `calibrate imu` on the shipped Xsens recording against the same method written plainly, in one run.

    python benchmarks/imu_calibration.py [--runs 5] [--smoke]

Prints medians with spread and the ratio, and the whole process's time with everything loaded from cold.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import plain_tedaldi

from inercal.examples import EXAMPLES, FOLDER
from inercal.imu.multiposition import calibrate_multiposition as calibrate
from inercal.records.maps import read_map
from inercal.records.read import read
from inercal.study.load import load_imu_study


def timed(work, runs: int) -> tuple[list[float], object]:
    """Seconds of each of several runs, and the last result."""
    seconds, result = [], None
    for _ in range(runs):
        clock = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - clock)
    return seconds, result


def row(name: str, seconds: list[float], beside: float) -> str:
    median = statistics.median(seconds)
    return f"{name:34s} {median:9.4f} s ({min(seconds):.4f} to {max(seconds):.4f})   ratio {median / beside:8.3f}"


def passes(calibration) -> dict:
    """One pass over all turns: in NumPy, with derivatives, and a compiled integration of as many intervals."""
    from inercal.geometry import kernels
    from inercal.imu.multiposition import _turns
    from inercal.imu.turns import carried, carried_with_derivatives

    turns, _ = _turns(calibration.recording, calibration.poses, False)
    gyro, up = calibration.gyro, calibration.poses.accelerometer.directions
    intervals = turns.intervals[turns.intervals > 0]
    omega = np.full((len(intervals), 3), 0.5)
    start, out = np.array([1.0, 0.0, 0.0, 0.0]), np.empty((len(intervals) + 1, 4))
    kernels.integrate(start, omega, intervals, out)  # compiles or loads
    return {
        "one pass of the turns": lambda: carried(turns, up, gyro.model, gyro.drift),
        "the same with derivatives": lambda: carried_with_derivatives(turns, up, gyro.model, gyro.drift),
        "as many intervals, compiled": lambda: kernels.integrate(start, omega, intervals, out),
    }


def process_seconds(runs: int) -> list[float]:
    """Wall time of the whole command, without a report."""
    xsens = EXAMPLES["xsens"]
    command = [sys.executable, "-m", *xsens.command(str(FOLDER)).split()]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "cal.json"
        seconds, _ = timed(
            lambda: subprocess.run([*command, "--out", str(out)], check=True, capture_output=True), runs + 1
        )
        assert json.loads(out.read_text())["status"]["code"] == "ok"
    return seconds[1:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument(
        "--smoke", action="store_true", help="one run of ours, the peer on the accelerometers alone"
    )
    options = parser.parse_args()

    xsens = EXAMPLES["xsens"]
    record = read([FOLDER / name for name in xsens.records], read_map(FOLDER / xsens.map))
    settings = load_imu_study(FOLDER / xsens.study)
    calibrate(record, settings)  # loads what is loaded once
    runs = 1 if options.smoke else options.runs
    ours, calibration = timed(lambda: calibrate(record, settings), runs)
    acc, gyro = record.triad("acc"), record.triad("gyro")
    if options.smoke:
        print(row("inercal, solve", ours, statistics.median(ours)))
        return
    plain, (p, q) = timed(lambda: plain_tedaldi.calibrate(acc.t, acc.values, gyro.values, 9.81744, 50.0), 1)
    median = statistics.median(ours)
    print(row("inercal, with uncertainties", ours, median))
    print(row("plain SciPy, values alone", plain, median))
    print(row("inercal, whole process", process_seconds(runs), median))
    fit = calibration.estimate
    for words, work in passes(calibration).items():
        print(row(words, timed(work, 20)[0], median))
    scales = np.array([fit[f"K1_{axis}"].value for axis in "xyz"])
    rates = np.array([fit[f"S_{axis}"].value for axis in "xyz"])
    print(f"largest difference in scale: accelerometers {np.max(np.abs(p[:3] / scales - 1)):.1e}, "
          f"gyro {np.max(np.abs(q[:3] / rates - 1)):.1e} (ours estimates the bias too)")  # fmt: skip


if __name__ == "__main__":
    main()
