"""Second-order coefficients of the accelerometers that are not fitted: what they would do, and whether they show.

|f| - g in a pose changes with K2 of an axis as the cube of the direction of gravity along it, the biases as the
direction itself. Poses square to the axes cannot tell the two apart: K2 is then all in K0.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.findings import Finding
from inercal.imu.limits import LIMITS
from inercal.imu.multiposition.accelerometer import AccelerometerFit, fit_accelerometer
from inercal.imu.multiposition.joint import Joint, Scatter, radial
from inercal.instruments.terms import shown_unit


def squares_finding(
    joint: Joint,
    scatter: Scatter,
    means: Array,
    gravity: float,
    u: Array,
    noise: float = 0.0,
    noise_dof: float = 0.0,
) -> Iterator[Finding]:
    """A finding where K2 shows, or may shift a value by more than its ``u`` (p,); none where it is fitted.

    K2 of each axis is 0 with the standard deviation `LIMITS.ordinary_k2` before the data, which may tell more of it.
    ``means`` (n, 3) are the outputs, ``gravity`` [m/s^2] that of the site; ``noise`` is the variance [(m/s^2)^2] of |f|
    that the sensors' noise explains, with ``noise_dof`` degrees of freedom, 0 where it is not known.
    """
    from scipy.special import fdtrc

    acc = joint.accelerometer
    if acc.squares:
        return
    in_force = acc.force_by_squares().reshape(-1, 3)
    columns = radial(acc) @ in_force  # what K2 adds to |f| - g
    shifts = joint.by_force @ in_force
    J = acc.fit.jacobian
    unexplained = columns - J @ (acc.fit.unit_covariance @ (J.T @ columns))
    K = unexplained.T @ unexplained
    allowed = _allowed(acc, means, gravity)
    names, unit = joint.names, shown_unit("1/(m/s^2)")
    if allowed and acc.fit.dof > 3:
        estimate = -np.linalg.solve(K, unexplained.T @ acc.fit.residuals)
        gained = float(estimate @ K @ estimate)
        left, dof = (acc.fit.chi2 - gained) / (acc.fit.dof - 3), float(acc.fit.dof - 3)
        if noise > 0 and fdtrc(dof, noise_dof, left / noise) > LIMITS.scatter_probability:
            left, dof = (dof * left + noise_dof * noise) / (dof + noise_dof), dof + noise_dof
        if left > 0 and fdtrc(3, dof, gained / 3.0 / left) < LIMITS.k2_probability:
            size = np.sqrt(np.diag(np.linalg.inv(K)) * left) / unit[1]
            words = ", ".join(
                f"{axis} {' ± '.join(rounded(value, each))}"
                for axis, value, each in zip("xyz", estimate / unit[1], size, strict=True)
            )
            harmed = np.abs(shifts @ estimate) > u
            yield Finding(
                "unmodelled_k2",
                f"the poses show second-order coefficients K2 of the accelerometers ({words} {unit[0]}) that are not "
                "fitted: set imu.k2 = true",
                harm=tuple(name for name, each in zip(names, harmed, strict=True) if each),
            )
            return
    possible = np.linalg.inv(K / scatter.s**2 + np.eye(3) / LIMITS.ordinary_k2**2)
    size = np.sqrt(np.einsum("pi,ij,pj->p", shifts, possible, shifts))
    if not np.any(size > u):
        return
    # poses that allow K2 have been asked for it: what is left open counts only where it rules the uncertainty
    harmed = size > (LIMITS.possible_k2_shift if allowed else 1.0) * u
    worst = int(np.argmax(size / u))
    cure = "set imu.k2 = true"
    if not allowed:
        cure = f"add poses on the edges and corners between the sides, {LIMITS.poses_with_k2} poses or more, and {cure}"
    yield Finding(
        "unmodelled_k2",
        f"an ordinary second-order coefficient K2 of the accelerometers ({LIMITS.ordinary_k2 / unit[1]:.0f} "
        f"{unit[0]}), as far as these poses leave it open, would shift {names[worst]} by {size[worst] / u[worst]:.1f} "
        f"of its u: {cure}",
        harm=tuple(name for name, each in zip(names, harmed, strict=True) if each),
    )


def _allowed(acc: AccelerometerFit, means: Array, gravity: float) -> bool:
    """True where the poses tell K2 apart from the rest."""
    if len(means) < LIMITS.poses_with_k2:
        return False
    identified = fit_accelerometer(means, gravity, acc.fit.x, True).fit.identifiability
    return identified.condition <= LIMITS.condition
