"""Raw binary files: rows of numbers one after the other, as a map describes them (`binary`, `fields`, `transpose`)."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel
from inercal.foundation.records.frames import CounterTurns, Frame, frames_in
from inercal.foundation.records.read.arrays import Contents, held, tables
from inercal.foundation.records.read.limits import check_unpacked, unpacked
from inercal.foundation.records.read.table import FileOptions, RawTable


def read(
    path: Path,
    options: FileOptions,
    channels: tuple[Channel, ...] | None,
    progress: Callable[[int], None],
) -> list[RawTable]:
    """Read the wanted fields; bytes at the end that are no whole row are a finding, and those in no sound frame.

    Raises `RecordError` where there is no whole row.
    """
    raw = path.read_bytes()
    if raw[:2] == b"\x1f\x8b":
        try:
            with gzip.open(path) as file:
                raw = file.read(unpacked(len(raw)) + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise RecordError(path, f"cannot be read as gzip ({error})") from error
        check_unpacked(path, len(raw), path.stat().st_size)
    if options.frame is not None:
        contents = contents_of_frames(raw[options.skip :], options.frame, channels or (), path)
    else:
        contents = contents_of(raw[options.skip :], options, path)
    progress(path.stat().st_size)
    return tables(contents, options, channels or (), path, mapped=True)


def contents_of(raw: bytes, options: FileOptions, path: Path) -> Contents:
    """The fields of rows as a table; of a transposed file each field stands as a whole, one after the other."""
    row = np.dtype([(name, kind) for name, kind in zip(options.fields, options.binary, strict=True)])
    rows, rest = divmod(len(raw), row.itemsize)
    if rows == 0:
        raise RecordError(
            path, f"found {len(raw)} bytes, expected rows of {row.itemsize} bytes, as [file] binary has it"
        )
    columns = {}
    begin = 0
    for name, kind in zip(options.fields, options.binary, strict=True):
        if options.transpose:
            column = np.frombuffer(raw, kind, rows, begin)
            begin += column.nbytes
        else:
            column = np.frombuffer(raw, row, rows)[name]
        columns[name] = held(np.ascontiguousarray(column))
    text = f"the file ends within a row: {rest} bytes left of a row of {row.itemsize}"
    findings = (Finding("truncated", text, f"row {rows + 1}"),) if rest else ()
    return Contents(columns, findings, tabular=True)


def contents_of_frames(raw: bytes, frame: Frame, channels: tuple[Channel, ...], path: Path) -> Contents:
    """The fields of frames as a table; stamps go on where their counter begins anew.

    Raises `RecordError` where there is no frame.
    """
    found = frames_in(raw, frame)
    if not len(found.rows):
        raise RecordError(
            path,
            f"found no frame of {frame.size} bytes in {len(raw)} bytes ({found.damaged} with a wrong check), expected "
            "frames as [file] has them",
        )
    columns = {name: np.ascontiguousarray(found.rows[name]) for name in frame.dtype.names or ()}
    findings = []
    if found.passed_over:
        text = (
            f"{found.passed_over} bytes are in no sound frame; the check of {found.damaged} frames is wrong"
        )
        findings.append(Finding("bad_row", text))
    if frame.counter:
        missing = CounterTurns().on(columns[frame.counter])[0].missing
        if missing:
            findings.append(Finding("gap", f"{missing} frames are missing by their counter {frame.counter}"))
    if rest := len(raw) - found.consumed:
        text = f"the file ends within a frame: {rest} bytes left of a frame of {frame.size}"
        findings.append(Finding("truncated", text, f"row {len(found.rows) + 1}"))
    stamp = next((channel.origin for channel in channels if channel.name == "t"), None)
    if stamp in columns and columns[stamp].dtype.kind == "u":
        columns[stamp] = CounterTurns().on(columns[stamp])[1]
    return Contents({name: held(each) for name, each in columns.items()}, tuple(findings), tabular=True)
