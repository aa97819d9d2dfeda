"""Angles of a recording, by any method; angle of attack and sideslip of the model in a stream not quite parallel.

Tunnel axes X upstream, Y left, Z up; body axes x forward, y left, z up. The model is yawed first, by psi about Z, nose
left, then pitched by theta, nose up, then rolled by phi about x, right wing down: theta is what accelerometers see,
whatever the yaw. The stream rises by the upwash e and comes from the right by the sidewash s, so that the model moves
through it, in tunnel axes and over its speed, with

    v = (cos e cos s, -cos e sin s, -sin e)

and in body axes, along (x, y, z), after each turn:

    x1 = v_x cos psi + v_y sin psi      y1 = -v_x sin psi + v_y cos psi      z1 = v_z
    x  = x1 cos theta + z1 sin theta    z2 = -x1 sin theta + z1 cos theta
    y  = y1 cos phi + z2 sin phi        z  = -y1 sin phi + z2 cos phi

    alpha = atan2(-z, x)       beta = asin(-y)

beta is positive where the wind comes from the right. Without roll, yaw and flow alpha = theta and beta = 0, all
around. A roll gives alpha = atan2(sin theta cos phi, cos theta) and beta = asin(sin theta sin phi); yaw and sidewash
add to beta and upwash to alpha where nothing else turns the model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.units import Quantity
from inercal.systems.aoa.settings import Attitude

_UNKNOWN = math.pi / math.sqrt(3.0)
"""Standard deviation [rad] of an angle that may be any."""

_SIDEWAYS = 1e-12
"""Part of the stream across y below which there is no angle of attack."""


_PART = 100_000
"""Angles that are looked at at a time."""


@dataclass(frozen=True, eq=False)
class InStream:
    """``alpha``, ``beta`` and their standard uncertainties [rad], (n,) each."""

    alpha: Array
    u_alpha: Array
    beta: Array
    u_beta: Array


def gives_alpha(attitude: Attitude) -> bool:
    """True where the study states how the model lies in the stream, so that alpha follows from theta."""
    return any(each is not None for each in (attitude.roll, attitude.yaw, attitude.upwash, attitude.sidewash))


def alpha_beta(
    theta: Array,
    u_theta: Array,
    attitude: Attitude,
    roll: Array | None = None,
    u_roll: Array | None = None,
    by_roll: Array | None = None,
) -> InStream:
    """Angle of attack and sideslip at pitch angles ``theta`` (n,) [rad] of standard uncertainty ``u_theta``.

    ``roll`` and ``u_roll`` (n,) [rad] are those that the fusion tracks with gyros for roll and yaw; they replace the
    stated roll. Uncertainties are propagated to first order, their sources taken as independent. A stated roll was used
    to find theta too, so its error enters twice, and ``u_theta`` must be without it; ``by_roll`` (n,) is the change of
    theta per change of the stated roll, by default `theta_by_roll`.
    Where the wind comes straight from the side alpha is not defined, and its uncertainty is that of any angle.
    """
    yaw, up, side = (_of(each) for each in (attitude.yaw, attitude.upwash, attitude.sidewash))
    of_roll = _of(attitude.roll)
    phi = np.full(np.shape(theta), of_roll[0]) if roll is None else roll
    x, y, z, slopes = _seen(theta, phi, yaw[0], up[0], side[0])
    if roll is None:
        # the roll's own way, and the way through theta
        through = theta_by_roll(theta, of_roll[0]) if by_roll is None else by_roll
        slopes[1] = slopes[1] + through * slopes[0]
        u_roll = np.full(np.shape(theta), of_roll[1])
    elif u_roll is None:
        u_roll = np.zeros(np.shape(theta))
    across = np.hypot(x, z)
    sideways = across < _SIDEWAYS
    safe = np.where(sideways, 1.0, across)
    alpha, beta = np.arctan2(-z, x), np.arctan2(-y, across)
    of_alpha, of_beta = np.zeros(np.shape(theta)), np.zeros(np.shape(theta))
    sources: list[Array | float] = [u_theta, u_roll, yaw[1], up[1], side[1]]
    for (dx, dy, dz), u in zip(slopes, sources, strict=True):
        of_alpha += ((z * dx - x * dz) / safe**2 * u) ** 2
        # straight from the side any turn takes beta off 90 deg
        of_beta += np.where(sideways, dx**2 + dz**2, (dy / safe) ** 2) * u**2
    u_alpha = np.where(sideways, _UNKNOWN, np.minimum(np.sqrt(of_alpha), _UNKNOWN))
    finite = np.isfinite(theta)
    return InStream(alpha, np.where(finite, u_alpha, np.nan), beta, np.sqrt(of_beta))


def theta_by_roll(theta: Array, roll: float) -> Array:
    """Change of theta, found by accelerometers along and across the body at rest, per change of the stated roll.

    A stream uses it; for a whole recording `inercal.systems.aoa.result.systematic` is exact. The best fit of g sin
    theta and g cos phi cos theta, equally well known, to the readings moves by
    -cos phi sin phi sin theta cos theta / (cos^2 theta + cos^2 phi sin^2 theta).
    """
    s, c, level = np.sin(theta), np.cos(theta), math.cos(roll)
    return np.asarray(-level * math.sin(roll) * s * c / np.maximum(c**2 + (level * s) ** 2, 1e-12))


def _of(quantity: Quantity | None) -> tuple[float, float]:
    """Value and standard uncertainty; 0 where nothing is stated."""
    return (0.0, 0.0) if quantity is None else (quantity.value, quantity.u)


def _seen(
    theta: Array, phi: Array, yaw: float, up: float, side: float
) -> tuple[Array, Array, Array, list[Array]]:
    """Components of the motion along x, y, z, and their derivatives (3, n) by theta, phi, yaw, upwash and sidewash."""
    ce, se, cs, ss = math.cos(up), math.sin(up), math.cos(side), math.sin(side)
    cy, sy = math.cos(yaw), math.sin(yaw)
    st, ct, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)

    def turned(vx: float, vy: float, vz: float) -> Array:
        x1, y1 = vx * cy + vy * sy, vy * cy - vx * sy
        z2 = vz * ct - x1 * st
        return np.stack([x1 * ct + vz * st, y1 * cp + z2 * sp, z2 * cp - y1 * sp])

    v = (ce * cs, -ce * ss, -se)
    x, y, z = turned(*v)
    slopes = [
        np.stack([y * sp + z * cp, -x * sp, -x * cp]),
        np.stack([np.zeros_like(x), z, -y]),
        turned(v[1], -v[0], 0.0),
        turned(-se * cs, se * ss, -ce),
        turned(-ce * ss, -ce * cs, 0.0),
    ]
    return x, y, z, slopes


@dataclass(frozen=True, eq=False)
class Angles:
    """Angles by a ``method`` at each of n rows, NaN in rows without one.

    ``theta`` pitch and its standard uncertainty ``u`` [rad]; ``rate`` and ``rate_u`` [rad/s]. ``roll`` and ``roll_u``
    [rad] where gyros for roll and yaw track it. Where the study states a roll with an uncertainty, ``own_u`` is u
    without the part of the roll (`inercal.systems.aoa.angles.alpha_beta` takes it), and ``by_roll`` the change of theta
    per change of the roll. ``nis`` of the fusion is its mean squared innovation of the last seconds
    (`inercal.systems.aoa.fusion.watch`).
    """

    method: str
    theta: Array
    u: Array
    rate: Array
    rate_u: Array
    roll: Array | None = None
    roll_u: Array | None = None
    own_u: Array | None = None
    by_roll: Array | None = None
    nis: Array | None = None

    @property
    def known_u(self) -> Array:
        """(n,) rad, standard uncertainty of theta, were the stated roll exact."""
        return self.u if self.own_u is None else self.own_u

    def in_stream(self, attitude: Attitude) -> InStream:
        """Angle of attack and sideslip of the model as the study states that it lies in the stream."""
        return alpha_beta(self.theta, self.known_u, attitude, self.roll, self.roll_u, self.by_roll)


def continuous(theta: Array) -> Array:
    """Angles (n,) [rad] without jumps of a turn, NaN where there is none."""
    smooth, finite = theta.copy(), np.isfinite(theta)
    smooth[finite] = np.unwrap(theta[finite])
    return smooth


def unwrapped(theta: Array) -> Array:
    """Angles (n,) [rad] without jumps of a turn; the same array where there is no jump."""
    parts = (theta[k : k + _PART + 1] for k in range(0, len(theta), _PART))
    return theta if all(bool((np.abs(np.diff(part)) < math.pi).all()) for part in parts) else np.unwrap(theta)


def stated_roll(angles: Angles, attitude: Attitude) -> Angles:
    """The angles with the uncertainty of the stated roll added to that of theta.

    They come back unchanged where no roll is stated, where it is exact, and where gyros track it: u has its part then.
    """
    roll, by_roll = attitude.roll, angles.by_roll
    if roll is None or roll.u == 0.0 or angles.roll is not None:
        return angles
    slope = theta_by_roll(angles.theta, roll.value) if by_roll is None else by_roll
    return replace(angles, u=np.hypot(angles.known_u, slope * roll.u), own_u=angles.known_u)
