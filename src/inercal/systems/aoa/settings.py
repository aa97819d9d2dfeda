"""Settings of a study of inertial angle of attack, in SI: sensors, noise, prior, motion, timing, estimator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import (
    DEVIATION,
    FREQUENCY,
    REQUIRED,
    TIME,
    Bounds,
    option,
    quantity,
    within,
)
from inercal.foundation.units import STANDARD_GRAVITY, Quantity
from inercal.systems.aoa.alarm import AlarmLimits
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.disturbances import SIZE, Disturbances
from inercal.systems.aoa.estimators import WORDS, Centrifugal, EstimatorKind, States, Static, Tangential
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.limits import LIMITS

Per = Literal["1", "V", "count"]
PointsBy = Literal["auto", "point", "trigger", "pause"]
MotionKind = Literal["static", "pitch-pause", "sine", "two-tone", "chirp", "buffet", "file"]

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
_PITCH = within(-2.0 * math.pi, 2.0 * math.pi, "an angle from -360 deg to 360 deg")


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
    """Flexure of the sting: a band-pass of ``frequency`` [rad/s] and relative ``damping``, whose output has the
    standard deviation ``level`` [m/s^2]; along the body's axis, or ``vertical`` as of a support that plunges."""

    frequency: float
    damping: float
    level: float
    vertical: bool = False


@dataclass(frozen=True)
class Prior:
    """Prior of the errors of the sensors: standard deviations about 0.

    ``heave`` and ``axial`` are the sting's flexure; ``rectified`` [m/s^2] is of the offset of each accelerometer by the
    vibration of a recording.
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
    heave: Resonance = Resonance(2.0 * math.pi * 9.0, 0.3, 0.01 * STANDARD_GRAVITY)
    axial: Resonance = Resonance(2.0 * math.pi * 12.0, 0.5, 0.01 * STANDARD_GRAVITY)
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
    """Delays [s], positive where outputs come late.

    ``gyro_delay`` of the gyro against the accelerometers, None where it is estimated ``gyro_delay_about`` some value,
    that of the spectra; ``common_delay`` of all sensors against the stamps, with its standard uncertainty
    ``common_delay_u``: no sensor sees it.
    """

    gyro_delay: float | None = None
    common_delay: float = 0.0
    common_delay_u: float = 0.0
    gyro_delay_about: float = 0.0


@dataclass(frozen=True)
class Estimator:
    """The estimator of the angle; keys other than its kind are of the fusion of all sensors.

    ``snap`` [rad^2/s^7], None where the recording decides (`inercal.systems.aoa.diagnosis.choice`); until then
    `density`.
    """

    states: States = option("of three accelerometers: 19 all errors, 15, 11, 8 biases alone", 19)
    smooth: bool = option("smooth, which uses later samples too", False)
    prior: Path | None = option(
        "result (--out) of an earlier run, beside the study, whose posterior is the prior of this one",
        None,
        example="last.json",
    )
    snap: float | None = None
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
    """A stretch at rest (wind off) from ``start`` to ``end`` [s] of the record, at a known ``angle`` [rad] with its
    standard uncertainty ``u``."""

    start: float
    end: float
    angle: float
    u: float


@dataclass(frozen=True)
class MotionPlan:
    """Pitch of the model in a simulation: its kind, and the keys of that kind.

    ``static``: a sweep from ``first`` to ``last`` at a constant rate, over all of the duration. ``pitch-pause``: pauses
    at ``first``, by ``step``, to ``last``, quintic moves between, and a buffet (its duration follows). ``sine``:
    ``mean`` + ``amplitude`` sin 2 pi ``frequency`` t. ``two-tone``: with a second sine. ``chirp``: about ``mean``,
    from ``low`` to ``high``. ``buffet``: about ``mean``, 150 equal sines of random frequency and phase from ``low`` to
    ``high``, ``rms`` in all. ``file``: the columns t and theta_ref of ``path``, for ``duration`` at most.
    """

    kind: MotionKind = option(
        "static: a sweep; pitch-pause: steps with pauses; sine; two-tone; chirp; buffet: random; file: as recorded"
    )
    duration: float = quantity(
        "of all kinds but pitch-pause; of a file all if absent", "time", "60 s", bounds=TIME
    )
    sample_rate: float = quantity("samples per second", "frequency", "1 kHz", bounds=FREQUENCY)
    mean: float = quantity(
        "of sine, two-tone, chirp and buffet", "angle", "0 deg", example="30 deg", bounds=_PITCH
    )
    amplitude: float = quantity("of sine, two-tone and chirp", "angle", 0.0, example="10 deg", bounds=SIZE)
    frequency: float = quantity("of sine and two-tone", "frequency", 1.0, example="1 Hz", bounds=FREQUENCY)
    second_amplitude: float = quantity(
        "of the second sine of two-tone", "angle", 0.0, example="2 deg", bounds=SIZE
    )
    second_frequency: float = quantity(
        "of the second sine of two-tone", "frequency", 1.0, example="3 Hz", bounds=FREQUENCY
    )
    low: float = quantity(
        "lowest frequency of chirp, buffet and of the buffet in a pitch-pause", "frequency", 2.0,
        example="0.1 Hz", bounds=FREQUENCY,
    )  # fmt: skip
    high: float = quantity("highest frequency of those", "frequency", 15.0, example="5 Hz", bounds=FREQUENCY)
    rms: float = quantity(
        "of the buffet, in all; in a pitch-pause none if absent",
        "angle",
        0.0,
        example="0.2 deg",
        bounds=SIZE,
    )
    first: float = quantity(
        "angle at the start of static and pitch-pause", "angle", 0.0, example="-10 deg", bounds=_PITCH
    )
    last: float = quantity(
        "angle at the end of static and pitch-pause", "angle", 0.0, example="90 deg", bounds=_PITCH
    )
    step: float = quantity("of pitch-pause, negative downward", "angle", 0.0, example="10 deg", bounds=_PITCH)
    move: float = quantity("time of a move of pitch-pause", "time", "1.5 s", bounds=TIME)
    pause: float = quantity("time of a pause of pitch-pause", "time", "4 s", bounds=TIME)
    path: Path | None = option(
        "of kind file: a record beside the study with the columns t and theta_ref", None, example="pitch.csv",
        name="file",
    )  # fmt: skip


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
    noise: Noise
    prior: Prior = field(default_factory=Prior)
    sensors: Mapping[str, SensorCalibration] = field(default_factory=dict)
    timing: Timing = field(default_factory=Timing)
    band: Band = field(default_factory=Band)
    estimator: Estimator = field(default_factory=Estimator)
    methods: Methods = field(default_factory=Methods)
    attitude: Attitude = field(default_factory=Attitude)
    zero: Zero | None = None
    points: PointPlan = field(default_factory=PointPlan)
    alarm: AlarmLimits = field(default_factory=AlarmLimits)
    motion: MotionPlan | None = None
    disturbances: Disturbances = field(default_factory=Disturbances)
    layouts: Mapping[str, Layout] = field(default_factory=dict)
    goal: Goal = field(default_factory=Goal)
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
    corrections: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def calibration(self, name: str) -> SensorCalibration:
        """The calibration of a sensor; the identity where the study has none."""
        return self.sensors.get(name, SensorCalibration())
