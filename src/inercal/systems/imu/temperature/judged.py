"""A polynomial through calibrations as its judge sees it: temperature is the input, the calibrations are in order."""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.judge import judge
from inercal.foundation.inference.questions import JudgedFit, StatedInput
from inercal.systems.imu.temperature.model import Curve
from inercal.systems.imu.temperature.polynomial import powers


def judged_points(curve: Curve, variances: Array, share: float) -> tuple[Finding, ...]:
    """Findings about all that the values (n,) of calibrations show beside a polynomial, such as a jump.

    ``variances`` (n,) are those of each by itself; where they scatter by more, this alone tells the noise. ``share`` of
    the risk, where several values are asked.
    """
    fit = curve.polynomial if curve.branched is None else curve.branched
    d, terms = curve.temperature - fit.reference, fit.terms
    by_value = powers(d, terms)
    beside = curve.rising[:, None][:, : len(fit.coefficients) - terms]
    sigma = np.sqrt(variances)
    size = float(np.abs(d).max()) ** -np.arange(float(terms))
    A = np.hstack([by_value * size, beside]) / sigma[:, None]
    n, dof = len(d), len(d) - A.shape[1]
    wide = dof > 0 and float(np.sum(np.square(fit.residuals / sigma))) > dof
    slope = powers(d, terms)[:, : terms - 1] @ (np.arange(1, terms) * fit.coefficients[1:terms])
    return judge(
        JudgedFit(
            tuple(curve.name + (f"_T{order}" if order else "") for order in range(terms)),
            fit.coefficients[:terms],
            np.sqrt(np.diag(fit.covariance))[:terms],
            (np.linalg.pinv(A) / sigma)[:terms] * size[:, None],
            by_value,
            beside,
            curve.values,
            fit.residuals,
            np.diag(variances),
            np.arange(n),
            np.zeros(n, dtype=np.int64),
            np.arange(n, dtype=float),
            (curve.name,),
            (StatedInput("temperature", d, slope),),
            0.0 if wide else math.inf,
        ),
        share,
    )
