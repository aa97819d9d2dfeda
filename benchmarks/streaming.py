"""Streams: lines through the commands, and a step of the monitor beside the same in plain NumPy.

    python benchmarks/streaming.py [--quick]

Six channels at 100 Hz. The commands run in processes of their own, from a file to nowhere; their start is taken off by
a run on ten rows in the same round. The plain loop does for each sample what the compiled kernels do, with the window
in an array that is shifted and octaves that are added up in Python.
"""

import gzip
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import Row, alone, in_turn, named, of_processes, row

from inercal.examples import FOLDER
from inercal.foundation.noise.running import cascade, empty_octaves, empty_window, load_kernels, slide

WINDOW = 101
TITLES = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
COMMANDS = {
    "apply --stream": ("apply", "cal.json", "--stream"),
    "apply --stream, a checkpoint each 1000 rows": ("apply", "cal.json", "--stream", "--checkpoint", "state"),
    "monitor": ("monitor",),
    'monitor --every "1 s"': ("monitor", "--every", "1 s"),
}

#: record that ships with inercal -> its streams
SHIPPED = {
    "selfcal": {
        "selfcal --stream": ("selfcal", "--stream"),
        "selfcal --stream --filter svd-qukf": ("selfcal", "--stream", "--filter", "svd-qukf"),
    },
    "sting": {"aoa --stream": ("aoa", "--stream")},
}


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


def lines_through(folder: Path, log: str, arguments: tuple[str, ...]) -> None:
    """A command that reads a file as standard input, to its end."""
    (folder / "state").unlink(missing_ok=True)
    with open(folder / log, "rb") as stream:
        command = [sys.executable, "-m", "inercal", *arguments, "--quiet"]
        subprocess.run(command, cwd=folder, stdin=stream, stdout=subprocess.DEVNULL, check=True)


def compiled(x: np.ndarray) -> None:
    """The kernels over all rows, called once for each."""
    window, octaves = empty_window(WINDOW, x.shape[1]), empty_octaves(x.shape[1])
    for each in x:
        slide(each, *window)
        cascade(each, *octaves)


def plain(x: np.ndarray) -> None:
    """The same in NumPy."""
    window, last = np.zeros((WINDOW, x.shape[1])), [None] * 40
    squares, count = np.zeros((40, x.shape[1])), np.zeros(40, int)
    for each in x:
        window[:-1] = window[1:]
        window[-1] = each
        window.mean(axis=0), window.var(axis=0, ddof=1)
        cluster, octave = each, 0
        while True:
            before, last[octave] = last[octave], cluster
            if before is not None:
                squares[octave] += (cluster - before) ** 2
            count[octave] += 1
            if count[octave] % 2 == 1:
                break
            cluster, octave = cluster + before, octave + 1


def rate_of(folder: Path, what: str, arguments: tuple[str, ...], log: str, n: int, rounds: int) -> list[Row]:
    """Processor time of a line of ``log``, of ``n`` lines, and of the start on ``start.csv``."""
    works = {name: lambda name=name: lines_through(folder, name, arguments) for name in ("start.csv", log)}
    seconds = in_turn(works, rounds, of_processes)
    starts = seconds["start.csv"]
    # a log of few lines may take less than the start varies
    each = [max(b - a, 0.0) / n for a, b in zip(starts, seconds[log], strict=True)]
    return [
        row(f"`{what}`, a line", f"{n} lines", ("µs", 1e6), each),
        row(f"`{what}`, start", "10 lines", ("s", 1.0), starts),
    ]


def platform_and_sting(folder: Path) -> list[Row]:
    """Streams of the records that ship with inercal."""
    found = []
    for name, streams in SHIPPED.items():
        lines = gzip.decompress((FOLDER / f"{name}.csv.gz").read_bytes()).splitlines(keepends=True)
        (folder / f"{name}.csv").write_bytes(b"".join(lines))
        (folder / "start.csv").write_bytes(b"".join(lines[:11]))
        for what, arguments in streams.items():
            told = (*arguments, "--study", str(FOLDER / f"{name}.toml"))
            found += rate_of(folder, what, told, f"{name}.csv", len(lines) - 1, 3)
    return found


def rows(quick: bool) -> list[Row]:
    load_kernels()
    x = np.random.default_rng(1).standard_normal((500 if quick else 5000, 6))
    steps = in_turn({"ours": lambda: compiled(x), "theirs": lambda: plain(x)}, 1 if quick else 7)
    ours, theirs = ([s / len(x) for s in steps[name]] for name in ("ours", "theirs"))
    found = [
        row("Step of the monitor", "6 channels", ("µs", 1e6), ours, named("numpy"), theirs, at_least=5.0)
    ]
    n, commands = (500, list(COMMANDS.items())[:1]) if quick else (20_000, list(COMMANDS.items()))
    with tempfile.TemporaryDirectory() as name:
        found += platform_and_sting(Path(name)) if not quick else []
        folder = Path(name)
        recording(folder / "log.csv", n)
        recording(folder / "start.csv", 10)
        calibration(folder / "cal.json")
        for what, arguments in commands:
            found += rate_of(folder, what, arguments, "log.csv", n, 1 if quick else 3)
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
