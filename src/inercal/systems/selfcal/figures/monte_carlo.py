"""The page of many simulated calibrations, which tests their stated uncertainties."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as framed
from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, INK, QUIET
from inercal.foundation.arrays import Array
from inercal.foundation.inference.consistency import Coverage
from inercal.systems.selfcal.estimators import ESTIMATORS
from inercal.systems.selfcal.figures.design import facts
from inercal.systems.selfcal.result.tables import campaign_table

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.selfcal.monte_carlo import Campaign
    from inercal.systems.selfcal.settings import SelfcalSettings


def page(campaign: Campaign, settings: SelfcalSettings, estimate: Estimate) -> str:
    """The report of many simulated calibrations as one self-contained HTML page."""
    coverage, nees, p = campaign.coverage, campaign.nees, len(campaign.names)
    m = campaign.joint_error.shape[1]
    each = np.einsum(
        "ri,ri->r",
        campaign.joint_error,
        np.linalg.solve(campaign.joint_covariance, campaign.joint_error[..., None])[..., 0],
    )
    what = "attitude and coefficients" if m > p else "coefficients"
    pictures = [
        _covered(coverage, campaign.names, campaign.rms_over_bound),
        _chi_square(
            "Normalised estimation error squared",
            f"Errors of {what} of a run together, {m} numbers, squared and over their stated covariance (NEES), beside "
            f"the chi-square density that they follow if the covariances are true. Mean {nees.mean:.3g} of {nees.runs} "
            f"runs, expected {nees.limits[0]:.4g} to {nees.limits[1]:.4g}. Too far right: covariances too small.",
            each,
            m,
            1.0,
            "NEES",
        ),
        _chi_square(
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
    return framed(
        "selfcal.html",
        estimate,
        "Self-calibration simulated many times",
        [*facts(settings), ("filter", "", f"{ESTIMATORS[campaign.kind].words} ({campaign.kind})")],
        tables=[campaign_table(campaign)],
        pictures=pictures,
        details=[],
    )


def _chi_square(title: str, caption: str, values: Array, dof: float, divisor: float, label: str) -> Picture:
    """Histogram of ``values`` (runs,) beside the density of chi-square with ``dof`` degrees of freedom, over
    ``divisor``."""
    from scipy.stats import chi2  # takes long to import

    values = values[np.isfinite(values)]
    low, high = (float(chi2.ppf(level, dof)) / divisor for level in (1e-4, 1.0 - 1e-4))
    far = high + 2.0 * (high - low)
    first, last = min([low, *values.tolist()]), min(max([high, *values.tolist()]), far)
    edges = np.linspace(first, last, int(np.clip(2.0 * np.sqrt(len(values)), 8, 40)) + 1)
    marks: list[Mark] = []
    if len(values):
        share = np.histogram(np.minimum(values, far), edges)[0] / (len(values) * np.diff(edges))
        marks.append(Area(edges, np.zeros(len(share)), share, "runs", alpha=0.55, steps=True))
    x = np.linspace(first, last, 200)
    marks.append(Line(x, divisor * chi2.pdf(divisor * x, dof), "chi-square", INK, 1.1))
    beyond = int(np.sum(values > far))
    more = f" {beyond} beyond {far:.3g} are counted in the last bar." if beyond else ""
    axes = Axis(label, margin=0.005), Axis("density", limits=(0.0, None))
    return draw(title, caption + more, [[Panel(marks, *axes)]], 2.4)


def _covered(coverage: Coverage, names: Sequence[str], over_bound: Array) -> Picture:
    """Share of stated intervals that held the truth, and root mean square errors over stated uncertainties and over
    bounds (p,)."""
    rows, (low, high) = np.arange(len(names)), coverage.limits
    # the root mean square of n normal numbers is 1 with a standard deviation of about 1/sqrt(2 n)
    spread = 3.0 / np.sqrt(2.0 * coverage.runs)
    panels = []
    for values, band, at, label in zip(
        (100.0 * coverage.fraction, coverage.rms, over_bound),
        ((100.0 * low, 100.0 * high), *2 * ((1.0 - spread, 1.0 + spread),)),
        (100.0 * coverage.level, 1.0, 1.0),
        ("intervals that hold the truth [%]", "rms of error / u", "rms of error / bound"),
        strict=True,
    ):
        marks: list[Mark] = [Strips(band), Level(at, "", QUIET, 0.7, upright=True)]
        out = ~((band[0] <= values) & (values <= band[1]))
        for chosen, colour in ((~out, COLOURS[0]), (out, ALARM)):
            marks.append(Dots(values[chosen], rows[chosen], colour=colour))
        panels.append(Panel(marks, Axis(label), Axis(names=names), grid="y"))
    return draw(
        "Coverage, and errors beside uncertainties and bounds",
        f"Left: share of {coverage.runs} runs in which the interval stated for {100.0 * coverage.level:g} % held the "
        "truth; band: where all of them lie by chance. Middle and right: root mean square of the errors over the "
        "stated standard uncertainty, and over the Cramér-Rao bound, 1 for a filter that uses all that the path tells; "
        "band: 1 ± three standard deviations of such a ratio. Red: outside; right of the band on the left, and left of "
        "it elsewhere, that is harmless, for uncertainties are then rather too large.",
        [panels],
        0.7 + 0.16 * len(names),
        share_y=True,
    )
