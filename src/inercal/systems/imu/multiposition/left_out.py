"""Errors of the accelerometers that are not fitted: whether the poses show them, and what they do to coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.results.shown import rounded
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.deletion import Added
from inercal.systems.imu.multiposition.joint import JointTriads, radial


class PoseEffects(NamedTuple):
    """Changes by q errors: of |f| - g in n poses beyond what the fitted coefficients take up, ``unexplained`` (n, q)
    [m/s^2], and of the p coefficients, ``shifts`` (p, q)."""

    unexplained: Array
    shifts: Array


class ShownErrors(NamedTuple):
    """The answer of the poses about q errors: likeliest sizes ``estimate`` (q,) with ``u`` (q,), and ``probability`` of
    so much by chance."""

    estimate: Array
    u: Array
    probability: float


class TestedErrors(NamedTuple):
    """Errors with their ``effects``, ``shown`` by the poses with a probability below ``limit``, as the likeliest of so
    many ``tries``."""

    effects: PoseEffects
    shown: ShownErrors
    limit: float
    tries: int = 1


def in_words(found: ShownErrors | Added, size: float = 1.0) -> str:
    """The sizes of errors of the three axes with their u, in units of ``size``: ``x 20 ± 3, y ..``."""
    each = zip("xyz", found.estimate / size, found.u / size, strict=True)
    return ", ".join(f"{axis} {' ± '.join(rounded(value, u))}" for axis, value, u in each)


def harmed(found: TestedErrors, names: tuple[str, ...], u: Array) -> tuple[str, ...]:
    """Those of the coefficients ``names`` (p,) that errors shift by more than ``u`` (p,)."""
    beyond = np.abs(found.effects.shifts @ found.shown.estimate) > u
    return tuple(name for name, more in zip(names, beyond, strict=True) if more)


def effects(joint: JointTriads, in_force: Array) -> PoseEffects:
    """Effects of errors that change the specific force in the poses by ``in_force`` (3 n, q)."""
    acc = joint.accelerometer
    columns = radial(acc) @ in_force
    J = acc.fit.jacobian
    return PoseEffects(
        columns - J @ (acc.fit.unit_covariance @ (J.T @ columns)), np.asarray(joint.by_force @ in_force)
    )


def shown(
    joint: JointTriads,
    of: PoseEffects,
    noise: float = 0.0,
    noise_dof: float = 0.0,
    beside: PoseEffects | None = None,
    tries: int = 1,
) -> ShownErrors | None:
    """The answer of the residuals about errors, by an F test; None where too few poses are left, or no scatter, or
    where the poses cannot tell the errors apart.

    ``noise`` is the variance [(m/s^2)^2] of |f| that the sensors' noise explains, with ``noise_dof`` degrees of
    freedom, 0 where it is not known; it is pooled with what the errors leave unless that is clearly more. The poses
    alone must show the errors too: a few of them cannot tell whether they scatter by more than the noise. ``beside``
    are other errors, which are fitted with the coefficients. Where these effects are the likeliest of so many
    ``tries``, the probability is multiplied by their number.
    """
    from scipy.special import fdtrc

    r, X, dof = joint.accelerometer.fit.residuals, of.unexplained, float(joint.accelerometer.fit.dof)
    if beside is not None:
        Z = np.linalg.qr(beside.unexplained)[0]
        r, X, dof = r - Z @ (Z.T @ r), X - Z @ (Z.T @ X), dof - Z.shape[1]
    q = X.shape[1]
    size = np.linalg.norm(of.unexplained, axis=0)
    if dof <= q or not np.all(size > 0.0) or np.linalg.matrix_rank(X / size, tol=1e-6) < q:
        return None
    K = X.T @ X
    estimate = np.asarray(-np.linalg.solve(K, X.T @ r))
    gained, dof = float(estimate @ K @ estimate), dof - q
    left = (float(r @ r) - gained) / dof
    if left <= 0.0:
        return None
    alone = tries * float(fdtrc(q, dof, gained / q / left))
    if noise > 0.0 and fdtrc(dof, noise_dof, left / noise) > LIMITS.scatter_probability:
        left, dof = (dof * left + noise_dof * noise) / (dof + noise_dof), dof + noise_dof
    pooled = tries * float(fdtrc(q, dof, gained / q / left))
    u = np.asarray(np.sqrt(np.diag(np.linalg.inv(K)) * left))
    return ShownErrors(
        estimate, u, min(1.0, pooled if alone < LIMITS.alone_probability else max(alone, pooled))
    )


def unexplained(
    joint: JointTriads, found: dict[str, TestedErrors | None], noise: float, noise_dof: float
) -> dict[str, TestedErrors]:
    """Of the errors ``found``, by name, those for which none of the others leaves nothing while itself it stays."""
    stand = {name: each for name, each in found.items() if each is not None}
    if len(stand) < 2:
        return stand

    def gone(one: TestedErrors, other: TestedErrors) -> bool:
        left = shown(joint, one.effects, noise, noise_dof, other.effects, one.tries)
        return left is None or left.probability > one.limit

    return {
        name: one
        for name, one in stand.items()
        if not any(gone(one, other) and not gone(other, one) for other in stand.values() if other is not one)
    }
