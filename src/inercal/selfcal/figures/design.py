"""The page of a search for a path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.report.coefficients import dots
from inercal.report.courses import path
from inercal.report.html import Picture
from inercal.report.html import page as framed
from inercal.selfcal.figures.facts import facts
from inercal.selfcal.platform.coefficients import shown_units
from inercal.selfcal.platform.rig import JOINTS
from inercal.selfcal.result.tables import bounds_by_path, paths, turns, weak_combinations

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.selfcal.before.path_design import Designed
    from inercal.selfcal.settings import SelfcalSettings


def main(designed: Designed) -> Picture:
    """The main picture: the path found."""
    plan = designed.plan
    return path(
        plan.step * np.arange(len(plan.angles()), dtype=float),
        plan.angles(),
        JOINTS,
        "The path found",
        "Gimbal angles; the background has the colour of the joint that turns: th_x the outer, th_y the inner one, "
        "th_z the platform's.",
    )


def page(designed: Designed, settings: SelfcalSettings, estimate: Estimate) -> str:
    """The report of a search for a path as one self-contained HTML page."""
    bounds, plan = designed.bounds, designed.plan
    units, size = shown_units(len(bounds.names))
    pictures = [
        main(designed),
        dots(
            "Bounds by path",
            "Standard uncertainty of each coefficient at the end of each path, the best that any filter can reach with "
            f"the stated noise and prior; further left is better.{' Bar: the goal.' if settings.goal else ''}",
            bounds.names,
            units,
            {each.name: each.observability.bounds.u / size for each in designed.compare},
            np.array([settings.goal.get(name, np.nan) for name in bounds.names]) / size
            if settings.goal
            else None,
        ),
    ]
    return framed(
        "selfcal.html",
        estimate,
        "A path for self-calibration",
        facts(settings),
        tables=[paths(designed), turns(plan), weak_combinations(bounds)],
        pictures=pictures,
        details=[bounds_by_path(designed)],
    )
