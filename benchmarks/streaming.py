"""Time streams: lines a second through the commands, and a step of the monitor beside the same in plain NumPy.

    python benchmarks/streaming.py [--rows 50000] [--smoke]

Six channels at 100 Hz. The commands run in processes of their own, from a file to nowhere; their start is taken off
by a run on ten rows. The plain loop does for each sample what the compiled kernels do, with the window in an array
that is rolled and octaves that are added up in Python.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from inercal.noise.running import cascade, empty_octaves, empty_window, load_kernels, slide

WINDOW = 101
TITLES = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")


def recording(path: Path, rows: int) -> None:
    """Write noise at rest as canonical CSV."""
    x = np.random.default_rng(1).standard_normal((rows, 6)).tolist()
    units = ["m/s^2"] * 3 + ["rad/s"] * 3
    header = ",".join(["t [s]", *(f"{name} [{unit}]" for name, unit in zip(TITLES, units, strict=True))])
    lines = (",".join(map(repr, (i / 100, *row))) for i, row in enumerate(x))
    path.write_text("\n".join([header, *lines]) + "\n")


def calibration(path: Path) -> None:
    """Write a calibration of an instrument without errors."""
    names = [f"{name}_{axis}" for name in ("K1", "S") for axis in "xyz"]
    whole = {
        "command": "calibrate imu",
        "status": {"code": "ok", "message": ""},
        "parameters": [{"name": name, "value": 1.0, "u": 0.1, "unit": "1"} for name in names],
        "covariance": {"names": names, "matrix": [[0.0] * 6] * 6},
        "result": {"unit": {"acc": "m/s^2", "gyro": "rad/s"}},
    }
    path.write_text(json.dumps(whole))


def seconds(folder: Path, log: str, *arguments: str) -> float:
    """Wall time of a command that reads a file as standard input."""
    clock = time.perf_counter()
    with open(folder / log, "rb") as stream:
        command = [sys.executable, "-m", "inercal", *arguments, "--quiet"]
        subprocess.run(command, cwd=folder, stdin=stream, stdout=subprocess.DEVNULL, check=True)
    return time.perf_counter() - clock


def compiled(x: np.ndarray) -> float:
    """Seconds a sample of the kernels."""
    window, octaves = empty_window(WINDOW, x.shape[1]), empty_octaves(x.shape[1])
    clock = time.perf_counter()
    for row in x:
        slide(row, *window)
        cascade(row, *octaves)
    return (time.perf_counter() - clock) / len(x)


def plain(x: np.ndarray) -> float:
    """Seconds a sample of the same in NumPy."""
    window, last = np.zeros((WINDOW, x.shape[1])), [None] * 40
    squares, count = np.zeros((40, x.shape[1])), np.zeros(40, int)
    clock = time.perf_counter()
    for row in x:
        window[:-1] = window[1:]
        window[-1] = row
        window.mean(axis=0), window.var(axis=0, ddof=1)
        cluster, octave = row, 0
        while True:
            before, last[octave] = last[octave], cluster
            if before is not None:
                squares[octave] += (cluster - before) ** 2
            count[octave] += 1
            if count[octave] % 2 == 1:
                break
            cluster, octave = cluster + before, octave + 1
    return (time.perf_counter() - clock) / len(x)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rows", type=int, default=50_000)
    parser.add_argument("--smoke", action="store_true", help="few rows; no timing is to be judged")
    options = parser.parse_args()
    rows = 500 if options.smoke else options.rows

    load_kernels()
    x = np.random.default_rng(1).standard_normal((rows, 6))
    ours, numpy = min(compiled(x) for _ in range(3)), plain(x[: max(500, rows // 10)])
    print(f"{'a step of the monitor, compiled':40s} {1e6 * ours:8.2f} us")
    print(f"{'  plain NumPy':40s} {1e6 * numpy:8.2f} us   ratio {numpy / ours:6.1f}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording(folder / "log.csv", rows)
        recording(folder / "start.csv", 10)
        calibration(folder / "cal.json")
        for words, arguments in (
            ("apply --stream", ["apply", "cal.json", "--stream"]),
            ("  with a checkpoint each 1000 rows", ["apply", "cal.json", "--stream", "--checkpoint", "a"]),
            ("monitor", ["monitor"]),
            ("  with a line each second", ["monitor", "--every", "1 s"]),
        ):
            seconds(folder, "start.csv", *arguments)  # compiles or loads
            Path(folder / "a").unlink(missing_ok=True)
            start = seconds(folder, "start.csv", *arguments)
            Path(folder / "a").unlink(missing_ok=True)
            work = seconds(folder, "log.csv", *arguments) - start
            rate = f"{rows / work:8.0f} lines a second, {1e6 * work / rows:6.1f} us a line"
            print(f"{words:40s} {rate}; start {start:.2f} s")


if __name__ == "__main__":
    main()
