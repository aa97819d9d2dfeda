"""The study of a turntable: one file for its sensitivity analysis, design, simulation and calibration."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import Field

from inercal.faces.studies.common import StudyFile, site_on_earth
from inercal.faces.studies.instrument import instrument_of
from inercal.faces.studies.tables import Stated, settings_of, table_of
from inercal.faces.studies.tolerances import CostsTable, tolerances_of
from inercal.foundation._toml import check
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.keys import OUTPUT, keys_of
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.plans import Grid, StatedPositions
from inercal.foundation.rigs.stated import StatedRig
from inercal.foundation.rigs.stated_chain import chain_of, limits_of
from inercal.foundation.rigs.stated_plan import compared, grid_of, plan_of
from inercal.foundation.units import Unit, parse_quantity
from inercal.systems.turntable.settings import (
    Disturbances,
    Instrument,
    PositionDesign,
    TurntableSettings,
    WantedOfTable,
)


class DesignTable(table_of(PositionDesign)):  # type: ignore[misc]
    """The search for positions."""

    candidates: Stated[Grid] | None = Field(
        default=None,
        title="Candidates",
        description="positions to choose from; every 10 deg from 0 if absent",
        examples=[{"phi1": 36, "phi2": 36, "offset": "none"}],
    )


class TurntableStudyFile(table_of(TurntableSettings), StudyFile):  # type: ignore[misc]
    """A study of a turntable, for `inercal sensitivity`, `design positions`, `simulate` and `calibrate turntable`."""

    rig: Stated[StatedRig] = Field(title="Rig", description="the turntable and its errors")
    positions: Stated[StatedPositions] = Field(
        default=StatedPositions(), title="Positions", description="where to stop; a grid of 10 deg if absent"
    )
    instrument: table_of(Instrument) = Field(  # type: ignore[valid-type]
        default=table_of(Instrument)(), title="Instrument", description="the instrument on the table"
    )
    design: DesignTable = Field(default=DesignTable(), title="Design", description="the search for positions")
    disturbances: table_of(Disturbances) = Field(  # type: ignore[valid-type]
        default=table_of(Disturbances)(),
        title="Disturbances",
        description="what a simulation adds to the model",
    )
    goal: Stated[WantedOfTable] = Field(
        default=WantedOfTable(), title="Goal", description="wanted uncertainties"
    )
    cost: CostsTable = Field(
        default=CostsTable(), title="Cost", description="cost of tolerances, for design tolerances"
    )


def turntable_study(data: Mapping[str, Any], path: str | Path) -> TurntableSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file: Any = check(TurntableStudyFile, data, path, StudyError)
    site = site_on_earth(file.site, path, "table")
    chain = chain_of(file.rig, path)
    limits = limits_of(file.rig, chain, path)
    instrument = instrument_of(file.instrument, site.gravity, path)
    for key, joint in _joints(file, data):
        _known([joint], chain.joints, key, path)
    if file.design.sensitivity is not None:
        _known(file.design.sensitivity.factors, chain.factors, "design.sensitivity.factors", path)
    asked = file.design.compare if "compare" in file.design.model_fields_set else None
    return settings_of(
        TurntableSettings,
        file,
        site=site,
        rig=file.rig.kind,
        chain=chain,
        plan=plan_of(file.positions, chain, limits, path),
        design=settings_of(
            PositionDesign,
            file.design,
            candidates=grid_of(file.design.candidates, chain, limits, "design.candidates", path, half=False),
            compare=compared(asked, chain, limits, path),
        ),
        instrument=instrument,
        limits=limits,
        disturbances=_disturbances(file.disturbances, instrument.unit, chain, path),
        tolerances=tolerances_of(file.goal, file.cost, chain, instrument, site.gravity, path),
        **file.shared(data),
    )


def _joints(file: Any, data: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Joints that tests name, by their keys."""
    for key, test in (("rate_test", file.rate_test), ("step_test", file.step_test)):
        if test is not None:
            yield f"{key}.joint", test.joint
            yield from ((f"{key}.at", joint) for joint in data[key].get("at", ()))
    for k, leg in enumerate(data.get("rate_test", {}).get("legs", ())):
        yield f"rate_test.legs.{k}.joint", leg["joint"]
        yield from ((f"rate_test.legs.{k}", joint) for joint in leg if joint != "joint")


def _disturbances(table: Any, unit: Unit, chain: Chain, where: object) -> Disturbances:
    """The disturbances in SI; those of outputs in the SI unit of ``unit``.

    Raises `StudyError` for a quantity of another kind than the outputs, a size below zero, or a joint that the table
    does not have.
    """
    for k, wave in enumerate(table.harmonics):
        if wave.joint not in chain.joints:
            raise StudyError(
                where,
                f"disturbances.harmonics.{k}.joint: found {wave.joint}, expected {' or '.join(chain.joints)}",
            )
    of_outputs = {}
    for field, key in keys_of(Disturbances):
        if key.dimension != OUTPUT or (text := getattr(table, field.name)) is None:
            continue
        try:
            value = parse_quantity(text, unit.dimension, f"disturbances.{field.name}").value
        except QuantityError as error:
            raise StudyError(where, str(error)) from error
        if not key.bounds.accept(value):
            raise StudyError(where, f"disturbances.{field.name}: found {text!r}, expected {key.bounds.words}")
        of_outputs[field.name] = value
    return settings_of(Disturbances, table, **of_outputs)


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
