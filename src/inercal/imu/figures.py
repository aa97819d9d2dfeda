"""The figures of an IMU calibration: rest, poses, residuals, turns, correlation and budget."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.imu.accelerometer import AccelerometerFit
from inercal.imu.poses import Poses, dwells_at
from inercal.imu.verdict import WORST_CONDITION, curing_pose, pose_words
from inercal.records.places import counted
from inercal.report.figures import budget, correlation
from inercal.report.html import Picture
from inercal.report.style import (
    ALARM,
    COLOURS,
    DIVERGING,
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
    from inercal.imu.task import Calibration

Array = NDArray[np.float64]

_WORDS = {"acc": "accelerometers", "gyro": "gyro"}
_NET = "#D5DBE1"
_NEAR = 0.15
"""Distance on the unit disc up to which poses share a label."""


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
    residuals = 1e3 * fit.fit.residuals
    limit = float(np.max(np.abs(residuals)))
    lacking = _lacking(fit)
    with figure(WIDTH, 3.3) as page:
        panels = page.subplots(1, 2)
        for axes, side in zip(panels, (1.0, -1.0), strict=True):
            _hemisphere(axes, side)
            here = side * fit.directions[:, 2] >= 0
            marks = axes.scatter(
                *_flat(fit.directions[here]),
                c=residuals[here],
                cmap=DIVERGING,
                vmin=-limit,
                vmax=limit,
                s=42,
                edgecolors=INK,
                linewidths=0.5,
                zorder=3,
            )
            _number(axes, fit.directions, here)
            for cure in lacking[side * lacking[:, 2] >= 0]:
                axes.scatter(*_flat(cure), marker="*", s=190, c="none", edgecolors=ALARM, lw=1.4, zorder=5)
        page.colorbar(marks, ax=panels, shrink=0.7, label="|f| − g [mm/s²]")
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
    if fit.fit.identifiability.condition <= WORST_CONDITION:
        return np.zeros((0, 3))
    gravity = float(np.mean(np.linalg.norm(fit.f, axis=1)))
    cure = curing_pose(fit, gravity)
    return np.array([cure, -cure])


def _flat(directions: Array) -> tuple[Array, Array]:
    """Lambert's equal-area projection of unit vectors (*batch, 3) from the nearer pole; the equator has radius 1."""
    shrink = np.sqrt(1.0 + np.abs(directions[..., 2]))
    return directions[..., 0] / shrink, directions[..., 1] / shrink


def _hemisphere(axes: Axes, side: float) -> None:
    """The net of one hemisphere, with the names of its axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for colatitude in (30.0, 60.0, 90.0):
        radius = np.sqrt(2.0) * np.sin(np.radians(colatitude) / 2.0)
        edge = colatitude == 90.0
        axes.plot(
            radius * np.cos(angle),
            radius * np.sin(angle),
            color=QUIET if edge else _NET,
            lw=0.9 if edge else 0.5,
        )
    axes.plot([-1, 1], [0, 0], [0, 0], [-1, 1], color=_NET, lw=0.5)
    for x, y, name in ((1, 0, "+x"), (-1, 0, "−x"), (0, 1, "+y"), (0, -1, "−y")):
        axes.text(1.12 * x, 1.12 * y, name, ha="center", va="center")
    axes.set_title(f"towards {'+' if side > 0 else '−'}z", pad=12)
    axes.set_aspect("equal")
    axes.set_axis_off()


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


def _number(axes: Axes, directions: Array, here: NDArray[np.bool_]) -> None:
    """Write the numbers of the poses on one hemisphere beside them, those of near ones together."""
    places = np.stack(_flat(directions), axis=-1)
    shared: dict[int, list[int]] = {}
    for k in np.flatnonzero(here).tolist():
        first = next((j for j in shared if np.linalg.norm(places[j] - places[k]) < _NEAR), k)
        shared.setdefault(first, []).append(k + 1)
    for k, numbers in shared.items():
        inward, below = -1 if places[k, 0] > 0.5 else 1, places[k, 1] > 0.7
        axes.annotate(
            fill(", ".join(map(str, numbers)), 16),
            places[k],
            (6 * inward, -8 if below else 4),
            textcoords="offset points",
            fontsize=6,
            ha="left" if inward > 0 else "right",
            zorder=4,
        )


def _whole_numbers(axes: Axes, label: str) -> None:
    """Count along the x axis."""
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel(label)
    axes.margins(x=0.02)
    axes.grid(axis="y")
