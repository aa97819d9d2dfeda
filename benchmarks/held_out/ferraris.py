"""Six rests and three turns by a known angle (Ferraris), labelled sections."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

import inercal as ic

from . import sample_faults as shared
from .samples import World, mems, progress
from .trial import DEG, EARTH_RATE, G0, Act, Array, Case, columns_of, log_uniform

GRAVITY, GRAVITY_U = 9.80938, 2e-4
RATE = 50.0
SIDES = [f"{a}_{s}" for a in "xyz" for s in "pa"]


@dataclass(frozen=True)
class Session:
    """A session, drawn."""

    truth: dict[str, float]
    up: Array
    axes: Array
    angles: Array
    turn_u: float
    alignment: float
    lengths: Array
    noise: tuple[float, float]
    gravity: float
    latitude: float
    clock: float
    seed: int

    def world(self) -> World:
        """The world without fault."""
        t, turn, hold, block = [], [], [], []
        begin = 0.0
        for k, length in enumerate(self.lengths):
            n = round(length * RATE)
            t.append(begin + np.arange(n) / RATE)
            moving = (t[-1] > begin + 1) & (t[-1] < begin + length - 1) & (k >= 6)
            turn.append(np.where(moving, k - 6, -1))
            hold.append(np.where(k < 6, k, -1) * np.ones(n, int))
            block.append(np.full(n, k))
            begin += length + 12.0
        plan = SimpleNamespace(up=self.up.copy(), axes=self.axes.copy(), angles=self.angles.copy())
        of_t, of_turn, of_hold, of_block = (np.concatenate(column) for column in (t, turn, hold, block))
        return World(
            of_t, of_turn, of_hold, of_block, self.truth, np.random.default_rng(self.seed), self.noise, np.zeros(3),
            self.gravity, plan, self.clock,
        )  # fmt: skip

    def feel(self, world: World) -> tuple[Array, Array]:
        """Force and rate (n, 3)."""
        rng = np.random.default_rng(self.seed + 1)
        f, w = np.zeros((len(world.t), 3)), np.zeros((len(world.t), 3))
        for k in range(9):
            rows = np.flatnonzero(world.block == k)
            up = world.plan.up[k] if k < 6 else world.plan.axes[k - 6]
            across = np.cross(up, rng.normal(size=3))
            across /= np.linalg.norm(across)
            t = world.t[rows] - world.t[rows[0]]
            angle = np.zeros(len(rows))
            if k >= 6:
                length = self.lengths[k] - 2
                way, speed, _ = progress((t - 1) / length)
                angle = world.plan.angles[k - 6] * way
                w[rows] += np.outer(world.plan.angles[k - 6] * speed / length, up)
            north = np.outer(np.cos(angle), across) - np.outer(np.sin(angle), np.cross(up, across))
            f[rows] = self.gravity * up
            w[rows] += EARTH_RATE * (np.sin(self.latitude) * up + np.cos(self.latitude) * north)
        return f, w

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault."""
        world = self.world()
        if act:
            act(world, size)
        world.make(*self.feel(world))
        return Case(self.record(world), self.study(), self.truth, self.means(world), self.columns)

    def means(self, world: World) -> Array:
        """Means of both triads over each section, over noise, tilts and angles."""
        found = []
        rows, _ = world.rows()
        for k, length in enumerate(self.lengths):
            of = rows[world.block[rows] == k]
            n, along = round(length * RATE), np.eye(3)[k // 2 if k < 6 else k - 6]
            rate = 0.0 if k < 6 else 2 * np.pi / length
            turned = (1 + world.clock) * world.gyro[of].sum(axis=0) / n
            tilt = self.alignment * (1 - along)
            force_u = np.hypot(self.noise[0] / np.sqrt(n), GRAVITY * tilt)
            rate_u = np.sqrt(
                self.noise[1] ** 2 / n + (rate * tilt) ** 2 + (along * (k >= 6) * self.turn_u / length) ** 2
            )
            found += [world.acc[of].mean(axis=0) / force_u, turned / rate_u]
        return np.concatenate(found)

    def columns(self) -> Array:
        """What each value does to these means, by differences."""
        return columns_of(
            lambda truth: np.asarray(replace(self, truth=dict(truth)).case().residual), self.truth
        )

    def record(self, world: World) -> Any:
        """The record with labels."""
        rows, stamps = world.rows()
        names = np.array([*SIDES, "x_rot", "y_rot", "z_rot"])
        return ic.record(t=stamps, acc=world.acc[rows], gyro=world.gyro[rows], label=names[world.block[rows]])

    def study(self) -> Any:
        """The study, with all that is stated."""
        return ic.study(
            "imu",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2", "latitude": f"{self.latitude / DEG:.8g} deg"},
            imu={
                "method": "ferraris",
                "time_base": "20 ppm",
                "ferraris": {
                    "turn": f"360 ± {self.turn_u / DEG:.6g} deg",
                    "alignment": f"{self.alignment / DEG:.6g} deg",
                },
            },
        )


def near(rng: np.random.Generator, axis: Array, tilt: float) -> Array:
    """A direction beside an axis, by a tilt in each of the two directions across."""
    found = axis + tilt * rng.normal(size=3) * (axis == 0)
    return np.asarray(found / np.linalg.norm(found))


def draw(rng: np.random.Generator) -> Session:
    """A session, all inputs within their stated uncertainty."""
    alignment, turn_u = DEG * log_uniform(rng, 0.02, 0.5), DEG * log_uniform(rng, 0.02, 1.0)
    up = np.array([near(rng, sign * axis, alignment) for axis in np.eye(3) for sign in (1, -1)])
    axes = np.array([near(rng, axis, alignment) for axis in np.eye(3)])
    truth = mems(rng, full=True)
    felt = log_uniform(rng, 1e-7, 1e-5)
    truth |= {f"G_{a}{b}": felt * rng.normal() for a in "xyz" for b in "xyz"}
    noise = (
        G0 * log_uniform(rng, 3e-5, 2e-4) * np.sqrt(RATE),
        log_uniform(rng, 0.05, 0.5) * DEG / 60 * np.sqrt(RATE),
    )
    return Session(
        truth, up, axes, 2 * np.pi + turn_u * rng.normal(size=3), turn_u, alignment,
        np.round(rng.uniform(6, 12, size=9)), noise, GRAVITY + GRAVITY_U * rng.normal(), rng.uniform(-55, 65) * DEG,
        20e-6 * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def face_not_square(world: World, size: float) -> None:
    """One side lies another way."""
    k = int(world.pick.integers(6))
    world.plan.up[k] += size * np.roll(np.eye(3)[k // 2], 1)
    world.plan.up[k] /= np.linalg.norm(world.plan.up[k])


def table_tilted(world: World, size: float) -> None:
    """All sides lean the same way on the table, each with its next axis."""
    for k in range(6):
        world.plan.up[k] += size * np.eye(3)[(k // 2 + 1) % 3]
        world.plan.up[k] /= np.linalg.norm(world.plan.up[k])


def turn_short(world: World, size: float) -> None:
    """One turn by a share of its angle."""
    world.plan.angles[world.channel()] *= 1 - size


def turn_axis_tilted(world: World, size: float) -> None:
    """One turn about an axis that leans."""
    k = world.channel()
    world.plan.axes[k] += size * np.eye(3)[(k + 1) % 3]
    world.plan.axes[k] /= np.linalg.norm(world.plan.axes[k])


def burr(world: World, size: float) -> None:
    """One side leans in its rest, and not in the turn."""
    k = 2 * world.channel()
    world.plan.up[k] += size * np.eye(3)[(k // 2 + 2) % 3]
    world.plan.up[k] /= np.linalg.norm(world.plan.up[k])


FAULTS: dict[str, tuple[float, Act]] = {
    "face_not_square": (0.5 * DEG, face_not_square),
    "table_tilted": (0.5 * DEG, table_tilted),
    "turn_short": (1e-2, turn_short),
    "turn_axis_tilted": (1 * DEG, turn_axis_tilted),
    "turn_clipped": (0.1, shared.one_turn_clipped),
    "samples_lost": (5, shared.samples_lost),
    "accelerometer_warms": (1e-2, shared.accelerometer_warms),
    "gyro_warms": (1e-4, shared.gyro_warms),
    "supply_droops": (1e-3, shared.supply_droops),
    "fan_runs": (1e-2, shared.fan_runs),
    "large_k2": (1e-3, shared.large_k2),
    "burr": (0.5 * DEG, burr),
    "clock_fast": (1e-3, shared.clock_fast),
    "bending_gyro": (1e-2, shared.bending_gyro),
}
