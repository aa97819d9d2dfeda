"""Noise simulated and estimated: tasks that a spawned process can import."""

import numpy as np

from inercal.instruments.noise import SYMBOLS, NoiseModel
from inercal.noise.coefficients import noise_coefficients
from inercal.noise.deviation import allan_deviation

SAMPLES, INTERVAL = 20000, 0.01

MIXES = {
    # a gyro of 0.3 deg/sqrt(h), 40 deg/h and its drift [rad/s]
    "mems": NoiseModel(N=1e-4, B=2e-4, K=2e-4),
    # an accelerometer of 100 ug/sqrt(Hz) that counts velocity in steps and warms up [m/s^2]
    "counting": NoiseModel(N=1e-3, Q=2e-4, R=4e-5),
}


def estimate(mix, rng):
    """Errors, u and dof (5,) of one simulated recording; NaN where a coefficient was not seen, then its limit."""
    model = MIXES[mix]
    found = noise_coefficients(allan_deviation(model.simulate(SAMPLES, INTERVAL, rng), INTERVAL))
    error, u, dof, limit = (np.full(len(SYMBOLS), np.nan) for _ in range(4))
    for k, name in enumerate(SYMBOLS):
        if name in found.names:
            i = found.names.index(name)
            error[k] = found.values[i] - getattr(model, name)
            u[k], dof[k] = found.u[i], found.dof[i]
        else:
            limit[k] = found.bounds[name]
    return {"error": error, "u": u, "dof": dof, "limit": limit, "sound": not found.findings}
