"""Settings of a study of a strapdown unit, in SI: noise, rests, start, prior, terms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import (
    AS_TYPED,
    DEVIATION,
    FREQUENCY,
    RELATIVE_U,
    REQUIRED,
    TIME,
    Bounds,
    Reading,
    above_zero,
    option,
    quantities,
    quantity,
    table,
    within,
)
from inercal.foundation.units import Quantity, parse_quantity, shown
from inercal.systems.strapdown.model.coefficients import GRAVITY, GROUPS, LATITUDE, SIZE, USUAL, Frame

Estimator = Literal["batch", "error-state"]
Term = Literal["k2", "size", "delay", "asymmetry", "g_sensitivity"]

_MARGIN = within(0.0, math.inf, "a time of 0 or more")
_NODE = Bounds(lambda time: 0.1 <= time <= 100.0, "a time from 0.1 s to 100 s")
_SIZE = within(0.0, math.inf, "0 or more")
_ESTIMATE = {"estimate": 0.0}


def _turn(typed: Any) -> tuple[int, float]:
    """A turn: axis 0 to 2, which may have a sign, and angle [rad]."""
    match typed:
        case [("x" | "y" | "z" | "-x" | "-y" | "-z" | "+x" | "+y" | "+z") as axis, text]:
            angle = parse_quantity(text, "angle", "turn", "90 deg")
            if angle.u != 0.0 or not 0.0 < abs(angle.value) <= 2.0 * math.pi:
                raise InputError(
                    "turn",
                    f"found {shown(text)}, expected an angle within 360 deg, not 0, without uncertainty",
                )
            return "xyz".index(axis[-1]), -angle.value if axis.startswith("-") else angle.value
    raise InputError("turn", f'found {shown(typed)}, expected a turn such as ["y", "90 deg"]')


_TURN = Reading(
    _turn,
    {
        "type": "array",
        "items": {"type": "string"},
        "minItems": 2,
        "maxItems": 2,
        "examples": [["y", "90 deg"]],
    },
)

TURN_NOISE: Final[tuple[str, ...]] = ("turn_attitude", "turn_velocity")
WALKS: Final[tuple[str, ...]] = ("gyro_walk", "accelerometer_walk")
ESTIMABLE: Final = (*WALKS, *TURN_NOISE)
"""Fields of `Noise` that a recording can tell."""


@dataclass(frozen=True)
class Noise:
    """Noise of the sensors, and of turns; what is in ``estimate`` is found from the recording."""

    angle_random_walk: float = quantity(
        "of the gyros", "angle random walk", REQUIRED, example="5e-4 deg/sqrt(h)",
        bounds=above_zero("an angle random walk"),
    )  # fmt: skip
    velocity_random_walk: float = quantity(
        "of the accelerometers", "velocity random walk", REQUIRED, example="5 ug/sqrt(Hz)",
        bounds=above_zero("a velocity random walk"),
    )  # fmt: skip
    gyro_walk: float = quantity(
        "random walk of the gyros' biases; estimate finds it from the recording", "rate random walk", "estimate",
        example="0.4 deg/h/sqrt(s)", bounds=_SIZE, words=_ESTIMATE,
    )  # fmt: skip
    accelerometer_walk: float = quantity(
        "random walk of the accelerometers' biases; estimate finds it from the recording",
        "acceleration random walk", "estimate", example="2 ug/sqrt(s)", bounds=_SIZE, words=_ESTIMATE,
    )  # fmt: skip
    turn_attitude: float = quantity(
        "standard deviation by which the attitude does not close over a turn, beyond the noise of the sensors; "
        "estimate finds it from the recording", "angle", "estimate", example="0.02 deg", bounds=_SIZE, words=_ESTIMATE,
    )  # fmt: skip
    turn_velocity: float = quantity(
        "the same of the velocity; estimate finds it from the recording", "velocity", "estimate", example="1 cm/s",
        bounds=_SIZE, words=_ESTIMATE,
    )  # fmt: skip
    estimate: tuple[str, ...] = ESTIMABLE

    @property
    def walks(self) -> bool:
        """True where biases walk."""
        return self.gyro_walk > 0.0 or self.accelerometer_walk > 0.0


@dataclass(frozen=True)
class Rests:
    """Rests of the unit between its turns: ``attitude`` None leaves it free within a rest."""

    velocity: float = quantity(
        "standard deviation of the velocity at a node of a rest, about 0: vibration of the stand", "velocity",
        "0.1 mm/s", example="1 mm/s", bounds=DEVIATION,
    )  # fmt: skip
    attitude: float | None = quantity(
        "standard deviation of the attitude at a node about that of its rest: sway of the stand; off leaves it free",
        "angle", "off", example="0.01 deg", bounds=DEVIATION, words={"off": None},
    )  # fmt: skip
    node: float = quantity("time between nodes of a rest", "time", "1 s", bounds=_NODE)
    margin: float = quantity(
        "time left out at both ends of a rest that is found", "time", "0.2 s", bounds=_MARGIN
    )
    list: tuple[tuple[float, float], ...] = quantity(
        "begin and end of each rest, from the first sample on; found in the recording if absent", "time", (),
        example=[["0 s", "69 s"], ["80 s", "168 s"]], bounds=_MARGIN, exact=True, of="begin, end",
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse a rest that ends before it begins."""
        for k, (begin, end) in enumerate(self.list):
            if begin >= end:
                found = f"found a rest from {begin:g} s to {end:g} s"
                raise InputError(f"list.{k}", f"{found}, expected its end after its begin")


@dataclass(frozen=True)
class Prior:
    """Standard deviations of the coefficients about 0 before the test; of scale factors about 1."""

    gyro_bias: float = quantity("of gyro biases", "rate", "1 deg/s", example="1 deg/h", bounds=DEVIATION)
    scale: float = quantity("of scale factors of gyros", "number", "2 %", example="300 ppm", bounds=DEVIATION)
    misalignment: float = quantity(
        "of misalignments of gyros", "angle", "1 deg", example="200 arcsec", bounds=DEVIATION
    )
    bias: float = quantity(
        "of accelerometer biases", "acceleration", "50 mg", example="500 ug", bounds=DEVIATION
    )
    k1: float = quantity(
        "of scale factors of accelerometers", "number", "2 %", example="300 ppm", bounds=DEVIATION
    )
    axes: float = quantity(
        "of misalignments of accelerometers", "angle", "1 deg", example="200 arcsec", bounds=DEVIATION
    )
    k2: float = quantity(
        "of second-order coefficients", "quadratic", "500 ug/g^2", example="100 ug/g^2", bounds=DEVIATION
    )
    size: float = quantity(
        "of the places of accelerometers x and y beside z", "length", "10 cm", bounds=DEVIATION
    )
    delay: float = quantity("of the delay of the accelerometers", "time", "10 ms", bounds=DEVIATION)
    asymmetry: float = quantity(
        "of half the differences of scale factors for positive and negative rates", "number", "500 ppm",
        bounds=DEVIATION,
    )  # fmt: skip
    g_sensitivity: float = quantity(
        "of drifts by specific force", "rate by force", "500 deg/h/g", example="0.05 deg/h/g", bounds=DEVIATION,
    )  # fmt: skip


@dataclass(frozen=True)
class Goal:
    """Wanted standard uncertainties, for `inercal design strapdown`; None without a wish."""

    gyro_bias: float | None = quantity("of gyro biases", "rate", example="0.003 deg/h", bounds=DEVIATION)
    scale: float | None = quantity("of scale factors of gyros", "number", example="1 ppm", bounds=DEVIATION)
    misalignment: float | None = quantity(
        "of misalignments of gyros", "angle", example="0.3 arcsec", bounds=DEVIATION
    )
    bias: float | None = quantity("of accelerometer biases", "acceleration", example="1 ug", bounds=DEVIATION)
    k1: float | None = quantity(
        "of scale factors of accelerometers", "number", example="1 ppm", bounds=DEVIATION
    )
    axes: float | None = quantity(
        "of misalignments of accelerometers", "angle", example="0.3 arcsec", bounds=DEVIATION
    )
    k2: float | None = quantity(
        "of second-order coefficients", "quadratic", example="1 ug/g^2", bounds=DEVIATION
    )
    size: float | None = quantity(
        "of the places of accelerometers x and y", "length", example="0.5 mm", bounds=DEVIATION
    )
    delay: float | None = quantity(
        "of the delay of the accelerometers", "time", example="0.01 ms", bounds=DEVIATION
    )
    asymmetry: float | None = quantity(
        "of half the differences of scale factors for positive and negative rates", "number", example="1 ppm",
        bounds=DEVIATION,
    )  # fmt: skip
    g_sensitivity: float | None = quantity(
        "of drifts by specific force", "rate by force", example="0.02 deg/h/g", bounds=DEVIATION
    )


@dataclass(frozen=True)
class PathDesign:
    """The search for a path, for `inercal design strapdown`."""

    turns: int = option("number of turns", 18, least=1, most=40)
    angles: tuple[float, ...] = quantities(
        "by which a turn goes, either way", "angle", example=["90 deg", "180 deg"],
        bounds=Bounds(lambda angle: math.radians(15.0) <= angle <= 2.0 * math.pi, "an angle from 15 to 360 deg"),
    )  # fmt: skip
    time: float | None = quantity(
        "of the whole test, in which rests last as long as the turns leave; if absent, as long as rests of the plan's "
        "dwell with turns by the smallest angle take", "time", example="10 min",
        bounds=Bounds(lambda time: 0.0 < time <= 1e6, "a time above 0, up to 1e6 s"),
    )  # fmt: skip
    start: Literal["free", "plan"] = option(
        "attitude of the first rest: free, a multiple of quarter turns from that of the plan, or that of the plan",
        "free",
    )
    seed: int = option("of the random starts", 1, least=0)


@dataclass(frozen=True)
class Start:
    """Attitude at the first rest."""

    heading: Quantity | Literal["gyrocompass", "free"] | None = quantity(
        "of the body axis nearest to level, clockwise from north: found from earth rate (gyrocompass), not known "
        "(free), or stated with its standard uncertainty; gyrocompass if absent where the prior of the gyro bias is "
        "below earth rate, else free", "angle", example="30(5) deg",
        words={"gyrocompass": "gyrocompass", "free": "free"},
    )  # fmt: skip

    @property
    def angle(self) -> float:
        """The heading [rad]; 0 where it is not stated."""
        return self.heading.value if isinstance(self.heading, Quantity) else 0.0

    @property
    def u(self) -> float:
        """Its standard uncertainty [rad], 0.01 deg where that is not stated."""
        return (
            (self.heading.u or math.radians(0.01))
            if isinstance(self.heading, Quantity)
            else math.radians(100)
        )


@dataclass(frozen=True)
class TurnPlan:
    """The plan of a test, or of a simulated recording; ``turns`` as (axis 0 to 2 of b, angle [rad])."""

    turns: tuple[tuple[int, float], ...] = option(
        "turns of the unit, consecutively: axis and angle; only a search for them does without", (), least=1,
        example=[["y", "90 deg"], ["-z", "90 deg"]], reads=_TURN,
    )  # fmt: skip
    start: tuple[float, float, float] = quantity(
        "attitude of the first rest: from x east, y north, z up turned about z by yaw, then about x by pitch, then "
        "about y by roll; pitch, roll, yaw, 0 if absent", "angle", (0.0, 0.0, 0.0),
        example=["0 deg", "-90 deg", "0 deg"], exact=True, of="pitch, roll, yaw",
    )  # fmt: skip
    turn_time: float = quantity("of a turn by 90 deg, others in proportion", "time", "9 s", bounds=TIME)
    dwell: float = quantity("of a rest", "time", "20 s", bounds=TIME)
    first_dwell: float = quantity("of the first rest", "time", "60 s", bounds=TIME)
    sample_rate: float = quantity("of a simulated recording", "frequency", "100 Hz", bounds=FREQUENCY)

    @property
    def duration(self) -> float:
        """Time [s] of all rests and turns."""
        turning = sum(self.time_of(angle) for _, angle in self.turns)
        return self.first_dwell + turning + self.dwell * len(self.turns)

    def time_of(self, angle: float) -> float:
        """Time [s] of a turn by ``angle`` [rad]."""
        return self.turn_time * abs(angle) / (0.5 * math.pi)


@dataclass(frozen=True)
class Motion:
    """Motion of a simulated unit while it is turned."""

    wobble: float = quantity("swing about the other two axes", "angle", "0 deg", example="3 deg")
    frequency: float = quantity("of the wobble", "frequency", "1.5 Hz", bounds=FREQUENCY)
    translation: float = quantity("way that it is carried", "length", "0 m", example="0.3 m")


@short_repr
@dataclass(frozen=True, eq=False)
class StrapdownSettings:
    """A study of a strapdown unit, in SI.

    ``site`` has a latitude; ``truth`` are coefficients of a simulation [SI] by symbol, those of a perfect unit where it
    has none; ``traceability``, ``temperature``, ``given`` as in `inercal.systems.imu.settings.ImuSettings`.
    """

    site: Site
    noise: Noise
    frame: Frame = option(
        "frame of the results: upper has z along the input axis of accelerometer z and y in the plane of y and z, "
        "lower has x along that of x and y in the plane of x and y",
        "upper",
    )
    filter: Estimator = option(
        "estimator: batch takes all of the recording at once; error-state goes from rest to rest, in passes until it "
        "is as good, for units whose biases hardly walk",
        "batch",
    )
    terms: tuple[Term, ...] = option(
        "what is estimated beside bias, scale factor and misalignment: second-order coefficients, places of "
        "accelerometers x and y beside z, delay of the accelerometers; also asymmetry of gyro scale factors and "
        "g_sensitivity of the gyros", USUAL, example=["k2", "size", "delay"],
    )  # fmt: skip
    time_base_u: float = quantity(
        "relative standard uncertainty of the record's clock", "number", "0", example="20 ppm",
        bounds=RELATIVE_U, name="time_base",
    )  # fmt: skip
    rests: Rests = table("rests between the turns", Rests())
    start: Start = table("attitude at the first rest", Start())
    prior: Prior = table("what is known before the test", Prior())
    goal: Goal = table("wanted standard uncertainties", Goal())
    plan: TurnPlan | None = table("the plan of a test, or of a simulated recording", None)
    design: PathDesign | None = table(
        "the search for a path; without this table the plan is judged alone", None
    )
    motion: Motion = table("motion in a simulated recording", Motion())
    truth: Mapping[str, float] = table(
        "true coefficients of a simulated recording by symbol, outputs in m/s^2 and rad/s; those of a perfect unit if "
        "absent", {}, example={"D_F_x": "0.1 deg/h", "r_xx": "1 cm"}, reads=AS_TYPED,
    )  # fmt: skip
    traceability: Mapping[str, str] = field(default_factory=dict)
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def latitude(self) -> float:
        """Latitude [rad]."""
        assert self.site.latitude is not None
        return self.site.latitude

    @property
    def gravity_u(self) -> float:
        """Standard uncertainty of gravity [m/s^2], without what latitude does to it."""
        return math.hypot(
            *(each.u * each.sensitivity for each in self.site.inputs if each.source != "latitude")
        )

    def deviations(self) -> Array:
        """Prior standard deviations (51,) of the array of coefficients."""
        prior = np.zeros(SIZE)
        for group, places in GROUPS.items():
            prior[list(places)] = getattr(self.prior, group)
        prior[GRAVITY], prior[LATITUDE] = self.gravity_u, self.site.latitude_u
        return prior
