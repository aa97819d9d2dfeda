"""A strapdown unit that rests and is turned by hand, with the faults of hands and laboratories: numpy alone.

No code of inercal: rates are drawn first, attitudes are products of rotation matrices in steps of a tenth of a sample,
and outputs are sums over these, where `inercal.systems.strapdown.simulate` has closed forms of angles and Gauss's
quadrature. n is east-north-up, numbers are in SI.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

EARTH, G, LATITUDE = 7.292115e-5, 9.8, 0.6
UG, DEG_PER_H = 9.80665e-6, np.pi / 180.0 / 3600.0
STEPS = 10
"""Steps of integration in a sample."""


@dataclass
class Unit:
    """A true instrument: gains, biases, K2 [1/(m/s^2)], places [m], delay of the accelerometers [s], asymmetry, G."""

    Ka: np.ndarray
    K0: np.ndarray
    Kg: np.ndarray
    D: np.ndarray
    k2: np.ndarray
    r: np.ndarray
    late: float
    asymmetry: np.ndarray = field(default_factory=lambda: np.zeros(3))
    g: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))

    def truth(self):
        """Coefficients by symbol, outputs in m/s^2 and rad/s."""
        out = {"tau_a": self.late}
        for i, x in enumerate("xyz"):
            k1, s = 1.0 + self.Ka[i, i], 1.0 + self.Kg[i, i]
            out |= {f"K0_{x}": self.K0[i], f"K1_{x}": k1, f"D_F_{x}": self.D[i], f"S_{x}": s}
            out |= {f"K2_{x}": self.k2[i] / k1}
            for j, y in enumerate("xyz"):
                out[f"G_{x}{y}"] = self.g[i, j]
                if j > i:
                    out[f"M_{x}{y}"] = self.Ka[i, j] / k1
                if j != i:
                    out[f"T_{x}{y}"] = self.Kg[i, j] / s
                if i < 2:
                    out[f"r_{x}{y}"] = self.r[i, j]
        return out


def unit(rng):
    """A unit of tactical grade, as its makers let it pass."""
    Ka = np.triu(5e-4 * rng.standard_normal((3, 3)))
    r = np.vstack([0.02 * rng.standard_normal((2, 3)), np.zeros(3)])
    return Unit(
        Ka, 2e-3 * 9.8 * rng.standard_normal(3), 5e-4 * rng.standard_normal((3, 3)),
        15.0 * DEG_PER_H * rng.standard_normal(3), 50e-6 / 9.8 * rng.standard_normal(3), r,
        2e-3 * round(float(rng.uniform(-2.0, 2.0))),
    )  # fmt: skip


@dataclass
class Faults:
    """What goes wrong.

    ``ramp_gyro`` [rad/s] and ``ramp_acc`` [m/s^2] over the test, ``walk_gyro`` [rad/s/sqrt(s)] and ``walk_acc``
    [m/s^2/sqrt(s)] random walks of biases, ``clip`` of the rate [rad/s], ``sway`` speed [m/s] of
    a slow motion that never rests, ``knock`` [m/s] that the accelerometers alone see in a rest, ``lost`` samples in the
    middle of a turn whose stamps were made up, ``clock`` its relative error, ``square`` of a rate [s/rad], ``low_pass``
    time constant [s] of a filter in the gyros that the accelerometers lack.
    """

    ramp_gyro: float = 0.0
    ramp_acc: float = 0.0
    walk_gyro: float = 0.0
    walk_acc: float = 0.0
    clip: float = np.inf
    sway: float = 0.0
    knock: float = 0.0
    lost: int = 0
    clock: float = 0.0
    square: float = 0.0
    low_pass: float = 0.0


PATH = "y y y -y -y -y z x x x -x -x -x z z -z -z -z"
TURNS = tuple(("xyz".index(each[-1]), -np.pi / 2 if each[0] == "-" else np.pi / 2) for each in PATH.split())


@dataclass
class Test:
    """How it is done: turns as (axis, angle), times [s], noise densities, vibration [m/s], sample rate."""

    turns: tuple = TURNS
    turn: float = 3.0
    rest: float = 8.0
    first: float = 20.0
    angle_walk: float = 0.05 * np.pi / 180.0 / 60.0
    velocity_walk: float = 50.0 * UG
    vibration: float = 2e-4
    rate: float = 50.0
    wobble: float = 0.15


def lag(time, test):
    """Delay [s] of slow rates by a filter of that time constant, in steps as it is made here; 0 without one."""
    h = 1.0 / (test.rate * STEPS)
    left = np.exp(-h / time) if time else 0.0
    return h * left / (1.0 - left)


def rotation(v):
    """Rotation matrix of a rotation vector (3,)."""
    a = float(np.sqrt(v @ v))
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    if a < 1e-8:
        return np.eye(3) + K
    return np.eye(3) + np.sin(a) / a * K + (1.0 - np.cos(a)) / a**2 * (K @ K)


def motion(rng, test):
    """Rates (n, 3) of b against n and accelerations (n, 3) in n, at the middle of each step."""
    h = 1.0 / (test.rate * STEPS)
    still, rates, pushes = lambda t: np.zeros((round(t / h), 3)), [], []
    rates.append(still(test.first))
    pushes.append(still(test.first))
    for axis, angle in test.turns:
        n = round(test.turn / h)
        s = (np.arange(n) + 0.5) / n
        window = np.sin(np.pi * s) ** 4
        w = (
            test.wobble
            * window[:, None]
            * np.sin(2 * np.pi * (rng.uniform(0.5, 1.5, 3) * s[:, None] * test.turn + rng.random(3)))
        )
        w[:, axis] += angle * (window / window.mean() / test.turn)
        # a push and its opposite: speed and way end as they began, but for the place
        way = rng.normal(0.0, 0.1, 3) * np.sin(4 * np.pi * s)[:, None] * window[:, None]
        way -= way.mean(axis=0)
        rates += [w, still(test.rest)]
        pushes += [way, still(test.rest)]
    return np.concatenate(rates), np.concatenate(pushes), h


def record(rng, made, test, fault=Faults()):  # noqa: B008
    """Stamps (n,), forces (n, 3) and rates (n, 3) of a test."""
    w_nb, push, h = motion(rng, test)
    earth = EARTH * np.array([0.0, np.cos(LATITUDE), np.sin(LATITUDE)])
    n = len(w_nb)
    C = np.empty((n, 3, 3))
    at = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # y down
    for k in range(n):
        half = rotation(0.5 * h * w_nb[k])
        C[k] = at @ half
        at = C[k] @ half
    time = (np.arange(n) + 0.5) * h
    speed = h * np.cumsum(push, axis=0) - 0.5 * h * push
    if fault.sway:
        push = push + fault.sway * 2 * np.pi * 0.7 * np.cos(2 * np.pi * (0.7 * time[:, None] + rng.random(3)))
    w = w_nb + np.einsum("nji,j->ni", C, earth)
    f = np.einsum("nji,nj->ni", C, push + 2.0 * np.cross(earth, speed) + [0.0, 0.0, G])
    wd = np.gradient(w, h, axis=0)
    fs = np.empty_like(f)
    for i in range(3):
        r = made.r[i]
        at_place = (
            f
            + np.cross(wd, np.broadcast_to(r, w.shape))
            + np.cross(w, np.cross(w, np.broadcast_to(r, w.shape)))
        )
        fs[:, i] = at_place[:, i]
    acc = fs @ (np.eye(3) + made.Ka).T + made.k2 * fs**2 + made.K0
    gyro = (
        w @ (np.eye(3) + made.Kg).T + made.asymmetry * np.abs(w) + f @ made.g.T + made.D + fault.square * w**2
    )
    part = (time - time.mean()) / time[-1]
    gyro, acc = gyro + fault.ramp_gyro * part[:, None], acc + fault.ramp_acc * part[:, None]
    if fault.low_pass:
        part_of_new = 1.0 - np.exp(-h / fault.low_pass)
        smooth = gyro[0].copy()
        for k in range(n):
            smooth += part_of_new * (gyro[k] - smooth)
            gyro[k] = smooth
    if fault.knock:
        begin = round((test.first + 5 * (test.turn + test.rest) + test.turn + 0.5 * test.rest) / h)
        acc[begin : begin + STEPS, 0] += fault.knock / (STEPS * h)
    shift = round(made.late / h)
    acc = np.roll(acc, shift, axis=0)
    acc, gyro = (
        x[: n - n % STEPS].reshape(-1, STEPS, 3).mean(axis=1)
        for x in (acc, np.clip(gyro, -fault.clip, fault.clip))
    )
    ts, count = 1.0 / test.rate, len(acc)
    vibration = test.vibration * rng.standard_normal((count + 1, 3))
    acc = acc + np.einsum("nji,nj->ni", C[STEPS // 2 :: STEPS][:count], np.diff(vibration, axis=0)) / ts
    acc += test.velocity_walk / np.sqrt(ts) * rng.standard_normal(acc.shape)
    gyro = gyro + test.angle_walk / np.sqrt(ts) * rng.standard_normal(gyro.shape)
    if fault.walk_gyro or fault.walk_acc:
        gyro = gyro + fault.walk_gyro * np.sqrt(ts) * np.cumsum(rng.standard_normal(gyro.shape), axis=0)
        acc = acc + fault.walk_acc * np.sqrt(ts) * np.cumsum(rng.standard_normal(acc.shape), axis=0)
    if fault.lost:
        gone = round((test.first + 0.5 * test.turn) * test.rate) + np.arange(fault.lost)
        acc, gyro = np.delete(acc, gone, axis=0), np.delete(gyro, gone, axis=0)
    return (1.0 + fault.clock) * ts * np.arange(1.0, len(acc) + 1.0), acc, gyro
