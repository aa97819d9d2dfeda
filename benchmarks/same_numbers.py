"""The same numbers before and after: a script of one round of rebuilding, deleted at its end.

    python benchmarks/same_numbers.py make FOLDER [BOOK]
    python benchmarks/same_numbers.py compare BEFORE AFTER [--new-columns]

`make` runs, in this process and with seeds, each shipped example by its command, the platform's by each estimator, the
commands of the book page by page, and the cases of `inercal validate`. It writes what each gave as one JSON file, and
keeps the pages: BOOK, the folder `book` of an earlier FOLDER, runs the commands of that time once more.

`compare` prints what differs, and exits with 1 if anything does. Two results are the same where
- exit code, status, names, units, and the codes, places and harm of the findings are equal;
- values differ by at most 1e-6 of their u, and u by 1e-6 of itself, covariances alike (1e-4 each where a search or a
  restricted likelihood stops by a tolerance; of a case of `validate` its limit is the u; with --new-columns values of a
  platform by 2e-6 u, and all its numbers by 2e-3 where it has harmonics or g-sensitivity);
- other numbers differ by at most ten times as much, relative to themselves or to the largest of their list.
Times, versions, checksums and sentences may differ.
"""

import argparse
import contextlib
import csv
import io
import json
import math
import os
import re
import shlex
import shutil
import sys
import tempfile
import time
import tomllib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from inercal.cli import run
from inercal.examples import EXAMPLES
from inercal.faces.validate.run import SYSTEMS, cases_of
from inercal.systems.selfcal.estimators import KINDS

DOCS = Path(__file__).parents[1] / "docs"

FENCE = re.compile(r"^```(python|console|toml|csv)\n(.*?)^```", re.DOTALL | re.MULTILINE)

#: first words of the commands whose outcome is kept; others of a page are run, for these may need them, but those
#: left out, which serve or take processes of their own
KEPT = (
    "allan", "aoa", "apply", "calibrate", "compare", "design", "history", "inspect", "monitor", "selfcal",
    "sensitivity", "simulate", "temperature",
)  # fmt: skip
LEFT_OUT = ("batch", "completion", "live", "validate", "workbench")

#: commands in which a search or a restricted likelihood stops by a tolerance
SEARCHES = ("aoa", "calibrate", "design", "temperature", "validate")

#: keys of what may differ
FREE = {
    "inercal", "inputs", "message", "model", "provenance", "references", "said", "timing_s", "traceability",
}  # fmt: skip

ROWS = 500
"""Rows of a table that are kept, evenly spread."""

EXACT, SEARCHED, WIDER = 1e-6, 1e-4, 10.0
COLUMNS, COLUMNS_OF_PATTERNS = 2e-6, 2e-3
"""Tolerances, as the docstring above states them."""

SHOWN = 20  # differences of a command
CHECKSUM = re.compile(r"[0-9a-f]{64}")
PATTERNS = re.compile(r"harmonic_|G_[xyz]{2}$")


# -- make


def table(text: str) -> dict[str, list[Any]]:
    """Columns of rows with commas, or of lines."""
    rows = list(csv.reader(io.StringIO(text)))
    rows = [*rows[:1], *rows[1 :: 1 + len(rows) // ROWS]]
    width = max(map(len, rows), default=0)
    return {f"{k}": [number(row[k]) if k < len(row) else "" for row in rows] for k in range(width)}


def number(cell: str) -> float | str:
    """The number in a cell, or its text."""
    try:
        return float(cell)
    except ValueError:
        return cell


def contents(path: Path) -> Any:
    """What a command wrote to a file, as plain objects; nothing of a kind that is not read here."""
    match path.suffix if path.is_file() else "":
        case ".toml":
            return tomllib.loads(path.read_text(encoding="utf-8"))
        case ".csv":
            return table(path.read_text(encoding="utf-8"))
        case ".npz":
            with np.load(path) as arrays:
                flat = {name: np.ravel(arrays[name]) for name in arrays}
            return {name: column[:: 1 + len(column) // ROWS].tolist() for name, column in flat.items()}
    return None


def outcome(words: list[str]) -> dict[str, Any]:
    """Exit code of a command without `inercal`, what it printed, and what it wrote."""
    if "--report" in words:
        at = words.index("--report")
        words = words[:at] + words[at + 2 :]
    if words[0] == "simulate" and "--seed" not in words:
        words = [*words, "--seed", "1"]
    streams = words[0] == "monitor" or "--stream" in words
    words = words if streams else [*words, "--json"]
    printed, said = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(said):
        code = run(words)
    text = printed.getvalue()
    shown = json.loads(text) if text.startswith("{") and not streams else table(text)
    written = contents(Path(words[words.index("--out") + 1])) if "--out" in words else None
    found = {"command": shlex.join(words), "exit": code, "shown": shown, "written": written}
    return found | ({"said": said.getvalue()} if code == 2 else {})


def of_examples() -> Iterator[tuple[str, dict[str, Any]]]:
    """Each shipped example by its command, and the platform's by each estimator."""
    for name, example in EXAMPLES.items():
        quietly(["examples", name, "--out", name])
        words = shlex.split(example.command(name))[1:]
        yield f"example {name}", outcome(words)
        for kind in KINDS if words[0] == "selfcal" else ():
            yield f"example {name} {kind}", outcome([*words, "--filter", kind])


def of_page(page: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """The commands of a page that are kept, after its files are laid out and its Python has run."""
    blocks = FENCE.findall(page.read_text(encoding="utf-8"))
    for language, text in blocks:
        if language in ("toml", "csv") and (named := re.match(r"# ([\w-]+\.(?:toml|csv))\n", text)):
            Path(named[1]).write_text(text, encoding="utf-8")
    code = "\n\n".join(text for language, text in blocks if language == "python")
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(code, page.name, "exec"), {"__name__": "__main__"})
    lines = [line for language, text in blocks if language == "console" for line in text.splitlines()]
    commands = [shlex.split(line, comments=True)[2:] for line in lines if line.startswith("$ inercal ")]
    for k, words in enumerate(words for words in commands if words[0] not in LEFT_OUT):
        if words[0] in KEPT:
            yield f"{page.stem} {k} {words[0]}", outcome(words)
        else:
            quietly(words)


def of_validation() -> Iterator[tuple[str, dict[str, Any]]]:
    """The numbers behind each case of the validation, their limits as u."""
    for system in SYSTEMS:
        cases = {}
        for case in cases_of(system):
            values = np.asarray(case.find(), dtype=float).ravel()
            limits = np.broadcast_to(np.asarray(case.limit, dtype=float).ravel(), values.shape)
            pairs = zip(values.tolist(), limits.tolist(), strict=True)
            cases[case.name] = [{"value": value, "u": limit} for value, limit in pairs]
        yield f"validate {system}", {"command": f"validate {system}", "shown": cases}


def quietly(words: list[str]) -> None:
    """Run a command whose outcome is not kept."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        run(words)


def make(folder: Path, book: Path) -> None:
    """Write the outcome of each command as a JSON file, and the pages from which they are."""
    folder.mkdir(parents=True)
    pages = [page for page in sorted(book.rglob("*.md")) if "\n$ inercal " in page.read_text("utf-8")]
    for page in pages:
        kept = folder / "book" / page.relative_to(book)
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(page, kept)
    for cases in (of_examples(), of_validation(), *map(of_page, pages)):
        began = time.perf_counter()
        name = ""
        with tempfile.TemporaryDirectory() as empty, contextlib.chdir(empty):
            try:
                for name, found in cases:
                    (folder / f"{name}.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
            except Exception as error:  # the other pages are to be tried too
                print(f"after {name!r}: {type(error).__name__}: {error}", file=sys.stderr)
        print(f"{time.perf_counter() - began:6.1f} s  {name}", file=sys.stderr)


# -- compare


def differences(before: Any, after: Any, close: float, where: str, scale: float = 0.0) -> Iterator[str]:
    """Where two plain objects differ: numbers by more than ``close`` of themselves or of ``scale``; values with u,
    these u and covariances by a tenth of that, in terms of u."""
    match before, after:
        case {"value": float(), "u": float()}, {"value": float(), "u": float()} if before["u"] > 0.0:
            for key in ("value", "u"):
                off = abs(after[key] - before[key]) / before["u"]
                if not off <= close / WIDER:
                    yield f"{where}: {key} off by {off:.2g} u"
            yield from differences(rest(before), rest(after), close, where)
        case dict(), dict():
            for key in sorted((before.keys() | after.keys()) - FREE):
                if (key in before) != (key in after):
                    yield f"{where}.{key}: only {'before' if key in before else 'after'}"
                else:
                    pair = arranged(key, before), arranged(key, after)
                    own = close / WIDER if key == "matrix" else close
                    yield from differences(*pair, own, f"{where}.{key}")
        case list(), list():
            if len(before) != len(after):
                yield f"{where}: {len(before)} before, {len(after)} after"
                return
            largest = max((abs(x) for x in before if is_number(x)), default=0.0)
            for k, pair in enumerate(zip(before, after, strict=True)):
                yield from differences(*pair, close, f"{where}[{k}]", largest)
        case str(), str() if not (CHECKSUM.fullmatch(before) and CHECKSUM.fullmatch(after)):
            if before != after and (" " not in before + after or where.endswith(".where")):
                yield f"{where}: {before!r} before, {after!r} after"
        case _ if is_number(before) and is_number(after):
            size = max(abs(before), abs(after), scale)
            alike = before == after or (math.isnan(before) and math.isnan(after))
            if not alike and not abs(after - before) <= close * size:
                yield f"{where}: {before!r} before, {after!r} after"
        case _ if before != after and not (isinstance(before, str) and isinstance(after, str)):
            yield f"{where}: {before!r} before, {after!r} after"


def is_number(x: Any) -> bool:
    """Whether it is one; True and False are none."""
    return isinstance(x, int | float) and not isinstance(x, bool)


def rest(row: dict[str, Any]) -> dict[str, Any]:
    """A row of a value without it and its u, and without U, which follows from u."""
    return {key: item for key, item in row.items() if key not in ("value", "u", "U")}


def arranged(key: str, owner: dict[str, Any]) -> Any:
    """An item as it is compared: findings in one order, covariances as correlations."""
    item = owner[key]
    if key == "findings":
        return sorted(item, key=lambda finding: (finding["code"], str(finding["where"])))
    if key in ("matrix", "common") and item and "names" in owner:
        sd = np.sqrt([row[k] or np.nan for k, row in enumerate(owner["matrix"])])
        return (np.array(item, dtype=float) / np.outer(sd, sd)).tolist()
    return item


def tolerance(case: dict[str, Any], new_columns: bool) -> float:
    """How far the values of a case may be off, in terms of u."""
    words = case["command"].split()
    if words[0] in SEARCHES:
        return SEARCHED
    if new_columns and words[0] == "selfcal":
        names = [row["name"] for row in case["shown"].get("parameters", [])]
        return COLUMNS_OF_PATTERNS if any(map(PATTERNS.match, names)) else COLUMNS
    return EXACT


def compare(folders: list[Path], new_columns: bool) -> int:
    """Print what differs between two folders; the exit code."""
    names = {path.name for folder in folders for path in folder.glob("*.json")}
    count = 0
    for name in sorted(names):
        pair = [folder / name for folder in folders]
        first, second = (json.loads(path.read_text("utf-8")) if path.exists() else None for path in pair)
        if first is None or second is None:
            found = ["only after" if first is None else "only before"]
        else:
            found = list(differences(first, second, WIDER * tolerance(first, new_columns), ""))
        count += bool(found)
        more = [f"and {len(found) - SHOWN} more"] if len(found) > SHOWN else []
        for line in [*found[:SHOWN], *more]:
            print(f"{name.removesuffix('.json')}: {line}")
    print(f"{count} of {len(names)} differ" if count else f"all {len(names)} agree")
    return 1 if count else 0


if __name__ == "__main__":
    os.environ |= {"COLUMNS": "120", "MPLBACKEND": "Agg"}
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = parser.add_subparsers(dest="what", required=True)
    of_make, of_compare = parts.add_parser("make"), parts.add_parser("compare")
    of_make.add_argument("folder", type=Path)
    of_make.add_argument("book", type=Path, nargs="?", default=DOCS)
    of_compare.add_argument("folders", type=Path, nargs=2)
    of_compare.add_argument("--new-columns", action="store_true")
    asked = parser.parse_args()
    if asked.what == "make":
        make(asked.folder.resolve(), asked.book.resolve())
    else:
        sys.exit(compare(asked.folders, asked.new_columns))
