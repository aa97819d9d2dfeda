"""Independent forward model: a unit with errors of its own, finite rotations on a turning Earth, noise and rounding."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

LATITUDE = math.radians(48.0)
HEIGHT = 45.0
EARTH = 7.292115e-5
_SINE2 = math.sin(LATITUDE) ** 2
GRAVITY = (
    9.7803253359 * (1 + 0.00193185265241 * _SINE2) / math.sqrt(1 - 0.00669437999013 * _SINE2)
    - 3.0877e-6 * HEIGHT
)
EARTH_RATE = EARTH * np.array([math.cos(LATITUDE), 0.0, math.sin(LATITUDE)])  # north, west, up
G = 9.80665
DEG = math.pi / 180


@dataclass(frozen=True)
class Motion:
    """Times (N,), body-to-world matrices (N, 3, 3), rates and angular accelerations on the body's axes (N, 3)."""

    t: np.ndarray
    C: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    rests: tuple


class Path:
    """Rests and turns one after the other, of a body whose attitude to the world is known."""

    def __init__(self, start=None):
        self.attitude = start or Rotation.identity()
        self.legs = []

    def rest(self, duration):
        self.legs.append(("rest", self.attitude, duration, None))
        return self

    def turn(self, axis, angle, duration, aside=None):
        """A turn about an axis of the body; `aside`: rotation vector by which it ends beside that, as hands do."""
        axis = np.asarray(axis, float) / np.linalg.norm(axis)
        aside = np.zeros(3) if aside is None else np.asarray(aside, float)
        self.legs.append(("turn", self.attitude, duration, (axis * angle, aside)))
        self.attitude = self.attitude * Rotation.from_rotvec(axis * angle) * Rotation.from_rotvec(aside)
        return self

    def spin(self, axis, rate, duration):
        """A steady rate from the first to the last sample."""
        self.legs.append(("spin", self.attitude, duration, np.asarray(axis, float) * rate))
        self.attitude = self.attitude * Rotation.from_rotvec(np.asarray(axis, float) * rate * duration)
        return self

    def to(self, attitude, duration, aside=None):
        """A turn about a fixed axis to another attitude."""
        step = (self.attitude.inv() * attitude).as_rotvec()
        return self.turn(step / np.linalg.norm(step), float(np.linalg.norm(step)), duration, aside)

    def sampled(self, rate):
        """The motion at equal steps of time."""
        ends = np.cumsum([leg[2] for leg in self.legs])
        t = np.arange(round(ends[-1] * rate)) / rate
        which = np.minimum(np.searchsorted(ends, t, side="right"), len(self.legs) - 1)
        C, w, dw, rests = np.empty((len(t), 3, 3)), np.zeros((len(t), 3)), np.zeros((len(t), 3)), []
        for k, (kind, start, duration, how) in enumerate(self.legs):
            rows = which == k
            begin = ends[k] - duration
            if kind == "rest":
                C[rows] = start.as_matrix()
                rests.append((begin, ends[k]))
            elif kind == "spin":
                s = (t[rows] - begin)[:, None]
                C[rows] = (start * Rotation.from_rotvec(how * s)).as_matrix()
                w[rows] = how
            else:
                s = ((t[rows] - begin) / duration)[:, None]
                part = s - np.sin(2 * np.pi * s) / (2 * np.pi)
                speed = (1 - np.cos(2 * np.pi * s)) / duration
                change = 2 * np.pi * np.sin(2 * np.pi * s) / duration**2
                main, aside = how
                last = Rotation.from_rotvec(aside * part)
                C[rows] = (start * Rotation.from_rotvec(main * part) * last).as_matrix()
                seen = last.inv().apply(np.tile(main, (rows.sum(), 1)))
                w[rows] = seen * speed + aside * speed
                dw[rows] = (seen + aside) * change - np.cross(aside * speed, seen * speed)
        return Motion(t, C, w, dw, tuple(rests))


@dataclass(frozen=True)
class Unit:
    """K1 (l + K2 l^2) with l = M f, and S (T w + G f), in SI; then a size and an offset of its outputs."""

    K0: np.ndarray
    K1: np.ndarray
    M: np.ndarray
    K2: np.ndarray
    D: np.ndarray
    S: np.ndarray
    T: np.ndarray
    G: np.ndarray
    acc_noise: float = 1e-3  # m/s^2/sqrt(Hz)
    gyro_noise: float = 1e-4  # rad/s/sqrt(Hz)
    acc_walk: float = 2e-5  # m/s^2/sqrt(s)
    gyro_walk: float = 2e-6  # rad/s/sqrt(s)
    acc_size: float = 1.0
    gyro_size: float = 1.0
    acc_zero: float = 0.0
    gyro_zero: float = 0.0
    acc_unit: str = "m/s^2"
    gyro_unit: str = "rad/s"
    acc_step: float = 0.0
    gyro_step: float = 0.0

    def given(self, **others):
        return dataclasses.replace(self, **others)

    def counts(self, acc=None, gyro=None, acc_zero=0.0, gyro_zero=0.0):
        """Whole counts: `acc` of them for 1 g, `gyro` for 1 deg/s."""
        unit = self
        if acc:
            unit = unit.given(acc_size=G / acc, acc_zero=acc_zero, acc_unit="count", acc_step=1.0)
        if gyro:
            unit = unit.given(gyro_size=DEG / gyro, gyro_zero=gyro_zero, gyro_unit="count", gyro_step=1.0)
        return unit

    def outputs(self, force, rate, fs, rng):
        """Outputs (N, 3) of accelerometers and gyro to specific force [m/s^2] and rate [rad/s], in their units."""
        level = force @ self.M.T
        acc = self.K0 + self.K1 * (level + self.K2 * level**2)
        gyro = self.D + self.S * (rate @ self.T.T + force @ self.G.T)
        n = len(acc)
        acc = acc + rng.normal(0, self.acc_noise * math.sqrt(fs / 2), (n, 3))
        acc = acc + wander(rng, self.acc_walk / math.sqrt(fs), n)
        gyro = gyro + rng.normal(0, self.gyro_noise * math.sqrt(fs / 2), (n, 3))
        gyro = gyro + wander(rng, self.gyro_walk / math.sqrt(fs), n)
        return rounded(acc / self.acc_size + self.acc_zero, self.acc_step), rounded(
            gyro / self.gyro_size + self.gyro_zero, self.gyro_step
        )

    def log(self, path, fs, rng, arm=(0.0, 0.0, 0.0)):
        """Times and outputs along a path; `arm`: place of the accelerometers beside the pivot [m]."""
        motion = path.sampled(fs)
        arm = np.asarray(arm)
        force = motion.C.transpose(0, 2, 1) @ np.array([0.0, 0.0, GRAVITY])
        force = force + np.cross(motion.acceleration, arm) + np.cross(motion.rate, np.cross(motion.rate, arm))
        rate = motion.rate + motion.C.transpose(0, 2, 1) @ EARTH_RATE
        acc, gyro = self.outputs(force, rate, fs, rng)
        return motion.t, acc, gyro

    def truth(self, frame):
        """Values by name as (value, unit), in the frame of the `case`, of the `accelerometers` or of the `gyro`."""
        A, B = self.K1[:, None] * self.M, self.S[:, None] * self.T
        Q = np.eye(3)
        if frame != "case":
            Q = frame_of(A if frame == "accelerometers" else B)
        A, B, force = A @ Q.T, B @ Q.T, (self.S[:, None] * self.G) @ Q.T
        K1, S = np.diag(A), np.diag(B)
        a, w = self.acc_unit, self.gyro_unit
        values = {}
        for i, x in enumerate("xyz"):
            values[f"K0_{x}"] = (self.K0[i] * (1.0 if a == "m/s^2" else 1 / self.acc_size) + self.acc_zero, a)
            values[f"K1_{x}"] = (K1[i] if a == "m/s^2" else K1[i] / self.acc_size, over(a, "m/s^2"))
            values[f"K2_{x}"] = (self.K2[i], "1/(m/s^2)")
            values[f"D_F_{x}"] = (
                self.D[i] * (1.0 if w == "rad/s" else 1 / self.gyro_size) + self.gyro_zero,
                w,
            )
            values[f"S_{x}"] = (S[i] if w == "rad/s" else S[i] / self.gyro_size, over(w, "rad/s"))
            for j, y in enumerate("xyz"):
                if i != j:
                    values[f"M_{x}{y}"] = (A[i, j] / K1[i], "rad")
                    values[f"T_{x}{y}"] = (B[i, j] / S[i], "rad")
                scale = 1.0 if w == "rad/s" else 1 / self.gyro_size
                values[f"G_{x}{y}"] = (force[i, j] * scale, over(w, "m/s^2"))
        return values


def wander(rng, step, n):
    """Random walks (n, 3) about their mean: the bias of a log is that over all of it."""
    walk = np.cumsum(rng.normal(0, step, (n, 3)), axis=0)
    return walk - walk.mean(axis=0)


def over(output, unit):
    """The unit of an output over an input."""
    return f"({output})/({unit})"


def frame_of(matrix):
    """The rotation into the frame in which a matrix (3, 3) is upper triangular with a positive diagonal."""
    flip = np.eye(3)[::-1]
    q, r = np.linalg.qr((flip @ matrix).T)
    sign = np.diag(np.sign(np.diag(r)))
    return flip @ sign @ q.T


def rounded(values, step):
    """Values to a step; 0: as they are."""
    return np.round(values / step) * step if step else values


def unit(rng, size=1.0):
    """A MEMS unit of usual errors; `size` multiplies them."""

    def off(sd, shape):
        return size * rng.normal(0, sd, shape)

    def skew(sd):
        matrix = off(sd, (3, 3))
        np.fill_diagonal(matrix, 1.0)
        return matrix

    return Unit(
        K0=off(0.15, 3),
        K1=1 + off(0.008, 3),
        M=skew(0.008),
        K2=off(1e-6, 3),
        D=off(0.7 * DEG, 3),
        S=1 + off(0.008, 3),
        T=skew(0.008),
        G=off(0.01 * DEG / G, (3, 3)),
    )


def side(axis, sign, rng=None, placing=0.3 * DEG, heading=0.0):
    """The attitude in which an axis of the case points up (sign +1) or down, off by the placing."""
    up = np.zeros(3)
    up["xyz".index(axis)] = sign
    rotation, _ = Rotation.align_vectors([[0.0, 0.0, 1.0]], [up])
    error = (
        Rotation.identity()
        if rng is None
        else Rotation.from_rotvec(np.append(rng.normal(0, placing, 2), 0.0))
    )
    return Rotation.from_rotvec([0, 0, heading]) * error * rotation


SIDES = [(axis, sign) for axis in "xyz" for sign in (1, -1)]


def sides_path(rng, hold=5.0, turning=2.5, placing=0.3 * DEG, order=SIDES):
    """A path over the sides, one after the other."""
    attitudes = [side(axis, sign, rng, placing, rng.uniform(0, 2 * np.pi)) for axis, sign in order]
    path = Path(attitudes[0]).rest(hold)
    for attitude in attitudes[1:]:
        path.to(attitude, turning, rng.normal(0, 0.02, 3)).rest(hold)
    return path


def poses_path(rng, poses=24, hold=3.0, start=10.0, turning=2.0, least=60, most=170):
    """A path through poses as of a unit that goes from hand to table and back."""
    path = Path(Rotation.from_rotvec(rng.normal(0, 0.05, 3))).rest(start)
    for _ in range(poses - 1):
        angle = DEG * rng.uniform(least, most)
        path.turn(rng.normal(size=3), angle, turning * rng.uniform(0.8, 1.3), rng.normal(0, 0.1, 3))
        path.rest(hold * rng.uniform(0.9, 1.3))
    return path
