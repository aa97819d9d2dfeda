"""The figures of a Ferraris calibration: sections, scatter of the positions, turns, correlation and budget."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Note, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, QUIET, envelope, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import breaks
from inercal.systems.imu.ferraris.names import NAMES, TURNS

if TYPE_CHECKING:
    from inercal.systems.imu.ferraris.calibration import FerrarisCalibration
    from inercal.systems.imu.ferraris.scatter import Scatter


_OF_AXES = (COLOURS[0], COLOURS[1], COLOURS[4])
"""Colours of x, y, z."""

_GAP = 0.5
"""Longest step of time [s] across which a line is drawn."""


def pictures(calibration: FerrarisCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration, of any status; without all sections there is one picture."""
    estimate, scatter = calibration.estimate, calibration.scatter
    pictures = [*([values(estimate)] if estimate.names else []), _sections(calibration)]
    if scatter is not None:
        pictures += [_positions(calibration, scatter), _turns(calibration)]
    if estimate.names:
        pictures += [correlation(estimate), budget(estimate)]
    return pictures


def _sections(calibration: FerrarisCalibration) -> Picture:
    """The outputs over time with the sections shaded and named."""
    acc, sections = calibration.accelerometer, calibration.sections
    origin = float(np.nanmin(acc.t))
    spans = {name: acc.t[rows[[0, -1]]] - origin for name, rows in sections.acc.items()}
    panels = []
    for triad, words in zip((acc, calibration.gyro), ("accelerometers", "gyro"), strict=True):
        marks: list[Mark] = []
        for name, (start, end) in spans.items():
            marks.append(Strips((start, end), COLOURS[1 if name in TURNS else 2], 0.22))
            marks += [Level(edge, "", QUIET, 0.4, upright=True) for edge in (start, end)]
            if triad is acc:
                marks.append(Note((0.5 * (start + end), 1.02), name, ha="center", va="bottom", of_panel="y"))
        marks += _outputs(triad, origin)
        across = Axis("" if triad is acc else "time [s]", margin=0.005)
        panels.append([Panel(marks, across, Axis(f"{words}\n[{plain_unit(triad.unit.symbol)}]"))])
    how = {
        "labels": "by the labels of the recording",
        "study": "as named in the study",
        "detection": "detected",
    }[sections.found_by]
    missing = f" Not found: {', '.join(sections.missing)}." if sections.missing else ""
    return draw(
        "Sections",
        f"Outputs with the {len(spans)} of {len(NAMES)} sections shaded, {how}: positions (green) with the axis named "
        f"upward (p) or downward (a), and turns (orange).{missing}",
        panels,
        3.8,
    )


def _outputs(triad: Triad, origin: float) -> Iterator[Line]:
    """Three outputs over time, with nothing drawn where samples are missing."""
    for k, axis in enumerate("xyz"):
        for n, (t, outputs) in enumerate(_pieces(triad)):
            t, shown = envelope(t - origin, outputs[:, k], max(20, 800 * len(t) // len(triad.t)))
            yield Line(t, shown, "" if n else axis, _OF_AXES[k], 0.5)


def _pieces(triad: Triad) -> Iterator[tuple[Array, Array]]:
    """Stretches of a triad in order of time, without gaps."""
    order = np.argsort(triad.t, kind="stable")
    t, outputs = triad.t[order], triad.values[order]
    edges = [0, *breaks(t, _GAP).tolist(), len(t)]
    for start, stop in itertools.pairwise(edges):
        yield t[start:stop], outputs[start:stop]


def _positions(calibration: FerrarisCalibration, scatter: Scatter) -> Picture:
    """Residuals of the two positions of each axis on the other two."""
    assert calibration.solution is not None
    assert calibration.readings is not None
    gravity = float(calibration.readings.inputs.gravity)
    tilts = np.degrees(scatter.left["acc"] / np.diag(calibration.solution.force_gain) / gravity)
    pairs = [(j, i) for j in range(3) for i in range(3) if i != j]
    labels = [f"{'xyz'[j]}_p, {'xyz'[j]}_a\non {'xyz'[i]}" for j, i in pairs]
    expected = math.degrees(scatter.tilt) / math.sqrt(2.0)
    marks: list[Mark] = [
        Strips((-expected, expected), level=True),
        Level(0.0),
        Dots(np.arange(len(pairs)), [tilts[pair] for pair in pairs]),
    ]
    basis = "as stated" if math.isinf(scatter.tilt_dof) else "as these six scatter"
    return draw(
        "Scatter of the positions",
        "Mean output of the two opposite positions of an axis, less the bias, on the other two axes, as an angle of "
        "gravity: half the difference of the directions of the two positions from upright. Band: ± one standard "
        f"deviation for positions upright to {math.degrees(scatter.tilt):.2g}° each ({basis}), the alignment on which "
        "the uncertainties of the misalignments rest. What both positions of a pair have in common does not show here.",
        [[Panel(marks, Axis(names=labels, size=7.5), Axis("left over [°]"), grid="y")]],
        2.1,
    )


def _turns(calibration: FerrarisCalibration) -> Picture:
    """The calibrated rate about the three axes in each turn."""
    assert calibration.solution is not None
    gyro, matrices, rows = calibration.gyro, calibration.solution, calibration.sections.gyro
    panels = []
    for name in TURNS:
        t = gyro.t[rows[name]]
        rate = np.degrees(matrices.gyro.correct(gyro.values[rows[name]]))
        lines = [
            Line(*envelope(t - t[0], rate[:, k]), f"about {axis}", _OF_AXES[k])
            for k, axis in enumerate("xyz")
        ]
        panels.append(Panel([Level(0.0), *lines], Axis("time [s]"), Axis("rate [°/s]"), name))
    return draw(
        "Turns",
        "Calibrated rate in the three turns (without the g-sensitive drift). A turn should begin and end at rest and "
        "keep to its axis; its integral is the stated angle by definition of the scale factor.",
        [panels],
        2.2,
        share_y=True,
    )
