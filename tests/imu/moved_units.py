"""A unit that somebody holds still, turns, and holds still again: samples by SciPy's rotations, earth rate included.

Nothing here is shared with the program but the records that it reads.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from inercal.systems.imu.sections.carried import Move
from inercal.systems.imu.sections.section import Section

EARTH, DEG, GRAVITY, LATITUDE = 7.292115e-5, np.pi / 180, 9.81, 48 * np.pi / 180
PAIRS = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]


def filled(off):
    """Matrix of unit diagonal from its six other elements."""
    out = np.eye(3)
    for (i, j), value in zip(PAIRS, off, strict=True):
        out[i, j] = value
    return out


@dataclass
class Record:
    """Samples, the begin and end of each rest, the truth by name, and attitudes in the rests."""

    t: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    rests: list
    truth: dict
    attitudes: Rotation

    def sections(self, **said):
        """The rests; ``said`` holds what is known of each, by the name of the field."""
        out = []
        for k, (i, j) in enumerate(self.rests):
            more = {name: values[k] for name, values in said.items()}
            acc, gyro = (y[i:j].mean(axis=0) for y in (self.acc, self.gyro))
            span = float(self.t[j - 1] - self.t[i])
            out.append(Section("rest", name=f"rest {k + 1}", acc=acc, gyro=gyro, duration=span, **more))
        return out

    def moves(self, **more):
        """The moves between them."""
        out = []
        for k, ((_, a), (b, _)) in enumerate(zip(self.rests[:-1], self.rests[1:], strict=True)):
            span = slice(a - 1, b + 1)
            out.append(Move(k, k + 1, self.t[span], self.gyro[span], self.acc[span], **more))
        return out


def turned_by_hand(
    rng,
    rests=24,
    rest=3.0,
    move=2.0,
    turns=None,
    rate=100.0,
    noise=(8e-3, 5.6e-3),
    unit="SI",
    drift=0.0,
    walk=0.0,
    swing=0.5,
    level=False,
):
    """A record of a unit in the hand. ``turns`` (rests - 1, 3) are rotation vectors of the moves; drawn if absent.
    ``drift`` [rad/s] is what the biases of the gyro gain over the record, ``walk`` [rad/s] a slow error of its rate in
    moves, ``swing`` [rad] how far their axes swing; ``level``: it begins upright."""
    v = rng.normal(0, 1.2, (rests - 1, 3)) if turns is None else np.asarray(turns)
    aside = rng.normal(0, swing, v.shape)
    attitude = [Rotation.identity() if level else Rotation.from_rotvec(rng.normal(0, 2, 3))]
    for turn in v:
        attitude.append(attitude[-1] * Rotation.from_rotvec(turn))
    period, hold = rest + move, rest
    n = round((rests * period - move) * rate)
    t = np.arange(n) / rate

    def at(times):
        k = np.clip((times // period).astype(int), 0, rests - 1)
        s = np.clip((times - k * period - hold) / move, 0, 1)
        s = np.where(k < rests - 1, s, 0.0)
        which = np.minimum(k, rests - 2)
        along, bump = s**3 * (10 - 15 * s + 6 * s**2), 64 * s**3 * (1 - s) ** 3
        base = Rotation.concatenate(attitude)[k]
        return (
            base
            * Rotation.from_rotvec(along[:, None] * v[which])
            * Rotation.from_rotvec(bump[:, None] * aside[which])
        )

    h = 1e-4
    here = at(t)
    relative = (at(t - h).inv() * at(t + h)).as_rotvec() / (2 * h)
    omega = relative + here.inv().apply(EARTH * np.array([np.cos(LATITUDE), 0, np.sin(LATITUDE)]))
    f = here.inv().apply([0, 0, GRAVITY])
    k0, k1, m = rng.normal(0, 0.2, 3), 1 + rng.normal(0, 0.01, 3), rng.normal(0, 0.01, 6) * [1, 1, 0, 1, 0, 0]
    d, s, off = rng.normal(0, 0.02, 3), 1 + rng.normal(0, 0.01, 3), rng.normal(0, 0.01, 6)
    if unit == "counts":
        k1, k0, s, d = 417 * k1, 417 * k0, 940 * s, 940 * d
    acc = k0 + k1 * ((f + rng.normal(0, noise[0], f.shape)) @ filled(m).T)
    moving = np.abs(relative).max(axis=1) > 1e-9
    slow = (
        walk * rng.normal(size=(rests, 3))[np.minimum((t // period).astype(int), rests - 1)] * moving[:, None]
    )
    change = np.outer(t / t[-1] - 0.5, rng.normal(0, drift, 3)) if drift else 0.0
    w = omega @ filled(off).T + rng.normal(0, noise[1], omega.shape) + change + slow
    names = [f"{p}_{'xyz'[i]}{'xyz'[j]}" for p in "MT" for i, j in PAIRS]
    truth = dict(zip(names, [*m, *off], strict=True))
    for name, value in (("K0", k0), ("K1", k1), ("D_F", d), ("S", s)):
        truth |= {f"{name}_{axis}": value[i] for i, axis in enumerate("xyz")}
    samples = np.round(rate * np.array([(k * period, k * period + hold) for k in range(rests)])).astype(int)
    return Record(
        t, acc, d + s * w, [(int(a) + 1, int(b)) for a, b in samples], truth, Rotation.concatenate(attitude)
    )
