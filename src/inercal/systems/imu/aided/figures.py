"""The figures of a calibration on a table: the test, the biases over it, correlation and budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, envelope, plain_unit
from inercal.foundation.arrays import Array
from inercal.systems.imu.aided.coefficients import of_triad

if TYPE_CHECKING:
    from inercal.systems.imu.aided.calibration import AidedCalibration
    from inercal.systems.imu.aided.fit import AidedFit


_WORDS = {"acc": "accelerometers", "gyro": "gyro"}


def pictures(calibration: AidedCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration, of any status; without a fit there is only the table."""
    names = calibration.estimate.names
    pictures = [*([values(calibration.estimate)] if names else []), _test(calibration)]
    if calibration.fit is not None:
        pictures += [
            _biases(calibration.fit, calibration.rests, triad) for triad in calibration.fit.identified
        ]
    if names:
        pictures += [correlation(calibration.estimate), budget(calibration.estimate)]
    return pictures


def _test(calibration: AidedCalibration) -> Picture:
    """Angles of the table over time."""
    motion, rests = calibration.motion, calibration.rests
    marks: list[Mark] = [Strips(rests, COLOURS[2], 0.2)]
    names, curves, across = motion.curves
    for k, (name, curve) in enumerate(zip(names, curves.T, strict=True)):
        marks.append(Line(*envelope(motion.t, curve), name, COLOURS[k]))
    return draw(
        "The reference",
        f"Angles of the table, or attitude of the reference, over the test. Shaded: the {len(rests)} rests.",
        [[Panel(marks, Axis("time [s]", margin=0.005), Axis(across))]],
        2.0,
    )


def _biases(fit: AidedFit, rests: Array, triad: str) -> Picture:
    """Residuals of a triad, averaged over each rest and each turn, with what the noise explains."""
    sensors = of_triad(fit, triad)
    blocks = sensors[0].side.blocks
    ends = np.concatenate([[blocks.nodes[0, 0]], rests.ravel(), [blocks.nodes[-1, -1]]])
    part = np.searchsorted(ends, blocks.middle)
    numbers = np.unique(part)
    blocks_of = [part == number for number in numbers]
    middle = np.array([np.average(blocks.middle[inside]) for inside in blocks_of])
    length = np.array([blocks.length[inside].sum() for inside in blocks_of])
    resting = np.array([blocks.resting[inside].mean() > 0.5 for inside in blocks_of])
    panels = []
    for sensor in sensors:
        means = np.array(
            [np.average(sensor.residual[inside], weights=blocks.length[inside]) for inside in blocks_of]
        )
        noise = np.where(resting, sensor.noise.resting, sensor.noise.moving) / np.sqrt(length)
        marks: list[Mark] = [Strips(rests, COLOURS[2], 0.2), Level(0.0)]
        for chosen, colour in ((numbers % 2 == 0, COLOURS[0]), (numbers % 2 == 1, COLOURS[1])):
            marks.append(Dots(middle[chosen], means[chosen], colour=colour, up=noise[chosen]))
        unit = f"\n[{plain_unit(blocks.triad.unit.symbol)}]"
        across = Axis("time [s]" if sensor is sensors[-1] else "", margin=0.005)
        panels.append([Panel(marks, across, Axis(f"{sensor.name}{unit}"))])
    return draw(
        f"Residuals of the {_WORDS[triad]}",
        "Output less what the calibration and the table make of it, averaged over each rest (blue) and each turn "
        "(orange). Bars: ± one standard uncertainty by white noise alone. What they do not explain is the wander of "
        "the bias, about its mean over the test; a pattern that goes with the position is something else.",
        panels,
        1.4 * len(sensors),
    )
