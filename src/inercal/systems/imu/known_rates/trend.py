"""Changes over the orientations: a bias that drifts, or a rate or scale factor that does, looked for in the residuals.

Times are no part of rows of means, so that a trend goes with the number of the orientation, file after file.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.results.rounding import rounded
from inercal.systems.imu.known_rates.fit import NAMES, RateFit
from inercal.systems.imu.known_rates.vector_sizes import residual_rows
from inercal.systems.imu.limits import LIMITS


def trend_findings(rate_fit: RateFit, sizes: Array, u: Array) -> Iterator[Finding]:
    """Findings about trends, each at `LIMITS.driver_probability`.

    ``sizes`` (n,) are the known sizes of the rates [rad/s], ``u`` (9,) the standard uncertainties of the coefficients,
    by more than which those move that are harmed.
    """
    fit = rate_fit.fit
    row, axis = residual_rows(sizes)
    along = np.where((axis >= 0)[:, None], np.eye(3)[np.maximum(axis, 0)], fit.directions[row])
    passed = (row - row.mean()) / max(int(np.max(row)), 1)
    bias, bias_p = _told(rate_fit, passed[:, None] * along)
    scale, scale_p = _told(rate_fit, (passed * np.where(axis < 0, sizes[row], 0.0))[:, None])
    if min(bias_p, scale_p) >= LIMITS.driver_probability:
        return
    if bias_p <= scale_p:
        value, size, effect = bias[0], bias[1], passed[:, None] * along
        each = zip("xyz", np.degrees(value) * 3600.0, np.degrees(size) * 3600.0, strict=True)
        words = ", ".join(f"{name} {' ± '.join(rounded(of, of_u))} deg/h" for name, of, of_u in each)
        what, cure = (
            f"the biases drift from the first to the last orientation ({words})",
            "wait until the gyro is warm",
        )
    else:
        value, size, effect = scale[0], scale[1], (passed * np.where(axis < 0, sizes[row], 0.0))[:, None]
        words = " ± ".join(rounded(1e6 * float(value[0]), 1e6 * float(size[0])))
        what = f"the rate or the scale factors change by {words} ppm from the first to the last orientation"
        cure = "let both get warm, and check the rate at the end"
    shift = np.abs(fit.gain() @ (effect @ value))
    yield Finding(
        "trend",
        f"{what}: {cure}, or take the orientations in an order that tells, there and back",
        harm=tuple(name for name, each_shift, own in zip(NAMES, shift, u, strict=True) if each_shift > own),
    )


def _told(rate_fit: RateFit, columns: Array) -> tuple[tuple[Array, Array], float]:
    """Sizes (k,) of effects ``columns`` (N, k) with their u (k,), and the probability of such by chance."""
    from scipy.special import fdtrc

    P, r, k = rate_fit.fit.left(), rate_fit.fit.residuals, columns.shape[1]
    dof = float(np.sum(rate_fit.dof)) - k
    information = columns.T @ P @ columns
    if dof < 3.0 or np.linalg.cond(information) > 1.0 / math.sqrt(np.finfo(float).eps):
        return (np.zeros(k), np.zeros(k)), 1.0
    inverse = np.linalg.inv(information)
    value = inverse @ columns.T @ P @ r
    gained = float(value @ information @ value)
    left = max(float(r @ P @ r) - gained, 1e-300) / dof
    return (value, np.sqrt(np.diag(inverse) * left)), float(fdtrc(k, dof, gained / k / left))
