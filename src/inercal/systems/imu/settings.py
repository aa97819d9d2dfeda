"""Settings of a calibration of an IMU, and those of its methods, in SI."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import Site
from inercal.foundation.keys import FREQUENCY, RATE, RELATIVE_U, TIME, Bounds, option, quantity, table, within
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Scope
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.stated import StatedRig
from inercal.foundation.units import Quantity

MASKED = ("saturation", "no_data")
"""Codes of a recording's findings whose samples no fit uses: turns in which a sensor saturates are left out."""

COMMAND = "calibrate imu"
"""The command behind every method of this room, as its results have it."""

NOT_NEGATIVE = within(0.0, math.inf, "a size of 0 or more")

TURN = Bounds(
    lambda angle: math.radians(10.0) <= abs(angle) <= math.radians(36000.0),
    "an angle of 10 deg to 36000 deg, negative for turns against the right-hand rule",
)
"""Angles of a turn."""

TILT = within(0.0, math.radians(20.0), "a standard uncertainty up to 20 deg")
"""Standard uncertainties of a direction."""


@dataclass(frozen=True)
class FerrarisSettings:
    """Options of the Ferraris calibration: six positions, each axis up and down, and a turn about each axis.

    Attributes
    ----------
    turn, alignment
        As their keys say [rad]; independent from turn to turn, and from position to position in either of the two
        directions across it.
    turn_u : float
        Standard uncertainty of ``turn`` [rad].
    sections : mapping
        Places of the sections by name: (start, end) in seconds of the record's time axis as floats, or in samples
        (from 0, the end not included) as integers, or the label of its rows. Empty: from the labels of the record
        that are names of sections, or detected.
    """

    turn: float = quantity(
        "angle of the turns, positive about the positive axis by the right-hand rule, perhaps with its standard "
        "uncertainty", "angle", "360 deg", example="360(0.5) deg", bounds=TURN, u="turn_u",
    )  # fmt: skip
    turn_u: float = 0.0
    alignment: float | None = quantity(
        "standard uncertainty of the direction of each position and of the axis of each turn; from the scatter of the "
        "positions if absent", "angle", example="0.5 deg",
        bounds=TILT,
    )  # fmt: skip
    sections: Mapping[str, tuple[float, float] | str] = field(default_factory=dict)


SignedAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


@dataclass(frozen=True)
class AidedReference:
    """A reference attitude of another instrument, such as a robot or motion capture, in the place of a table."""

    up: SignedAxis = option("axis of the reference that points up", "+z", example="+z")
    level: float = quantity(
        "standard uncertainty with which it is vertical", "angle", "2 deg", example="0.1 deg", bounds=TILT,
    )  # fmt: skip
    scalar: Literal["first", "last"] = option(
        "place of the scalar in q_ref_0 to q_ref_3", "first", example="first"
    )
    sense: Literal["body to reference", "reference to body"] = option(
        "what the attitude takes to what", "body to reference", example="body to reference"
    )
    angles: Literal["zyx", "zxy", "yxz", "yzx", "xyz", "xzy", "zyz", "zxz"] = option(
        "axes about which phi1, phi2 and phi3 turn, each one of the frame reached so far, where there is no quaternion",
        "zyx", example="zyx",
    )  # fmt: skip


@dataclass(frozen=True)
class AidedRig:
    """Reference-aided calibration: the table, and the instrument on it."""

    stated_rig: StatedRig | None = table(
        "the table, as in a study of a turntable; of two axes and without errors if absent, its azimuth unknown "
        "unless given", None, name="rig",
    )  # fmt: skip
    mounting: tuple[SignedAxis, SignedAxis, SignedAxis] = option(
        "axes of the table, at zero angles, along which the instrument's x, y and z point", ("+x", "+y", "+z"),
        example=["+x", "+y", "+z"],
    )  # fmt: skip
    reference: AidedReference | None = table(
        "a reference attitude that is recorded, in the place of a table: q_ref_0 to q_ref_3, or phi1, phi2, phi3",
        None,
    )

    def __post_init__(self) -> None:
        """Refuse axes that make no frame, and ranges, which would change nothing."""
        if mounting_of(self.mounting) is None:
            axes = ", ".join(self.mounting)
            raise InputError(
                "", f"found the mounting {axes}, expected three axes that make a right-handed frame"
            )
        if self.reference is not None and self.stated_rig is not None:
            raise InputError("", "found rig beside reference, expected one of the two")
        if self.rig.limits.stated:
            raise InputError("", "found rig.limits, expected none: the angles are those of the record")

    @property
    def rig(self) -> StatedRig:
        """The table; a plain one of two axes where none is stated."""
        return self.stated_rig or StatedRig("two_axis_turntable")


@dataclass(frozen=True)
class AidedSettings:
    """Options of a reference-aided calibration, in SI.

    Attributes
    ----------
    chain : Chain
        The table from n (north, west, up) to the nominal axes of the instrument, with its errors; its joints are
        columns of the record. Errors of scope ``sample`` are left to the scatter of the data.
    azimuth_u : float or None
        Standard uncertainty [rad] of the azimuth in the chain's base; None: the azimuth is not known.
    reference : AidedReference or None
        A recorded attitude in the place of joints; the chain is then the errors of its level, and the mounting.
    """

    chain: Chain = field()
    azimuth_u: float | None = None
    reference: AidedReference | None = None


@dataclass(frozen=True)
class MeansSettings:
    """A shorthand of sections: rests of unknown direction, a row of means for each; there are no options."""


@dataclass(frozen=True)
class KnownRatesSettings:
    """A shorthand of sections: a gyro at known rates about unknown axes, and rests.

    Attributes
    ----------
    rates, rates_u : (k,)
        Rate of each record [rad/s], and its standard uncertainty, one error for all of it.
    """

    rates: tuple[float, ...]
    rates_u: tuple[float, ...]


@dataclass(frozen=True)
class KnownTurnsSettings:
    """A shorthand of sections: a gyro, turned by known angles about x, y and z.

    Attributes
    ----------
    angles, angles_u : three floats
        Angle of each turn [rad], positive about the positive axis by the right-hand rule, and its standard uncertainty.
    alignment : float or None
        As its key says [rad].
    """

    angles: tuple[float, float, float]
    angles_u: tuple[float, float, float]
    alignment: float | None = None


@dataclass(frozen=True)
class SectionsSettings:
    """Options of a calibration from sections, of each of which is stated what is known.

    Attributes
    ----------
    table : Path or None
        The table of sections; None: those of ``rows`` or, without any, what names and recordings tell.
    rows : sequence of mappings
        Tables ``[[imu.section]]`` of the study, as typed.
    placing, level
        As their keys say [rad].
    misalignment : float or None
        Standard deviation of M and T about 0 [rad]; as usual if absent.
    mounting_u : float
        Standard uncertainty of the case against directions and axes [rad].
    frame : str
        Frame of the coefficients, as its key says; empty: as the sections tell.
    """

    table: Path | None = None
    rows: tuple[Mapping[str, object], ...] = ()
    placing: float | None = None
    level: float | None = None
    misalignment: float | None = None
    mounting_u: float = 0.0
    frame: str = ""


Method: TypeAlias = (
    FerrarisSettings
    | AidedSettings
    | MeansSettings
    | KnownRatesSettings
    | KnownTurnsSettings
    | SectionsSettings
)
"""Options of a method other than multi-position."""


@dataclass(frozen=True)
class Simulation:
    """A simulated recording: sections one after the other, by hand from pose to pose, or on a table.

    Biases wander with a correlation time of 100 s. ``coefficients`` are true values by symbol, in counts and SI.
    """

    poses: int = option(
        "of multiposition, and of sections that nothing states: held one after the other, the first level", 24,
        least=4, most=1000, kinds=("multiposition", "sections"),
    )  # fmt: skip
    start: float = quantity(
        "length of the first hold, or rest of the table",
        "time",
        "30 s",
        bounds=TIME,
        kinds=("multiposition", "aided", "sections"),
    )
    hold: float = quantity("length of each other hold, position or rest", "time", "3 s", bounds=TIME)
    turning: float = quantity("length of each turn; of the table, by 90 deg", "time", "3 s", bounds=TIME)
    sample_rate: float = quantity("samples per second", "frequency", "100 Hz", bounds=FREQUENCY)
    means: bool = option(
        "of sections that are rests: a row of mean outputs for each in the place of samples",
        False,
        kinds=("sections",),
    )
    accelerometer_noise: float = quantity(
        "white noise of the accelerometers", "velocity random walk", "80 ug/sqrt(Hz)", bounds=NOT_NEGATIVE
    )
    gyro_noise: float = quantity(
        "white noise of the gyros", "angle random walk", "2 deg/sqrt(h)", bounds=NOT_NEGATIVE
    )
    accelerometer_wander: float = quantity(
        "standard deviation of the biases of accelerometers", "acceleration", "30 ug", bounds=NOT_NEGATIVE
    )
    gyro_wander: float = quantity(
        "standard deviation of the biases of gyros", "rate", "10 deg/h", bounds=NOT_NEGATIVE
    )
    coefficients: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that a simulation adds to a recording; none if absent. ``k2`` [1/(m/s^2)]."""

    restless_start: float = quantity(
        "standard deviation of a tremble of the attitude in the first hold, as of an IMU in the hand", "angle",
        "0 deg", example="0.2 deg", bounds=NOT_NEGATIVE, kinds=("multiposition", "ferraris", "sections"),
    )  # fmt: skip
    knocks: int = option("turns in which the instrument is knocked", 0, least=0, most=1000)
    knock: float = quantity("angle by which the gyro is wrong after a knock", "angle", "1 deg")
    gyro_range: float | None = quantity(
        "rate at which the gyro clips; without limit if absent", "rate", example="80 deg/s", bounds=RATE
    )
    clock: float = quantity(
        "relative error of the clock, positive where it counts too many seconds", "number", "0", example="0.3 %",
        bounds=within(-0.5, 0.5, "within 50 %"),
    )  # fmt: skip
    lever_arm: float = quantity(
        "of aided: standard deviation of the places of the accelerometers beside the crossing of the axes; of sections "
        "that of all of them beside the axis", "length", "0 mm", example="50 mm", bounds=NOT_NEGATIVE,
        kinds=("aided", "sections"),
    )  # fmt: skip
    delay: float = quantity(
        "of aided: time by which the angles of the table come late", "time", "0 ms", example="20 ms",
        kinds=("aided",),
    )  # fmt: skip
    k2: float = 0.0


@dataclass(frozen=True)
class Exclusion:
    """Parts of a recording that no fit uses: ``times`` (begin, end) [s] of its clock, and ``poses`` by number."""

    times: tuple[tuple[float, float], ...] = ()
    poses: tuple[int, ...] = ()

    def touches(self, begin: float, end: float) -> bool:
        """True where some of the time from ``begin`` to ``end`` [s] is left out."""
        return any(begin < last and first < end for first, last in self.times)


@short_repr
@dataclass(frozen=True)
class ImuSettings:
    """Settings of a calibration, in SI.

    Attributes
    ----------
    site : Site
        Local gravity and what it is uncertain by.
    static_start, g_sensitivity, time_base_u
        As their keys say.
    g_sensitivity_u : float or None
        Of sections: its standard deviation about 0 [(rad/s)/(m/s^2)]; as usual for such gyros if absent.
    k2 : bool
        Second-order coefficients of the accelerometers are estimated.
    k2_u : float or None
        Their standard deviation about 0 [1/(m/s^2)] where they are not; as usual for such sensors if absent.
    exclude : Exclusion
        Poses and turns to be left out.
    traceability : mapping
        ``instrument``, ``operator``, ``date``, ``reference``; empty texts where not given.
    method : Method or None
        Options of the method; None: multi-position, un-aided.
    simulation, disturbances
        What is simulated, and what is added to it.
    temperature : Quantity or None
        Temperature of the instrument.
    given : mapping
        The keys of the study that were given, and their values as typed; ready for JSON.
    """

    site: Site
    static_start: float | None = quantity(
        "length of the still period at the start; by the recording if absent", "time", example="50 s",
        bounds=TIME, kinds=("multiposition",),
    )  # fmt: skip
    g_sensitivity: bool = option(
        "also estimate how the gyro's drift depends on specific force",
        False,
        kinds=("multiposition", "aided", "sections"),
    )
    g_sensitivity_u: float | None = None
    k2: bool = False
    k2_u: float | None = None
    time_base_u: float = quantity(
        "relative standard uncertainty of the record's clock", "number", "0", example="20 ppm",
        bounds=RELATIVE_U, name="time_base", kinds=("multiposition", "ferraris", "aided", "known_turns", "sections"),
    )  # fmt: skip
    exclude: Exclusion = Exclusion()
    traceability: Mapping[str, str] = field(default_factory=dict)
    method: Method | None = None
    simulation: Simulation = Simulation()
    disturbances: Disturbances = Disturbances()
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)


def mounting_of(axes: tuple[str, str, str]) -> Array | None:
    """Rotation (3, 3) whose columns are the instrument's x, y, z in the frame of the inner axis.

    Parameters
    ----------
    axes : three of ``+x -x +y -y +z -z``
        The axis of the table, at zero angles, along which each axis of the instrument points.

    Returns
    -------
    (3, 3), or None where the three make no right-handed frame
    """
    rotation = np.stack([axis_of(axis) for axis in axes], axis=1)
    return rotation if np.linalg.det(rotation) > 0.5 else None


def of_attitude(reference: AidedReference, mounting: Array) -> Chain:
    """The chain of a reference attitude: how level it is, and the ``mounting`` (3, 3) of the instrument on its body."""
    tilt, what = normal(max(reference.level, 1e-9)), "tilt of the reference"
    x, y = Error("dlevel_x", "x", tilt, Scope.RIG, what), Error("dlevel_y", "y", tilt, Scope.RIG, what)
    return Chain((x, y, Fixed(mounting)))


def axis_of(name: str) -> Array:
    """The unit vector (3,) of ``+x``, ``-x``, .."""
    return np.asarray(float(f"{name[0]}1") * np.eye(3)["xyz".index(name[1])])


def mountings() -> dict[tuple[str, ...], Array]:
    """The 24 ways to mount an instrument square on a table, as rotations by axes."""
    axes = [f"{sign}{axis}" for axis in "xyz" for sign in "+-"]
    made = {each: mounting_of((each[0], each[1], each[2])) for each in itertools.permutations(axes, 3)}
    return {each: rotation for each, rotation in made.items() if rotation is not None}
