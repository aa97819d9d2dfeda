"""A fit of positions as its judge sees it: beside the terms, the joints of the table are inputs."""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.judge import judge
from inercal.foundation.inference.questions import JudgedFit, StatedInput
from inercal.systems.turntable.positions.examination import Examination
from inercal.systems.turntable.positions.shifts import Scale
from inercal.systems.turntable.readings import Readings
from inercal.systems.turntable.regression import Regression

_STEP = 1e-6
"""Step of a joint [rad] for the derivative of the readings."""


def judged_positions(
    means: Readings,
    fit: Regression,
    scale: Scale,
    values: Array,
    examination: Examination,
    noise_stated: bool,
) -> tuple[Finding, ...]:
    """Findings about all that the readings show beside the terms and the faults that were named.

    ``values`` (p,) are those of the names in ``scale``.
    """
    n, c = fit.y.shape
    weight = fit.weights(fit.noise)
    common = weight.common.reshape(n * c, -1)
    covariance = common @ common.T
    for k, block in enumerate(weight.within):
        covariance[k * c : (k + 1) * c, k * c : (k + 1) * c] += block
    named = [fault.fault.columns.reshape(n * c, -1) for fault in examination.significant]
    return judge(
        JudgedFit(
            scale.names,
            values,
            scale.u,
            np.einsum("pq,qnc->pnc", scale.slope, fit.gain).reshape(-1, n * c),
            fit.model.rows(fit.angles).reshape(n * c, -1) @ np.linalg.inv(scale.slope),
            np.hstack([fit.effects.free.reshape(n * c, -1), *named]),
            fit.y.reshape(-1),
            fit.residuals.reshape(-1),
            covariance,
            np.repeat(np.arange(n), c),
            np.tile(np.arange(c), n),
            np.repeat(means.times, c),
            tuple(means.channels),
            _joints(fit),
            math.inf if noise_stated else 0.0,
        )
    )


def _joints(fit: Regression) -> tuple[StatedInput, ...]:
    """The joints that move, as inputs."""
    c = fit.y.shape[1]
    made = []
    for k, name in enumerate(fit.model.chain.joints):
        if not np.ptp(fit.angles[:, k]):
            continue
        step = _STEP * np.eye(fit.angles.shape[1])[k]
        ends = [fit.model.outputs(fit.angles + sign * step, fit.c) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1]) / (2.0 * _STEP)
        made.append(StatedInput(name, np.repeat(fit.angles[:, k], c), slope.reshape(-1), 2.0 * math.pi))
    return tuple(made)
