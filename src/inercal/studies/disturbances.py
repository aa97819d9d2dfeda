"""Disturbances of a simulated test on a table in a study: those of outputs are in the unit that the outputs have."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt

from inercal._toml import Strict
from inercal.errors import QuantityError, StudyError
from inercal.rigs.chain import Chain
from inercal.studies.fields import QuantityText
from inercal.studies.rig import Angle
from inercal.studies.tables import settings_of, table_of
from inercal.turntable.settings import Disturbances
from inercal.units import Quantity, Unit, parse_quantity

_OF_OUTPUTS = ("ramp", "warm_up", "random_walk", "dead_zone", "hysteresis", "magnetic")


class TableHarmonicTable(Strict):
    """An error of an encoder that repeats with its angle: amplitude times sin(order times angle + phase)."""

    joint: Literal["phi1", "phi2", "phi3"] = Field(description="the joint")
    order: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(description="periods in a full turn")
    amplitude: Annotated[Quantity, QuantityText("angle", "5 arcsec")] = Field(description="of the error")
    phase: Angle | None = Field(default=None, description="at angle 0; 0 if absent")


class TableDisturbancesTable(table_of(Disturbances)):  # type: ignore[misc]
    """Disturbances that a simulation adds to table and instrument, and no calibration knows; none if absent."""

    harmonics: list[TableHarmonicTable] = Field(
        default=[],
        description="errors of the encoders; none if absent",
        examples=[[{"joint": "phi2", "order": 1, "amplitude": "5 arcsec", "phase": "0 deg"}]],
    )
    ramp: str | None = Field(
        default=None,
        description="steady change of the outputs from begin to end of the test",
        examples=["0.2 deg/h"],
    )
    warm_up: str | None = Field(
        default=None,
        description="excess of the outputs at the begin, which dies away",
        examples=["0.2 deg/h"],
    )
    random_walk: str | None = Field(
        default=None,
        description="standard deviation that a random walk of the outputs has at the end of the test",
        examples=["0.1 deg/h"],
    )
    dead_zone: str | None = Field(
        default=None,
        description="response to an input below which there is none: the output stays at its bias",
        examples=["0.05 deg/h"],
    )
    hysteresis: str | None = Field(
        default=None,
        description="output after it was raised less that after it was lowered, at the same input",
        examples=["0.05 deg/h"],
    )
    magnetic: str | None = Field(
        default=None,
        description="output along a field that is fixed to the ground, to the north and down",
        examples=["0.05 deg/h"],
    )


def disturbances_of(table: Any, unit: Unit, chain: Chain, where: object) -> Disturbances:
    """The disturbances in SI; those of outputs in the SI unit of ``unit``.

    Raises
    ------
    StudyError
        A quantity of another kind than the outputs, a size below zero, or a joint that the table does not have.
    """
    of_outputs = {}
    for key in _OF_OUTPUTS:
        text = getattr(table, key)
        if text is None:
            continue
        try:
            value = parse_quantity(text, unit.dimension, f"disturbances.{key}").value
        except QuantityError as error:
            raise StudyError(where, str(error)) from error
        if value < 0.0 and key in ("random_walk", "dead_zone"):
            raise StudyError(where, f"disturbances.{key}: found {text!r}, expected a value of 0 or more")
        of_outputs[key] = value
    for k, each in enumerate(table.harmonics):
        if each.joint not in chain.joints:
            raise StudyError(
                where,
                f"disturbances.harmonics.{k}.joint: found {each.joint}, expected {' or '.join(chain.joints)}",
            )
    harmonics = tuple(
        (each.joint, each.order, each.amplitude.value, 0.0 if each.phase is None else each.phase.value)
        for each in table.harmonics
    )
    return settings_of(Disturbances, table, harmonics=harmonics, **of_outputs)
