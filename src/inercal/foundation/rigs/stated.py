"""Tables of a study about a rig: its kind, its errors by name or a chain of its own, its base, ranges of its axes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from inercal.foundation.errors import InputError
from inercal.foundation.geometry.rotations import Axis
from inercal.foundation.keys import REQUIRED, Bounds, keyed, option, quantity, table, within
from inercal.foundation.rigs.patterns import Distribution, normal, triangular, two_point, uniform
from inercal.foundation.rigs.tables import TABLES, Slot, slots
from inercal.foundation.units import Quantity

JointName = Literal["phi1", "phi2", "phi3"]
RigKind = Literal["two_axis_turntable", "three_axis_turntable", "chain"]

LARGEST = math.radians(10.0)
"""Largest measured error [rad]: more is an attitude, not an error."""

DISTRIBUTIONS: Mapping[str, Callable[[float], Distribution]] = {
    "uniform": uniform,
    "normal": normal,
    "triangular": triangular,
    "two_point": two_point,
}

_LEAVE_OUT = 'an error is left out with NAME = "none"'
_WIDTH = Bounds(lambda size: 0.0 < size <= math.pi, f"a half width above 0 and up to 180 deg; {_LEAVE_OUT}")
_DEVIATION = Bounds(
    lambda size: 0.0 < size <= math.pi / 3.0,
    f"a standard deviation above 0 and up to 60 deg; {_LEAVE_OUT}",
)
_SHIFT = Bounds(lambda d: 0.0 < d <= 1.0, f"a length above 0 and up to 1 m; {_LEAVE_OUT}")


@dataclass(frozen=True, kw_only=True)
class _Distributed:
    """Keys that every error has."""

    scope: Literal["sample", "position", "angle", "run", "rig"] | None = option(
        "how long a value lasts: until the next sample, position, angle of the joint or mounting, or for good (rig)",
        None,
    )

    def __post_init__(self) -> None:
        """Refuse two distributions."""
        given = [name for name in DISTRIBUTIONS if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError("", f"found {' and '.join(given)}, expected one distribution")

    @property
    def distribution(self) -> Distribution | None:
        """The distribution [rad or m], if one is given."""
        for name, make in DISTRIBUTIONS.items():
            size = getattr(self, name)
            if size is not None:
                return make(size)
        return None


@dataclass(frozen=True, kw_only=True)
class AngularError(_Distributed):
    """An error of an attitude: one distribution, and perhaps its scope."""

    uniform: float | None = quantity("uniform, by its half width", "angle", example="2 arcmin", bounds=_WIDTH)
    normal: float | None = quantity(
        "normal, by its standard deviation", "angle", example="1 arcmin", bounds=_DEVIATION
    )
    triangular: float | None = quantity(
        "triangular, by its half width", "angle", example="2 arcmin", bounds=_WIDTH
    )
    two_point: float | None = quantity("plus or minus that size", "angle", example="2 arcmin", bounds=_WIDTH)


@dataclass(frozen=True, kw_only=True)
class OffsetError(_Distributed):
    """An error of a place: one distribution of lengths, and perhaps its scope."""

    uniform: float | None = quantity("uniform, by its half width", "length", example="10 um", bounds=_SHIFT)
    normal: float | None = quantity(
        "normal, by its standard deviation", "length", example="10 um", bounds=_SHIFT
    )
    triangular: float | None = quantity(
        "triangular, by its half width", "length", example="10 um", bounds=_SHIFT
    )
    two_point: float | None = quantity("plus or minus that size", "length", example="10 um", bounds=_SHIFT)


@dataclass(frozen=True)
class ErrorHarmonic:
    """A harmonic: amplitude times the sine of order times the angle of the joint, plus phase."""

    order: int = option("periods in a turn of the joint", least=1, most=1024)
    amplitude: Quantity = quantity(
        "with a phase that of the measured harmonic; without one u of its sine and of its cosine", "angle",
        REQUIRED, example="1 arcsec",
        bounds=Bounds(lambda a: 0.0 < a <= LARGEST, "an angle above 0 and up to 10 deg"),
    )  # fmt: skip
    phase: Quantity | None = quantity(
        "phase of a measured harmonic; unknown if absent", "angle", example="30 deg"
    )


@dataclass(frozen=True, kw_only=True)
class NamedError(AngularError):
    """An error of an attitude: a distribution, what is measured of it, harmonics of the angle; at least one of them."""

    value: Quantity | None = quantity(
        "measured value: corrected for, its u in the budget", "angle", example="3.2(5) arcsec",
        bounds=within(-LARGEST, LARGEST, "an angle within 10 deg"),
    )  # fmt: skip
    measured_table: str | None = option(
        "measured error over the angle of the joint: a CSV beside the study with its header angle [deg],"
        "error [arcsec],u [arcsec]", None, example="encoder.csv",
        name="table",
    )  # fmt: skip
    certificate: str = option("certificate of what is measured", "", example="K-2026-117", most=80)
    harmonics: tuple[ErrorHarmonic, ...] = table(
        "harmonics over the angle of the joint; none if absent", (),
        example=[{"order": 1, "amplitude": "1 arcsec"}],
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse keys that say nothing here."""
        super().__post_init__()
        phases = any(harmonic.phase is not None for harmonic in self.harmonics)
        if self.certificate and self.value is None and self.measured_table is None and not phases:
            raise InputError(
                "", "found a certificate of nothing measured, expected value, table or a phase with it"
            )
        if self.measured and self.scope is not None and self.distribution is None:
            raise InputError("scope", "found with what is measured alone, expected it with a distribution")
        orders = [harmonic.order for harmonic in self.harmonics]
        for k, order in enumerate(orders):
            if order in orders[:k]:
                raise InputError(f"harmonics.{k}.order", f"found {order} twice, expected each order once")

    @property
    def measured(self) -> bool:
        """True if something other than a distribution is given."""
        return self.value is not None or self.measured_table is not None or bool(self.harmonics)


_FIELDS = {"table": "measured_table"}
_OF_ERRORS = sorted((*DISTRIBUTIONS, "certificate", "harmonics", "scope", "table", "value", "what"))


@dataclass(frozen=True, kw_only=True)
class ChainElement(NamedError):  # noqa: N818 - an error of a table is no exception
    """An element of a chain: a joint, a fixed turn, or an error with its distribution."""

    joint: JointName | None = option("a commanded angle; the record has it by this name", None)
    turn: Quantity | None = quantity("a known, fixed angle", "angle", example="90 deg")
    error: str | None = option("name of an error", None, example="sag_x", most=40)
    axis: Axis = option("axis, of the frame that the elements before have reached, about which it turns")
    what: str = option("the error in words", "", most=120)

    def __post_init__(self) -> None:
        """Refuse elements of two kinds or none, and keys that say nothing of theirs."""
        super().__post_init__()
        kinds = [name for name in ("joint", "turn", "error") if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise InputError(
                "", f"found {' and '.join(kinds) or 'none'}, expected one of joint, turn and error"
            )
        if self.error is None:
            beside = [key for key in _OF_ERRORS if getattr(self, _FIELDS.get(key, key)) not in (None, "", ())]
            if beside:
                raise InputError(beside[0], f"found with a {kinds[0]}, expected it with an error only")
        elif not re.fullmatch(r"[A-Za-z]\w*", self.error):
            raise InputError("error", f"found {self.error!r}, expected a name of letters, digits and _")
        if self.turn is not None and self.turn.u > 0.0:
            raise InputError(
                "turn", "found an uncertainty, expected it as an error with a value beside the turn"
            )


LEFT_OUT = "none"
"""The word for an error that a table does not have."""


def _by_name() -> dict[str, tuple[Any, Any]]:
    """Fields of every error that some table may have, each name once."""
    every: dict[str, Slot] = {slot.name: slot for kind in TABLES for slot in slots(kind)}
    return {
        slot.name: (
            OffsetError | None if slot.is_offset else NamedError | None,
            table(
                f"{slot.what}; usual scope {slot.scope.value}{'; only where it is given' if slot.optional else ''}",
                None, example={"normal": "10 um" if slot.is_offset else "1 arcmin"}, words={LEFT_OUT: LEFT_OUT},
            ),
        )
        for slot in every.values()
    }  # fmt: skip


@dataclass(frozen=True)
class TableErrors(keyed("ByName", _by_name())):  # type: ignore[misc]
    """Errors of the table: one default, and by name what differs from it."""

    default: AngularError | None = table(
        "of every error not named here, the optional ones aside", None, example={"uniform": "2 arcmin"}
    )


@dataclass(frozen=True)
class BaseAttitude:
    """Known attitude of the table's base, turned in this order."""

    azimuth: Quantity | None = quantity(
        "about up, north towards west positive; 0 if absent", "angle", example="40 deg"
    )
    tilt_north: float = quantity("about north; 0 if absent", "angle", 0.0, example="40 deg")
    tilt_west: float = quantity("about west; 0 if absent", "angle", 0.0, example="40 deg")

    @property
    def angles(self) -> tuple[float, float, float]:
        """The three [rad]."""
        return 0.0 if self.azimuth is None else self.azimuth.value, self.tilt_north, self.tilt_west


_ENDS = "the lowest, the highest angle"
_Ends = tuple[Quantity, Quantity]


@dataclass(frozen=True)
class AxisRanges:
    """Ranges within which the axes turn; a whole circle if absent."""

    phi1: _Ends | None = quantity(
        "lowest and highest outer angle", "angle", example=["-90 deg", "90 deg"], of=_ENDS
    )
    phi2: _Ends | None = quantity("of the next axis", "angle", example=["-180 deg", "180 deg"], of=_ENDS)
    phi3: _Ends | None = quantity(
        "of the inner axis of three", "angle", example=["-180 deg", "180 deg"], of=_ENDS
    )

    def __post_init__(self) -> None:
        """Refuse ends out of order."""
        for joint, (low, high) in self.stated.items():
            if not low.value < high.value:
                raise InputError(joint, f"found {low.text!r} to {high.text!r}, expected the lower end first")

    @property
    def stated(self) -> dict[str, _Ends]:
        """Ends of the joints that have some, by name."""
        ends = {"phi1": self.phi1, "phi2": self.phi2, "phi3": self.phi3}
        return {joint: pair for joint, pair in ends.items() if pair is not None}


@dataclass(frozen=True)
class StatedRig:
    """The turntable."""

    kind: RigKind = option("two axes (outer y, inner z), three (z, y, x), or a chain of elements of your own")
    chain: tuple[ChainElement, ...] = table(
        "elements of a chain, base first; for kind = chain only", (),
        example=[{"joint": "phi1", "axis": "z"}],
    )  # fmt: skip
    errors: TableErrors | None = table(
        'errors of the table, NAME = "none" leaves one out; none if absent', None
    )
    base: BaseAttitude = table("known attitude of the base; level and north if absent", BaseAttitude())
    limits: AxisRanges = table("ranges of the axes; whole circles if absent", AxisRanges())
