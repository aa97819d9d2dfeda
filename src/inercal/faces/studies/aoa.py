"""The study of an angle of attack: one file for its simulation and its measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from inercal.faces.studies.common import StudyFile, site_of
from inercal.faces.studies.fields import refusal
from inercal.faces.studies.sensors import LayoutTable, SensorsTable, calibrations_of, layout_of, layouts_of
from inercal.faces.studies.tables import settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.units import shown
from inercal.systems.aoa.disturbances import Disturbances, check_band
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import MotionPlan, duration, moves
from inercal.systems.aoa.settings import GYROS, AoaSettings, Attitude, Flow, ModelAttitude, SensorCalibration

MOST_ROWS = 20_000_000
"""Samples that a simulation may have."""


class StingTable(Strict):
    """Support of the model."""

    kind: Literal["sting"] = Field(description="a model that pitches about a pivot, on a sting")


class AoaStudyFile(table_of(AoaSettings), StudyFile):  # type: ignore[misc]
    """A study of inertial angle of attack, for `inercal simulate aoa` and `aoa`."""

    rig: StingTable = Field(title="Rig", description="what carries the model")
    sensors: SensorsTable = Field(title="Sensors", description="the sensors, by the names of their columns")
    model: table_of(ModelAttitude) = Field(  # type: ignore[valid-type]
        default=table_of(ModelAttitude)(), title="Model", description="how the model lies"
    )
    flow: table_of(Flow) = Field(  # type: ignore[valid-type]
        default=table_of(Flow)(), title="Flow", description="angularity of the flow"
    )
    layouts: dict[str, LayoutTable] = Field(
        default_factory=dict,
        title="Layouts",
        description="what `inercal design aoa` sets beside [sensors], each a table of a name of one's own: of each "
        "accelerometer what differs, and all of further ones",
        examples=[{"long": {"a1": {"r": "-0.3 m"}, "a3": {"r": "0.3 m"}}}],
    )

    @model_validator(mode="before")
    @classmethod
    def _no_search(cls, data: Any) -> Any:
        """Refuse the table of the search for places, which 0.2.0 had."""
        if isinstance(data, Mapping) and "design" in data:
            raise refusal(
                "design: found, which is gone since 0.3.0, expected in its place [layouts.NAME], places to compare"
            )
        return data


def aoa_study(data: Mapping[str, Any], path: str | Path) -> AoaSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it, and those of motion and
    prior are read only where they are needed.
    """
    file: Any = check(AoaStudyFile, data, path, StudyError)
    layout, sensors = layout_of(file.sensors), calibrations_of(file.sensors, path)
    motion = None if file.motion is None else _motion(file.motion, data["motion"], path)
    prior = file.estimator.prior
    _check_disturbances(file.disturbances, layout, sensors, motion, path)
    return settings_of(
        AoaSettings,
        file,
        site=site_of(file.site, path),
        layout=layout,
        sensors=sensors,
        estimator=replace(file.estimator, prior=None if prior is None else Path(path).parent / prior),
        attitude=settings_of(Attitude, file.model, file.flow),
        motion=motion,
        layouts=layouts_of(data, path),
        **file.shared(data),
    )


def _motion(plan: MotionPlan, typed: Mapping[str, Any], where: str | Path) -> MotionPlan:
    """The motion, its file beside the study.

    Raises `StudyError` for frequencies out of order, steps that do not lead from first to last, too many samples.
    """
    if plan.path is not None:
        whole = plan.duration if "duration" in typed else math.inf
        plan = replace(plan, path=Path(where).parent / plan.path, duration=whole)
    if {"low", "high"} & typed.keys():
        try:
            check_band(plan.low, plan.high)
        except InputError as error:
            raise StudyError(where, f"motion.{error}") from error
    if plan.kind == "pitch-pause":
        count = (plan.last - plan.first) / plan.step if plan.step else -1.0
        if count < 0.0 or abs(count - moves(plan)) > 1e-6:
            raise StudyError(
                where,
                f"motion.step: found {shown(typed['step'])}, expected steps that lead from first to last",
            )
    rows = 0.0 if plan.kind == "file" else duration(plan) * plan.sample_rate
    if plan.kind != "file" and not 2.0 <= rows <= MOST_ROWS:
        raise StudyError(where, f"motion: found {rows:.4g} samples, expected 2 to {MOST_ROWS:.0e}")
    return plan


def _check_disturbances(
    disturbances: Disturbances,
    layout: Layout,
    sensors: Mapping[str, SensorCalibration],
    motion: MotionPlan | None,
    where: str | Path,
) -> None:
    """Refuse lists for another number of accelerometers, rates of sensors that do not divide that of the motion, and
    clipping without a range."""
    _check_sample_rates(disturbances.sample_rates, layout, motion, where)
    for key in ("heights", "axis_errors", "bias_drift"):
        found = len(getattr(disturbances, key))
        if found not in (0, len(layout.names)):
            raise StudyError(
                where,
                f"disturbances.{key}: found {found}, expected one for each of {', '.join(layout.names)}",
            )
    if disturbances.clip and all(sensor.range is None for sensor in sensors.values()):
        raise StudyError(
            where, "disturbances.clip: found true, but no range of a sensor, expected one under [sensors]"
        )


def _check_sample_rates(
    stated: Mapping[str, float], layout: Layout, motion: MotionPlan | None, where: object
) -> None:
    """Refuse a rate [Hz] of a sensor, by its name, that is not the motion's over a whole number."""
    names = (*layout.names, *GYROS)
    for name, rate in stated.items():
        key = f"disturbances.sample_rates.{name}"
        if name not in names:
            raise StudyError(where, f"{key}: found no such sensor, expected one of {', '.join(names)}")
        if motion is None:
            raise StudyError(where, f"{key}: found without a [motion], expected one with its sample_rate")
        ratio = motion.sample_rate / rate
        if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
            raise StudyError(
                where,
                f"{key}: found {rate:g} Hz, expected motion.sample_rate, {motion.sample_rate:g} Hz, over a "
                "whole number",
            )
