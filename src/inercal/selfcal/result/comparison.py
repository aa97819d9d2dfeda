"""Estimators beside the one that counts: their part of a comparison, and a finding where linearisation shows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inercal.arrays import Array
from inercal.findings import Finding, Status
from inercal.selfcal.estimators import FilterKind
from inercal.selfcal.filters.filter_result import FilterResult, product_form
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.coefficients import names


def stated_variance(filtered: FilterResult, u: Array) -> Array:
    """Variance (p,) that what is stated with an uncertainty adds to that of the estimator that counts, by the
    uncertainties ``u`` (p,) of the result; product form."""
    _, own = product_form(filtered)
    return np.maximum(np.square(u) - np.square(own), 0.0)


def with_stated(other: FilterResult, stated: Array) -> tuple[Array, Array]:
    """Coefficients (p,) of an estimator, product form, and u (p,) with the variance that is ``stated`` (p,)."""
    values, own = product_form(other)
    return values, np.sqrt(np.square(own) + stated[: len(own)])


def beside(other: FilterResult, status: Status, stated: Array) -> dict[str, Any]:
    """An estimator's part of a comparison."""
    values, u = with_stated(other, stated)
    each = zip(names(len(values)), values.tolist(), u.tolist(), strict=True)
    return {
        "parameters": {name: {"value": value, "u": own} for name, value, own in each},
        "status": status.value,
        "step_us": other.step_us,
    }


def differing(filtered: FilterResult, others: Mapping[FilterKind, FilterResult]) -> list[Finding]:
    """``estimators_differ``: the batch estimator, which linearises all rows where it ends, is far from the one that
    counts. Not of ``lm``, which weighs the noise of the gyros otherwise, and says so by its u."""
    batch = others.get("map")
    if batch is None or not (batch.converged and filtered.converged) or filtered.kind == "lm":
        return []
    values, u = product_form(filtered)
    p = min(len(values), len(batch.coefficients))
    apart = np.abs(product_form(batch)[0][:p] - values[:p]) / u[:p]
    far = np.flatnonzero(apart > LIMITS.estimators_apart)
    if not far.size:
        return []
    worst = int(np.argmax(apart))
    text = (
        f"map, which linearises all rows where it ends, is up to {apart[worst]:.2g} u from {filtered.kind} "
        f"({names(p)[worst]}): take its values, by --filter map"
    )
    return [Finding("estimators_differ", text, harm=tuple(names(p)[k] for k in far))]
