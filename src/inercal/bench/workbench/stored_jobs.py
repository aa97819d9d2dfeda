"""The command line of a job that was found in a work folder, where anybody may have written it.

A workbench that begins anew runs what waits there, and what its pages ask for again. It holds such a line against the
lists of `inercal.cli.stored_line`, and against the work folder: files come from there, and go to the folder of the job.
"""

from __future__ import annotations

import os
from pathlib import Path

from inercal.bench.workbench.sessions import PART
from inercal.cli.stored_line import stored_line
from inercal.foundation.errors import InputError
from inercal.laboratory.again import LaidOut


def check_stored(arguments: tuple[str, ...], where: Path, work: Path, own: Path) -> None:
    """Refuse what is not of this work folder; raises `InputError`, naming the word.

    ``where`` the command is run, ``work`` is the work folder, ``own`` that of the job.
    """
    line = stored_line(list(arguments))
    inside, files = _is_inside(where, work), {}
    for name, values in line.given.items():
        use = line.use(name)
        if use == "dropped" and name not in ("--json", "--quiet"):
            raise InputError(
                name, "found in a job of an earlier workbench, expected options that only compute"
            )
        for value in values:
            if use == "below" and not _is_inside(where / value, own):
                raise InputError(value, "lies outside the folder of the job, expected a file in it")
            if use == "file":
                inside = inside and _is_inside(where / str(value), work)
                files[os.path.normpath(str(value))] = os.path.normpath(str(value))
            if not inside:
                raise InputError(value, "lies outside the work folder, expected a file in it")
    if any(path.suffix != PART for path in where.glob(".*")):
        raise InputError(where, "holds a hidden file, as settings of other programs are, expected none")
    line.check_named(LaidOut(work.resolve(), where, files))


def _is_inside(path: Path, folder: Path) -> bool:
    """True for a place in a folder, links followed."""
    return path.resolve().is_relative_to(folder.resolve())
