"""The picture of a test by small steps: output over input, about the straight line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK
from inercal.foundation.instruments.terms import shown_unit

_MARKS = {"raised": ("^", "input was raised"), "lowered": ("v", "lowered"), "first": ("o", "first")}


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
        for k, (way, (shape, label)) in enumerate(_MARKS.items()):
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
