"""Do spoiled files ever crash their reader, hang it, or give a number that is another? A campaign of random accidents.

    python benchmarks/spoiled_files.py --runs 3000 --keep spoiled.json [--only "mat v5"]...
    python benchmarks/spoiled_files.py --table spoiled.json
    python benchmarks/spoiled_files.py --case "mat v5" 17

Every case spoils a whole file of one of the formats that are read, in one to three places, with its structure known
(`spoiled/`), and reads it. A few dozen are read in a process of their own under limits. A fault is: a crash or a hang
of that process, 10 s of the processor, 2 GiB of memory, another exception than an error of inercal in one sentence, or
a value that differs from that of a strict parser without a finding. What crashes or hangs a library is read again as a
user would have it read, in a child: this must end in one sentence. Results are kept in docs/design/spoiled-files.md.
"""

import argparse
import json
import os
import platform
import resource
import sys
import tempfile
import time
from collections import Counter
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from spoiled import strict, whole
from spoiled.spoil import spoiled

from inercal.foundation.errors import InercalError, RecordError
from inercal.foundation.records.read import arrays, bags, child, limits
from inercal.foundation.records.read.table import LARGEST

SEED = 20261122
A_CHILD = 40
"""Cases that one process reads."""

MOST_S, MOST_MIB = 10.0, 2048
ON_READING = {"bad_row", "truncated", "nan", "resolution", "file_changed"}
"""Findings on numbers that could not be read, or not be relied on."""

OUTCOMES = (
    "refused",
    "read with findings",
    "read",
    "read, strictly refused",
    "given up by the child",
    "fault",
)


def case(name, number):
    """The bytes of a case."""
    rng = np.random.default_rng([SEED, sorted(whole.FORMATS).index(name), number])
    return spoiled(rng, name, whole.content(name))


def read(name, path, folder):
    """Columns by name and codes of findings of a file, as inercal reads it."""
    if name.startswith("result"):
        from inercal.foundation.results.files import load

        return {"values": load(path).values}, set()
    if name.startswith("xml"):
        from inercal.laboratory.certificate.reading import estimate_of_certificate

        return {"values": estimate_of_certificate(path).values}, set()
    if name == "checkpoint":
        from inercal.faces.stream.checkpoint import load as load_state

        like = {"x": np.zeros(1), "n": 0}
        state = load_state(path, "test", "same", like)
        return {"x": state["x"]}, set()
    if name.startswith("map"):
        from inercal.foundation.records.maps import read_map

        return {"parts": np.array([len(read_map(path).parts)])}, set()
    if name == "yaml":
        from inercal.faces.convert.kalibr import loaded

        loaded(path.read_text(errors="surrogateescape"), path)
        return {}, set()
    from inercal.foundation.records.read import read as read_record

    record_map = None
    if (text := whole.FORMATS[name][2]) is not None:
        record_map = folder / "map.toml"
        record_map.write_text(text)
    record = read_record(path, record_map)
    columns = {each: column.values for each, column in record.columns.items()}
    t = next(iter(record.columns.values())).t
    if all(column.t is t for column in record.columns.values()):
        columns["t"] = t
    return columns, {finding.code for finding in record.findings}


def outcome(name, number, direct):
    """Outcome of a case in a word, and a sentence on it; ``direct``: libraries without a child of their own."""
    began = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    if direct:
        for module in (arrays, bags):
            module.in_child = lambda work, path, progress=lambda _: None: work(progress)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        path = folder / f"a{whole.FORMATS[name][0]}"
        path.write_bytes(case(name, number))
        try:
            columns, codes = read(name, path, folder)
        except InercalError as error:
            said = str(error)
            word = "given up by the child" if "its reader" in said or "was given up" in said else "refused"
            word = "fault" if "\n" in said or "\r" in said or len(said) > 1000 else word
        except Exception as error:
            word, said = "fault", f"{type(error).__name__}: {error}"
        else:
            word, said = _judged(name, path, columns, codes)
    ended = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = sum(
        b.ru_utime + b.ru_stime - a.ru_utime - a.ru_stime for a, b in zip(began, ended, strict=True)
    )
    mebibytes = max(each.ru_maxrss for each in ended) / 1024
    if seconds > MOST_S or mebibytes > MOST_MIB:
        word, said = "fault", f"{seconds:.1f} s, {mebibytes:.0f} MiB ({said})"
    return word, said, seconds


def _judged(name, path, columns, codes):
    """Outcome of a file that was read: no infinity, and the values of a strict parser, or a finding."""
    for each, values in columns.items():
        if each != "values" and np.isinf(values).any():
            return "fault", f"{each} has infinite values"
    if codes & ON_READING:
        return "read with findings", ", ".join(sorted(codes))
    wanted = strict.columns(name, path)
    word = "read with findings" if codes else "read"
    if wanted is None:
        return ("read, strictly refused" if name in STRICT else word), ""
    for each in columns.keys() & wanted.keys():
        theirs = np.asarray(wanted[each], float)
        most = np.inf if each == "values" else LARGEST  # a result says what it says
        theirs = np.where(np.abs(theirs) < most, theirs, np.nan)
        ours = columns[each]
        if each == "t" and "outlying_time" in codes and ours.shape == theirs.shape:
            theirs = np.where(np.isnan(ours), np.nan, theirs)  # wrong stamps, set aside
        if ours.shape != theirs.shape or not np.array_equal(ours, theirs, equal_nan=True):
            same = each == "t" and ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=0, atol=1e-6)
            if not same and not (each == "t" and name.startswith(("tdms", "nc", "h5"))):
                return "fault", f"{each} differs from the strict parser's"
    return word, ", ".join(sorted(codes))


STRICT = set(whole.FORMATS) - {"checkpoint", "map, TOML", "yaml"}
"""Formats with a strict parser."""


def _batch(name, numbers, tell):
    """Outcomes of some cases in this process; the last one told is where it ended, if it did."""
    done = []
    for number in numbers:
        tell(number)
        done.append(outcome(name, number, direct=True))
    return done


def _alone(name, number, _):
    """The outcome of a case as a user would have it."""
    return outcome(name, number, direct=False)


def campaign(name, numbers, said=lambda text: None):
    """Outcomes of cases of a format: how many of each, faults in words, and the longest [s]."""
    counts, faults, longest = Counter(), {}, 0.0
    numbers = list(numbers)
    whole.content(name)
    with tempfile.NamedTemporaryFile() as nothing:
        while numbers:
            batch, at = numbers[:A_CHILD], []
            try:
                done = child.in_child(partial(_batch, name, batch), Path(nothing.name), at.append)
            except (
                RecordError
            ):  # a library fell over a case: those before once more, that one as a user would
                before = batch[: batch.index(at[-1])]
                done = child.in_child(partial(_batch, name, before), Path(nothing.name)) if before else []
                batch = batch[: len(done) + 1]
                try:
                    last = child.in_child(partial(_alone, name, batch[-1]), Path(nothing.name))
                except RecordError as error:
                    last = ("fault", str(error), 0.0)
                word, text, seconds = last
                done.append(("given up by the child" if word == "refused" else word, text, seconds))
            for number, (word, text, seconds) in zip(batch, done, strict=True):
                counts[word] += 1
                longest = max(longest, seconds)
                if word == "fault":
                    faults[number] = text
                    said(f"{name} {number}: {text}")
            numbers = numbers[len(batch) :]
    return counts, faults, longest


def table(kept):
    """A row for each format, in Markdown."""
    lines = [f"| format | {' | '.join(OUTCOMES)} | longest [s] |", f"| --- |{' --- |' * (len(OUTCOMES) + 1)}"]
    for name, (counts, _, longest) in kept["formats"].items():
        cells = " | ".join(str(counts.get(word, 0)) for word in OUTCOMES)
        lines.append(f"| {name} | {cells} | {longest:.1f} |")
    return "\n".join([*lines, "", kept["on"]])


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=3000)
    parser.add_argument("--only", action="append", choices=list(whole.FORMATS))
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--case", nargs=2, metavar=("FORMAT", "NUMBER"))
    asked = parser.parse_args()
    limits.seconds = lambda size: 3  # more would only wait longer for what never ends
    child._PATIENCE = 100  # times that: a campaign runs beside others
    if asked.table:
        print(table(json.loads(asked.table.read_text())))
        return 0
    if asked.case:
        name, number = asked.case[0], int(asked.case[1])
        Path(f"case{whole.FORMATS[name][0]}").write_bytes(case(name, number))
        with tempfile.NamedTemporaryFile() as nothing:
            print(child.in_child(partial(_alone, name, number), Path(nothing.name)))
        return 0
    on = f"Seed {SEED}, {asked.runs} cases each; Python {platform.python_version()}, NumPy {np.__version__}."
    kept = {"on": on, "formats": {}}
    if asked.keep and asked.keep.exists():
        kept = json.loads(asked.keep.read_text())
    for name in asked.only or whole.FORMATS:
        if name in kept["formats"]:
            continue
        began = time.perf_counter()
        kept["formats"][name] = campaign(name, range(asked.runs), lambda text: print(text, flush=True))
        print(
            f"{name}: {dict(kept['formats'][name][0])}, {time.perf_counter() - began:.0f} s", file=sys.stderr
        )
        if asked.keep:
            asked.keep.write_text(json.dumps(kept, indent=1))
    print(table(kept))
    return int(any(faults for _, faults, _ in kept["formats"].values()))


if __name__ == "__main__":
    sys.exit(main())
