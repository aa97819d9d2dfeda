"""What goes wrong on a platform in gimbals, by the names of `kinds.csv`: a size to begin with, and what it does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .trial import ARCSEC, DEG, DEG_H, G0, Act, Array

if TYPE_CHECKING:
    from .platform import World


def gyro_drifts(world: World, size: float) -> None:
    """Biases that go with time, rad/s."""
    world.gyro_bias += size * np.outer(world.part - 0.5, world.pick.normal(size=3))


def accelerometer_warms(world: World, size: float) -> None:
    """Biases that die away within a fifth of the test, m/s²."""
    world.acc_bias += size * np.outer(np.exp(-5 * world.part), world.pick.normal(size=3))


def scale_droops(world: World, size: float) -> None:
    """Scales of the accelerometers fall."""
    world.acc_gain *= 1 - size * (world.part - 0.5)[:, None]


def base_settles(world: World, size: float) -> None:
    """A tilt that dies away within a fifth of the test."""
    heading = world.pick.uniform(0, 6.28)
    world.base += size * np.outer(np.exp(-5 * world.part), [np.cos(heading), 0.0, np.sin(heading)])


def wrong_heading(world: World, size: float) -> None:
    """The base heads elsewhere."""
    world.base[:, 1] += size


def wrong_latitude(world: World, size: float) -> None:
    """The test stands at another latitude than stated."""
    world.latitude += size


def wrong_gravity(world: World, size: float) -> None:
    """All forces by a factor."""
    world.gravity *= 1 + size


def large_k2(world: World, size: float) -> None:
    """One accelerometer, relative at 1 g."""
    k = int(world.pick.integers(3))

    def bend(world: World) -> None:
        world.acc_bias[:, k] += size * world.f[:, k] ** 2 / G0

    world.on_force.append(bend)


def cubic_sensor(world: World, size: float) -> None:
    """All accelerometers, relative at 1 g."""

    def bend(world: World) -> None:
        world.acc_bias += size * world.f**3 / G0**2

    world.on_force.append(bend)


def cross_product(world: World, size: float) -> None:
    """One accelerometer by the product of the two others, relative at 1 g."""
    k = int(world.pick.integers(3))

    def mix(world: World) -> None:
        world.acc_bias[:, k] += size * world.f[:, k - 1] * world.f[:, k - 2] / G0

    world.on_force.append(mix)


def sticking_sensor(world: World, size: float) -> None:
    """One accelerometer by the sense of its last change, m/s²."""
    k = int(world.pick.integers(3))

    def stick(world: World) -> None:
        ways = np.diff(world.f[:, k], prepend=world.f[0, k])
        sense = np.sign(np.where(np.abs(ways) < 1e-4, 0.0, ways))
        for row in range(1, len(sense)):
            sense[row] = sense[row] or sense[row - 1]
        world.acc_bias[:, k] += size * sense

    world.on_force.append(stick)


def weight_on_gyro(world: World, size: float) -> None:
    """Drift by force at the commanded angles, rad/s at 1 g."""
    from .platform import gimbals

    up = gimbals(world.nominal)[:, 1, :]
    world.gyro_bias += size * up @ world.pick.normal(size=(3, 3)).T


def unequal_senses(world: World, size: float) -> None:
    """Scales of the torquers by the sense of the command."""
    by = world.pick.normal(size=3)

    def change(world: World) -> None:
        world.gyro_gain = world.gyro_gain + size * by * np.sign(world.command)

    world.on_rate.append(change)


def torquer_bends(world: World, size: float) -> None:
    """Short by the square of the command, relative at 1 deg/s."""

    def change(world: World) -> None:
        world.gyro_gain = world.gyro_gain - size * (world.command / DEG) ** 2

    world.on_rate.append(change)


def _encoder(world: World, joint: int, error: Any) -> None:
    def change(world: World) -> None:
        world.th[:, joint] += error(world.th[:, joint])

    world.on_encoders.append(change)


def eccentric_disc(world: World, size: float) -> None:
    """The outer encoder, one period a turn."""
    phase = world.pick.uniform(0, 6.28)
    _encoder(world, 0, lambda angle: size * np.sin(angle + phase))


def three_lobed_disc(world: World, size: float) -> None:
    """The platform's encoder, three periods a turn."""
    phase = world.pick.uniform(0, 6.28)
    _encoder(world, 2, lambda angle: size * np.sin(3 * angle + phase))


def counts_lost(world: World, size: float) -> None:
    """The platform's encoder from some row within a turn of it on."""
    row = int(world.pick.choice(np.flatnonzero(world.rates[:, 2])))
    _encoder(world, 2, lambda angle: -size * (np.arange(len(angle)) > row))


def _senses(world: World) -> Array:
    found = np.sign(world.rates)
    for row in range(1, len(found)):
        found[row] = np.where(found[row] == 0, found[row - 1], found[row])
    return found


def coupling_wound(world: World, size: float) -> None:
    """One encoder behind in the sense of the last turn."""
    joint = int(world.pick.choice([0, 2]))
    sense = _senses(world)[:, joint]
    _encoder(world, joint, lambda angle: -size * sense)


def clock_ratio(world: World, size: float) -> None:
    """Angles of the encoders run ahead."""
    world.encoder_clock += size


def slipped_block(world: World, size: float) -> None:
    """Another block angle from some time on."""
    axis = world.pick.normal(size=3)
    world.block += size * np.outer(world.part > world.pick.uniform(0.2, 0.8), axis / np.linalg.norm(axis))


def block_sags(world: World, size: float) -> None:
    """An elastic turn by the weight, at 1 g."""

    def sag(world: World) -> None:
        arm = np.array([0.3, 0.9, 0.3])
        world.block += size * np.cross(arm, world.f) / G0

    world.on_force.append(sag)


def knocked_gyro(world: World, size: float) -> None:
    """The bias of one gyro from some time on, rad/s."""
    world.gyro_bias[world.part > world.pick.uniform(0.2, 0.8), int(world.pick.integers(3))] += size


def turns_shake(world: World, size: float) -> None:
    """Offsets of the accelerometers while the outer joint turns, m/s²."""
    world.acc_bias += size * np.outer(world.rates[:, 0] != 0, np.abs(world.pick.normal(size=3)))


def bearing_cage(world: World, size: float) -> None:
    """A tilt of the outer axis that goes round at 0.4 of its angle."""
    angle = 0.4 * world.nominal[:, 0] + world.pick.uniform(0, 6.28)
    world.tilt += size * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


FAULTS: dict[str, tuple[float, Act]] = {
    act.__name__: (size, act)
    for size, acts in (
        (0.01 * DEG_H, (gyro_drifts, knocked_gyro, weight_on_gyro)),
        (1e-5 * G0, (accelerometer_warms, sticking_sensor, turns_shake)),
        (
            1e-5,
            (
                scale_droops,
                wrong_gravity,
                large_k2,
                cubic_sensor,
                cross_product,
                unequal_senses,
                torquer_bends,
            ),
        ),
        (1e-5, (clock_ratio,)),
        (
            5 * ARCSEC,
            (base_settles, eccentric_disc, three_lobed_disc, counts_lost, coupling_wound, slipped_block),
        ),
        (5 * ARCSEC, (block_sags, bearing_cage)),
        (0.02 * DEG, (wrong_latitude, wrong_heading)),
    )
    for act in acts
}
