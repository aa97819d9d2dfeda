"""From line in to line out: the time that `aoa --stream` takes at 1 kHz.

    python benchmarks/stream_latency.py [--quick]

The shipped wind-tunnel model, its rows written into the standard input one by one, each at its own time; a thread waits
for the angles. By the clock on the wall, from the row handed to the pipe to its angle read from the other: whoever
writes late does not count. The first two seconds, in which a stream chooses its band, and pages are new, are not in it.
"""

import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import Row, Spread, alone

from inercal.examples import FOLDER
from live import model

WARM = 2000
"""Rows before any counts."""


def latencies(path: Path) -> np.ndarray:
    """Seconds (n,) from each row in to its angle out."""
    header, *lines = path.read_bytes().splitlines(keepends=True)
    command = [sys.executable, "-m", "inercal", "aoa", "--stream", "--quiet"]
    command += ["--study", str(FOLDER / "sting.toml")]
    sent, come = np.full(len(lines), np.nan), np.full(len(lines), np.nan)
    began = threading.Event()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        out = process.stdout.fileno()

        def listen() -> None:
            left = b""
            while data := os.read(out, 1 << 16):
                now = time.monotonic()
                *whole, left = (left + data).split(b"\n")
                for line in whole:
                    began.set()
                    if line[:1].isdigit():
                        come[round(1000.0 * float(line.partition(b",")[0]))] = now

        listening = threading.Thread(target=listen)
        listening.start()
        process.stdin.write(header + lines[0])
        began.wait(60.0)
        start = time.monotonic()
        for k in range(1, len(lines)):
            wait = start + 0.001 * k - time.monotonic()
            if wait > 0.0:
                time.sleep(wait)
            sent[k] = time.monotonic()
            process.stdin.write(lines[k])
        process.stdin.close()
        listening.join()
    return (come - sent)[WARM if len(lines) > 2 * WARM else 1 :]


def rows(quick: bool) -> list[Row]:
    seconds, rounds = (2.0, 1) if quick else (12.0, 3)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        path = model(Path(folder), seconds)
        each = [latencies(path) for _ in range(rounds)]
    for what, share, limit in (("median", 50.0, 0.3), ("99 % within", 99.0, 2.0)):
        ms = sorted(1e3 * float(np.nanpercentile(lag, share)) for lag in each)
        found.append(
            Row(
                f"`aoa --stream`, line in to line out: {what}",
                f"1 kHz, {seconds:g} s",
                "ms",
                Spread(ms[len(ms) // 2], ms[0], ms[-1]),
                at_most=limit,
            )
        )
    lost = float(sum(int(np.isnan(lag).sum()) for lag in each))
    found.append(
        Row("`aoa --stream`: rows without a line", f"1 kHz, {seconds:g} s", "1", Spread(lost, lost, lost))
    )
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
