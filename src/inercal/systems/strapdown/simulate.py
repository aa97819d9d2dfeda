"""A simulated recording: a unit of known truth that rests and is turned, once after the other.

Attitude and path are closed forms of time, the outputs are means over each sample by Gauss-Legendre quadrature; no code
is shared with the estimation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.geometry.rotations import Axis, elementary
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import parse_unit
from inercal.systems.strapdown.model.coefficients import K0, K2, KA, KG, TAU, A, D, G, R
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import Motion, Noise, StrapdownSettings, TurnPlan

AXES: Final[tuple[Axis, Axis, Axis]] = ("x", "y", "z")
_ORDER: Final[tuple[Axis, Axis, Axis]] = ("z", "x", "y")

_POINTS, _WEIGHTS = (each / 2.0 for each in np.polynomial.legendre.leggauss(5))
"""Places within a sample, from its middle in its length, and their weights."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Motion that the sensors meet at times (n,): rate ``w`` and its derivative ``wd`` in b, specific force ``f`` of
    the origin in b, all (n, 3), and the attitude ``C_nb`` (n, 3, 3)."""

    w: Array
    wd: Array
    f: Array
    C_nb: Array


class UnitTurn(NamedTuple):
    """A turn from ``begin`` [s], lasting ``time``, from ``C_nb`` (3, 3) about ``axis`` by ``angle``, along ``path``."""

    begin: float
    time: float
    C_nb: Array
    axis: int
    angle: float
    path: Array


def _turns(plan: TurnPlan, motion: Motion, rng: np.random.Generator) -> Iterator[UnitTurn]:
    """The turns of a plan, one after the other; each goes along a way of random direction."""
    C, begin = start_attitude(plan), plan.first_dwell
    for axis, angle in plan.turns:
        time = plan.time_of(angle)
        direction = rng.standard_normal(3)
        yield UnitTurn(
            begin, time, C, axis, angle, motion.translation * direction / np.linalg.norm(direction)
        )
        C = np.asarray(C @ elementary(AXES[axis], angle))
        begin += time + plan.dwell


def start_attitude(plan: TurnPlan) -> Array:
    """C_nb (3, 3) of the first rest: from x east, y north, z up turned about z by yaw, then x by pitch, then y by
    roll."""
    pitch, roll, yaw = plan.start
    z, x, y = (elementary(axis, angle) for axis, angle in zip(_ORDER, (yaw, pitch, roll), strict=True))
    return np.asarray(z @ x @ y)


def _bump(s: Array, size: float, rate: float, time: float) -> tuple[Array, Array, Array]:
    """An oscillation of ``size`` with circular ``rate`` under sin^4 of the turn's progress ``s``, and two derivatives
    by time."""
    p = np.pi / time
    a, da = np.sin(np.pi * s) ** 4, 4.0 * p * np.sin(np.pi * s) ** 3 * np.cos(np.pi * s)
    dda = 4.0 * p**2 * (3.0 * np.sin(np.pi * s) ** 2 - 4.0 * np.sin(np.pi * s) ** 4)
    t = s * time * rate
    b, db, ddb = np.sin(t), rate * np.cos(t), -(rate**2) * np.sin(t)
    return size * a * b, size * (da * b + a * db), size * (dda * b + 2.0 * da * db + a * ddb)


def truth(turn: UnitTurn, t: Array, motion: Motion, earth: Array, gravity: float) -> Truth:
    """Motion that the sensors meet at times (n,) within a turn, or before or after it."""
    s = np.clip((t - turn.begin) / turn.time, 0.0, 1.0)
    two_pi = 2.0 * np.pi
    smooth = s - np.sin(two_pi * s) / two_pi, 1.0 - np.cos(two_pi * s), two_pi * np.sin(two_pi * s)
    main = tuple(turn.angle * x / turn.time**k for k, x in enumerate(smooth))
    rate = two_pi * motion.frequency
    others = [(turn.axis + 1) % 3, (turn.axis + 2) % 3]
    swings = (
        _bump(s, motion.wobble, rate, turn.time),
        _bump(s, -motion.wobble, 0.8 * rate, turn.time),
    )
    C = np.broadcast_to(turn.C_nb, (len(t), 3, 3))
    w, wd = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for axis, (angle, first, second) in zip([turn.axis, *others], [main, *swings], strict=True):
        step, unit = elementary(AXES[axis], angle), np.eye(3)[axis]
        w, wd = np.einsum("nji,nj->ni", step, w), np.einsum("nji,nj->ni", step, wd)
        wd = wd - np.cross(first[:, None] * unit, w) + second[:, None] * unit
        w = w + first[:, None] * unit
        C = C @ step
    # there and on: a path of no velocity and acceleration at its ends
    speed = turn.path * (1.0 - np.cos(two_pi * s))[:, None] / turn.time
    push = turn.path * (two_pi * np.sin(two_pi * s))[:, None] / turn.time**2
    inertial = np.einsum("nji,j->ni", C, earth)
    of_earth = np.cross(inertial, w)  # earth rate in b changes while b turns
    force = np.einsum("nji,nj->ni", C, push + 2.0 * np.cross(earth, speed) + [0.0, 0.0, gravity])
    return Truth(w + inertial, wd + of_earth, force, C)


class _Means(NamedTuple):
    """Means over samples (n, 3): rate and its size and force at times of the gyros, force and its square at the
    accelerometers, and the attitude (n, 3, 3)."""

    w: Array
    size: Array
    f: Array
    fs: Array
    square: Array
    C_nb: Array


def _means(turn: UnitTurn, stamps: Array, settings: StrapdownSettings, c: Array, ts: float) -> _Means:
    """Means over the samples that end at ``stamps`` (n,)."""
    latitude = settings.latitude
    earth = EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    r, total = c[R].reshape(3, 3), None
    for place, weight in zip(_POINTS, _WEIGHTS, strict=True):
        t = stamps + (place - 0.5) * ts
        at_gyro, at_acc = (
            truth(turn, each, settings.motion, earth, settings.site.gravity) for each in (t, t - c[TAU])
        )
        w, wd = at_acc.w, at_acc.wd
        turning = np.cross(wd[:, None], r) + np.cross(w[:, None], np.cross(w[:, None], r))
        fs = at_acc.f + np.einsum("nii->ni", turning)
        each = _Means(at_gyro.w, np.abs(at_gyro.w), at_gyro.f, fs, fs**2, at_gyro.C_nb)
        total = [weight * x + (0.0 if total is None else total[k]) for k, x in enumerate(each)]
    assert total is not None
    return _Means(*total)


def simulated(settings: StrapdownSettings, c: Array, rng: np.random.Generator, noise: bool = True) -> Samples:
    """Outputs of a unit with the coefficients ``c`` (51,) that rests and turns as planned; ``noise`` of sensors and
    stand as the study states it, or none."""
    plan = settings.plan
    if plan is None or not plan.turns:
        where = "plan" if plan is None else "plan.turns"
        raise StudyError(where, 'missing, expected turns, such as turns = [["y", "90 deg"], ["z", "90 deg"]]')
    ts, turns = 1.0 / plan.sample_rate, list(_turns(plan, settings.motion, rng))
    last = turns[-1]
    count = round((last.begin + last.time + plan.dwell) / ts)
    stamps = ts * np.arange(1.0, count + 1.0)
    edges = [0] + [round((each.begin - 0.5 * plan.dwell) / ts) for each in turns[1:]] + [count]
    parts = list[_Means]()
    for turn, first, end in zip(turns, edges[:-1], edges[1:], strict=True):
        begin, done = (
            round(each / ts) for each in (turn.begin - abs(c[TAU]), turn.begin + turn.time + abs(c[TAU]))
        )
        for low, high in ((first, begin - 1), (begin - 1, done + 2), (done + 2, end)):
            # nothing changes before and after the turn
            at = stamps[low:high] if low == begin - 1 else stamps[low : low + 1]
            means = _means(turn, at, settings, c, ts)
            parts.append(_Means(*(np.resize(each, (high - low, *each.shape[1:])) for each in means)))
    mean = _Means(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    rate = (
        mean.w @ (np.eye(3) + c[KG].reshape(3, 3)).T + c[A] * mean.size + mean.f @ c[G].reshape(3, 3).T + c[D]
    )
    force = mean.fs @ (np.eye(3) + c[KA].reshape(3, 3)).T + c[K2] * mean.square + c[K0]
    if noise:
        sway, shake = _disturbed(mean, settings, c[R].reshape(3, 3), rng, ts)
        white, walk = _sensor_noise(settings.noise, count, rng, ts)
        if settings.noise.turn_attitude or settings.noise.turn_velocity:
            ends = [round((each.begin + each.time) / ts) for each in turns]
            _add_turn_noise(settings.noise, ends, mean.C_nb, rng, (rate, force), ts)
        rate, force = rate + sway + white[0] + walk[0], force + shake + white[1] + walk[1]
    return Samples(rate, force, ts)


def _sensor_noise(
    noise: Noise, count: int, rng: np.random.Generator, ts: float
) -> tuple[list[Array], list[Array]]:
    """White noise and walks of biases of gyros and accelerometers, (count, 3) each."""
    densities = noise.angle_random_walk, noise.velocity_random_walk
    white = [rng.standard_normal((count, 3)) * density / np.sqrt(ts) for density in densities]
    walks = noise.gyro_walk, noise.accelerometer_walk
    return white, [np.cumsum(rng.standard_normal((count, 3)) * walk * np.sqrt(ts), axis=0) for walk in walks]


def _add_turn_noise(
    noise: Noise,
    ends: list[int],
    C_nb: Array,
    rng: np.random.Generator,
    outputs: tuple[Array, Array],
    ts: float,
) -> None:
    """Add to rates and forces (n, 3) what attitude and velocity do not close by, in the sample where each turn
    ends."""
    for output, size in zip(outputs, (noise.turn_attitude, noise.turn_velocity), strict=True):
        jumps = size * rng.standard_normal((len(ends), 3)) / ts
        output[ends] += np.einsum("nji,nj->ni", C_nb[ends], jumps)


def _disturbed(
    mean: _Means, settings: StrapdownSettings, r: Array, rng: np.random.Generator, ts: float
) -> tuple[Array, Array]:
    """Rates and forces (n, 3) that the stand adds by vibration and, where the attitude within a rest is held, by sway,
    which accelerometers at ``r`` (3, 3) feel, too."""
    count = len(mean.w)
    velocity = settings.rests.velocity * _smooth(rng, count + 1, ts)
    force = np.einsum("nji,nj->ni", mean.C_nb, np.diff(velocity, axis=0)) / ts
    if settings.rests.attitude is None:
        return np.zeros((count, 3)), force
    angle = settings.rests.attitude * _smooth(rng, count + 3, ts)
    sway = 0.5 * (angle[2:] - angle[:-2]) / ts  # at the stamps, and before the first sample
    at_levers = np.einsum("nii->ni", np.cross((np.diff(sway, axis=0) / ts)[:, None], r))
    angle = angle[1:-1]
    middle = 0.5 * (angle[1:] + angle[:-1])
    # turned by a small angle, the unit has its own axes for what the plan turns and pushes it by
    rate = np.diff(angle, axis=0) / ts - np.cross(middle, mean.w)
    return rate, force + at_levers - np.cross(middle, mean.f)


def _smooth(rng: np.random.Generator, count: int, ts: float) -> Array:
    """Noise (count, 3) of unit variance that is correlated over a tenth of a second."""
    reach = max(1, round(0.3 / ts))
    weights = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) * ts / 0.05))
    white = rng.standard_normal((count + 2 * reach, 3))
    smoothed = np.stack([np.convolve(column, weights, "valid") for column in white.T], axis=-1)
    return np.asarray(smoothed / np.linalg.norm(weights))


def to_record(samples: Samples) -> Record:
    """The recording as a record: t, gyro_x..z [rad/s], acc_x..z [m/s^2]."""
    columns = []
    for sensor, unit, values in (("gyro", "rad/s", samples.rate), ("acc", "m/s^2", samples.force)):
        columns += [(f"{sensor}_{axis}", parse_unit(unit), values[:, k]) for k, axis in enumerate("xyz")]
    return record_of(columns, samples.ts * np.arange(1.0, len(samples.rate) + 1.0))
