"""The figures of a Ferraris calibration: sections, scatter of the positions, turns, correlation and budget."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from inercal.arrays import Array
from inercal.imu.ferraris.names import NAMES, TURNS
from inercal.records.column import Triad
from inercal.records.dwells import breaks
from inercal.report.figures import budget, correlation
from inercal.report.html import Picture
from inercal.report.style import COLOURS, INK, QUIET, WIDTH, envelope, figure, plain_unit, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from inercal.imu.ferraris.calibration import FerrarisCalibration
    from inercal.imu.ferraris.scatter import Scatter


_GAP = 0.5
"""Longest step of time [s] across which a line is drawn."""


def pictures(calibration: FerrarisCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration, of any status; without all sections there is one picture."""
    estimate, scatter = calibration.estimate, calibration.scatter
    drawn = [_sections(calibration)]
    if scatter is not None:
        drawn += [_positions(calibration, scatter), _turns(calibration)]
    if estimate.names:
        drawn += [correlation(estimate), budget(estimate)]
    return drawn


def _sections(calibration: FerrarisCalibration) -> Picture:
    """The outputs over time with the sections shaded and named."""
    acc, sections = calibration.accelerometer, calibration.sections
    origin = float(np.nanmin(acc.t))
    spans = {name: acc.t[rows[[0, -1]]] - origin for name, rows in sections.acc.items()}
    with figure(WIDTH, 3.8) as page:
        panels = page.subplots(2, 1, sharex=True)
        for axes, triad, words in zip(
            panels, (acc, calibration.gyro), ("accelerometers", "gyro"), strict=True
        ):
            for name, (start, end) in spans.items():
                axes.axvspan(start, end, color=COLOURS[1 if name in TURNS else 2], alpha=0.22, lw=0)
                axes.axvline(start, color=QUIET, lw=0.4)
                axes.axvline(end, color=QUIET, lw=0.4)
            _draw(axes, triad, origin)
            axes.set_ylabel(f"{words}\n[{plain_unit(triad.unit.symbol)}]")
            axes.margins(x=0.005)
        for name, (start, end) in spans.items():
            panels[0].text(
                0.5 * (start + end),
                1.02,
                name,
                transform=panels[0].get_xaxis_transform(),
                fontsize=6.5,
                ha="center",
                va="bottom",
            )
        panels[-1].set_xlabel("time [s]")
        handles, labels = panels[0].get_legend_handles_labels()
        page.legend(handles[:3], labels[:3], loc="outside upper right", ncols=3)
        drawn = svg(page)
    how = {
        "labels": "by the labels of the recording",
        "study": "as named in the study",
        "detection": "detected",
    }[sections.found_by]
    missing = f" Not found: {', '.join(sections.missing)}." if sections.missing else ""
    return Picture(
        "Sections",
        f"Outputs with the {len(spans)} of {len(NAMES)} sections shaded, {how}: positions (green) with the axis named "
        f"upward (p) or downward (a), and turns (orange).{missing}",
        drawn,
    )


def _draw(axes: Axes, triad: Triad, origin: float) -> None:
    """Three outputs over time, with nothing drawn where samples are missing."""
    for k, axis in enumerate("xyz"):
        for n, (t, values) in enumerate(_pieces(triad)):
            t, shown = envelope(t - origin, values[:, k], max(20, 800 * len(t) // len(triad.t)))
            axes.plot(t, shown, color=COLOURS[(0, 1, 4)[k]], lw=0.5, label="" if n else axis)


def _pieces(triad: Triad) -> Iterator[tuple[Array, Array]]:
    """Stretches of a triad in order of time, without gaps."""
    order = np.argsort(triad.t, kind="stable")
    t, values = triad.t[order], triad.values[order]
    edges = [0, *breaks(t, _GAP).tolist(), len(t)]
    for start, stop in itertools.pairwise(edges):
        yield t[start:stop], values[start:stop]


def _positions(calibration: FerrarisCalibration, scatter: Scatter) -> Picture:
    """What the two positions of each axis leave over on the other two."""
    assert calibration.solution is not None
    assert calibration.readings is not None
    gravity = float(calibration.readings.inputs.gravity)
    tilts = np.degrees(scatter.left["acc"] / np.diag(calibration.solution.force_gain) / gravity)
    pairs = [(j, i) for j in range(3) for i in range(3) if i != j]
    labels = [f"{'xyz'[j]}_p, {'xyz'[j]}_a\non {'xyz'[i]}" for j, i in pairs]
    expected = math.degrees(scatter.tilt) / math.sqrt(2.0)
    with figure(WIDTH, 2.1) as page:
        axes = page.subplots()
        axes.axhspan(-expected, expected, color=COLOURS[0], alpha=0.15, lw=0)
        axes.axhline(0.0, color=QUIET, lw=0.6)
        places = np.arange(len(pairs))
        axes.plot(places, [tilts[pair] for pair in pairs], "o", color=COLOURS[0])
        axes.set_xticks(places, labels)
        axes.margins(x=0.06)
        axes.grid(axis="y")
        axes.set_ylabel("left over [°]")
        drawn = svg(page)
    said = "as stated" if math.isinf(scatter.tilt_dof) else "as these six scatter"
    return Picture(
        "Scatter of the positions",
        "Mean output of the two opposite positions of an axis, less the bias, on the other two axes, as an angle of "
        "gravity: half the difference of the directions of the two positions from upright. Band: ± one standard "
        f"deviation for positions upright to {math.degrees(scatter.tilt):.2g}° each ({said}), the alignment on which "
        "the uncertainties of the misalignments rest. What both positions of a pair have in common does not show here.",
        drawn,
    )


def _turns(calibration: FerrarisCalibration) -> Picture:
    """The calibrated rate about the three axes in each turn."""
    assert calibration.solution is not None
    gyro, found, rows = calibration.gyro, calibration.solution, calibration.sections.gyro
    with figure(WIDTH, 2.2) as page:
        panels = page.subplots(1, 3, sharey=True)
        for axes, name in zip(panels, TURNS, strict=True):
            t = gyro.t[rows[name]]
            rate = np.degrees(found.gyro.correct(gyro.values[rows[name]]))
            axes.axhline(0.0, color=QUIET, lw=0.6)
            for k, axis in enumerate("xyz"):
                axes.plot(
                    *envelope(t - t[0], rate[:, k]),
                    color=COLOURS[(0, 1, 4)[k]],
                    lw=0.8,
                    label=f"about {axis}",
                )
            axes.set_title(name, color=INK)
            axes.set_xlabel("time [s]")
        panels[0].set_ylabel("rate [°/s]")
        page.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
        drawn = svg(page)
    return Picture(
        "Turns",
        "Calibrated rate in the three turns (without the g-sensitive drift). A turn should begin and end at rest and "
        "keep to its axis; its integral is the stated angle by definition of the scale factor.",
        drawn,
    )
