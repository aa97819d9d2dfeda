"""A strapdown unit that rests and is turned, without a table."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

import inercal as ic

from . import sample_faults as shared
from .motion import Motion
from .samples import World
from .trial import ARCSEC, DEG, DEG_H, G0, Act, Case, turn

GRAVITY, GRAVITY_U = 9.80938, 1e-5
RATE = 50.0
TURNS = ("-z", "y", "x", "-y", "-y", "-x", "-x", "-x", "z", "y", "y", "-z")
GRADES = {  # random walks [deg/sqrt(h), ug/sqrt(Hz)], rest velocity [mm/s], time of a turn [s], priors
    "navigation": (5e-4, 5.0, 0.1, 9.0, (0.5, 100.0, 60.0, 200.0, 150.0, 60.0)),
    "tactical": (0.05, 50.0, 0.2, 4.0, (10.0, 500.0, 200.0, 3000.0, 500.0, 200.0)),
    "mems": (0.3, 150.0, 1.0, 2.0, (200.0, 3000.0, 1000.0, 20000.0, 3000.0, 1000.0)),
}


@dataclass(frozen=True)
class Unit:
    """A recording, drawn."""

    grade: str
    truth: dict[str, float]
    motion: Motion
    end: float
    gravity: float
    latitude: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The recording with a fault."""
        walk, force_walk, sway, _, _ = GRADES[self.grade]
        t = np.arange(1, round(self.end * RATE) + 1) / RATE
        turns, hold = self.motion.numbers(t - 0.5 / RATE)
        noise = (force_walk * 1e-6 * G0 * np.sqrt(RATE), walk * DEG / 60 * np.sqrt(RATE))
        k2 = np.array([self.truth[f"K2_{a}"] for a in "xyz"])
        plan = SimpleNamespace(latitude=self.latitude)
        world = World(
            t, turns, hold, np.zeros(len(t), int), self.truth, np.random.default_rng(self.seed), noise, k2,
            self.gravity, plan,
        )  # fmt: skip
        world.attitude = self.motion.at(t - 0.5 / RATE)[0]
        if act:
            act(world, size)
        arms = np.array([[self.truth.get(f"r_{i}{j}", 0.0) for j in "xyz"] for i in "xyz"])
        f, w = self.motion.feel(t, 1 / RATE, self.gravity, plan.latitude, self.truth["tau_a"], arms)
        rng = np.random.default_rng(self.seed + 3)
        shaken = np.zeros_like(f)
        for frequency in rng.uniform(1.5, 6, size=16):
            speed = 0.3 * sway * 1e-3 / np.sqrt(8) * rng.normal(size=3)
            wave = np.sin(2 * np.pi * frequency * t + rng.uniform(0, 6.28))
            shaken += np.outer(np.diff(wave, prepend=wave[0]) * RATE, speed)
        world.make(f + np.einsum("nji,nj->ni", world.attitude, shaken), w)
        rows, stamps = world.rows()
        record = ic.record(t=stamps, acc=world.acc[rows], gyro=world.gyro[rows])
        return Case(record, self.study(), self.truth)

    def study(self) -> Any:
        """The study, with all that is stated."""
        walk, force_walk, sway, _, (drift, scale, skew, bias, k1, axes) = GRADES[self.grade]
        return ic.study(
            "strapdown",
            strapdown={"frame": "upper"},
            site={"gravity": f"{GRAVITY} ± {GRAVITY_U} m/s^2", "latitude": f"{self.latitude / DEG:.8g} deg"},
            noise={
                "angle_random_walk": f"{walk} deg/sqrt(h)", "velocity_random_walk": f"{force_walk} ug/sqrt(Hz)",
                "gyro_walk": "0 deg/h/sqrt(s)", "accelerometer_walk": "0 ug/sqrt(s)",
            },
            rests={"velocity": f"{sway} mm/s"},
            start={"heading": "gyrocompass" if self.grade == "navigation" else "free"},
            prior={
                "gyro_bias": f"{drift} deg/h", "scale": f"{scale} ppm", "misalignment": f"{skew} arcsec",
                "bias": f"{bias} ug", "k1": f"{k1} ppm", "axes": f"{axes} arcsec", "k2": "100 ug/g^2",
                "size": "3 cm", "delay": "2 ms",
            },
        )  # fmt: skip


def draw(rng: np.random.Generator) -> Unit:
    """A recording, all inputs within their stated uncertainty, all coefficients from the prior."""
    grade = str(rng.choice(list(GRADES)))
    _, _, _, time, (drift, scale, skew, bias, k1, axes) = GRADES[grade]
    truth: dict[str, float] = {}
    for name, mean, size in (
        ("D_F", 0.0, drift * DEG_H), ("S", 1.0, scale * 1e-6), ("K0", 0.0, bias * 1e-6 * G0), ("K1", 1.0, k1 * 1e-6),
        ("K2", 0.0, 1e-4 / G0),
    ):  # fmt: skip
        truth |= {f"{name}_{a}": mean + size * rng.normal() for a in "xyz"}
    truth |= {f"T_{a}{b}": skew * ARCSEC * rng.normal() for a in "xyz" for b in "xyz" if a != b}
    truth |= {f"M_{pair}": axes * ARCSEC * rng.normal() for pair in ("xy", "xz", "yz")}
    truth |= {f"r_{a}{b}": 0.03 * rng.normal() for a in "xy" for b in "xyz"} | {"tau_a": 2e-3 * rng.normal()}
    dwell = float(rng.choice([8.0, 12.0]))
    signs = rng.permutation(3)
    axes_of = [np.eye(3)[signs["xyz".index(name[-1])]] * (-1 if name[0] == "-" else 1) for name in TURNS]
    begins = 20.0 + np.arange(len(TURNS)) * (time + dwell)
    motion = Motion(
        turn("z", rng.uniform(0, 6.28)) @ turn("x", 0.02 * rng.normal()) @ turn("y", 0.02 * rng.normal()), begins,
        np.full(len(TURNS), time), np.array(axes_of), DEG * (90 + 3 * rng.normal(size=len(TURNS))),
        0.1 * rng.normal(size=(len(TURNS), 3)),
    )  # fmt: skip
    return Unit(
        grade, truth, motion, float(begins[-1] + time + dwell), GRAVITY + GRAVITY_U * rng.normal(),
        rng.uniform(-55, 65) * DEG, int(rng.integers(2**31)),
    )  # fmt: skip


def wrong_latitude(world: World, size: float) -> None:
    """The unit stands at another latitude than stated."""
    world.plan.latitude += size


def tripod_creeps(world: World, size: float) -> None:
    """A lean in each rest that settles within 3 s."""
    shared.sinks(world, size, 3.0)


def carpet_slides(world: World, size: float) -> None:
    """A slide of some length in the first two seconds of each rest."""
    pulse = np.zeros((len(world.t), 3))
    for number in np.unique(world.hold[world.hold > 0]):
        since = world.t - world.t[np.flatnonzero(world.hold == number)[0]]
        inside = (since >= 0) & (since < 2)
        x = since[inside] / 2
        rise = 60 * x * (1 - x) * (1 - 2 * x) / 4
        pulse[inside] = np.outer(rise, np.append(world.pick.normal(size=2), 0.0))

    def slide(world: World) -> None:
        world.f = world.f + size * np.einsum("nji,nj->ni", world.attitude, pulse)

    world.on_input.append(slide)


def one_channel_late(world: World, size: float) -> None:
    """One accelerometer by a time."""
    channel = world.channel()

    def late(world: World) -> None:
        world.f[:, channel] = np.interp(world.t - size, world.t, world.f[:, channel])

    world.on_input.append(late)


def sample_lost(world: World, size: float) -> None:
    """One sample (more where the size says so) in one turn."""
    shared.lose(world, size, 1)


FAULTS: dict[str, tuple[float, Act]] = {
    "turns_clipped": (0.02, shared.turns_clipped),
    "sample_lost": (1, sample_lost),
    "clock_fast": (1e-4, shared.clock_fast),
    "wrong_gravity": (1e-4, shared.wrong_gravity),
    "wrong_latitude": (0.5 * DEG, wrong_latitude),
    "knocked_gyro": (1 * DEG_H, shared.knocked_gyro),
    "gyro_wanders": (1 * DEG_H, shared.gyro_wanders),
    "scale_warms": (1e-4, shared.scale_warms),
    "supply_droops": (1e-4, shared.supply_droops),
    "unequal_senses": (1e-4, shared.unequal_senses),
    "weight_on_gyro": (1 * DEG_H, shared.weight_on_gyro),
    "cubic_sensor": (1e-4, shared.cubic_sensor),
    "tripod_creeps": (20 * ARCSEC, tripod_creeps),
    "carpet_slides": (1e-3, carpet_slides),
    "one_channel_late": (1e-3, one_channel_late),
    "warm_after_turn": (1 * DEG_H, shared.warm_after_turn),
    "bending_gyro": (1e-4, shared.bending_gyro),
    "cross_product": (1e-4, shared.cross_product),
}
