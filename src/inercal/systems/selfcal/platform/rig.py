"""Three-axis gimbals on a base: attitude from angles, earth rate and gravity on the base.

Frame b belongs to the encoders: it is the frame of the platform p at zero angles, ``C_bp(0) = 1``; the base as it is
stated here may be turned against it, which is beta of the extended model. Joints are turned in the order x, y, z
(outer, inner, platform); about which axis of p each turns at zero angles is data. The usual rig has X_K along Z_p, Y_K
along X_p, Z_K along Y_p (up): ``q_bp = qz(thx) qx(thy) qy(thz)``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import Site, earth_rate
from inercal.foundation.geometry.rotations import (
    Axis,
    conjugate,
    elementary,
    exp,
    from_matrix,
    log,
    multiply,
    to_matrix,
)
from inercal.foundation.keys import Reading, option, quantity, within
from inercal.foundation.rigs.chain import Chain, Joint
from inercal.foundation.units import shown

JOINTS = ("th_x", "th_y", "th_z")
"""Names of the gimbal angles, outer first."""

Frame = Literal["nue", "enu", "ned"]

_NORTH, _EAST, _UP = (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)
_DOWN = (0.0, 0.0, -1.0)

#: frame n -> its axes (rows), as north, west, up
_AXES: Mapping[str, Array] = {
    "nue": np.array([_NORTH, _UP, _EAST]),
    "enu": np.array([_EAST, _NORTH, _UP]),
    "ned": np.array([_NORTH, _EAST, _DOWN]),
}


def _once_each(axes: Any) -> tuple[Any, ...]:
    """The axes of a study: x, y and z in some order."""
    if not isinstance(axes, list) or sorted(map(str, axes)) != ["x", "y", "z"]:
        raise InputError(
            "gimbals", f'found {shown(axes)}, expected "x", "y" and "z" once each, the outer joint first'
        )
    return tuple(axes)


def _three_signs(signs: Any) -> tuple[int, ...]:
    """The signs of a study: three of 1 and -1."""
    good = isinstance(signs, list) and len(signs) == 3
    if not good or any(type(sign) is not int or sign not in (1, -1) for sign in signs):
        raise InputError("signs", f"found {shown(signs)}, expected three of 1 and -1, for the joints x, y, z")
    return tuple(signs)


def _three(choices: list[Any]) -> dict[str, Any]:
    """JSON Schema of a list of three of such."""
    return {"type": "array", "items": {"enum": choices}, "minItems": 3, "maxItems": 3}


@dataclass(frozen=True, eq=False)
class Gimbals:
    """The joints, outer first: ``axes`` of p along which they lie at zero angles, and their ``signs``, -1 where the
    angle counts left-handed."""

    axes: tuple[Axis, Axis, Axis] = option(
        "axis of the platform along which each joint lies at zero angles, outer first", ("z", "x", "y"),
        example=["z", "x", "y"], name="gimbals", reads=Reading(_once_each, _three(["x", "y", "z"])),
    )  # fmt: skip
    signs: tuple[int, int, int] = option(
        "of the angles: -1 where one counts left-handed", (1, 1, 1), example=[1, 1, 1],
        reads=Reading(_three_signs, _three([1, -1])),
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse two joints about one axis, which no three angles make good."""
        if sorted(self.axes) != ["x", "y", "z"] or any(sign not in (1, -1) for sign in self.signs):
            raise ValueError(f"found {self.axes}, {self.signs}, expected x, y, z once each and signs 1 or -1")

    @property
    def index(self) -> NDArray[np.int64]:
        """(3,) axes as 0, 1, 2, for kernels."""
        return np.array(["xyz".index(axis) for axis in self.axes], dtype=np.int64)

    @property
    def sign(self) -> Array:
        """(3,) signs, for kernels."""
        return np.array(self.signs, dtype=float)

    def chain(self) -> Chain:
        """The same as a kinematic chain, whose angles are right-handed (th times signs)."""
        return Chain(tuple(Joint(name, axis) for name, axis in zip(JOINTS, self.axes, strict=True)))


LEANING = within(-0.5 * math.pi, 0.5 * math.pi, "an angle from -90 deg to 90 deg")
"""Tilts of a base."""


@dataclass(frozen=True, eq=False)
class Base:
    """Attitude of frame b on the earth: axes of b lie along those of ``frame`` at zero heading and tilt.

    ``heading`` [rad] turns the base clockwise as seen from above; ``tilt`` [rad] then about north and about east,
    right-handed; both with standard uncertainties ``heading_u`` and ``tilt_u`` [rad].
    """

    frame: Frame = option(
        "axes of the platform at zero angles: north-up-east, east-north-up, north-east-down", "nue"
    )
    heading: float = quantity(
        "of the base, from north to east; may carry an uncertainty; unknown: found from the record; 0 if absent",
        "angle", 0.0, example="40 deg", u="heading_u", words={"unknown": 0.0},
    )  # fmt: skip
    tilt: tuple[float, float] = quantity(
        "of the base, about north and about east; may carry uncertainties; level if absent", "angle", (0.0, 0.0),
        example=["0 arcmin", "0 arcmin"], u="tilt_u", of="the one about north, the one about east",
        bounds=LEANING,
    )  # fmt: skip
    heading_u: float = 0.0
    tilt_u: tuple[float, float] = (0.0, 0.0)

    def from_geographic(self) -> Array:
        """(3, 3): components in b of a vector given as north, west, up."""
        about_north, about_east = self.tilt
        tilted = to_matrix(exp(np.array([about_north, -about_east, 0.0])))
        return np.asarray(_AXES[self.frame] @ (tilted @ elementary("z", -self.heading)).T)

    def turned(self, beta: Array) -> Base:
        """The base of which a rotation vector ``beta`` (3,) [rad], in b, is the zero of the encoders against this one.

        ``qexp(beta)`` turns components in b to those in the new b. The turn from geographic axes is split into one
        about the vertical, the heading, and after it one about a level axis, the tilt (swing and twist).
        """
        to_base = to_matrix(exp(beta)) @ self.from_geographic()
        whole = from_matrix(to_base.T @ _AXES[self.frame])
        about_vertical = 2.0 * math.atan2(whole[3], whole[0])
        twist = exp(np.array([0.0, 0.0, about_vertical]))
        north, west, _ = (float(each) for each in log(multiply(whole, conjugate(twist))))
        return replace(self, heading=math.remainder(-about_vertical, 2.0 * math.pi), tilt=(north, -west))


class World(NamedTuple):
    """Earth rate (3,) [rad/s] and specific force at rest ``up`` (3,) [m/s^2], both in b, and ``axes`` (3,) and
    ``signs`` (3,) of the gimbals, as kernels take them."""

    earth: Array
    up: Array
    axes: NDArray[np.int64]
    signs: Array


def world(site: Site, base: Base, gimbals: Gimbals) -> World:
    """Earth rate and gravity on a base; the latitude of the site must be known."""
    if site.latitude is None:
        raise ValueError("found a site without latitude, expected one")
    north, up = (float(rate) for rate in earth_rate(site.latitude))
    to_base = base.from_geographic()
    return World(
        to_base @ np.array([north, 0.0, up]),
        to_base @ np.array([0.0, 0.0, site.gravity]),
        gimbals.index,
        gimbals.sign,
    )
