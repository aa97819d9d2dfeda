"""Readings a row each, in their order: what acts on them, and faults that several methods of rows share."""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import inercal as ic

from .trial import Array


@dataclass
class World:
    """Inputs ``x`` (n, c) of a row each, as they are; ``seen`` (n,) what the sheet says of a row, where it does.

    Outputs are ``gain`` times what the instrument makes of x, and ``bias``; ``span`` is the largest output. ``file``
    (n,) is the number of the file of a row.
    """

    x: Array
    seen: Array
    pick: np.random.Generator
    channels: int
    span: float
    file: Array
    gain: Array = field(init=False)
    bias: Array = field(init=False)
    y: Array = field(init=False)
    gravity: float = 1.0
    on_output: list[Callable[[World], None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begin without faults."""
        self.gain, self.bias = np.ones((len(self.x), self.channels)), np.zeros((len(self.x), self.channels))

    @property
    def part(self) -> Array:
        """How much of the test is over at each row, 0 to 1."""
        return np.linspace(0, 1, len(self.x))

    @property
    def size(self) -> float:
        """The largest input."""
        return float(np.abs(self.x).max())

    def some(self, margin: int = 2) -> int:
        """A row by chance, not among the first and last."""
        return int(self.pick.integers(margin, len(self.x) - margin))

    def channel(self) -> int:
        """A channel by chance."""
        return int(self.pick.integers(self.channels))

    def give(self, ideal: Array, noise: Array) -> None:
        """Make the outputs of what an instrument without fault would give."""
        self.y = self.gain * ideal + self.bias + noise
        for late in self.on_output:
            late(self)


def counted(title: str, y: Array) -> Any:
    """A record of rows without times, read from a file, for there is no other way to have one."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.csv"
        with path.open("w", newline="") as file:
            csv.writer(file).writerows([[title.replace("?", a) for a in "xyz"], *np.round(y, 12).tolist()])
        return ic.read(path, counted=True)


def supply_step(world: World, size: float) -> None:
    """All scales by a factor from some row on."""
    world.gain[world.some() :] *= 1 + size


def scale_drifts(world: World, size: float) -> None:
    """A scale of each channel that goes with time."""
    world.gain *= 1 + size * np.outer(world.part - 0.5, world.pick.normal(size=world.channels))


def warming(world: World, size: float) -> None:
    """Biases that die away, to 1/e within a fifth of the test."""
    world.bias += (
        size * world.span * np.outer(np.exp(-5 * world.part), world.pick.normal(size=world.channels))
    )


def bias_drifts(world: World, size: float) -> None:
    """Biases that go with time."""
    world.bias += size * world.span * np.outer(world.part, world.pick.normal(size=world.channels))


def rows_exchanged(world: World, size: float) -> None:
    """The two rows whose readings differ by what comes closest to the size."""

    def exchange(world: World) -> None:
        apart = np.abs(world.y[:, None] - world.y[None]).max(axis=2) + 1e9 * world.span * np.eye(len(world.y))
        i, j = np.unravel_index(np.argmin(np.abs(np.log(apart / (size * world.span) + 1e-300))), apart.shape)
        world.y[[i, j]] = world.y[[j, i]]

    world.on_output.append(exchange)


def coarse_display(world: World, size: float) -> None:
    """Readings are rounded."""

    def write_down(world: World) -> None:
        world.y = np.round(world.y / (size * world.span)) * size * world.span

    world.on_output.append(write_down)


def digit_mistyped(world: World, size: float) -> None:
    """One number of one row is off."""
    row, channel = world.some(0), world.channel()

    def mistype(world: World) -> None:
        world.y[row, channel] += size * world.span

    world.on_output.append(mistype)


def remembers_last(world: World, size: float) -> None:
    """A part of the reading before is left in each."""

    def remember(world: World) -> None:
        world.y[1:] += size * (world.y[:-1] - world.y[1:])

    world.on_output.append(remember)
