"""The study of a self-calibration: one file for its simulation, path design and estimation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model

from inercal.faces.studies.common import SiteTable, StudyFile, site_on_earth
from inercal.faces.studies.fields import QuantityText, Several, SeveralTexts, Word, positive
from inercal.faces.studies.platform import CommandTable, GimbalsTable, PlacedRecordTable, plan_of
from inercal.faces.studies.platform_model import ModelTable, model_of, on_rig, true_errors
from inercal.faces.studies.tables import replaced, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.units import parse_quantity
from inercal.systems.selfcal.disturbances import Disturbances
from inercal.systems.selfcal.platform.coefficients import BETA, EXTENDED, GROUPS
from inercal.systems.selfcal.platform.joint_limits import JointLimits
from inercal.systems.selfcal.platform.rig import Base, Gimbals
from inercal.systems.selfcal.platform.states import STATES
from inercal.systems.selfcal.settings import Filter, Gating, RecordOnBase, SelfcalSettings


def _small(group: str) -> QuantityText:
    """A value of a group: misalignments of some degrees and scale errors of a half are none."""
    dimension, example = STATES[group].dimension, STATES[group].example
    limit, words = {
        "angle": (math.radians(10.0), "an angle within 10 deg"),
        "number": (0.5, "a scale error within 0.5"),
    }.get(dimension, (math.inf, ""))
    return QuantityText(dimension, example, lambda value: abs(value) <= limit, words)


def _true_values() -> dict[str, Any]:
    """Fields of three true values for each group."""
    fields = {}
    for group in GROUPS:
        words = STATES[group].words
        texts = SeveralTexts(_small(group), ", ".join(GROUPS[group][0]))
        fields[group] = (
            Annotated[Several, texts] | None,
            Field(default=None, description=f"{words}; 0 if absent"),
        )
    return fields


_TRUE: Any = create_model("TrueValues", __base__=Strict, **_true_values())


class TruthTable(_TRUE):  # type: ignore[misc]
    """True coefficients of a simulation, in the product form, three of each group."""


def _of_deviations(what: str, note: str) -> dict[str, Any]:
    """Fields of one standard deviation for each group, or three; ``note`` on what absent ones mean."""
    fields = {}
    for group in GROUPS:
        state = STATES[group]
        each = QuantityText(state.dimension, state.example, positive, f"{what} above zero")
        texts = SeveralTexts(each, ", ".join(GROUPS[group][0]), one=True)
        described = f"of {state.words}; {note.format(state.prior)} if absent"
        fields[group] = (Annotated[Several, texts] | None, Field(default=None, description=described))
    return fields


_BY_GROUP: Any = create_model("ByGroup", __base__=Strict, **_of_deviations("a standard deviation", "{}"))
_WANTED: Any = create_model("Wanted", __base__=Strict, **_of_deviations("a standard uncertainty", "no goal"))


class PriorTable(_BY_GROUP):  # type: ignore[misc]
    """Standard deviations of the coefficients about 0 before the test: one for a group, or three.

    To that of the encoders' zero the uncertainties of heading and tilt are added.
    """


class GoalTable(_WANTED):  # type: ignore[misc]
    """Wanted standard uncertainties: one for a group, or three."""


class FilterTable(table_of(Filter)):  # type: ignore[misc]
    """Choice and settings of the estimator."""

    gating: Literal["off", "any", "two", "channel"] = Field(
        default="off",
        description="near-level gating: stop where any accelerometer is near level, where two are, or each by itself",
    )
    gating_stops: Literal["accelerometers", "step"] = Field(
        default="accelerometers", description="what gating stops: the accelerometers, or the whole update"
    )


_ON_RIG: Any = create_model("OnRig", __base__=table_of(Disturbances), **true_errors())


class DisturbancesTable(_ON_RIG):  # type: ignore[misc]
    """Disturbances that a simulation adds to the model; none if absent."""


class SelfcalStudyFile(table_of(SelfcalSettings), StudyFile):  # type: ignore[misc]
    """A study of a self-calibration, for `inercal simulate selfcal`, `design selfcal` and `selfcal`."""

    rig: GimbalsTable = Field(title="Rig", description="the gimbals and their base")
    records: list[PlacedRecordTable] = Field(
        default=[],
        title="Records",
        description="records on bases of their own, fitted together; one base for all if absent",
        examples=[[{"file": "south.csv", "heading": "180 deg"}]],
    )
    plan: CommandTable | None = Field(
        default=None, title="Plan", description="the path; a recording can do without"
    )
    truth: TruthTable | None = Field(
        default=None, title="Truth", description="true coefficients, for simulations"
    )
    model: ModelTable = Field(
        default=ModelTable(), title="Model", description="errors of the rig, estimated or stated"
    )
    prior: PriorTable = Field(
        default=PriorTable(), title="Prior", description="what is known before the test"
    )
    goal: GoalTable = Field(default=GoalTable(), title="Goal", description="wanted uncertainties")
    filter: FilterTable = Field(default=FilterTable(), title="Filter", description="the estimator")
    disturbances: DisturbancesTable = Field(
        default=DisturbancesTable(), title="Disturbances", description="what a simulation adds to the model"
    )


def selfcal_study(data: Mapping[str, Any], path: str | Path) -> SelfcalSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it.
    """
    file: Any = check(SelfcalStudyFile, data, path, StudyError)
    base, fixed, joints = (
        settings_of(Base, file.rig),
        file.rig.fixed.by_joint,
        settings_of(JointLimits, file.rig),
    )
    truth = None if file.truth is None else np.append(_truth(file.truth), on_rig(file.disturbances))
    return settings_of(
        SelfcalSettings,
        file,
        site=_site(file.site, path),
        prior=_prior(file.prior, base),
        gimbals=settings_of(Gimbals, file.rig),
        base=base,
        heading_unknown=isinstance(file.rig.heading, Word),
        limits=file.rig.limits.by_joint,
        joints=joints,
        fixed=fixed,
        plan=None if file.plan is None else plan_of(file.plan, fixed, joints, path),
        truth=truth,
        goal=_wanted(file.goal),
        filter=_filter(file.filter),
        model=model_of(file.model, file.filter, path),
        disturbances=settings_of(Disturbances, file.disturbances),
        placed=tuple(_placed(record, file) for record in file.records),
        **file.shared(data),
    )


def _placed(table: PlacedRecordTable, file: Any) -> RecordOnBase:
    """A record with its base."""
    base = replaced(settings_of(Base, file.rig), table)
    typed = table.heading or file.rig.heading
    return RecordOnBase(table.file, base, isinstance(typed, Word), _prior(file.prior, base))


def _site(table: SiteTable, path: str | Path) -> Site:
    """The site; its gravity is as uncertain as typed.

    Scale errors of parts in 1e7 are found against gravity; the uncertainty that other studies take for granted where
    none is typed would hide all that the noise does, so it is left to a finding.
    """
    site = site_on_earth(table, path, "rig")
    if table.gravity is not None or (table.height is not None and table.height.u > 0.0):
        return site
    return replace(site, inputs=tuple(each for each in site.inputs if each.source == "latitude"))


def _prior(table: PriorTable, base: Base) -> Array:
    """(24,) standard deviations; that of beta with the uncertainty of the base, about the axes of b."""
    prior = np.concatenate(
        [
            [parse_quantity(STATES[group].prior, STATES[group].dimension, group).value] * 3
            if (given := getattr(table, group)) is None
            else given.values
            for group in GROUPS
        ]
    )
    (north, east), up = base.tilt_u, base.heading_u
    prior[BETA] = np.sqrt(prior[BETA] ** 2 + base.from_geographic() ** 2 @ np.square([north, east, up]))
    return prior


def _truth(table: TruthTable) -> Array:
    """(24,) true coefficients."""
    return np.concatenate(
        [(0.0,) * 3 if (given := getattr(table, group)) is None else given.values for group in GROUPS]
    )


def _wanted(table: GoalTable) -> dict[str, float]:
    """Wanted standard uncertainty by name of coefficient."""
    return {
        name: value
        for k, group in enumerate(GROUPS)
        if (given := getattr(table, group)) is not None
        for name, value in zip(EXTENDED[3 * k : 3 * k + 3], given.values, strict=True)
    }


def _filter(table: Any) -> Filter:
    """The estimator."""
    gating = None if table.gating == "off" else Gating(table.gating, table.gating_stops)
    return settings_of(Filter, table, gating=gating)
