"""The picture of a rate test: what a straight line leaves at each rate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.report.html import Picture
from inercal.report.style import COLOURS, INK, WIDTH, figure, svg

_MARKS = {"below": ("^", "approached from below"), "above": ("v", "from above"), "rest": ("o", "from rest")}


def residuals_by_rate(rows: Sequence[Mapping[str, Any]]) -> Picture:
    """Residuals of the straight line over the rate, one panel for each gyro.

    ``rows`` with ``channel``, ``rate_rad_s``, ``residual_ppm_of_full_scale``, ``u_ppm_of_full_scale`` and
    ``reached_from``, in the order taken.
    """
    channels = list(dict.fromkeys(row["channel"] for row in rows))
    with figure(WIDTH, 0.6 + 1.9 * len(channels)) as page:
        panels = page.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
        for axes, channel in zip(panels, channels, strict=True):
            own = [row for row in rows if row["channel"] == channel]
            for way, (mark, label) in _MARKS.items():
                here = [row for row in own if row["reached_from"] == way]
                if not here:
                    continue
                axes.errorbar(
                    np.degrees([row["rate_rad_s"] for row in here]),
                    [row["residual_ppm_of_full_scale"] for row in here],
                    [row["u_ppm_of_full_scale"] for row in here],
                    fmt=mark,
                    color=COLOURS[list(_MARKS).index(way)],
                    lw=0.8,
                    capsize=2.0,
                    label=label,
                )
            axes.axhline(0.0, color=INK, lw=0.6)
            axes.set_ylabel(f"{channel}\nresidual [ppm of full scale]")
            axes.grid(axis="y")
        panels[-1].set_xlabel("rate of the table [deg/s]")
        page.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
        drawn = svg(page)
    return Picture(
        "Residual of each rate",
        "Output minus the best straight line, over the scale factor and full scale, with its standard uncertainty. "
        "A curve is non-linearity, a kink at zero asymmetry, a gap between the two ways hysteresis.",
        drawn,
    )
