"""The figures of an IMU calibration: rest, poses, residuals, turns, correlation and budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.arrays import Array
from inercal.estimate.identifiability import WORST_BY_SIZE
from inercal.imu.accelerometer import AccelerometerFit
from inercal.imu.poses import Poses, dwells_at
from inercal.imu.verdict import curing_pose, pose_words
from inercal.records.places import counted
from inercal.report.figures import budget, correlation
from inercal.report.html import Picture
from inercal.report.positions import hemispheres
from inercal.report.style import (
    ALARM,
    COLOURS,
    INK,
    QUIET,
    WIDTH,
    envelope,
    figure,
    powers_of_ten,
    svg,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from inercal.imu.gyro import GyroFit
    from inercal.imu.multiposition import Calibration


_WORDS = {"acc": "accelerometers", "gyro": "gyro"}


def pictures(calibration: Calibration) -> list[Picture]:
    """Draw what there is to see of a calibration.

    Parameters
    ----------
    calibration : Calibration
        Of any status; without poses there is one picture, without a gyro there are none of turns.
    """
    estimate, poses, gyro = calibration.estimate, calibration.poses, calibration.gyro
    drawn = [_rest(calibration)]
    if poses is not None:
        drawn += [_sphere(poses), _residuals(poses, estimate.statistics["scatter"])]
    if gyro is not None:
        durations = np.array([turn["duration_s"] for turn in estimate.result["turns"]])
        drawn.append(_misses(gyro, durations, estimate.statistics["scatter"]))
    if estimate.names:
        drawn += [correlation(estimate), budget(estimate)]
    return drawn


def _rest(calibration: Calibration) -> Picture:
    """Windowed variance over time, the threshold, and the static intervals below it."""
    recording, poses = calibration.recording, calibration.poses
    t = recording.accelerometer.t
    threshold = calibration.estimate.statistics["threshold"]
    dwells = dwells_at(recording, threshold, False) if poses is None else poses.dwells
    judged = set(recording.restlessness) if poses is not None and poses.with_gyro else {"acc"}
    spans = [(t[d.start], t[d.stop - 1] - t[d.start]) for d in dwells]
    with figure(WIDTH, 0.6 + 1.5 * len(recording.restlessness)) as page:
        panels = page.subplots(len(recording.restlessness), 1, sharex=True, squeeze=False)[:, 0]
        for axes, (sensor, size) in zip(panels, recording.restlessness.items(), strict=True):
            axes.set_yscale("log")
            axes.broken_barh(
                spans, (0, 1), transform=axes.get_xaxis_transform(), color=COLOURS[2], alpha=0.25, lw=0
            )
            axes.plot(*envelope(t, size), color=COLOURS[0], lw=0.5)
            if sensor in judged:
                axes.axhline(threshold, color=ALARM, lw=0.9)
            axes.set_ylabel(f"{_WORDS[sensor]}\nvariance / at rest")
            axes.margins(x=0.005)
            powers_of_ten(axes.yaxis)
        panels[-1].set_xlabel("time [s]")
        drawn = svg(page)
    ends = t[recording.initial.start], t[recording.initial.stop - 1]
    unused = "" if judged == set(recording.restlessness) else "; the gyro took no part in finding them"
    return Picture(
        "Static intervals",
        f"Variance in a window of {recording.window} samples over the variance of the initial static period "
        f"({ends[0]:.1f} s to {ends[1]:.1f} s), least and greatest values of pieces of the recording. Shaded: the "
        f"{len(dwells)} static intervals found below the threshold of {threshold:g} (red){unused}.",
        drawn,
    )


def _sphere(poses: Poses) -> Picture:
    """Directions of the specific force on two hemispheres, with the pose that is lacking."""
    fit = poses.accelerometer
    lacking = _lacking(fit)
    with figure(WIDTH, 3.3) as page:
        hemispheres(
            page.subplots(1, 2), fit.directions, 1e3 * fit.fit.residuals, "|f| − g [mm/s²]", stars=lacking
        )
        drawn = svg(page)
    star = (
        f" Stars: the pose {pose_words(lacking[0])} and its opposite, which would add most to what is known of the "
        "weakest combination of coefficients."
        if len(lacking)
        else ""
    )
    return Picture(
        "Poses",
        "Direction of the specific force in each static pose, in the frame of the accelerometers, on two "
        "hemispheres seen along −z (equal-area projection; circles at 30° and 60° from the pole), coloured by "
        f"residual. The numbers count the poses in order of time; near ones share a label.{star}",
        drawn,
    )


def _lacking(fit: AccelerometerFit) -> Array:
    """Directions (2, 3) that would cure an ill-conditioned fit; (0, 3) where none is needed."""
    if fit.fit.identifiability.condition <= WORST_BY_SIZE:
        return np.zeros((0, 3))
    gravity = float(np.mean(np.linalg.norm(fit.f, axis=1)))
    cure = curing_pose(fit, gravity)
    return np.array([cure, -cure])


def _residuals(poses: Poses, scatter: float) -> Picture:
    """Residual of each pose, with what the noise explains and what the uncertainties use."""
    residuals = 1e3 * poses.accelerometer.fit.residuals
    numbers = np.arange(1, len(residuals) + 1)
    with figure(WIDTH, 2.1) as page:
        axes = page.subplots()
        axes.axhspan(-1e3 * scatter, 1e3 * scatter, color=COLOURS[0], alpha=0.15, lw=0)
        axes.axhline(0.0, color=QUIET, lw=0.6)
        axes.errorbar(
            numbers,
            residuals,
            1e3 * np.sqrt(poses.noise_variance),
            fmt="o",
            color=COLOURS[0],
            ecolor=INK,
            elinewidth=0.7,
        )
        _whole_numbers(axes, "pose")
        axes.set_ylabel("|f| − g [mm/s²]")
        drawn = svg(page)
    return Picture(
        "Residual of each pose",
        "Size of the calibrated specific force less local gravity. Bars: ± one standard uncertainty by the noise at "
        f"rest; band: ± {1e3 * scatter:.2g} mm/s², the standard deviation on which the uncertainties of the "
        f"accelerometers rest. The nine coefficients draw the residuals towards zero: {len(numbers)} poses leave "
        f"{counted(poses.accelerometer.fit.dof, 'degree')} of freedom.",
        drawn,
    )


def _misses(gyro: GyroFit, durations: Array, scatter: float) -> Picture:
    """Angle between carried and measured vertical after each turn."""
    numbers = np.arange(1, len(gyro.miss) + 1)
    misses = 1e3 * np.linalg.norm(gyro.miss, axis=1)
    by_verticals = scatter**2 * np.sum(gyro.vertical_error.reshape(len(numbers), -1) ** 2, axis=1)
    # the random walk acts in the two directions across the vertical
    expected = 1e3 * np.sqrt(by_verticals + 2.0 * gyro.walk**2 * durations)
    with figure(WIDTH, 2.1) as page:
        axes = page.subplots()
        axes.vlines(numbers, 0.0, misses, color=COLOURS[0], lw=0.8)
        axes.plot(numbers, misses, "o", color=COLOURS[0], label="miss")
        axes.plot(numbers, expected, "_", ms=9, mew=1.4, color=COLOURS[1], label="expected, rms")
        _whole_numbers(axes, "turn")
        axes.set_ylabel("miss [mrad]")
        axes.set_ylim(bottom=0.0)
        page.legend(loc="outside upper right", ncols=2)
        drawn = svg(page)
    return Picture(
        "Miss of each turn",
        "Angle between the vertical of a pose carried through the gyro's output to the next pose and the vertical "
        f"measured there. Dashes: what the uncertainty of the verticals and the fitted angle random walk of "
        f"{gyro.walk:.2g} rad/√s make expect. Turns left out of the fit are not counted.",
        drawn,
    )


def _whole_numbers(axes: Axes, label: str) -> None:
    """Count along the x axis."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel(label)
    axes.margins(x=0.02)
    axes.grid(axis="y")
