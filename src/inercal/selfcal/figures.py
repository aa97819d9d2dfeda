"""Pictures and pages of self-calibration: a calibration, filters beside each other, a path, a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from inercal.arrays import Array
from inercal.geometry.rotations import boxminus
from inercal.instruments.terms import shown_unit
from inercal.report import filtering
from inercal.report.figures import budget, correlation, dots
from inercal.report.histories import Course, Line, converging, falling, lines_by_group, path
from inercal.report.html import Picture, page, render
from inercal.report.selfcal import attitude_correction, attitude_errors, bounds_beside, filters_apart
from inercal.selfcal.display import of_field
from inercal.selfcal.filters.filter_result import found
from inercal.selfcal.filters.residuals import gimbals
from inercal.selfcal.platform.coefficients import ETA, KA0, names, product_slope, to_linear, to_product
from inercal.selfcal.platform.rig import JOINTS
from inercal.selfcal.result.comparison import FILTERS
from inercal.selfcal.result.tables import bounds_by_path, campaign_table, paths, turns, weak_combinations
from inercal.selfcal.task import compared

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.selfcal.before.path_design import Designed
    from inercal.selfcal.campaign import Campaign
    from inercal.selfcal.filters.filter_result import Filtered, History
    from inercal.selfcal.settings import SelfcalSettings
    from inercal.selfcal.task import Calibration


_AT_ONCE = ("map", "lm")
"""Estimators that know all at once: their coefficients have no course over time."""

_CHANNELS = ("acc x", "acc y", "acc z")


def calibration_page(calibration: Calibration, settings: SelfcalSettings) -> str:
    """The report of a self-calibration as one self-contained HTML page, with or without other filters."""
    estimate = calibration.estimate.shown()
    tables = [*compared(calibration), weak_combinations(calibration.bounds)]
    drawn = pictures(calibration, settings) + compare_pictures(calibration)
    return render(estimate, drawn, "Self-calibration of a platform", tables)


def pictures(
    calibration: Calibration, settings: SelfcalSettings, attitude: Array | None = None
) -> list[Picture]:
    """Draw what there is to see of a calibration.

    Parameters
    ----------
    calibration : Calibration
        Of any status.
    settings : SelfcalSettings
        Of its study.
    attitude : (n, 4), optional
        True ``q_bp`` at each row, of a simulation; without it the attitude is drawn against the encoders'.
    """
    recording, filtered, estimate = (
        calibration.recording,
        calibration.filtered,
        calibration.estimate.shown(),
    )
    t, history = recording.t, filtered.history
    drawn = [
        path(
            t,
            recording.th,
            JOINTS,
            "The path",
            "Gimbal angles that the encoders read; the background has the colour of the joint that turns: th_x the "
            "outer, th_y the inner one, th_z the platform's.",
        )
    ]
    if history is not None:
        if filtered.kind not in _AT_ONCE:
            drawn += convergence(calibration)
        drawn.append(_attitude(calibration, history, attitude))
        if filtered.kind not in _AT_ONCE:
            drawn.append(relative_errors(t, history, calibration.truth))
    drawn.append(filtering.nis(t[1:], filtered.nis, filtered.dims))
    if len(filtered.innovations):
        last = JOINTS if filtered.kind == "gimbal-ukf" else tuple(f"attitude {axis}" for axis in "XYZ")
        drawn.append(filtering.innovations(t[1:], filtered.innovations, (*_CHANNELS, *last)))
    if estimate.names:
        drawn += [_bounds(calibration, settings), correlation(estimate)]
        drawn += [budget(estimate)] if estimate.budget else []
    return drawn


def compare_pictures(calibration: Calibration) -> list[Picture]:
    """How far the other filters are from the one that counts; nothing where there are none."""
    filters = _all(calibration)
    if len(filters) < 2:
        return []
    values, u = found(calibration.filtered)
    apart = {
        kind: (found(each)[0] - values) / u
        for kind, each in filters.items()
        if kind != calibration.filtered.kind
    }
    return [filters_apart(names(len(values)), apart, calibration.filtered.kind)]


def convergence(calibration: Calibration) -> list[Picture]:
    """Coefficients with their bands, and how their uncertainties fall, over time: in the linear form of the filters,
    as a history knows nothing of the correlation between eta and ka1."""
    history, bounds, t = calibration.filtered.history, calibration.bounds, calibration.recording.t
    assert history is not None
    values, p = history.coefficients, history.coefficients.shape[1]
    truth = None if calibration.truth is None else to_linear(calibration.truth[:p])
    to_filter = np.linalg.inv(product_slope(calibration.filtered.coefficients))
    bound = np.sqrt(np.diag(to_filter @ bounds.covariance @ to_filter.T))
    units, size = of_field(p)
    courses = [
        Course(
            name,
            units[k],
            values[:, k] / size[k],
            history.u[:, k] / size[k],
            float(bounds.prior[k] / size[k]),
            None if truth is None else float(truth[k] / size[k]),
            float(bound[k] / size[k]),
        )
        for k, name in enumerate(names(p))
    ]
    form = " Misalignments eta as filters know them, (1 + ka1) eta; the table of coefficients has eta itself."
    dotted = " Red dots: the truth." if calibration.truth is not None else ""
    return [
        converging(
            "Convergence of the coefficients",
            "Estimates as the platform turns, with bands of ± two standard uncertainties; above each its last value "
            "with its standard uncertainty u. Bar at the start: the prior, ± two standard deviations about 0."
            f"{dotted} Each panel spans what the last 45 % of the time leave open: bands and bars may go beyond."
            f"{form}",
            t,
            courses,
        ),
        falling(
            "How the uncertainties fall",
            "Standard uncertainty of each coefficient over that of its prior, as the platform turns. Dash at the end: "
            "Cramér-Rao bound, the best that any filter can reach on this path. A line falls when the path begins to "
            "excite the coefficient, and stays level while it tells nothing.",
            t,
            courses,
        ),
    ]


def relative_errors(t: Array, history: History, truth: Array | None) -> Picture:
    """Relative errors of biases and misalignments of the accelerometers; relative changes where no truth is known."""
    values = to_product(history.coefficients)
    reference = values[-1] if truth is None else truth[: values.shape[1]]
    what = "change still to come" if truth is None else "error"

    def lines(group: slice) -> list[Line]:
        return [
            Line(
                names(len(reference))[k],
                100.0 * (values[:, k] - reference[k]) / (abs(reference[k]) or np.nan),
            )
            for k in range(group.start, group.stop)
        ]

    end = "its last value" if truth is None else "the truth"
    return lines_by_group(
        f"{what.capitalize()} of the accelerometers' coefficients, in percent",
        f"Estimate less {end}, in percent of the size of {end}, of biases ka0 and misalignments eta. Linear up to "
        "± 1 %, logarithmic beyond: every estimate begins at 0, 100 % away.",
        t,
        {f"{what} of ka0 [%]": lines(KA0), f"{what} of eta [%]": lines(ETA)},
        1.0,
    )


def design_page(designed: Designed, settings: SelfcalSettings, estimate: Estimate) -> str:
    """The report of a search for a path as one self-contained HTML page."""
    bounds, plan = designed.bounds, designed.plan
    units, size = of_field(len(bounds.names))
    drawn = [
        path(
            plan.step * np.arange(len(plan.angles()), dtype=float),
            plan.angles(),
            JOINTS,
            "The path found",
            "Gimbal angles; the background has the colour of the joint that turns: th_x the outer, th_y the inner one, "
            "th_z the platform's.",
        ),
        dots(
            "Bounds by path",
            "Standard uncertainty of each coefficient at the end of each path, the best that any filter can reach with "
            f"the stated noise and prior; further left is better.{' Bar: the goal.' if settings.goal else ''}",
            bounds.names,
            units,
            {each.name: each.seen.bounds.u / size for each in designed.compare},
            np.array([settings.goal.get(name, np.nan) for name in bounds.names]) / size
            if settings.goal
            else None,
        ),
    ]
    return page(
        "selfcal.html",
        estimate,
        "A path for self-calibration",
        _facts(settings),
        tables=[paths(designed), turns(plan), weak_combinations(bounds)],
        pictures=drawn,
        details=[bounds_by_path(designed)],
    )


def campaign_page(campaign: Campaign, settings: SelfcalSettings, estimate: Estimate) -> str:
    """The report of many simulated calibrations as one self-contained HTML page."""
    coverage, nees, p = campaign.coverage, campaign.nees, len(campaign.names)
    m = campaign.joint_error.shape[1]
    each = np.einsum(
        "ri,ri->r",
        campaign.joint_error,
        np.linalg.solve(campaign.joint_covariance, campaign.joint_error[..., None])[..., 0],
    )
    what = "attitude and coefficients" if m > p else "coefficients"
    drawn = [
        filtering.covered(coverage, campaign.names, campaign.rms_over_bound),
        filtering.chi_square(
            "Normalised estimation error squared",
            f"Errors of {what} of a run together, {m} numbers, squared and over their stated covariance (NEES), beside "
            f"the chi-square density that they follow if the covariances are true. Mean {nees.mean:.3g} of {nees.runs} "
            f"runs, expected {nees.limits[0]:.4g} to {nees.limits[1]:.4g}. Too far right: covariances too small.",
            each,
            m,
            1.0,
            "NEES",
        ),
        filtering.chi_square(
            "Normalised innovations squared",
            f"Mean over the {campaign.rows:.0f} rows of each run away from gimbal lock (NIS), beside the density of "
            f"such a mean. Mean {np.nanmean(campaign.nis):.4f}, expected {campaign.nis_limits[0]:.4f} to "
            f"{campaign.nis_limits[1]:.4f}.",
            campaign.nis,
            campaign.nis_expected * campaign.rows,
            campaign.rows,
            "mean NIS of a run",
        ),
    ]
    return page(
        "selfcal.html",
        estimate,
        "Self-calibration simulated many times",
        [*_facts(settings), ("filter", "", f"{FILTERS.get(campaign.kind, campaign.kind)} ({campaign.kind})")],
        tables=[campaign_table(campaign)],
        pictures=drawn,
        details=[],
    )


def _facts(settings: SelfcalSettings) -> list[tuple[str, str, str]]:
    """Site, noise and path, as name, unit and text."""
    noise, site = settings.noise, settings.site
    _, arcsec = shown_unit("rad")
    _, ug = shown_unit("m/s^2")
    facts = [
        ("latitude", "°", f"{np.degrees(site.latitude):.6g}") if site.latitude is not None else ("", "", ""),
        ("gravity", "m/s²", f"{site.gravity:.7g}"),
        ("angle random walk", "°/√h", f"{np.degrees(noise.angle_random_walk) * 60.0:.3g}"),
        ("noise of an accelerometer's sample", "µg", f"{noise.accelerometer / ug:.3g}"),
        ("noise of an encoder's sample", "arcsec", f"{noise.encoder / arcsec:.3g}"),
    ]
    if settings.plan is not None:
        facts.append(("path of the study", "", settings.plan.words()))
    return [fact for fact in facts if fact[0]]


def _attitude(calibration: Calibration, history: History, truth: Array | None) -> Picture:
    """The attitude against the truth where that is known, else against the encoders."""
    t = calibration.recording.t
    if truth is not None:
        courses = {
            kind: each.history.attitude
            for kind, each in _all(calibration).items()
            if each.history is not None and kind in (calibration.filtered.kind, "svd-qukf", "gimbal-ukf")
        }
        return attitude_errors(t, truth, courses)
    th = calibration.recording.th
    read, _ = gimbals(np.nan_to_num(th), calibration.problem.world)
    correction = boxminus(history.attitude, read)
    correction[np.isnan(th).any(axis=1)] = np.nan
    about_axes = calibration.filtered.kind != "gimbal-ukf"
    return attitude_correction(t, correction, history.attitude_u if about_axes else None)


def _bounds(calibration: Calibration, settings: SelfcalSettings) -> Picture:
    """Uncertainties beside bounds, priors and goals."""
    estimate, bounds = calibration.estimate, calibration.bounds
    units, size = of_field(len(bounds.names))
    goal = np.array([settings.goal.get(name, np.nan) for name in bounds.names])
    stated = [estimate[name].u if name in estimate.parameters else np.nan for name in bounds.names]
    return bounds_beside(
        bounds.names, units, np.array(stated) / size, bounds.u / size, bounds.prior / size, goal / size
    )


def _all(calibration: Calibration) -> Mapping[str, Filtered]:
    """Every filter that ran, the one that counts first."""
    return {calibration.filtered.kind: calibration.filtered} | dict(calibration.compared)
