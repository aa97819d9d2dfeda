"""Pictures of a design: the layouts that were compared, and how u goes with base line and accelerometers."""

from __future__ import annotations

import math

import numpy as np

from inercal.aoa.design import Designed
from inercal.aoa.figures.sensors import side_view
from inercal.aoa.settings import AoaSettings
from inercal.arrays import Array
from inercal.report.html import Picture
from inercal.report.marks import Axis, Dots, Level, Line, Mark, Panel
from inercal.report.panels import draw
from inercal.report.style import COLOURS
from inercal.units import STANDARD_GRAVITY


def best(designed: Designed) -> Picture:
    """The best layout from its side."""
    layout = designed.best.layout
    return side_view(layout.names, layout.angle, layout.r, layout.z, True)


def pictures(designed: Designed, settings: AoaSettings) -> list[Picture]:
    """The best layout; u over the base line and over the errors of the accelerometers, with the wanted u."""
    wanted = settings.goal.theta
    aim: list[Mark] = [] if wanted is None else [Level(math.degrees(wanted), "wanted", style="--")]
    parts = np.array([part for part, _ in designed.base_lines])
    span = 1e3 * float(np.ptp(designed.best.layout.r)) * parts
    drawn: list[Mark] = [
        *_course(span, [each.fusion for _, each in designed.base_lines], "fusion", 0),
        *_course(span, [each.sample for _, each in designed.base_lines], "one sample", 1),
    ]
    times = np.array([each for each, _ in designed.qualities])
    bias = 1e6 * settings.noise.accelerometer_bias / STANDARD_GRAVITY * times
    better: list[Mark] = [*_course(bias, [u for _, u in designed.qualities], "", 0), *aim]
    return [
        best(designed),
        draw(
            "How u depends on base line and accelerometers",
            "Rms standard uncertainty of the angle along the study's motion with the best layout. Left: drawn in "
            "towards the pivot, by the fusion and from single samples. Right: by the fusion, with noise and bias of "
            "all accelerometers larger or smaller together; where it is level they are not what limits the angle.",
            [
                [
                    Panel([*drawn, *aim], Axis("base line [mm]"), Axis("u [°]", "log"), grid="both"),
                    Panel(better, Axis("accelerometer bias [ug]", "log"), Axis("", "log"), grid="both"),
                ]
            ],
            2.6,
            where="left",
        ),
    ]


def _course(x: Array, u: list[float], label: str, colour: int) -> tuple[Mark, Mark]:
    """A line with dots of u [rad] in degrees; none where it is not known."""
    y = np.degrees(u)
    y = np.where(np.isfinite(y), y, np.nan)
    return Line(x, y, label, COLOURS[colour]), Dots(x, y, "", COLOURS[colour], size=3.0)
