"""The problem of every estimator of self-calibration: the platform, its noise, the prior, the filter."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

from inercal.arrays import Array
from inercal.selfcal.filters.gating import Gate, gate_of
from inercal.selfcal.platform.rig import World
from inercal.selfcal.settings import Filter, Noise, SelfcalSettings


class NoiseLevels(NamedTuple):
    """Standard deviations as kernels take them: ``angle_random_walk`` of the gyros [rad/sqrt(s)], ``accelerometer``
    [m/s^2] and ``encoder`` [rad] of each sample."""

    angle_random_walk: float
    accelerometer: float
    encoder: float


class Model(NamedTuple):
    """The platform as kernels take it."""

    world: World
    noise: NoiseLevels
    gate: Gate


@dataclass(frozen=True, eq=False)
class FilterProblem:
    """The problem of an estimator, without the recording: ``prior`` (p,) standard deviations about 0, p 18 or 24."""

    world: World
    noise: Noise
    prior: Array
    filter: Filter = field(default_factory=Filter)

    @cached_property
    def model(self) -> Model:
        """World, noise and near-level gate, for kernels."""
        noise = self.noise
        levels = NoiseLevels(float(noise.angle_random_walk), float(noise.accelerometer), float(noise.encoder))
        return Model(self.world, levels, gate_of(self.filter.gating))


def problem(settings: SelfcalSettings) -> FilterProblem:
    """The problem of a study."""
    return FilterProblem(settings.world, settings.noise, settings.prior[: settings.size], settings.filter)


@dataclass(frozen=True, eq=False)
class Start:
    """A start of an estimator other than the first encoder reading.

    ``attitude`` (4,) q_bp at the first row, and its standard deviation ``sigma`` [rad] about each axis.
    """

    attitude: Array
    sigma: float
