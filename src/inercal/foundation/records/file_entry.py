"""``[file]`` of a column map: how the files are laid out."""

from __future__ import annotations

import re
from typing import Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from inercal.foundation._toml import Strict
from inercal.foundation.errors import InputError
from inercal.foundation.records.checksums import CHECKS, NONE
from inercal.foundation.records.frames import Frame
from inercal.foundation.records.read.rewriting import PLACE
from inercal.foundation.records.read.table import FileOptions
from inercal.foundation.units import shown


def _refusal(message: str) -> PydanticCustomError:
    """An error that `inercal.foundation._toml.check` reports in just these words, after the dotted key."""
    return PydanticCustomError("refused", "refused", {"error": InputError("", message)})


class FileEntry(Strict):
    """``[file]``: how the files are laid out; what is left out is found out."""

    delimiter: str | None = Field(default=None, description="what parts the fields; found out if absent")
    decimal: Literal[".", ","] | None = Field(default=None, description="decimal mark; found out if absent")
    comment: str | None = Field(
        default=None, description="what begins a line that is passed over; # and % if absent"
    )
    skip: int = Field(
        default=0, ge=0, description="lines before the header or the numbers; bytes of a binary file"
    )
    lines: Literal["json", "documents"] | None = Field(
        default=None,
        description="what stands in the lines of a text: an object of JSON each, or documents between lines ---; "
        "`from` names a number by its names, joined by points",
    )
    message: str | None = Field(
        default=None,
        min_length=1,
        description="word with which the lines to read begin, of a text with several kinds; it is column 0",
        examples=["IMU"],
    )
    pattern: list[str] = Field(
        default=[],
        description="lines with words before numbers: the words, with {} for each number; several make a row",
        examples=[["Acc: {}, {}, {} Gyro: {}, {}, {}"]],
    )
    variable: str | None = Field(
        default=None, description="variable, group or topic that holds the columns, where a file has several"
    )
    transpose: bool = Field(
        default=False, description="the file lies on its side: its rows are channels, as of a 3 x n array"
    )
    binary: str | list[str] | None = Field(
        default=None,
        description="type of the numbers of a raw binary file, or of each field: byte order < (little) or >, kind f, i "
        "or u, and bytes",
        examples=["<f4", [">u4", "<i2"]],
    )
    fields: list[str] = Field(
        default=[], description="names of the numbers of each row of a raw binary file, for `from`",
        examples=[["t", "gyro_x", "gyro_y", "gyro_z"]],
    )  # fmt: skip
    sync: str | None = Field(
        default=None,
        description="bytes in hexadecimal with which each row of a raw binary file begins, which is then a frame",
        examples=["AA 55"],
    )
    check: str | None = Field(
        default=None, description="check at the end of a frame, by name", examples=["crc-16/modbus"]
    )
    check_begin: int = Field(
        default=0, ge=0, description="byte of a frame, from 0, with which its check begins"
    )
    check_order: Literal["<", ">"] = Field(
        default="<", description="byte order of the check: < (little) or >"
    )
    length: int | None = Field(
        default=None, gt=0, le=65536,
        description="bytes of a whole frame, where some between the fields and the check are of no use",
    )  # fmt: skip
    counter: str | None = Field(
        default=None,
        description="field that goes up by one from frame to frame, which tells of those that are missing",
    )

    @field_validator("binary")
    @classmethod
    def _is_binary(cls, value: str | list[str] | None) -> str | list[str] | None:
        """Types of numbers, the byte order stated; bytes of no use in a list."""
        for each in [value] if isinstance(value, str) else value or ():
            unused = isinstance(value, list) and re.fullmatch(r"x[1-9]\d{0,3}", each)
            if not unused and not re.fullmatch(r"[<>](f[48]|[iu][248])|[iu]1", each):
                raise ValueError(f'expected a type such as "<f4", ">i2" or "u1", not {shown(each)}')
        return value

    @field_validator("sync")
    @classmethod
    def _is_sync(cls, value: str | None) -> str | None:
        """Bytes in hexadecimal."""
        if value is not None and not re.fullmatch(r"(?:[0-9A-Fa-f]{2} ?){1,16}", value):
            raise ValueError('expected 1 to 16 bytes in hexadecimal such as "AA 55"')
        return value

    @field_validator("check")
    @classmethod
    def _is_check(cls, value: str | None) -> str | None:
        """The name of a check."""
        if value is not None and value not in CHECKS:
            raise ValueError(f"expected one of {', '.join(CHECKS)}")
        return value

    @property
    def types(self) -> list[str]:
        """The type of each field of a binary file."""
        return self.binary if isinstance(self.binary, list) else [self.binary or ""] * len(self.fields)

    @property
    def frame(self) -> Frame | None:
        """The layout of a frame, None where the file has none."""
        if self.sync is None:
            return None
        check = NONE if self.check is None else CHECKS[self.check]
        what = bytes.fromhex(self.sync), tuple(self.fields), tuple(self.types), check, self.check_begin
        return Frame(*what, self.check_order, self.length or 0, self.counter or "")

    @property
    def laid_out(self) -> FileOptions:
        """The layout as the readers take it."""
        return FileOptions(
            self.delimiter,
            self.decimal,
            self.comment,
            self.skip,
            self.variable,
            self.transpose,
            tuple(self.types),
            tuple(self.fields),
            self.frame,
            self.lines or "",
            self.message or "",
            tuple(self.pattern),
        )

    @model_validator(mode="after")
    def _framed(self) -> FileEntry:
        """Keys of frames fit together."""
        own = {"check": self.check, "length": self.length, "counter": self.counter}
        if self.sync is None or self.binary is None:
            given = next((name for name, value in own.items() if value is not None), None)
            given = given if self.sync is None else "sync"
            if self.binary is not None and any(each.startswith("x") for each in self.types):
                given = "a type x"
            if given:
                raise _refusal(f"found {given} alone, expected sync, binary and fields for frames")
            return self
        if self.transpose or not self.fields or len(self.types) != len(self.fields):
            return self  # refused below
        frame = self.frame
        if frame is None or frame.size < frame.least:
            raise _refusal(
                f"found a length of {self.length}, expected {frame.least if frame else 0} bytes at least"
            )
        if self.check_begin >= frame.size - frame.check.width // 8:
            raise _refusal(f"found check_begin {self.check_begin}, expected a byte before the check")
        kinds = dict(zip(self.fields, self.types, strict=True))
        if self.counter is not None and not re.fullmatch(r"[<>]u[24]|u1", kinds.get(self.counter, "")):
            raise _refusal(
                f"found the counter {shown(self.counter)}, expected the name of a field of a type such as "
                '"u1" or "<u4"'
            )
        if all(each.startswith("x") for each in self.types):
            raise _refusal("found bytes of no use alone, expected a number at least")
        return self

    @model_validator(mode="after")
    def _of_one_kind(self) -> FileEntry:
        """Lines are of one kind, which leaves nothing else to say of their layout."""
        kinds = [name for name in ("lines", "message", "pattern") if getattr(self, name)]
        others = ("delimiter", "decimal", "comment", "binary")
        if len(kinds) > 1 or (kinds and any(getattr(self, name) for name in others)):
            raise _refusal(
                f"found {', '.join(kinds)} beside {', '.join(others)} or each other, expected one alone"
            )
        if self.pattern and not any(PLACE in text for text in self.pattern):
            raise _refusal("found a pattern without {}, expected one for each number")
        return self

    @model_validator(mode="after")
    def _described(self) -> FileEntry:
        """A binary file has a type for each field, and nothing of a text."""
        if self.binary is None and self.fields:
            raise _refusal("found fields without binary, expected both for a raw binary file")
        if self.binary is None:
            return self
        types = self.types
        if self.sync is not None and self.transpose:
            raise _refusal("found transpose with sync, expected frames one after the other")
        if not self.fields or len(types) != len(self.fields) or len(set(self.fields)) < len(self.fields):
            raise _refusal(
                f"found {len(types)} types of binary for {len(self.fields)} fields, expected one "
                "for each, or one for all, "
                "and a different name for each"
            )
        if self.delimiter or self.decimal or self.comment or self.variable:
            raise _refusal(
                "found delimiter, decimal, comment or variable, expected none for a raw binary file"
            )
        return self

    @field_validator("delimiter")
    @classmethod
    def _is_delimiter(cls, value: str | None) -> str | None:
        """One character that no number is written with."""
        if value is not None and (len(value) != 1 or value.isalnum() or value in '+-."\r\n'):
            raise ValueError('expected one character such as ",", ";", "\\t" or " " (any blanks)')
        return value

    @field_validator("decimal")
    @classmethod
    def _is_decimal(cls, value: str | None, info: ValidationInfo) -> str | None:
        """A comma cannot both part fields and mark decimals."""
        if value == "," and info.data.get("delimiter") == ",":
            raise ValueError("expected another than the delimiter")
        return value
