"""A fit of positions as its judge sees it: beside the terms, the joints of the table are inputs."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.judge import asked_of, blind, blind_shares, evidence_of, judge
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.inference.questions import JudgedFit, StatedInput, questions
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
) -> Iterator[Finding]:
    """Findings about all that the readings show beside the terms and the faults that were named, and about what they
    would not show.

    ``values`` (p,) are those of the names in ``scale``.
    """
    named = [fault.fault.columns for fault in examination.significant]
    case = fit_as_judged(means.channels, means.times, fit, scale, values, named, noise_stated)
    found = judge(case)
    yield from found
    if len(case.residuals) <= LIMITS.most_readings and not any(one.code == "row_order" for one in found):
        with contextlib.suppress(np.linalg.LinAlgError):
            of_fit = evidence_of(case)
            pairs = asked_of(of_fit, questions(case)) if of_fit.dof > 0 else []
            yield from blind(case.names, case.u, of_fit, pairs)


def fit_as_judged(
    channels: Sequence[str],
    times: Array,
    fit: Regression,
    scale: Scale,
    values: Array,
    named: Sequence[Array] = (),
    noise_stated: bool = True,
) -> JudgedFit:
    """A fit of readings at ``times`` (n,) with the columns (n, c, m) of faults that are ``named`` beside it."""
    n, c = fit.y.shape
    weight = fit.weights(fit.noise)
    common = weight.common.reshape(n * c, -1)
    covariance = common @ common.T
    for k, block in enumerate(weight.within):
        covariance[k * c : (k + 1) * c, k * c : (k + 1) * c] += block
    return JudgedFit(
        scale.names,
        values,
        scale.u,
        np.einsum("pq,qnc->pnc", scale.slope, fit.gain).reshape(-1, n * c),
        fit.model.rows(fit.angles).reshape(n * c, -1) @ np.linalg.inv(scale.slope),
        np.hstack([fit.effects.free.reshape(n * c, -1), *(part.reshape(n * c, -1) for part in named)]),
        fit.y.reshape(-1),
        fit.residuals.reshape(-1),
        covariance,
        np.repeat(np.arange(n), c),
        np.tile(np.arange(c), n),
        np.repeat(times, c),
        tuple(channels),
        _joints(fit),
        math.inf if noise_stated else 0.0,
    )


def planned_blindness(fit: Regression, slope: Array, u: Array, values: Array) -> dict[str, float]:
    """Share of the faults by order, place, reading and history that positions would hide, of a fit of readings as they
    are expected, in that order; ``slope`` (p, p) of the ``values`` (p,) by the linear coefficients, ``u`` (p,)."""
    if fit.y.size > LIMITS.most_readings:
        return {}
    channels = tuple(block.channel for block in fit.model.channels)
    times = np.arange(len(fit.y), dtype=float)
    return blind_shares(fit_as_judged(channels, times, fit, Scale(fit.model.symbols, slope, u), values))


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
