"""Errors of the accelerometers that are not fitted: whether the poses show them, and what they do to coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.arrays import Array
from inercal.imu.limits import LIMITS
from inercal.imu.multiposition.joint import Joint, radial


class Effects(NamedTuple):
    """Changes by q errors: of |f| - g in n poses beyond what the fitted coefficients take up, ``unexplained`` (n, q)
    [m/s^2], and of the p coefficients, ``shifts`` (p, q)."""

    unexplained: Array
    shifts: Array


class Shown(NamedTuple):
    """The answer of the poses about q errors: likeliest sizes ``estimate`` (q,) with ``u`` (q,), the sum of squares
    ``gained`` by them [(m/s^2)^2], and the ``probability`` of so much by chance."""

    estimate: Array
    u: Array
    gained: float
    probability: float


def effects(joint: Joint, in_force: Array) -> Effects:
    """Effects of errors that change the specific force in the poses by ``in_force`` (3 n, q)."""
    acc = joint.accelerometer
    columns = radial(acc) @ in_force
    J = acc.fit.jacobian
    return Effects(
        columns - J @ (acc.fit.unit_covariance @ (J.T @ columns)), np.asarray(joint.by_force @ in_force)
    )


def shown(joint: Joint, of: Effects, noise: float = 0.0, noise_dof: float = 0.0) -> Shown | None:
    """The answer of the residuals about errors, by an F test; None where too few poses are left, or no scatter.

    ``noise`` is the variance [(m/s^2)^2] of |f| that the sensors' noise explains, with ``noise_dof`` degrees of
    freedom, 0 where it is not known; it is pooled with what the errors leave unless that is clearly more.
    """
    from scipy.special import fdtrc

    fit, q = joint.accelerometer.fit, of.unexplained.shape[1]
    if fit.dof <= q:
        return None
    K = of.unexplained.T @ of.unexplained
    estimate = np.asarray(-np.linalg.solve(K, of.unexplained.T @ fit.residuals))
    gained = float(estimate @ K @ estimate)
    left, dof = (fit.chi2 - gained) / (fit.dof - q), float(fit.dof - q)
    if noise > 0 and fdtrc(dof, noise_dof, left / noise) > LIMITS.scatter_probability:
        left, dof = (dof * left + noise_dof * noise) / (dof + noise_dof), dof + noise_dof
    if left <= 0:
        return None
    u = np.asarray(np.sqrt(np.diag(np.linalg.inv(K)) * left))
    return Shown(estimate, u, gained, float(fdtrc(q, dof, gained / q / left)))
