"""A gyro turned by a known angle about each axis: a file for each turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np

import inercal as ic

from . import sample_faults as shared
from .ferraris import near, turn_axis_tilted, turn_short
from .samples import World, mems, progress
from .trial import DEG, EARTH_RATE, G0, Act, Array, Case, columns_of, log_uniform

RATE = 100.0


@dataclass(frozen=True)
class Turns:
    """Three files, drawn."""

    truth: dict[str, float]
    stated: Array
    turn_u: float
    angles: Array
    axes: Array
    alignment: float
    times: Array
    noise: float
    latitude: float
    clock: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The files with a fault."""
        rng = np.random.default_rng(self.seed)
        lengths = 10 + self.times
        t = np.concatenate([np.arange(round(length * RATE)) / RATE for length in lengths])
        block = np.repeat(np.arange(3), np.round(lengths * RATE).astype(int))
        moving = (t > 5) & (t < 5 + self.times[block])
        plan = SimpleNamespace(axes=self.axes.copy(), angles=self.angles.copy(), stated=self.stated.copy())
        world = World(
            t, np.where(moving, block, -1), np.where(moving, -1, block), block, self.truth, rng, (0.0, self.noise),
            np.zeros(3), G0, plan, self.clock,
        )  # fmt: skip
        if act:
            act(world, size)
        w = np.zeros((len(t), 3))
        for k, axis in enumerate(world.plan.axes):
            rows = block == k
            way, speed, _ = progress((t[rows] - 5) / self.times[k])
            across = np.cross(axis, rng.normal(size=3))
            across /= np.linalg.norm(across)
            angle = world.plan.angles[k] * way
            north = np.outer(np.cos(angle), across) - np.outer(np.sin(angle), np.cross(axis, across))
            earth = EARTH_RATE * (np.sin(self.latitude) * axis + np.cos(self.latitude) * north)
            w[rows] = np.outer(world.plan.angles[k] * speed / self.times[k], axis) + earth
        world.make(G0 * world.plan.axes[block], w)
        rows, stamps = world.rows()
        records = [
            ic.record(t=stamps[block[rows] == k], gyro=world.gyro[rows][block[rows] == k]) for k in range(3)
        ]
        u = self.turn_u / DEG
        study = ic.study(
            "imu",
            site={"latitude": f"{self.latitude / DEG:.8g} deg"},
            imu={
                "method": "known_turns",
                "time_base": "20 ppm",
                "turns": {
                    a: f"{angle / DEG:.9g} ± {u:.6g} deg"
                    for a, angle in zip("xyz", world.plan.stated, strict=True)
                },
                "alignment": f"{self.alignment / DEG:.6g} deg",
            },
        )
        kept = {name: value for name, value in self.truth.items() if name[0] in "DST"}
        return Case(records, study, kept, self.means(world), self.columns)

    def means(self, world: World) -> Array:
        """Mean rates of the rests and the turn of each file, less the stated angle, over noise, tilts and angles."""
        found = []
        rows, _ = world.rows()
        for k, time in enumerate(self.times):
            along = np.eye(3)[k]
            tilt = self.alignment * (1 - along)
            of = rows[world.turn[rows] == k]
            n = round(time * RATE)
            rate = (1 + world.clock) * world.gyro[of].sum(axis=0) / n - along * world.plan.stated[k] / time
            rate_u = np.sqrt(
                self.noise**2 / n + (2 * np.pi / time * tilt) ** 2 + (along * self.turn_u / time) ** 2
            )
            found.append(rate / rate_u)
            for rest in (world.t[rows] <= 5, world.t[rows] > 5):
                of = rows[(world.hold[rows] == k) & rest]
                found.append(world.gyro[of].mean(axis=0) / (self.noise / np.sqrt(5 * RATE)))
        return np.concatenate(found)

    def columns(self) -> Array:
        """What each value does to these means, by differences."""
        of = {name: value for name, value in self.truth.items() if name[0] in "DST"}

        def means(truth: Mapping[str, float]) -> Array:
            return np.asarray(replace(self, truth={**self.truth, **truth}).case().residual)

        return columns_of(means, of)


def draw(rng: np.random.Generator) -> Turns:
    """Three files, all inputs within their stated uncertainty."""
    alignment, turn_u = DEG * log_uniform(rng, 0.02, 0.3), DEG * log_uniform(rng, 2e-3, 0.5)
    stated = DEG * rng.uniform(340, 380, size=3)
    return Turns(
        mems(rng, full=True), stated, turn_u, stated + turn_u * rng.normal(size=3),
        np.array([near(rng, axis, alignment) for axis in np.eye(3)]), alignment, np.round(rng.uniform(4, 9, size=3)),
        log_uniform(rng, 0.05, 0.5) * DEG / 60 * np.sqrt(RATE), rng.uniform(-55, 65) * DEG, 20e-6 * rng.normal(),
        int(rng.integers(2**31)),
    )  # fmt: skip


def bias_warms(world: World, size: float) -> None:
    """Biases that die away in each file, within 6 s to 1/e."""
    world.gyro_bias += size * np.outer(np.exp(-world.t / 6), world.pick.normal(size=3))


def drift_in_turn(world: World, size: float) -> None:
    """The scale falls over one turn."""
    rows = np.flatnonzero(world.turn == world.channel())
    world.gyro_gain[rows] *= (1 - size * np.linspace(0, 1, len(rows)))[:, None]


def angles_exchanged(world: World, size: float) -> None:
    """Stated angles come nearer to each other's place, at size 1 wholly."""
    world.plan.stated[:2] += min(size, 1.0) * (world.plan.stated[1::-1] - world.plan.stated[:2])


FAULTS: dict[str, tuple[float, Act]] = {
    "mark_missed": (1e-2, turn_short),
    "axis_tilted": (1 * DEG, turn_axis_tilted),
    "bias_warms": (1e-4, bias_warms),
    "clips": (0.05, shared.one_turn_clipped),
    "samples_lost": (5, shared.samples_lost),
    "clock_fast": (1e-3, shared.clock_fast),
    "small_rates_zeroed": (1e-2, shared.small_rates_zeroed),
    "drift_in_turn": (1e-2, drift_in_turn),
    "angles_exchanged": (1.0, angles_exchanged),
}
