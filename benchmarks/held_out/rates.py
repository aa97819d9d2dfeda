"""Rate tests: a gyro along the axis of a table that turns at one rate after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import inercal as ic

from . import rows
from .rows import World
from .trial import ARCSEC, DEG, EARTH_RATE, Act, Array, Case, log_uniform


@dataclass(frozen=True)
class Rates:
    """A rate test, drawn; rates and noise in deg/s."""

    truth: dict[str, float]
    rates: Array
    noise: float
    table: float
    ppm: float
    lean: float
    error: float
    latitude: float
    seed: int

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault."""
        rng = np.random.default_rng(self.seed)
        x = (1 + self.error) * self.rates[:, None]
        span = float(np.abs(self.rates).max())
        world = World(x, self.rates.copy(), rng, 1, span, np.zeros(len(x)))
        noise = np.random.default_rng(self.seed + 1).normal(size=x.shape) * self.noise
        if act:
            act(world, size)
        earth = EARTH_RATE * np.sin(self.latitude) / DEG
        bias = self.truth["D_F_z"] / DEG
        world.give(self.truth["S_z"] * np.cos(self.lean) * (world.x + earth), noise)
        world.y = world.y + bias
        n = len(x)
        line = world.seen + earth
        z = (world.y[:, 0] - bias - self.truth["S_z"] * line) / self.noise
        positive = np.abs(line) / 2
        columns = np.stack([np.ones(n), line, positive], axis=1) / self.noise
        return Case(self.record(world), self.study(), self.truth, z, columns)

    def record(self, world: World) -> Any:
        """The record, a row for each stay."""
        import pandas

        n = len(world.seen)
        table = {
            "t [s]": np.arange(n) * 60.0 + 30, "rate [deg/s]": world.seen, "phi1 [deg]": np.zeros(n),
            "phi2 [deg]": np.zeros(n), "gyro_z [deg/s]": world.y[:, 0],
        }  # fmt: skip
        return ic.record(pandas.DataFrame(table))

    def study(self) -> Any:
        """The study, with all that is stated."""
        return ic.study(
            "turntable",
            site={"latitude": f"{self.latitude / DEG:.10g} deg"},
            rig={
                "kind": "two_axis_turntable",
                "errors": {"default": {"normal": f"{self.table / ARCSEC:.6g} arcsec"}},
            },
            instrument={"kind": "gyro", "unit": "deg/s", "noise": f"{self.noise:.6g} deg/s", "dwell": "36 s"},
            rate_test={"joint": "phi2", "rate_uncertainty": f"{self.ppm:.6g} ppm"},
        )


def draw(rng: np.random.Generator) -> Rates:
    """A test, all inputs within their stated uncertainty."""
    largest = float(rng.choice([20.0, 100.0, 300.0]))
    steps = int(rng.integers(4, 9))
    half = largest * np.linspace(1 / steps, 1, steps)
    up = np.concatenate([-half[::-1], half])
    choice = rng.integers(3)
    rates = (
        up if choice == 0 else np.concatenate([up, up[::-1]]) if choice == 1 else up[rng.permutation(len(up))]
    )
    table, ppm = ARCSEC * log_uniform(rng, 2, 30), log_uniform(rng, 2, 50)
    truth = {"S_z": 1 + 1e-3 * rng.normal(), "D_F_z": log_uniform(rng, 0.1, 30) / 3600 * DEG, "S_asym_z": 0.0}
    return Rates(
        truth, rates, largest * log_uniform(rng, 1e-6, 1e-4), table, ppm, float(np.hypot(*rng.normal(size=2) * table)),
        1e-6 * ppm * rng.normal(), rng.uniform(-55, 65) * DEG, int(rng.integers(2**31)),
    )  # fmt: skip


def belt_slips(world: World, size: float) -> None:
    """Slip in proportion to the rate."""
    world.x *= 1 - size * np.abs(world.x) / world.size


def tachometer_wrong(world: World, size: float) -> None:
    """All true rates by a factor."""
    world.x *= 1 + size


def heats_itself(world: World, size: float) -> None:
    """A scale that settles within a third of the test."""
    world.gain *= 1 + size * (1 - np.exp(-3 * world.part))[:, None]


def bends_at_end(world: World, size: float) -> None:
    """Short by the fourth power of the rate."""
    world.gain *= 1 - size * (world.x / world.size) ** 4


def off_axis(world: World, size: float) -> None:
    """An output by the square of the rate."""
    world.bias += size * world.span * (world.x / world.size) ** 2


def drive_unequal(world: World, size: float) -> None:
    """Negative rates are smaller than shown."""
    world.x = np.where(world.x < 0, (1 - size) * world.x, world.x)


def stiction(world: World, size: float) -> None:
    """Small rates come out smaller."""
    world.x = world.x - size * world.size * np.sign(world.x) * np.exp(-np.abs(world.x) / (0.15 * world.size))


def servo_resonance(world: World, size: float) -> None:
    """One true rate by a factor."""
    world.x[world.some(0)] *= 1 + size


def converter_limit(world: World, size: float) -> None:
    """Outputs are cut below the largest."""

    def cut(world: World) -> None:
        top = (1 - size) * np.abs(world.y).max()
        world.y = np.clip(world.y, -top, top)

    world.on_output.append(cut)


def rate_mistyped(world: World, size: float) -> None:
    """One rate of the sheet by a factor."""
    world.seen[world.some(0)] *= 1 + size


FAULTS: dict[str, tuple[float, Act]] = {
    "belt_slips": (1e-4, belt_slips),
    "tachometer_wrong": (1e-4, tachometer_wrong),
    "output_lags": (1e-4, rows.remembers_last),
    "heats_itself": (1e-4, heats_itself),
    "bends_at_end": (1e-4, bends_at_end),
    "supply_step": (1e-4, rows.supply_step),
    "warming_bias": (1e-4, rows.warming),
    "off_axis": (1e-4, off_axis),
    "drive_unequal": (1e-4, drive_unequal),
    "stiction": (1e-4, stiction),
    "servo_resonance": (1e-3, servo_resonance),
    "rows_exchanged": (1e-4, rows.rows_exchanged),
    "converter_limit": (1e-4, converter_limit),
    "rate_mistyped": (1e-3, rate_mistyped),
    "coarse_display": (1e-4, rows.coarse_display),
}
