"""A self-calibration for people: coefficients in units of the field, and filters side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from inercal.estimate.result import Estimate, in_degrees, rounded
from inercal.estimate.table import Table
from inercal.selfcal.coefficients import names, product_slope, to_product, units
from inercal.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from inercal.selfcal.filtered import Filtered
    from inercal.selfcal.task import Calibration

Array = NDArray[np.float64]

#: key of the statistics -> in words
_STATISTICS = {
    "residual_rms": "root-mean-square normalised innovation, expected 1",
    "chi2": "normalised innovations squared, summed",
    "nis_mean": "normalised innovation squared of a row (NIS), mean",
    "nis_expected": "NIS, expected",
    "nis_limit": "NIS, largest mean of a recording that fits the model",
    "steps": "steps from row to row",
}

FILTERS: Final[Mapping[str, str]] = {
    "error-state": "error-state filter",
    "mukf": "multiplicative sigma-point filter",
    "svd-qukf": "quaternion sigma-point filter",
    "gimbal-ukf": "gimbal-angle sigma-point filter",
    "map": "batch, largest posterior",
    "lm": "batch, Levenberg-Marquardt",
}
"""Estimators in words."""

#: SI unit -> that of the field, and how many of the old it is
_OF_FIELD = {
    "rad/s": ("deg/h", np.radians(1.0 / 3600.0)),
    "rad": ("arcsec", np.radians(1.0 / 3600.0)),
    "m/s^2": ("ug", 1e-6 * STANDARD_GRAVITY),
    "1": ("ppm", 1e-6),
    "rad/sqrt(s)": ("deg/sqrt(h)", np.radians(1.0 / 60.0)),
}


def shown_unit(si: str) -> tuple[str, float]:
    """A unit for people, and how many of the old it is: deg/h, arcsec, ug, ppm, deg/sqrt(h); others stay."""
    return _OF_FIELD.get(si, (si, 1.0))


def of_field(p: int) -> tuple[tuple[str, ...], Array]:
    """Units of the first ``p`` coefficients for people, and how many SI units (p,) each is."""
    shown = [shown_unit(unit) for unit in units(p)]
    return tuple(unit for unit, _ in shown), np.array([size for _, size in shown])


def displayed(estimate: Estimate) -> Estimate:
    """The estimate with coefficients and budget in units of the field, angles of the conditions in degrees, and keys
    of the statistics in words.

    What has unit 1 in the budget, and all of ``result``, stays as it is.
    """
    return replace(
        estimate.in_units([shown_unit(unit) for unit in estimate.units]),
        conditions=in_degrees(estimate.conditions),
        statistics=_in_words(estimate),
        budget=tuple(
            replace(item, u=item.u / size, unit=unit)
            for item in estimate.budget
            for unit, size in [(item.unit, 1.0) if item.unit == "1" else shown_unit(item.unit)]
        ),
    )


def _in_words(estimate: Estimate) -> dict[str, float]:
    """Statistics under keys for people, and what a row cost."""
    told = {_STATISTICS.get(key, key): value for key, value in estimate.statistics.items()}
    if "step_us" in estimate.result:
        told["time of a row_us"] = estimate.result["step_us"]
        told["time of a row, of the sample interval_percent"] = 100.0 * estimate.result["sample_share"]
    return told


def found(filtered: Filtered) -> tuple[Array, Array]:
    """Coefficients (p,) of an estimator and their standard uncertainties (p,), product form."""
    slope = product_slope(filtered.coefficients)
    variances = np.diag(slope @ filtered.covariance @ slope.T)
    return to_product(filtered.coefficients), np.sqrt(np.where(variances > 0.0, variances, np.nan))


def compared(calibration: Calibration) -> list[Table]:
    """`side_by_side` of a calibration, the estimator that counts first; nothing where no other was run."""
    if not calibration.compared:
        return []
    estimate, first = calibration.estimate, calibration.filtered
    status = {kind: str(each["status"]) for kind, each in estimate.result.get("compare", {}).items()}
    filters = {first.kind: first} | dict(calibration.compared)
    interval = float(np.median(calibration.recording.dt))
    return side_by_side(filters, calibration.truth, interval, status | {first.kind: estimate.status.value})


def side_by_side(
    filters: Mapping[str, Filtered], truth: Array | None, interval: float, status: Mapping[str, str]
) -> list[Table]:
    """All estimators of one recording: what they found, how far it is off, and what they cost.

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
    unit, size = of_field(p)
    by_filter = {kind: found(each) for kind, each in filters.items()}
    values, u = found(first)
    true = None if truth is None else truth[:p]
    rows = []
    for k, name in enumerate(names(p)):
        stated = () if true is None else (f"{true[k] / size[k]:.6g}",)
        own = (rounded(c[k] / size[k], u[k] / size[k])[0] for c, _ in by_filter.values())
        rows.append((name, unit[k], *stated, *own, rounded(values[k] / size[k], u[k] / size[k])[1]))
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
                FILTERS.get(kind, ""),
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
    by_filter: Mapping[str, tuple[Array, Array]], values: Array, u: Array, true: Array | None
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


def short(value: float, digits: int = 2) -> str:
    """A number to so many digits after the first; a dash where there is none."""
    if not np.isfinite(value):
        return "–"
    if value and not 1e-4 <= abs(value) < 1e5:
        return f"{value:.1e}"
    return f"{value:.{digits + 1}g}" if abs(value) < 10 ** (digits + 1) else f"{value:.0f}"
