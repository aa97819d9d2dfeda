"""The figures of a calibration on a table: the test, the biases over it, correlation and budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.arrays import Array
from inercal.imu.aided.coefficients import of_triad
from inercal.report.figures import budget, correlation
from inercal.report.html import Picture
from inercal.report.style import COLOURS, QUIET, WIDTH, envelope, figure, plain_unit, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from inercal.imu.aided.calibration import AidedCalibration
    from inercal.imu.aided.fit import Fit


_WORDS = {"acc": "accelerometers", "gyro": "gyro"}


def pictures(calibration: AidedCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration, of any status; without a fit there is only the table."""
    drawn = [_test(calibration)]
    if calibration.fit is not None:
        drawn += [_biases(calibration.fit, calibration.rests, triad) for triad in calibration.fit.identified]
    if calibration.estimate.names:
        drawn += [correlation(calibration.estimate), budget(calibration.estimate)]
    return drawn


def _shade(axes: Axes, rests: Array) -> None:
    """Mark the rests."""
    spans = [(start, end - start) for start, end in rests]
    axes.broken_barh(spans, (0, 1), transform=axes.get_xaxis_transform(), color=COLOURS[2], alpha=0.2, lw=0)


def _test(calibration: AidedCalibration) -> Picture:
    """Angles of the table over time."""
    motion, rests = calibration.motion, calibration.rests
    with figure(WIDTH, 2.0) as page:
        axes = page.subplots()
        _shade(axes, rests)
        for k, (name, angle) in enumerate(zip(motion.chain.joints, motion.angles.T, strict=True)):
            axes.plot(*envelope(motion.t, np.degrees(angle)), color=COLOURS[k], label=name)
        axes.set_ylabel("angle [deg]")
        axes.set_xlabel("time [s]")
        axes.margins(x=0.005)
        page.legend(loc="outside upper right", ncols=3)
        drawn = svg(page)
    return Picture(
        "The table",
        f"Angles of the table over the test, whole turns counted. Shaded: the {len(rests)} rests.",
        drawn,
    )


def _biases(fit: Fit, rests: Array, triad: str) -> Picture:
    """Residuals of a triad, averaged over each rest and each turn, with what the noise explains."""
    sensors = of_triad(fit, triad)
    blocks = sensors[0].side.blocks
    ends = np.concatenate([[blocks.nodes[0, 0]], rests.ravel(), [blocks.nodes[-1, -1]]])
    part = np.searchsorted(ends, blocks.middle)
    with figure(WIDTH, 4.2) as page:
        panels = page.subplots(3, 1, sharex=True)
        for axes, axis, sensor in zip(panels, "xyz", sensors, strict=True):
            _shade(axes, rests)
            axes.axhline(0.0, color=QUIET, lw=0.6)
            for number in np.unique(part):
                inside = part == number
                length = blocks.length[inside].sum()
                noise = sensor.noise.resting if blocks.resting[inside].mean() > 0.5 else sensor.noise.moving
                axes.errorbar(
                    np.average(blocks.middle[inside]),
                    np.average(sensor.residual[inside], weights=blocks.length[inside]),
                    noise / np.sqrt(length),
                    fmt="o",
                    color=COLOURS[0] if number % 2 == 0 else COLOURS[1],
                    elinewidth=0.8,
                )
            axes.set_ylabel(f"{triad}_{axis}")
            axes.margins(x=0.005)
        panels[-1].set_xlabel("time [s]")
        page.align_ylabels(panels)
        page.supylabel(f"residual [{plain_unit(blocks.triad.unit.symbol)}]", fontsize=8)
        drawn = svg(page)
    return Picture(
        f"Residuals of the {_WORDS[triad]}",
        "Output less what the calibration and the table make of it, averaged over each rest (blue) and each turn "
        "(orange). Bars: ± one standard uncertainty by white noise alone. What they do not explain is the wander of "
        "the bias, about its mean over the test; a pattern that goes with the position is something else.",
        drawn,
    )
