"""Fits of a rate test as their judge sees them: a cubic and hysteresis are the gyro's own, the rate is the input."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.judge import gross, judge
from inercal.foundation.inference.questions import JudgedFit, StatedInput
from inercal.systems.turntable.rate.fit import GyroRateFit, approaches, columns, symbols, weights_of
from inercal.systems.turntable.rate.stays import Input, RateDwells


def judged_rates(
    dwells: RateDwells, inputs: Sequence[Input], fits: Sequence[GyroRateFit], u: Array
) -> tuple[tuple[Finding, ...], str]:
    """Findings about all that the stays show beside the terms of each gyro, and a sentence where nothing can be used.

    ``u`` (p,) are those of the values of all fits. Gyros that several axes turn are not asked yet: each attitude has a
    bias of its own.
    """
    ends = np.cumsum([len(fit.names) for fit in fits])[:-1]
    findings: list[Finding] = []
    excess = ""
    for given, fit, of_fit in zip(inputs, fits, np.split(u, ends), strict=True):
        if len(fit.stays) < len(dwells.rate) or f"S_{fit.axis}" not in fit.names:
            continue
        case = _fitted(dwells, given, fit, of_fit)
        found = judge(case, 1.0 / len(fits))
        findings += found
        if times := gross(case):
            excess = excess or (
                f"gyro_{fit.axis} misses a cubic by {times:.2g} times what the stated noise and the table explain: "
                "check rates, order of the rows and units"
            )
    return tuple(findings), excess


def _fitted(dwells: RateDwells, given: Input, fit: GyroRateFit, u: Array) -> JudgedFit:
    """One gyro's fit."""
    n = len(dwells.rate)
    weight = weights_of(given.effects, fit.scale, n)
    common = weight.common[:, 0]
    covariance = common @ common.T + np.diag(weight.within[:, 0, 0] + fit.noise**2)
    cubic = dict(zip(symbols(fit.axis, 3, True), columns(given.x, 3, True).T, strict=True))
    none = np.zeros(n)
    return JudgedFit(
        fit.names,
        fit.values,
        u,
        fit.gain,
        np.stack([fit.scale * cubic.get(name, none) for name in fit.names], axis=1),
        np.column_stack([*cubic.values(), approaches(dwells.rate)]),
        dwells.y[:, dwells.channels.index(f"gyro_{fit.axis}")],
        fit.residuals,
        covariance,
        np.arange(n),
        np.zeros(n, dtype=np.int64),
        np.arange(n, dtype=float),
        (f"gyro_{fit.axis}",),
        (StatedInput("rate", given.x, np.full(n, fit.scale)),),
        math.inf if math.isinf(fit.noise_dof) else 0.0,
    )
