"""The fusion's problem as numbers for kernels: which states there are, their prior, and what is taken as known."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.fusion import model
from inercal.aoa.layout import Layout
from inercal.aoa.settings import AoaSettings, Resonance
from inercal.arrays import Array

Indices = NDArray[np.int64]

START = np.array([0.1, 0.5, 20.0, 200.0])
"""Standard deviations of angle [rad], rate, acceleration and jerk where the filter starts."""

_ROLL_U = math.radians(0.1)
"""Standard uncertainty of a roll at the start that is stated without one, where it is estimated."""


@dataclass(frozen=True, eq=False)
class FilterProblem:
    """All that the fusion is told beside the recording.

    ``names`` (n,) of the states; ``mean`` (n,) and ``covariance`` (n, n) of all but the four of motion, which have none
    before the start; ``places``, ``constants`` and ``geometry`` as in `inercal.aoa.fusion.model`.
    """

    layout: Layout
    names: tuple[str, ...]
    mean: Array
    covariance: Array
    places: Indices
    constants: Array
    geometry: Array

    @property
    def count(self) -> int:
        """Number of accelerometers."""
        return len(self.layout.names)

    @property
    def size(self) -> int:
        """Number of states."""
        return len(self.names)

    @cached_property
    def nuisances(self) -> dict[str, int]:
        """Place of each coefficient that stays constant, by its name."""
        changing = (*_MOTION, *_FLEXURE, "phi")
        return {name: k for k, name in enumerate(self.names) if name not in changing}

    @property
    def spatial(self) -> bool:
        """True where roll is estimated."""
        return bool(self.places[model.ROLL] >= 0)


_MOTION = ("theta", "rate", "acceleration", "jerk")
_FLEXURE = ("s_z", "flexure_z", "s_x", "flexure_x")
_TURNING = ("phi", "b_roll", "b_yaw")
_MOVING = (*_MOTION, *_FLEXURE, *_TURNING)


def problem(
    settings: AoaSettings,
    spatial: bool = False,
    posterior: tuple[Mapping[str, float], Mapping[tuple[str, str], float]] | None = None,
) -> FilterProblem:
    """The problem that a study states.

    ``spatial``: the recording has gyros for roll and yaw. ``posterior``: values of coefficients by name, and their
    covariances by pairs of names, of an earlier run, in the place of the study's prior.
    """
    layout, prior, noise, states = settings.layout, settings.prior, settings.noise, settings.estimator.states
    n = len(layout.names)
    each = range(1, n + 1)
    names: list[str] = [*_MOTION, "b_g", *(f"b_{k}" for k in each)]
    half = 0.5 * noise.accelerometer_bias**2
    blocks = [np.zeros((4, 4)), np.array([[noise.gyro_bias**2]]), half + half * np.eye(n)]
    places = np.full(model.ROWS + 11, -1, dtype=np.int64)

    def add(place: int, block: Array, *of: str) -> None:
        places[place] = len(names)
        names.extend(of)
        blocks.append(block)

    if states >= 11:
        common, own = prior.lever_common**2, prior.lever**2
        add(model.LEVERS, common + own * np.eye(n), *(f"dr_{k}" for k in each))
    if states >= 15:
        add(model.RESONATORS, np.diag([*_stationary(prior.heave), *_stationary(prior.axial)]), *_FLEXURE)
    if states >= 19:
        add(model.HEIGHTS, prior.height**2 * np.eye(n), *(f"zo_{k}" for k in each))
        add(model.SCALE, np.array([[prior.gyro_scale**2]]), "k_g")
    if settings.timing.gyro_delay is None:
        add(model.DELAY, np.array([[prior.gyro_delay**2]]), "tau_g")
    roll = settings.attitude.roll
    if spatial:
        of_roll = _ROLL_U if roll is None or roll.u == 0.0 else roll.u
        variances = [of_roll**2, noise.gyro_bias**2, noise.gyro_bias**2]
        add(model.ROLL, np.diag(variances), *_TURNING)
    size = len(names)
    mean, covariance = np.zeros(size), np.zeros((size, size))
    a = 0
    for block in blocks:
        covariance[a : a + len(block), a : a + len(block)] = block
        a += len(block)
    if spatial and roll is not None:
        mean[places[model.ROLL]] = roll.value
    places[model.COUNT], places[model.STATES] = n, size
    moving = [k for k, name in enumerate(names) if name in _MOVING]
    places[model.MOVING] = len(moving)
    places[model.ROWS : model.ROWS + len(moving)] = moving
    if posterior is not None:
        _known_before(names, mean, covariance, posterior)
    return FilterProblem(
        layout, tuple(names), mean, covariance, places, _constants(settings), layout.geometry
    )


def _stationary(of: Resonance) -> tuple[float, float]:
    """Variances of s and s'."""
    return (of.level / of.frequency) ** 2, of.level**2


def _constants(settings: AoaSettings) -> Array:
    """As in `inercal.aoa.fusion.model`."""
    noise, timing, roll = settings.noise, settings.timing, settings.attitude.roll
    known = {
        model.GRAVITY: settings.site.gravity,
        model.SNAP: settings.estimator.density,
        model.NOISE: noise.accelerometer**2,
        model.GYRO_NOISE: noise.gyro**2,
        model.TURN_NOISE: noise.gyro**2,
        model.GYRO_DELAY: timing.gyro_delay or 0.0,
        model.COMMON_DELAY: timing.common_delay,
        model.COMMON_DELAY_U: timing.common_delay_u,
        model.ROLL_COSINE: 1.0 if roll is None else math.cos(roll.value),
        model.GATE: settings.estimator.gate,
    }
    made = np.zeros(16)
    made[list(known)] = list(known.values())
    for first, of in ((model.Z_RATE, settings.prior.heave), (model.X_RATE, settings.prior.axial)):
        made[first : first + 3] = of.frequency, of.damping, of.level
    return made


def _known_before(
    names: list[str],
    mean: Array,
    covariance: Array,
    posterior: tuple[Mapping[str, float], Mapping[tuple[str, str], float]],
) -> None:
    """Put an earlier posterior in the place of the prior of the same names."""
    values, covariances = posterior
    for i, name in enumerate(names):
        if name not in values:
            continue
        mean[i] = values[name]
        for j, other in enumerate(names):
            covariance[i, j] = covariance[j, i] = covariances.get((name, other), 0.0)
