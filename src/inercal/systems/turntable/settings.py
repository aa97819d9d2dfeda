"""Settings of an analysis, a design, a simulation or a calibration on a turntable."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from inercal.foundation.arrays import short_repr
from inercal.foundation.designs.tolerances import Price
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import (
    FREQUENCY,
    RATE,
    RELATIVE_U,
    TIME,
    above_zero,
    option,
    quantities,
    quantity,
    within,
)
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.plans import Plan
from inercal.foundation.units import Quantity, Unit

BiasDrift = Literal["none", "linear", "exponential", "random_walk"]
"""Drift of the biases over a test."""


@dataclass(frozen=True)
class Analysis:
    """The sensitivity analysis; ``outputs`` are names of `inercal.foundation.rigs.outputs.NAMES`, or ``y_x``,
    ``y_y``."""

    outputs: tuple[str, ...] = ("ax", "ay", "az", "wx", "wy")
    method: Literal["exact", "sampled", "local"] = option(
        "exact, from samples, or from derivatives alone", "exact"
    )
    sampling: Literal["random", "sobol"] = option(
        "plain random rows, or scrambled Sobol points; for sampled", "sobol"
    )
    samples: int = option("rows at each position; for sampled", 1024, least=2, most=2**24)
    seed: int = option("of the random numbers; for sampled", 1, least=0)


@dataclass(frozen=True)
class Instrument:
    """The instrument on the table.

    Attributes
    ----------
    kind, dwell, sample_rate, bias_drift, earth_rate
        As their keys say; the kind is a key of `inercal.foundation.instruments.by_angle.CHANNELS`.
    unit : Unit
        Of its outputs in a record that is simulated. Coefficients and noise are in its SI unit where it is one of
        rate or acceleration (then k_x is a pure number), else in that of their dimension (count, V, A, N*m, 1).
    terms : tuple of str or None
        Terms to be estimated, for any of its channels; None: those usual for the kind.
    coefficients : mapping
        Stated values of terms: the truth of a simulation, and in a calibration the terms not fitted. In the units
        of the term table, with that SI unit for ``output``.
    coefficients_u : mapping
        Their standard uncertainties, where stated.
    noise : float or None
        Standard deviation of a reading (the mean over a dwell), SI; None: estimated from the scatter.
    """

    kind: Literal["gyrowheel", "gyro", "accelerometer"] = option(
        "gyrowheel (two drift outputs), gyro or accelerometer (one to three)", "gyrowheel"
    )
    unit: Unit = field(default_factory=lambda: Unit("rad/s", "rate", 1.0))
    terms: tuple[str, ...] | None = None
    coefficients: Mapping[str, float] = field(default_factory=dict)
    coefficients_u: Mapping[str, float] = field(default_factory=dict)
    noise: float | None = None
    dwell: float = quantity("time in each position", "time", "60 s", bounds=TIME)
    sample_rate: float | None = quantity(
        "samples per second of a simulation; one row a position if absent", "frequency", example="10 Hz",
        bounds=FREQUENCY,
    )  # fmt: skip
    bias_drift: BiasDrift = option(
        "drift of the biases that is fitted: none, linear, exponential (a warm-up) or random_walk", "none"
    )
    earth_rate: Literal["fitted", "stated"] | None = option(
        "whether the response to earth rate is fitted; if absent where the plan allows", None
    )

    @property
    def samples(self) -> int:
        """Rows of a record behind each reading."""
        return 1 if self.sample_rate is None else max(1, round(self.sample_rate * self.dwell))


@dataclass(frozen=True)
class Constraint:
    """The paper's way: only positions where every index S of ``factors`` on ``outputs`` stays below ``below``."""

    factors: tuple[str, ...]
    outputs: tuple[str, ...]
    below: float


@dataclass(frozen=True, eq=False)
class PositionDesign:
    """The search for positions.

    ``candidates`` from which to choose; ``compare`` named plans to set beside; ``constraint`` the paper's.
    """

    candidates: Plan
    positions: int = option("how many", 24, least=1, most=1000)
    criterion: Literal["D", "A", "I"] = option(
        "D: volume, A: mean variance of the coefficients; I: variance of prediction", "D"
    )
    table_errors: bool = option("judge with the errors of the table, or by the noise alone", True)
    compare: tuple[str, ...] = ()
    constraint: Constraint | None = None
    seed: int = option("of the random starts", 1, least=0)


@dataclass(frozen=True)
class Cost:
    """The cost of a tolerance: of the size that the study states, and its growth as the tolerance is tightened."""

    cost: float = option("relative cost of the size that the study states", 1.0, least=1e-6)
    exponent: float = option("power of the inverse size that the cost goes with", 1.0, least=0.01, most=10.0)


@dataclass(frozen=True, eq=False)
class Tolerances:
    """The search for tolerances: wanted u by symbol of a coefficient, or ``drift``, in SI; the price of each error.

    ``drift`` is the rms u of the predicted output over all directions of gravity.
    """

    goal: Mapping[str, float] = field(default_factory=dict)
    prices: Mapping[str, Price] = field(default_factory=dict)
    position: float = option("cost of taking one position, in the same unit", 0.0, least=0.0)


@dataclass(frozen=True)
class Leg:
    """A part of a rate test: the ``joint`` that turns, and angles [rad] ``at`` which it begins; 0 where absent."""

    joint: str
    at: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RateTest:
    """A rate test of gyros: the table turns at each rate in turn, by whole turns or not.

    ``at`` holds angles [rad] of a simulation: where the other joints stand and each stay begins; 0 where absent.
    ``legs`` are those of a simulation in which several axes turn, one after the other, each at all rates.
    """

    joint: str = option("axis that turns, where no column joint of the record says", "phi2")
    full_scale: float | None = quantity(
        "rate that non-linearity is stated against; the largest if absent", "rate", example="100 deg/s",
        bounds=RATE,
    )  # fmt: skip
    order: Literal[1, 2, 3] = option("1 scale factor alone, 2 and 3 with S2 and S3", 1)
    rates: tuple[float, ...] = quantities(
        "rates of a simulation, in the order taken", "rate", example=["-10 deg/s", "10 deg/s"]
    )
    rate_u: float = quantity(
        "relative standard uncertainty of the table's rate, common to all rates", "number", "0", example="20 ppm",
        bounds=RELATIVE_U, name="rate_uncertainty",
    )  # fmt: skip
    at: Mapping[str, float] = field(default_factory=dict)
    legs: tuple[Leg, ...] = ()


@dataclass(frozen=True)
class StepTest:
    """A test of accelerometers by small steps about level; all but its being there is for a simulation.

    ``at`` holds angles [rad] at which the table is level; 0 where absent.
    """

    joint: str = option("axis that tilts; for simulate", "phi1")
    largest: float = quantity(
        "largest tilt to either side; for simulate", "angle", "60 arcsec", bounds=above_zero("an angle")
    )
    step: float = quantity(
        "change of the tilt from step to step; for simulate",
        "angle",
        "2 arcsec",
        bounds=above_zero("an angle"),
    )
    cycles: int = option("times up, down and back; for simulate", 2, least=1, most=1000)
    at: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that a simulation adds to table and instrument, and no calibration knows; none if absent.

    Those of outputs are in the SI unit of these: ``ramp`` their change over the test, ``warm_up`` their excess at its
    begin, ``random_walk`` its standard deviation at the end, ``dead_zone`` the response below which there is none,
    ``hysteresis`` the output after it was raised less that after it was lowered, ``magnetic`` that along a field to the
    north and down. ``harmonics`` are errors of encoders: joint, order k, amplitude [rad], phase [rad]:
    a sin(k phi + phase).
    """

    heading: float = quantity(
        "turn of the base about up that nobody knows of, north towards west positive", "angle", "0 deg",
        example="1 deg",
    )  # fmt: skip
    tilt_north: float = quantity("tilt of the base about north", "angle", "0 arcsec", example="20 arcsec")
    tilt_west: float = quantity("tilt of the base about west", "angle", "0 arcsec", example="20 arcsec")
    angle: float = quantity(
        "standard deviation of an error of each joint that comes back at each commanded angle", "angle",
        "0 arcsec", example="5 arcsec", bounds=within(0.0, math.inf, "an angle of 0 or more"),
    )  # fmt: skip
    scale_drift: float = quantity(
        "relative change of the response to inputs from begin to end of the test",
        "number",
        "0",
        example="20 ppm",
    )
    warm_up_time: float = quantity("in which the warm-up falls to 1/e", "time", "30 min", bounds=TIME)
    dip: float = quantity("of the field below the horizon", "angle", "60 deg")
    harmonics: tuple[tuple[str, int, float, float], ...] = ()
    ramp: float = 0.0
    warm_up: float = 0.0
    random_walk: float = 0.0
    dead_zone: float = 0.0
    hysteresis: float = 0.0
    magnetic: float = 0.0


@short_repr
@dataclass(frozen=True, eq=False)
class TurntableSettings:
    """A study of a turntable, in SI.

    Attributes
    ----------
    site : Site
        Gravity, latitude and what they are uncertain by.
    rig : str
        Kind of table, a key of `inercal.foundation.rigs.tables.TABLES`.
    chain : Chain
        The table with its errors.
    plan : Plan
        Positions to analyse, simulate or calibrate at.
    limits : mapping
        Allowed range (low, high) [rad] of a joint by its name.
    design, tolerances
        Settings of a search for positions, and of one for tolerances.
    disturbances : Disturbances
        Of a simulation.
    traceability, temperature, given
        As in `inercal.systems.imu.settings.ImuSettings`.
    """

    site: Site
    rig: str
    chain: Chain
    plan: Plan
    design: PositionDesign
    analysis: Analysis = Analysis()
    instrument: Instrument = Instrument()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rate_test: RateTest | None = None
    step_test: StepTest | None = None
    disturbances: Disturbances = Disturbances()
    tolerances: Tolerances = Tolerances()
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
