"""Notes the types with which entries are called, and adds them to the table of signatures.

    python kernels/note.py COMMAND ...        # a line of the program, such as "selfcal log.csv --study study.toml"
    python kernels/note.py --pytest WORD ...  # tests, in this process

numba compiles what is called meanwhile.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from pathlib import Path
from typing import Any

os.environ["INERCAL_KERNELS"] = "numba"

from entries import Sources
from inercal.foundation import _jit

TABLE = Path(__file__).with_name("signatures.json")

ENTRIES = {".".join(name) for name in Sources().entries}
NOTED: dict[str, set[str]] = {}


def noting(function: Any, *options: Any) -> Any:
    """A dispatcher of numba that notes what Python calls it with; calls among kernels do not pass here."""
    dispatcher, name = JITTED(function, *options), f"{function.__module__}.{function.__name__}"
    if name in ENTRIES:
        of = type(dispatcher)

        def noted(self: Any, *arguments: Any) -> Any:
            NOTED.setdefault(name, set()).add(_jit.types_of(arguments))
            return of.__call__(self, *arguments)

        dispatcher.__class__ = type("Noting", (of,), {"__call__": noted, "__slots__": ()})
    return dispatcher


JITTED, _jit._jitted = _jit._jitted, noting  # type: ignore[assignment]


def merged(signatures: set[str]) -> list[str]:
    """Signatures, in order; where one is noted with an array that cannot be written, it holds for those that can be."""
    of_same: dict[str, list[str]] = {}
    for signature in sorted(signatures):
        of_same.setdefault(signature.replace("R", ""), []).append(signature)
    return [_readable(same) for _, same in sorted(of_same.items())]


def _readable(same: list[str]) -> str:
    """Signatures that differ by R alone in one, which has an R wherever one of them has it."""
    rows = [re.findall(r"[dqwQB?x]\d[FA]?R?|.", signature) for signature in same]
    return "".join(max(letters, key=len) for letters in zip(*rows, strict=True))


def main(words: list[str]) -> None:
    """Run the commands or tests, and write the table."""
    if words[0] == "--pytest":
        import pytest

        pytest.main(words[1:])
    else:
        from inercal.cli import run

        for line in words:
            print(f"{line}: {run(shlex.split(line))}", file=sys.stderr)
    table: dict[str, list[str]] = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    rows = {name: merged(NOTED.get(name, set()) | set(table.get(name, ()))) for name in sorted(ENTRIES)}
    TABLE.write_text(json.dumps(rows, indent=1) + "\n")
    print("without a signature:", *(name for name, found in rows.items() if not found), file=sys.stderr)


if __name__ == "__main__":
    main(sys.argv[1:])
