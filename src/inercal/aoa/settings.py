"""What a study of inertial angle of attack says, in SI: sensors, noise, prior, motion, timing, estimator."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from inercal.aoa.layout import Layout
from inercal.arrays import Array
from inercal.geometry.site import Site
from inercal.units import STANDARD_GRAVITY, Quantity

States = Literal[8, 11, 15, 19]
Static = Literal["segmented", "complementary", "improved", "difference", "gls"]
Centrifugal = Literal["none", "low-pass", "mechanical", "decision"]
Tangential = Literal["none", "differentiated", "dual"]
Per = Literal["1", "V", "count"]
MotionKind = Literal["static", "pitch-pause", "sine", "two-tone", "chirp", "buffet", "file"]

STATES: tuple[States, ...] = (8, 11, 15, 19)

GYROS = ("gyro", "gyro_roll", "gyro_yaw")


@dataclass(frozen=True)
class Noise:
    """Standard deviations of each sample, ``accelerometer`` [m/s^2] and ``gyro`` [rad/s], and of the biases.

    ``accelerometer_bias`` [m/s^2] is the total, half its variance common to all accelerometers; ``gyro_bias`` [rad/s].
    """

    accelerometer: float
    accelerometer_bias: float
    gyro: float
    gyro_bias: float


@dataclass(frozen=True)
class Resonance:
    """Flexure of the sting: a band-pass of ``frequency`` [rad/s] and relative ``damping``, whose output has the
    standard deviation ``level`` [m/s^2]."""

    frequency: float
    damping: float
    level: float


@dataclass(frozen=True)
class Prior:
    """Standard deviations of what the filter estimates beside motion and biases, about 0.

    Positions r [m]: ``lever_common`` to all (the pivot) and ``lever`` of each; ``height`` z [m] of each;
    ``gyro_scale``; ``gyro_delay`` [s], where it is estimated. ``heave`` and ``axial`` are the sting's flexure.
    """

    lever_common: float = 3e-3
    lever: float = 1e-3
    height: float = 5e-3
    gyro_scale: float = 1e-3
    gyro_delay: float = 5e-3
    heave: Resonance = Resonance(2.0 * math.pi * 9.0, 0.3, 0.01 * STANDARD_GRAVITY)
    axial: Resonance = Resonance(2.0 * math.pi * 12.0, 0.5, 0.01 * STANDARD_GRAVITY)


@dataclass(frozen=True)
class Calibration:
    """A sensor's calibration: what it measures is ``(indication x scale - bias)``, each with temperature terms.

    ``scale`` SI per SI unit of the record's column, or ``per`` volt or count of it; ``bias`` [SI]; ``scale_slope``
    [1/K] and ``bias_slope`` [SI/K] about ``temperature`` [degC]; ``range`` [SI] of what it measures, at or beyond
    which it is saturated, None where not known. ``caution``: what the file that it is of says against itself.
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
        """What indications (n,) mean [SI]; at the calibration's own temperature where ``temperature`` is None."""
        scale, bias = self._at(temperature)
        return np.asarray(indication * scale - bias)

    def indicated(self, value: Array, temperature: Array | float | None = None) -> Array:
        """The inverse of `measured`: what the record's column holds, in SI, volts or counts."""
        scale, bias = self._at(temperature)
        return np.asarray((value + bias) / scale)

    def _at(self, temperature: Array | float | None) -> tuple[Array | float, Array | float]:
        """Scale and bias at a temperature [degC]."""
        off = 0.0 if temperature is None else temperature - self.temperature
        return self.scale * (1.0 + self.scale_slope * off), self.bias + self.bias_slope * off


@dataclass(frozen=True)
class Timing:
    """Delays [s], positive where outputs come late.

    ``gyro_delay`` of the gyro against the accelerometers, None where it is to be estimated; ``common_delay`` of all
    sensors against the stamps, with its standard uncertainty ``common_delay_u``: no sensor sees it.
    """

    gyro_delay: float | None = 0.0
    common_delay: float = 0.0
    common_delay_u: float = 0.0


@dataclass(frozen=True)
class Estimator:
    """The fusion: number of ``states`` for three accelerometers, whether it smooths, and the posterior of an earlier
    run as its ``prior``. ``snap`` [rad^2/s^7] the spectral density of the angle's fourth derivative, None where it is
    not stated (`density`), ``gate`` the innovation squared over its variance from which it is held back."""

    states: States = 19
    smooth: bool = False
    prior: Path | None = None
    snap: float | None = None
    gate: float = 25.0

    @property
    def density(self) -> float:
        """``snap``, or where it is not stated 1e7, and 1e8 where flexure is estimated too: a livelier motion that the
        model does not expect would be taken for errors of positions and of the gyro's scale, which multiply it."""
        return (1e8 if self.states >= 15 else 1e7) if self.snap is None else self.snap


@dataclass(frozen=True)
class Methods:
    """The paper's way: static mechanisation, centrifugal and tangential compensation."""

    static: Static = "improved"
    centrifugal: Centrifugal = "mechanical"
    tangential: Tangential = "dual"


@dataclass(frozen=True)
class Attitude:
    """How the model lies in the stream, beside its pitch; values [rad] with standard uncertainties.

    ``roll`` right wing down, constant over the record (with gyros for roll and yaw: at its start); ``yaw`` nose left of
    the tunnel's axis; ``upwash`` and ``sidewash`` of the flow: a stream that rises, one that comes from the right.
    """

    roll: Quantity | None = None
    yaw: Quantity | None = None
    upwash: Quantity | None = None
    sidewash: Quantity | None = None


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
    """Pitch to be simulated; angles [rad], frequencies [Hz], times [s].

    ``static``: a sweep from ``first`` to ``last`` at a constant rate, over all of the duration. ``pitch-pause``: pauses
    of ``pause`` at ``first``, by ``step``, to ``last``, quintic moves of ``move`` between, and a buffet of ``rms`` from
    ``low`` to ``high`` (its duration follows). ``sine``: ``mean`` + ``amplitude`` sin 2 pi ``frequency`` t.
    ``two-tone``: with a second sine. ``chirp``: about ``mean``, from ``low`` to ``high``. ``buffet``: about ``mean``,
    150 equal sines of random frequency and phase from ``low`` to ``high``, ``rms`` in all. ``file``: the columns t and
    theta_ref of ``path``, for ``duration`` at most.
    """

    kind: MotionKind = "sine"
    duration: float = 60.0
    sample_rate: float = 1000.0
    mean: float = 0.0
    amplitude: float = 0.0
    frequency: float = 1.0
    second_amplitude: float = 0.0
    second_frequency: float = 1.0
    low: float = 2.0
    high: float = 15.0
    rms: float = 0.0
    first: float = 0.0
    last: float = 0.0
    step: float = 0.0
    move: float = 1.5
    pause: float = 4.0
    path: Path | None = None


@dataclass(frozen=True)
class Shaking:
    """A random vibration of ``rms``, 40 equal sines from ``low`` to ``high`` [Hz]."""

    rms: float
    low: float
    high: float


@dataclass(frozen=True)
class Oscillation:
    """A rigid rotation ``amplitude`` [rad] sin 2 pi ``frequency`` [Hz] t."""

    amplitude: float
    frequency: float


@dataclass(frozen=True)
class Disturbances:
    """What a simulation adds to the rigid, well-known model; nothing by default.

    Flexure of the sting: ``pitch`` [rad], ``heave`` and ``axial`` [m/s^2]. ``roll`` and ``yaw`` [rad] coupled in.
    ``pivot`` [m] added to all r, ``heights`` [m] to each z. ``gyro_scale``; ``gyro_delay``, ``common_delay`` [s].
    ``bandwidth`` [Hz] of all sensors, first order. ``spikes``: probability that a sample of a sensor is off by
    ``spike`` [m/s^2] (accelerometers) or that over 9.80665 in rad/s (gyro). ``clip``: limit readings to the ranges of
    the sensors. ``dropouts``: probability that a row is missing.
    """

    pitch: Shaking | None = None
    heave: Shaking | None = None
    axial: Shaking | None = None
    roll: Oscillation | None = None
    yaw: Oscillation | None = None
    pivot: float = 0.0
    heights: tuple[float, ...] = ()
    gyro_scale: float = 0.0
    gyro_delay: float = 0.0
    common_delay: float = 0.0
    bandwidth: float = math.inf
    spikes: float = 0.0
    spike: float = 0.5 * STANDARD_GRAVITY
    clip: bool = False
    dropouts: float = 0.0


@dataclass(frozen=True, eq=False)
class AoaSettings:
    """A study of inertial angle of attack, in SI.

    ``sensors`` holds the calibrations by name: those of the layout, and ``gyro``, ``gyro_roll``, ``gyro_yaw``.
    ``traceability``, ``temperature``, ``given`` as in `inercal.imu.settings.ImuSettings`. ``corrections`` are scale and
    axis angle [rad] by which an earlier run changed accelerometers, by name (`inercal.aoa.reference.corrections`).
    """

    site: Site
    layout: Layout
    noise: Noise
    prior: Prior = field(default_factory=Prior)
    sensors: Mapping[str, Calibration] = field(default_factory=dict)
    timing: Timing = field(default_factory=Timing)
    estimator: Estimator = field(default_factory=Estimator)
    methods: Methods = field(default_factory=Methods)
    attitude: Attitude = field(default_factory=Attitude)
    zero: Zero | None = None
    motion: MotionPlan | None = None
    disturbances: Disturbances = field(default_factory=Disturbances)
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
    corrections: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def calibration(self, name: str) -> Calibration:
        """The calibration of a sensor; that of one which needs none where the study has none."""
        return self.sensors.get(name, Calibration())
