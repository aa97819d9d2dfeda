"""ArduPilot's dataflash logs (.bin): messages that describe themselves, with their units and multipliers.

Source: ArduPilot, "Logging" (libraries/AP_Logger): messages FMT, FMTU, UNIT and MULT.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray
from inercal.foundation.records.read.content import binary

_SYNC = b"\xa3\x95"
_HEAD = 3  # two bytes of synchronisation and the type of the message
_FMT, _FMT_LENGTH = 128, 89
_AT_ONCE = 1 << 16  # messages whose bytes are gathered at a time
_NAME = re.compile(r"\w+", re.ASCII)
#: character of a field -> its type in NumPy, and the factor that the character means
_FIELDS = {
    "a": ("(32,)<i2", 1.0), "b": ("<i1", 1.0), "B": ("<u1", 1.0), "h": ("<i2", 1.0), "H": ("<u2", 1.0),
    "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0), "n": ("S4", 1.0),
    "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 0.01), "C": ("<u2", 0.01), "e": ("<i4", 0.01),
    "E": ("<u4", 0.01), "L": ("<i4", 1e-7), "M": ("<u1", 1.0), "q": ("<i8", 1.0), "Q": ("<u8", 1.0),
}  # fmt: skip
#: how the log writes units -> how they are written here
_UNITS = {"m/s/s": "m/s^2", "degheading": "deg", "deglatitude": "deg", "deglongitude": "deg"}
#: characters whose factor the multiplier of the field repeats
_SCALED = "cCeEL"
_INSTANCE = "#"


@dataclass(frozen=True)
class _Kind:
    """A kind of message: its name, length in bytes, and fields with the characters of their types."""

    name: str
    length: int
    characters: str
    fields: tuple[str, ...]

    @property
    def dtype(self) -> np.dtype[Any]:
        """The type of NumPy of a whole message; raises `ValueError` where fields and length do not fit."""
        types = [
            (field, _FIELDS[character][0])
            for field, character in zip(self.fields, self.characters, strict=True)
        ]
        dtype = np.dtype([("_head", f"V{_HEAD}"), *types])
        if dtype.itemsize != self.length:
            raise ValueError(f"message {self.name} has {self.length} bytes, its fields {dtype.itemsize}")
        return dtype


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The fields by message, as ``"IMU/AccX"``; of a message with instances as ``"IMU[0]/AccX"``."""
    data = path.read_bytes()
    if not data.startswith(_SYNC):
        raise RecordError(path, binary(data.find(0)))
    kinds, places, lost = _messages(data)
    rows = {kind: _rows(data, kinds[kind], starts) for kind, starts in places.items()}
    units = _units(kinds, rows)
    arrays: dict[str, NamedArray] = {}
    for number, messages in rows.items():
        arrays |= _arrays(kinds[number], messages, units.get(number, {}))
    yield Contents(arrays, lost)


def _messages(data: bytes) -> tuple[dict[int, _Kind], dict[int, list[int]], tuple[Finding, ...]]:
    """Kinds of messages by number, where messages of each begin, and findings on bytes that are no message."""
    kinds = {_FMT: _Kind("FMT", _FMT_LENGTH, "BBnNZ", ("Type", "Length", "Name", "Format", "Columns"))}
    lengths = {_FMT: _FMT_LENGTH}
    places: dict[int, list[int]] = {}
    at, end, strange = 0, len(data), 0
    while at + _HEAD <= end:
        number = data[at + 2]
        length = lengths.get(number)
        if data[at : at + 2] != _SYNC or length is None:
            following = data.find(_SYNC, at + 1)
            following = end if following < 0 else following
            strange += following - at
            at = following
            continue
        if at + length > end:
            break
        if number == _FMT:
            kind = _kind(data[at + _HEAD : at + length])
            if kind is not None:
                kinds[kind[0]], lengths[kind[0]] = kind[1], kind[1].length
        places.setdefault(number, []).append(at)
        at += length
    findings = []
    if strange:
        findings.append(
            Finding("bad_row", f"{strange} bytes between the messages are none, and were passed over")
        )
    if at < end:
        findings.append(Finding("truncated", "the file ends within a message"))
    return kinds, places, tuple(findings)


def _kind(body: bytes) -> tuple[int, _Kind] | None:
    """Number and kind that an FMT message declares; None where names are none, or fields do not fill its length."""
    number, length, name, characters, columns = struct.unpack("<BB4s16s64s", body)
    kind = _Kind(_text(name), length, _text(characters), tuple(filter(None, _text(columns).split(","))))
    named = all(map(_NAME.fullmatch, (kind.name, *kind.fields)))
    try:
        return (number, kind) if number != _FMT and named and kind.dtype else None
    except (ValueError, KeyError):
        return None


def _rows(data: bytes, kind: _Kind, starts: list[int]) -> NDArray[Any]:
    """The messages of one kind (n,), with its fields."""
    raw, within = np.frombuffer(data, np.uint8), np.arange(kind.length)
    pieces = [starts[k : k + _AT_ONCE] for k in range(0, len(starts), _AT_ONCE)]
    return np.concatenate([raw[np.add.outer(piece, within)].view(kind.dtype)[:, 0] for piece in pieces])


def _units(
    kinds: Mapping[int, _Kind], rows: Mapping[int, NDArray[Any]]
) -> dict[int, dict[str, tuple[str, float]]]:
    """Unit and multiplier of the fields by kind of message, as the log states them; ``#`` marks an instance."""
    number = {kind.name: number for number, kind in kinds.items()}

    def said(name: str) -> NDArray[Any]:
        return rows.get(number.get(name, -1), np.empty(0))

    labels = {chr(row["Id"]): _text(row["Label"]) for row in said("UNIT")}
    factors = {chr(row["Id"]): float(row["Mult"]) for row in said("MULT")}
    found: dict[int, dict[str, tuple[str, float]]] = {}
    for row in said("FMTU"):
        kind = kinds.get(int(row["FmtType"]))
        if kind is None:
            continue
        ids = (_text(row["UnitIds"]), _text(row["MultIds"]))
        found[int(row["FmtType"])] = {
            field: (_INSTANCE if unit == _INSTANCE else labels.get(unit, ""), factors.get(factor, 1.0) or 1.0)
            for field, unit, factor in zip(kind.fields, *ids, strict=False)
        }
    return found


def _arrays(
    kind: _Kind, messages: NDArray[Any], units: Mapping[str, tuple[str, float]]
) -> dict[str, NamedArray]:
    """The fields of messages of one kind, for each instance apart; the clock is TimeUS."""
    instance = next((field for field, (unit, _) in units.items() if unit == _INSTANCE), None)
    if instance is None and "I" in kind.fields:
        instance = "I"
    if instance is None:
        parts = {kind.name: np.arange(len(messages))}
    else:
        numbers = messages[instance]
        parts = {f"{kind.name}[{value}]": np.flatnonzero(numbers == value) for value in np.unique(numbers)}
    arrays = {}
    for name, chosen in parts.items():
        clock = f"{name}/TimeUS" if "TimeUS" in kind.fields else None
        for field, character in zip(kind.fields, kind.characters, strict=True):
            if field == instance or character == "a":
                continue
            unit, factor = units.get(field, ("", 1.0))
            factor = _FIELDS[character][1] * (1.0 if character in _SCALED else factor)
            unit, factor = ("us", 1.0) if field == "TimeUS" else (_UNITS.get(unit, unit), factor)
            own = None if field == "TimeUS" else clock
            load = cache(partial(_column, messages, chosen, field, factor))
            arrays[f"{name}/{field}"] = NamedArray(
                len(chosen), 1, load, character in "nNZ", unit or None, own
            )
    return arrays


def _column(
    messages: NDArray[Any], chosen: NDArray[np.intp], field: str, factor: float, _: int
) -> NDArray[Any]:
    """A field of the chosen messages, scaled."""
    values = messages[field][chosen]
    return values if factor == 1.0 or values.dtype.kind == "S" else values.astype(np.float64) * factor


def _text(padded: bytes | np.bytes_) -> str:
    """Text that zero bytes fill up."""
    return bytes(padded).split(b"\0")[0].decode("latin-1").strip()


_FORMAT = ArrayFormat("a dataflash log", _opened)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
