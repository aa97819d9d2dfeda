"""The motion of a simulated wind-tunnel model in a study, and what disturbs it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from inercal.faces.studies.fields import ExactText, refusal
from inercal.faces.studies.tables import Stated, settings_of, table_of
from inercal.foundation.errors import StudyError
from inercal.foundation.keys import FREQUENCY
from inercal.foundation.units import Quantity, shown
from inercal.systems.aoa.disturbances import (
    AngleShaking,
    Disturbances,
    Mains,
    Oscillation,
    Plunge,
    Shaking,
    VibrationLine,
)
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import duration, moves
from inercal.systems.aoa.settings import GYROS, MotionPlan, SensorCalibration

MOST_ROWS = 20_000_000
"""Samples that a simulation may have."""

#: kind of motion -> keys that it needs, keys that it heeds besides
_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "static": (("first", "last"), ("duration",)),
    "pitch-pause": (("first", "last", "step"), ("move", "pause", "rms", "low", "high")),
    "sine": (("amplitude", "frequency"), ("mean", "duration")),
    "two-tone": (
        ("amplitude", "frequency", "second_amplitude", "second_frequency"),
        ("mean", "duration"),
    ),
    "chirp": (("amplitude", "low", "high"), ("mean", "duration")),
    "buffet": (("rms", "low", "high"), ("mean", "duration")),
    "file": (("file",), ("duration",)),
}


def of_other_kinds(kind: object) -> frozenset[str]:
    """The keys that a motion of that kind does not heed, but others do; none where there is no such kind."""
    if kind not in _KEYS:
        return frozenset()
    every = {key for keys in _KEYS.values() for part in keys for key in part}
    return frozenset(every.difference(*_KEYS[str(kind)]))


class MotionTable(table_of(MotionPlan)):  # type: ignore[misc]
    """Pitch of the model in a simulation: its kind, and the keys of that kind."""

    @model_validator(mode="after")
    def _of_the_kind(self) -> MotionTable:
        """Refuse keys of other kinds, and missing ones."""
        needed, heeded = _KEYS[self.kind]
        for key in type(self).model_fields:
            if key in ("kind", "sample_rate"):
                continue
            there = getattr(self, key) is not None
            if there and key not in (*needed, *heeded):
                kinds = [kind for kind, keys in _KEYS.items() if key in (*keys[0], *keys[1])]
                raise refusal(
                    f"{key}: found with kind = {self.kind!r}, expected it with {' or '.join(kinds)} only"
                )
            if not there and key in needed:
                raise refusal(f"{key}: missing, expected it with kind = {self.kind!r}")
        return self


def motion_of(table: MotionTable, where: str | Path) -> MotionPlan:
    """The motion in SI.

    Raises `StudyError` for frequencies out of order, steps that do not lead from first to last, too many samples.
    """
    plan = settings_of(MotionPlan, table)
    if plan.path is not None:
        whole = plan.duration if table.duration is not None else math.inf
        plan = replace(plan, path=Path(where).parent / plan.path, duration=whole)
    if table.low is not None or table.high is not None:
        _ordered(plan.low, plan.high, "motion", where)
    if table.kind == "pitch-pause":
        count = (plan.last - plan.first) / plan.step if plan.step else -1.0
        if count < 0.0 or abs(count - moves(plan)) > 1e-6:
            assert table.step is not None
            raise StudyError(
                where,
                f"motion.step: found {shown(table.step.text)}, expected steps that lead from first to last",
            )
    rows = 0.0 if table.kind == "file" else duration(plan) * plan.sample_rate
    if table.kind != "file" and not 2.0 <= rows <= MOST_ROWS:
        raise StudyError(where, f"motion: found {rows:.4g} samples, expected 2 to {MOST_ROWS:.0e}")
    return plan


_SampleRate = Annotated[Quantity, ExactText("frequency", "250 Hz", FREQUENCY.accept, FREQUENCY.words)]

_PARTS = ("pitch", "heave", "axial", "roll", "yaw", "buffet", "plunge", "local_vibration", "mains")
"""Disturbances that are tables of their own."""


class AoaDisturbancesTable(table_of(Disturbances)):  # type: ignore[misc]
    """Disturbances that a simulation adds to the rigid, well-known model; none if absent."""

    pitch: Stated[AngleShaking] | None = Field(
        default=None,
        title="Pitch",
        description="flexure of the sting in pitch",
        examples=[{"rms": "0.1 deg", "low": "8 Hz", "high": "10 Hz"}],
    )
    heave: Stated[Shaking] | None = Field(
        default=None,
        title="Heave",
        description="flexure along z",
        examples=[{"rms": "0.03 g", "low": "8 Hz", "high": "10 Hz"}],
    )
    axial: Stated[Shaking] | None = Field(
        default=None,
        title="Axial",
        description="flexure along x",
        examples=[{"rms": "0.005 g", "low": "14 Hz", "high": "16 Hz"}],
    )
    roll: Stated[Oscillation] | None = Field(
        default=None,
        title="Roll",
        description="roll coupled in; adds gyro_roll and gyro_yaw",
        examples=[{"amplitude": "1 deg", "frequency": "8 Hz"}],
    )
    yaw: Stated[Oscillation] | None = Field(
        default=None,
        title="Yaw",
        description="yaw coupled in; adds gyro_roll and gyro_yaw",
        examples=[{"amplitude": "1 deg", "frequency": "8 Hz"}],
    )
    buffet: Stated[AngleShaking] | None = Field(
        default=None,
        title="Buffet",
        description="random pitching by the stream, 150 sines, beside the motion",
        examples=[{"rms": "0.1 deg", "low": "5 Hz", "high": "40 Hz"}],
    )
    plunge: Stated[Plunge] | None = Field(
        default=None,
        title="Plunge",
        description="the whole model goes up and down",
        examples=[{"level": "0.02 g", "frequency": "2 Hz"}],
    )
    lines: list[Stated[VibrationLine]] = Field(
        default=[],
        description="lines of the tunnel's vibration, which shake the whole model",
        examples=[[{"frequency": "112 Hz", "level": "0.3 g"}]],
    )
    local_vibration: Stated[Shaking] | None = Field(
        default=None,
        title="Local vibration",
        description="of each accelerometer by itself, as of the structure that it sits on",
        examples=[{"rms": "0.5 g", "low": "120 Hz", "high": "240 Hz"}],
    )
    mains: Stated[Mains] | None = Field(
        default=None,
        title="Mains",
        description="pick-up in each channel by itself",
        examples=[{"level": "50 mg", "frequency": "50 Hz"}],
    )
    sample_rates: dict[str, _SampleRate] = Field(
        default={},
        description="of sensors that are slower than motion.sample_rate, which is a whole number of times theirs; the "
        "recording then goes to .h5 or .nc",
        examples=[{"gyro": "250 Hz"}],
    )


def disturbances_of(
    table: AoaDisturbancesTable,
    layout: Layout,
    sensors: dict[str, SensorCalibration],
    motion: MotionPlan | None,
    where: object,
) -> Disturbances:
    """Disturbances of a simulation, in SI.

    Raises `StudyError` for frequencies out of order, lists for another number of accelerometers, rates of sensors that
    do not divide that of the motion, clipping without a range.
    """
    parts: dict[str, Any] = {key: getattr(table, key) for key in _PARTS}
    parts["lines"] = tuple(table.lines)
    parts["sample_rates"] = _sample_rates(table.sample_rates, layout, motion, where)
    disturbances = settings_of(Disturbances, table, **parts)
    for key, each in parts.items():
        if isinstance(each, Shaking):
            _ordered(each.low, each.high, f"disturbances.{key}", where)
    for key in ("heights", "axis_errors", "bias_drift"):
        found = len(getattr(disturbances, key))
        if getattr(table, key) is not None and found != len(layout.names):
            raise StudyError(
                where,
                f"disturbances.{key}: found {found}, expected one for each of {', '.join(layout.names)}",
            )
    if table.clip and all(each.range is None for each in sensors.values()):
        raise StudyError(
            where, "disturbances.clip: found true, but no range of a sensor, expected one under [sensors]"
        )
    return disturbances


def _sample_rates(
    stated: dict[str, Quantity], layout: Layout, motion: MotionPlan | None, where: object
) -> dict[str, float]:
    """Rates [Hz] of sensors by name, each that of the motion over a whole number."""
    names = (*layout.names, *GYROS)
    for name, rate in stated.items():
        key = f"disturbances.sample_rates.{name}"
        if name not in names:
            raise StudyError(where, f"{key}: found no such sensor, expected one of {', '.join(names)}")
        if motion is None:
            raise StudyError(where, f"{key}: found without a [motion], expected one with its sample_rate")
        ratio = motion.sample_rate / rate.value
        if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
            raise StudyError(
                where,
                f"{key}: found {shown(rate.text)}, expected motion.sample_rate, {motion.sample_rate:g} Hz, over a "
                "whole number",
            )
    return {name: rate.value for name, rate in stated.items()}


def _ordered(low: float, high: float, key: str, where: object) -> None:
    """Refuse a band without width."""
    if not low < high:
        raise StudyError(
            where, f"{key}.low: found {low:g} Hz with high {high:g} Hz, expected the lower one here"
        )
