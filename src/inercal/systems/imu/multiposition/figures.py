"""The figures of an IMU calibration: rest, poses, residuals, turns, correlation and budget."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import budget, correlation, values
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Bars, Dots, Level, Line, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.faces.report.style import ALARM, COLOURS, INK, envelope
from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import WORST_BY_SIZE
from inercal.foundation.records.places import counted
from inercal.foundation.units import parse_unit
from inercal.systems.imu.identified import pose_words
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit
from inercal.systems.imu.multiposition.poses import Poses, dwells_at
from inercal.systems.imu.multiposition.verdict import curing_pose

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.imu.multiposition.calibration import MultipositionCalibration
    from inercal.systems.imu.multiposition.gyro import GyroFit


_UG, _ARCSEC = (parse_unit(symbol).factor for symbol in ("ug", "arcsec"))

_WORDS = {"acc": "accelerometers", "gyro": "gyro"}


def pictures(calibration: MultipositionCalibration) -> list[Picture]:
    """Draw what there is to see of a calibration.

    Parameters
    ----------
    calibration : MultipositionCalibration
        Of any status; without poses there is one picture, without a gyro there are none of turns.
    """
    estimate, poses, gyro = calibration.estimate, calibration.poses, calibration.gyro
    pictures = [] if poses is None else [_sphere(poses)]
    pictures += [values(estimate)] if estimate.names else []
    pictures.append(_rest(calibration))
    if poses is not None:
        off = calibration.outliers
        pictures.append(
            _residuals(poses, estimate.statistics["scatter"], off.poses, _foretold(estimate, "poses"))
        )
    if poses is not None and gyro is not None:
        told = _foretold(estimate, "turns")
        pictures.append(_misses(gyro, poses, estimate.statistics["scatter"], off.turns, told))
    if estimate.names:
        pictures += [correlation(estimate), budget(estimate)]
    return pictures


def _rest(calibration: MultipositionCalibration) -> Picture:
    """Windowed variance over time, the threshold, and the static intervals below it."""
    recording, poses = calibration.recording, calibration.poses
    t = recording.accelerometer.t
    threshold = calibration.estimate.statistics["threshold"]
    dwells = dwells_at(recording, threshold, False) if poses is None else poses.dwells
    judged = set(recording.restlessness) if poses is not None and poses.with_gyro else {"acc"}
    spans = [(t[d.start], t[d.stop - 1]) for d in dwells]
    panels: list[list[Panel]] = []
    for sensor, size in recording.restlessness.items():
        marks: list[Mark] = [Strips(spans, COLOURS[2], 0.25), Line(*envelope(t, size), width=0.5)]
        if sensor in judged:
            marks.append(Level(threshold, "", ALARM, 0.9))
        last = len(panels) == len(recording.restlessness) - 1
        across = Axis("time [s]" if last else "", margin=0.005)
        panels.append([Panel(marks, across, Axis(f"{_WORDS[sensor]}\nvariance / at rest", "log"))])
    at_rest = f"{t[recording.rest[0].start]:.1f} s to {t[recording.rest[-1].stop - 1]:.1f} s"
    if len(recording.rest) > 1:
        at_rest = f"{len(recording.rest)} quiet pieces, {at_rest}"
    unused = "" if judged == set(recording.restlessness) else "; the gyro took no part in finding them"
    return draw(
        "Static intervals",
        f"Variance in a window of {recording.window} samples over the variance at rest ({at_rest}), "
        f"least and greatest values of pieces of the recording. Shaded: the "
        f"{len(dwells)} static intervals found below the threshold of {threshold:g} (red){unused}.",
        panels,
        0.6 + 1.5 * len(panels),
    )


def _sphere(poses: Poses) -> Picture:
    """Directions of the specific force on two hemispheres, with the pose that is lacking."""
    fit = poses.accelerometer
    lacking = _lacking(fit)
    star = (
        f" Stars: the pose {pose_words(lacking[0])} and its opposite, which would add most to what is known of the "
        "weakest combination of coefficients."
        if len(lacking)
        else ""
    )
    return draw(
        "Poses",
        "Direction of the specific force in each static pose, in the frame of the accelerometers, on two "
        "hemispheres seen along −z (equal-area projection; circles at 30° and 60° from the pole), coloured by "
        f"residual. The numbers count the poses in order of time; near ones share a label.{star}",
        [hemispheres(fit.directions, fit.fit.residuals / _UG, "|f| − g [µg]", lacking)],
        3.3,
    )


def _lacking(fit: AccelerometerFit) -> Array:
    """Directions (2, 3) that would cure an ill-conditioned fit; (0, 3) where none is needed."""
    if fit.fit.identifiability.condition <= WORST_BY_SIZE:
        return np.zeros((0, 3))
    gravity = float(np.mean(np.linalg.norm(fit.f, axis=1)))
    cure = curing_pose(fit, gravity)
    return np.array([cure, -cure])


def _foretold(estimate: Estimate, what: str) -> str:
    """A sentence on every second pose or turn foretold by the others; empty where there are too few."""
    if what not in estimate.result["held_out"]:
        return ""
    told = estimate.result["held_out"][what]
    low, high = told["range_99"]
    return (
        f" Every second one, foretold by the others, is off by {told['rms_z']:.2f} of its u (rms; {low:.2f} to "
        f"{high:.2f} at 99 % for {told['residuals']} residuals)."
    )


def _alarming(numbers: Array, values: Array, places: tuple[int, ...]) -> list[Mark]:
    """Rings around what lies off all others."""
    if not places:
        return []
    k = list(places)
    return [Dots(numbers[k], values[k], "lies off all others", ALARM, "o", 9.0, filled=False)]


def _residuals(poses: Poses, scatter: float, off: tuple[int, ...], foretold: str) -> Picture:
    """Residual of each pose, with what the noise explains and what the uncertainties use."""
    residuals = poses.accelerometer.fit.residuals / _UG
    numbers = np.array(poses.numbers)
    noise = np.sqrt(poses.noise_variance) / _UG
    size = scatter / _UG
    marks: list[Mark] = [
        Strips((-size, size), level=True),
        Level(0.0),
        Dots(numbers, residuals, up=noise, bar=INK),
        *_alarming(numbers, residuals, off),
    ]
    return draw(
        "Residual of each pose",
        "Size of the calibrated specific force less local gravity. Bars: ± one standard uncertainty by the noise at "
        f"rest; band: ± {size:.2g} µg, the standard deviation on which the uncertainties of the "
        f"accelerometers rest. The coefficients draw the residuals towards zero: {len(numbers)} poses leave "
        f"{counted(poses.accelerometer.fit.dof, 'degree')} of freedom.{foretold}",
        [[Panel(marks, _counted("pose"), Axis("|f| − g [µg]"), grid="y")]],
        2.1,
    )


def _misses(gyro: GyroFit, poses: Poses, scatter: float, off: tuple[int, ...], foretold: str) -> Picture:
    """Angle between carried and measured vertical after each turn."""
    numbers = np.array([poses.numbers[k] for k in gyro.first])
    misses = np.linalg.norm(gyro.miss, axis=1) / _ARCSEC
    by_verticals = scatter**2 * np.sum(gyro.vertical_error.reshape(len(numbers), -1) ** 2, axis=1)
    # the random walk acts in the two directions across the vertical
    expected = np.sqrt(by_verticals + 2.0 * gyro.walk**2 * gyro.durations) / _ARCSEC
    marks: list[Mark] = [
        Bars(numbers, np.zeros(len(numbers)), misses, thickness=0.06, upright=True),
        Dots(numbers, misses, "miss"),
        Dots(numbers, expected, "expected, rms", COLOURS[1], "_", 9.0),
        *_alarming(numbers, misses, off),
    ]
    return draw(
        "Miss of each turn",
        "Angle between the vertical of a pose carried through the gyro's output to the next pose and the vertical "
        f"measured there. Dashes: what the uncertainty of the verticals and the fitted angle random walk of "
        f"{gyro.walk:.2g} rad/√s make expect. A turn has the number of the pose before it.{foretold}",
        [[Panel(marks, _counted("turn from pose"), Axis("miss [arcsec]", limits=(0.0, None)), grid="y")]],
        2.1,
    )


def _counted(label: str) -> Axis:
    """An axis that counts."""
    return Axis(label, whole=True, margin=0.02)
