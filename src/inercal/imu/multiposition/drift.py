"""Biases of the accelerometers that drift through a recording, as they do while a unit warms up."""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.estimate.budget import Uncertainty
from inercal.estimate.rounding import rounded
from inercal.findings import Finding
from inercal.imu.limits import LIMITS
from inercal.imu.multiposition.accelerometer import inverses
from inercal.imu.multiposition.joint import Joint
from inercal.imu.multiposition.left_out import effects, shown
from inercal.imu.multiposition.squares import squares_shown
from inercal.imu.recording import Recording


def drift_finding(
    joint: Joint,
    recording: Recording,
    times: Array,
    uncertainty: Uncertainty,
    noise: float,
    noise_dof: float,
) -> Finding | None:
    """A finding where the poses, at ``times`` (n,) [s], show that the biases change evenly with time, more than they
    show K2.

    It does harm where a value is shifted by more than its u, in which the scatter that the drift makes is already.
    ``noise`` and ``noise_dof`` are those of `inercal.imu.multiposition.left_out.shown`.
    """
    acc = joint.accelerometer
    lasts = float(np.ptp(times))
    if lasts <= 0.0:
        return None
    through = (times - np.mean(times)) / lasts
    in_force = -inverses(acc.model, acc.k2, acc.f) * through[:, None, None]
    of = effects(joint, in_force.reshape(-1, 3))
    if np.linalg.cond(of.unexplained) > LIMITS.condition:
        return None
    found, other = shown(joint, of, noise, noise_dof), squares_shown(joint, noise, noise_dof)
    if found is None or found.probability > LIMITS.driver_probability:
        return None
    if other is not None and other.gained > found.gained:
        return None
    unit = recording.accelerometer.unit.symbol
    words = ", ".join(
        f"{axis} {' ± '.join(rounded(value, each))}"
        for axis, value, each in zip("xyz", found.estimate, found.u, strict=True)
    )
    harmed = np.abs(of.shifts @ found.estimate) > uncertainty.u
    return Finding(
        "bias_drift",
        f"the biases of the accelerometers drift over the recording by {words} {unit}; K0 is their "
        "mean: let the unit warm up before the first pose, or take less time",
        harm=tuple(name for name, each in zip(joint.names, harmed, strict=True) if each),
    )
