"""Second-order coefficients of the accelerometers that are not fitted: their part of u, and whether they show.

|f| - g in a pose changes with K2 of an axis as the cube of the direction of gravity along it, the biases as the
direction itself. Poses square to the axes cannot tell the two apart: K2 is then all in K0.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.budget import TypeB, Uncertainty
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit, fit_accelerometer
from inercal.systems.imu.multiposition.joint import JointTriads, PoseScatter
from inercal.systems.imu.multiposition.left_out import (
    PoseEffects,
    TestedErrors,
    effects,
    harmed,
    in_words,
    shown,
)
from inercal.systems.imu.second_order import SOURCE, k2_finding, shares
from inercal.systems.imu.settings import ImuSettings

_LEAST_SCATTER = 1e-9
"""Scatter [m/s^2] that rounding leaves."""


def squares_source(joint: JointTriads, scatter: PoseScatter, size: float) -> list[TypeB]:
    """The part of u by K2 that is not fitted; empty where it is.

    K2 of each axis is 0 with the standard deviation ``size`` [1/(m/s^2)] before the data. The values are not corrected
    for what these say of it: its likeliest value there counts as uncertainty, with what they leave open (GUM F.2.4.5).
    """
    if joint.accelerometer.squares or size <= 0.0:
        return []
    unexplained, shifts = _effects(joint)
    variance = max(scatter.s, _LEAST_SCATTER) ** 2
    left_open = np.linalg.inv(unexplained.T @ unexplained / variance + np.eye(3) / size**2)
    likeliest = -left_open @ unexplained.T @ joint.accelerometer.fit.residuals / variance
    columns = np.column_stack([np.linalg.cholesky(left_open), likeliest])
    return [TypeB(SOURCE, size, "1/(m/s^2)", shifts @ columns / size)]


def squares_shown(
    joint: JointTriads, means: Array, gravity: float, noise: float = 0.0, noise_dof: float = 0.0
) -> TestedErrors | None:
    """K2 that is not fitted, where the poses, of mean outputs ``means`` (n, 3), allow to fit it and show it.

    ``noise`` and ``noise_dof`` are those of `inercal.systems.imu.multiposition.left_out.shown`.
    """
    acc = joint.accelerometer
    if acc.squares or not _allowed(acc, means, gravity):
        return None
    of = _effects(joint)
    found = shown(joint, of, noise, noise_dof)
    if found is None or found.probability > LIMITS.k2_probability:
        return None
    return TestedErrors(of, found, LIMITS.k2_probability)


def squares_finding(
    joint: JointTriads,
    means: Array,
    uncertainty: Uncertainty,
    settings: ImuSettings,
    size: float,
    found: TestedErrors | None,
) -> Iterator[Finding]:
    """A finding where K2 was ``found`` by `squares_shown`, or where u of a value is mostly an ordinary one; none where
    it is fitted.

    What shows does harm where it shifts a value by more than the rest of its u; where ``size`` [1/(m/s^2)], as of
    `squares_source`, was stated, by more than the whole. ``means`` (n, 3) are the outputs.
    """
    acc = joint.accelerometer
    if acc.squares:
        return
    names, unit = joint.names, shown_unit("1/(m/s^2)")
    if found is not None:
        u = uncertainty.u
        if settings.k2_u is None:
            u = u * np.sqrt(1.0 - shares(names, uncertainty))
        words = in_words(found.shown, unit[1])
        yield Finding(
            "unmodelled_k2",
            f"the poses show second-order coefficients K2 of the accelerometers ({words} {unit[0]}), not fitted",
            harm=harmed(found, names, u),
            action="set imu.k2 = true",
        )
        return
    cure = "set imu.k2 = true"
    if not _allowed(acc, means, settings.site.gravity):
        cure = f"add poses on the edges and corners between the sides, {LIMITS.poses_with_k2} poses or more, and {cure}"
    yield from k2_finding(names, uncertainty, settings, size, cure)


def _effects(joint: JointTriads) -> PoseEffects:
    """Effects of K2 of each axis."""
    return effects(joint, joint.accelerometer.force_by_squares().reshape(-1, 3))


def _allowed(acc: AccelerometerFit, means: Array, gravity: float) -> bool:
    """True where the poses tell K2 apart from the rest."""
    if len(means) < LIMITS.poses_with_k2:
        return False
    identified = fit_accelerometer(means, gravity, acc.fit.x, True).fit.identifiability
    return identified.condition <= LIMITS.condition
