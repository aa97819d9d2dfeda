"""Small steps about level: does an accelerometer follow tilts of seconds of arc?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import inercal as ic

from . import rows
from .rows import World
from .trial import ARCSEC, G0, Act, Array, Case, log_uniform


@dataclass(frozen=True)
class Steps:
    """A test by small steps, drawn; tilts in rad, outputs in m/s²."""

    truth: dict[str, float]
    tilts: Array
    noise: float
    jitter: float
    table: float
    gravity: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault."""
        rng = np.random.default_rng(self.seed)
        x = (
            self.tilts[:, None]
            + self.jitter * rng.normal(size=(len(self.tilts), 1))
            + self.table * rng.normal()
        )
        noise = self.noise * rng.normal(size=x.shape)
        span = G0 * float(np.abs(self.tilts).max())
        world = World(x, self.tilts.copy(), rng, 1, span, np.zeros(len(x)))
        if act:
            act(world, size)
        world.give(-self.gravity * np.sin(world.x) * self.truth["K1_x"], noise)
        world.y = world.y + self.truth["K0_x"]
        n, arcsec = len(x), ARCSEC
        record = ic.record(
            t=10.0 * np.arange(n), position=np.arange(n) + 1.0, phi1=world.seen / arcsec, phi2=np.zeros(n),
            acc_x=world.y[:, 0] / G0, units={"phi1": "arcsec", "phi2": "deg", "acc_x": "g"},
        )  # fmt: skip
        small = {"normal": f"{self.jitter / ARCSEC:.6g} arcsec"}
        study = ic.study(
            "turntable",
            site={"latitude": "48.1 deg", "gravity": "9.80938(2) m/s^2"},
            rig={
                "kind": "two_axis_turntable",
                "errors": {
                    "default": {"normal": f"{self.table / ARCSEC:.6g} arcsec"},
                    "dphi_y1": small, "dphi_z2": "none", "dalpha_x1": "none", "dalpha_z1": "none",
                    "dalpha_x2": "none", "dalpha_y2": "none",
                },
            },
            instrument={"kind": "accelerometer", "unit": "g"},
            step_test={"joint": "phi1"},
        )  # fmt: skip
        sigma = np.hypot(self.noise, G0 * self.jitter)
        force = -self.gravity * np.sin(world.seen)
        z = (world.y[:, 0] - self.truth["K0_x"] - self.truth["K1_x"] * force) / sigma
        return Case(record, study, self.truth, z, np.stack([np.ones(n), force], axis=1) / sigma)


def draw(rng: np.random.Generator) -> Steps:
    """A test, all inputs within their stated uncertainty."""
    largest, number = float(rng.choice([30.0, 60.0, 120.0])), int(rng.integers(22, 40))
    up = np.linspace(0, largest, number + 1)
    cycle = np.concatenate([up[1:], up[-2::-1], -up[1:], -up[-2::-1]])
    tilts = ARCSEC * np.concatenate([[0.0], np.tile(cycle, int(rng.integers(2, 4)))])
    step = G0 * ARCSEC * largest / number
    truth = {"K0_x": 2e-4 * G0 * rng.normal(), "K1_x": 1 + 3e-4 * rng.normal()}
    truth |= {"K_dz_x": 0.0, "K_hyst_x": 0.0}
    return Steps(
        truth, tilts, step * log_uniform(rng, 0.01, 0.2), ARCSEC * log_uniform(rng, 0.02, 0.3),
        ARCSEC * log_uniform(rng, 2, 10), 9.80938 + 2e-5 * rng.normal(), int(rng.integers(2**31)),
    )  # fmt: skip


def table_sticks(world: World, size: float) -> None:
    """The table follows when the command is far enough away."""
    stands = world.x[0]
    for k, wanted in enumerate(world.x.copy()):
        stands = wanted if abs(wanted[0] - stands[0]) >= size else stands
        world.x[k] = stands


def screw_backlash(world: World, size: float) -> None:
    """The table lies within half the backlash of the command."""
    stands = world.x[0, 0]
    for k, wanted in enumerate(world.x[:, 0].copy()):
        stands = float(np.clip(stands, wanted - size / 2, wanted + size / 2))
        world.x[k] = stands


def bending_drift(world: World, size: float) -> None:
    """An arch over the test."""
    world.bias += size * world.span * (4 * world.part * (1 - world.part))[:, None]


def step_too_large(world: World, size: float) -> None:
    """All tilts by a factor."""
    world.x *= 1 + size


def knock(world: World, size: float) -> None:
    """Another tilt from some step on."""
    world.x[world.some(10) :] += size


def people_walk(world: World, size: float) -> None:
    """A tilt that comes and goes five times."""
    world.x += size * np.maximum(0, np.sin(10 * np.pi * world.part))[:, None]


FAULTS: dict[str, tuple[float, Act]] = {
    "table_sticks": (2 * ARCSEC, table_sticks),
    "screw_backlash": (1 * ARCSEC, screw_backlash),
    "sensor_settles": (1e-2, rows.remembers_last),
    "bending_drift": (1e-2, bending_drift),
    "step_too_large": (1e-2, step_too_large),
    "coarse_display": (1e-2, rows.coarse_display),
    "knock": (1 * ARCSEC, knock),
    "people_walk": (1 * ARCSEC, people_walk),
}
