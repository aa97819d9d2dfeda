"""Pictures of layouts side by side: u of the angle by each, and where its sensors are."""

from __future__ import annotations

import math

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS
from inercal.systems.aoa.design import ComparedLayouts
from inercal.systems.aoa.figures.sensors import side_view
from inercal.systems.aoa.settings import AoaSettings


def main(compared: ComparedLayouts, settings: AoaSettings) -> Picture:
    """U of the angle by each layout, and the wanted u."""
    wanted, names = settings.goal.theta, [bound.name for bound in compared.bounds]
    rows = np.arange(len(names))
    marks: list[Mark] = []
    for k, (label, u) in enumerate(
        (
            ("fusion", [bound.fusion for bound in compared.bounds]),
            ("one sample", [bound.sample for bound in compared.bounds]),
        )
    ):
        known = np.where(np.isfinite(u), np.degrees(u), np.nan)
        marks.append(Dots(known, rows, label, COLOURS[k], "os"[k], filled=k == 0))
    if wanted is not None:
        marks.append(Level(math.degrees(wanted), "wanted", style="--", upright=True))
    return draw(
        "Layouts side by side",
        "Rms standard uncertainty of the angle along the study's motion by each layout, with the stated sensors: by "
        "the fusion after it settled, and from single samples. No estimate has less.",
        [[Panel(marks, Axis("u of the angle [°]", "log"), Axis(names=names), grid="both")]],
        0.9 + 0.22 * len(names),
        3,
        "center",
    )


def pictures(compared: ComparedLayouts, settings: AoaSettings) -> list[Picture]:
    """Layouts side by side, and the side view of each."""
    views = [
        side_view(
            bound.layout.names,
            bound.layout.angle,
            bound.layout.r,
            bound.layout.z,
            True,
            f"Where the sensors are: {bound.name}",
        )
        for bound in compared.bounds
    ]
    return [main(compared, settings), *views]
