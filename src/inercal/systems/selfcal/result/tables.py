"""Tables of self-calibration: estimators side by side, weak combinations, paths, bounds, errors over many runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import HALF_SEEN, UNSEEN, learned
from inercal.foundation.records.places import counted
from inercal.foundation.results.shown import Table, heads, rounded, short
from inercal.systems.selfcal.estimators import ESTIMATORS, FilterKind
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.platform.coefficients import shown_units
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.result.comparison import attitude_errors, with_stated

if TYPE_CHECKING:
    from inercal.systems.selfcal.before.bounds import PathBounds
    from inercal.systems.selfcal.before.path_design import DesignedPath
    from inercal.systems.selfcal.monte_carlo import Campaign

_WEAKEST = 6
"""Combinations that a page lists, unless more are left at their prior."""

_JOINTS = {"x": "outer", "y": "inner", "z": "platform"}


def side_by_side(
    filters: Mapping[FilterKind, FilterResult],
    stated: Array,
    truth: Array | None,
    interval: float,
    status: Mapping[str, str],
) -> list[Table]:
    """Tables of estimates, of differences or errors, and of verdict and time.

    The filter that counts is the first; ``stated`` (p,) is the variance that what is stated adds to each; ``truth``
    (p,) or longer, product form, where known; ``interval`` [s] from sample to sample; ``status`` the verdicts that
    there are, by name.
    """
    (_, first), *_ = filters.items()
    p = len(first.coefficients)
    units, size = shown_units(first.names)
    by_filter = {kind: _onto(p, *with_stated(each, stated)) for kind, each in filters.items()}
    values, u = with_stated(first, stated)
    true = None if truth is None else truth[:p]
    rows, costs = [], []
    for k, name in enumerate(first.names):
        true_value = () if true is None else (f"{true[k] / size[k]:.6g}",)
        own = (
            rounded(c[k] / size[k], u[k] / size[k])[0] if name in filters[kind].names else "–"
            for kind, (c, _) in by_filter.items()
        )
        last = rounded(values[k] / size[k], u[k] / size[k])[1]
        rows.append((name, units[k], *true_value, *own, last))
    for kind, each in filters.items():
        apart = np.abs(by_filter[kind][0] - values) / u
        verdict = status.get(kind, "ok" if each.converged else "not converged").replace("_", " ")
        largest = float(np.nanmax(apart)) if np.isfinite(apart).any() else np.nan
        times = short(each.step_us), short(1e-4 * each.step_us / interval)
        costs.append((kind, ESTIMATORS[kind].words, verdict, short(each.nis_mean, 3), short(largest), *times))
    trouble = [f"{kind}: {each.message.rstrip('.')}." for kind, each in filters.items() if each.message]
    columns = ("coefficient", "unit", *(() if true is None else ("truth",)), *filters, "u")
    return [
        Table(
            "Filters side by side",
            f"Estimates of each filter from the same recording; u is that of {first.kind}.",
            heads(*columns),
            tuple(rows),
            2,
        ),
        _apart(first.names, by_filter, values, u, true),
        Table(
            "Verdict and time of each filter",
            "Mean normalised innovation squared, expected 6 where all six scalars of a row are used; largest "
            f"difference from {first.kind} in its standard uncertainties; time of a row, and its share of the sample "
            f"interval of {interval:.4g} s. {' '.join(trouble)}",
            heads(
                *("filter", "", "verdict", "mean NIS", "largest difference [u]"),
                *("time of a row [µs]", "of the interval [%]"),
            ),
            tuple(costs),
            3,
        ),
    ]


def _onto(p: int, values: Array, u: Array) -> tuple[Array, Array]:
    """Values and u for the ``p`` coefficients of the estimator that counts, NaN for those that another one lacks."""
    room = np.full(p - len(values), np.nan)
    return np.append(values, room), np.append(u, room)


def of_attitudes(filters: Mapping[FilterKind, FilterResult], reference: Array) -> Table:
    """Errors of the attitude of each filter against the true one (n, 4)."""
    rows = []
    for kind, each in filters.items():
        if each.history is not None:
            q, angle = attitude_errors(each.history.attitude, reference).rms
            arcsec = short(float(np.degrees(angle)) * 3600.0)
            rows.append((kind, *(f"{float(part):.3g}" for part in q), arcsec))
    return Table(
        "Errors of the attitude",
        "Root mean square over all rows of the estimated less the true components of the unit quaternion q_bp, and of "
        "the angle between both. A filter knows the rows up to its own, map all.",
        heads("filter", *(f"q{k}" for k in range(4)), "angle [″]"),
        tuple(rows),
    )


def _apart(
    names: Sequence[str],
    by_filter: Mapping[FilterKind, tuple[Array, Array]],
    values: Array,
    u: Array,
    true: Array | None,
) -> Table:
    """Errors in percent of the truth where that is known, else differences from the first in its uncertainties."""
    named = list(enumerate(names))
    if true is None:
        rows = [
            (name, *(_difference(c[k] - values[k], u[k]) for c, _ in by_filter.values())) for k, name in named
        ]
        caption = f"Estimate less that of {next(iter(by_filter))}, over its u."
        return Table(
            "Differences between the filters", caption, heads("coefficient", *by_filter), tuple(rows)
        )

    def percent(part: Array, k: int) -> str:
        return _difference(100.0 * part[k], abs(true[k])) if true[k] else "–"

    rows = [
        (name, *(percent((c - true) * np.sign(true), k) for c, _ in by_filter.values()), percent(u, k))
        for k, name in named
    ]
    return Table(
        "Errors in percent of the truth",
        "(estimate − truth) / truth. The last column is one standard uncertainty, in percent of the truth too.",
        heads("coefficient", *by_filter, "u"),
        tuple(rows),
    )


def _difference(difference: float, size: float) -> str:
    """A difference over a size; a dash where a filter does not have the coefficient."""
    return "–" if np.isnan(difference) else short(float(difference / size))


def weak_combinations(bounds: PathBounds) -> Table:
    """Combinations of coefficients that a path shows least, in words, each in units of its prior."""
    weak = learned(bounds.covariance, bounds.prior, bounds.names)
    unseen = int((weak.left > HALF_SEEN).sum())
    count = max(unseen, min(_WEAKEST, len(weak.left)))
    rows = []
    for words, left in zip(weak.weakest(count), weak.left, strict=False):
        remark = "not seen" if left > UNSEEN else "left at its prior" if left > HALF_SEEN else ""
        rows.append((words, remark, short(100.0 * float(left))))
    what = "No combination is left at its prior; these are the least known."
    if unseen:
        many = f"{counted(unseen, 'independent combination')} of {len(weak.left)}"
        what = f"{many} {'keep' if unseen > 1 else 'keeps'} more than half of the prior."
    return Table(
        "What the path cannot see",
        f"{what} Combinations are sums of coefficients, each over its prior standard deviation; the last column is "
        "how much of the prior uncertainty of the combination the path leaves.",
        heads("combination", "", "of the prior [%]"),
        tuple(rows),
        2,
    )


def turns(plan: PlatformPlan) -> Table:
    """The moves of a plan, with the angles and the time at which each ends."""
    at, clock, rows = np.array(plan.start), 0.0, []
    for number, move in enumerate(plan.moves, start=1):
        lasts = plan.steps(move) * plan.step
        clock += lasts
        words, by, rate = "rest", "", ""
        if isinstance(move, Turn):
            at = at + np.where(np.array(["x", "y", "z"]) == move.joint, move.angle, 0.0)
            words = f"th_{move.joint} ({_JOINTS[move.joint]})"
            by, rate = f"{np.degrees(move.angle):+.4g}", f"{np.degrees(abs(move.angle)) / lasts:.4g}"
        ends = (f"{angle:.4g}" for angle in np.degrees(at) + 0.0)
        rows.append((str(number), words, by, rate, f"{lasts:.4g}", f"{clock:.5g}", *ends))
    return Table(
        "Turns",
        "Gimbal angles and time are those at the end of each move.",
        heads(
            *("no.", "joint", "by [°]", "rate [°/s]", "lasts [s]", "ends at [s]"),
            *("th_x [°]", "th_y [°]", "th_z [°]"),
        ),
        tuple(rows),
        2,
    )


def paths(designed: DesignedPath) -> Table:
    """The path found beside others of the same time."""
    rows, robust = [], any(each.unmodelled for each in designed.compare)
    for each in designed.compare:
        learned = each.observability.learned
        worst = int(np.argmax(learned.ratio))
        texts = [", ".join(each.observability.at_prior) or "none", ", ".join(each.beyond) or "none"]
        rows.append(
            (
                each.name,
                each.plan.words(),
                *texts,
                *([each.worst_shift()] if robust else []),
                f"{each.plan.duration:.6g}",
                f"{each.observability.rank} of {len(learned.left)}",
                f"{short(100.0 * float(learned.ratio[worst]))} ({learned.names[worst]})",
                short(each.criterion),
            )
        )
    of_errors = " Errors left out: their largest shift, which counts in the criterion." if robust else ""
    return Table(
        "Comparison of paths",
        "Left at prior: coefficients of whose prior uncertainty more than half remains. Beyond: limits that the "
        f"path breaks.{of_errors} Rank: combinations of coefficients of which the path tells something. Largest u: "
        "the coefficient least known, over its prior. The search makes the criterion small.",
        heads(
            *("path", "turns", "left at prior", "beyond", *(["errors left out"] if robust else [])),
            *("time [s]", "rank", "largest u [% of prior]", "criterion"),
        ),
        tuple(rows),
        5 if robust else 4,
    )


def bounds_by_path(designed: DesignedPath) -> Table:
    """Bounds of every path, in units of the field."""
    bounds, first = [each.observability.bounds for each in designed.compare], designed.compare[0]
    units, size = shown_units(bounds[0].names)
    to_goal = first.observability.to_goal
    rows = [
        (
            name,
            units[k],
            *(short(float(each.u[k] / size[k])) for each in bounds),
            f"{bounds[0].prior[k] / size[k]:.4g}",
            *((short(to_goal.get(name, np.nan)),) if to_goal else ()),
        )
        for k, name in enumerate(bounds[0].names)
    ]
    wanted = f" Of goal: the bound of the path {first.name} over the goal, met up to 1." if to_goal else ""
    plans = [each.name for each in designed.compare]
    return Table(
        "Bounds",
        "Cramér-Rao bounds of the standard uncertainties at the end of each path, with the stated noise and prior."
        f"{wanted}",
        heads("coefficient", "unit", *plans, "prior", *(["of goal"] if to_goal else [])),
        tuple(rows),
        2,
    )


def campaign_table(campaign: Campaign) -> Table:
    """Errors of each coefficient over many simulated runs."""
    units, size = shown_units(campaign.names)
    coverage, rms = campaign.coverage, np.sqrt(np.mean(np.square(campaign.error), axis=0))
    sizes = np.array([campaign.error.mean(axis=0), rms, campaign.bound]) / size
    rows = [
        (
            name,
            units[k],
            *(short(float(each)) for each in sizes[:, k]),
            f"{campaign.rms_over_bound[k]:.3f}",
            f"{coverage.rms[k]:.3f}",
            f"{100.0 * coverage.fraction[k]:.1f}",
        )
        for k, name in enumerate(campaign.names)
    ]
    low, high = (100.0 * limit for limit in coverage.limits)
    return Table(
        "Errors of the coefficients",
        "Estimate less truth over all runs: its mean and root mean square, the Cramér-Rao bound, and the share of "
        f"runs whose interval for {100.0 * coverage.level:g} % held the truth, by chance {low:.1f} to "
        f"{high:.1f} %. More is harmless: the uncertainties are then rather too large.",
        heads(
            *("coefficient", "unit", "mean error", "rms error", "bound"),
            *("rms / bound", "rms of error / u", "covered [%]"),
        ),
        tuple(rows),
        2,
    )
