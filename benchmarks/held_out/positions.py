"""Positions on a two-axis turntable: accelerometer triads and gyrowheels that rest at one position after the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import inercal as ic

from .position_faults import FAULTS
from .trial import ARCSEC, DEG, DEG_H, EARTH_RATE, G0, Act, Array, Case, columns_of, log_uniform, turn

__all__ = ["FAULTS", "draw"]

ERRORS = {  # name, and whether it is redrawn at each position
    "dphi_y1": True, "dalpha_x1": True, "dalpha_z1": True, "deps_x": False, "deps_y": False, "dphi_z2": True,
    "dalpha_x2": True, "dalpha_y2": True, "dtheta_x": False, "dtheta_y": False, "dtheta_z": False,
}  # fmt: skip


@dataclass
class World:
    """All that acts on the readings, a row each: faults change it before and while readings are made.

    ``k`` is the number of the position of a row. ``body`` are small turns of the instrument in its mounting, ``base``
    of the base about north, west and up. ``gain`` multiplies what is not bias, ``supply`` all of the output.
    """

    t: Array
    k: Array
    phi1: Array
    phi2: Array
    errors: dict[str, Array]
    span: float
    pick: np.random.Generator
    latitude: float
    gravity: float
    channels: int
    seen1: Array = field(init=False)
    seen2: Array = field(init=False)
    body: Array = field(init=False)
    base: Array = field(init=False)
    bias: Array = field(init=False)
    gain: Array = field(init=False)
    supply: Array = field(init=False)
    turned: bool = False
    on_force: list[Callable[[World], None]] = field(default_factory=list)
    on_output: list[Callable[[World], None]] = field(default_factory=list)
    f: Array = field(init=False)
    w: Array = field(init=False)
    y: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin without faults."""
        n = len(self.t)
        self.seen1, self.seen2 = self.phi1.copy(), self.phi2.copy()
        self.body, self.base = np.zeros((n, 3)), np.zeros((n, 3))
        self.bias, self.gain, self.supply = (
            np.zeros((n, self.channels)),
            np.ones((n, self.channels)),
            np.ones(n),
        )

    @property
    def part(self) -> Array:
        """How much of the test is over at each row, 0 to 1."""
        return np.asarray(self.t / self.t[-1])

    @property
    def last(self) -> int:
        """Number of the last position."""
        return int(self.k[-1])

    def at(self, rows: Array) -> Array:
        """The first row of each position of an array over rows."""
        return rows[np.unique(self.k, return_index=True)[1]]

    def attitude(self) -> Array:
        """Axes of the instrument in north, west, up (rows, 3, 3), with all errors."""
        e = self.errors
        chain = (
            ("x", self.base[:, 0]), ("y", self.base[:, 1]), ("z", self.base[:, 2]),
            ("y", self.phi1), ("y", e["dphi_y1"]), ("x", e["dalpha_x1"]), ("z", e["dalpha_z1"]),
            ("x", e["deps_x"]), ("y", e["deps_y"]), ("z", self.phi2), ("z", e["dphi_z2"]),
            ("x", e["dalpha_x2"]), ("y", e["dalpha_y2"]),
            ("x", e["dtheta_x"]), ("y", e["dtheta_y"]), ("z", e["dtheta_z"]),
            ("x", self.body[:, 0]), ("y", self.body[:, 1]), ("z", self.body[:, 2]),
        )  # fmt: skip
        found = np.eye(3)
        for axis, angle in chain:
            found = found @ turn(axis, angle)
        return found

    def feel(self) -> None:
        """Find specific force [m/s²] and earth rate [rad/s] on the instrument's axes."""
        attitude = self.attitude()
        up, north = attitude[:, 2, :], attitude[:, 0, :]
        self.f = self.gravity * up
        self.w = EARTH_RATE * (np.cos(self.latitude) * north + np.sin(self.latitude) * up)
        for act in self.on_force:
            act(self)


def accelerometers(truth: Mapping[str, float], world: World) -> tuple[Array, Array]:
    """Outputs without bias, and biases (rows, 3) [m/s²]."""
    found, bias = np.zeros_like(world.f), np.zeros_like(world.f)
    for i, a in enumerate("xyz"):
        force = world.f[:, i] + sum(
            truth.get(f"M_{a}{b}", 0.0) * world.f[:, j] for j, b in enumerate("xyz") if b != a
        )
        found[:, i] = truth[f"K1_{a}"] * (force + truth.get(f"K2_{a}", 0.0) * force**2)
        bias[:, i] = truth[f"K0_{a}"]
    return found, bias


def wheel(truth: Mapping[str, float], world: World) -> tuple[Array, Array]:
    """Outputs without bias, and bias (rows, 1) [rad/s]; its reference of gravity is -1 for an axis that is up."""
    a = -world.f / world.gravity
    squares = {"XX": (0, 0), "YY": (1, 1), "XY": (0, 1), "XZ": (0, 2), "YZ": (1, 2)}
    found = world.w[:, 0].copy()
    for name, value in truth.items():
        of = name.removeprefix("DX_")
        if of in squares:
            found += value * a[:, squares[of][0]] * a[:, squares[of][1]]
        elif of in "XYZ":
            found += value * a[:, "XYZ".index(of)]
    return found[:, None], np.full((len(found), 1), truth["DX_F"])


@dataclass(frozen=True)
class Positions:
    """A test on a table, drawn."""

    kind: str
    truth: dict[str, float]
    angles: Array
    samples: int
    noise: float
    stated: bool
    table: float
    latitude: float
    gravity: float
    seed: int

    @property
    def model(self) -> Callable[[Mapping[str, float], World], tuple[Array, Array]]:
        """The instrument."""
        return accelerometers if self.kind == "accelerometer" else wheel

    def world(self, faultless: bool = False) -> World:
        """The world without fault, with the errors of the table, or without any."""
        n, m = len(self.angles), self.samples
        rng = np.random.default_rng(self.seed)
        k = np.repeat(np.arange(n), m)
        begin = np.arange(n) * 75.0
        t = (begin[:, None] + (np.arange(m) + 0.5) * 60.0 / m).ravel()
        errors = {}
        for name, redrawn in ERRORS.items():
            drawn = rng.normal(size=n) if redrawn else np.full(n, rng.normal())
            errors[name] = np.zeros(n * m) if faultless else self.table * drawn[k]
        span = G0 if self.kind == "accelerometer" else 5 * DEG_H
        return World(
            t, k, self.angles[k, 0], self.angles[k, 1], errors, span, np.random.default_rng(self.seed + 1),
            self.latitude, self.gravity, 3 if self.kind == "accelerometer" else 1,
        )  # fmt: skip

    def expected(self, truth: Mapping[str, float], phi1: Array, phi2: Array) -> Array:
        """Readings (positions, channels) at stated angles on a perfect table."""
        world = self.world(faultless=True)
        world.phi1, world.phi2 = phi1, phi2
        world.feel()
        output, bias = self.model(truth, world)
        return self.means(output + bias)

    def means(self, y: Array) -> Array:
        """Means over the rows of each position."""
        return np.asarray(y.reshape(len(self.angles), self.samples, -1).mean(axis=1))

    def spread(self) -> Array:
        """Standard deviation of the mean readings by noise and by what of the table is redrawn at each position."""
        variance = np.full(self.expected(self.truth, *self._grid()).shape, self.noise**2)
        for name, redrawn in ERRORS.items():
            if redrawn:
                world = self.world(faultless=True)
                world.errors[name] += 1e-5
                world.feel()
                output, bias = self.model(self.truth, world)
                slope = (self.means(output + bias) - self.expected(self.truth, *self._grid())) / 1e-5
                variance = variance + (slope * self.table) ** 2
        return np.asarray(np.sqrt(variance))

    def _grid(self) -> tuple[Array, Array]:
        k = np.repeat(np.arange(len(self.angles)), self.samples)
        return self.angles[k, 0], self.angles[k, 1]

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record with a fault."""
        world = self.world()
        noise = np.random.default_rng(self.seed + 2)
        if act:
            act(world, size)
        world.feel()
        output, bias = self.model(self.truth, world)
        world.y = world.supply[:, None] * (world.gain * output + bias + world.bias)
        scatter = self.noise * np.sqrt(self.samples) * noise.normal(size=world.y.shape)
        world.y = world.y + scatter
        for late in world.on_output:
            late(world)
        spread = self.spread()
        z = (self.means(world.y) - self.expected(self.truth, world.seen1, world.seen2)) / spread
        return Case(self.record(world), self.study(), self.truth, z.ravel(), lambda: self.columns(spread))

    def columns(self, spread: Array) -> Array:
        """What each value does to the mean readings, by differences, over their spread."""
        grid = self._grid()
        slopes = columns_of(lambda truth: self.expected(truth, *grid).ravel(), self.truth)
        return np.asarray(slopes / spread.ravel()[:, None])

    def record(self, world: World) -> Any:
        """The record as a logger or a sheet has it."""
        columns: dict[str, Any] = {
            "t": world.t, "position": world.k + 1.0, "phi1": world.seen1 / DEG, "phi2": world.seen2 / DEG
        }  # fmt: skip
        units = {"phi1": "deg", "phi2": "deg"}
        if self.kind == "accelerometer":
            return ic.record(**columns, acc=world.y / G0, units={**units, "acc": "g"})
        return ic.record(**columns, y_x=world.y[:, 0] / DEG_H, units={**units, "y_x": "deg/h"})

    def study(self) -> Any:
        """The study, with all that is stated."""
        instrument: dict[str, Any] = {"kind": self.kind, "dwell": "60 s", "terms": list(self.truth)}
        if self.kind == "accelerometer":
            instrument |= {"unit": "g"} | (
                {"noise": f"{self.noise / G0 * 1e6:.6g} ug"} if self.stated else {}
            )
        else:
            instrument |= {
                "unit": "deg/h",
                "earth_rate": "stated",
                "coefficients": {"k_x": "1", "k_y": "0", "k_z": "0"},
            }
            instrument |= {"noise": f"{self.noise / DEG_H:.6g} deg/h"} if self.stated else {}
        site = {"latitude": f"{self.latitude / DEG:.10g} deg", "gravity": f"9.80938 ± {GRAVITY_U} m/s^2"}
        rig = {
            "kind": "two_axis_turntable",
            "errors": {"default": {"normal": f"{self.table / ARCSEC:.6g} arcsec"}},
        }
        return ic.study("turntable", site=site, rig=rig, instrument=instrument)


GRAVITY_U = 2e-5


def plan(rng: np.random.Generator) -> Array:
    """Positions (n, 2) of a test: the classic 24, these in a random order or twice, or scattered ones."""
    turns = 45 * DEG * np.arange(8)
    classic = np.concatenate([
        np.stack([turns, 0 * turns], 1), np.stack([turns, 0 * turns + 90 * DEG], 1),
        np.stack([0 * turns + 90 * DEG, turns], 1),
    ])  # fmt: skip
    choice = rng.integers(4)
    if choice == 0:
        return classic
    if choice == 1:
        return classic[rng.permutation(24)]
    if choice == 2:
        return np.concatenate([classic, classic[::-1]])
    scattered = 10 * DEG * rng.integers(0, 36, size=(int(rng.integers(26, 40)), 2))
    return np.concatenate([classic[:8:2], scattered])


def draw(rng: np.random.Generator) -> Positions:
    """A test, all inputs within their stated uncertainty."""
    kind = str(rng.choice(["accelerometer", "gyrowheel"]))
    if kind == "accelerometer":
        truth: dict[str, float] = {}
        for a in "xyz":
            truth |= {f"K0_{a}": 2e-4 * G0 * rng.normal(), f"K1_{a}": 1 + 3e-4 * rng.normal()}
            truth |= {f"M_{a}{b}": 60 * ARCSEC * rng.normal() for b in "xyz" if b != a}
            truth[f"K2_{a}"] = 2e-5 / G0 * rng.normal()
        noise = G0 * log_uniform(rng, 1e-6, 3e-5)
    else:
        sizes = {
            "F": 5.0,
            "X": 4.0,
            "Y": 4.0,
            "Z": 1.0,
            "XX": 0.3,
            "YY": 0.3,
            "XY": 0.2,
            "XZ": 0.2,
            "YZ": 0.2,
        }
        truth = {f"DX_{name}": DEG_H * size * rng.normal() for name, size in sizes.items()}
        noise = DEG_H * log_uniform(rng, 1e-3, 3e-2)
    return Positions(
        kind, truth, plan(rng), int(rng.choice([1, 12])), noise, bool(rng.integers(2)),
        ARCSEC * log_uniform(rng, 1.0, 15.0), rng.uniform(-55, 65) * DEG, 9.80938 + GRAVITY_U * rng.normal(),
        int(rng.integers(2**31)),
    )  # fmt: skip
