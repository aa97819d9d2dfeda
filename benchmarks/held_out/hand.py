"""An IMU in the hand: many poses, turned between them by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import inercal as ic

from . import sample_faults as shared
from .means import triad
from .motion import Motion
from .samples import World, mems
from .trial import DEG, G0, Act, Array, Case, columns_of, log_uniform, turned_by

GRAVITY, GRAVITY_U = 9.80938, 5e-5
RATE = 100.0


@dataclass(frozen=True)
class Hand:
    """A recording, drawn."""

    truth: dict[str, float]
    motion: Motion
    end: float
    k2: Array
    k2_u: float
    noise: tuple[float, float]
    gravity: float
    latitude: float
    clock: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The recording with a fault."""
        t = np.arange(1, round(self.end * RATE) + 1) / RATE
        turn, hold = self.motion.numbers(t - 0.5 / RATE)
        world = World(
            t, turn, hold, np.zeros(len(t), int), self.truth, np.random.default_rng(self.seed), self.noise, self.k2,
            self.gravity, SimpleNamespace(), self.clock,
        )  # fmt: skip
        if act:
            act(world, size)
        world.make(*self.motion.feel(t, 1 / RATE, self.gravity, self.latitude))
        rows, stamps = world.rows()
        record = ic.record(t=stamps, acc=world.acc[rows], gyro=world.gyro[rows])
        study = ic.study(
            "imu",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2", "latitude": f"{self.latitude / DEG:.8g} deg"},
            method="multiposition",
            time_base="20 ppm",
            k2=f"0 ± {self.k2_u * G0 * 1e6:.6g} ug/g^2",
        )
        misses = self.misses(self.truth, world)
        return Case(
            record,
            study,
            self.truth,
            misses,
            lambda: columns_of(lambda of: self.misses(of, world), self.truth),
        )

    def misses(self, truth: Mapping[str, float], world: World) -> Array:
        """Of each rest the force it tells less gravity, of each turn how far gravity arrives elsewhere, over noise."""
        rows, stamps = world.rows()
        step = float(np.median(np.diff(stamps)))
        offset, drift = (np.array([truth[f"{name}_{a}"] for a in "xyz"]) for name in ("K0", "D_F"))
        f = np.linalg.solve(triad(truth, "K1", "M"), (world.acc[rows] - offset).T).T
        f = f - self.k2 * f**2
        turns = turned_by(np.linalg.solve(triad(truth, "S", "T"), (world.gyro[rows] - drift).T).T * step)
        hold = world.hold[rows]
        found, before = [], None
        for number in np.unique(hold[hold >= 0]):
            of = np.flatnonzero(hold == number)
            mean, force_u = f[of].mean(axis=0), self.noise[0] / np.sqrt(len(of))
            size = np.linalg.norm(mean)
            found.append((size - GRAVITY) / force_u)
            if before is not None:
                last, middle, last_u = before
                way = turns[middle : of[len(of) // 2]]
                rate_u = self.noise[1] * step * np.sqrt(len(way))
                u = np.sqrt(rate_u**2 + (force_u**2 + last_u**2) / GRAVITY**2)
                found.extend((last @ product(way) - mean / size) / u)
            before = mean / size, of[len(of) // 2], force_u
        return np.array(found)


def product(turns: Array) -> Array:
    """The product (3, 3) of rotations (n, 3, 3), the first on the left."""
    while len(turns) > 1:
        odd = turns[-1:] if len(turns) % 2 else turns[:0]
        turns = np.concatenate(
            [turns[0 : len(turns) - len(odd) : 2] @ turns[1 : len(turns) - len(odd) : 2], odd]
        )
    return np.asarray(turns[0])


def draw(rng: np.random.Generator) -> Hand:
    """A recording, all inputs within their stated uncertainty."""
    poses = int(rng.integers(20, 36))
    times, holds = np.round(rng.uniform(1.5, 3.0, size=poses), 2), np.round(rng.uniform(3, 5, size=poses), 2)
    begins = 30.0 + np.cumsum(np.concatenate([[0.0], (times + holds)[:-1]]))
    axes = rng.normal(size=(poses, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    motion = Motion(
        turned_by(0.1 * rng.normal(size=3)), begins, times, axes, DEG * rng.uniform(60, 170, size=poses),
        0.2 * rng.normal(size=(poses, 3)),
    )  # fmt: skip
    noise = (
        G0 * log_uniform(rng, 3e-5, 2e-4) * np.sqrt(RATE),
        log_uniform(rng, 0.05, 0.6) * DEG / 60 * np.sqrt(RATE),
    )
    k2_u = float(rng.choice([5, 30])) * 1e-6 / G0
    return Hand(
        mems(rng, full=False), motion, begins[-1] + times[-1] + 5, k2_u * rng.normal(size=3), k2_u, noise,
        GRAVITY + GRAVITY_U * rng.normal(), rng.uniform(-55, 65) * DEG, 20e-6 * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def foam_sinks(world: World, size: float) -> None:
    """A lean in each hold that settles within 1.5 s."""
    shared.sinks(world, size, 1.5)


FAULTS: dict[str, tuple[float, Act]] = {
    "foam_sinks": (0.5 * DEG, foam_sinks),
    "accelerometer_wanders": (1e-2, shared.accelerometer_wanders),
    "gyro_scale_warms": (1e-2, shared.scale_warms),
    "turns_clipped": (0.1, shared.turns_clipped),
    "force_clipped": (1e-3, shared.force_clipped),
    "clock_fast": (1e-3, shared.clock_fast),
    "packets_lost": (5, shared.packets_lost),
    "weight_on_gyro": (1e-3, shared.weight_on_gyro),
    "large_k2": (1e-3, shared.large_k2),
    "supply_step": (1e-3, shared.supply_step),
    "unequal_senses": (1e-3, shared.unequal_senses),
    "fan_runs": (1e-2, shared.fan_runs),
    "knocked_gyro": (1e-3, shared.knocked_gyro),
    "last_value_held": (0.1, shared.last_value_held),
    "rate_filter_short": (1e-2, shared.small_rates_zeroed),
    "wrong_gravity": (1e-3, shared.wrong_gravity),
    "bending_gyro": (1e-2, shared.bending_gyro),
    "bending_accelerometer": (1e-3, shared.cubic_sensor),
    "loose_chip": (1e-3, shared.loose_chip),
    "hand_warmth": (1e-2, shared.hand_warmth),
    "cross_product": (1e-3, shared.cross_product),
}
