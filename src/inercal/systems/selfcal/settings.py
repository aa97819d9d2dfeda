"""Settings of a study of self-calibration, in SI: rig, plan, truth, noise, prior, goal, filter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePath
from typing import Any, Literal

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import (
    REQUIRED,
    TIME,
    Bounds,
    above_zero,
    option,
    quantity,
    table,
    within,
)
from inercal.foundation.units import Quantity
from inercal.systems.selfcal.disturbances import Disturbances
from inercal.systems.selfcal.estimators import FactorKind, FilterKind
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.joint_limits import JointLimits
from inercal.systems.selfcal.platform.plan import PlatformPlan
from inercal.systems.selfcal.platform.rig import JOINTS, LEANING, Base, Gimbals, World, world
from inercal.systems.selfcal.platform.states import (
    ALL,
    EXTENDED_MODEL,
    LEFT_OUT,
    PAPER,
    STATES,
    USUAL_WAVES,
    WALK,
    StateVector,
    state_vector,
)

_OF_A_SAMPLE = above_zero("a standard deviation of a sample")
_OF_A_TURN = Bounds(lambda angle: 0.0 < angle <= 2.0 * math.pi, "an angle above 0 and up to 360 deg")


@dataclass(frozen=True)
class Noise:
    """Noise of the instruments."""

    angle_random_walk: float = quantity(
        "of the gyros", "angle random walk", REQUIRED, example="5e-4 deg/sqrt(h)",
        bounds=above_zero("an angle random walk"),
    )  # fmt: skip
    accelerometer: float = quantity(
        "standard deviation of a sample", "acceleration", REQUIRED, example="10 ug", bounds=_OF_A_SAMPLE
    )
    encoder: float = quantity(
        "standard deviation of a sample of an angle",
        "angle",
        REQUIRED,
        example="2 arcsec",
        bounds=_OF_A_SAMPLE,
    )
    gyro_walk: float = quantity(
        "of the gyros' biases about their means, within 60 s, where bias_walk is among the states",
        "rate random walk", "1e-4 deg/h/sqrt(s)", bounds=above_zero("a walk"),
    )  # fmt: skip
    accelerometer_walk: float = quantity(
        "the same of the accelerometers' biases", "acceleration random walk", "0.35 ug/sqrt(s)",
        bounds=above_zero("a walk"),
    )  # fmt: skip

    base_sway: float = quantity(
        "amplitude of the sway of the base about level axes, noise to the encoders", "angle", "0 arcsec",
        example="2 arcsec", bounds=within(0.0, math.inf, "an angle of 0 or more"),
    )  # fmt: skip

    vibration: float = quantity(
        "root mean square along each axis, faster than the rows, noise to the accelerometers", "acceleration", "0 ug",
        example="1 mg", bounds=within(0.0, math.inf, "a vibration of 0 or more"),
    )  # fmt: skip

    @property
    def unsteady(self) -> bool:
        """True where the base is stated to sway or to vibrate, which is no white noise."""
        return self.base_sway > 0.0 or self.vibration > 0.0

    @property
    def of_readings(self) -> Noise:
        """The same with the sway of the base in the noise of the encoders, which read angles against it, and its
        vibration in that of the accelerometers."""
        return replace(
            self,
            encoder=math.hypot(self.encoder, self.base_sway / math.sqrt(2.0)),
            accelerometer=math.hypot(self.accelerometer, self.vibration),
        )

    @property
    def gyro_walk_sigma(self) -> float:
        """Standard deviation [rad/s] of the gyros' biases about their means."""
        return self.gyro_walk * math.sqrt(0.5 * LIMITS.walk_time)

    @property
    def accelerometer_walk_sigma(self) -> float:
        """Standard deviation [m/s^2] of the accelerometers' biases about their means."""
        return self.accelerometer_walk * math.sqrt(0.5 * LIMITS.walk_time)


@dataclass(frozen=True)
class Gating:
    """Near-level gating: an accelerometer is near level from |f_i| < sin(``near``) g0 on until |f_i| > sin(``far``) g0.

    ``rule``: ``any`` stops where any accelerometer is near level, ``two`` where two are, ``channel`` each by itself.
    ``stops``: the ``accelerometers`` or the whole ``step`` of update. Angles in rad.
    """

    rule: Literal["off", "any", "two", "channel"] = option(
        "near-level gating: stop where any accelerometer is near level, where two are, or each by itself", "off",
        name="gating",
    )  # fmt: skip
    stops: Literal["accelerometers", "step"] = option(
        "what gating stops: the accelerometers, or the whole update", "accelerometers", name="gating_stops"
    )
    near: float = float(np.radians(2.0))
    far: float = float(np.radians(5.0))


@dataclass(frozen=True)
class Filter:
    """The estimator and its options; ``gating`` None is off."""

    kind: FilterKind = option("the estimator; --filter overrides it", "error-state")
    extended: bool = option("estimate gyro scale errors and the encoders' zero too", False)
    gating: Gating | None = None
    factor: FactorKind | None = option(
        "of the covariance, for sigma points; cholesky if absent, but eigen for svd-qukf", None
    )
    integration: Literal["rk4", "euler"] = option("of the gimbal angles, for gimbal-ukf", "rk4")


@dataclass(frozen=True, eq=False)
class PlatformStates:
    """The model of the platform: kinds of ``states`` (None: the paper's, with the extended model where the filter has
    it), and, by name of parameter, what is ``stated`` of those of the rig: value and standard uncertainty [SI].
    ``left_out``: parameters of these kinds that a recording cannot tell from others; ``harmonics`` by joint 0, 1, 2 and
    order, in the order of their parameters."""

    states: tuple[str, ...] | None = None
    stated: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    harmonics: tuple[tuple[int, int], ...] = USUAL_WAVES


@dataclass(frozen=True)
class Search:
    """The search for a path."""

    turns: int = option("how many at most", 5, least=1, most=50)
    angle: float = quantity("turns are multiples of it", "angle", "30 deg", bounds=_OF_A_TURN)
    time: float | None = quantity(
        "most that the path may take; that of the plan if absent", "time", example="540 s", bounds=TIME
    )
    criterion: Literal["worst", "mean"] = option(
        "the mean of all uncertainties on a log scale, or the largest over goal or prior (worst)", "mean"
    )
    closed: bool = option("the path ends at the angles where it began", False)
    rest: float = quantity(
        "after each turn", "time", "0 s", example="10 s", bounds=within(0.0, math.inf, "a time of 0 or more")
    )
    robust: tuple[Literal[LEFT_OUT], ...] = option(  # type: ignore[valid-type]
        "errors that are no states, of the size stated under model, or usual: how far they shift coefficients counts "
        "beside the bound", (), example=["k2", "harmonics"],
    )  # fmt: skip
    seed: int = option("of the random starts", 1, least=0)


@dataclass(frozen=True)
class PlacedRecord:
    """A record of a platform on a base of its own; several are fitted together."""

    file: str = option("of the record, as the command is given it", example="south.csv", least=1)
    heading: float | None = quantity(
        "of the base, from north to east; that of [rig] if absent", "angle", example="40 deg", words={"unknown": 0.0}
    )  # fmt: skip
    tilt: tuple[float, float] | None = quantity(
        "of the base, about north and about east; that of [rig] if absent", "angle",
        example=["0 arcmin", "0 arcmin"], of="the one about north, the one about east", bounds=LEANING,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class RecordOnBase:
    """A record with a base of its own: its ``file`` as typed, the ``base``, unknown in heading where
    ``heading_unknown``, and the ``prior`` (24,) of the coefficients with that of the base."""

    file: str
    base: Base
    heading_unknown: bool
    prior: Array

    def names(self, path: str) -> bool:
        """True for the path of that file."""
        own = PurePath(self.file).parts
        return PurePath(path).parts[-len(own) :] == own

    def of(self, settings: SelfcalSettings) -> SelfcalSettings:
        """The study with that base."""
        return replace(settings, base=self.base, heading_unknown=self.heading_unknown, prior=self.prior)


@short_repr
@dataclass(frozen=True, eq=False)
class SelfcalSettings:
    """A study of self-calibration, in SI.

    ``site`` with its uncertainties; ``gimbals`` and ``base`` the rig, its heading to be found from the record where
    ``heading_unknown``; ``limits`` (low, high) [rad] of a gimbal angle by its name, ``joints`` what limits them else,
    and the angle [rad] of each joint
    that is ``fixed``, on a rig of one or two axes, and has no encoder; ``plan`` None where a record is
    enough. ``prior`` (24,) standard deviations of the coefficients about 0, in the order of
    `inercal.systems.selfcal.platform.coefficients`; ``truth`` (24,), (K,) with the rig's, or None, product form, for
    simulations; ``goal`` wanted standard uncertainty [SI] by name;
    ``placed`` the bases of several records. ``traceability``, ``temperature``, ``given`` as in
    `inercal.systems.imu.settings.ImuSettings`.
    """

    site: Site
    prior: Array
    noise: Noise = table("noise of the instruments")
    gimbals: Gimbals = field(default_factory=Gimbals)
    base: Base = field(default_factory=Base)
    heading_unknown: bool = False
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    joints: JointLimits = field(default_factory=JointLimits)
    fixed: Mapping[str, float] = field(default_factory=dict)
    plan: PlatformPlan | None = None
    truth: Array | None = None
    goal: Mapping[str, float] = field(default_factory=dict)
    filter: Filter = field(default_factory=Filter)
    model: PlatformStates = field(default_factory=PlatformStates)
    disturbances: Disturbances = field(default_factory=Disturbances)
    search: Search = table("the search for a path", Search(), name="design")
    placed: tuple[RecordOnBase, ...] = ()
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def world(self) -> World:
        """Earth rate and gravity on the base."""
        return world(self.site, self.base, self.gimbals)

    @property
    def unread(self) -> tuple[int, ...]:
        """Joints 0, 1, 2 that are fixed."""
        return tuple(k for k, name in enumerate(JOINTS) if name in self.fixed)

    @property
    def fixed_angles(self) -> Array:
        """(3,) rad, of fixed joints, 0 for the others."""
        return np.array([self.fixed.get(name, 0.0) for name in JOINTS])

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the states that are estimated."""
        if self.model.states is not None:
            return self.model.states
        return EXTENDED_MODEL if self.filter.extended else PAPER

    @property
    def extended(self) -> bool:
        """True where gyro scale errors and the encoders' zero are estimated."""
        return "beta" in self.kinds

    def with_extended(self) -> SelfcalSettings:
        """The study with the extended model."""
        if self.extended:
            return self
        if self.model.states is None:
            return replace(self, filter=replace(self.filter, extended=True))
        kinds = (*EXTENDED_MODEL, *self.model.states[len(PAPER) :])
        return replace(self, model=replace(self.model, states=kinds))

    @property
    def states(self) -> StateVector:
        """The states that are estimated, and the values of those that are not."""
        stated = np.zeros(len(ALL))
        for name, (value, _) in self.model.stated.items():
            stated[ALL.index(name)] = value
        return state_vector(self.kinds, stated, self.model.left_out, self.model.harmonics, self.unread)

    @property
    def priors(self) -> Array:
        """(K,) standard deviations of the full vector, those of the rig as stated or usual."""
        usual = [state.usual for state in STATES.values() for _ in state.parameters]
        whole = np.append(self.prior, usual[len(self.prior) :])
        whole[WALK : WALK + 3] = self.noise.gyro_walk_sigma
        whole[WALK + 3 :] = self.noise.accelerometer_walk_sigma
        for name, (_, u) in self.model.stated.items():
            whole[ALL.index(name)] = u or whole[ALL.index(name)]
        return whole

    def warm(self, temperature: Array) -> Array:
        """Temperatures (n,) [degC] less that of the coefficients: the stated one, else the mean."""
        of_coefficients = float(np.mean(temperature)) if self.temperature is None else self.temperature.value
        return temperature - of_coefficients

    def simulated_temperature(self, n: int) -> Array | None:
        """(n,) [degC] of the rows of a simulation; None where it is constant."""
        given = self.disturbances.temperature
        if not given:
            return None
        return np.asarray(np.interp(np.linspace(0.0, 1.0, n), np.linspace(0.0, 1.0, len(given)), given))

    @property
    def true_values(self) -> Array | None:
        """(K,) the truth of the full vector, product form, if it is stated."""
        if self.truth is None:
            return None
        return np.append(self.truth, np.zeros(len(ALL) - len(self.truth)))
