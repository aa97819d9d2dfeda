"""A platform in three gimbals that turns through a path and calibrates itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import inercal as ic

from .platform_faults import FAULTS
from .trial import ARCSEC, DEG, DEG_H, EARTH_RATE, G0, Act, Array, Case, log_uniform, turn, turned_by

__all__ = ["FAULTS", "draw"]

GRAVITY, GRAVITY_U = 9.80938, 1e-5
STEP = 0.2
PATHS = (
    (("x", 120), ("z", 90), ("x", 150), ("z", -120), ("y", -60)),
    (("z", 120), ("x", -90), ("y", 50), ("z", -150), ("x", 120), ("y", -80), ("z", 60)),
    (("y", 40), ("z", 180), ("x", 90), ("y", -70), ("z", -180), ("x", 90), ("y", 30)),
)


@dataclass
class World:
    """Rows (n,) of a platform: what acts on its torquers, accelerometers and encoders, a row each.

    ``nominal`` (n, 3) are the commanded angles, ``rates`` (n, 3) the commanded joint rates. ``base`` turns the base,
    ``tilt`` the outer axis on it, ``block`` the sensors against the last gimbal.
    """

    t: Array
    nominal: Array
    rates: Array
    pick: np.random.Generator
    latitude: float
    gravity: float
    heading: float
    encoder_clock: float = 0.0
    on_rate: list[Callable[[World], None]] = field(default_factory=list)
    on_force: list[Callable[[World], None]] = field(default_factory=list)
    on_encoders: list[Callable[[World], None]] = field(default_factory=list)
    command: Array = field(init=False)
    f: Array = field(init=False)
    th: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin without faults."""
        n = len(self.t)
        self.gyro_bias, self.gyro_gain = np.zeros((n, 3)), np.ones((n, 3))
        self.acc_bias, self.acc_gain = np.zeros((n, 3)), np.ones((n, 3))
        self.base, self.tilt, self.block = np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 3))
        self.command, self.f = np.zeros((n, 3)), np.zeros((n, 3))

    @property
    def part(self) -> Array:
        """How much of the test is over at each row, 0 to 1."""
        return np.asarray(self.t / self.t[-1])


def gimbals(th: Array) -> Array:
    """Platform's axes in the frame of the base (n, 3, 3) by the angles x, y, z (n, 3)."""
    return np.asarray(turn("z", th[:, 0]) @ turn("x", th[:, 1]) @ turn("y", th[:, 2]))


def angles_of(C: Array, near: Array) -> Array:
    """The angles (n, 3) of an attitude, of both branches and all turns those nearest to some angles (n, 3)."""
    first = np.stack(
        [np.arctan2(-C[:, 0, 1], C[:, 1, 1]), np.arcsin(C[:, 2, 1]), np.arctan2(-C[:, 2, 0], C[:, 2, 2])], 1
    )
    second = np.stack([first[:, 0] + np.pi, np.pi - first[:, 1], first[:, 2] + np.pi], axis=1)
    found = [b + 2 * np.pi * np.round((near - b) / (2 * np.pi)) for b in (first, second)]
    miss = [np.abs(b - near).sum(axis=1) for b in found]
    return np.where((miss[0] <= miss[1])[:, None], *found)


@dataclass(frozen=True)
class Platform:
    """A test, drawn."""

    truth: dict[str, float]
    path: tuple[tuple[str, int], ...]
    walk: float
    acc_noise: float
    encoder: float
    beta: Array
    gamma: Array
    zero_y: float
    delays: tuple[float, float]
    latitude: float
    gravity: float
    heading: float
    seed: int

    def plan(self) -> tuple[Array, Array, Array]:
        """Times, nominal angles and joint rates of the rows."""
        listed = []
        for joint, angle in self.path:
            row = np.zeros(3)
            row["xyz".index(joint)] = np.sign(angle) * DEG
            listed += [row] * round(abs(angle) / STEP)
        rates = np.array([*listed, np.zeros(3)])
        nominal = np.vstack([np.zeros(3), np.cumsum(rates[:-1] * STEP, axis=0)])
        return STEP * np.arange(len(rates)), nominal, rates

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault."""
        t, nominal, rates = self.plan()
        world = World(
            t, nominal, rates, np.random.default_rng(self.seed), self.latitude, self.gravity, self.heading
        )
        noise = np.random.default_rng(self.seed + 1)
        if act:
            act(world, size)
        middle = nominal + 0.5 * STEP * rates
        stated = EARTH_RATE * np.array([np.cos(self.latitude), np.sin(self.latitude), 0.0])
        earth = EARTH_RATE * np.array([np.cos(world.latitude), np.sin(world.latitude), 0.0])
        s, c = np.sin(middle), np.cos(middle)
        zero = np.zeros(len(t))
        J = np.array([
            [-s[:, 2] * c[:, 1], c[:, 2], zero], [s[:, 1], zero, zero + 1], [c[:, 2] * c[:, 1], s[:, 2], zero],
        ])  # fmt: skip
        to_base = np.swapaxes(north(self.heading) @ gimbals(middle), 1, 2) @ stated
        world.command = np.einsum("ijn,nj->ni", J, rates) + to_base
        for change in world.on_rate:
            change(world)
        M = np.zeros((3, 3))
        for (i, j), name, sign in (
            ((0, 1), "ds_x", 1), ((0, 2), "do_x", -1), ((1, 0), "do_y", -1), ((1, 2), "ds_y", 1), ((2, 0), "ds_z", 1),
            ((2, 1), "do_z", -1),
        ):  # fmt: skip
            M[i, j] = sign * self.truth[name]
        M += np.diag([self.truth[f"kg1_{a}"] for a in "xyz"])
        drift = np.array([self.truth[f"kg0_{a}"] for a in "xyz"])
        scatter = self.walk / np.sqrt(STEP) * noise.normal(size=(len(t), 3))
        rate = world.command * world.gyro_gain + world.command @ M.T + drift + world.gyro_bias + scatter
        steps, back = turned_by(rate * STEP), turned_by(-earth * STEP)
        C = np.empty((len(t), 3, 3))
        C[0] = north(self.heading) @ turned_by(self.beta) @ turned_by(1e-5 * noise.normal(size=3))
        for k in range(len(t) - 1):
            C[k + 1] = back @ C[k] @ steps[k]
        self.read(world, C, noise)
        return Case(self.record(world), self.study(), self.truth)

    def read(self, world: World, C: Array, noise: np.random.Generator) -> None:
        """Make the readings of encoders and accelerometers of the attitude (n, 3, 3) of p in north, up, east."""
        late_encoder, late_acc = self.delays
        world.f = world.gravity * C[:, 1, :]
        for act in world.on_force:
            act(world)
        base = north(world.heading) @ turned_by(world.base) @ turned_by(self.beta) @ turned_by(world.tilt)
        inside = np.swapaxes(base, 1, 2) @ C @ turned_by(-(self.gamma + world.block))
        world.th = angles_of(inside, world.nominal) + np.array([0.0, self.zero_y, 0.0])
        for change in world.on_encoders:
            change(world)
        at = world.t * (1 + world.encoder_clock) - late_encoder
        th = np.stack([np.interp(at, world.t, world.th[:, k]) for k in range(3)], axis=1)
        world.th = th + self.encoder * noise.normal(size=th.shape)
        f = np.stack([np.interp(world.t - late_acc, world.t, world.f[:, k]) for k in range(3)], axis=1)
        eta = [self.truth[f"eta_{name}"] for name in ("pz", "oy", "oz")]
        f = np.stack(
            [f[:, 0], f[:, 1] - eta[1] * f[:, 0], f[:, 2] + eta[0] * f[:, 0] - eta[2] * f[:, 1]], axis=1
        )
        scale = 1 + np.array([self.truth[f"ka1_{a}"] for a in "xyz"])
        offset = np.array([self.truth[f"ka0_{a}"] for a in "xyz"])
        world.f = (
            scale * f * world.acc_gain + offset + world.acc_bias + self.acc_noise * noise.normal(size=f.shape)
        )

    def record(self, world: World) -> Any:
        """The record."""
        return ic.record(t=world.t, wc=world.command, th=world.th, acc=world.f)

    def study(self) -> Any:
        """The study, with all that is stated."""
        return ic.study(
            "selfcal",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2", "latitude": f"{self.latitude / DEG:.10g} deg"},
            rig={"kind": "three_axis_gimbals", "heading": f"{self.heading / DEG:.8g} deg"},
            noise={
                "angle_random_walk": f"{self.walk / DEG * 60:.6g} deg/sqrt(h)",
                "accelerometer": f"{self.acc_noise / G0 * 1e6:.6g} ug",
                "encoder": f"{self.encoder / ARCSEC:.6g} arcsec",
            },
            prior={"kg1": "50 ppm", "beta": "20 arcsec"},
            model={"states": "rig"},
        )


def north(heading: float) -> Array:
    """Axes of a base (north, up, east at zero) that is turned clockwise by a heading."""
    return turn("y", -heading)


def draw(rng: np.random.Generator) -> Platform:
    """A test, all inputs within their stated uncertainty."""
    truth: dict[str, float] = {}
    for name, size in (
        ("kg0", 0.3 * DEG_H), ("ds", 300 * ARCSEC), ("do", 300 * ARCSEC), ("ka0", 500e-6 * G0), ("ka1", 1500e-6),
        ("kg1", 50e-6),
    ):  # fmt: skip
        truth |= {f"{name}_{a}": 0.7 * size * rng.normal() for a in "xyz"}
    truth |= {f"eta_{pair}": 200 * ARCSEC * rng.normal() for pair in ("pz", "oy", "oz")}
    return Platform(
        truth, PATHS[int(rng.integers(len(PATHS)))], log_uniform(rng, 1e-4, 1e-2) * DEG / 60,
        G0 * log_uniform(rng, 1e-6, 5e-5), ARCSEC * log_uniform(rng, 0.5, 5), 20 * ARCSEC * rng.normal(size=3),
        15 * ARCSEC * rng.normal(size=3), 15 * ARCSEC * rng.normal(), (2e-3 * rng.normal(), 2e-3 * rng.normal()),
        rng.uniform(-50, 60) * DEG, GRAVITY + GRAVITY_U * rng.normal(), float(rng.integers(0, 360)) * DEG,
        int(rng.integers(2**31)),
    )  # fmt: skip
