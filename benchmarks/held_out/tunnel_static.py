"""Polars: a model that goes from pause to pause."""

from __future__ import annotations

import numpy as np

from . import tunnel
from .samples import progress
from .trial import DEG, G0, Act, Array
from .tunnel import Run, World, buffet, drawn


def draw(rng: np.random.Generator) -> Run:
    """A polar."""
    first, step, count = (
        float(rng.choice([-10.0, -5.0, 0.0])),
        float(rng.choice([3.0, 5.0, 8.0])),
        int(rng.integers(6, 9)),
    )
    shaken = buffet(rng, DEG * float(rng.choice([0.01, 0.05])))
    begins = 4.0 + 5.5 * np.arange(count)

    def motion(t: Array) -> tuple[Array, Array, Array]:
        found = list(shaken(t))
        found[0] += first * DEG
        for begin in begins:
            for k, part in enumerate(progress((t - begin) / 1.5)):
                found[k] += step * DEG * part / 1.5**k
        return found[0], found[1], found[2]

    return drawn(rng, motion, float(begins[-1] + 5.5), begins + 4.8)


def scale_mistaken(world: World, size: float) -> None:
    """One accelerometer by a factor."""
    world.gain[:, world.sensor()] *= 1 + size


def model_rolls(world: World, size: float) -> None:
    """Roll in proportion to the load."""
    world.roll += size * (world.theta - world.theta.min()) / np.ptp(world.theta)


def bracket_creeps(world: World, size: float) -> None:
    """One axis creeps by the logarithm of time."""
    world.lean[:, world.sensor()] += size * np.log1p(20 * world.part) / np.log(21)


def wrong_gravity(world: World, size: float) -> None:
    """All forces by a factor."""
    world.gravity *= 1 + size


def large_k2(world: World, size: float) -> None:
    """One accelerometer, relative at 1 g."""
    k = world.sensor()

    def bend(world: World) -> None:
        world.bias[:, k] += size * world.f[:, k] ** 2 / G0

    world.on_force.append(bend)


def sticking_sensor(world: World, size: float) -> None:
    """One accelerometer is behind its input until that has changed by twice a size, m/s²."""
    k = world.sensor()

    def stick(world: World) -> None:
        stands = world.f[0, k]
        for row, wanted in enumerate(world.f[:, k].copy()):
            stands = min(max(stands, wanted - size), wanted + size)
            world.f[row, k] = stands

    world.on_force.append(stick)


def fan_rectified(world: World, size: float) -> None:
    """An offset of one accelerometer while the fan runs, after the first pause, m/s²."""
    world.bias[world.t > 4, world.sensor()] += size


def held_values(world: World, size: float) -> None:
    """One accelerometer for a time, begun in each second move."""
    k = world.sensor()

    def hold(world: World) -> None:
        for pause in world.pauses[::2]:
            rows = (world.t > pause - 4.4) & (world.t < pause - 4.4 + size)
            if rows.any():
                world.a[rows, k] = world.a[np.argmax(rows), k]

    world.on_output.append(hold)


FAULTS: dict[str, tuple[float, Act]] = {
    "axis_turned": (0.1 * DEG, tunnel.axis_turned),
    "stream_heats": (1e-3 * G0, tunnel.stream_heats),
    "scale_mistaken": (5e-3, scale_mistaken),
    "model_rolls": (5 * DEG, model_rolls),
    "loose_bracket": (0.1 * DEG, tunnel.loose_bracket),
    "bracket_creeps": (0.1 * DEG, bracket_creeps),
    "wrong_gravity": (1e-2, wrong_gravity),
    "bending_sensor": (1e-2, tunnel.bending_sensor),
    "large_k2": (5e-3, large_k2),
    "sticking_sensor": (1e-3 * G0, sticking_sensor),
    "supply_sags": (5e-3, tunnel.supply_sags),
    "fan_rectified": (1e-3 * G0, fan_rectified),
    "clips": (1e-2, tunnel.clips),
    "held_values": (1.0, held_values),
    "coarse_converter": (1e-2 * G0, tunnel.coarse_converter),
}
