"""The study of ``inercal calibrate imu``, by any of its methods."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from inercal._toml import Strict, check
from inercal.errors import StudyError
from inercal.imu.settings import (
    AidedSettings,
    Disturbances,
    Exclusion,
    FerrarisSettings,
    ImuSettings,
    Simulation,
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
from inercal.studies.fields import refusal
from inercal.studies.imu_aided import AidedTable, aided_settings
from inercal.studies.imu_ferraris import FerrarisTable, ferraris_settings, seconds_of
from inercal.studies.instrument import Typed, check_symbol, coefficient_of
from inercal.studies.tables import as_typed, settings_of, table_of
from inercal.units import parse_unit, shown

#: keys that not all methods heed -> those that do
_METHODS = {
    "static_start": ("multiposition",),
    "g_sensitivity": ("multiposition", "aided"),
    "bias_drift": ("multiposition",),
    "exclude": ("multiposition",),
    "k2": ("multiposition", "aided"),
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


class ImuTable(table_of(ImuSettings)):  # type: ignore[misc]
    """Settings of the calibration."""

    method: Literal["multiposition", "ferraris", "aided"] = Field(
        default="multiposition",
        description="multiposition: many poses held still by hand, no turntable; ferraris: six positions and three "
        "turns by a known angle; aided: on a table whose angles are in the record",
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


def imu_study(data: Mapping[str, Any], path: str | Path) -> ImuSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file = check(ImuStudyFile, data, path, StudyError)
    method: FerrarisSettings | AidedSettings | None = None
    if file.imu.method == "ferraris":
        method = ferraris_settings(file.imu.ferraris)
    elif file.imu.method == "aided":
        method = aided_settings(file.imu.aided, path)
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
        method=method,
        temperature=file.conditions.temperature,
        exclude=exclusion_of(file.imu.exclude),
        given=as_typed(data),
    )
