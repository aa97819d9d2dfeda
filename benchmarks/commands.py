"""How long does a user wait? Whole commands on records that ship with inercal, from a cold process to the end.

    python benchmarks/commands.py [--quick]

Kernels are compiled and kept by a first run that is not counted. Beside them `inercal --version`, which is what Python
and the command line take by themselves, and the first angle of a stream of the angle of attack. Times are those of the
processor: what one waits on a machine that does nothing else.
"""

import gzip
import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measure import Row, alone, in_turn, of_processes, row

from inercal.examples import FOLDER

SELFCAL = ("selfcal", str(FOLDER / "selfcal.csv.gz"), "--study", str(FOLDER / "selfcal.toml"), "--quiet")
STREAM = ("aoa", "--stream", "--study", str(FOLDER / "sting.toml"), "--quiet")


def command(*arguments: str) -> list[str]:
    """The words of a process."""
    return [sys.executable, "-m", "inercal", *arguments]


def done(*arguments: str) -> None:
    """Run a command to its end."""
    subprocess.run(command(*arguments), check=True, stdout=subprocess.DEVNULL)


def first_angle(lines: bytes) -> None:
    """Start a stream, feed lines, and read until the first row of angles; the stream is then ended."""
    with subprocess.Popen(command(*STREAM), stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(lines)
        process.stdin.flush()
        title, first = process.stdout.readline(), process.stdout.readline()
        assert title
        assert first
        process.stdin.close()
        process.stdout.read()


def rows(quick: bool) -> list[Row]:
    lines = b"".join(gzip.decompress((FOLDER / "sting.csv.gz").read_bytes()).splitlines(keepends=True)[:2000])
    with tempfile.TemporaryDirectory() as folder:
        report = ("--report", str(Path(folder) / "report.html"))
        works = {"`--version`": lambda: done("--version")}
        if not quick:
            works |= {
                "`selfcal` to the written report": lambda: done(*SELFCAL, *report),
                "`selfcal` without a report": lambda: done(*SELFCAL),
                "`aoa --stream` to its first angle": lambda: first_angle(lines),
            }
        seconds = in_turn(works, 1 if quick else 5, of_processes)
    promised = {"`selfcal` to the written report": 3.0, "`aoa --stream` to its first angle": 2.0}
    return [
        row(
            name,
            "cold process",
            ("s", 1.0),
            each,
            **({"at_most": promised[name]} if name in promised else {}),
        )
        for name, each in seconds.items()
    ]


if __name__ == "__main__":
    alone(rows, __doc__)
