"""Forced oscillation: a model that pitches up and down about a mean."""

from __future__ import annotations

import numpy as np

from . import tunnel
from .trial import DEG, G0, Act, Array
from .tunnel import Run, World, drawn


def draw(rng: np.random.Generator) -> Run:
    """An oscillation of one or two sines."""
    mean, size = (
        DEG * rng.uniform(-5, 35),
        DEG * rng.uniform(3, 12, size=2) * [1.0, float(rng.integers(2)) / 4],
    )
    w, phase = (
        2 * np.pi * np.array([rng.uniform(0.5, 2.0), rng.uniform(2.0, 3.5)]),
        rng.uniform(0, 6.28, size=2),
    )

    def motion(t: Array) -> tuple[Array, Array, Array]:
        at = np.outer(t, w) + phase
        return mean + np.sin(at) @ size, np.cos(at) @ (size * w), -np.sin(at) @ (size * w**2)

    return drawn(rng, motion, 30.0, np.zeros(0))


def place_mistaken(world: World, size: float) -> None:
    """One accelerometer sits elsewhere, m."""
    world.places[:, world.sensor()] += size


def gyro_scale(world: World, size: float) -> None:
    """The gyro by a factor."""
    world.gyro_gain *= 1 + size


def pivot_walks(world: World, size: float) -> None:
    """All places by the angle about its mean, m at the amplitude."""
    away = world.theta - world.theta.mean()
    world.places += size * (away / np.abs(away).max())[:, None]


def late_channel(world: World, size: float) -> None:
    """One accelerometer by a time."""
    world.channel_late[world.sensor()] += size


def all_late(world: World, size: float) -> None:
    """All channels by a time."""
    world.late += size


def yawing(world: World, size: float) -> None:
    """A rate of yaw of 3 Hz, rad/s."""
    world.yaw_rate += size * np.sin(2 * np.pi * 3 * world.t)


def gyro_feels_force(world: World, size: float) -> None:
    """Drift of the gyro by the force along the model, rad/s at 1 g."""
    world.gyro_bias += size * np.sin(world.theta)


def clocks_apart(world: World, size: float) -> None:
    """The gyro runs ahead."""
    world.gyro_clock += size


def gyro_clips(world: World, size: float) -> None:
    """The gyro is cut at a share below its largest rate."""

    def cut(world: World) -> None:
        top = (1 - min(size, 0.95)) * np.abs(world.gyro).max()
        world.gyro = np.clip(world.gyro, -top, top)

    world.on_output.append(cut)


def slow_sting(world: World, size: float) -> None:
    """Heave in proportion to the angle, m/s² at the amplitude."""
    away = world.theta - world.theta.mean()
    world.heave += size * away / np.abs(away).max()


FAULTS: dict[str, tuple[float, Act]] = {
    "axis_turned": (0.1 * DEG, tunnel.axis_turned),
    "stream_heats": (1e-3 * G0, tunnel.stream_heats),
    "place_mistaken": (0.01, place_mistaken),
    "gyro_scale": (1e-2, gyro_scale),
    "pivot_walks": (0.01, pivot_walks),
    "late_channel": (1e-3, late_channel),
    "all_late": (1e-3, all_late),
    "yawing": (20 * DEG, yawing),
    "loose_bracket": (0.1 * DEG, tunnel.loose_bracket),
    "gyro_feels_force": (0.1 * DEG, gyro_feels_force),
    "clocks_apart": (1e-4, clocks_apart),
    "clips": (1e-2, tunnel.clips),
    "gyro_clips": (0.1, gyro_clips),
    "bending_sensor": (1e-2, tunnel.bending_sensor),
    "supply_sags": (5e-3, tunnel.supply_sags),
    "slow_sting": (1e-2 * G0, slow_sting),
    "coarse_converter": (1e-2 * G0, tunnel.coarse_converter),
}
