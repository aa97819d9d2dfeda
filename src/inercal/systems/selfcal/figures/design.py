"""The page of a search for a path, and the facts of a study on any page of simulated self-calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import dots
from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as framed
from inercal.faces.report.style import plain_unit
from inercal.foundation.instruments.terms import shown_unit
from inercal.systems.selfcal.figures.filters import path_of
from inercal.systems.selfcal.platform.coefficients import shown_units
from inercal.systems.selfcal.result.tables import bounds_by_path, paths, turns, weak_combinations

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.selfcal.before.path_design import DesignedPath
    from inercal.systems.selfcal.settings import SelfcalSettings


def main(designed: DesignedPath) -> Picture:
    """The main picture: the path found."""
    plan = designed.plan
    angles = plan.angles()
    t = plan.step * np.arange(len(angles), dtype=float)
    return path_of(t, angles, "The path found", "Gimbal angles")


def page(designed: DesignedPath, settings: SelfcalSettings, estimate: Estimate) -> str:
    """The report of a search for a path as one self-contained HTML page."""
    bounds, plan = designed.bounds, designed.plan
    units, size = shown_units(bounds.names)
    goal = np.array([settings.goal.get(name, np.nan) for name in bounds.names]) / size
    pictures = [
        main(designed),
        dots(
            "Bounds by path",
            "Standard uncertainty of each coefficient at the end of each path, the best that any filter can reach with "
            f"the stated noise and prior; further left is better.{' Bar: the goal.' if settings.goal else ''}",
            bounds.names,
            units,
            {each.name: each.observability.bounds.u / size for each in designed.compare},
            goal if settings.goal else None,
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


def facts(settings: SelfcalSettings) -> list[tuple[str, str, str]]:
    """Site, noise and path, as name, unit and text."""
    noise, site = settings.noise, settings.site

    def row(name: str, value: float, si: str) -> tuple[str, str, str]:
        unit, size = shown_unit(si)
        return name, plain_unit(unit), f"{value / size:.3g}"

    rows = [
        ("gravity", plain_unit("m/s^2"), f"{site.gravity:.7g}"),
        row("angle random walk", noise.angle_random_walk, "rad/sqrt(s)"),
        row("noise of an accelerometer's sample", noise.accelerometer, "m/s^2"),
        row("noise of an encoder's sample", noise.encoder, "rad"),
    ]
    if site.latitude is not None:
        rows.insert(0, ("latitude", "°", f"{np.degrees(site.latitude):.6g}"))
    if settings.plan is not None:
        rows.append(("path of the study", "", settings.plan.words()))
    return rows
