"""The study of a self-calibration: one file for its simulation, path design and estimation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from inercal.faces.studies.common import SiteTable, StudyFile, site_on_earth
from inercal.faces.studies.fields import Word
from inercal.faces.studies.platform import CommandTable, GimbalsTable, plan_of
from inercal.faces.studies.tables import Stated, replaced, settings_of, table_of
from inercal.foundation._toml import check
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import Site
from inercal.systems.selfcal.disturbances import Disturbances
from inercal.systems.selfcal.platform.joint_limits import JointLimits
from inercal.systems.selfcal.platform.rig import Base, Gimbals
from inercal.systems.selfcal.settings import Filter, Gating, PlacedRecord, RecordOnBase, SelfcalSettings
from inercal.systems.selfcal.stated import Goal, PriorDeviations, RigModel, TrueCoefficients, TrueErrors


class FilterTable(table_of(Gating), table_of(Filter)):  # type: ignore[misc]
    """Choice and settings of the estimator."""


class DisturbancesTable(table_of(TrueErrors), table_of(Disturbances)):  # type: ignore[misc]
    """Disturbances that a simulation adds to the model; none if absent."""


class SelfcalStudyFile(table_of(SelfcalSettings), StudyFile):  # type: ignore[misc]
    """A study of a self-calibration, for `inercal simulate selfcal`, `design selfcal` and `selfcal`."""

    rig: GimbalsTable = Field(title="Rig", description="the gimbals and their base")
    records: list[table_of(PlacedRecord)] = Field(  # type: ignore[valid-type]
        default=[],
        title="Records",
        description="records on bases of their own, fitted together; one base for all if absent",
        examples=[[{"file": "south.csv", "heading": "180 deg"}]],
    )
    plan: CommandTable | None = Field(
        default=None, title="Plan", description="the path; a recording can do without"
    )
    truth: Stated[TrueCoefficients] | None = Field(
        default=None, title="Truth", description="true coefficients, for simulations"
    )
    model: Stated[RigModel] = Field(
        default=RigModel(), title="Model", description="errors of the rig, estimated or stated"
    )
    prior: Stated[PriorDeviations] = Field(
        default=PriorDeviations(), title="Prior", description="what is known before the test"
    )
    goal: Stated[Goal] = Field(default=Goal(), title="Goal", description="wanted uncertainties")
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
    on_rig = settings_of(TrueErrors, file.disturbances).values
    gating = settings_of(Gating, file.filter)
    filter = settings_of(Filter, file.filter, gating=None if gating.rule == "off" else gating)
    return settings_of(
        SelfcalSettings,
        file,
        site=_site(file.site, path),
        prior=file.prior.of(base),
        gimbals=settings_of(Gimbals, file.rig),
        base=base,
        heading_unknown=isinstance(file.rig.heading, Word),
        limits=file.rig.limits.by_joint,
        joints=joints,
        fixed=fixed,
        plan=None if file.plan is None else plan_of(file.plan, fixed, joints, path),
        truth=None if file.truth is None else np.append(file.truth.values, on_rig),
        goal=file.goal.by_name,
        filter=filter,
        model=file.model.of(filter, path),
        disturbances=settings_of(Disturbances, file.disturbances),
        placed=tuple(_placed(record, file) for record in file.records),
        **file.shared(data),
    )


def _placed(table: Any, file: Any) -> RecordOnBase:
    """A record with its base."""
    base = replaced(settings_of(Base, file.rig), table)
    typed = table.heading or file.rig.heading
    return RecordOnBase(table.file, base, isinstance(typed, Word), file.prior.of(base))


def _site(table: SiteTable, path: str | Path) -> Site:
    """The site; its gravity is as uncertain as typed.

    Scale errors of parts in 1e7 are found against gravity; the uncertainty that other studies take for granted where
    none is typed would hide all that the noise does, so it is left to a finding.
    """
    site = site_on_earth(table, path, "rig")
    if table.gravity is not None or (table.height is not None and table.height.u > 0.0):
        return site
    return replace(site, inputs=tuple(each for each in site.inputs if each.source == "latitude"))
