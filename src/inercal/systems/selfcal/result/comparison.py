"""Estimators beside the one that counts: their part of a comparison, and a finding where linearisation shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.rotations import boxminus
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters.filter_result import FilterResult, product_form
from inercal.systems.selfcal.limits import LIMITS


def stated_variance(filtered: FilterResult, u: Array) -> Array:
    """Variance (p,) that what is stated with an uncertainty, or not fitted, adds to that of the estimator that counts,
    by the uncertainties ``u`` (p,) of the result; product form."""
    _, own = product_form(filtered)
    return np.asarray(np.maximum(np.square(u) - np.square(own), 0.0))


def with_stated(other: FilterResult, stated: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of an estimator, product form, and u (p,) with the variance that is ``stated`` (p,), none where
    that is empty."""
    values, own = product_form(other)
    return values, np.sqrt(np.square(own) + (stated[: len(own)] if stated.size else 0.0))


def beside(
    other: FilterResult, status: Status, stated: Array, reference: Array | None = None
) -> dict[str, Any]:
    """An estimator's part of a comparison; ``reference`` (n, 4) the true attitude, where known."""
    values, u = with_stated(other, stated)
    each = zip(other.names, values.tolist(), u.tolist(), strict=True)
    return {
        "parameters": {name: {"value": value, "u": own} for name, value, own in each},
        "status": status.value,
        **of_attitude(other, reference),
    }


class AttitudeErrors(NamedTuple):
    """Errors of attitudes against true ones: of the components ``q`` (n, 4), of the sign that is nearer, and ``angle``
    (n,) [rad]."""

    q: Array
    angle: Array

    @property
    def rms(self) -> tuple[Array, float]:
        """Root mean squares of the components (4,) and of the angle [rad]; NaN without any."""
        there = np.isfinite(self.angle)
        if not there.any():
            return np.full(4, np.nan), np.nan
        q, angle = (np.sqrt(np.mean(np.square(each[there]), axis=0)) for each in self)
        return q, float(angle)


def attitude_errors(attitude: Array, reference: Array) -> AttitudeErrors:
    """Errors of attitudes (n, 4) q_bp against the true ones (n, 4); q and -q are one attitude."""
    sign = np.where(np.sum(attitude * reference, axis=1) < 0.0, -1.0, 1.0)
    angle = np.linalg.norm(boxminus(attitude, reference), axis=1)
    return AttitudeErrors(sign[:, None] * attitude - reference, angle)


def of_attitude(filtered: FilterResult, reference: Array | None) -> dict[str, Any]:
    """``reference`` of the JSON result: rms of the components of q, and of the angle [rad]; empty without a true
    attitude."""
    if reference is None or filtered.history is None:
        return {}
    q, angle = attitude_errors(filtered.history.attitude, reference).rms
    return {"reference": {"rms_q": q.tolist(), "rms_rad": angle}}


def differing(filtered: FilterResult, others: Mapping[FilterKind, FilterResult]) -> list[Finding]:
    """``estimators_differ``: the batch estimator, which linearises all rows where it ends, is far from the one that
    counts; not where the two have other states."""
    batch = others.get("map")
    if batch is None or not (batch.converged and filtered.converged):
        return []
    if batch.names != filtered.names:
        return []
    values, u = product_form(filtered)
    apart = np.abs(product_form(batch)[0] - values) / u
    far = np.flatnonzero(apart > LIMITS.estimators_apart)
    if not far.size:
        return []
    worst = int(np.argmax(apart))
    text = (
        f"map, which linearises all rows where it ends, is up to {apart[worst]:.2g} u from {filtered.kind} "
        f"({filtered.names[worst]})"
    )
    harm = tuple(filtered.names[k] for k in far)
    return [Finding("estimators_differ", text, harm=harm, action="take its values, by --filter map")]
