"""The figures of a calibration from sections: its holds, coefficients, what is left of each section, correlation and
budget."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.faces.report.style import ALARM, COLOURS, envelope
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.windows import Windows
from inercal.systems.imu.sections.design import DesignedSections
from inercal.systems.imu.sections.outcome import CalibrationFromSections


def pictures(calibration: CalibrationFromSections) -> list[Picture]:
    """Draw what there is to see of a calibration of any status; nothing where there was no fit."""
    estimate, found = calibration.estimate, calibration.found
    holds = _holds(calibration)
    if found is None:
        swung = bool(estimate.names)
        return [*holds, *([values(estimate), correlation(estimate), budget(estimate)] if swung else [])]
    drawn = [*_directions(found), _left(found), values(estimate), *holds]
    return [*drawn, correlation(estimate), budget(estimate)]


def _directions(found: SectionCalibration) -> list[Picture]:
    """Verticals and axes of sections, where the fit found some of them."""
    readings, point = found.problem.readings, found.point
    seen: NDArray[np.bool_] = np.any(readings.seen, axis=2)
    felt = seen[:, 0]
    turned = ~felt & seen[:, 2] & (readings.rate != 0.0)
    if not np.any((felt & ~readings.know_up) | (turned & ~readings.know_axis)):
        return []
    ways = np.where(felt[:, None], point.up, point.axis)[felt | turned]
    words = " and ".join(
        name
        for name, some in (("specific force at rest", felt), ("the axis of a rate or turn", turned))
        if some.any()
    )
    return [
        draw(
            "Directions",
            f"Direction of {words} in each section, on two hemispheres seen along −z (equal-area projection; circles "
            "at 30° and 60° from the pole), numbered in their order; near ones share a label.",
            [hemispheres(ways)],
            3.3,
        )
    ]


def _holds(calibration: CalibrationFromSections) -> list[Picture]:
    """Scatter of the outputs of one log in short windows, with the holds that are used and those that are not."""
    proposal = calibration.proposal
    rests = [] if proposal is None else [row for row in proposal.rows if row.kind == "rest"]
    if proposal is None or len(proposal.triads) != 1 or not all(row.end for row in rests) or not rests:
        return []
    used = [(row.begin or 0.0, row.end or 0.0) for row in rests if row.section not in proposal.unused]
    unused = [
        (float(item["begin [s]"]), float(item["end [s]"]))
        for finding in calibration.estimate.findings
        for item in finding.items
        if finding.code == "poor_section" and "begin [s]" in item
    ]
    panels: list[list[Panel]] = []
    (triads,) = proposal.triads.values()
    for name, triad in zip(("accelerometers", "gyro"), triads, strict=True):
        if triad is None or len(triad.t) < 4 * LIMITS.blocks_of_window:
            continue
        block = max(round(LIMITS.still_window / LIMITS.blocks_of_window / triad.step), 2)
        windows = Windows.of(triad.values, block, np.zeros(0, dtype=np.int64))
        size = np.sqrt(np.where(np.isfinite(windows.variance), windows.variance, np.nan))
        marks: list[Mark] = [
            Strips(used, COLOURS[2], 0.25),
            *([Strips(unused, ALARM, 0.25)] if unused else []),
            Line(*envelope(triad.t[: len(size) * block : block], size), width=0.5),
        ]
        panels.append([Panel(marks, Axis("time [s]", margin=0.005), Axis(f"{name}\n[output]", "log"))])
    return [
        draw(
            "Holds",
            f"Scatter of the outputs in windows of {LIMITS.still_window:g} s. Shaded: the {len(used)} holds that are "
            f"used, and in red the {len(unused)} that are not.",
            panels,
            0.6 + 1.5 * len(panels),
        )
    ]


def foretold(designed: DesignedSections) -> Picture:
    """Sections more, by the factor to which u falls with each."""
    shown = designed.shown
    rows = np.arange(len(shown))
    best = [min(one.factors.values()) for one in shown]
    marks: list[Mark] = [
        Dots([one.mean for one in shown], rows, "all terms, mean"),
        Dots(best, rows, "the term it helps most", COLOURS[1], "s", filled=False),
        Level(1.0, upright=True),
    ]
    return draw(
        "One section more",
        "Factor to which the standard uncertainty falls with each section more: of all terms in the geometric mean, "
        "and of the term that it helps most.",
        [
            [
                Panel(
                    marks,
                    Axis("u with it / u without", "log"),
                    Axis(names=[one.section for one in shown]),
                    grid="both",
                )
            ]
        ],
        0.9 + 0.22 * len(shown),
        2,
        "center",
    )


def _left(found: SectionCalibration) -> Picture:
    """Residuals of the outputs."""
    readings, panels = found.problem.readings, []
    for name, kind in (("accelerometers", 0), ("gyro", 2)):
        seen = readings.seen[:, kind]
        if seen.any():
            numbers = np.broadcast_to(np.arange(1, len(seen) + 1)[:, None], seen.shape)[seen]
            panels.append(
                [
                    Panel(
                        [Level(0.0), Dots(numbers, found.residuals[:, kind][seen])],
                        Axis("section", whole=True, margin=0.02),
                        Axis(f"{name}\n[output]"),
                        grid="y",
                    )
                ]
            )
    return draw(
        "Residuals of the sections",
        "Mean outputs of each section less those of the model, all axes, by the number of the section.",
        panels,
        0.5 + 1.6 * len(panels),
    )
