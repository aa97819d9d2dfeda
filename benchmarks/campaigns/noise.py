"""One simulated recording and its noise, for campaigns that ask whether the stated uncertainties are true."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.noise import SYMBOLS, NoiseModel
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.deviation import allan_deviation

SAMPLES, INTERVAL = 20000, 0.01
"""Samples of a recording, and their interval [s]."""

MIXES = {
    # a gyro of 0.3 deg/sqrt(h), 40 deg/h and its drift [rad/s]
    "mems": NoiseModel(N=1e-4, B=2e-4, K=2e-4),
    # an accelerometer of 100 ug/sqrt(Hz) that counts velocity in steps and warms up [m/s^2]
    "counting": NoiseModel(N=1e-3, Q=2e-4, R=4e-5),
    # a gyro that counts angle in steps, whose quantisation rules to a second [rad/s]
    "steps": NoiseModel(N=3e-4, K=3e-4, Q=2e-4),
    # the first gyro with a drift that two hundred seconds hardly show
    "weak": NoiseModel(N=1e-4, B=2e-4, K=6e-5),
}


def one_recording(mix: str, lost: float, rng: np.random.Generator) -> dict[str, Array]:
    """Simulate a recording of one of `MIXES`, of which the share ``lost`` is missing, and estimate its noise.

    Returns
    -------
    ``error``, ``u`` and ``dof`` (5,) in the order N, B, K, R, Q, NaN for a coefficient that was not seen; ``limit``
    (5,) its upper limit, NaN for those seen; ``sound`` (1 if there was no finding).
    """
    model = MIXES[mix]
    x = model.simulate(SAMPLES, INTERVAL, rng)
    if lost:
        x[rng.random(SAMPLES) < lost] = np.nan
    found = noise_coefficients(allan_deviation(x, INTERVAL))
    error, u, dof, limit = (np.full(len(SYMBOLS), np.nan) for _ in range(4))
    for k, name in enumerate(SYMBOLS):
        if name in found.names:
            i = found.names.index(name)
            error[k] = found.values[i] - getattr(model, name)
            u[k], dof[k] = found.u[i], found.dof[i]
        else:
            limit[k] = found.bounds[name]
    return {"error": error, "u": u, "dof": dof, "limit": limit, "sound": np.array(float(not found.findings))}
