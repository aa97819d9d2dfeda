"""The picture of a rate test: what a straight line leaves at each rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK

_MARKS = {"below": ("^", "approached from below"), "above": ("v", "from above"), "rest": ("o", "from rest")}
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
        for k, (way, (shape, label)) in enumerate(_MARKS.items()):
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
