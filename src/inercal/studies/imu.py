"""The study of ``inercal calibrate imu``, by any of its methods."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from inercal._toml import Strict, check
from inercal.errors import StudyError
from inercal.imu.settings import (
    AidedSettings,
    Disturbances,
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
from inercal.studies.imu_ferraris import FerrarisTable, ferraris_settings
from inercal.studies.instrument import Typed, check_symbol, coefficient_of
from inercal.studies.tables import as_typed, settings_of, table_of
from inercal.units import parse_unit

#: keys that not all methods heed -> those that do
_METHODS = {
    "static_start": ("multiposition",),
    "g_sensitivity": ("multiposition", "aided"),
    "bias_drift": ("multiposition",),
    "ferraris": ("ferraris",),
    "aided": ("aided",),
}


class ImuTable(table_of(ImuSettings)):  # type: ignore[misc]
    """Settings of the calibration."""

    method: Literal["multiposition", "ferraris", "aided"] = Field(
        default="multiposition",
        description="multiposition: many poses held still by hand, no turntable; ferraris: six positions and three "
        "turns by a known angle; aided: on a table whose angles are in the record",
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
        given=as_typed(data),
    )
