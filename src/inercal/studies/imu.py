"""The study of ``inercal calibrate imu``, by any of its methods."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from inercal._toml import Strict, check
from inercal.errors import QuantityError, StudyError
from inercal.imu.ferraris.names import NAMES
from inercal.imu.settings import (
    TILT,
    TURN,
    AidedSettings,
    Disturbances,
    Exclusion,
    FerrarisSettings,
    ImuSettings,
    KnownRatesSettings,
    KnownTurnsSettings,
    MeansSettings,
    Method,
    Simulation,
    mounting_of,
)
from inercal.instruments.terms import ACCELEROMETER_TRIAD, GYRO_G_SENSITIVITY, GYRO_TRIAD
from inercal.studies.common import (
    Conditions,
    ConditionsTable,
    SiteTable,
    Traceability,
    TraceabilityTable,
    Version,
    site_of,
)
from inercal.studies.fields import QuantityText, refusal
from inercal.studies.instrument import Typed, check_symbol, coefficient_of
from inercal.studies.rig import RigTable, chain_of
from inercal.studies.tables import as_typed, settings_of, table_of
from inercal.units import Quantity, parse_quantity, parse_unit, shown

SignedAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class AidedTable(Strict):
    """Reference-aided calibration: the table, and the instrument on it."""

    rig: RigTable = Field(
        default=RigTable(kind="two_axis_turntable"),
        title="Rig",
        description="the table, as in a study of a turntable; of two axes and without errors if absent, "
        "its azimuth unknown unless given",
    )
    mounting: tuple[SignedAxis, SignedAxis, SignedAxis] = Field(
        default=("+x", "+y", "+z"),
        examples=[["+x", "+y", "+z"]],
        description="axes of the table, at zero angles, along which the instrument's x, y and z point",
    )

    @model_validator(mode="after")
    def _right_handed(self) -> AidedTable:
        """Refuse axes that make no frame."""
        if mounting_of(self.mounting) is None:
            raise refusal(
                f"found the mounting {', '.join(self.mounting)}, expected three axes that make a right-handed frame"
            )
        return self

    @model_validator(mode="after")
    def _no_limits(self) -> AidedTable:
        """Refuse what would change nothing."""
        if self.rig.limits.model_fields_set:
            raise refusal("found rig.limits, expected none: the angles are those of the record")
        return self


def aided_settings(table: AidedTable, where: object) -> AidedSettings:
    """Put the table in SI.

    Raises `StudyError` for an error that this kind of table does not have, or one without any distribution.
    """
    azimuth = table.rig.base.azimuth
    chain = chain_of(table.rig, where, mounting_of(table.mounting), "imu.aided.rig")
    return AidedSettings(chain, None if azimuth is None else azimuth.u)


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


#: keys that not all methods heed -> those that do
_METHODS = {
    "static_start": ("multiposition",),
    "g_sensitivity": ("multiposition", "aided"),
    "bias_drift": ("multiposition",),
    "exclude": ("multiposition", "means"),
    "k2": ("multiposition", "means", "aided"),
    "time_base": ("multiposition", "ferraris", "aided", "known_turns"),
    "rates": ("known_rates",),
    "turns": ("known_turns",),
    "alignment": ("known_turns",),
    "ferraris": ("ferraris",),
    "aided": ("aided",),
}


def _left(value: object) -> object:
    """A time or a pose to be left out, as text."""
    if isinstance(value, str):
        if re.fullmatch(r"pose [1-9]\d*", value.strip()):
            return value
        begin, dots, end = value.partition("..")
        if dots and seconds_of(begin.strip()) < seconds_of(end.strip()):
            return value
    raise refusal(
        f'found {shown(value)}, expected a time, such as "249 s .. 253 s", or a pose, such as "pose 12"'
    )


Left = Annotated[str, BeforeValidator(_left)]


def exclusion_of(texts: list[str]) -> Exclusion:
    """The parts of a recording to be left out, of texts that were read well."""
    poses = tuple(int(text.split()[1]) for text in texts if ".." not in text)
    ends = [text.split("..") for text in texts if ".." in text]
    times = tuple((seconds_of(begin.strip()), seconds_of(end.strip())) for begin, end in ends)
    return Exclusion(times, poses)


Rate = Annotated[Quantity, QuantityText("rate", "33.333(15) rpm")]

TurnAngle = Annotated[Quantity, QuantityText("angle", "361.338(5) deg", TURN.accept, TURN.words)]


class TurnsTable(Strict):
    """Angles of three turns, positive about the positive axis by the right-hand rule."""

    x: TurnAngle = Field(description="angle of the turn about x, perhaps with its standard uncertainty")
    y: TurnAngle = Field(description="angle of the turn about y")
    z: TurnAngle = Field(description="angle of the turn about z")


class ImuTable(table_of(ImuSettings)):  # type: ignore[misc]
    """Settings of the calibration."""

    method: Literal["multiposition", "ferraris", "aided", "means", "known_rates", "known_turns"] = Field(
        default="multiposition",
        description="multiposition: many poses held still by hand, no turntable; ferraris: six positions and three "
        "turns by a known angle; aided: on a table whose angles are in the record; means: a row of mean outputs for "
        "each pose, accelerometers; known_rates: a gyro on a platter or rate table, in unknown orientations; "
        "known_turns: a gyro, a turn by a known angle about each axis",
    )
    rates: list[Rate] = Field(
        default=[],
        examples=[["0 rpm", "33.333(15) rpm", "45.00(2) rpm"]],
        description="of known_rates: rate of the table in each FILE, in their order",
    )
    turns: TurnsTable | None = Field(
        default=None,
        title="Turns",
        examples=[{"x": "361.338(5) deg", "y": "367.160(5) deg", "z": "363.670(5) deg"}],
        description="of known_turns: angle of the turn in each FILE, or in the rows of each label",
    )
    alignment: Annotated[Quantity, QuantityText("angle", "0.1 deg", TILT.accept, TILT.words)] | None = Field(
        default=None,
        description="of known_turns: standard uncertainty of the direction of the axis of each turn; taken as square "
        "to each other if absent",
    )
    exclude: list[Left] = Field(
        default=[],
        examples=[["249 s .. 253 s", "pose 12"]],
        description="what no fit uses: turns that a time of the record's clock touches and poses of which it holds the "
        "middle, and poses by their numbers, which stay as without this key",
    )
    ferraris: FerrarisTable = Field(
        default=FerrarisTable(), title="Ferraris", description="options of the method ferraris"
    )
    aided: AidedTable = Field(default=AidedTable(), title="Aided", description="options of the method aided")

    @model_validator(mode="after")
    def _of_the_method(self) -> ImuTable:
        """Refuse what the method does not heed."""
        for key in ("rates", "turns"):
            if self.method == f"known_{key}" and not getattr(self, key):
                raise refusal(f"{key}: missing, expected it with method = {self.method!r}")
        for key in self.model_fields_set - {"method"}:
            methods = _METHODS.get(key, ())
            if methods and self.method not in methods:
                raise refusal(
                    f"{key}: found with method = {self.method!r}, expected it with {' or '.join(methods)} only"
                )
        return self


class ImuDisturbancesTable(table_of(Disturbances)):  # type: ignore[misc]
    """Disturbances that a simulation adds to a recording by hand; none if absent."""

    k2: Typed | None = Field(
        default=None, description="second-order coefficient of all accelerometers", examples=["30 ug/g^2"]
    )


class SimulationTable(table_of(Simulation)):  # type: ignore[misc]
    """A simulated recording: the instrument lies still, then is turned from pose to pose by hand."""

    coefficients: dict[str, Typed] = Field(
        default_factory=dict,
        description="true values of terms by symbol, outputs in counts; those that are absent are drawn",
        examples=[{"K1_x": "4000 count/g"}],
    )


class ImuStudyFile(Strict):
    """A study for ``inercal calibrate imu``."""

    version: Version = 1
    site: SiteTable = Field(default=SiteTable(), title="Site", description="where the instrument stands")
    imu: ImuTable = Field(default=ImuTable(), title="Imu", description="how to calibrate the IMU")
    simulation: SimulationTable = Field(
        default=SimulationTable(), title="Simulation", description="a simulated recording"
    )
    disturbances: ImuDisturbancesTable = Field(
        default=ImuDisturbancesTable(),
        title="Disturbances",
        description="what a simulation adds to the model",
    )
    traceability: Traceability = TraceabilityTable()
    conditions: Conditions = ConditionsTable()


def _method(table: ImuTable, path: str | Path) -> Method | None:
    """The options of a method other than multi-position, in SI."""
    match table.method:
        case "ferraris":
            return ferraris_settings(table.ferraris)
        case "aided":
            return aided_settings(table.aided, path)
        case "means":
            return MeansSettings()
        case "known_rates":
            return KnownRatesSettings(
                tuple(rate.value for rate in table.rates), tuple(rate.u for rate in table.rates)
            )
        case "known_turns":
            assert table.turns is not None
            x, y, z = table.turns.x, table.turns.y, table.turns.z
            alignment = None if table.alignment is None else table.alignment.value
            return KnownTurnsSettings((x.value, y.value, z.value), (x.u, y.u, z.u), alignment)
    return None


def imu_study(data: Mapping[str, Any], path: str | Path) -> ImuSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file = check(ImuStudyFile, data, path, StudyError)
    site, count = site_of(file.site, path), parse_unit("count")
    known = (*ACCELEROMETER_TRIAD, *GYRO_TRIAD, *GYRO_G_SENSITIVITY)
    truth = {}
    for symbol, text in file.simulation.coefficients.items():
        key = f"simulation.coefficients.{symbol}"
        check_symbol(symbol, known, key, path)
        kind = "accelerometer" if symbol in ACCELEROMETER_TRIAD else "gyro"
        truth[symbol], _ = coefficient_of(text, symbol, kind, count, site.gravity, key, path)
    other, k2 = file.disturbances, 0.0
    if other.k2 is not None:
        k2, _ = coefficient_of(
            other.k2, "K2_x", "accelerometer", count, site.gravity, "disturbances.k2", path
        )
    return settings_of(
        ImuSettings,
        file.imu,
        site=site,
        simulation=settings_of(Simulation, file.simulation, coefficients=truth),
        disturbances=settings_of(Disturbances, other, k2=k2),
        traceability=file.traceability.model_dump(),
        method=_method(file.imu, path),
        temperature=file.conditions.temperature,
        exclude=exclusion_of(file.imu.exclude),
        given=as_typed(data),
    )
