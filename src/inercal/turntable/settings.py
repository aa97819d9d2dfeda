"""What an analysis, a design, a simulation or a calibration on a turntable is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from inercal.geometry.site import Site
from inercal.rigs.chain import Chain
from inercal.rigs.plans import Plan
from inercal.units import Quantity, Unit


@dataclass(frozen=True)
class Analysis:
    """A sensitivity analysis.

    ``outputs`` names of `inercal.rigs.outputs.NAMES`; ``method`` exact, sampled or local; for a sampled one
    ``sampling`` plain random rows or scrambled Sobol points, ``samples`` N, and ``seed``.
    """

    outputs: tuple[str, ...] = ("ax", "ay", "az", "wx", "wy")
    method: Literal["exact", "sampled", "local"] = "exact"
    sampling: Literal["random", "sobol"] = "sobol"
    samples: int = 1024
    seed: int = 1


@dataclass(frozen=True)
class Instrument:
    """The instrument on the table.

    Attributes
    ----------
    kind : str
        ``gyrowheel``, ``gyro`` or ``accelerometer``, a key of `inercal.instruments.by_angle.CHANNELS`.
    unit : Unit
        Of its outputs in a record that is simulated. Coefficients and noise are in its SI unit where it is one of
        rate or acceleration (then k_x is a pure number), else in the unit itself (count, V, 1).
    terms : tuple of str or None
        Terms to be estimated, for any of its channels; None: those usual for the kind.
    coefficients : mapping
        Stated values of terms: the truth of a simulation, and in a calibration what is not fitted. In the units
        of the term table, with that SI unit for ``output``.
    coefficients_u : mapping
        Their standard uncertainties, where stated.
    noise : float or None
        Standard deviation of a reading (the mean over a dwell), SI; None: estimated from the scatter.
    dwell : float
        Time in each position [s].
    sample_rate : float or None
        Samples per second; None: one row for each position.
    earth_rate : str or None
        ``fitted`` or ``stated``; None: fitted where the plan allows, else stated.
    """

    kind: Literal["gyrowheel", "gyro", "accelerometer"] = "gyrowheel"
    unit: Unit = field(default_factory=lambda: Unit("rad/s", "rate", 1.0))
    terms: tuple[str, ...] | None = None
    coefficients: Mapping[str, float] = field(default_factory=dict)
    coefficients_u: Mapping[str, float] = field(default_factory=dict)
    noise: float | None = None
    dwell: float = 60.0
    sample_rate: float | None = None
    earth_rate: Literal["fitted", "stated"] | None = None

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
class Design:
    """A search for positions.

    ``positions`` how many; ``criterion`` D, A or I; ``table_errors`` judge by the covariance with table errors
    and not by the noise alone; ``candidates`` from which to choose; ``compare`` named plans to set beside;
    ``constraint`` the paper's; ``seed`` of the random starts.
    """

    candidates: Plan
    positions: int = 24
    criterion: Literal["D", "A", "I"] = "D"
    table_errors: bool = True
    compare: tuple[str, ...] = ()
    constraint: Constraint | None = None
    seed: int = 1


@dataclass(frozen=True)
class RateTest:
    """A rate test: the table turns about ``joint`` at each rate in turn, whole turns or not.

    Attributes
    ----------
    joint : str
        The one that turns.
    full_scale : float or None
        Rate [rad/s] by which non-linearity is divided; None: the largest of the record.
    rates : tuple of float
        Rates [rad/s] of a simulation, in the order taken.
    rate_u : float
        Relative standard uncertainty of the table's rate, common to all rates.
    order : int
        Of the polynomial that is fitted: 1 scale factor, 2 and 3 with S2 and S3.
    at : mapping
        Angles [rad] of a simulation: where the other joints stand and each stay begins; 0 where nothing is said.
    """

    joint: str = "phi2"
    full_scale: float | None = None
    rates: tuple[float, ...] = ()
    rate_u: float = 0.0
    order: Literal[1, 2, 3] = 1
    at: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class TurntableSettings:
    """A study of a turntable, in SI.

    Attributes
    ----------
    site : Site
        Gravity, latitude and what they are uncertain by.
    rig : str
        Kind of table, a key of `inercal.rigs.tables.TABLES`.
    chain : Chain
        The table with its errors.
    plan : Plan
        Positions to analyse, simulate or calibrate at.
    limits : mapping
        Allowed range (low, high) [rad] of a joint by its name.
    design : Design
        How positions are searched.
    traceability, temperature, given
        As in `inercal.imu.settings.ImuSettings`.
    """

    site: Site
    rig: str
    chain: Chain
    plan: Plan
    design: Design
    analysis: Analysis = Analysis()
    instrument: Instrument = Instrument()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    rate_test: RateTest | None = None
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
