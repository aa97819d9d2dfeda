"""The angle ahead of the rows that are fused: carried on by the model over the delay of a band, or between rows.

The filter knows theta, rate, acceleration and jerk at the stamp of a fused row. At a time tau later

    theta' = theta + c (w tau + al tau^2 / 2 + j tau^3 / 6)      P' = F P F^T + Q(tau)

with the noise Q of the snap: what the motion may have done since is in u.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating
from inercal.systems.aoa.fusion.loop import LOST, OUTPUTS, root
from inercal.systems.aoa.fusion.model import Constants

Array: TypeAlias = NDArray[np.float64]

WIDTH = OUTPUTS + 2
"""Columns of a row that is carried on: those of `inercal.systems.aoa.fusion.loop.write`, roll and its u."""


def carried_on(motions: Array, ahead: Array, constants: Constants) -> Array:
    """(m, `WIDTH`) of motions (m, `MOTION`) after ``ahead`` (m,) [s]; NaN where theta is lost by then."""
    out = np.empty((len(ahead), WIDTH))
    _carry_on(np.ascontiguousarray(motions), ahead, constants, out)
    return out


def between(t: Array, theta: tuple[Array, ...], at: Array) -> Array:
    """Angle, u, rate, u, acceleration (m, `OUTPUTS`) at times ``at`` (m,) [s] between rows at ``t`` (k,) [s].

    ``theta`` are these at the rows: of angle, rate and acceleration the polynomial of fifth degree that has both ends'
    goes between, of the u a line. NaN before the first row, after the last one, and where either end has none.
    """
    out = np.full((len(at), OUTPUTS), np.nan)
    if len(t) < 2:
        return out
    k = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    inside = (at >= t[0]) & (at <= t[-1])
    k, h = k[inside], (t[k + 1] - t[k])[inside]
    s = (at[inside] - t[k]) / h
    angle, u, rate, rate_u, acceleration = theta
    a, b, c = angle[k], h * rate[k], 0.5 * h * h * acceleration[k]
    d = angle[k + 1] - a - b - c
    e = h * rate[k + 1] - b - 2.0 * c
    f = h * h * acceleration[k + 1] - 2.0 * c
    p, q, r = 10.0 * d - 4.0 * e + 0.5 * f, -15.0 * d + 7.0 * e - f, 6.0 * d - 3.0 * e + 0.5 * f
    value = a + s * (b + s * (c + s * (p + s * (q + s * r))))
    slope = (b + s * (2.0 * c + s * (3.0 * p + s * (4.0 * q + s * 5.0 * r)))) / h
    bend = (2.0 * c + s * (6.0 * p + s * (12.0 * q + s * 20.0 * r))) / (h * h)
    spread = [(1.0 - s) * x[k] + s * x[k + 1] for x in (u, rate_u)]
    out[inside] = np.column_stack([value, spread[0], slope, spread[1], bend])
    return out


@allocating
def _carry_on(motions: Array, ahead: Array, constants: Constants, out: Array) -> None:
    """The loop of `carried_on`."""
    of_theta, of_rate = np.zeros(4), np.zeros(4)
    for k in range(len(ahead)):
        motion, tau = motions[k], ahead[k] + constants.common_delay
        level, across = motion[20], motion[21]
        of_theta[0], of_theta[1] = 1.0, level * tau
        of_theta[2], of_theta[3] = 0.5 * level * tau * tau, level * tau * tau * tau / 6.0
        of_rate[1], of_rate[2], of_rate[3] = 1.0, tau, 0.5 * tau * tau
        theta, rate = across * tau, 0.0
        power = abs(tau)
        squared = power * power
        of_snap = constants.snap * power * squared * squared
        variance, of_rates = of_snap * squared / 252.0, of_snap / 20.0
        for i in range(4):
            theta += of_theta[i] * motion[i]
            rate += of_rate[i] * motion[i]
            for j in range(4):
                p = motion[4 + 4 * i + j]
                variance += of_theta[i] * of_theta[j] * p
                of_rates += of_rate[i] * of_rate[j] * p
        acceleration, u = motion[2] + tau * motion[3], constants.common_delay_u
        out[k, 0], out[k, 1] = theta, root(variance + rate * rate * u * u)
        out[k, 2], out[k, 3] = rate, root(of_rates + acceleration * acceleration * u * u)
        out[k, 4] = acceleration
        out[k, 5], out[k, 6] = motion[22] + ahead[k] * motion[24], motion[23]
        if not variance < LOST:
            out[k, :] = math.nan
