"""The motion of a simulated wind-tunnel model in a study, and what disturbs it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, StrictBool, model_validator

from inercal._toml import Strict
from inercal.aoa.layout import Layout
from inercal.aoa.motion import duration, moves
from inercal.aoa.settings import (
    Calibration,
    Disturbances,
    MotionKind,
    MotionPlan,
    Oscillation,
    Shaking,
)
from inercal.errors import StudyError
from inercal.studies.fields import Duration, QuantityText, positive, refusal
from inercal.units import Quantity, shown

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

_PITCH = QuantityText(
    "angle", "30 deg", lambda a: abs(a) <= 2.0 * math.pi, "an angle from -360 deg to 360 deg"
)
_Pitch = Annotated[Quantity, _PITCH]
_SIZE = QuantityText("angle", "10 deg", lambda a: 0.0 <= a <= math.pi, "an angle from 0 to 180 deg")
_Size = Annotated[Quantity, _SIZE]
_Frequency = Annotated[Quantity, QuantityText("frequency", "1 Hz", positive, "a frequency above zero")]
_Part = Annotated[
    Quantity, QuantityText("number", "0.1 %", lambda p: 0.0 <= p < 1.0, "a part from 0 to below 1")
]
_Delay = Annotated[
    Quantity, QuantityText("time", "2 ms", lambda t: abs(t) <= 1.0, "a delay from -1 s to 1 s")
]
_Force = Annotated[
    Quantity, QuantityText("acceleration", "0.03 g", lambda a: a >= 0.0, "an acceleration of 0 or more")
]
_Shift = Annotated[
    Quantity,
    QuantityText("length", "3 mm", lambda d: abs(d) <= 1.0, "a length within 1 m (mm given as m?)"),
]


def of_other_kinds(kind: object) -> frozenset[str]:
    """The keys that a motion of that kind does not heed, but others do; none where there is no such kind."""
    if kind not in _KEYS:
        return frozenset()
    every = {key for keys in _KEYS.values() for part in keys for key in part}
    return frozenset(every.difference(*_KEYS[str(kind)]))


class MotionTable(Strict):
    """Pitch of the model in a simulation: its kind, and the keys of that kind."""

    kind: MotionKind = Field(
        description="static: a sweep; pitch-pause: steps with pauses; sine; two-tone; chirp; buffet: random; file: as "
        "recorded"
    )
    duration: Duration | None = Field(
        default=None, description="of all kinds but pitch-pause; 60 s, or all of a file, if absent"
    )
    sample_rate: _Frequency | None = Field(default=None, description="samples per second; 1 kHz if absent")
    mean: _Pitch | None = Field(
        default=None, description="of sine, two-tone, chirp and buffet; 0 deg if absent"
    )
    amplitude: _Size | None = Field(default=None, description="of sine, two-tone and chirp")
    frequency: _Frequency | None = Field(default=None, description="of sine and two-tone")
    second_amplitude: _Size | None = Field(default=None, description="of the second sine of two-tone")
    second_frequency: _Frequency | None = Field(default=None, description="of the second sine of two-tone")
    low: _Frequency | None = Field(
        default=None, description="lowest frequency of chirp, buffet and of the buffet in a pitch-pause"
    )
    high: _Frequency | None = Field(default=None, description="highest frequency of those")
    rms: _Size | None = Field(
        default=None, description="of the buffet, in all; in a pitch-pause none if absent"
    )
    first: _Pitch | None = Field(default=None, description="angle at the start of static and pitch-pause")
    last: _Pitch | None = Field(default=None, description="angle at the end of static and pitch-pause")
    step: _Pitch | None = Field(default=None, description="of pitch-pause, negative downward")
    move: Duration | None = Field(default=None, description="time of a move of pitch-pause; 1.5 s if absent")
    pause: Duration | None = Field(default=None, description="time of a pause of pitch-pause; 4 s if absent")
    file: str | None = Field(
        default=None,
        min_length=1,
        description="of kind file: a record beside the study with the columns t and theta_ref",
        examples=["pitch.csv"],
    )

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

    Raises
    ------
    StudyError
        Frequencies out of order, steps that do not lead from first to last, too many samples.
    """
    keys = {
        key: getattr(table, key).value
        for key in type(table).model_fields
        if key not in ("kind", "file") and getattr(table, key) is not None
    }
    if table.file is not None:
        keys = {"duration": math.inf} | keys
    path = None if table.file is None else Path(where).parent / table.file
    plan = MotionPlan(table.kind, path=path, **keys)
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


class ShakingTable(Strict):
    """A random vibration, 40 equal sines."""

    rms: _Force = Field(description="in all")
    low: _Frequency = Field(description="lowest frequency")
    high: _Frequency = Field(description="highest frequency")


class AngleShakingTable(Strict):
    """A random vibration of an angle, 40 equal sines."""

    rms: _Size = Field(description="in all")
    low: _Frequency = Field(description="lowest frequency")
    high: _Frequency = Field(description="highest frequency")


class OscillationTable(Strict):
    """A rigid oscillation."""

    amplitude: _Size = Field(description="of the angle")
    frequency: _Frequency = Field(description="of the sine")


class AoaDisturbancesTable(Strict):
    """What a simulation adds to the rigid, well-known model; nothing if absent."""

    pitch: AngleShakingTable | None = Field(
        default=None, title="Pitch", description="flexure of the sting in pitch"
    )
    heave: ShakingTable | None = Field(default=None, title="Heave", description="flexure along z")
    axial: ShakingTable | None = Field(default=None, title="Axial", description="flexure along x")
    roll: OscillationTable | None = Field(default=None, title="Roll", description="roll coupled in")
    yaw: OscillationTable | None = Field(default=None, title="Yaw", description="yaw coupled in")
    pivot: _Shift | None = Field(default=None, description="added to all positions r; 0 if absent")
    heights: list[_Shift] | None = Field(
        default=None, description="added to the heights z, one for each accelerometer; 0 if absent"
    )
    gyro_scale: (
        Annotated[Quantity, QuantityText("number", "0.1 %", lambda k: abs(k) <= 0.5, "within 50 %")] | None
    ) = Field(default=None, description="scale error of the gyro; 0 if absent")
    gyro_delay: _Delay | None = Field(
        default=None, description="by which the gyro comes later than the accelerometers; 0 if absent"
    )
    common_delay: _Delay | None = Field(
        default=None, description="by which all sensors come later than their stamps; 0 if absent"
    )
    bandwidth: _Frequency | None = Field(
        default=None, description="of all sensors, first order; without limit if absent"
    )
    spikes: _Part | None = Field(
        default=None, description="part of the samples of each sensor that are spikes; 0 if absent"
    )
    spike: _Force | None = Field(
        default=None, description="size of a spike, of a gyro 1 rad/s for each g; 0.5 g if absent"
    )
    clip: StrictBool = Field(default=False, description="limit sensors to their ranges")
    dropouts: _Part | None = Field(default=None, description="part of the rows that are empty; 0 if absent")


def disturbances_of(
    table: AoaDisturbancesTable, layout: Layout, sensors: dict[str, Calibration], where: object
) -> Disturbances:
    """What a simulation adds, in SI.

    Raises
    ------
    StudyError
        Frequencies out of order, heights for another number of accelerometers, clipping without a range.
    """
    found: dict[str, Any] = {}
    for key in type(table).model_fields:
        given = getattr(table, key)
        if isinstance(given, Quantity):
            found[key] = given.value
        elif isinstance(given, ShakingTable | AngleShakingTable):
            _ordered(given.low.value, given.high.value, f"disturbances.{key}", where)
            found[key] = Shaking(given.rms.value, given.low.value, given.high.value)
        elif isinstance(given, OscillationTable):
            found[key] = Oscillation(given.amplitude.value, given.frequency.value)
    if table.heights is not None:
        if len(table.heights) != len(layout.names):
            raise StudyError(
                where,
                f"disturbances.heights: found {len(table.heights)}, expected one for each of "
                f"{', '.join(layout.names)}",
            )
        found["heights"] = tuple(each.value for each in table.heights)
    if table.clip and all(each.range is None for each in sensors.values()):
        raise StudyError(
            where, "disturbances.clip: found true, but no range of a sensor, expected one under [sensors]"
        )
    return Disturbances(clip=table.clip, **found)


def _ordered(low: float, high: float, key: str, where: object) -> None:
    """Refuse a band without width."""
    if not low < high:
        raise StudyError(
            where, f"{key}.low: found {low:g} Hz with high {high:g} Hz, expected the lower one here"
        )
