"""A gyro on a platter of known rates, in orientations that nobody knows: a file for each rate, a row each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

import inercal as ic

from . import rows
from .means import sphere, triad
from .rows import World, counted
from .trial import DEG, EARTH_RATE, Act, Array, Case, columns_of, log_uniform

RPM = 6 * DEG


@dataclass(frozen=True)
class Platter:
    """Files of orientations at rest and at rates, drawn; rates in rad/s."""

    truth: dict[str, float]
    stated: Array
    u: Array
    rates: Array
    axes: Array
    file: Array
    earth: Array
    noise: float
    latitude: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The files with a fault."""
        n = len(self.axes)
        rng = np.random.default_rng(self.seed)
        noise = self.noise * rng.normal(size=(n, 3))
        rate = self.rates[self.file] + EARTH_RATE * np.sin(self.latitude)
        x = rate[:, None] * self.axes + np.where(self.file[:, None] == 0, self.earth, 0.0)
        world = World(x, np.zeros(n), rng, 3, float(self.rates.max()), self.file)
        if act:
            act(world, size)
        world.give(world.x @ triad(self.truth, "S", "T").T, noise)
        world.y = world.y + [self.truth[f"D_F_{a}"] for a in "xyz"]
        records = [counted("gyro_? [rad/s]", world.y[self.file == k]) for k in range(len(self.rates))]
        rates = [
            f"{r / RPM:.9g} ± {u / RPM:.4g} rpm" if u else "0 rpm"
            for r, u in zip(self.stated, self.u, strict=True)
        ]
        study = ic.study(
            "imu", site={"latitude": f"{self.latitude / DEG:.8g} deg"}, method="known_rates", rates=rates
        )
        return Case(
            records, study, self.truth, self.misses(self.truth, world.y), lambda: self.columns(world.y)
        )

    def misses(self, truth: Mapping[str, float], y: Array) -> Array:
        """At rates the size of the rate that a row tells, less the stated one; at rest the output less bias."""
        bias = np.array([truth[f"D_F_{a}"] for a in "xyz"])
        size = np.linalg.norm(np.linalg.solve(triad(truth, "S", "T"), (y - bias).T).T, axis=1)
        moving = self.file > 0
        spun = (size - self.stated[self.file])[moving] / np.hypot(self.noise, self.u[self.file[moving]])
        return np.concatenate([spun, ((y - bias)[~moving] / np.hypot(self.noise, EARTH_RATE)).ravel()])

    def columns(self, y: Array) -> Array:
        """What each value does to these misses, by differences."""
        return columns_of(lambda truth: self.misses(truth, y), self.truth)


def draw(rng: np.random.Generator) -> Platter:
    """A test, all inputs within their stated uncertainty."""
    truth = {f"S_{a}": 1 + 0.01 * rng.normal() for a in "xyz"}
    truth |= {f"T_{a}": 0.01 * rng.normal() for a in ("xy", "xz", "yz")}
    truth |= {f"D_F_{a}": 0.3 * DEG * rng.normal() for a in "xyz"}
    stated = RPM * np.array([0.0, 100 / 3, 45.0, 78.26][: int(rng.integers(3, 5))])
    u = stated * log_uniform(rng, 5e-5, 1e-3)
    numbers = [int(rng.integers(6, 10))] + [int(rng.integers(12, 20)) for _ in stated[1:]]
    axes = np.concatenate([sphere(rng, n) for n in numbers])
    level = rng.normal(size=axes.shape)
    level -= np.sum(level * axes, axis=1, keepdims=True) * axes
    latitude = rng.uniform(-55, 65) * DEG
    earth = EARTH_RATE * np.cos(latitude) * level / np.linalg.norm(level, axis=1, keepdims=True)
    return Platter(
        truth, stated, u, stated + u * rng.normal(size=len(u)), axes, np.repeat(np.arange(len(numbers)), numbers),
        earth, DEG * log_uniform(rng, 1e-3, 2e-2), latitude, int(rng.integers(2**31)),
    )  # fmt: skip


def _spinning(world: World) -> Array:
    return np.asarray(world.file > 0)


def speed_worn(world: World, size: float) -> None:
    """The fastest file by a factor."""
    world.x[world.file == world.file.max()] *= 1 - size


def speed_sags(world: World, size: float) -> None:
    """One file slows down from row to row."""
    rows_of = world.file == 1
    world.x[rows_of] *= (1 - size * np.linspace(0, 1, rows_of.sum()))[:, None]


def bias_restarts(world: World, size: float) -> None:
    """Other biases from the second file on."""
    world.bias[_spinning(world)] += size * world.span * world.pick.normal(size=3)


def one_axis_clips(world: World, size: float) -> None:
    """One channel is cut below its largest reading."""
    channel = world.channel()

    def cut(world: World) -> None:
        top = np.abs(world.y[:, channel]).max() - size * world.span
        world.y[:, channel] = np.clip(world.y[:, channel], -top, top)

    world.on_output.append(cut)


def window_early(world: World, size: float) -> None:
    """One row at a lower rate."""
    world.x[world.pick.choice(np.flatnonzero(_spinning(world)))] *= 1 - size


def off_axis(world: World, size: float) -> None:
    """An output by the centripetal acceleration, along a direction across the axis that chance gives."""
    across = world.pick.normal(size=world.x.shape)
    along = world.x / np.maximum(np.linalg.norm(world.x, axis=1, keepdims=True), 1e-12)
    across -= np.sum(across * along, axis=1, keepdims=True) * along
    square = np.sum(world.x**2, axis=1, keepdims=True) / world.size**2
    world.bias += size * world.span * square * across * world.pick.normal(size=3)


def bending_gyro(world: World, size: float) -> None:
    """A third-order error, relative at the largest rate."""
    world.gain *= 1 - size * (world.x / world.size) ** 2


def tilted_platter(world: World, size: float) -> None:
    """Drift by force along the axis of the platter."""
    along = world.x / np.maximum(np.linalg.norm(world.x, axis=1, keepdims=True), 1e-12)
    world.bias += size * world.span * along @ world.pick.normal(size=(3, 3))


FAULTS: dict[str, tuple[float, Act]] = {
    "speed_worn": (1e-3, speed_worn),
    "speed_sags": (1e-3, speed_sags),
    "bias_restarts": (1e-4, bias_restarts),
    "bias_drifts": (1e-4, rows.bias_drifts),
    "scale_warms": (1e-3, rows.scale_drifts),
    "one_axis_clips": (1e-3, one_axis_clips),
    "window_early": (1e-3, window_early),
    "off_axis": (1e-4, off_axis),
    "bending_gyro": (1e-3, bending_gyro),
    "number_mistyped": (1e-3, rows.digit_mistyped),
    "tilted_platter": (1e-4, tilted_platter),
}
