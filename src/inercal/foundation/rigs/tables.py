"""Turntables as chains: the two-axis table with its eleven errors, a three-axis table, and the base below them.

The two-axis table (outer axis y, angle phi1; inner axis z, angle phi2) and its factor names are those of Zhao
et al. 2023, "Error sensitivity analysis of a turntable-gyrowheel calibration system".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import Axis, elementary
from inercal.foundation.rigs.chain import Chain, Element, Error, Fixed, Joint, Scope
from inercal.foundation.rigs.patterns import Distribution


@dataclass(frozen=True)
class Slot:
    """Elementary error of a table: name of the factor, axis, default scope, and meaning.

    ``optional`` ones are there only where a distribution is given for them by name.
    """

    name: str
    axis: Axis
    scope: Scope
    what: str
    optional: bool = False
    is_offset: bool = False


_BASE: tuple[Joint | Slot, ...] = (
    Slot("dbase_z", "z", Scope.RIG, "azimuth of the rig", optional=True),
    Slot("dbase_x", "x", Scope.RIG, "levelling: tilt about north", optional=True),
    Slot("dbase_y", "y", Scope.RIG, "levelling: tilt about west", optional=True),
)
_MOUNTING: tuple[Joint | Slot, ...] = tuple(
    Slot(f"dtheta_{axis}", axis, Scope.RUN, f"mounting of the instrument about {axis}")
    for axis in ("x", "y", "z")
)
_TWO_AXIS: tuple[Joint | Slot, ...] = (
    Joint("phi1", "y"),
    Slot("dphi_y1", "y", Scope.POSITION, "positioning of the outer axis"),
    Slot("dalpha_x1", "x", Scope.POSITION, "wobble of the outer axis about x"),
    Slot("dalpha_z1", "z", Scope.POSITION, "wobble of the outer axis about z"),
    Slot("d_eta", "x", Scope.RIG, "intersection offset of the axes", optional=True, is_offset=True),
    Slot("deps_x", "x", Scope.RIG, "perpendicularity of the axes, about x"),
    Slot("deps_y", "y", Scope.RIG, "perpendicularity of the axes, about y"),
    Joint("phi2", "z"),
    Slot("dphi_z2", "z", Scope.POSITION, "positioning of the inner axis"),
    Slot("dalpha_x2", "x", Scope.POSITION, "wobble of the inner axis about x"),
    Slot("dalpha_y2", "y", Scope.POSITION, "wobble of the inner axis about y"),
)
_THREE_AXIS: tuple[Joint | Slot, ...] = (
    Joint("phi1", "z"),
    Slot("dphi_z1", "z", Scope.POSITION, "positioning of the outer axis"),
    Slot("dalpha_x1", "x", Scope.POSITION, "wobble of the outer axis about x"),
    Slot("dalpha_y1", "y", Scope.POSITION, "wobble of the outer axis about y"),
    Slot("deps_x1", "x", Scope.RIG, "perpendicularity of outer and middle axis, about x"),
    Slot("deps_z1", "z", Scope.RIG, "zero of the middle axis, about z"),
    Joint("phi2", "y"),
    Slot("dphi_y2", "y", Scope.POSITION, "positioning of the middle axis"),
    Slot("dalpha_x2", "x", Scope.POSITION, "wobble of the middle axis about x"),
    Slot("dalpha_z2", "z", Scope.POSITION, "wobble of the middle axis about z"),
    Slot("deps_z2", "z", Scope.RIG, "perpendicularity of middle and inner axis, about z"),
    Slot("deps_y2", "y", Scope.RIG, "zero of the inner axis, about y"),
    Joint("phi3", "x"),
    Slot("dphi_x3", "x", Scope.POSITION, "positioning of the inner axis"),
    Slot("dalpha_y3", "y", Scope.POSITION, "wobble of the inner axis about y"),
    Slot("dalpha_z3", "z", Scope.POSITION, "wobble of the inner axis about z"),
)

#: rig.kind of a study -> its joints and slots, base first
TABLES: Mapping[str, tuple[Joint | Slot, ...]] = {
    "two_axis_turntable": (*_BASE, *_TWO_AXIS, *_MOUNTING),
    "three_axis_turntable": (*_BASE, *_THREE_AXIS, *_MOUNTING),
}


def slots(kind: str) -> tuple[Slot, ...]:
    """Everywhere a table of that kind may err, base first; raises KeyError for an unknown kind."""
    return tuple(slot for slot in TABLES[kind] if isinstance(slot, Slot))


def turntable(
    kind: str,
    default: Distribution | None,
    errors: Mapping[str, Distribution] | None = None,
    scopes: Mapping[str, Scope] | None = None,
    base: Sequence[float] = (0.0, 0.0, 0.0),
    mounting: Array | None = None,
    parts: Mapping[str, Sequence[Element]] | None = None,
) -> Chain:
    """A table of a known kind with its errors put in.

    Parameters
    ----------
    kind : str
        A key of `TABLES`.
    default : Distribution or None
        Of every error that is not optional and not given by name; None leaves these out.
    errors : mapping, optional
        Distribution [rad; m for an offset] by factor name.
    scopes : mapping, optional
        Scope by factor name, where it is not the usual one.
    base : (3,), optional
        Known attitude of the base: azimuth (about up), tilt about north, tilt about west [rad], turned in this
        order.
    mounting : (3, 3), optional
        Known nominal attitude of the instrument on the inner axis.
    parts : mapping, optional
        What else there is at the place of an error, by factor name: known errors, harmonics.

    Raises
    ------
    KeyError
        An unknown kind, or a factor the table does not have.
    """
    given, scope_of = dict(errors or {}), dict(scopes or {})
    factors = {slot.name for slot in slots(kind)}
    for name in (*given, *scope_of, *(parts or {})):
        if name not in factors:
            raise KeyError(name)
    elements: list[Element] = []
    if any(base):
        azimuth, north, west = base
        elements.append(Fixed(elementary("z", azimuth) @ elementary("x", north) @ elementary("y", west)))
    for part in TABLES[kind]:
        if isinstance(part, Joint):
            elements.append(part)
            continue
        if part.name == "dtheta_x" and mounting is not None:
            elements.append(Fixed(mounting))
        elements += (parts or {}).get(part.name, ())
        distribution = given.get(part.name) or (None if part.optional else default)
        if distribution is not None:
            scope = scope_of.get(part.name, part.scope)
            elements.append(Error(part.name, part.axis, distribution, scope, part.what, part.is_offset))
    return Chain(tuple(elements))
