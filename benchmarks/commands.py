"""How long does a user wait? Whole commands on records that ship with inercal, from a cold process to the end.

    python benchmarks/commands.py [--quick]

Kernels are compiled and kept by a first run that is not counted. Beside them `inercal --version`, which is what Python
and the command line take by themselves, and the first angle of a stream of the angle of attack; and a long record of a
model with points, report and result, with the largest memory of a process. Times are those of the processor: what one
waits on a machine that does nothing else.
"""

import gzip
import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measure import Row, alone, in_turn, of_processes, row, spread

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


def memory_of(words: list[str]) -> float:
    """Run a process to its end: its largest memory [MiB]."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL)
    _, process.returncode, used = os.wait4(process.pid, 0)
    assert process.returncode == 0
    return used.ru_maxrss / 1024.0


def long_records(quick: bool) -> list[Row]:
    """A model at 1 kHz that goes from pause to pause, of a record as text: the causal fusion, and the smoothed one."""
    pauses, rounds = (3, 1) if quick else (100, 3)
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        record, study = str(folder / "model.csv"), str(folder / "aoa.toml")
        done("new", "aoa", "--out", study, "--quiet", "--set", "site.gravity=9.80665 m/s^2")
        steps = {
            "first": "0 deg",
            "last": f"{pauses} deg",
            "step": "1 deg",
            "pause": "4.44 s",
            "move": "1.5 s",
        }
        keys = [f"motion.{key}={value}" for key, value in ({"kind": "pitch-pause"} | steps).items()]
        done(
            "simulate",
            "aoa",
            study,
            *(word for key in keys for word in ("--set", key)),
            "--out",
            record,
            "--quiet",
        )
        lines = [line.rsplit(",", 1)[0] for line in Path(record).read_text(encoding="utf-8").splitlines()]
        Path(record).write_text("\n".join(lines) + "\n", encoding="utf-8")  # a tunnel has no reference angle
        size = f"{len(lines) - 1} rows"
        files = ("--out", str(folder / "points.csv"), "--report", str(folder / "report.html"), "--quiet")
        for how, limit in (((), 7.0), (("--smooth",), 10.0)):
            words = ("aoa", record, "--study", study, "--points", *how, *files)
            what = "`" + " ".join(("aoa --points", *how)) + "` with report"
            seconds = in_turn({what: lambda words=words: done(*words)}, rounds, of_processes)[what]
            found.append(row(what, size, ("s", 1.0), seconds, at_most=limit))
            found.append(Row(f"{what}, memory", size, "MiB", spread([memory_of(command(*words))])))
    return found


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
    return long_records(quick) + [
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
