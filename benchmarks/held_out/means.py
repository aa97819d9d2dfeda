"""Means of poses: accelerometers held still in attitudes that nobody knows, a row each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import inercal as ic

from . import rows
from .rows import World, counted
from .trial import G0, Act, Array, Case, columns_of, log_uniform

GRAVITY, GRAVITY_U = 9.80938, 5e-5


def triad(truth: Mapping[str, float], scale: str, skew: str) -> Array:
    """Gain (3, 3) of a triad: its scale factors times its upper-triangular or full misalignment."""
    gain = np.eye(3)
    for i, a in enumerate("xyz"):
        for j, b in enumerate("xyz"):
            if i != j:
                gain[i, j] = truth.get(f"{skew}_{a}{b}", 0.0)
    return np.array([truth[f"{scale}_{a}"] for a in "xyz"])[:, None] * gain


@dataclass(frozen=True)
class Means:
    """A table of means, drawn; outputs in m/s²."""

    truth: dict[str, float]
    k2: Array
    stated_k2: float
    up: Array
    noise: float
    gravity: float
    seed: int

    def outputs(self, truth: Mapping[str, float], x: Array) -> Array:
        """Outputs without fault (n, 3)."""
        scale = np.array([truth[f"K1_{a}"] for a in "xyz"])
        along = x @ (triad(truth, "K1", "M") / scale[:, None]).T
        return np.asarray(scale * (along + self.k2 * along**2) + [truth[f"K0_{a}"] for a in "xyz"])

    def misses(self, truth: Mapping[str, float], y: Array) -> Array:
        """The size of the force that each row tells, less the stated gravity, over the noise."""
        offset = y - [truth[f"K0_{a}"] for a in "xyz"]
        gain = triad(truth, "K1", "M")
        f = np.linalg.solve(gain, offset.T).T
        f = np.linalg.solve(gain, (offset - np.array([truth[f"K1_{a}"] for a in "xyz"]) * self.k2 * f**2).T).T
        return np.asarray((np.linalg.norm(f, axis=1) - GRAVITY) / self.noise)

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The table with a fault."""
        n = len(self.up)
        rng = np.random.default_rng(self.seed)
        noise = self.noise * rng.normal(size=(n, 3))
        world = World(self.gravity * self.up, np.zeros(n), rng, 3, G0, np.zeros(n))
        if act:
            act(world, size)
        world.give(self.outputs(self.truth, world.x), noise)
        study = ic.study(
            "imu",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2"},
            method="means",
            k2=f"0 ± {self.stated_k2 * G0 * 1e6:.6g} ug/g^2",
        )
        z = self.misses(self.truth, world.y)
        columns = columns_of(
            lambda truth: self.misses(truth, self.outputs(self.truth, self.gravity * self.up)), self.truth
        )
        return Case(counted("acc_? [m/s^2]", world.y), study, self.truth, z, columns)


def sphere(rng: np.random.Generator, n: int) -> Array:
    """Directions (n, 3): the six sides first, then any."""
    found = np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(n - 6, 3))]) + 0.05 * rng.normal(size=(n, 3))
    found = found[rng.permutation(n)]
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def draw(rng: np.random.Generator) -> Means:
    """A table, all inputs within their stated uncertainty."""
    truth = {f"K0_{a}": 0.01 * G0 * rng.normal() for a in "xyz"}
    truth |= {f"K1_{a}": 1 + 0.005 * rng.normal() for a in "xyz"}
    truth |= {f"M_{a}": 0.005 * rng.normal() for a in ("xy", "xz", "yz")}
    stated = float(rng.choice([2, 10, 50])) * 1e-6 / G0
    return Means(
        truth, stated * rng.normal(size=3), stated, sphere(rng, int(rng.integers(14, 41))),
        G0 * log_uniform(rng, 2e-6, 3e-4), GRAVITY + GRAVITY_U * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def moved_pose(world: World, size: float) -> None:
    """One mean over an arc: shorter, and elsewhere."""
    row = world.some(0)
    world.x[row] *= 1 - size


def machine_runs(world: World, size: float) -> None:
    """Offsets in a third of the rows."""
    begin = int(world.pick.integers(len(world.x) * 2 // 3))
    world.bias[begin : begin + len(world.x) // 3] += size * world.span * np.abs(world.pick.normal(size=3))


def large_k2(world: World, size: float) -> None:
    """A square of the force along one axis, relative at 1 g."""
    channel = world.channel()
    world.bias[:, channel] += size * world.x[:, channel] ** 2 / world.span


def cubic_sensor(world: World, size: float) -> None:
    """A third-order error, relative at 1 g."""
    world.bias += size * world.x**3 / world.span**2


def clipped_side(world: World, size: float) -> None:
    """One channel is cut below its largest reading."""
    channel = world.channel()

    def cut(world: World) -> None:
        world.y[:, channel] = np.minimum(world.y[:, channel], world.y[:, channel].max() - size * world.span)

    world.on_output.append(cut)


def columns_exchanged(world: World, size: float) -> None:
    """Of the row whose two numbers differ by what comes closest to the size."""

    def exchange(world: World) -> None:
        apart = np.abs(world.y[:, 0] - world.y[:, 1])
        row = int(np.argmin(np.abs(np.log(apart / (size * world.span) + 1e-300))))
        world.y[row, [0, 1]] = world.y[row, [1, 0]]

    world.on_output.append(exchange)


def wrong_gravity(world: World, size: float) -> None:
    """All forces by a factor."""
    world.x *= 1 + size


def regulator_sags(world: World, size: float) -> None:
    """The scale of a channel by the output of the next."""
    channel = world.channel()
    world.gain[:, channel] *= 1 - size * world.x[:, (channel + 1) % 3] / world.span


def sticking_sensor(world: World, size: float) -> None:
    """An offset by the sense of the last change."""
    channel = world.channel()
    sense = np.sign(np.diff(world.x[:, channel], prepend=0.0))
    world.bias[:, channel] += size * world.span * sense


def product_term(world: World, size: float) -> None:
    """An offset by the product of the two other forces."""
    channel = world.channel()
    other = world.x[:, [(channel + 1) % 3, (channel + 2) % 3]]
    world.bias[:, channel] += size * other.prod(axis=1) / world.span


FAULTS: dict[str, tuple[float, Act]] = {
    "moved_pose": (1e-3, moved_pose),
    "machine_runs": (1e-4, machine_runs),
    "large_k2": (1e-4, large_k2),
    "cubic_sensor": (1e-4, cubic_sensor),
    "warming_up": (1e-4, rows.warming),
    "supply_step": (1e-4, rows.supply_step),
    "clipped_side": (1e-3, clipped_side),
    "digit_mistyped": (1e-3, rows.digit_mistyped),
    "columns_exchanged": (1e-2, columns_exchanged),
    "scale_drifts": (1e-4, rows.scale_drifts),
    "wrong_gravity": (1e-4, wrong_gravity),
    "regulator_sags": (1e-4, regulator_sags),
    "rounded": (1e-3, rows.coarse_display),
    "sticking_sensor": (1e-4, sticking_sensor),
    "product_term": (1e-4, product_term),
}
