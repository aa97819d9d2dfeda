"""Sampled outputs of an IMU: what acts on them, made from force and rate on its axes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from .means import triad
from .trial import Array


@dataclass
class World:
    """Samples (n,) of both triads; faults change the world before (``plan``, biases, gains) and while it is made.

    ``turn`` and ``hold`` are the number of the turn or rest of a sample, -1 outside; ``block`` that of its file or
    section, within which stamps run on though samples are lost. ``plan`` holds what is particular to a method.
    ``attitude`` takes body to a level frame, where the method has one.
    """

    t: Array
    turn: Array
    hold: Array
    block: Array
    truth: Mapping[str, float]
    pick: np.random.Generator
    noise: tuple[float, float]
    k2: Array
    gravity: float
    plan: SimpleNamespace
    clock: float = 0.0
    on_input: list[Callable[[World], None]] = field(default_factory=list)
    on_output: list[Callable[[World], None]] = field(default_factory=list)
    f: Array = field(init=False)
    w: Array = field(init=False)
    attitude: Array = field(init=False)
    acc: Array = field(init=False)
    gyro: Array = field(init=False)
    keep: Array = field(init=False)

    def __post_init__(self) -> None:
        """Begin without faults."""
        n = len(self.t)
        self.acc_bias, self.gyro_bias = np.zeros((n, 3)), np.zeros((n, 3))
        self.acc_gain, self.gyro_gain = np.ones((n, 3)), np.ones((n, 3))
        self.keep = np.ones(n, bool)
        drawn = np.random.default_rng(int(self.pick.integers(2**31)))
        self.scatter = [sigma * drawn.normal(size=(n, 3)) for sigma in self.noise]

    @property
    def part(self) -> Array:
        """How much of the test is over at each sample, 0 to 1."""
        return np.asarray((self.t - self.t[0]) / (self.t[-1] - self.t[0]))

    @property
    def step(self) -> float:
        """Time from sample to sample."""
        return float(np.median(np.diff(self.t)))

    def channel(self) -> int:
        """An axis by chance."""
        return int(self.pick.integers(3))

    def turns(self, count: int) -> Array:
        """Numbers of some turns by chance."""
        listed = np.unique(self.turn[self.turn >= 0])
        return self.pick.choice(listed, size=min(count, len(listed)), replace=False)

    def middle(self, turn: int) -> int:
        """The sample in the middle of a turn."""
        rows = np.flatnonzero(self.turn == turn)
        return int(rows[len(rows) // 2])

    def make(self, f: Array, w: Array) -> None:
        """Make the outputs of force and rate (n, 3) on the axes of the body."""
        self.f, self.w = f, w
        for act in self.on_input:
            act(self)
        scale = np.array([self.truth[f"K1_{a}"] for a in "xyz"])
        along = self.f @ (triad(self.truth, "K1", "M") / scale[:, None]).T
        offset = np.array([self.truth[f"K0_{a}"] for a in "xyz"])
        self.acc = (
            scale * (along + self.k2 * along**2) * self.acc_gain + offset + self.acc_bias + self.scatter[0]
        )
        drift = np.array([self.truth[f"D_F_{a}"] for a in "xyz"])
        felt = np.array([[self.truth.get(f"G_{a}{b}", 0.0) for b in "xyz"] for a in "xyz"])
        rate = (self.w @ triad(self.truth, "S", "T").T) * self.gyro_gain
        self.gyro = rate + self.f @ felt.T + drift + self.gyro_bias + self.scatter[1]
        for late in self.on_output:
            late(self)

    def rows(self) -> tuple[Array, Array]:
        """Numbers of the samples that are in the file, and their stamps."""
        rows, stamps = [], []
        for block in np.unique(self.block):
            of = np.flatnonzero(self.block == block)
            left = of[self.keep[of]]
            rows.append(left)
            stamps.append(self.t[of[: len(left)]])
        return np.concatenate(rows), np.concatenate(stamps) * (1 + self.clock)


def mems(rng: np.random.Generator, full: bool) -> dict[str, float]:
    """True coefficients of an IMU; M is full where a case is the frame, else upper-triangular."""
    truth: dict[str, float] = {}
    for name, mean, size in (("K0", 0.0, 0.05), ("K1", 1.0, 0.005), ("D_F", 0.0, 5e-3), ("S", 1.0, 0.01)):
        truth |= {f"{name}_{a}": mean + size * rng.normal() for a in "xyz"}
    pairs = [a + b for a in "xyz" for b in "xyz" if a != b]
    truth |= {f"M_{pair}": 0.005 * rng.normal() for pair in (pairs if full else ("xy", "xz", "yz"))}
    truth |= {f"T_{pair}": 0.01 * rng.normal() for pair in pairs}
    return truth


def progress(x: Array) -> tuple[Array, Array, Array]:
    """A smooth way from 0 to 1 while x goes from 0 to 1, and its first and second derivatives."""
    x = np.clip(x, 0.0, 1.0)
    return (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * x**2 * (1 - x) ** 2,
        60 * x * (1 - x) * (1 - 2 * x),
    )
