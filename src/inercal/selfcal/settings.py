"""What a study of self-calibration says, in SI: rig, plan, truth, noise, prior, goal, filter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from inercal.arrays import Array
from inercal.geometry.site import Site
from inercal.selfcal.platform.coefficients import NAMES
from inercal.selfcal.platform.plan import Plan
from inercal.selfcal.platform.rig import Base, Gimbals, World, world
from inercal.units import Quantity

FilterKind = Literal["svd-qukf", "gimbal-ukf", "mukf", "error-state", "map", "lm"]
FactorKind = Literal["cholesky", "eigen", "svd"]

KINDS: tuple[FilterKind, ...] = ("error-state", "mukf", "svd-qukf", "gimbal-ukf", "map", "lm")
"""All estimators, the product's default first."""

FACTOR_OF: Mapping[FilterKind, FactorKind] = {
    "svd-qukf": "eigen",
    "gimbal-ukf": "cholesky",
    "mukf": "cholesky",
}
"""Factor of the covariance that each sigma-point filter takes where the study names none."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations: ``angle_random_walk`` of the gyros [rad/sqrt(s)], ``accelerometer`` [m/s^2] and
    ``encoder`` [rad] of each sample."""

    angle_random_walk: float
    accelerometer: float
    encoder: float

    @property
    def levels(self) -> Array:
        """(3,) the same in this order, for kernels."""
        return np.array([self.angle_random_walk, self.accelerometer, self.encoder])


@dataclass(frozen=True)
class Gating:
    """Near-level gating: an accelerometer is near level from |f_i| < sin(``near``) g0 on until |f_i| > sin(``far``) g0.

    ``rule``: ``any`` stops where any accelerometer is near level, ``two`` where two are, ``channel`` each by itself.
    ``stops``: the ``accelerometers`` or the whole ``step`` of update. Angles in rad.
    """

    rule: Literal["any", "two", "channel"]
    stops: Literal["accelerometers", "step"] = "accelerometers"
    near: float = float(np.radians(2.0))
    far: float = float(np.radians(5.0))


@dataclass(frozen=True)
class Filter:
    """Which estimator, and how.

    ``extended`` estimates gyro scale errors and the zero of the encoders too; ``factor`` of the covariance for
    sigma points (None: as in `FACTOR_OF`); ``integration`` of the gimbal-ukf; ``gating`` None is off.
    """

    kind: FilterKind = "error-state"
    extended: bool = False
    gating: Gating | None = None
    factor: FactorKind | None = None
    integration: Literal["rk4", "euler"] = "rk4"


@dataclass(frozen=True)
class Disturbances:
    """What a simulation adds to the model; nothing by default.

    Attributes
    ----------
    dropouts : float
        Probability that a row has neither accelerometers nor angles.
    harmonics : tuple of (int, int, float, float)
        Errors of encoders: joint 0, 1, 2, order k, amplitude [rad], phase [rad]: a sin(k th + phase).
    command_delay : float
        Time [s] by which the platform acts after the command log says.
    substeps : int
        Steps of the truth between two rows.
    """

    dropouts: float = 0.0
    harmonics: tuple[tuple[int, int, float, float], ...] = ()
    command_delay: float = 0.0
    substeps: int = 10


@dataclass(frozen=True)
class Search:
    """A search for a path: ``turns`` most in number, of multiples of ``angle`` [rad], within ``time`` [s] at the
    rates of the plan; ``criterion`` ``mean`` (of log u) or ``worst`` (largest u over goal or prior); ``seed``.
    ``time`` None: as long as the plan of the study."""

    turns: int = 5
    angle: float = float(np.radians(30.0))
    time: float | None = None
    criterion: Literal["worst", "mean"] = "mean"
    seed: int = 1


@dataclass(frozen=True, eq=False)
class SelfcalSettings:
    """A study of self-calibration, in SI.

    Attributes
    ----------
    site : Site
        Latitude and gravity with their uncertainties.
    gimbals, base
        The rig.
    heading_unknown : bool
        The heading of the base is to be found from the record; beta corrects it.
    limits : mapping
        Allowed range (low, high) [rad] of a gimbal angle by its name ``th_x``.
    plan : Plan or None
        The path; None where the study has none (a record is enough to calibrate).
    noise : Noise
    prior : (24,)
        Standard deviations of all coefficients about 0, in the order of `inercal.selfcal.platform.coefficients`.
    truth : (24,) or None
        Product form, for simulations; its last six are the true gyro scale errors and base tilt.
    goal : mapping
        Wanted standard uncertainty [SI] by name of coefficient.
    filter, disturbances, search
    traceability, temperature, given
        As in `inercal.imu.settings.ImuSettings`.
    """

    site: Site
    noise: Noise
    prior: Array
    gimbals: Gimbals = field(default_factory=Gimbals)
    base: Base = field(default_factory=Base)
    heading_unknown: bool = False
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    plan: Plan | None = None
    truth: Array | None = None
    goal: Mapping[str, float] = field(default_factory=dict)
    filter: Filter = field(default_factory=Filter)
    disturbances: Disturbances = field(default_factory=Disturbances)
    search: Search = field(default_factory=Search)
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def world(self) -> World:
        """Earth rate and gravity on the base."""
        return world(self.site, self.base, self.gimbals)

    @property
    def size(self) -> int:
        """Number of coefficients estimated: 18, or 24."""
        return len(self.prior) if self.filter.extended else len(NAMES)
