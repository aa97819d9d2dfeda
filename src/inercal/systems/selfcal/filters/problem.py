"""The problem of every estimator of self-calibration: the platform, its noise, the prior, the near-level gate.

An accelerometer near level reads close to zero; a gate stops it within a first angle of that, and takes it up again
beyond a second, larger one. Off unless asked for: it only loses information, as the comparison of bounds shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector
from inercal.systems.selfcal.estimators import ESTIMATORS, FilterKind
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.linearised import AXES, FLOOR, STIFF
from inercal.systems.selfcal.platform.model import WIDEST, Rates, base_of, encoders, room
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import ALL, StateVector
from inercal.systems.selfcal.settings import Filter, Gating, Noise, SelfcalSettings

_OFF, _ANY, _TWO, _CHANNEL = range(4)
"""Rules of a gate."""

_RULES: Final = {"any": _ANY, "two": _TWO, "channel": _CHANNEL}


class Gate(NamedTuple):
    """The gate as kernels take it: its ``rule``; true if the ``whole_step`` of update stops; sines of the angles within
    which an accelerometer is ``near`` level, and beyond which it is ``far`` from it."""

    rule: int
    whole_step: bool
    near: float
    far: float


def _gate_of(gating: Gating | None) -> Gate:
    """The gate of the settings, off where there is none."""
    if gating is None or gating.rule == "off":
        return Gate(_OFF, False, 0.0, 0.0)
    return Gate(_RULES[gating.rule], gating.stops == "step", math.sin(gating.near), math.sin(gating.far))


@kernel
def watch(f: Vector, gate: Gate, near: NDArray[np.int64]) -> None:
    """Update which accelerometers are ``near`` (3,) level, from the specific force of the encoders' attitude."""
    if gate.rule == _OFF:
        return
    g = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    for i in range(3):
        if abs(f[i]) < gate.near * g:
            near[i] = 1
        elif abs(f[i]) > gate.far * g:
            near[i] = 0


@kernel
def admitted(i: int, gate: Gate, near: NDArray[np.int64]) -> bool:
    """True if accelerometer ``i`` takes part."""
    count = near[0] + near[1] + near[2]
    if gate.rule == _ANY:
        return bool(count == 0)
    if gate.rule == _TWO:
        return bool(count < 2)
    return bool(gate.rule == _OFF or near[i] == 0)


@kernel
def updating(gate: Gate, near: NDArray[np.int64]) -> bool:
    """False where the whole step of update stops, encoders too: with rule ``channel`` as soon as one is near level."""
    if gate.rule == _OFF or not gate.whole_step:
        return True
    count = near[0] + near[1] + near[2]
    return bool(count < 2) if gate.rule == _TWO else bool(count == 0)


class NoiseLevels(NamedTuple):
    """Standard deviations as kernels take them: ``angle_random_walk`` of the gyros [rad/sqrt(s)], ``accelerometer``
    [m/s^2] and ``encoder`` [rad] of each sample; of biases that walk, about their means, ``gyro_walk`` [rad/s] and
    ``accelerometer_walk`` [m/s^2]; ``joints`` (3,) variance of each joint's angle over that of an encoder: 1, and of a
    joint that is fixed, without an encoder, what the sway of the base makes of it."""

    angle_random_walk: float
    accelerometer: float
    encoder: float
    gyro_walk: float
    accelerometer_walk: float
    joints: Array


@kernel
def apart(noise: NoiseLevels, dt: float, sigma: float) -> float:
    """Variance [rad^2] of an attitude by the encoders about each axis, beside that of the joints' angles, of standard
    deviation ``sigma`` [rad]: of three joints `LIMITS.encoder_floor` of the encoders' noise. Where joints are fixed, it
    is a part of what the gyros wander within the ``dt`` [s] to the row before, so that the innovations about a fixed
    joint are the noise of the gyros, and what an axis that is not quite known makes of sigma."""
    if noise.joints[0] * noise.joints[1] * noise.joints[2] == 1.0:
        return FLOOR * FLOOR * sigma * sigma
    return STIFF * noise.angle_random_walk * noise.angle_random_walk * dt + AXES * AXES * sigma * sigma


class FilterModel(NamedTuple):
    """The platform as kernels take it."""

    world: World
    noise: NoiseLevels
    gate: Gate
    layout: StateLayout


@dataclass(frozen=True, eq=False)
class FilterProblem:
    """The problem of an estimator, without the recording.

    ``prior`` (p,) standard deviations of its states about their ``mean`` (p,), in the order of `states`; without a
    ``vector`` those are the first p of all, p 18 or 24, about 0.
    """

    world: World
    noise: Noise
    prior: Array
    filter: Filter = field(default_factory=Filter)
    vector: StateVector | None = None

    @cached_property
    def states(self) -> StateVector:
        """The states."""
        return self.vector or StateVector(ALL[: len(self.prior)], np.zeros(len(ALL)))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.states.names

    @cached_property
    def mean(self) -> Array:
        """(p,) values of the states before the recording."""
        return self.states.stated[self.states.index]

    def for_kind(self, kind: FilterKind) -> FilterProblem:
        """The problem with the states that an estimator can have: without those of the rig where it has none, and in
        ``map`` without those that change with time."""
        if kind == "map" and self.states.walks.any():
            constant = self.states.without_walks
            return replace(self, prior=self.prior[: len(constant.names)], vector=constant)
        if ESTIMATORS[kind].rig or not self.states.of_rig:
            return self
        size = 24 if self.states.has("kg1") and self.states.has("beta") else 18
        return replace(self, prior=self.prior[:size], vector=None)

    @cached_property
    def model(self) -> FilterModel:
        """World, noise and near-level gate, for kernels."""
        noise = self.noise
        levels = NoiseLevels(
            float(noise.angle_random_walk), float(noise.accelerometer), float(noise.encoder),
            noise.gyro_walk_sigma, noise.accelerometer_walk_sigma,
            np.where(self.states.layout.turning, 1.0, 0.5 * (noise.base_sway / noise.encoder) ** 2),
        )  # fmt: skip
        return FilterModel(self.world, levels, _gate_of(self.filter.gating), self.states.layout)


def problem(settings: SelfcalSettings) -> FilterProblem:
    """The problem of a study."""
    vector = settings.states
    noise = settings.noise.of_readings
    return FilterProblem(settings.world, noise, settings.priors[vector.index], settings.filter, vector)


@dataclass(frozen=True, eq=False)
class AttitudeStart:
    """A start other than the first encoder reading: ``attitude`` (4,) q_bp at the first row, and its standard deviation
    ``sigma`` [rad] about each axis.

    Where encoders read, it may be off by any angle for ``error-state`` and ``map``. Where they never do, by up to 45
    degrees for ``map``, and by none to speak of for a filter: 1 degree leaves coefficients several u off.
    """

    attitude: Array
    sigma: float


def encoders_at(problem: FilterProblem, th: Array, c: Array, rate: Array) -> tuple[Array, Array]:
    """Attitude (4,) of p as encoders have it that read ``th`` (3,) [rad], and its change (3, p) [rad, about the axes of
    p] per change of the states ``c`` (p,); ``rate`` (3,) [rad/s] as read about that time."""
    layout, slope, axes = problem.states.layout, np.zeros((3, len(c))), np.zeros((WIDEST, 3))
    th, rate = np.array(th, dtype=float), np.array(rate, dtype=float)
    q = _encoders_at(th, rate, problem.states.full(c), layout, problem.world, axes)
    slope[:, layout.columns - 3] = axes[: len(layout.columns)].T
    return np.array(q), slope


@allocating
def _encoders_at(
    th: Array, rate: Array, c: Array, layout: StateLayout, world: World, axes: Array
) -> Quaternion:
    """The attitude (4,) of encoders, for `encoders_at`; ``axes`` (WIDEST, 3) of their columns."""
    own = room()
    w, base = (rate[0], rate[1], rate[2]), base_of(c, layout.based, world)
    q = encoders(th, Rates(w, w), base, c, layout, world, own)
    for j in range(WIDEST):
        for i in range(3):
            axes[j, i] = own.axes[j, i]
    return q
