"""Options of the Ferraris calibration in a study, and places of its sections."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from inercal.faces.studies.fields import refusal
from inercal.faces.studies.tables import settings_of, table_of
from inercal.foundation._toml import Strict
from inercal.foundation.errors import QuantityError
from inercal.foundation.units import parse_quantity, shown
from inercal.systems.imu.ferraris.names import NAMES
from inercal.systems.imu.settings import FerrarisSettings

_EXPECTED = (
    'expected ["start", "end"] in time, such as ["5.2 s", "12.4 s"], or in samples, such as [540, 1271], or a '
    "label"
)


def _ends(value: object) -> object:
    """A section: two times, two sample numbers, or the label of its rows."""
    match value:
        case str() if value.strip():
            return value
        case [int(start), int(end)] if not isinstance(start, bool) and not isinstance(end, bool):
            if 0 <= start < end - 1:
                return value
        case [str(start), str(end)]:
            begin, stop = seconds_of(start), seconds_of(end)
            if begin < stop:
                return value
    raise refusal(f"found {shown(value)}, {_EXPECTED}, the end after the start")


def seconds_of(text: str) -> float:
    """A time [s]."""
    try:
        return parse_quantity(text, "time", "time").value
    except QuantityError as error:
        raise refusal(error.message) from error


_Ends = Field(min_length=2, max_length=2)

Section = Annotated[
    Annotated[list[str], _Ends] | Annotated[list[int], _Ends] | str,
    BeforeValidator(_ends),
    Field(examples=[["5.2 s", "12.4 s"], [540, 1271], "X up"]),
]


class SectionsTable(Strict):
    """Places of the sections: times of the record's time axis, samples from 0, the end not included, or labels."""

    x_p: Section | None = Field(default=None, description="+x up: accelerometer x reads +g")
    x_a: Section | None = Field(default=None, description="-x up: accelerometer x reads -g")
    y_p: Section | None = Field(default=None, description="+y up: accelerometer y reads +g")
    y_a: Section | None = Field(default=None, description="-y up: accelerometer y reads -g")
    z_p: Section | None = Field(default=None, description="+z up: accelerometer z reads +g")
    z_a: Section | None = Field(default=None, description="-z up: accelerometer z reads -g")
    x_rot: Section | None = Field(default=None, description="the turn about x, from rest to rest")
    y_rot: Section | None = Field(default=None, description="the turn about y, from rest to rest")
    z_rot: Section | None = Field(default=None, description="the turn about z, from rest to rest")


class FerrarisTable(table_of(FerrarisSettings)):  # type: ignore[misc]
    """Options of the Ferraris calibration: six positions, each axis up and down, and a turn about each axis."""

    sections: SectionsTable = Field(
        default=SectionsTable(),
        title="Sections",
        description="where the sections are; by the labels of the record if absent, or else detected",
    )


def ferraris_settings(table: FerrarisTable) -> FerrarisSettings:
    """The options in SI."""
    given = {name: ends for name in NAMES if (ends := getattr(table.sections, name)) is not None}
    sections = {name: _span(ends) for name, ends in given.items()}
    return settings_of(FerrarisSettings, table, sections=sections)


def _span(ends: list[str] | list[int] | str) -> tuple[float, float] | str:
    """A section as the settings have it: seconds, samples or a label."""
    if isinstance(ends, str):
        return ends
    start, end = (seconds_of(each) if isinstance(each, str) else each for each in ends)
    return start, end
