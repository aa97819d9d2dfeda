"""Settings of an analysis, a design, a simulation or a calibration on a turntable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from inercal.foundation.arrays import short_repr
from inercal.foundation.designs.tolerances import Price
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.instruments.by_angle import CHANNELS, channel_model
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.keys import (
    AS_TYPED,
    FREQUENCY,
    OUTPUT,
    RATE,
    RELATIVE_U,
    REQUIRED,
    TIME,
    above_zero,
    keyed,
    option,
    quantities,
    quantity,
    table,
    within,
)
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.plans import PLAN_NAME, Plan
from inercal.foundation.units import Quantity, Unit

JointName = Literal["phi1", "phi2", "phi3"]
OutputName = Literal["ax", "ay", "az", "wx", "wy", "wz"]
AnalysedName = Literal["ax", "ay", "az", "wx", "wy", "wz", "y_x", "y_y"]
BiasDrift = Literal["none", "linear", "exponential", "random_walk"]
"""Drift of the biases over a test."""


@dataclass(frozen=True)
class Analysis:
    """The sensitivity analysis."""

    outputs: tuple[AnalysedName, ...] = option(
        "components of gravity (a) and earth rate (w) on the instrument's axes; y_x, y_y: outputs of a gyrowheel with "
        "the coefficients of [instrument.coefficients]", ("ax", "ay", "az", "wx", "wy"), least=1,
    )  # fmt: skip
    method: Literal["exact", "sampled", "local"] = option(
        "exact, from samples, or from derivatives alone", "exact"
    )
    sampling: Literal["random", "sobol"] = option(
        "plain random rows, or scrambled Sobol points; for sampled", "sobol"
    )
    samples: int = option("rows at each position; for sampled", 1024, least=2, most=2**24)
    seed: int = option("of the random numbers; for sampled", 1, least=0)

    def __post_init__(self) -> None:
        """Refuse an output that occurs twice."""
        _once("outputs", self.outputs)


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
    unit: Unit = quantity(
        "of its outputs where no record says it; that of the noise, rad/s or m/s^2 if absent", OUTPUT,
        Unit("rad/s", "rate", 1.0), example="deg/h",
    )  # fmt: skip
    terms: tuple[str, ...] | None = option(
        "terms to estimate; those usual for the kind if absent", None, least=1
    )
    coefficients: Mapping[str, float] = option(
        "values of terms by symbol: true ones to simulate, stated ones where a term is not fitted", {}, reads=AS_TYPED
    )  # fmt: skip
    coefficients_u: Mapping[str, float] = field(default_factory=dict)
    noise: float | None = quantity(
        "standard deviation of a reading, or random walk; from the scatter if absent", OUTPUT,
        example="0.01 deg/h",
    )  # fmt: skip
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
    """Only positions where the sensitivity of outputs to errors is low, the paper's way."""

    factors: tuple[str, ...] = option("errors of the table by name", least=1)
    outputs: tuple[OutputName, ...] = option("outputs whose first-order indices count", least=1)
    below: float = option("what each index stays below", least=0.0, most=1.0)

    def __post_init__(self) -> None:
        """Refuse a name that occurs twice, and a limit that nothing stays below."""
        _once("factors", self.factors)
        _once("outputs", self.outputs)
        if not self.below > 0.0:
            raise InputError("below", f"found {self.below:g}, expected a number above 0, at most 1")


@dataclass(frozen=True, eq=False)
class PositionDesign:
    """The search for positions: ``candidates`` from which to choose, ``compare`` named plans to set beside."""

    candidates: Plan
    positions: int = option("how many", 24, least=1, most=1000)
    criterion: Literal["D", "A", "I"] = option(
        "D: volume, A: mean variance of the coefficients; I: variance of prediction", "D"
    )
    table_errors: bool = option("judge with the errors of the table, or by the noise alone", True)
    compare: tuple[str, ...] = option(
        "named plans to set beside; all the table can take if absent", (), reads=PLAN_NAME
    )
    constraint: Constraint | None = table(
        "only positions of low sensitivity; all if absent", None,
        example={"factors": ["dtheta_x"], "outputs": ["ax"], "below": 0.3}, name="sensitivity",
    )  # fmt: skip
    seed: int = option("of the random starts", 1, least=0)


DRIFT = "drift"
"""The goal that is no coefficient."""

SYMBOLS = {
    kind: tuple(symbol for channel in channels for symbol in channel_model(kind, channel).symbols)
    for kind, channels in CHANNELS.items()
}
"""Coefficients by kind of instrument."""

_GOALS = {
    symbol: (
        Any,
        option(f"wanted u of {symbol}: {TERMS[symbol].name}", None, example="0.01 deg/h", reads=AS_TYPED),
    )
    for symbols in SYMBOLS.values()
    for symbol in symbols
}


@dataclass(frozen=True)
class WantedOfTable(keyed("WantedByName", _GOALS)):  # type: ignore[misc]
    """Wanted uncertainties, for design tolerances: of coefficients, and of the drift after compensation."""

    drift: Any = option(
        "wanted u of the output that the coefficients predict, rms over all directions of gravity", None,
        example="0.02 deg/h", reads=AS_TYPED,
    )  # fmt: skip

    @property
    def stated(self) -> dict[str, Any]:
        """Those stated, as typed, by symbol or `DRIFT`."""
        return {name: text for name, text in vars(self).items() if text is not None}


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
class JointAngles:
    """Angles of the axes."""

    phi1: float = quantity("outer angle; 0 if absent", "angle", 0.0, example="40 deg")
    phi2: float = quantity("of the next axis; 0 if absent", "angle", 0.0, example="40 deg")
    phi3: float = quantity("of the inner axis of three; 0 if absent", "angle", 0.0, example="40 deg")

    def of(self, joints: Sequence[str]) -> list[float]:
        """Angles [rad] of some joints."""
        return [getattr(self, joint) for joint in joints]


@dataclass(frozen=True, kw_only=True)
class Leg(JointAngles):
    """A part of a rate test: the axis that turns, and angles at which it begins."""

    joint: JointName = option("axis that turns")


@dataclass(frozen=True)
class RateTest:
    """A rate test of gyros: the table turns at each rate in turn, by whole turns or not."""

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
    at: JointAngles = table(
        "angles of a simulation, where each stay begins", JointAngles(), example={"phi1": "90 deg"}
    )
    legs: tuple[Leg, ...] = table(
        "axes of a simulation that turn one after the other; joint alone if absent", (),
        example=[{"joint": "phi1"}, {"joint": "phi1", "phi2": "90 deg"}, {"joint": "phi2"}],
    )  # fmt: skip


@dataclass(frozen=True)
class StepTest:
    """A test by small steps about level: threshold, dead zone and hysteresis of accelerometers."""

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
    at: JointAngles = table(
        "angles of a simulation, where the accelerometer is level", JointAngles(), example={"phi2": "90 deg"}
    )


@dataclass(frozen=True)
class TableHarmonic:
    """An error of an encoder that repeats with its angle: amplitude times sin(order times angle + phase)."""

    joint: JointName = option("the joint")
    order: int = option("periods in a full turn", least=1, most=100_000)
    amplitude: float = quantity("of the error", "angle", REQUIRED, example="5 arcsec")
    phase: float = quantity("at angle 0; 0 if absent", "angle", 0.0, example="40 deg")


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that a simulation adds to table and instrument, and no calibration knows; none if absent.

    Those of outputs are in the SI unit of these.
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
    harmonics: tuple[TableHarmonic, ...] = table(
        "errors of the encoders; none if absent", (),
        example=[{"joint": "phi2", "order": 1, "amplitude": "5 arcsec", "phase": "0 deg"}],
    )  # fmt: skip
    ramp: float = quantity(
        "steady change of the outputs from begin to end of the test", OUTPUT, 0.0, example="0.2 deg/h"
    )
    warm_up: float = quantity(
        "excess of the outputs at the begin, which dies away", OUTPUT, 0.0, example="0.2 deg/h"
    )
    random_walk: float = quantity(
        "standard deviation that a random walk of the outputs has at the end of the test", OUTPUT, 0.0,
        example="0.1 deg/h", bounds=within(0.0, math.inf, "a value of 0 or more"),
    )  # fmt: skip
    dead_zone: float = quantity(
        "response to an input below which there is none: the output stays at its bias", OUTPUT, 0.0,
        example="0.05 deg/h", bounds=within(0.0, math.inf, "a value of 0 or more"),
    )  # fmt: skip
    hysteresis: float = quantity(
        "output after it was raised less that after it was lowered, at the same input", OUTPUT, 0.0,
        example="0.05 deg/h",
    )  # fmt: skip
    magnetic: float = quantity(
        "output along a field that is fixed to the ground, to the north and down",
        OUTPUT,
        0.0,
        example="0.05 deg/h",
    )


def _once(key: str, names: Sequence[str]) -> None:
    """Raise `InputError` for a name that occurs twice."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise InputError(key, f"found {name!r} twice, expected each once")


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
    analysis: Analysis = table("the sensitivity analysis", Analysis())
    instrument: Instrument = Instrument()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rate_test: RateTest | None = table("a rate test; none if absent", None)
    step_test: StepTest | None = table("a test by small steps about level; none if absent", None)
    disturbances: Disturbances = Disturbances()
    tolerances: Tolerances = Tolerances()
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
