"""Pictures of a rate test and of a test by small steps: what a straight line leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK
from inercal.foundation.instruments.terms import shown_unit

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
