"""The problem of the fusion: its states, their prior, and the constants of its model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.aoa.band import WHOLE, Band
from inercal.systems.aoa.fusion.model import BIASES, Constants, Model, Places
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.settings import AoaSettings

START = np.array([0.1, 0.5, 20.0, 200.0])
"""Standard deviations of angle [rad], rate, acceleration and jerk where the filter starts."""


@dataclass(frozen=True, eq=False)
class FusionProblem:
    """The problem of the fusion, without the recording.

    ``names`` (n,) of the states; ``mean`` (n,) and ``covariance`` (n, n) of all but the four of motion, which have none
    before the start; ``places``, ``constants`` and ``geometry`` as in `inercal.systems.aoa.fusion.model.Model`,
    the noise that of a fused row; ``band`` of the sensors before.
    """

    layout: Layout
    names: tuple[str, ...]
    mean: Array
    covariance: Array
    places: Places
    constants: Constants
    geometry: Array
    band: Band = WHOLE

    @cached_property
    def model(self) -> Model:
        """Geometry, places and constants, for kernels."""
        return Model(self.geometry, self.places, self.constants)

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
        return self.places.roll >= 0


_MOTION = ("theta", "rate", "acceleration", "jerk")
_FLEXURE = ("s_z", "flexure_z", "s_x", "flexure_x")
_TURNING = ("phi", "b_roll", "b_yaw")
_MOVING = (*_MOTION, *_FLEXURE, *_TURNING)


def problem(
    settings: AoaSettings,
    spatial: bool = False,
    posterior: tuple[Mapping[str, float], Mapping[tuple[str, str], float]] | None = None,
) -> FusionProblem:
    """The problem of a study.

    ``spatial``: the recording has gyros for roll and yaw. ``posterior``: values of coefficients by name, and their
    covariances by pairs of names, of an earlier run, in the place of the study's prior.
    """
    layout, prior, noise, states = settings.layout, settings.prior, settings.noise, settings.estimator.states
    n = len(layout.names)
    each = range(1, n + 1)
    names: list[str] = [*_MOTION, "b_g", *(f"b_{k}" for k in each)]
    half = 0.5 * noise.accelerometer_bias**2
    blocks = [np.zeros((4, 4)), np.array([[noise.gyro_bias**2]]), half + half * np.eye(n)]
    parts = dict.fromkeys(("levers", "resonators", "heights", "scale", "delay", "roll"), -1)

    def add(part: str, block: Array, *of: str) -> None:
        parts[part] = len(names)
        names.extend(of)
        blocks.append(block)

    if states >= 11:
        common, own = prior.lever_common**2, prior.lever**2
        add("levers", common + own * np.eye(n), *(f"dr_{k}" for k in each))
    if states >= 15:
        # variances of s and s'
        both = [((of.level / of.omega) ** 2, of.level**2) for of in (prior.heave, prior.axial)]
        add("resonators", np.diag(np.ravel(both)), *_FLEXURE)
    if states >= 19:
        add("heights", prior.height**2 * np.eye(n), *(f"zo_{k}" for k in each))
        add("scale", np.array([[prior.gyro_scale**2]]), "k_g")
    if settings.timing.gyro_delay is None:
        add("delay", np.array([[prior.gyro_delay**2]]), "tau_g")
    roll = settings.attitude.roll
    if spatial:
        of_roll = LIMITS.roll_u if roll is None or roll.u == 0.0 else roll.u
        variances = [of_roll**2, noise.gyro_bias**2, noise.gyro_bias**2]
        add("roll", np.diag(variances), *_TURNING)
    size = len(names)
    mean, covariance = np.zeros(size), np.zeros((size, size))
    a = 0
    for block in blocks:
        covariance[a : a + len(block), a : a + len(block)] = block
        a += len(block)
    if spatial and roll is not None:
        mean[parts["roll"]] = roll.value
    if parts["delay"] >= 0:
        mean[parts["delay"]] = settings.timing.gyro_delay_about
    moving = np.array([k for k, name in enumerate(names) if name in _MOVING], dtype=np.int64)
    places = Places(n, size, **parts, moving=moving)
    if posterior is not None:
        _known_before(names, mean, covariance, posterior)
    # of the vibration of this recording, which no earlier run knows
    biases = np.arange(BIASES, BIASES + n)
    covariance[biases, biases] += prior.rectified**2
    return FusionProblem(
        layout, tuple(names), mean, covariance, places, _constants(settings), layout.geometry, settings.band
    )


def _constants(settings: AoaSettings) -> Constants:
    """The constants of a study."""
    noise, timing = settings.noise, settings.timing
    heave, axial = settings.prior.heave, settings.prior.axial
    every = settings.band.every
    constants = Constants(
        gravity=settings.site.gravity,
        snap=settings.estimator.density,
        accelerometer_noise=noise.accelerometer**2 / every,
        gyro_noise=noise.gyro**2 / every,
        turn_noise=noise.gyro**2 / every,
        accelerometer_walk=noise.accelerometer_walk**2,
        gyro_walk=noise.gyro_walk**2,
        gyro_delay=timing.gyro_delay or 0.0,
        common_delay=timing.common_delay,
        common_delay_u=timing.common_delay_u,
        roll_cosine=settings.attitude.level,
        gate=settings.estimator.gate,
        heave_frequency=heave.omega,
        heave_damping=heave.damping,
        heave_level=heave.level,
        axial_frequency=axial.omega,
        axial_damping=axial.damping,
        axial_level=axial.level,
        plunge=heave.vertical,
    )
    return Constants(*map(float, constants))


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
