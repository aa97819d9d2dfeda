"""Searching for a path: turns and a first attitude, improved from random ones until no small change makes them better.

The changes tried are those of exchange algorithms (`inercal.designs.exchange`), for sequences: a turn replaced, two
exchanged, one moved, the first attitude replaced. Paths of one search take the same time: longer turns leave less for
the rests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

import numpy as np

from inercal.arrays import Array
from inercal.geometry.rotations import elementary
from inercal.strapdown.bounds import Pieces, Step, Times
from inercal.strapdown.limits import LIMITS
from inercal.strapdown.settings import Plan
from inercal.strapdown.simulate import start_attitude

Path: TypeAlias = tuple[int, tuple[tuple[int, float], ...]]
"""Number of the first attitude, and turns as axis 0 to 2 and angle [rad]."""


def criterion(ratio: Array) -> float:
    """Criterion of the ratios (q,) of u to the goal: their geometric mean, and a part of the largest."""
    return float(np.exp(np.mean(np.log(ratio))) + LIMITS.largest_part * ratio.max())


@dataclass(frozen=True, eq=False)
class Ground:
    """The ground of a search: ``pieces`` of plans, ``starts`` (3, 3) that are allowed, ``moves`` (axis, angle), the
    ``number`` of turns, ``goal`` (q,), and of all paths the ``time`` [s], of turns by 90 deg and of the first rest."""

    pieces: Pieces
    starts: tuple[Array, ...]
    moves: tuple[tuple[int, float], ...]
    number: int
    goal: Array
    time: float
    turn_time: float
    first_dwell: float

    def times(self, turns: tuple[tuple[int, float], ...]) -> Times:
        """Times of a path; its rests last as long as the turns leave."""
        turning = sum(abs(angle) for _, angle in turns) * self.turn_time / (0.5 * math.pi)
        dwell = float(self.time - self.first_dwell - turning) / max(len(turns), 1)
        return Times(self.turn_time, dwell, self.first_dwell)

    def fits(self, path: Path) -> bool:
        """True where the turns leave time for rests."""
        return self.times(path[1]).dwell >= LIMITS.shortest_rest + 2.0 * self.pieces.settings.rests.margin


class Judge:
    """The criterion of paths, computed from where each differs from the one last kept."""

    def __init__(self, ground: Ground) -> None:
        self.ground = ground
        self.values: dict[Path, float] = {}
        self._steps: list[Step] = []
        self._path: Path = (-1, ())
        self._times: Times | None = None

    def __call__(self, path: Path) -> float:
        """Criterion of a path."""
        if path not in self.values:
            pieces = self.ground.pieces
            P = pieces.covariance(self._along(path)[-1].information)
            variance = np.diag(P)
            sound = np.all(variance > 0.0)
            self.values[path] = criterion(np.sqrt(variance) / self.ground.goal) if sound else math.inf
        return self.values[path]

    def keep(self, path: Path) -> None:
        """Take a path as the one that those to come differ from."""
        self._steps, self._path, self._times = self._along(path), path, self.ground.times(path[1])

    def _along(self, path: Path) -> list[Step]:
        """The path, after each of its rests."""
        ground, (start, turns) = self.ground, path
        times, same = ground.times(turns), 0
        if start == self._path[0] and times == self._times:
            same = 1
            for one, other in zip(turns, self._path[1], strict=False):
                if one != other:
                    break
                same += 1
        steps = self._steps[:same] or ground.pieces.steps(ground.starts[start], (), times)
        for axis, angle in turns[len(steps) - 1 :]:
            steps.append(ground.pieces.after(steps[-1], axis, angle, times))
        return steps


def search(
    ground: Ground, rng: np.random.Generator, progress: Callable[[int, int], None]
) -> tuple[Path, int]:
    """The best path found, and the number of paths tried; ``progress`` is told (done, total) of the random starts."""
    judge = Judge(ground)
    progress(0, LIMITS.path_starts)
    for done in range(LIMITS.path_starts):
        improve(judge, random_path(ground, rng), rng)
        progress(done + 1, LIMITS.path_starts)
    return min(judge.values, key=lambda path: judge.values[path]), len(judge.values)


def random_path(ground: Ground, rng: np.random.Generator) -> Path:
    """A random path; of turns as short as there are where others do not fit."""
    start = int(rng.integers(len(ground.starts)))
    turns = tuple(ground.moves[int(k)] for k in rng.integers(len(ground.moves), size=ground.number))
    if ground.fits((start, turns)):
        return start, turns
    least = min(abs(angle) for _, angle in ground.moves)
    return start, tuple((axis, math.copysign(least, angle)) for axis, angle in turns)


def improve(judge: Judge, path: Path, rng: np.random.Generator) -> None:
    """Change a path as long as that makes it better."""
    best, improved = judge(path), True
    while improved:
        improved = False
        judge.keep(path)
        changes = sorted(set(_changes(judge.ground, path)) - {path})
        for k in rng.permutation(len(changes)).tolist():
            candidate = changes[k]
            if judge.ground.fits(candidate) and judge(candidate) < best:
                path, best, improved = candidate, judge(candidate), True
                judge.keep(path)
                break


def _changes(ground: Ground, path: Path) -> Iterator[Path]:
    """Paths that differ by one small change; not all of them fit."""
    start, turns = path
    for other in range(len(ground.starts)):
        yield other, turns
    for i, j in product(range(len(turns)), repeat=2):
        if i < j:
            yield start, (*turns[:i], turns[j], *turns[i + 1 : j], turns[i], *turns[j + 1 :])
        if i != j:
            rest = (*turns[:i], *turns[i + 1 :])
            yield start, (*rest[:j], turns[i], *rest[j:])
    for i, move in product(range(len(turns)), ground.moves):
        yield start, (*turns[:i], move, *turns[i + 1 :])


def attitudes(plan: Plan) -> tuple[Array, ...]:
    """The 24 first attitudes (3, 3) that quarter turns make of that of a plan, that first."""
    found = [start_attitude(plan)]
    for C in found:
        for axis in ("x", "y", "z"):
            turned = np.asarray(C @ elementary(axis, 0.5 * np.pi))
            if not any(np.allclose(turned, each, atol=1e-9) for each in found):
                found.append(turned)
    return tuple(found)
