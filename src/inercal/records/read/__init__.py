"""Reading: files and a column map in, one `Record` out; each format has a module of its own."""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from inercal.errors import InputError, MapError, RecordError
from inercal.records.checks import check
from inercal.records.read.join import FileTable, join
from inercal.records.read.table import Format, Part
from inercal.records.record import Record, Source
from inercal.units import Unit

if TYPE_CHECKING:
    from inercal.records.maps import RecordMap

#: suffix -> module of this package that reads it
FORMATS = {
    **{
        suffix + packed: "text"
        for suffix in (".csv", ".txt", ".tsv", ".dat", ".log")
        for packed in ("", ".gz")
    },
    ".mat": "mat",
}

_CANONICAL = Part(channels=None)


def read(
    paths: str | Path | Sequence[str | Path],
    record_map: str | Path | RecordMap | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Record:
    """Read one or several files into a record, and say what is suspicious about them.

    Parameters
    ----------
    paths : path or sequence of paths
        Files with distinct channels are parts of one record; each keeps its own time axis, unless the
        stamps are equal. May be empty if the map names its files.
    record_map : path or RecordMap, optional
        Which column is which channel. Without one, text files must have a canonical header such as
        ``t [s],acc_x [m/s^2]``.
    progress : callable, optional
        Called with bytes done and bytes in all.

    Returns
    -------
    Record
        Every row of every file: what could not be read is NaN, and is in ``findings``.

    Raises
    ------
    RecordError
        A file is missing, of no known format, or not readable as numbers.
    MapError
        The map is wrong in itself or does not fit the files.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "still.csv"
    >>> _ = path.write_text("t [s],acc_z [g]\\n0.0,1.001\\n0.1,0.999\\n0.2,1.000\\n")
    >>> read(path)["acc_z"].values
    array([1.001, 0.999, 1.   ])
    """
    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(path) for path in paths]
    if isinstance(record_map, str | Path):
        from inercal.records.maps import read_map

        record_map = read_map(record_map)
    jobs = [(file, _CANONICAL) for file in files] if record_map is None else _assigned(files, record_map)
    if not jobs:
        raise RecordError("record", "found no file to read, expected one at least")
    formats = [format_of(path) for path, _ in jobs]
    sizes = [path.stat().st_size for path, _ in jobs]
    tables = []
    for index, (path, part) in enumerate(jobs):
        told = partial(_tell, progress, sum(sizes[:index]), sum(sizes))
        tables.append(_read_one(formats[index], path, part, told))
    columns = join(tables, record_map)
    if not columns:
        raise RecordError(jobs[0][0], "found a time column alone, expected a channel")
    findings = [
        replace(finding, where=finding.where if len(tables) == 1 else f"{file.path.name}, {finding.where}")
        for file in tables
        for finding in file.table.findings
    ]
    return Record(
        columns,
        (*findings, *check(columns)),
        (*(file.source for file in tables), *(() if record_map is None else (source_of(record_map.path),))),
        next((file.table.labels for file in tables if file.table.labels), ()),
    )


def _assigned(files: Sequence[Path], record_map: RecordMap) -> list[tuple[Path, Part]]:
    """Each file with its part of the map: ``[file.NAME]`` by file name, ``[columns]`` for all others.

    A named file that is not given is looked for beside the map.
    """
    parts = [_without_time(part) if record_map.ignore_time else part for part in record_map.parts]
    named = {Path(part.path).name: part for part in parts if part.name}
    plain = next((part for part in parts if not part.name), None)
    jobs = []
    for file in files:
        part = named.get(file.name, plain)
        if part is None:
            raise RecordError(file, f"not named by {record_map.path}, expected {' or '.join(named)}")
        jobs.append((file, part))
    for part in named.values():
        if not any(job is part for _, job in jobs):
            jobs.append((record_map.path.parent / part.path, part))
    if plain is not None and not any(job is plain for _, job in jobs):
        raise MapError(record_map.path, "columns: found no file they are for, expected one to be given")
    return jobs


def _without_time(part: Part) -> Part:
    """A part whose time column is not to be trusted, and so not to be read."""
    return replace(part, channels=tuple(channel for channel in part.channels or () if channel.name != "t"))


def source_of(path: str | Path) -> Source:
    """A file and the SHA-256 of its bytes; raises `RecordError` where it cannot be read."""
    try:
        with Path(path).open("rb") as file:
            return Source(str(path), hashlib.file_digest(file, "sha256").hexdigest())
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error


def canonical_units(paths: Sequence[Path]) -> dict[str, Unit] | None:
    """Unit of each channel that the headers of the files name; None where one of them needs a map, or is none."""
    from inercal.records.read import text

    try:
        if any(format_of(path) is not text for path in paths):
            return None
        return {channel.name: channel.unit for path in paths for channel in text.header(path)}
    except (InputError, OSError):
        return None


def _read_one(form: Format, path: Path, part: Part, progress: Callable[[int], None]) -> FileTable:
    """The wanted columns of one file, and the hash of its bytes."""
    try:
        table = form.read(path, part.options, part.channels, progress)
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error
    return FileTable(path, source_of(path), part, table)


def _tell(progress: Callable[[int, int], None] | None, before: int, total: int, done: int) -> None:
    """Pass on the bytes done of one file as those of all."""
    if progress is not None:
        progress(before + done, total)


def format_of(path: Path) -> Format:
    """The module that reads a file; raises `RecordError` if there is no such file or none reads its suffix."""
    name = path.name.lower()
    for suffix, module in FORMATS.items():
        if name.endswith(suffix):
            if not path.is_file():
                found = "a folder" if path.is_dir() else "no such file"
                raise RecordError(path, f"found {found}, expected a recording")
            return cast(Format, importlib.import_module(f"{__name__}.{module}"))
    ending = "".join(Path(name).suffixes[-2:]) if name.endswith(".gz") else Path(name).suffix
    raise RecordError(path, f"found the ending {ending or 'none'!r}, expected one of {', '.join(FORMATS)}")
