"""Run a half of the corpus, a line for each protocol, and the totals."""

from __future__ import annotations

import argparse
import contextlib
import glob
import io
import json
import os
import shlex
import tempfile
from collections import Counter
from pathlib import Path

from inercal.cli import run

from .corpus import HALVES, half, made
from .outcome import OUTCOMES, judged


def typed(command):
    """The arguments of a command line as a shell hands them over, without the name of the program."""
    words = []
    for word in shlex.split(command)[1:]:
        words += sorted(glob.glob(word)) or [word] if "*" in word else [word]
    return words


def outcome(case, folder):
    """The outcome of a case in a word, why, and all that was said."""
    said, code, result = io.StringIO(), 0, None
    with contextlib.chdir(folder), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        for k, command in enumerate(case.commands):
            last = k == len(case.commands) - 1
            print("$", command)
            code = run([*typed(command), *(["--out", "result-of-it.json"] if last else [])])
            if code == 2:
                break
    path = Path(folder) / "result-of-it.json"
    if path.exists():
        result = json.loads(path.read_text())
    return (*judged(case, code, result, said.getvalue()), said.getvalue())


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--half", choices=HALVES, required=True)
    parser.add_argument("--only", help="protocols whose name holds this")
    parser.add_argument("--show", action="store_true", help="print what the commands say")
    parser.add_argument("--keep", help="a folder for the files of each protocol")
    asked = parser.parse_args()
    os.environ.setdefault("INERCAL_STORE", str(Path(tempfile.gettempdir()) / "no-store"))
    counts = Counter()
    for name in half(asked.half):
        if asked.only and asked.only not in name:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(asked.keep or scratch) / name
            word, why, said = outcome(made(name, folder), folder)
        counts[word] += 1
        print(f"{name:28} {word:8} {why}", flush=True)
        if asked.show:
            print(said)
    total = sum(counts.values())
    print(f"\n{total} protocols: " + ", ".join(f"{counts[word]} {word}" for word in OUTCOMES))


if __name__ == "__main__":
    main()
