"""What goes wrong at a table with positions, by the names of `kinds.csv`: a size to begin with, and what it does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .trial import ARCSEC, DEG, Act, Array

if TYPE_CHECKING:
    from .positions import World


def _axis(world: World) -> int:
    return int(world.pick.integers(3))


def _sense(angle: Array) -> Array:
    """Sense (n,) in which a joint came to each of n positions; where it stood still, that of before."""
    found = np.ones(len(angle))
    for k in range(1, len(angle)):
        step = np.sign(np.round(angle[k] - angle[k - 1], 9))
        found[k] = step if step else found[k - 1]
    return found


def elastic_mount(world: World, size: float) -> None:
    """Two elastic angles that go with the force across the mounting."""
    world.feel()
    lean = world.f / world.gravity
    world.body[:, 0] += size * lean[:, 1]
    world.body[:, 1] -= size * lean[:, 0]


def creeping_mount(world: World, size: float) -> None:
    """A creep by the logarithm of time."""
    world.body[:, _axis(world)] += size * np.log1p(world.t / 200) / np.log1p(world.t[-1] / 200)


def slipped_mount(world: World, size: float) -> None:
    """A turn about a random axis from a random position on."""
    axis = world.pick.normal(size=3)
    world.body += size * np.outer(
        world.k >= world.pick.integers(4, world.last - 3), axis / np.linalg.norm(axis)
    )


def backlash_inner(world: World, size: float) -> None:
    """Half of the backlash against the sense of the last move."""
    world.errors["dphi_z2"] = world.errors["dphi_z2"] - 0.5 * size * _sense(world.at(world.phi2))[world.k]


def eccentric_disc(world: World, size: float) -> None:
    """One period a turn of the inner axis."""
    world.errors["dphi_z2"] = world.errors["dphi_z2"] + size * np.sin(
        world.phi2 + world.pick.uniform(0, 6.28)
    )


def three_jaw_chuck(world: World, size: float) -> None:
    """Three periods a turn of the outer axis."""
    world.errors["dphi_y1"] = world.errors["dphi_y1"] + size * np.sin(
        3 * world.phi1 + world.pick.uniform(0, 6.28)
    )


def lost_counts(world: World, size: float) -> None:
    """The inner axis stands elsewhere from one position on."""
    world.errors["dphi_z2"] = world.errors["dphi_z2"] + size * (
        world.k >= world.pick.integers(3, world.last - 2)
    )


def angle_mistyped(world: World, size: float) -> None:
    """One angle of one position is noted wrongly."""
    seen = world.seen1 if world.pick.integers(2) else world.seen2
    seen[world.k == world.pick.integers(world.last + 1)] += size


def rows_exchanged(world: World, size: float) -> None:
    """The two positions whose readings differ by what comes closest to the size."""

    def exchange(world: World) -> None:
        mean = np.stack([world.y[world.k == k].mean(axis=0) for k in range(world.last + 1)])
        apart = np.abs(mean[:, None] - mean[None]).max(axis=2) + 1e9 * world.span * np.eye(len(mean))
        i, j = np.unravel_index(np.argmin(np.abs(np.log(apart / (size * world.span) + 1e-300))), apart.shape)
        first, second = world.y[world.k == i].copy(), world.y[world.k == j].copy()
        world.y[world.k == i], world.y[world.k == j] = second, first

    world.on_output.append(exchange)


def skipped_position(world: World, size: float) -> None:
    """The last positions, as many as the size says, have the readings of the next."""

    def early(world: World) -> None:
        samples = int(np.sum(world.k == 0))
        rows = world.k >= world.last - max(1, round(size))
        rows[-samples:] = False
        world.y[rows] = np.roll(world.y, -samples, axis=0)[rows]

    world.on_output.append(early)


def remembers_last(world: World, size: float) -> None:
    """A part of the mean of the position before."""

    def remember(world: World) -> None:
        mean = np.stack([world.y[world.k == k].mean(axis=0) for k in range(world.last + 1)])
        before = np.vstack([mean[:1], mean[:-1]])
        world.y = world.y + size * (before - mean)[world.k]

    world.on_output.append(remember)


def supply_step(world: World, size: float) -> None:
    """All of the output by a factor, from some position on."""
    world.supply *= 1 + size * (world.k >= world.pick.integers(3, world.last - 2))


def afternoon_sun(world: World, size: float) -> None:
    """Half a sine in the middle third, with another sign and size in each channel."""
    middle = (world.part > 1 / 3) & (world.part < 2 / 3)
    arch = np.where(middle, np.sin(np.pi * (3 * world.part - 1)), 0.0)
    world.bias += size * world.span * np.outer(arch, world.pick.normal(size=world.channels))


def cable_pull(world: World, size: float) -> None:
    """A lean in proportion to the inner angle as it is wound."""
    world.body[:, int(world.pick.integers(2))] += size * np.unwrap(world.phi2) / np.pi


def slip_ring_contact(world: World, size: float) -> None:
    """A scale with one period of the inner axis."""
    world.gain *= (1 + size * np.sin(world.phi2 + world.pick.uniform(0, 6.28)))[:, None]


def pump_on(world: World, size: float) -> None:
    """An offset in the last third."""
    world.bias += size * world.span * np.outer(world.part > 2 / 3, world.pick.normal(size=world.channels))


def converter_limit(world: World, size: float) -> None:
    """Readings are cut below the largest, of either sign."""

    def cut(world: World) -> None:
        top = np.abs(world.y).max(axis=0)
        world.y = np.clip(world.y, -top + size * world.span, top - size * world.span)

    world.on_output.append(cut)


def coarse_display(world: World, size: float) -> None:
    """Readings are rounded."""

    def write_down(world: World) -> None:
        world.y = np.round(world.y / (size * world.span)) * size * world.span

    world.on_output.append(write_down)


def unequal_gain(world: World, size: float) -> None:
    """Negative outputs are larger by a share."""

    def amplify(world: World) -> None:
        world.y = np.where(world.y < 0, (1 + size) * world.y, world.y)

    world.on_output.append(amplify)


def cubic_amplifier(world: World, size: float) -> None:
    """A third-order error, relative at the span."""

    def bend(world: World) -> None:
        world.y = world.y * (1 + size * (world.y / world.span) ** 2)

    world.on_output.append(bend)


def pier_tilts(world: World, size: float) -> None:
    """A steady tilt about a level axis."""
    heading = world.pick.uniform(0, 6.28)
    world.base[:, :2] += size * np.outer(world.part, [np.cos(heading), np.sin(heading)])


def pier_settles(world: World, size: float) -> None:
    """A tilt that dies away, within a seventh of the test to 1/e."""
    heading = world.pick.uniform(0, 6.28)
    world.base[:, :2] += size * np.outer(np.exp(-7 * world.part), [np.cos(heading), np.sin(heading)])


def unbalanced_table(world: World, size: float) -> None:
    """A sag of the outer axis by the moment of a weight."""
    world.errors["dphi_y1"] = world.errors["dphi_y1"] + size * np.cos(
        world.phi1 + world.pick.uniform(0, 6.28)
    )


def bearing_cage(world: World, size: float) -> None:
    """A tilt that goes round at 0.4 of the outer angle as it is wound."""
    angle = 0.4 * np.cumsum(np.diff(world.phi1, prepend=world.phi1[0])) + world.pick.uniform(0, 6.28)
    world.errors["dalpha_x1"] = world.errors["dalpha_x1"] + size * np.cos(angle)
    world.errors["dalpha_z1"] = world.errors["dalpha_z1"] + size * np.sin(angle)


def wrong_latitude(world: World, size: float) -> None:
    """The test stands at another latitude than stated."""
    world.latitude += size


def wrong_gravity(world: World, size: float) -> None:
    """The test stands in another gravity than stated."""
    world.gravity *= 1 + size


def motor_field(world: World, size: float) -> None:
    """A field that is fixed in the frame of the outer axis."""
    across = np.stack([np.cos(world.phi2), -np.sin(world.phi2), 0 * world.phi2], axis=1)
    world.bias += size * world.span * across[:, : world.channels] * np.cos(world.pick.uniform(0, 1))


def crane_magnet(world: World, size: float) -> None:
    """A field fixed to the ground, in the second half."""
    field = world.pick.normal(size=3)
    felt = np.einsum("nij,i->nj", world.attitude(), field / np.linalg.norm(field))
    world.bias += size * world.span * felt[:, : world.channels] * (world.part > 0.5)[:, None]


def window_early(world: World, size: float) -> None:
    """A part of each mean is taken on the way from the inner angle before."""
    before = np.concatenate([world.at(world.phi2)[:1], world.at(world.phi2)[:-1]])[world.k]
    world.errors["dphi_z2"] = world.errors["dphi_z2"] + size * (before - world.phi2)


def wheel_speed(world: World, size: float) -> None:
    """All but the bias by a factor, from some position on."""
    world.gain *= 1 + size * (world.k >= world.pick.integers(3, world.last - 2))[:, None]


def unbalance_creeps(world: World, size: float) -> None:
    """A response to gravity along one axis that grows with time."""
    axis, channel = _axis(world), int(world.pick.integers(world.channels))

    def respond(world: World) -> None:
        world.bias[:, channel] += size * world.span * world.part * world.f[:, axis] / world.gravity

    world.on_force.append(respond)


def inverted_memory(world: World, size: float) -> None:
    """An offset after each position in which z pointed down."""

    def remember(world: World) -> None:
        down = world.at(world.f[:, 2]) < -0.5 * world.gravity
        world.bias += size * world.span * np.concatenate([[False], down[:-1]])[world.k][:, None]

    world.on_force.append(remember)


def zero_set_wrong(world: World, size: float) -> None:
    """The outer axis by an angle that stays."""
    world.errors["dphi_y1"] = world.errors["dphi_y1"] + size


def bent_trunnion(world: World, size: float) -> None:
    """The inner axis leans against the outer one."""
    name = "deps_x" if world.pick.integers(2) else "deps_y"
    world.errors[name] = world.errors[name] + size


def thermostat_cycles(world: World, size: float) -> None:
    """A sine of 23 min."""
    wave = np.sin(2 * np.pi * world.t / 1380 + world.pick.uniform(0, 6.28))
    world.bias += size * world.span * np.outer(wave, world.pick.normal(size=world.channels))


def parallax(world: World, size: float) -> None:
    """Inner angles of the second half are noted with an offset."""
    world.seen2[world.part > 0.5] += size


def switched_off(world: World, size: float) -> None:
    """Other biases after a break."""
    after = world.k >= world.pick.integers(3, world.last - 2)
    world.bias += size * world.span * np.outer(after, world.pick.normal(size=world.channels))


def wires_exchanged(world: World, size: float) -> None:
    """Two channels (of one alone: its sign) are exchanged in the last positions, as many as the size says."""

    def exchange(world: World) -> None:
        rows = world.k > world.last - max(1, round(size))
        world.y[rows] = -world.y[rows] if world.channels == 1 else world.y[rows][:, [1, 0, 2]]

    world.on_output.append(exchange)


_ANGLE = 20 * ARCSEC
FAULTS: dict[str, tuple[float, Act]] = {
    act.__name__: (size, act)
    for size, acts in (
        (
            _ANGLE,
            (elastic_mount, creeping_mount, slipped_mount, backlash_inner, eccentric_disc, three_jaw_chuck),
        ),
        (
            _ANGLE,
            (lost_counts, cable_pull, pier_tilts, pier_settles, unbalanced_table, bearing_cage, parallax),
        ),
        (_ANGLE, (zero_set_wrong, bent_trunnion)),
        (1 * DEG, (angle_mistyped, wrong_latitude)),
        (1e-2, (rows_exchanged,)),
        (1.0, (skipped_position, wires_exchanged)),
        (1e-4, (remembers_last, supply_step, afternoon_sun, slip_ring_contact, pump_on, converter_limit)),
        (1e-4, (unequal_gain, cubic_amplifier, wrong_gravity, motor_field, crane_magnet, window_early)),
        (1e-4, (wheel_speed, unbalance_creeps, inverted_memory, thermostat_cycles, switched_off)),
        (1e-3, (coarse_display,)),
    )
    for act in acts
}
