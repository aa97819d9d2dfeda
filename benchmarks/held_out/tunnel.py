"""A model on its sting: accelerometers and a gyro that pitch in the plane, and its angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import inercal as ic

from .trial import DEG, DEG_H, G0, Act, Array, Case, log_uniform

GRAVITY, GRAVITY_U = 9.8101, 1e-4
AXES = np.array([90.0, 0.0, -90.0]) * DEG
PLACES = np.array([-0.25, 0.20, 0.25])


@dataclass
class World:
    """Samples (n,) of a model: its pitch and what acts on its sensors; faults change it before and while it is read.

    ``lean`` (n, 3) are turns of the axes, ``places`` and ``heights`` (n, 3) where the sensors are; ``heave`` and
    ``axial`` (n,) accelerations of the whole model; ``roll`` and ``yaw`` rates and angles out of the plane.
    """

    t: Array
    theta: Array
    w: Array
    al: Array
    places: Array
    heights: Array
    pick: np.random.Generator
    gravity: float
    pauses: Array
    gyro_clock: float = 0.0
    late: float = 0.0
    gyro_gain: float = 1.0
    channel_late: Array = field(default_factory=lambda: np.zeros(3))
    on_force: list[Callable[[World], None]] = field(default_factory=list)
    on_output: list[Callable[[World], None]] = field(default_factory=list)
    f: Array = field(init=False)
    a: Array = field(init=False)
    gyro: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin without faults."""
        n = len(self.t)
        self.lean, self.bias, self.gain = np.zeros((n, 3)), np.zeros((n, 3)), np.ones((n, 3))
        self.heave, self.axial, self.roll, self.yaw_rate = (np.zeros(n) for _ in range(4))
        self.gyro_bias = np.zeros(n)

    @property
    def part(self) -> Array:
        """How much of the run is over at each sample, 0 to 1."""
        return np.asarray(self.t / self.t[-1])

    def sensor(self) -> int:
        """An accelerometer by chance."""
        return int(self.pick.integers(3))

    def feel(self) -> None:
        """Find what each accelerometer should indicate [m/s²] (n, 3)."""
        th, w2 = self.theta[:, None], (self.w**2)[:, None]
        yaw2 = (self.yaw_rate**2)[:, None]
        fx = (
            self.gravity * np.sin(th)
            - self.places * (w2 + yaw2)
            - self.heights * self.al[:, None]
            + self.axial[:, None]
        )
        fz = self.gravity * np.cos(th) * np.cos(self.roll)[:, None] + self.places * self.al[:, None]
        fz = fz - self.heights * w2 + self.heave[:, None]
        angle = AXES + self.lean
        self.f = np.cos(angle) * fx - np.sin(angle) * fz


@dataclass(frozen=True)
class Run:
    """A run in a tunnel, drawn; ``motion`` gives angle, rate and acceleration at any time."""

    motion: Callable[[Array], tuple[Array, Array, Array]]
    length: float
    rate: float
    pauses: Array
    noise: tuple[float, float]
    bias: Array
    bias_u: float
    gyro_bias: float
    gyro_scale: float
    gyro_delay: float
    places: Array
    heights: Array
    gravity: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault; its values are angles at some times."""
        t = np.arange(round(self.length * self.rate)) / self.rate
        rng = np.random.default_rng(self.seed)
        theta, w, al = self.motion(t)
        ones = np.ones((len(t), 1))
        world = World(
            t, theta, w, al, PLACES + self.places * ones, self.heights * ones, rng, self.gravity, self.pauses
        )
        noise = np.random.default_rng(self.seed + 1)
        for frequency in noise.uniform(8, 10, size=12):
            world.heave += (
                0.002
                * G0
                / np.sqrt(6)
                * noise.normal()
                * np.sin(2 * np.pi * frequency * t + noise.uniform(0, 6))
            )
        for frequency in noise.uniform(11, 13, size=12):
            world.axial += (
                0.001
                * G0
                / np.sqrt(6)
                * noise.normal()
                * np.sin(2 * np.pi * frequency * t + noise.uniform(0, 6))
            )
        truth_theta = theta.copy()
        if act:
            act(world, size)
        world.feel()
        for change in world.on_force:
            change(world)
        ideal = world.f
        for k, late in enumerate(world.channel_late + world.late):
            if late:
                ideal[:, k] = np.interp(t - late, t, ideal[:, k])
        scatter = self.noise[0] * noise.normal(size=ideal.shape)
        world.a = world.gain * ideal + self.bias + world.bias + scatter
        at = t * (1 + world.gyro_clock) - self.gyro_delay - world.late
        rate = self.motion(at)[1] * (1 + self.gyro_scale) * world.gyro_gain
        world.gyro = rate + self.gyro_bias + world.gyro_bias + self.noise[1] * noise.normal(size=len(t))
        for late_act in world.on_output:
            late_act(world)
        record = ic.record(
            t=t, a1=world.a[:, 0] / G0, a2=world.a[:, 1] / G0, a3=world.a[:, 2] / G0, gyro=world.gyro / DEG,
            units={"a1": "g", "a2": "g", "a3": "g", "gyro": "deg/s"},
        )  # fmt: skip
        rows = np.flatnonzero(np.isin(np.arange(len(t)), np.searchsorted(t, self.times())))
        truth = {f"theta@{t[row]:.2f}": float(truth_theta[row]) for row in rows}

        def values(result: Any) -> tuple[list[str], Array, Array, Array]:
            table = result.view.rows()
            theta_seen, u = (
                np.asarray(table[name].values, float)[rows] * DEG for name in ("theta", "u_theta")
            )
            return list(truth), theta_seen, u, 2.0 * u

        return Case(record, self.study(), truth, values=values)

    def times(self) -> Array:
        """When the angle is compared: late in each pause, or ten times in the run."""
        return self.pauses if len(self.pauses) else np.linspace(0.25, 0.98, 10) * self.length

    def study(self) -> Any:
        """The study, with all that is stated."""
        names = ("-z", "+x", "+z")
        sensors = {f"a{k + 1}": {"axis": names[k], "r": f"{PLACES[k]} m"} for k in range(3)}
        return ic.study(
            "aoa",
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2"},
            rig={"kind": "sting"},
            sensors={**sensors, "gyro": {}},
            noise={
                "accelerometer": f"{self.noise[0] / G0:.6g} g", "accelerometer_bias": f"{self.bias_u / G0:.6g} g",
                "gyro": f"{self.noise[1] / DEG:.6g} deg/s", "gyro_bias": "5 deg/h",
            },
        )  # fmt: skip


def drawn(rng: np.random.Generator, motion: Any, length: float, pauses: Array) -> Run:
    """A run with this motion, all sensors within what is stated of them."""
    bias_u = G0 * log_uniform(rng, 3e-5, 3e-4)
    return Run(
        motion, length, float(rng.choice([250.0, 500.0])), pauses,
        (G0 * log_uniform(rng, 5e-5, 3e-4), DEG * log_uniform(rng, 0.05, 0.3)),
        bias_u * (rng.normal() + rng.normal(size=3)) / np.sqrt(2), bias_u, 5 * DEG_H * rng.normal(),
        1e-3 * rng.normal(), rng.uniform(0, 3e-3), 3e-3 * rng.normal() + 1e-3 * rng.normal(size=3),
        5e-3 * rng.normal(size=3), GRAVITY + GRAVITY_U * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def buffet(rng: np.random.Generator, rms: float) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Random pitching of 40 sines between 3 and 12 Hz."""
    w, phase = 2 * np.pi * rng.uniform(3, 12, size=40), rng.uniform(0, 6.28, size=40)
    size = rms * np.sqrt(2 / 40)

    def motion(t: Array) -> tuple[Array, Array, Array]:
        found = [np.zeros(len(t)) for _ in range(3)]
        for one, start in zip(w, phase, strict=True):
            found[0] += size * np.sin(one * t + start)
            found[1] += size * one * np.cos(one * t + start)
            found[2] -= size * one**2 * np.sin(one * t + start)
        return found[0], found[1], found[2]

    return motion


def axis_turned(world: World, size: float) -> None:
    """One axis by an angle that stays."""
    world.lean[:, world.sensor()] += size


def stream_heats(world: World, size: float) -> None:
    """The bias of one accelerometer settles within a third of the run, m/s²."""
    world.bias[:, world.sensor()] += size * (1 - np.exp(-3 * world.part))


def loose_bracket(world: World, size: float) -> None:
    """One axis turns by the force along it, at 1 g."""
    k = world.sensor()
    world.feel()
    world.lean[:, k] += size * world.f[:, k] / G0


def bending_sensor(world: World, size: float) -> None:
    """One accelerometer, third order, relative at 1 g."""
    k = world.sensor()

    def bend(world: World) -> None:
        world.bias[:, k] += size * world.f[:, k] ** 3 / G0**2

    world.on_force.append(bend)


def supply_sags(world: World, size: float) -> None:
    """The scale of one accelerometer falls."""
    world.gain[:, world.sensor()] *= 1 - size * world.part


def clips(world: World, size: float) -> None:
    """One accelerometer is cut below its largest value, of either sign."""
    k = world.sensor()

    def cut(world: World) -> None:
        low, high = world.a[:, k].min() + size * G0, world.a[:, k].max() - size * G0
        world.a[:, k] = np.clip(world.a[:, k], low, max(low, high))

    world.on_output.append(cut)


def coarse_converter(world: World, size: float) -> None:
    """One accelerometer in steps of a size, m/s²."""
    k = world.sensor()

    def convert(world: World) -> None:
        world.a[:, k] = size * np.round(world.a[:, k] / size)

    world.on_output.append(convert)
