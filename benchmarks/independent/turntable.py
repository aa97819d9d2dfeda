"""A turntable with ordinary faults, in plain NumPy: it shares no code with the product.

Rotations, signs and terms are written out from the publication (Zhao et al. 2023) and IEEE names: base north, west,
up; outer axis y (phi1), inner axis z (phi2); rows ``u C_nb``. Angles in rad, rates in deg/h, accelerations in m/s^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EARTH = 15.041067178669  # deg/h
GRAVITY = 9.8
LATITUDE = np.radians(45.0)
ARCSEC = np.pi / 648000.0

REDRAWN = ("dphi_y1", "dalpha_x1", "dalpha_z1", "dphi_z2", "dalpha_x2", "dalpha_y2")
STAYING = ("deps_x", "deps_y", "dtheta_x", "dtheta_y", "dtheta_z")
#: the chain: axis and what turns about it; a digit is a joint
CHAIN = (
    ("y", "1"), ("y", "dphi_y1"), ("x", "dalpha_x1"), ("z", "dalpha_z1"), ("x", "deps_x"), ("y", "deps_y"),
    ("z", "2"), ("z", "dphi_z2"), ("x", "dalpha_x2"), ("y", "dalpha_y2"),
    ("x", "dtheta_x"), ("y", "dtheta_y"), ("z", "dtheta_z"),
)  # fmt: skip

#: a gyrowheel's axes, three gyros, three accelerometers: their true terms
WHEEL = {
    "k_x": 1.01, "k_y": -0.02, "k_z": 0.01, "DX_F": 50.0, "DX_X": 60.0, "DX_Y": 40.0, "DX_Z": 8.0, "DX_XX": 2.0,
    "DX_YY": 1.5, "DX_XY": 1.0, "DX_XZ": 3.0, "DX_YZ": 2.5, "kY_x": 0.015, "kY_y": 0.99, "kY_z": -0.01,
    "DY_F": -20.0, "DY_X": 35.0, "DY_Y": -55.0, "DY_Z": 5.0, "DY_XX": -1.0, "DY_YY": 2.5, "DY_XY": 2.0,
    "DY_XZ": -1.5, "DY_YZ": 3.5,
}  # fmt: skip
ACCELEROMETERS = {
    "K0": np.array([0.002, -0.003, 0.001]),
    "K1": np.array([1.0002, 0.9997, 1.0001]),
    "M": np.array([[1.0, 2e-4, -1e-4], [-2e-4, 1.0, 1.5e-4], [1e-4, -2e-4, 1.0]]),
}
FELT = {
    "gyrowheel": np.array([[0.2, -0.6], [0.7, 0.1], [0.4, 0.5]]),
    "accelerometer": np.array([[0.2, 0.6, -0.4], [0.7, 0.1, 0.5], [0.4, -0.5, 0.3]]),
}
"""Response of the outputs to a horizontal field (north 0.9, west 0.3) along x, y, z of the case."""


def turn(axis: str, angle: np.ndarray) -> np.ndarray:
    """Rotation (..., 3, 3) about an axis; columns are the new axes in the old frame."""
    c, s, o, e = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    rows = {
        "x": [[e, o, o], [o, c, -s], [o, s, c]],
        "y": [[c, o, s], [o, e, o], [-s, o, c]],
        "z": [[c, -s, o], [s, c, o], [o, o, e]],
    }[axis]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


@dataclass(frozen=True)
class Faults:
    """Sizes of faults; nothing is wrong by default.

    ``ramp`` and ``warm_up`` (of ``tau`` in parts of the test) of every output [its unit], from beginning to end;
    ``scale_drift`` relative, over the test; ``heading``, ``tilt_north``, ``tilt_west`` [rad] of the base; ``harmonic``
    joint, order -> amplitude [rad] of its angle; ``backlash`` [rad] of both joints and ``hysteresis`` [output's unit]
    with the sense of approach; ``field`` [output's unit] of a vector fixed to the ground, felt across the case;
    ``latitude`` [rad] added to the true one.
    """

    ramp: float = 0.0
    warm_up: float = 0.0
    tau: float = 0.15
    scale_drift: float = 0.0
    walk: float = 0.0
    heading: float = 0.0
    tilt_north: float = 0.0
    tilt_west: float = 0.0
    harmonic: dict[tuple[int, int], float] = field(default_factory=dict)
    backlash: float = 0.0
    hysteresis: float = 0.0
    field: float = 0.0
    latitude: float = 0.0


def grid(n: int) -> np.ndarray:
    """n x n positions over the full circle, half a step from zero (n n, 2)."""
    steps = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    return np.array([[a, b] for a in steps for b in steps])


def shuffled(n: int, seed: int = 5) -> np.ndarray:
    """The same positions in an order drawn once."""
    return np.random.default_rng(seed).permutation(grid(n))


def tumble() -> np.ndarray:
    """The classic 24 positions (24, 2)."""
    circle = np.pi / 4.0 * np.arange(8)
    zero, quarter = np.zeros(8), np.full(8, np.pi / 2.0)
    pairs = [(circle, zero), (circle, quarter), (quarter, circle)]
    return np.concatenate([np.stack(pair, axis=-1) for pair in pairs])


def approach(angles: np.ndarray) -> np.ndarray:
    """Sense (n, joints) in which each angle was reached, by the shorter way; kept while a joint stands."""
    step = np.angle(np.exp(1j * np.diff(angles, axis=0)))
    sense = np.zeros_like(angles)
    for k in range(1, len(angles)):
        for j in range(angles.shape[1]):
            half = abs(abs(step[k - 1, j]) - np.pi) < 1e-6
            moved = abs(step[k - 1, j]) > 1e-6 and not half
            sense[k, j] = np.sign(step[k - 1, j]) if moved else 0.0 if half else sense[k - 1, j]
    return sense


def inputs(angles, errors, faults):
    """Specific force and earth rate (n, 3) on the instrument's axes, and its attitude (n, 3, 3)."""
    n = len(angles)
    real = angles.copy()
    for (joint, order), size in faults.harmonic.items():
        real[:, joint - 1] += size * np.cos(order * angles[:, joint - 1] + 0.7 + joint + order)
    real = real + faults.backlash * approach(angles)
    level = turn("x", np.full(n, faults.tilt_north)) @ turn("y", np.full(n, faults.tilt_west))
    C = turn("z", np.full(n, faults.heading)) @ level
    for axis, what in CHAIN:
        value = real[:, int(what) - 1] if what in "12" else errors.get(what, np.zeros(n))
        C = C @ turn(axis, value)
    L = LATITUDE + faults.latitude
    up, rate = np.array([0.0, 0.0, GRAVITY]), EARTH * np.array([np.cos(L), 0.0, np.sin(L)])
    return up @ C, rate @ C, C


def wheel(f, w, axis):
    """Output [deg/h] of an axis of the gyrowheel: gravity's reference is the opposite of specific force."""
    k, D = {"x": ("k", "DX"), "y": ("kY", "DY")}[axis]
    a = -f / GRAVITY
    made = WHEEL[f"{D}_F"] + sum(WHEEL[f"{k}_{i}"] * w[:, j] for j, i in enumerate("xyz"))
    made = made + sum(WHEEL[f"{D}_{i}"] * a[:, j] for j, i in enumerate("XYZ"))
    for i, j in ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2)):
        made = made + WHEEL[f"{D}_{'XYZ'[i]}{'XYZ'[j]}"] * a[:, i] * a[:, j]
    return made


def recorded(rng, kind, angles, noise, tolerance, faults=Faults(), samples=1, within=0.0):
    """One test: outputs (n, channels), or (n samples, channels) in time where each dwell has so many.

    ``tolerance`` [rad] half width of every error of the table, uniform; ``noise`` of a reading; ``within`` of a sample
    beside that.
    """
    n = len(angles)
    errors = {name: rng.uniform(-tolerance, tolerance, n) for name in REDRAWN}
    errors |= {name: np.full(n, rng.uniform(-tolerance, tolerance)) for name in STAYING}
    f, w, C = inputs(angles, errors, faults)
    if kind == "gyrowheel":
        y = np.stack([wheel(f, w, "x"), wheel(f, w, "y")], axis=-1)
    else:
        y = ACCELEROMETERS["K0"] + ACCELEROMETERS["K1"] * (f @ ACCELEROMETERS["M"].T)
    y = y + faults.field * (np.array([0.9, 0.3, 0.0]) @ C) @ FELT[kind]
    y = y + faults.hysteresis * approach(angles).sum(axis=1)[:, None]
    y = y + noise * rng.standard_normal(y.shape)
    y = y + faults.walk * np.cumsum(rng.standard_normal(y.shape), axis=0) / np.sqrt(n)
    t = (np.arange(n * samples) + 0.5) / (n * samples)
    drift = (faults.ramp * (t - 0.5) + faults.warm_up * np.exp(-t / faults.tau))[:, None]
    y = np.repeat(y, samples, axis=0)
    return y * (1.0 + faults.scale_drift * (t[:, None] - 0.5)) + drift + within * rng.standard_normal(y.shape)
