"""The tare: errors of the sensors as wind-off runs found them, interpolated to the runs between.

At a wind-off the fusion takes the known angle as measured, and learns the biases at it. Of two wind-offs with the
coefficients x_1, P_1 and x_2, P_2 a run at the part f of the time between has

    x = (1 - f) x_1 + f x_2        P = (1 - f) P_1 + f P_2 + f (1 - f) d d^T      d = x_2 - x_1

The first two terms are the largest that covariance can be, whatever the two wind-offs have in common (the angle, the
prior), for they exceed it by f (1 - f) cov(d); the third is the variance of a random walk that goes from x_1 to x_2,
whose variance in all that time is estimated by d d^T itself. Before the first wind-off and after the last the nearest
one holds, and the same walk goes on from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import shown_unit, term
from inercal.systems.aoa.limits import LIMITS

Posterior: TypeAlias = tuple[Mapping[str, float], Mapping[tuple[str, str], float]]
"""Values of coefficients by name, and their covariances by pairs of names."""


@dataclass(frozen=True, eq=False)
class WindOff:
    """Coefficients found at a wind-off ``at`` a time [s or rows]: ``names`` (p,), ``values`` (p,), ``covariance`` (p,
    p), and the ``label`` of its run."""

    at: float
    label: str
    names: tuple[str, ...]
    values: Array
    covariance: Array


def interpolated(tares: Sequence[WindOff], at: float) -> tuple[Posterior, str]:
    """The coefficients at a time, and in words from which wind-offs they are."""
    before = max((each for each in tares if each.at <= at), key=lambda each: each.at, default=None)
    after = min((each for each in tares if each.at > at), key=lambda each: each.at, default=None)
    if before is not None and after is not None:
        f = (at - before.at) / (after.at - before.at)
        d = after.values - before.values
        values = before.values + f * d
        covariance = (1.0 - f) * before.covariance + f * after.covariance + f * (1.0 - f) * np.outer(d, d)
        return _posterior(before.names, values, covariance), f"{before.label} and {after.label}"
    nearest = before if after is None else after
    assert nearest is not None
    covariance = nearest.covariance
    if len(tares) > 1:
        in_time = sorted(tares, key=lambda each: each.at)
        pair = (in_time[-2], in_time[-1]) if after is None else (in_time[0], in_time[1])
        d = pair[1].values - pair[0].values
        covariance = covariance + abs(at - nearest.at) / (pair[1].at - pair[0].at) * np.outer(d, d)
    return _posterior(nearest.names, nearest.values, covariance), nearest.label


def _posterior(names: Sequence[str], values: Array, covariance: Array) -> Posterior:
    """Coefficients as `inercal.systems.aoa.fusion.problem.problem` takes them."""
    by_pair = {(a, b): float(covariance[i, j]) for i, a in enumerate(names) for j, b in enumerate(names)}
    return dict(zip(names, values.tolist(), strict=True)), by_pair


def drifts(tares: Sequence[WindOff]) -> list[Finding]:
    """``bias_drift``: biases that moved between two wind-offs by more than their uncertainty; they are interpolated."""
    found = []
    for first, second in pairwise(tares):
        u = np.sqrt(np.diag(first.covariance) + np.diag(second.covariance))
        for k, name in enumerate(first.names):
            d = float(second.values[k] - first.values[k])
            if not name.startswith("b_") or not abs(d) > LIMITS.disagreeing_sigmas * u[k]:
                continue
            of = term(name)
            assert of is not None
            unit, size = shown_unit(of.unit)
            text = (
                f"{name}: {d / size:+.3g} {unit} from {first.label} to {second.label}: the tare is interpolated, and u "
                "has the walk between"
            )
            found.append(Finding("bias_drift", text, harm=()))
    return found
