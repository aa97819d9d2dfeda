"""Biases and scale factors that drift through a recording, as they do while a unit warms up.

Those of the accelerometers show in the poses, scale factors of the gyro in the turns; its biases, which show at rest,
are in `inercal.systems.imu.multiposition.verdict`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.results.budget import Uncertainty
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import inverses
from inercal.systems.imu.multiposition.gyro import GyroFit
from inercal.systems.imu.multiposition.joint import JointTriads
from inercal.systems.imu.multiposition.left_out import TestedErrors, effects, harmed, in_words, shown

_PPM = 1e-6
_SCALES = slice(3, 6)
"""Places of the scale factors among the parameters of a gyro."""

_SETTLING = (3.0, 10.0)
"""Range of the times over the time constants by which a unit may settle."""

_CURE = "let the unit warm up before the first pose, or take less time"


def bias_drift_shown(joint: JointTriads, times: Array, noise: float, noise_dof: float) -> TestedErrors | None:
    """Biases that change over the range of ``times`` (n,) [s] of the poses, where the poses show them.

    Evenly, or as a unit settles, with time constants of a third and a tenth of that range: the likeliest of the three.
    ``noise`` and ``noise_dof`` are those of `inercal.systems.imu.multiposition.left_out.shown`.
    """
    return _drift_shown(joint, times, np.ones((len(times), 3)), noise, noise_dof)


def scale_drift_shown(
    joint: JointTriads, times: Array, noise: float, noise_dof: float
) -> TestedErrors | None:
    """The same of scale factors, relative."""
    acc = joint.accelerometer
    return _drift_shown(joint, times, acc.model.scale * (acc.f @ acc.model.misalignment.T), noise, noise_dof)


def _drift_shown(
    joint: JointTriads, times: Array, in_output: Array, noise: float, noise_dof: float
) -> TestedErrors | None:
    """Errors that grow with time to changes ``in_output`` (n, 3) of each axis, where the poses show them."""
    acc = joint.accelerometer
    lasts = float(np.ptp(times))
    if lasts <= 0.0:
        return None
    courses, best = _courses((times - np.min(times)) / lasts), None
    for course in courses:
        through = course - np.mean(course)
        in_force = -inverses(acc.model, acc.k2, acc.f) * (through[:, None] * in_output)[:, None, :]
        of = effects(joint, in_force.reshape(-1, 3))
        found = shown(joint, of, noise, noise_dof, tries=len(courses))
        if found is not None and (best is None or found.probability < best.shown.probability):
            best = TestedErrors(of, found, LIMITS.driver_probability, len(courses))
    return None if best is None or best.shown.probability > best.limit else best


def _courses(part: Array) -> list[Array]:
    """Courses that grow by 1 over the recording, of which the ``part`` (n,) has gone: evenly, or as a unit settles."""
    return [part, *(-np.exp(-rate * part) / -np.expm1(-rate) for rate in _SETTLING)]


def bias_drift_finding(
    joint: JointTriads, found: TestedErrors, unit: str, uncertainty: Uncertainty
) -> Finding:
    """The finding about biases that drift; outputs are in ``unit``.

    It does harm where a value is shifted by more than its u, in which the scatter that the drift makes is already.
    """
    return Finding(
        "bias_drift",
        f"the biases of the accelerometers drift over the recording by {in_words(found.shown)} {unit}",
        action=_CURE,
        harm=harmed(found, joint.names, uncertainty.u),
    )


def gyro_scale_drift(
    gyro: GyroFit, times: Array, names: tuple[str, ...], uncertainty: Uncertainty
) -> Iterator[Finding]:
    """A finding where the turns show that the gyro's scale factors change over the ``times`` (n,) [s] of the poses, in
    one of the courses of biases; harm to the coefficients ``names`` as with them.

    Accelerometers that drift make verticals wrong, and so the turns: where they are found to, this is not asked.
    """
    at = 0.5 * (times[gyro.first] + times[gyro.first + 1])
    scales = gyro.linear.jacobian[:, :, _SCALES] * gyro.model.scale
    courses = _courses((at - np.min(times)) / np.ptp(times))
    tried = [gyro.linear.added(scales * (course - np.mean(course))[:, None, None]) for course in courses]
    found = min((each for each in tried if each is not None), key=lambda each: each.probability, default=None)
    if found is None or not len(courses) * found.probability <= LIMITS.gyro_drift_probability:
        return
    # beyond the names follow the unknown parts of earth rate
    shifts = dict(zip(gyro.names, found.shifts @ found.estimate, strict=False))
    yield Finding(
        "trend",
        f"the scale factors of the gyro change over the recording by {in_words(found, _PPM)} ppm",
        action=_CURE,
        harm=tuple(
            name for name, u in zip(names, uncertainty.u, strict=True) if abs(shifts.get(name, 0.0)) > u
        ),
    )


def scale_drift_finding(joint: JointTriads, found: TestedErrors, uncertainty: Uncertainty) -> Finding:
    """The finding about scale factors that drift; harm as with biases."""
    return Finding(
        "trend",
        f"the scale factors of the accelerometers change over the recording by {in_words(found.shown, _PPM)} ppm",
        action=_CURE,
        harm=harmed(found, joint.names, uncertainty.u),
    )
