"""Reading: files and a column map in, one `Record` out; each format has a module of its own."""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, cast

from inercal.foundation._files import is_pipe
from inercal.foundation.errors import InputError, MapError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.checks import check
from inercal.foundation.records.read.content import format_by_content, is_json
from inercal.foundation.records.read.join import FileTable, joined
from inercal.foundation.records.read.limits import size_of
from inercal.foundation.records.read.table import FileShare, Format, Reader
from inercal.foundation.records.record import Record
from inercal.foundation.records.stamps import with_sound_stamps
from inercal.foundation.units import Unit

if TYPE_CHECKING:
    from inercal.foundation.records.maps import RecordMap

#: suffix -> module of this package that reads it; a folder that ROS 2 recorded is read as a bag
FORMATS = {
    **{
        suffix + packed: "text"
        for suffix in (".csv", ".txt", ".tsv", ".dat", ".log")
        for packed in ("", ".gz")
    },
    ".mat": "mat",
    **dict.fromkeys((".h5", ".hdf5"), "hdf5"),
    ".nc": "netcdf",
    ".npz": "npz",
    ".parquet": "parquet",
    ".tdms": "tdms",
    ".ulg": "ulog",
    ".bin": "dataflash",
    **dict.fromkeys((".xlsx", ".xlsm", ".xls", ".ods"), "sheets"),
    **dict.fromkeys((".bag", ".mcap", ".db3"), "bags"),
}

_CANONICAL = FileShare(channels=None)


def read(
    paths: str | Path | Sequence[str | Path],
    record_map: str | Path | RecordMap | None = None,
    progress: Callable[[int, int], None] | None = None,
    counted: bool = False,
) -> Record:
    """Read one or several files into a record, and say what is suspicious about them.

    Parameters
    ----------
    paths : path or sequence of paths
        Files with distinct channels are parts of one record; each keeps its own time axis, unless the
        stamps are equal. So do columns of one file on clocks of their own, as in TDMS and HDF5. May be
        empty if the map names its files.
    record_map : path or RecordMap, optional
        Which column is which channel. Without one, a file must say so itself: a canonical header such as
        ``t [s],acc_x [m/s^2]``, arrays of such names or with units beside them, or one topic of
        `sensor_msgs/Imu`.
    progress : callable, optional
        Called with bytes done and bytes in all.
    counted : bool
        Rows need no times and are then counted 0, 1, 2, ...: means of poses.

    Returns
    -------
    Record
        Every row of every file: what could not be read, and time stamps that are wrong, are NaN, and in ``findings``.

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
    tables, record_map = _tables(paths, record_map, progress)
    return _record(tables, record_map, counted)


def read_runs(
    paths: str | Path | Sequence[str | Path],
    record_map: str | Path | RecordMap | None = None,
    progress: Callable[[int, int], None] | None = None,
    counted: bool = False,
) -> list[Record]:
    """Read the records of one or several runs of a test: files with the same channels are repeat runs.

    A file belongs to the first run that has none of its channels yet, so that ``acc1 gyro1 acc2 gyro2`` and
    ``acc1 acc2 gyro1 gyro2`` are two runs alike. Parameters and errors are those of `read`; the same file twice is an
    error too.
    """
    given = [paths] if isinstance(paths, str | Path) else paths
    for index, path in enumerate(given):
        if Path(path).resolve() in (Path(other).resolve() for other in given[:index]):
            raise RecordError(path, "found it given twice, expected each run once")
    tables, record_map = _tables(paths, record_map, progress)
    return [_record(run, record_map, counted) for run in _runs(tables)]


def _runs(tables: Sequence[FileTable]) -> list[list[FileTable]]:
    """The tables of each run; raises `RecordError` where one file stands for two."""
    files: dict[Source, list[FileTable]] = {}
    for file in tables:
        files.setdefault(file.source, []).append(file)
    runs: list[tuple[set[str], list[FileTable]]] = []
    for source, own in files.items():
        channels = _channels(own)
        run = next((run for run in runs if not run[0] & channels), None)
        if run is None:
            run = (set(), [])
            runs.append(run)
        twin = next((other for other in files if other.sha256 == source.sha256 and other is not source), None)
        if twin is not None and channels & _channels(files[twin]):
            raise RecordError(source.path, f"holds the same as {twin.path}, expected each run once")
        run[0].update(channels)
        run[1].extend(own)
    return [own for _, own in runs]


def _channels(tables: Sequence[FileTable]) -> set[str]:
    """The channels of tables, apart from the time."""
    return {channel.name for file in tables for channel in file.table.channels} - {"t"}


def _tables(
    paths: str | Path | Sequence[str | Path],
    record_map: str | Path | RecordMap | None,
    progress: Callable[[int, int], None] | None,
) -> tuple[list[FileTable], RecordMap | None]:
    """The tables of all files in order, and the map read."""
    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(path) for path in paths]
    if isinstance(record_map, str | Path):
        from inercal.foundation.records.maps import read_map

        record_map = read_map(record_map)
    jobs = [(file, _CANONICAL) for file in files] if record_map is None else _assigned(files, record_map)
    if not jobs:
        raise RecordError("record", "found no file to read, expected one at least")
    formats = [_form(path, part) for path, part in jobs]
    sizes = [size_of(path) for path, _ in jobs]
    tables: list[FileTable] = []
    for index, (path, part) in enumerate(jobs):
        share = partial(_tell, progress, sum(sizes[:index]), sum(sizes))
        tables += _read_one(formats[index], path, part, share)
    return tables, record_map


def _record(tables: Sequence[FileTable], record_map: RecordMap | None, counted: bool) -> Record:
    """The record of tables that belong together."""
    columns, of_time = with_sound_stamps(joined(tables, record_map, counted))
    sources = [
        *(file.source for file in tables),
        *([] if record_map is None or not record_map.written else [source_of(record_map.path)]),
    ]
    if not columns:
        raise RecordError(tables[0].path, "found a time column alone, expected a channel")
    several = len({file.path for file in tables}) > 1
    findings = dict.fromkeys(
        replace(finding, where=f"{file.path.name}, {finding.where}" if several else finding.where)
        for file in tables
        for finding in file.table.findings
    )
    stamped = any("t" in file.table.values for file in tables)
    return Record(
        columns,
        (*findings, *of_time, *check(columns)),
        tuple(dict.fromkeys(sources)),
        next((file.table.labels for file in tables if file.table.labels), ()),
        rate_u=None if record_map is None or record_map.rate is None or stamped else record_map.rate_u,
        taken={} if record_map is None else record_map.taken,
    )


def _assigned(files: Sequence[Path], record_map: RecordMap) -> list[tuple[Path, FileShare]]:
    """Each file with its part of the map: ``[file.NAME]`` by file name, ``[columns]`` for all others.

    A named file that is not given is looked for beside the map.
    """
    parts = [_without_time(part) if record_map.ignore_time else part for part in record_map.parts]
    named = [part for part in parts if part.name]
    plain = next((part for part in parts if not part.name), None)
    jobs: list[tuple[Path, FileShare]] = []
    for file in files:
        its_own = [part for part in named if Path(part.path).name == file.name]
        its_own = its_own or ([] if plain is None else [plain])
        if not its_own:
            names = " or ".join(dict.fromkeys(Path(part.path).name for part in named))
            raise RecordError(file, f"not named by {record_map.path}, expected {names}")
        jobs += [(file, part) for part in its_own]
    for part in named:
        if not any(job is part for _, job in jobs):
            jobs.append((record_map.path.parent / part.path, part))
    if plain is not None and not any(job is plain for _, job in jobs):
        raise MapError(record_map.path, "columns: found no file they are for, expected one to be given")
    return jobs


def files_named(files: Sequence[Path], record_map: RecordMap) -> tuple[Path, ...]:
    """The files that are read by a map: those given, and those that it names; raises `RecordError` or `MapError`."""
    return tuple(path for path, _ in _assigned(files, record_map))


def _without_time(part: FileShare) -> FileShare:
    """A part whose time column is not to be trusted, and so not to be read."""
    return replace(part, channels=tuple(channel for channel in part.channels or () if channel.name != "t"))


def source_of(path: str | Path) -> Source:
    """A file, or the files of a folder in order, and the SHA-256 of the bytes; raises `RecordError`."""
    digest = hashlib.sha256()
    try:
        for name in _files(Path(path)):
            with name.open("rb") as file:
                while piece := file.read(1 << 20):
                    digest.update(piece)
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error
    return Source(str(path), digest.hexdigest())


def _files(path: Path) -> list[Path]:
    """The file, or those of a folder in the order of their names."""
    return sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]


def canonical_units(paths: Sequence[Path]) -> dict[str, Unit] | None:
    """Unit of each channel that the files themselves name; None where one of them needs a map, or is none."""
    try:
        return {channel.name: channel.unit for path in paths for channel in format_of(path).header(path)}
    except (InputError, OSError):
        return None


def _read_one(form: Reader, path: Path, part: FileShare, progress: Callable[[int], None]) -> list[FileTable]:
    """The wanted columns of one file, a table for each clock, and the hash of its bytes."""
    try:
        before = _state(path)
        tables = form.read(path, part.options, part.channels, progress)
        source = source_of(path)
        changed = _state(path) != before
    except OSError as error:
        raise RecordError(path, f"cannot be read ({error.strerror or error})") from error
    if changed:
        finding = Finding(
            "file_changed", "the file was written to while it was read: the checksum is not of its rows"
        )
        tables = [replace(table, findings=(*table.findings, finding)) for table in tables]
    return [FileTable(path, source, part, table) for table in tables]


def _state(path: Path) -> list[tuple[int, int]]:
    """Size and time of the last change of a file, or of those of a folder."""
    return [(file.stat().st_size, file.stat().st_mtime_ns) for file in _files(path)]


def _tell(progress: Callable[[int, int], None] | None, before: int, total: int, done: int) -> None:
    """Pass on the bytes done of one file as those of all."""
    if progress is not None:
        progress(before + done, total)


def _form(path: Path, part: FileShare) -> Reader:
    """The module that reads a file as its part of the map says; raises `RecordError` if there is none."""
    if not part.options.binary:
        return format_of(path)
    if not path.is_file():
        raise RecordError(path, "found no such file, expected a recording")
    return _module("binary")


def format_of(path: Path) -> Format:
    """The module that reads a file, by its ending, else by its content; raises `RecordError` if there is none."""
    if (path / "metadata.yaml").is_file():
        return _module("bags")
    name = path.name.lower()
    for suffix, module in FORMATS.items():
        if name.endswith(suffix):
            if not path.is_file():
                there = "a pipe or a device" if is_pipe(path) else "no such file"
                kind = "a folder" if path.is_dir() else there
                raise RecordError(path, f"found {kind}, expected a recording in a file")
            return _module("json_arrays" if module == "text" and is_json(path) else module)
    if path.is_dir():
        raise RecordError(
            path, "is a folder without metadata.yaml (a ROS 2 bag has one), expected a recording"
        )
    if not path.is_file():
        raise RecordError(
            path, f"found {'a pipe or a device' if is_pipe(path) else 'no such file'}, expected a recording"
        )
    return _module(format_by_content(path))


def _module(name: str) -> Format:
    """A module of this package, loaded only now."""
    return cast(Format, importlib.import_module(f"{__name__}.{name}"))
