"""TDMS files of LabVIEW and its kin, through npTDMS; only the wanted channels are read."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import MissingExtraError
from inercal.foundation.findings import Finding
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray


def _library(_: Path) -> tuple[Any, Any]:
    """The parts of npTDMS that are used; raises `MissingExtraError`."""
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError as error:
        raise MissingExtraError("Reading TDMS files", "files") from error
    return TdmsFile, log_manager


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The channels as ``"Group/Channel"``, with their units; waveforms have a clock, ``"Group/waveform time"``.

    Where the waveforms state when they began, times count from the first of them.
    """
    TdmsFile, log_manager = _library(path)
    log_manager.set_level(logging.ERROR)  # what it warns of becomes a finding
    with path.open("rb") as stream, TdmsFile.open(stream, raw_timestamps=True) as file:
        channels = [channel for group in file.groups() for channel in group.channels() if len(channel)]
        begun = min((start for channel in channels if (start := _start(channel)) is not None), default=0)
        clocks: dict[tuple[Any, ...], str] = {}
        arrays: dict[str, NamedArray] = {}
        for channel in channels:
            text = channel.dtype.kind == "O"
            if not text and channel.dtype.kind not in "fiubM":
                continue
            clock = None
            if waveform := _waveform(channel, begun):
                clock = clocks.setdefault(waveform, _free(f"{channel.group_name}/waveform time", clocks))
                arrays.setdefault(clock, NamedArray(len(channel), 1, partial(_times, waveform), unit="s"))
            name = f"{channel.group_name}/{channel.name}"
            unit = "s" if channel.dtype.kind == "M" else channel.properties.get("unit_string") or None
            arrays[name] = NamedArray(len(channel), 1, partial(_column, channel), text, unit, clock)
        cut = file.file_status.incomplete_final_segment
        findings = (Finding("truncated", "the file ends within a segment"),) if cut else ()
        yield Contents(arrays, findings)


def _start(channel: Any) -> int | None:
    """When a waveform began, in 2^-64 s since 1904; None where that is not said, or as zero."""
    start = channel.properties.get("wf_start_time") if channel.properties.get("wf_increment") else None
    return (int(start.seconds) << 64) + int(start.second_fractions) or None if start is not None else None


def _waveform(channel: Any, begun: int) -> tuple[str, float, float, int] | None:
    """Group, first time [s], interval [s] and number of samples of a waveform; None for other channels."""
    increment = float(channel.properties.get("wf_increment") or 0.0)
    if not increment > 0.0:
        return None
    start = _start(channel)
    late = 0.0 if start is None else (start - begun) / 2**64
    first = late + float(channel.properties.get("wf_start_offset") or 0.0)
    return channel.group_name, round(first, 9), increment, len(channel)


def _free(name: str, clocks: Mapping[tuple[Any, ...], str]) -> str:
    """The name, numbered if another clock has it."""
    return name if name not in clocks.values() else f"{name} {len(clocks) + 1}"


def _times(waveform: tuple[str, float, float, int], column: int) -> NDArray[Any]:
    """The stamps [s] of a waveform."""
    first, increment, count = waveform[1:]
    return first + increment * np.arange(count)


def _column(channel: Any, _: int) -> NDArray[Any]:
    """The values of a channel, scaled as the file says."""
    values = channel[:]
    numbers: NDArray[Any] = values.as_datetime64("ns") if channel.dtype.kind == "M" else values
    return numbers


_FORMAT = ArrayFormat("a TDMS file", _opened, _library)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
