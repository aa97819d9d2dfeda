"""Faults that sampled IMUs of all methods share; sizes are relative, or in SI."""

from __future__ import annotations

import numpy as np

from .samples import World
from .trial import G0, Array, turned_by


def lean(world: World, angle: Array) -> None:
    """Turn the body by small angles (n, 3) against what carries it: force and rate change."""
    back = turned_by(-angle)
    world.f = np.einsum("nij,nj->ni", back, world.f)
    world.w = np.einsum("nij,nj->ni", back, world.w) + np.diff(angle, axis=0, prepend=angle[:1]) / world.step


def clock_fast(world: World, size: float) -> None:
    """Stamps count too many seconds."""
    world.clock += size


def wrong_gravity(world: World, size: float) -> None:
    """All forces by a factor."""

    def weigh(world: World) -> None:
        world.f = world.f * (1 + size)

    world.on_input.append(weigh)


def lose(world: World, size: float, count: int) -> None:
    """Samples in the middle of some turns, as many as the size says."""
    for turn in world.turns(count):
        middle = world.middle(turn)
        world.keep[middle : middle + max(1, round(size))] = False


def samples_lost(world: World, size: float) -> None:
    """In one turn."""
    lose(world, size, 1)


def packets_lost(world: World, size: float) -> None:
    """In three turns."""
    lose(world, size, 3)


def last_value_held(world: World, size: float) -> None:
    """In three turns for a time."""
    turns = world.turns(3)

    def hold(world: World) -> None:
        for turn in turns:
            middle = world.middle(turn)
            rows = slice(middle, middle + max(2, round(size / world.step)))
            world.acc[rows], world.gyro[rows] = world.acc[middle], world.gyro[middle]

    world.on_output.append(hold)


def turns_clipped(world: World, size: float) -> None:
    """Rates above a share of the largest of all are cut."""

    def cut(world: World) -> None:
        top = (1 - size) * np.abs(world.gyro).max()
        world.gyro = np.clip(world.gyro, -top, top)

    world.on_output.append(cut)


def one_turn_clipped(world: World, size: float) -> None:
    """Rates above a share of the largest of one turn are cut in it."""
    rows = world.turn == world.turns(1)[0]

    def cut(world: World) -> None:
        top = (1 - size) * np.abs(world.gyro[rows]).max()
        world.gyro[rows] = np.clip(world.gyro[rows], -top, top)

    world.on_output.append(cut)


def force_clipped(world: World, size: float) -> None:
    """One accelerometer is cut below the most that it reads at rest."""
    channel = world.channel()

    def cut(world: World) -> None:
        top = world.acc[world.hold >= 0, channel].max() - size * G0
        world.acc[:, channel] = np.minimum(world.acc[:, channel], top)

    world.on_output.append(cut)


def supply_step(world: World, size: float) -> None:
    """Scales of the accelerometers by a factor from some time on."""
    world.acc_gain[world.part > world.pick.uniform(0.3, 0.7)] *= 1 + size


def supply_droops(world: World, size: float) -> None:
    """Scales of the accelerometers fall steadily."""
    world.acc_gain *= 1 - size * (world.part - 0.5)[:, None]


def scale_warms(world: World, size: float) -> None:
    """Scales of the gyros go with time, each its own way."""
    world.gyro_gain *= 1 + size * np.outer(world.part - 0.5, world.pick.normal(size=3))


def large_k2(world: World, size: float) -> None:
    """One accelerometer, relative at 1 g."""
    channel = world.channel()

    def bend(world: World) -> None:
        world.acc_bias[:, channel] += size * world.f[:, channel] ** 2 / G0

    world.on_input.append(bend)


def cubic_sensor(world: World, size: float) -> None:
    """All accelerometers, relative at 1 g."""

    def bend(world: World) -> None:
        world.acc_bias += size * world.f**3 / G0**2

    world.on_input.append(bend)


def cross_product(world: World, size: float) -> None:
    """One accelerometer by the product of the two other forces, relative at 1 g."""
    channel = world.channel()

    def mix(world: World) -> None:
        world.acc_bias[:, channel] += size * world.f[:, channel - 1] * world.f[:, channel - 2] / G0

    world.on_input.append(mix)


def bending_gyro(world: World, size: float) -> None:
    """All gyros, relative at the largest rate."""

    def bend(world: World) -> None:
        world.gyro_gain *= 1 - size * (world.w / np.abs(world.w).max()) ** 2

    world.on_input.append(bend)


def weight_on_gyro(world: World, size: float) -> None:
    """Drift by force, rad/s at 1 g."""
    felt = world.pick.normal(size=(3, 3))

    def drift(world: World) -> None:
        world.gyro_bias += size * world.f @ felt.T / G0

    world.on_input.append(drift)


def unequal_senses(world: World, size: float) -> None:
    """Scales of the gyros by the sense of the rate."""
    by = world.pick.normal(size=3)

    def turn(world: World) -> None:
        world.gyro_gain *= 1 + size * by * np.sign(world.w)

    world.on_input.append(turn)


def fan_runs(world: World, size: float) -> None:
    """Offsets of the accelerometers in the second half, m/s²."""
    world.acc_bias[world.part > 0.5] += size * np.abs(world.pick.normal(size=3))


def knocked_gyro(world: World, size: float) -> None:
    """The bias of one gyro from some time on, rad/s."""
    world.gyro_bias[world.part > world.pick.uniform(0.3, 0.7), world.channel()] += size


def accelerometer_warms(world: World, size: float) -> None:
    """Biases that die away within a fifth of the test to 1/e, m/s²."""
    world.acc_bias += size * np.outer(np.exp(-5 * world.part), world.pick.normal(size=3))


def gyro_warms(world: World, size: float) -> None:
    """Biases of the gyros that go with time, rad/s."""
    world.gyro_bias += size * np.outer(world.part, world.pick.normal(size=3))


def _walk(world: World) -> Array:
    steps = np.random.default_rng(int(world.pick.integers(2**31))).normal(size=(len(world.t), 3))
    return np.asarray(np.cumsum(steps, axis=0) / np.sqrt(len(world.t)))


def accelerometer_wanders(world: World, size: float) -> None:
    """A random walk of the biases, m/s² at the end."""
    world.acc_bias += size * _walk(world)


def gyro_wanders(world: World, size: float) -> None:
    """A random walk of the biases, rad/s at the end."""
    world.gyro_bias += size * _walk(world)


def small_rates_zeroed(world: World, size: float) -> None:
    """Rates below a size are taken for zero."""

    def zero(world: World) -> None:
        world.w = np.where(np.abs(world.w) < size, 0.0, world.w)

    world.on_input.append(zero)


def loose_chip(world: World, size: float) -> None:
    """The accelerometers lean by their weight, the gyros do not."""

    def bend(world: World) -> None:
        angle = size * np.stack([world.f[:, 1], -world.f[:, 0], 0 * world.f[:, 0]], axis=1) / G0
        world.f = world.f - np.cross(angle, world.f)

    world.on_input.append(bend)


def creeping_mount(world: World, size: float) -> None:
    """A creep by the logarithm of time about one axis."""
    axis = np.eye(3)[world.channel()]
    world.on_input.append(
        lambda world: lean(world, size * np.outer(np.log1p(20 * world.part) / np.log(21), axis))
    )


def slipped_mount(world: World, size: float) -> None:
    """A turn about a random axis within a second."""
    axis, time = world.pick.normal(size=3), world.pick.uniform(0.3, 0.7) * world.t[-1]
    axis /= np.linalg.norm(axis)
    world.on_input.append(lambda world: lean(world, size * np.outer(np.clip(world.t - time, 0, 1), axis)))


def sinks(world: World, size: float, time: float) -> None:
    """In each rest a lean about a random axis that settles in a time, and is gone over the next turn."""
    part, axes = np.zeros(len(world.t)), np.zeros((len(world.t), 3))
    for number in np.unique(world.hold[world.hold >= 0]):
        rows = np.flatnonzero(world.hold == number)
        way = 1 - np.exp(-(world.t[rows] - world.t[rows[0]]) / time)
        after = np.flatnonzero(world.turn == number)
        axis = world.pick.normal(size=3)
        part[rows], axes[rows] = way, axis
        part[after], axes[after] = (
            way[-1] * np.linspace(1, 0, len(after) + 1)[1:] if len(after) else 0.0,
            axis,
        )
    world.on_input.append(lambda world: lean(world, size * part[:, None] * axes))


def heated_by_turns(world: World, time: float) -> Array:
    """A warmth (n,) that rises in turns and dies away in rests."""
    warm, found = 0.0, np.zeros(len(world.t))
    for k, moving in enumerate(world.turn >= 0):
        warm += (float(moving) - warm) * world.step / time
        found[k] = warm
    return found


def hand_warmth(world: World, size: float) -> None:
    """Biases of the accelerometers, m/s²."""
    world.acc_bias += size * np.outer(heated_by_turns(world, 8.0), world.pick.normal(size=3))


def warm_after_turn(world: World, size: float) -> None:
    """Biases of the gyros, rad/s."""
    world.gyro_bias += size * np.outer(heated_by_turns(world, 4.0), world.pick.normal(size=3))
