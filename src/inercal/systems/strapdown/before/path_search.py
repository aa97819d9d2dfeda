"""Searching for a path (`inercal.foundation.designs.search`): a first attitude and turns.

The changes tried: a turn replaced, two exchanged, one moved, the first attitude replaced. Paths of one search take the
same time: longer turns leave less for the rests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from typing import TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.search import from_starts, improved
from inercal.foundation.geometry.rotations import elementary
from inercal.systems.strapdown.before.bounds import Pieces, Step, Times
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.settings import TurnPlan
from inercal.systems.strapdown.simulate import start_attitude

Turns: TypeAlias = tuple[tuple[int, float], ...]
"""Turns as axis 0 to 2 and angle [rad]."""

Path: TypeAlias = tuple[int, Turns]
"""Number of the first attitude, and the turns."""

_KEPT = 1000
"""Beginnings of paths of which the end is kept: some 10 MB."""


def criterion(ratio: Array) -> float:
    """Criterion of the ratios (q,) of u to the goal: their geometric mean, and a part of the largest."""
    return float(np.exp(np.mean(np.log(ratio))) + LIMITS.largest_part * ratio.max())


@dataclass(frozen=True, eq=False)
class TurnGround:
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

    def times(self, turns: Turns) -> Times:
        """Times of a path; its rests last as long as the turns leave."""
        turning = sum(abs(angle) for _, angle in turns) * self.turn_time / (0.5 * math.pi)
        dwell = float(self.time - self.first_dwell - turning) / max(len(turns), 1)
        return Times(self.turn_time, dwell, self.first_dwell)

    def fits(self, path: Path) -> bool:
        """True where the turns leave time for rests."""
        return self.times(path[1]).dwell >= LIMITS.shortest_rest + 2.0 * self.pieces.settings.rests.margin

    def first(self, rng: np.random.Generator) -> Path:
        """A random path; of turns as short as there are where others do not fit."""
        start = int(rng.integers(len(self.starts)))
        turns = tuple(self.moves[int(k)] for k in rng.integers(len(self.moves), size=self.number))
        if self.fits((start, turns)):
            return start, turns
        least = min(abs(angle) for _, angle in self.moves)
        return start, tuple((axis, math.copysign(least, angle)) for axis, angle in turns)

    def changes(self, path: Path) -> Iterator[Path]:
        """Other paths that differ by one small change; not all of them fit."""
        start, turns = path
        changed = [(other, turns) for other in range(len(self.starts))]
        for i, j in product(range(len(turns)), repeat=2):
            if i < j:
                changed.append((start, (*turns[:i], turns[j], *turns[i + 1 : j], turns[i], *turns[j + 1 :])))
            if i != j:
                rest = (*turns[:i], *turns[i + 1 :])
                changed.append((start, (*rest[:j], turns[i], *rest[j:])))
        for i, move in product(range(len(turns)), self.moves):
            changed.append((start, (*turns[:i], move, *turns[i + 1 :])))
        return (each for each in changed if each != path)

    def value(self, path: Path) -> float:
        """Criterion of a path."""
        start, turns = path
        P = self.pieces.covariance(self._after(start, turns, self.times(turns)).information)
        variance = np.diag(P)
        return criterion(np.sqrt(variance) / self.goal) if np.all(variance > 0.0) else math.inf

    @cached_property
    def _after(self) -> Callable[[int, Turns, Times], Step]:
        """The end of a path that begins so; of paths that begin alike the common part is computed once."""

        @lru_cache(maxsize=_KEPT)
        def after(start: int, turns: Turns, times: Times) -> Step:
            if not turns:
                return self.pieces.steps(self.starts[start], (), times)[0]
            return self.pieces.after(after(start, turns[:-1], times), *turns[-1], times)

        return after


def search(
    ground: TurnGround, rng: np.random.Generator, progress: Callable[[int, int], None]
) -> tuple[Path, int]:
    """The best path found, and the number of paths tried; ``progress`` is told (done, total) of the random starts."""
    values: dict[Path, float] = {}
    streams = (rng,) * LIMITS.path_starts  # one after the other, in this thread: a path tried is known to all
    found = from_starts(lambda of: improved(ground, of, values), streams, progress=progress)
    return min(found, key=lambda each: each[0])[1], len(values)


def attitudes(plan: TurnPlan) -> tuple[Array, ...]:
    """The 24 first attitudes (3, 3) that quarter turns make of that of a plan, that first."""
    found = [start_attitude(plan)]
    for C in found:
        for axis in ("x", "y", "z"):
            turned = np.asarray(C @ elementary(axis, 0.5 * np.pi))
            if not any(np.allclose(turned, each, atol=1e-9) for each in found):
                found.append(turned)
    return tuple(found)
