"""The study of a turntable: one file for its sensitivity analysis, design, simulation and calibration."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, StrictInt

from inercal.faces.studies.common import StudyFile, site_on_earth
from inercal.faces.studies.fields import QuantityText
from inercal.faces.studies.instrument import InstrumentTable, instrument_of
from inercal.faces.studies.positions import GridTable, PlanName, PositionsTable, compared, grid_of, plan_of
from inercal.faces.studies.rig import Angle, Limits, RigTable, chain_of, limits_of
from inercal.faces.studies.tables import settings_of, table_of
from inercal.faces.studies.tolerances import CostsTable, WantedTable, tolerances_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.units import Quantity, Unit, parse_quantity
from inercal.systems.turntable.settings import (
    Analysis,
    Constraint,
    Disturbances,
    Leg,
    PositionDesign,
    RateTest,
    StepTest,
    TurntableSettings,
)

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

    Raises `StudyError` for a quantity of another kind than the outputs, a size below zero, or a joint that the table
    does not have.
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


OutputName = Literal["ax", "ay", "az", "wx", "wy", "wz"]
AnalysedName = Literal["ax", "ay", "az", "wx", "wy", "wz", "y_x", "y_y"]


class AnalysisTable(table_of(Analysis)):  # type: ignore[misc]
    """The sensitivity analysis."""

    outputs: list[AnalysedName] = Field(
        default=["ax", "ay", "az", "wx", "wy"],
        min_length=1,
        description="components of gravity (a) and earth rate (w) on the instrument's axes; y_x, y_y: outputs of a "
        "gyrowheel with the coefficients of [instrument.coefficients]",
    )


class ConstraintTable(Strict):
    """Only positions where the sensitivity of outputs to errors is low."""

    factors: list[str] = Field(min_length=1, description="errors of the table by name")
    outputs: list[OutputName] = Field(min_length=1, description="outputs whose first-order indices count")
    below: Annotated[float, Field(gt=0.0, le=1.0)] = Field(description="what each index stays below")


class DesignTable(table_of(PositionDesign)):  # type: ignore[misc]
    """The search for positions."""

    candidates: GridTable | None = Field(
        default=None,
        title="Candidates",
        description="positions to choose from; every 10 deg from 0 if absent",
        examples=[{"phi1": 36, "phi2": 36, "offset": "none"}],
    )
    compare: list[PlanName] | None = Field(
        default=None, description="named plans to set beside; all the table can take if absent"
    )
    sensitivity: ConstraintTable | None = Field(
        default=None,
        title="Sensitivity",
        description="only positions of low sensitivity; all if absent",
        examples=[{"factors": ["dtheta_x"], "outputs": ["ax"], "below": 0.3}],
    )


class AnglesTable(Strict):
    """Angles of the axes."""

    phi1: Angle | None = Field(default=None, description="outer angle; 0 if absent")
    phi2: Angle | None = Field(default=None, description="of the next axis; 0 if absent")
    phi3: Angle | None = Field(default=None, description="of the inner axis of three; 0 if absent")


class LegTable(AnglesTable):
    """A part of a rate test: the axis that turns, and angles at which it begins."""

    joint: Literal["phi1", "phi2", "phi3"] = Field(description="axis that turns")


class RateTestTable(table_of(RateTest)):  # type: ignore[misc]
    """A rate test of gyros: the table turns at each rate in turn."""

    at: AnglesTable = Field(
        default=AnglesTable(),
        title="At",
        description="angles of a simulation, where each stay begins",
        examples=[{"phi1": "90 deg"}],
    )
    legs: list[LegTable] = Field(
        default=[],
        description="axes of a simulation that turn one after the other; joint alone if absent",
        examples=[[{"joint": "phi1"}, {"joint": "phi1", "phi2": "90 deg"}, {"joint": "phi2"}]],
    )


class StepTestTable(table_of(StepTest)):  # type: ignore[misc]
    """A test by small steps about level: threshold, dead zone and hysteresis of accelerometers."""

    at: AnglesTable = Field(
        default=AnglesTable(),
        title="At",
        description="angles of a simulation, where the accelerometer is level",
        examples=[{"phi2": "90 deg"}],
    )


class TurntableStudyFile(StudyFile):
    """A study of a turntable, for `inercal sensitivity`, `design positions`, `simulate` and `calibrate turntable`."""

    rig: RigTable = Field(title="Rig", description="the turntable and its errors")
    positions: PositionsTable = Field(
        default=PositionsTable(), title="Positions", description="where to stop; a grid of 10 deg if absent"
    )
    analysis: AnalysisTable = Field(
        default=AnalysisTable(), title="Analysis", description="the sensitivity analysis"
    )
    instrument: InstrumentTable = Field(
        default=InstrumentTable(), title="Instrument", description="the instrument on the table"
    )
    design: DesignTable = Field(default=DesignTable(), title="Design", description="the search for positions")
    rate_test: RateTestTable | None = Field(
        default=None, title="Rate test", description="a rate test; none if absent"
    )
    step_test: StepTestTable | None = Field(
        default=None, title="Step test", description="a test by small steps about level; none if absent"
    )
    disturbances: TableDisturbancesTable = Field(
        default=TableDisturbancesTable(),
        title="Disturbances",
        description="what a simulation adds to the model",
    )
    goal: WantedTable = Field(default=WantedTable(), title="Goal", description="wanted uncertainties")
    cost: CostsTable = Field(
        default=CostsTable(), title="Cost", description="cost of tolerances, for design tolerances"
    )


def turntable_study(data: Mapping[str, Any], path: str | Path) -> TurntableSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file = check(TurntableStudyFile, data, path, StudyError)
    site = site_on_earth(file.site, path, "table")
    chain = chain_of(file.rig, path)
    limits = limits_of(file.rig, chain, path)
    instrument = instrument_of(file.instrument, site.gravity, path)
    return TurntableSettings(
        site=site,
        rig=file.rig.kind,
        chain=chain,
        plan=plan_of(file.positions, chain, limits, path),
        design=_design(file.design, chain, limits, path),
        analysis=_analysis(file.analysis, path),
        instrument=instrument,
        limits=limits,
        rate_test=None if file.rate_test is None else _rate_test(file.rate_test, chain, path),
        step_test=None if file.step_test is None else _step_test(file.step_test, chain, path),
        disturbances=disturbances_of(file.disturbances, instrument.unit, chain, path),
        tolerances=tolerances_of(file.goal, file.cost, chain, instrument, site.gravity, path),
        **file.shared(data),
    )


def _analysis(table: AnalysisTable, where: object) -> Analysis:
    """Settings of an analysis; each output once."""
    _once(table.outputs, "analysis.outputs", where)
    return settings_of(Analysis, table, outputs=tuple(table.outputs))


def _design(table: DesignTable, chain: Chain, limits: Limits, where: object) -> PositionDesign:
    """Settings of a search for positions."""
    constraint = None
    if table.sensitivity is not None:
        limit = table.sensitivity
        _known(limit.factors, chain.factors, "design.sensitivity.factors", where)
        _once(limit.factors, "design.sensitivity.factors", where)
        _once(limit.outputs, "design.sensitivity.outputs", where)
        constraint = Constraint(tuple(limit.factors), tuple(limit.outputs), limit.below)
    return settings_of(
        PositionDesign,
        table,
        candidates=grid_of(table.candidates, chain, limits, "design.candidates", where, half=False),
        compare=compared(table.compare, chain, limits, where),
        constraint=constraint,
    )


def _rate_test(table: RateTestTable, chain: Chain, where: object) -> RateTest:
    """A rate test."""
    _known([table.joint], chain.joints, "rate_test.joint", where)
    for k, leg in enumerate(table.legs):
        _known([leg.joint], chain.joints, f"rate_test.legs.{k}.joint", where)
    legs = tuple(
        Leg(leg.joint, _at(leg, chain, f"rate_test.legs.{k}", where)) for k, leg in enumerate(table.legs)
    )
    return settings_of(RateTest, table, at=_at(table.at, chain, "rate_test.at", where), legs=legs)


def _step_test(table: StepTestTable, chain: Chain, where: object) -> StepTest:
    """A test by small steps."""
    _known([table.joint], chain.joints, "step_test.joint", where)
    return settings_of(StepTest, table, at=_at(table.at, chain, "step_test.at", where))


def _at(table: AnglesTable, chain: Chain, key: str, where: object) -> dict[str, float]:
    """Angles [rad] by joint, those that are stated."""
    at = {joint: angle.value for joint in AnglesTable.model_fields if (angle := getattr(table, joint))}
    _known(list(at), chain.joints, key, where)
    return at


def _known(names: Sequence[str], choices: Sequence[str], key: str, where: object) -> None:
    """Refuse a name the table does not have."""
    for name in names:
        if name not in choices:
            near = difflib.get_close_matches(name[:80], choices, n=1, cutoff=0.5)
            hint = (
                f"did you mean {near[0]}?"
                if near
                else f"expected {', '.join(choices) or 'errors in rig.errors'}"
            )
            raise StudyError(where, f"{key}: found {name!r}, {hint}")


def _once(names: Sequence[str], key: str, where: object) -> None:
    """Refuse a name that occurs twice."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise StudyError(where, f"{key}: found {name!r} twice, expected each once")
