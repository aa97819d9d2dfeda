"""Pictures and the page of a self-calibration, with or without other filters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import budget, correlation
from inercal.faces.report.courses import (
    CoefficientCourse,
    converging,
    falling,
    innovations,
    lines_by_group,
    nis,
)
from inercal.faces.report.html import Picture, render
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import boxminus
from inercal.systems.selfcal.figures.filters import (
    attitude_correction,
    attitude_errors,
    attitudes_apart,
    bounds_beside,
    changes_of_turn,
    filters_apart,
    gimbals_on_base,
    path_of,
)
from inercal.systems.selfcal.filters import residuals
from inercal.systems.selfcal.filters.filter_result import product_form
from inercal.systems.selfcal.platform.coefficients import (
    ETA,
    EXTENDED,
    KA0,
    product_slope,
    shown_units,
    to_linear,
    to_product,
)
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.result.comparison import with_stated
from inercal.systems.selfcal.result.tables import weak_combinations
from inercal.systems.selfcal.task import compared

if TYPE_CHECKING:
    from inercal.systems.selfcal.estimators import FilterKind
    from inercal.systems.selfcal.filters.filter_result import FilterResult, RowHistory
    from inercal.systems.selfcal.task import Calibration


_OF_THE_PAPER = ("svd-qukf", "gimbal-ukf")

_CHANNELS = ("acc x", "acc y", "acc z")


def main(calibration: Calibration) -> Picture:
    """The main picture: uncertainties beside bounds and goals, or the path where there are no coefficients."""
    return _bounds(calibration) if calibration.estimate.names else _path(calibration)


def page(calibration: Calibration) -> str:
    """The report of a self-calibration as one self-contained HTML page, with or without other filters."""
    tables = [*compared(calibration), weak_combinations(calibration.bounds)]
    shown = calibration.estimate.shown()
    return render(shown, pictures(calibration), "Self-calibration of a platform", tables)


def pictures(calibration: Calibration, attitude: Array | None = None) -> list[Picture]:
    """All pictures of a calibration of any status, the main one first.

    ``attitude`` (n, 4) is the true q_bp at each row, that of the recording if absent; without one the attitude is drawn
    against the encoders'.
    """
    filtered, estimate = calibration.filtered, calibration.estimate.shown()
    t, history = calibration.recording.t, filtered.history
    drawings = [_bounds(calibration)] if estimate.names else []
    if history is not None and filtered.kind != "map":
        drawings += convergence(calibration)
    drawings += [_path(calibration), gimbals_on_base(calibration.settings.base, calibration.settings.gimbals)]
    if history is not None:
        true = calibration.recording.reference if attitude is None else attitude
        drawings += _attitude(calibration, history, true)
        if filtered.kind != "map":
            drawings.append(relative_errors(t, history, calibration.truth))
    drawings.append(nis(t[1:], filtered.nis, filtered.dims))
    if len(filtered.innovations):
        last = JOINTS if filtered.kind == "gimbal-ukf" else tuple(f"attitude {axis}" for axis in "XYZ")
        drawings.append(innovations(t[1:], filtered.innovations, (*_CHANNELS, *last)))
    if estimate.names:
        drawings.append(correlation(estimate))
        drawings += [budget(estimate)] if estimate.budget else []
    return drawings + _compare_pictures(calibration)


def _path(calibration: Calibration) -> Picture:
    """The angles of the gimbals over time."""
    recording = calibration.recording
    return path_of(recording.t, recording.th, "The path", "Gimbal angles that the encoders read")


def _compare_pictures(calibration: Calibration) -> list[Picture]:
    """Distance of the other filters from the one that counts; no picture without others."""
    filters = _all(calibration)
    if len(filters) < 2:
        return []
    values, u = with_stated(calibration.filtered, calibration.stated)
    first = calibration.filtered.kind
    apart: dict[str, Array] = {
        kind: (product_form(each, calibration.filtered.names)[0] - values) / u
        for kind, each in filters.items()
        if kind != first
    }
    return [filters_apart(calibration.filtered.names, apart, first)]


def convergence(calibration: Calibration) -> list[Picture]:
    """Coefficients with their bands, and how their uncertainties fall, over time: in the linear form of the filters,
    as a history knows nothing of the correlation between eta and ka1."""
    history, bounds, t = calibration.filtered.history, calibration.bounds, calibration.recording.t
    assert history is not None
    values = history.coefficients
    truth = None if calibration.truth is None else to_linear(calibration.truth)
    to_filter = np.linalg.inv(product_slope(calibration.filtered.coefficients))
    bound = np.sqrt(np.diag(to_filter @ bounds.covariance @ to_filter.T))
    units, size = shown_units(calibration.filtered.names)
    courses = [
        CoefficientCourse(
            name,
            units[k],
            values[:, k] / size[k],
            history.u[:, k] / size[k],
            float(bounds.prior[k] / size[k]),
            None if truth is None else float(truth[k] / size[k]),
            float(bound[k] / size[k]),
        )
        for k, name in enumerate(calibration.filtered.names)
    ]
    form = " Misalignments eta as filters know them, (1 + ka1) eta; the table of coefficients has eta itself."
    dotted = " Red dots: the truth." if calibration.truth is not None else ""
    return [
        converging(
            "Convergence of the coefficients",
            "Estimates as the platform turns, with bands of ± two standard uncertainties; above each its last value "
            "with its u by noise and prior. Bar at the start: the prior, ± two standard deviations about 0."
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


def relative_errors(t: Array, history: RowHistory, truth: Array | None) -> Picture:
    """Relative errors of biases and misalignments of the accelerometers; relative changes where no truth is known."""
    values = to_product(history.coefficients)
    reference = values[-1] if truth is None else truth[: values.shape[1]]
    what = "change still to come" if truth is None else "error"

    def lines(group: slice) -> dict[str, Array]:
        return {
            EXTENDED[k]: 100.0 * (values[:, k] - reference[k]) / (abs(reference[k]) or np.nan)
            for k in range(group.start, group.stop)
        }

    end = "its last value" if truth is None else "the truth"
    return lines_by_group(
        f"{what.capitalize()} of the accelerometers' coefficients, in percent",
        f"Estimate less {end}, in percent of the size of {end}, of biases ka0 and misalignments eta. Linear up to "
        "± 1 %, logarithmic beyond: every estimate begins at 0, 100 % away.",
        t,
        {f"{what} of ka0 [%]": lines(KA0), f"{what} of eta [%]": lines(ETA)},
        1.0,
    )


def _attitude(calibration: Calibration, history: RowHistory, truth: Array | None) -> list[Picture]:
    """The attitude against the truth where that is known, else against the encoders; and filters that were compared
    against the paper's, or the one that counts."""
    t, th, own = calibration.recording.t, calibration.recording.th, calibration.filtered.kind
    courses: dict[str, Array] = {
        kind: each.history.attitude
        for kind, each in _all(calibration).items()
        if each.history is not None and kind in (own, *_OF_THE_PAPER)
    }
    changes = changes_of_turn(t, th)
    drawings = []
    if len(courses) > 1:
        by = "svd-qukf" if "svd-qukf" in courses else own
        others = {kind: q for kind, q in courses.items() if kind != by}
        drawings = [attitudes_apart(t, courses[by], others, by, changes)]
    if truth is not None:
        return [attitude_errors(t, truth, courses, changes), *drawings]
    read, _ = residuals.gimbals(np.nan_to_num(th), calibration.problem.world)
    correction = boxminus(history.attitude, read)
    correction[np.isnan(th).any(axis=1)] = np.nan
    about_axes = calibration.filtered.kind != "gimbal-ukf"
    correction_u = history.attitude_u if about_axes else None
    return [attitude_correction(t, correction, correction_u, changes), *drawings]


def _bounds(calibration: Calibration) -> Picture:
    """Uncertainties beside bounds, priors and goals."""
    estimate, bounds = calibration.estimate, calibration.bounds
    units, size = shown_units(bounds.names)
    goal = np.array([calibration.settings.goal.get(name, np.nan) for name in bounds.names])
    u = [estimate[name].u if name in estimate.parameters else np.nan for name in bounds.names]
    return bounds_beside(
        bounds.names, units, np.array(u) / size, bounds.u / size, bounds.prior / size, goal / size
    )


def _all(calibration: Calibration) -> Mapping[FilterKind, FilterResult]:
    """Every filter that ran, the one that counts first."""
    return {calibration.filtered.kind: calibration.filtered} | dict(calibration.compared)
