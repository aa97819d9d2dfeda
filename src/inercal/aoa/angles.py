"""Angles of a recording, by any method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from inercal.aoa.flow import InStream, alpha_beta, theta_u
from inercal.aoa.settings import Attitude
from inercal.arrays import Array


@dataclass(frozen=True, eq=False)
class Angles:
    """Angles by a ``method`` at each of n rows, NaN in rows without one.

    ``theta`` pitch and its standard uncertainty ``u`` [rad]; ``rate`` and ``rate_u`` [rad/s]. ``roll`` and ``roll_u``
    [rad] where gyros for roll and yaw track it. Where the study states a roll with an uncertainty, ``own_u`` is u
    without the part of the roll (`inercal.aoa.flow.alpha_beta` takes it), and ``by_roll`` the change of theta per
    change of the roll.
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

    @property
    def known_u(self) -> Array:
        """(n,) rad, standard uncertainty of theta, were the stated roll exact."""
        return self.u if self.own_u is None else self.own_u

    def in_stream(self, attitude: Attitude) -> InStream:
        """Angle of attack and sideslip of the model as the study states that it lies in the stream."""
        return alpha_beta(self.theta, self.known_u, attitude, self.roll, self.roll_u, self.by_roll)


def continuous(theta: Array) -> Array:
    """Angles (n,) [rad] without jumps of a turn, NaN where there is none."""
    unwrapped, finite = theta.copy(), np.isfinite(theta)
    unwrapped[finite] = np.unwrap(theta[finite])
    return unwrapped


def stated_roll(angles: Angles, attitude: Attitude) -> Angles:
    """The angles with the uncertainty of the stated roll added to that of theta.

    They come back unchanged where no roll is stated, where it is exact, and where gyros track it: u has its part then.
    """
    if attitude.roll is None or attitude.roll.u == 0.0 or angles.roll is not None:
        return angles
    u = theta_u(angles.theta, angles.known_u, attitude, angles.by_roll)
    return replace(angles, u=u, own_u=angles.known_u)
