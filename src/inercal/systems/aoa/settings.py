"""Settings of a study of inertial angle of attack, in SI: sensors, noise, prior, motion, timing, estimator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import (
    DEVIATION,
    FREQUENCY,
    REQUIRED,
    TIME,
    Bounds,
    above_zero,
    option,
    quantity,
    table,
    within,
)
from inercal.foundation.units import STANDARD_GRAVITY, Quantity
from inercal.systems.aoa.alarm import AlarmLimits
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.disturbances import DELAY, Disturbances
from inercal.systems.aoa.estimators import WORDS, Centrifugal, EstimatorKind, States, Static, Tangential
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.motion import MotionPlan

Per = Literal["1", "V", "count"]
Direction = Literal["z", "vertical"]
PointsBy = Literal["auto", "point", "trigger", "pause"]

GYROS = ("gyro", "gyro_roll", "gyro_yaw")

_OF_BIASES = Bounds(
    lambda deviation: 0.0 < deviation <= 0.3 * STANDARD_GRAVITY,
    f"{DEVIATION.words}, 0.3 g at most, or gravity cannot be told from it (mg given as g?)",
)
_OF_PLACES = Bounds(
    lambda deviation: 0.0 < deviation <= 1.0, f"{DEVIATION.words}, 1 m at most (mm given as m?)"
)
_ANY_ANGLE = within(-math.pi, math.pi, "an angle from -180 deg to 180 deg")
_OF_THE_STREAM = within(-0.25 * math.pi, 0.25 * math.pi, "an angle from -45 deg to 45 deg")
_WALK = within(0.0, math.inf, "a random walk of 0 or more")
_K2 = within(0.0, 0.1, "a coefficient from 0 to 0.1 s^2/m")
_WAIT = within(0.0, 1e6, "a time of 0 or more")
_INSTANT = within(-1e10, 1e10, "a time of the record")
_DAMPING = Bounds(lambda damping: 0.0 < damping < 1.0, "a relative damping above 0, below 1")


@dataclass(frozen=True)
class Noise:
    """Noise of each sample, and unknown biases: standard deviations."""

    accelerometer: float = quantity(
        "of a sample of an accelerometer", "acceleration", REQUIRED, example="1e-4 g", bounds=DEVIATION
    )
    # a bias near gravity leaves the angle unknown, which no u of first order can say
    accelerometer_bias: float = quantity(
        "of the accelerometers' biases, half its variance common to all; 0.3 g at most", "acceleration", REQUIRED,
        example="1e-4 g", bounds=_OF_BIASES,
    )  # fmt: skip
    gyro: float = quantity("of a sample of a gyro", "rate", REQUIRED, example="0.2 deg/s", bounds=DEVIATION)
    gyro_bias: float = quantity("of the gyros' biases", "rate", REQUIRED, example="5 deg/h", bounds=DEVIATION)
    accelerometer_walk: float = quantity(
        "random walk of each accelerometer's bias, for the fusion", "acceleration random walk", "0 ug/sqrt(s)",
        example="10 ug/sqrt(s)", bounds=_WALK,
    )  # fmt: skip
    gyro_walk: float = quantity(
        "random walk of each gyro's bias, for the fusion", "rate random walk", "0 deg/h/sqrt(s)",
        example="0.1 deg/h/sqrt(s)", bounds=_WALK,
    )  # fmt: skip
    rectification: float = quantity(
        "largest second-order coefficient K2 of an accelerometer: the offset that vibration makes by it is in u",
        "quadratic", "0 ug/g^2", example="100 ug/g^2", bounds=_K2,
    )  # fmt: skip


@dataclass(frozen=True)
class Resonance:
    """Flexure of the sting as the filter takes it: a band-pass with random input, along an axis of the body."""

    frequency: float = quantity(
        "of the resonance; as usual if absent", "frequency", 12.0, example="9 Hz", bounds=FREQUENCY
    )
    damping: float = quantity(
        "relative to critical; as usual if absent", "number", 0.5, example="0.3", bounds=_DAMPING
    )
    level: float = quantity(
        "standard deviation of the acceleration", "acceleration", "0.01 g", bounds=DEVIATION
    )

    @property
    def omega(self) -> float:
        """Angular frequency [rad/s]."""
        return 2.0 * math.pi * self.frequency

    @property
    def vertical(self) -> bool:
        """True along the vertical, as of a support that plunges."""
        return False


@dataclass(frozen=True)
class Heave(Resonance):
    """The first of both resonances, across the model or along the vertical."""

    frequency: float = quantity(
        "of the resonance; as usual if absent", "frequency", 9.0, example="9 Hz", bounds=FREQUENCY
    )
    damping: float = quantity(
        "relative to critical; as usual if absent", "number", 0.3, example="0.3", bounds=_DAMPING
    )
    direction: Direction = option("across the model, or vertical, as of a support that plunges", "z")

    @property
    def vertical(self) -> bool:
        """True along the vertical, as of a support that plunges."""
        return self.direction == "vertical"


@dataclass(frozen=True)
class Prior:
    """Standard deviations of the sensors' errors about 0 before the run; the usual ones if absent.

    ``rectified`` [m/s^2] is of the offset of each accelerometer by the vibration of a recording.
    """

    lever_common: float = quantity(
        "of all positions r together, the pivot", "length", "3 mm", bounds=_OF_PLACES
    )
    lever: float = quantity("of each position r", "length", "1 mm", bounds=_OF_PLACES)
    height: float = quantity("of each height z", "length", "5 mm", bounds=_OF_PLACES)
    gyro_scale: float = quantity("of the gyro's scale", "number", "0.1 %", bounds=DEVIATION)
    gyro_delay: float = quantity(
        "of the gyro's delay, where it is estimated", "time", "5 ms", bounds=DEVIATION
    )
    heave: Heave = table("flexure along z: 9 Hz, damping 0.3 if absent", Heave())
    axial: Resonance = table("flexure along x: 12 Hz, damping 0.5 if absent", Resonance())
    rectified: float = 0.0


@dataclass(frozen=True)
class SensorCalibration:
    """A sensor's calibration: it measures ``indication x scale - bias``, both with temperature terms.

    ``scale`` SI per SI unit of the record's column, or ``per`` volt or count of it; ``bias`` [SI]; ``scale_slope``
    [1/K] and ``bias_slope`` [SI/K] about ``temperature`` [degC]; ``range`` [SI] of the measured value, at or beyond
    which it is saturated, None where not known. ``caution``: the warning in the file that holds it.
    """

    scale: float = 1.0
    bias: float = 0.0
    range: float | None = None
    scale_slope: float = 0.0
    bias_slope: float = 0.0
    temperature: float = 20.0
    per: Per = "1"
    caution: str = ""

    def measured(self, indication: Array, temperature: Array | float | None = None) -> Array:
        """Measured values [SI] of indications (n,); at its own temperature without ``temperature`` [degC]."""
        scale, bias = self._at(temperature)
        measured = np.asarray(indication * scale)
        measured -= bias
        return measured

    def indicated(self, value: Array, temperature: Array | float | None = None) -> Array:
        """Indications, in SI, volts or counts, of measured values: the inverse of `measured`."""
        scale, bias = self._at(temperature)
        return np.asarray((value + bias) / scale)

    def _at(self, temperature: Array | float | None) -> tuple[Array | float, Array | float]:
        """Scale and bias at a temperature [degC]."""
        off = 0.0 if temperature is None else temperature - self.temperature
        return self.scale * (1.0 + self.scale_slope * off), self.bias + self.bias_slope * off


@dataclass(frozen=True)
class Timing:
    """Delays, positive where outputs come late; a ``gyro_delay`` that is estimated is ``gyro_delay_about`` some value
    [s], that of the spectra."""

    gyro_delay: float | None = quantity(
        "of the gyro against the accelerometers; or estimate", "time", "estimate", example="2 ms", bounds=DELAY,
        exact=True, words={"estimate": None},
    )  # fmt: skip
    common_delay: float = quantity(
        "of all sensors against the stamps, which none of them sees, with its standard uncertainty; 0 if absent",
        "time", 0.0, example="0.5(1) ms", bounds=DELAY, u="common_delay_u",
    )  # fmt: skip
    common_delay_u: float = 0.0
    gyro_delay_about: float = 0.0


@dataclass(frozen=True)
class Estimator:
    """The estimator of the angle; keys other than its kind are of the fusion of all sensors.

    ``snap`` is None where the recording decides (`inercal.systems.aoa.diagnosis.choice`); until then `density`.
    """

    states: States = option("of three accelerometers: 19 all errors, 15, 11, 8 biases alone", 19)
    smooth: bool = option("smooth, which uses later samples too", False)
    prior: Path | None = option(
        "result (--out) of an earlier run, beside the study, whose posterior is the prior of this one",
        None,
        example="last.json",
    )
    snap: float | None = quantity(
        "spectral density of the angle's fourth derivative; auto: 1e7 rad^2/s^7, 1e8 from 15 states on, or in a "
        "livelier file the smallest of 1e9 to 1e12 that fits", "snap density", "auto", example="1e9 rad^2/s^7",
        bounds=above_zero("a spectral density"), exact=True, words={"auto": None},
    )  # fmt: skip
    gate: float = option(
        "innovation squared over its variance from which a sample is held back", 25.0, least=1.0
    )
    kind: EstimatorKind = option("; ".join(f"{kind}: {words}" for kind, words in WORDS.items()), "fusion")

    @property
    def density(self) -> float:
        """``snap``, or, where it is not stated, 1e7, and 1e8 where flexure is estimated too: a livelier motion than the
        model expects would be taken for errors of positions and of the gyro's scale, which multiply it."""
        return (1e8 if self.states >= 15 else 1e7) if self.snap is None else self.snap


@dataclass(frozen=True)
class Methods:
    """The paper's way, for the estimator of that kind."""

    static: Static = option("the static mechanisation", "improved")
    centrifugal: Centrifugal = option("compensation of r w^2", "mechanical")
    tangential: Tangential = option(
        "compensation of r times angular acceleration; differentiated: the gyro's first difference", "dual"
    )


@dataclass(frozen=True)
class ModelAttitude:
    """Attitude of the model in the tunnel beside its pitch; alpha and beta need this or the flow."""

    roll: Quantity | None = quantity(
        "right wing down positive; 0 if absent; with gyros for roll and yaw at the start of the record", "angle",
        example="2.0(1) deg", bounds=_ANY_ANGLE,
    )  # fmt: skip
    yaw: Quantity | None = quantity(
        "nose left of the tunnel's axis positive; 0 if absent", "angle", example="0.5(1) deg",
        bounds=_ANY_ANGLE,
    )  # fmt: skip


@dataclass(frozen=True)
class Flow:
    """Angularity of the flow."""

    upwash: Quantity | None = quantity(
        "a stream that rises positive; 0 if absent", "angle", example="0.10(2) deg", bounds=_OF_THE_STREAM
    )
    sidewash: Quantity | None = quantity(
        "a stream from the right positive; 0 if absent", "angle", example="0.05(2) deg", bounds=_OF_THE_STREAM
    )


@dataclass(frozen=True)
class Attitude(Flow, ModelAttitude):
    """Attitude of the model in the stream beside its pitch; values [rad] with standard uncertainties."""

    @property
    def level(self) -> float:
        """Cosine of the stated roll; 1 without one."""
        return 1.0 if self.roll is None else math.cos(self.roll.value)

    def check_pitch_shows(self) -> None:
        """Raise `StudyError` for a model on its side, whose pitch no sensor shows."""
        if self.roll is not None and abs(self.level) < LIMITS.level_cosine:
            degrees = math.degrees(self.roll.value)
            text = f"found {degrees:.6g} deg, expected one further from +-90 deg, at which pitch shows"
            raise StudyError("model.roll", text)


@dataclass(frozen=True)
class PointPlan:
    """Test points of a recording."""

    by: PointsBy = option(
        "point: stretches of one number in that column; trigger: from that channel; pause: of the angle itself; auto: "
        "point where there is such a column, else pause", "auto",
    )  # fmt: skip
    delay: float = quantity(
        "with trigger: time left out from where it changes", "time", "0 s", example="0.5 s", bounds=_WAIT
    )
    length: float | None = quantity(
        "with trigger: time averaged; as long as its value holds if absent",
        "time",
        example="1 s",
        bounds=TIME,
    )


@dataclass(frozen=True)
class Zero:
    """A stretch at rest, wind off, at a known angle; ``u`` is its standard uncertainty [rad]."""

    start: float = quantity(
        "of the stretch, in the record's time", "time", REQUIRED, example="0 s", bounds=_INSTANT
    )
    end: float = quantity("of the stretch", "time", REQUIRED, example="5 s", bounds=_INSTANT)
    angle: float = quantity(
        "pitch in that stretch, with its standard uncertainty", "angle", REQUIRED, example="0.00(1) deg",
        bounds=_ANY_ANGLE, u="u", uncertain=True,
    )  # fmt: skip
    u: float = 0.0

    def __post_init__(self) -> None:
        """Refuse a stretch without length."""
        if not self.start < self.end:
            raise InputError("start", f"found {self.start:g} s, expected it before end, {self.end:g} s")


@dataclass(frozen=True)
class Goal:
    """Wanted standard uncertainty, for `inercal design aoa`."""

    theta: float | None = quantity(
        "of the angle", "angle", example="0.01 deg", bounds=within(1e-9, 1.0, "an angle above 0, below 1 rad")
    )


@short_repr
@dataclass(frozen=True, eq=False)
class AoaSettings:
    """A study of inertial angle of attack, in SI.

    ``sensors`` holds the calibrations by name: those of the layout, and ``gyro``, ``gyro_roll``, ``gyro_yaw``.
    ``traceability``, ``temperature``, ``given`` as in `inercal.systems.imu.settings.ImuSettings`. ``corrections`` are
    scale and axis angle [rad] by which an earlier run changed accelerometers, by name
    (`inercal.systems.aoa.reference.corrections`). ``layouts`` are those that a design compares with the stated one, by
    name.
    """

    site: Site
    layout: Layout
    noise: Noise = table("noise and biases of the sensors")
    prior: Prior = table("what is not known of the sensors", Prior())
    sensors: Mapping[str, SensorCalibration] = field(default_factory=dict)
    motion: MotionPlan | None = table("of a simulation; a recording can do without", None)
    disturbances: Disturbances = table("what a simulation adds to the model", Disturbances())
    timing: Timing = table("delays of the sensors", Timing())
    band: Band = table("what of the sensors the fusion takes", Band())
    estimator: Estimator = table("how the angle is found", Estimator())
    methods: Methods = table("the paper's way", Methods())
    attitude: Attitude = field(default_factory=Attitude)
    zero: Zero | None = table("a stretch at a known angle", None)
    points: PointPlan = table("stretches that are test points", PointPlan())
    alarm: AlarmLimits = table("limits of the angle, for live measurements", AlarmLimits())
    layouts: Mapping[str, Layout] = field(default_factory=dict)
    goal: Goal = table("uncertainty that a design is to reach", Goal())
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
    corrections: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def calibration(self, name: str) -> SensorCalibration:
        """The calibration of a sensor; the identity where the study has none."""
        return self.sensors.get(name, SensorCalibration())
