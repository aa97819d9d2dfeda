"""Scatter of the positions by the six equations that are left over of eighteen, for twelve unknowns of each sensor.

The two positions of an axis have one mean, the bias, also in the outputs of the other axes. There the accelerometers
show how far the positions were from upright: their scatter is the alignment. The gyro's show whether its bias stayed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.inference.least_squares import LinearFit, least_squares
from inercal.systems.imu.ferraris.method import Matrices
from inercal.systems.imu.ferraris.names import UP
from inercal.systems.imu.ferraris.readings import SectionReadings
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import FerrarisSettings

DOF = 6
"""Equations left over in the positions of either sensor."""

_AXIS = np.repeat(np.arange(3), 2)
_ACROSS = ~np.eye(3, dtype=bool)


@dataclass(frozen=True, eq=False)
class Scatter:
    """Scatter of the positions.

    ``tilt`` [rad] the standard uncertainty of the direction of a position and ``tilt_dof`` its degrees of freedom, inf
    where it is stated; ``means`` the variances (6, 3) [output squared] of the mean outputs by sensor and ``dof`` theirs
    (where the tilt is taken from the scatter across the axes, it holds the noise there); ``over_expected`` the scatter
    over what was expected of it, and ``excess`` whether chance does not explain it; ``left`` (3, 3) the mean output of
    the two positions of an axis (row) less the bias, by output; ``fits`` the least-squares solutions of all eighteen
    equations.
    """

    tilt: float
    tilt_dof: float
    means: dict[str, Array]
    dof: dict[str, float]
    over_expected: dict[str, float]
    excess: dict[str, bool]
    left: dict[str, Array]
    fits: dict[str, LinearFit]


def judge(readings: SectionReadings, solution: Matrices, site: Site, options: FerrarisSettings) -> Scatter:
    """Compare the scatter of the positions with the noise at rest, the stated alignment and earth rate."""
    x = readings.inputs
    outputs = {"acc": x.force, "gyro": x.rate}
    noise = {
        s: np.maximum(readings.noise[s].variance(readings.lengths), _floor(y)) for s, y in outputs.items()
    }
    dof = {s: 3.0 * readings.noise[s].dof(float(np.median(readings.lengths))) for s in outputs}
    tilted = _by_direction(solution.force_gain * site.gravity)
    earth = site.horizontal_rate_u**2 * _by_direction(solution.rate_gain)
    left = {"acc": _left_over(x.force, solution.force_bias), "gyro": _left_over(x.rate, x.rate.mean(axis=0))}

    # what the noise does to the means of the pairs, and to the bias taken off them
    of_pairs, of_bias = _pairs(noise["acc"]), np.diag(_pairs(noise["acc"]))
    by_tilt, squares = _pairs(tilted)[_ACROSS], left["acc"][_ACROSS] ** 2
    by_noise = (of_pairs + of_bias)[_ACROSS]
    alignment = options.alignment or 0.0
    ratio = float(np.mean(squares / (by_noise + alignment**2 * by_tilt)))
    rest = _all_equations(x.rate, site.gravity, noise["gyro"] + earth, "D_F", "G")
    excess = {
        "acc": _beyond_chance(ratio, np.inf if alignment else dof["acc"]),
        "gyro": _beyond_chance(rest.s2, dof["gyro"]),
    }
    means, tilt, tilt_dof = dict(noise), alignment, np.inf
    if options.alignment is None or excess["acc"]:
        seen = np.mean((squares - np.broadcast_to(of_bias, (3, 3))[_ACROSS]) / by_tilt)
        tilt, tilt_dof = float(np.sqrt(max(seen, np.mean(of_pairs[_ACROSS] / by_tilt)))), float(DOF)
        means["acc"] = np.where(np.eye(3)[_AXIS] > 0.0, noise["acc"], 0.0)
    # the equations left over say what a mean output at rest is worth; too much scatter is put down to the output
    means["gyro"] = rest.s2 * noise["gyro"] + max(rest.s2 - 1.0, 0.0) * earth
    dof["gyro"] = float(DOF)
    force = _all_equations(x.force, site.gravity, noise["acc"] + tilt**2 * tilted, "K0", "K1")
    return Scatter(
        tilt,
        tilt_dof,
        means,
        dof,
        {"acc": float(np.sqrt(ratio)), "gyro": float(np.sqrt(rest.s2))},
        excess,
        left,
        {"acc": force, "gyro": rest},
    )


def _floor(outputs: Array) -> float:
    """A variance below which nothing is known: the rounding of the outputs."""
    return float((1e-15 * np.max(np.abs(outputs)) + 1e-300) ** 2)


def _all_equations(outputs: Array, gravity: float, variance: Array, bias: str, gain: str) -> LinearFit:
    """Least squares of the eighteen equations: bias of each output, then its response to each direction."""
    of_position = np.hstack([np.ones((6, 1)), gravity * UP])
    design = np.asarray(np.kron(of_position, np.eye(3)), dtype=np.float64)
    names = [f"{bias}_{i}" for i in "xyz"] + [f"{gain}_{i}{j}" for j in "xyz" for i in "xyz"]
    return least_squares(design, outputs.ravel(), names, np.asarray(variance).ravel())


def _by_direction(gain: Array) -> Array:
    """(6, 3): variance of the outputs in each position by unit errors in the two directions across its axis."""
    squares = gain**2
    return np.array([squares.sum(axis=1) - squares[:, j] for j in _AXIS])


def _pairs(variance: Array) -> Array:
    """(3, 3): variance of the mean of the two positions of an axis (row), by output (column)."""
    return np.asarray(0.25 * (variance[0::2] + variance[1::2]))


def _left_over(outputs: Array, bias: Array) -> Array:
    """(3, 3): mean of the two positions of an axis (row) less the bias, by output (column)."""
    return np.asarray(0.5 * (outputs[0::2] + outputs[1::2]) - bias)


def _beyond_chance(ratio: float, dof: float) -> bool:
    """True if a ratio of variances of `DOF` and ``dof`` degrees of freedom is too large for chance (F test)."""
    from scipy.special import chdtrc, fdtrc

    p = chdtrc(DOF, DOF * ratio) if np.isinf(dof) else fdtrc(DOF, dof, ratio)
    return bool(p < LIMITS.scatter_probability)
