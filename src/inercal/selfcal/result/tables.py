"""Tables of paths and campaigns: weak combinations, turns, bounds, errors over many runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.estimate.identifiability import HALF_SEEN, UNSEEN, learned
from inercal.estimate.rounding import short
from inercal.estimate.table import Table
from inercal.records.places import counted
from inercal.selfcal.platform.coefficients import shown_units
from inercal.selfcal.platform.plan import Plan, Turn

if TYPE_CHECKING:
    from inercal.selfcal.before.bounds import PathBounds
    from inercal.selfcal.before.path_design import Designed
    from inercal.selfcal.monte_carlo import Campaign

_WEAKEST = 6
"""Combinations that a page lists, unless more are left at their prior."""

_JOINTS = {"x": "outer", "y": "inner", "z": "platform"}


def weak_combinations(bounds: PathBounds) -> Table:
    """Combinations of coefficients that a path shows least, in words, each in units of its prior."""
    weak = learned(bounds.covariance, bounds.prior, bounds.names)
    unseen = int((weak.left > HALF_SEEN).sum())
    count = max(unseen, min(_WEAKEST, len(weak.left)))
    rows = tuple(
        (
            words,
            "not seen" if left > UNSEEN else "left at its prior" if left > HALF_SEEN else "",
            short(100.0 * float(left)),
        )
        for words, left in zip(weak.weakest(count), weak.left, strict=False)
    )
    what = (
        f"{counted(unseen, 'independent combination')} of {len(weak.left)} {'keep' if unseen > 1 else 'keeps'} more "
        "than half of the prior."
        if unseen
        else "No combination is left at its prior; these are the least known."
    )
    return Table(
        "What the path cannot see",
        f"{what} Combinations are sums of coefficients, each over its prior standard deviation; the last column is "
        "how much of the prior uncertainty of the combination the path leaves.",
        (("combination", ""), ("", ""), ("of the prior", "%")),
        rows,
        2,
    )


def turns(plan: Plan) -> Table:
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
        rows.append(
            (
                str(number),
                words,
                by,
                rate,
                f"{lasts:.4g}",
                f"{clock:.5g}",
                *(f"{a:.4g}" for a in np.degrees(at) + 0.0),
            )
        )
    return Table(
        "Turns",
        "Gimbal angles and time are those at the end of each move.",
        (
            ("no.", ""),
            ("joint", ""),
            ("by", "°"),
            ("rate", "°/s"),
            ("lasts", "s"),
            ("ends at", "s"),
            ("th_x", "°"),
            ("th_y", "°"),
            ("th_z", "°"),
        ),
        tuple(rows),
        2,
    )


def paths(designed: Designed) -> Table:
    """The path found beside others of the same time."""
    rows = []
    for each in designed.compare:
        learned = each.observability.learned
        worst = int(np.argmax(learned.ratio))
        rows.append(
            (
                each.name,
                each.plan.words(),
                ", ".join(each.observability.at_prior) or "none",
                ", ".join(each.beyond) or "none",
                f"{each.plan.duration:.6g}",
                f"{each.observability.rank} of {len(learned.left)}",
                f"{short(100.0 * float(learned.ratio[worst]))} ({learned.names[worst]})",
                short(each.criterion),
            )
        )
    return Table(
        "Comparison of paths",
        "Left at prior: coefficients of whose prior uncertainty more than half remains. Beyond: gimbals that the path "
        "takes beyond their limits. Rank: combinations of coefficients of which the path tells something. Largest u: "
        "the coefficient least known, over its prior. The search makes the criterion small.",
        (
            ("path", ""),
            ("turns", ""),
            ("left at prior", ""),
            ("beyond", ""),
            ("time", "s"),
            ("rank", ""),
            ("largest u", "% of prior"),
            ("criterion", ""),
        ),
        tuple(rows),
        4,
    )


def bounds_by_path(designed: Designed) -> Table:
    """Bounds of every path, in units of the field."""
    bounds = [each.observability.bounds for each in designed.compare]
    units, size = shown_units(len(bounds[0].names))
    first = designed.compare[0]
    to_goal = first.observability.to_goal

    def of_goal(name: str) -> tuple[str, ...]:
        return (short(to_goal.get(name, np.nan)),) if to_goal else ()

    rows = tuple(
        (
            name,
            units[k],
            *(short(float(each.u[k] / size[k])) for each in bounds),
            f"{bounds[0].prior[k] / size[k]:.4g}",
            *of_goal(name),
        )
        for k, name in enumerate(bounds[0].names)
    )
    wanted = f" Of goal: the bound of the path {first.name} over the goal, met up to 1." if to_goal else ""
    return Table(
        "Bounds",
        "Cramér-Rao bounds of the standard uncertainties at the end of each path, with the stated noise and prior."
        f"{wanted}",
        (
            ("coefficient", ""),
            ("unit", ""),
            *((each.name, "") for each in designed.compare),
            ("prior", ""),
            *([("of goal", "")] if to_goal else []),
        ),
        rows,
        2,
    )


def campaign_table(campaign: Campaign) -> Table:
    """Errors of each coefficient over many simulated runs."""
    units, size = shown_units(len(campaign.names))
    coverage, rms = campaign.coverage, np.sqrt(np.mean(np.square(campaign.error), axis=0))
    rows = tuple(
        (
            name,
            units[k],
            short(float(campaign.error[:, k].mean() / size[k])),
            short(float(rms[k] / size[k])),
            short(float(campaign.bound[k] / size[k])),
            f"{campaign.rms_over_bound[k]:.3f}",
            f"{coverage.rms[k]:.3f}",
            f"{100.0 * coverage.fraction[k]:.1f}",
        )
        for k, name in enumerate(campaign.names)
    )
    low, high = (100.0 * limit for limit in coverage.limits)
    return Table(
        "Errors of the coefficients",
        "Estimate less truth over all runs: its mean and root mean square, the Cramér-Rao bound, and the share of "
        f"runs whose interval for {100.0 * coverage.level:g} % held the truth, by chance {low:.1f} to "
        f"{high:.1f} %. More is harmless: the uncertainties are then rather too large.",
        (
            ("coefficient", ""),
            ("unit", ""),
            ("mean error", ""),
            ("rms error", ""),
            ("bound", ""),
            ("rms / bound", ""),
            ("rms of error / u", ""),
            ("covered", "%"),
        ),
        rows,
        2,
    )
