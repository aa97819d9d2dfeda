"""Pictures and the page of a calibration on a turntable, by positions, by rates or by small steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, dots, heat, values
from inercal.faces.report.html import Picture, render
from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import NUMBERED, hemispheres
from inercal.faces.report.style import COLOURS, INK, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.systems.turntable.figures.table import rig
from inercal.systems.turntable.rate.calibration import RateCalibration
from inercal.systems.turntable.regression import Regression
from inercal.systems.turntable.step_test import StepCalibration

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.turntable.positions.calibration import PositionCalibration
    from inercal.systems.turntable.readings import Readings

_SCOPES = {
    "stated": "as stated",
    "random": "all redrawn at each position",
    "constant": "all constant over the test",
}


def main(calibration: PositionCalibration | RateCalibration | StepCalibration) -> Picture:
    """The picture that answers the question: the residuals, or the positions where these do not identify the terms."""
    return pictures(calibration)[0]


def page(calibration: PositionCalibration | RateCalibration | StepCalibration) -> str:
    """The report of a calibration as one self-contained HTML page."""
    return render(calibration.shown, pictures(calibration), "Calibration on a turntable")


def pictures(calibration: PositionCalibration | RateCalibration | StepCalibration) -> list[Picture]:
    """All pictures of a calibration of any status, the main one first.

    Where the positions do not identify the terms there are those of positions and table alone; where no gyro could be
    fitted by rates, or no accelerometer by steps, there is none.
    """
    estimate = calibration.shown
    if isinstance(calibration, StepCalibration):
        if not estimate.names:
            return []
        scale = {f"acc_{each.axis}": float(each.values[1]) for each in calibration.responses}
        steps = response_by_input(estimate.result["steps"], scale)
        return [steps, values(estimate), correlation(estimate), budget(estimate)]
    if isinstance(calibration, RateCalibration):
        if not estimate.names:
            return []
        return [residuals_by_rate(estimate.result["rates"]), correlation(estimate), budget(estimate)]
    readings, fit, chain = calibration.readings, calibration.fitting.fit, calibration.fitting.model.chain
    plan = estimate.result["plan"]["name"]
    if fit is None:
        return [
            _positions(readings, gravity_reference() @ chain.attitude(readings.angles), None, plan),
            rig(chain),
        ]
    directions = gravity_reference() @ fit.model.chain.attitude(readings.angles)
    factor, alone = readings.unit.factor, estimate.u / calibration.estimate.u
    return [
        _residuals(readings, fit),
        values(estimate),
        _positions(readings, directions, fit.residuals / factor, plan),
        rig(chain),
        correlation(estimate),
        budget(estimate),
        *_tolerances(estimate, alone),
    ]


def _residuals(readings: Readings, fit: Regression) -> Picture:
    """Residual of each reading, with what noise and table explain."""
    factor, n = readings.unit.factor, len(readings.y)
    few = n <= NUMBERED
    weight = fit.weights(fit.noise)
    band = weight.std / factor
    numbers, edges = np.arange(1, n + 1), np.arange(n + 1) + 0.5
    panels = []
    for k, channel in enumerate(readings.channels):
        off = Dots(
            numbers,
            fit.residuals[:, k] / factor,
            size=4.0 if few else 1.5,
            up=fit.noise[k] / factor if few else None,
            bar=INK,
        )
        marks: list[Mark] = [Area(edges, -band[:, k], band[:, k], steps=True), Level(0.0), off]
        up = Axis(f"{channel} [{plain_unit(readings.unit.symbol)}]")
        across = Axis("position" if k == len(readings.channels) - 1 else "", margin=0.01)
        panels.append([Panel(marks, across, up, grid="y")])
    bars = "Bars: ± one standard deviation of the noise. " if few else ""
    rms = ", ".join(
        f"{channel} {value:.2g} {plain_unit(readings.unit.symbol)}"
        for channel, value in zip(
            readings.channels, np.sqrt(np.mean(np.square(fit.residuals), axis=0)) / factor, strict=True
        )
    )
    return draw(
        "Residual of each position",
        f"Reading less the fitted model at the commanded angles. {bars}Band: ± one standard deviation of noise and "
        "errors of the table together. The fit draws the residuals towards zero: "
        f"{counted(n, 'position')} of {counted(len(readings.channels), 'channel')} leave "
        f"{counted(fit.dof, 'degree')} of freedom. Root mean square: {rms}.",
        panels,
        0.5 + 1.5 * len(readings.channels),
    )


def _positions(readings: Readings, directions: Array, residuals: Array | None, plan: str) -> Picture:
    """Direction of gravity on the instrument, coloured by residual (n, c) where there is one."""
    rows = readings.channels if residuals is not None else ("",)
    panels = [
        hemispheres(
            directions,
            None if residuals is None else residuals[:, k],
            f"residual of {channel} [{plain_unit(readings.unit.symbol)}]",
        )
        for k, channel in enumerate(rows)
    ]
    coloured = "" if residuals is None else ", coloured by residual"
    return draw(
        "Positions",
        f"Direction of gravity on the axes of the instrument in each of the {len(readings.y)} positions ({plan}), on "
        f"two hemispheres seen along −z (equal-area projection; circles at 30° and 60° from the pole){coloured}. "
        "Numbers count the positions in order; near ones share a label.",
        panels,
        3.2 * len(rows),
    )


def _tolerances(estimate: Estimate, factor: Array) -> list[Picture]:
    """Effect of each tolerance of the table; ``factor`` (p,) takes uncertainties from SI to the shown units."""
    given, names = estimate.result, estimate.names
    factors = list(given["halved"])
    if not factors:
        return []
    rows = {name: given["tolerance_shares"].get(name, {}) for name in names}
    if given["drift_shares"]:
        rows["output"] = given["drift_shares"]
    shares = np.array([[row.get(each, 0.0) for each in factors] for row in rows.values()])
    gains = np.array([[1.0 - given["halved"][each][name] for each in factors] for name in names])
    scopes = {
        words: factor * [given["scopes"][key][name] for name in names] for key, words in _SCOPES.items()
    }
    drift = (
        " The last row is the predicted output as a whole, its mean square error over all directions of gravity."
        if given["drift_shares"]
        else ""
    )
    return [
        heat(
            "Which tolerance matters for which coefficient",
            "Share of each error of the table in the part of the variance of a coefficient that the table causes. "
            f"Shares below 0.5 % have no number.{drift}",
            list(rows),
            factors,
            100.0 * shares,
            "share [%]",
        ),
        heat(
            "What halving a tolerance brings",
            "How much smaller the standard uncertainty u of a coefficient were, all sources counted, if that one "
            "error of the table were half as large. Reductions below 0.5 % have no number.",
            names,
            factors,
            100.0 * gains,
            "reduction of u [%]",
        ),
        dots(
            "What the scopes mean",
            "Standard uncertainty of noise and table together, for errors of the table as stated, if all were redrawn "
            "at each position, and if all kept one value over the test: those that are redrawn average out over the "
            "positions, constant ones do not, but pull at some coefficients only.",
            names,
            estimate.units,
            scopes,
        ),
    ]


_BY_RATE = {"below": ("^", "approached from below"), "above": ("v", "from above"), "rest": ("o", "from rest")}
_BY_STEP = {"raised": ("^", "input was raised"), "lowered": ("v", "lowered"), "first": ("o", "first")}
_KEYS = ("rate_rad_s", "residual_ppm_of_full_scale", "u_ppm_of_full_scale")


def residuals_by_rate(rows: Sequence[Mapping[str, Any]]) -> Picture:
    """Residuals of the straight line over the rate, one panel for each gyro.

    ``rows`` with ``channel``, ``rate_rad_s``, ``residual_ppm_of_full_scale``, ``u_ppm_of_full_scale`` and
    ``reached_from``, in the order taken.
    """
    channels = list(dict.fromkeys(row["channel"] for row in rows))
    panels = []
    for channel in channels:
        marks: list[Mark] = [Level(0.0, "", INK)]
        for k, (way, (shape, label)) in enumerate(_BY_RATE.items()):
            here = [row for row in rows if row["channel"] == channel and row["reached_from"] == way]
            if here:
                rate, residual, u = (np.array([row[key] for row in here]) for key in _KEYS)
                marks.append(Dots(np.degrees(rate), residual, label, COLOURS[k], shape, up=u))
        across = Axis("rate of the table [deg/s]" if channel == channels[-1] else "")
        panels.append([Panel(marks, across, Axis(f"{channel}\nresidual [ppm of full scale]"), grid="y")])
    return draw(
        "Residual of each rate",
        "Output minus the best straight line, over the scale factor and full scale, with its standard uncertainty. "
        "A curve is non-linearity, a kink at zero asymmetry, a gap between the two ways hysteresis.",
        panels,
        0.6 + 1.9 * len(channels),
    )


def response_by_input(rows: Sequence[Mapping[str, Any]], scale: Mapping[str, float]) -> Picture:
    """Departure of each output from the straight line over the input, one panel for each accelerometer.

    ``rows`` as ``result.steps`` has them, ``scale`` K1 of each channel.
    """
    unit, size = shown_unit("m/s^2")
    channels = list(dict.fromkeys(row["channel"] for row in rows))
    panels = []
    for channel in channels:
        own = [row for row in rows if row["channel"] == channel]
        x, y, fitted = (np.array([row[key] for row in own]) for key in ("input_m_s2", "output", "response"))
        line = scale[channel] * x
        zero = float(np.mean(fitted - line))
        order = np.argsort(x, kind="stable")
        marks: list[Mark] = [Level(0.0, "", INK)]
        for k, (way, (shape, label)) in enumerate(_BY_STEP.items()):
            here = np.array([row["input_was"] == way for row in own])
            if here.any():
                off = (y - line - zero)[here] / scale[channel] / size
                marks.append(Dots(x[here] / size, off, label, COLOURS[k], shape))
        bent = (fitted - line - zero)[order] / scale[channel] / size
        marks.append(Line(x[order] / size, bent, "likeliest response", INK))
        last = channel == channels[-1]
        panels.append(
            [
                Panel(
                    marks,
                    Axis(f"input [{unit}]" if last else ""),
                    Axis(f"{channel}\noff the line [{unit}]"),
                    grid="y",
                )
            ]
        )
    return draw(
        "Response to small steps",
        "Output less the straight line, over the scale factor, against the input. A slope of -1 is a dead zone, where "
        "the output stands; a gap between the two ways is hysteresis. Drift is in the readings still.",
        panels,
        0.6 + 2.2 * len(channels),
    )
