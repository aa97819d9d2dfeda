"""The motion of a simulated wind-tunnel model in a study, and what disturbs it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from pydantic import Field, model_validator

from inercal.aoa.layout import Layout
from inercal.aoa.motion import duration, moves
from inercal.aoa.settings import AngleShaking, Calibration, Disturbances, MotionPlan, Oscillation, Shaking
from inercal.errors import StudyError
from inercal.studies.fields import refusal
from inercal.studies.tables import Stated, settings_of, table_of
from inercal.units import shown

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


def disturbances_of(
    table: AoaDisturbancesTable, layout: Layout, sensors: dict[str, Calibration], where: object
) -> Disturbances:
    """Disturbances of a simulation, in SI.

    Raises `StudyError` for frequencies out of order, heights for another number of accelerometers, clipping without a
    range.
    """
    shaking = {key: getattr(table, key) for key in ("pitch", "heave", "axial", "roll", "yaw")}
    disturbances = settings_of(Disturbances, table, **shaking)
    for key, each in shaking.items():
        if isinstance(each, Shaking):
            _ordered(each.low, each.high, f"disturbances.{key}", where)
    if table.heights is not None and len(disturbances.heights) != len(layout.names):
        raise StudyError(
            where,
            f"disturbances.heights: found {len(disturbances.heights)}, expected one for each of "
            f"{', '.join(layout.names)}",
        )
    if table.clip and all(each.range is None for each in sensors.values()):
        raise StudyError(
            where, "disturbances.clip: found true, but no range of a sensor, expected one under [sensors]"
        )
    return disturbances


def _ordered(low: float, high: float, key: str, where: object) -> None:
    """Refuse a band without width."""
    if not low < high:
        raise StudyError(
            where, f"{key}.low: found {low:g} Hz with high {high:g} Hz, expected the lower one here"
        )
