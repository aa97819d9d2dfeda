"""Biases of the accelerometers that drift through a recording, as they do while a unit warms up."""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.estimate.budget import Uncertainty
from inercal.findings import Finding
from inercal.imu.limits import LIMITS
from inercal.imu.multiposition.accelerometer import inverses
from inercal.imu.multiposition.joint import Joint
from inercal.imu.multiposition.left_out import Tested, effects, harmed, in_words, shown


def drift_shown(joint: Joint, times: Array, noise: float, noise_dof: float) -> Tested | None:
    """Biases that change evenly with time, by the range of ``times`` (n,) [s] of the poses, where the poses show them.

    ``noise`` and ``noise_dof`` are those of `inercal.imu.multiposition.left_out.shown`.
    """
    acc = joint.accelerometer
    lasts = float(np.ptp(times))
    if lasts <= 0.0:
        return None
    through = (times - np.mean(times)) / lasts
    in_force = -inverses(acc.model, acc.k2, acc.f) * through[:, None, None]
    of = effects(joint, in_force.reshape(-1, 3))
    found = shown(joint, of, noise, noise_dof)
    if found is None or found.probability > LIMITS.driver_probability:
        return None
    return Tested(of, found, LIMITS.driver_probability)


def drift_finding(joint: Joint, found: Tested, unit: str, uncertainty: Uncertainty) -> Finding:
    """The finding about biases that drift; outputs are in ``unit``.

    It does harm where a value is shifted by more than its u, in which the scatter that the drift makes is already.
    """
    return Finding(
        "bias_drift",
        f"the biases of the accelerometers drift over the recording by {in_words(found.shown)} {unit}: let the unit "
        "warm up before the first pose, or take less time",
        harm=harmed(found, joint.names, uncertainty.u),
    )
