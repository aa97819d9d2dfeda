"""The study of ``inercal calibrate imu``, by any of its methods."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from inercal.faces.studies.common import StudyFile, site_of
from inercal.faces.studies.ferraris import FerrarisTable, ferraris_settings, seconds_of
from inercal.faces.studies.fields import QuantityText, refusal
from inercal.faces.studies.instrument import Typed, check_symbol, coefficient_of
from inercal.faces.studies.tables import Stated, check_kind, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.terms import (
    ACCELEROMETER_TRIAD,
    ACCELEROMETERS_IN_A_FRAME,
    GYRO_G_SENSITIVITY,
    GYRO_TRIAD,
)
from inercal.foundation.rigs.stated_chain import chain_of
from inercal.foundation.units import Quantity, parse_unit, shown
from inercal.systems.imu.settings import (
    TILT,
    TURN,
    AidedRig,
    AidedSettings,
    Disturbances,
    Exclusion,
    ImuSettings,
    KnownRatesSettings,
    KnownTurnsSettings,
    MeansSettings,
    Method,
    SectionsSettings,
    Simulation,
    mounting_of,
)


def aided_settings(table: AidedRig, where: object) -> AidedSettings:
    """The table with its errors, in SI.

    Raises `StudyError` for an error that this kind of table does not have, or one without any distribution.
    """
    azimuth = table.rig.base.azimuth
    chain = chain_of(table.rig, where, mounting_of(table.mounting), "imu.aided.rig")
    return AidedSettings(chain, None if azimuth is None else azimuth.u)


#: keys beside those of the settings that not all methods heed -> those that do
_METHODS = {
    "exclude": ("multiposition", "means", "known_rates"),
    "k2": ("multiposition", "ferraris", "means", "aided", "sections"),
    "sections": ("sections",),
    "section": ("sections",),
    "placing": ("sections",),
    "level": ("sections",),
    "misalignment": ("sections",),
    "mounting": ("sections",),
    "clock": ("sections",),
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


Prior = Annotated[
    Any, WithJsonSchema({"type": "string", "pattern": r"^\s*0", "examples": ["0(0.05) deg/s/g"]})
]
"""0 with a standard uncertainty, in a unit that depends on the term."""


def _about_zero(dimension: str, example: str) -> QuantityText:
    """The reader of a prior: 0 with its standard uncertainty."""
    return QuantityText(dimension, example, lambda value: value == 0.0, "0 with its standard uncertainty")


Rate = Annotated[Quantity, QuantityText("rate", "33.333(15) rpm")]

TurnAngle = Annotated[Quantity, QuantityText("angle", "361.338(5) deg", TURN.accept, TURN.words)]


class TurnsTable(Strict):
    """Angles of three turns, positive about the positive axis by the right-hand rule."""

    x: TurnAngle = Field(description="angle of the turn about x, perhaps with its standard uncertainty")
    y: TurnAngle = Field(description="angle of the turn about y")
    z: TurnAngle = Field(description="angle of the turn about z")


class ImuTable(table_of(ImuSettings)):  # type: ignore[misc]
    """Settings of the calibration."""

    method: Literal[
        "multiposition", "ferraris", "aided", "means", "known_rates", "known_turns", "sections"
    ] = Field(
        default="multiposition",
        description="multiposition: many poses held still by hand, no turntable; ferraris: six positions and three "
        "turns by a known angle; aided: on a table whose angles are in the record; sections: rests, rates and turns, "
        "each with what is known of it; shorthands of sections are ferraris, means: accelerometers, a row of mean "
        "outputs for each rest in an unknown direction; known_rates: a gyro on a platter or rate table, in unknown "
        "orientations; known_turns: a gyro, a turn by a known angle about each axis",
    )
    sections: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        examples=["sections.csv"],
        description="of sections: the table of the sections, beside the study; from names, labels and the recordings "
        "if absent",
    )
    section: list[dict[str, Any]] = Field(
        default=[],
        examples=[[{"section": "x up", "file": "x_up.csv", "up": "+x"}]],
        description="of sections: the sections themselves in the place of a table, with the same keys as its columns",
    )
    placing: Annotated[Quantity, QuantityText("angle", "0.3 deg", TILT.accept, TILT.words)] | None = Field(
        default=None,
        description="of sections: standard uncertainty of every direction and axis whose section states none; from the "
        "scatter if absent",
    )
    level: Annotated[Quantity, QuantityText("angle", "0.05 deg", TILT.accept, TILT.words)] | None = Field(
        default=None,
        description="of sections: the axes of turns and rates are vertical within this; not known if absent",
    )
    misalignment: Annotated[Quantity, _about_zero("angle", "0(50) mrad")] | None = Field(
        default=None, description="of sections: what M and T are before the test; 0(50) mrad if absent"
    )
    mounting: Annotated[Quantity, _about_zero("angle", "0(0.5) deg")] | None = Field(
        default=None,
        description="of sections: rotation of the case against what is said of directions and axes; 0 if absent",
    )
    clock: Annotated[Quantity, _about_zero("number", "0(20) ppm")] | None = Field(
        default=None,
        description="of sections: relative error of the record's clock, in the place of time_base",
    )
    g_sensitivity: bool | Prior = Field(
        default=False,
        description="how the gyro's drift depends on specific force: true to estimate it too; of sections, where it is "
        "estimated unless false, 0 with the standard uncertainty it has before the test, by default 0.1 deg/s/g, of "
        "gyros for navigation 0.1 deg/h/g",
        examples=["0(0.05) deg/s/g"],
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
        description="of known_turns: standard uncertainty of the direction of the axis of each turn; not known if "
        "absent, some 0.3 deg",
    )
    k2: bool | Typed = Field(
        default=False,
        description="second-order coefficients of the accelerometers, K1 (f + K2 f^2), f along the input axis: true to "
        "estimate them, or 0 with the standard uncertainty they have where they are not; by default 30 ug/g^2 where "
        "the mean specific force scatters by 20 ug at most from pose to pose, else 150 ug/g^2",
        examples=["0(50) ug/g^2"],
    )
    exclude: list[Left] = Field(
        default=[],
        examples=[["249 s .. 253 s", "pose 12"]],
        description="what no fit uses: turns that a time of the record's clock touches and poses of which it holds the "
        "middle, and poses by their numbers, which stay as without this key; of known_rates orientations, counted "
        "through all files",
    )
    ferraris: FerrarisTable = Field(
        default=FerrarisTable(), title="Ferraris", description="options of the method ferraris"
    )
    aided: Stated[AidedRig] = Field(
        default=AidedRig(), title="Aided", description="options of the method aided"
    )

    @model_validator(mode="after")
    def _of_the_method(self) -> ImuTable:
        """Refuse what the method does not heed."""
        for key in ("rates", "turns"):
            if self.method == f"known_{key}" and not getattr(self, key):
                raise refusal(f"missing, expected it with method = {self.method!r}", key)
        check_kind(ImuSettings, self, self.method, "method")
        if self.sections is not None and self.section:
            raise refusal("found beside sections, expected one of the two", "section")
        if self.clock is not None and "time_base" in self.model_fields_set:
            raise refusal("found beside time_base, expected one of the two", "clock")
        for key in self.model_fields_set - {"method"}:
            methods = _METHODS.get(key, ())
            if methods and self.method not in methods:
                words = f"found with method = {self.method!r}, expected it with {' or '.join(methods)} only"
                raise refusal(words, key)
        return self


class ImuDisturbancesTable(table_of(Disturbances)):  # type: ignore[misc]
    """Disturbances that a simulation adds to a recording; none if absent."""

    k2: Typed | None = Field(
        default=None, description="second-order coefficient of all accelerometers", examples=["30 ug/g^2"]
    )


class SimulationTable(table_of(Simulation)):  # type: ignore[misc]
    """A simulated recording: by hand from pose to pose, in six positions and three turns, or on a table."""

    coefficients: dict[str, Typed] = Field(
        default_factory=dict,
        description="true values of terms by symbol, outputs in counts; those that are absent are drawn",
        examples=[{"K1_x": "4000 count/g"}],
    )


class ImuStudyFile(StudyFile):
    """A study for ``inercal calibrate imu``."""

    imu: ImuTable = Field(default=ImuTable(), title="Imu", description="how to calibrate the IMU")
    simulation: SimulationTable = Field(
        default=SimulationTable(), title="Simulation", description="a simulated recording"
    )
    disturbances: ImuDisturbancesTable = Field(
        default=ImuDisturbancesTable(),
        title="Disturbances",
        description="what a simulation adds to the model",
    )

    @model_validator(mode="after")
    def _of_the_method(self) -> ImuStudyFile:
        """Refuse what the simulation of the method does not heed."""
        check_kind(Simulation, self.simulation, self.imu.method, "method", "simulation.")
        check_kind(Disturbances, self.disturbances, self.imu.method, "method", "disturbances.")
        return self


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
        case "sections":
            return SectionsSettings(
                None if table.sections is None else Path(path).parent / table.sections,
                tuple(table.section),
                None if table.placing is None else table.placing.value,
                None if table.level is None else table.level.value,
                None if table.misalignment is None else table.misalignment.u,
                0.0 if table.mounting is None else table.mounting.u,
            )
    return None


def _k2(table: ImuTable, gravity: float, path: str | Path) -> tuple[bool, float | None]:
    """True where K2 is estimated without a prior, and its standard deviation about 0 [1/(m/s^2)] where that is
    stated."""
    if isinstance(table.k2, bool):
        if table.method == "sections":
            return False, 0.0 if "k2" in table.model_fields_set and not table.k2 else None
        if table.k2 and table.method == "ferraris":
            raise StudyError(
                path,
                "imu.k2: found true with method = 'ferraris', expected \"0(50) ug/g^2\": its six "
                "positions do not tell K2 from K0",
            )
        return table.k2, None
    if table.method == "aided":
        raise StudyError(path, "imu.k2: found an uncertainty with method = 'aided', expected true or false")
    return False, _u_about_zero(table.k2, "K2_x", "imu.k2", "0(50) ug/g^2", gravity, path)


def _g_sensitivity(table: ImuTable, gravity: float, path: str | Path) -> tuple[bool, float | None]:
    """True where it is estimated without a prior, and of sections its standard deviation about 0
    [(rad/s)/(m/s^2)] where that is stated, 0 where there is none."""
    if isinstance(table.g_sensitivity, bool):
        unsaid = table.g_sensitivity or "g_sensitivity" not in table.model_fields_set
        return table.g_sensitivity, None if unsaid else 0.0
    if table.method != "sections":
        found = f"imu.g_sensitivity: found {shown(table.g_sensitivity)}"
        raise StudyError(path, f"{found}, expected true or false with method = {table.method!r}")
    key, example = "imu.g_sensitivity", "0(0.05) deg/s/g"
    return True, _u_about_zero(table.g_sensitivity, "G_xx", key, example, gravity, path)


def _u_about_zero(
    text: object, symbol: str, key: str, example: str, gravity: float, path: str | Path
) -> float:
    """Standard deviation [SI] of a term about 0."""
    kind, unit = ("accelerometer", "count") if symbol.startswith("K") else ("gyro", "rad/s")
    value, u = coefficient_of(text, symbol, kind, parse_unit(unit), gravity, key, path)
    if value != 0.0:
        expected = f'expected true, false or 0 with an uncertainty, such as "{example}"'
        raise StudyError(path, f"{key}: found {shown(text)}, {expected}")
    return u


def imu_study(data: Mapping[str, Any], path: str | Path) -> ImuSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file = check(ImuStudyFile, data, path, StudyError)
    site, count = site_of(file.site, path), parse_unit("count")
    known = (
        *(ACCELEROMETER_TRIAD if file.imu.method == "multiposition" else ACCELEROMETERS_IN_A_FRAME),
        *GYRO_TRIAD,
        *GYRO_G_SENSITIVITY,
    )
    truth = {}
    for symbol, text in file.simulation.coefficients.items():
        key = f"simulation.coefficients.{symbol}"
        check_symbol(symbol, known, key, path)
        kind = "accelerometer" if symbol in ACCELEROMETERS_IN_A_FRAME else "gyro"
        truth[symbol], _ = coefficient_of(text, symbol, kind, count, site.gravity, key, path)
    other, k2 = file.disturbances, 0.0
    if other.k2 is not None:
        k2, _ = coefficient_of(
            other.k2, "K2_x", "accelerometer", count, site.gravity, "disturbances.k2", path
        )
    fitted, k2_u = _k2(file.imu, site.gravity, path)
    with_g, g_u = _g_sensitivity(file.imu, site.gravity, path)
    of_clock = {} if file.imu.clock is None else {"time_base_u": file.imu.clock.u}
    return settings_of(
        ImuSettings,
        file.imu,
        k2=fitted,
        k2_u=k2_u,
        g_sensitivity=with_g,
        g_sensitivity_u=g_u,
        **of_clock,
        site=site,
        simulation=settings_of(Simulation, file.simulation, coefficients=truth),
        disturbances=settings_of(Disturbances, other, k2=k2),
        method=_method(file.imu, path),
        exclude=exclusion_of(file.imu.exclude),
        **file.shared(data),
    )
