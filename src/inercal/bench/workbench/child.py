"""A command in a process of its own, which ends with the workbench that began it.

    python -m inercal.bench.workbench.child FOLDER ARGUMENTS ...

Standard input is a pipe that the workbench holds: where it closes, as by kill -9, this process ends too. What the
command says on the way goes to ``FOLDER/progress``, its exit code to ``FOLDER/end``, written last.
"""

from __future__ import annotations

import os
import sys
import threading
from pathlib import Path

from inercal.foundation._files import write_text

ABANDONED = 75
"""Exit code of a process whose workbench has gone."""


def _end_with_parent() -> None:
    """Wait for the end of standard input, without its buffer, which Python locks at its own end."""
    while os.read(0, 1 << 16):
        pass
    os._exit(ABANDONED)


def main(folder: Path, arguments: list[str]) -> int:
    """Run a command line and leave its exit code in ``folder``."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ["INERCAL_PROGRESS"] = str(folder / "progress")
    from inercal.cli import run

    code = run(arguments)
    write_text(folder / "end", f"{code}\n")
    return code


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
