"""Estimators of one recording side by side: estimates, differences and time of each."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inercal.arrays import Array
from inercal.estimate.rounding import rounded, short
from inercal.estimate.table import Table
from inercal.selfcal.estimators import ESTIMATORS, FilterKind
from inercal.selfcal.filters.filter_result import FilterResult, product_form
from inercal.selfcal.platform.coefficients import names, shown_units


def side_by_side(
    filters: Mapping[FilterKind, FilterResult],
    truth: Array | None,
    interval: float,
    status: Mapping[str, str],
) -> list[Table]:
    """Tables of estimates, of differences or errors, and of verdict and time.

    Parameters
    ----------
    filters : mapping
        Results by name, the one that counts first.
    truth : (p,) or longer, optional
        True coefficients, product form.
    interval : float
        Time from sample to sample [s].
    status : mapping
        Verdict by name, where there is one.
    """
    (_, first), *_ = filters.items()
    p = len(first.coefficients)
    unit, size = shown_units(p)
    by_filter = {kind: product_form(each) for kind, each in filters.items()}
    values, u = product_form(first)
    true = None if truth is None else truth[:p]
    rows = []
    for k, name in enumerate(names(p)):
        true_value = () if true is None else (f"{true[k] / size[k]:.6g}",)
        own = (rounded(c[k] / size[k], u[k] / size[k])[0] for c, _ in by_filter.values())
        rows.append((name, unit[k], *true_value, *own, rounded(values[k] / size[k], u[k] / size[k])[1]))
    heads = [(kind, "") for kind in filters]
    result = [
        Table(
            "Filters side by side",
            f"Estimates of each filter from the same recording; u is that of {first.kind}.",
            (
                ("coefficient", ""),
                ("unit", ""),
                *([] if true is None else [("truth", "")]),
                *heads,
                ("u", ""),
            ),
            tuple(rows),
            2,
        ),
        _apart(by_filter, values, u, true),
    ]
    costs = []
    for kind, each in filters.items():
        apart = np.abs(by_filter[kind][0] - values) / u
        costs.append(
            (
                kind,
                ESTIMATORS[kind].words,
                status.get(kind, "ok" if each.converged else "not converged").replace("_", " "),
                short(each.nis_mean, 3),
                short(float(np.nanmax(apart)) if np.isfinite(apart).any() else np.nan),
                short(each.step_us),
                short(1e-4 * each.step_us / interval),
            )
        )
    trouble = [f"{kind}: {each.message}" for kind, each in filters.items() if each.message]
    result.append(
        Table(
            "Verdict and time of each filter",
            "Mean normalised innovation squared, expected 6 where all six scalars of a row are used; largest "
            f"difference from {first.kind} in its standard uncertainties; time of a row, and its share of the sample "
            f"interval of {interval:.4g} s. " + " ".join(f"{text.rstrip('.')}." for text in trouble),
            (
                ("filter", ""),
                ("", ""),
                ("verdict", ""),
                ("mean NIS", ""),
                ("largest difference", "u"),
                ("time of a row", "µs"),
                ("of the interval", "%"),
            ),
            tuple(costs),
            3,
        )
    )
    return result


def _apart(
    by_filter: Mapping[FilterKind, tuple[Array, Array]], values: Array, u: Array, true: Array | None
) -> Table:
    """Errors in percent of the truth where that is known, else differences from the first in its uncertainties."""
    heads = [(kind, "") for kind in by_filter]
    if true is None:
        rows = [
            (name, *(short(float((c[k] - values[k]) / u[k])) for c, _ in by_filter.values()))
            for k, name in enumerate(names(len(values)))
        ]
        first = next(iter(by_filter))
        title, caption = "Differences between the filters", f"Estimate less that of {first}, over its u."
        return Table(title, caption, (("coefficient", ""), *heads), tuple(rows))
    rows = [
        (
            name,
            *(
                short(float(100.0 * (c[k] - true[k]) / true[k])) if true[k] else "–"
                for c, _ in by_filter.values()
            ),
            short(float(100.0 * u[k] / abs(true[k]))) if true[k] else "–",
        )
        for k, name in enumerate(names(len(values)))
    ]
    return Table(
        "Errors in percent of the truth",
        "(estimate − truth) / truth. The last column is one standard uncertainty, in percent of the truth too.",
        (("coefficient", ""), *heads, ("u", "")),
        tuple(rows),
    )
