"""The search for a plan: random ones, each improved by small changes until none makes it better.

These are the exchanges of `inercal.foundation.designs.exchange`, for plans of any kind: a system says how a plan
begins, which small changes there are, which plans fit, and the criterion of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from inercal.foundation.computing.executors import Executor, numbered
from inercal.foundation.findings import Finding

T = TypeVar("T")
P = TypeVar("P")


class Ground(Protocol[P]):
    """The ground of a search for plans, which have an order and can be keys."""

    def first(self, rng: np.random.Generator) -> P:
        """A random plan that fits."""

    def changes(self, plan: P, /) -> Iterable[P]:
        """Plans that differ by one small change; not all of them fit."""

    def fits(self, plan: P, /) -> bool:
        """True for a plan within all limits."""

    def value(self, plan: P, /) -> float:
        """Criterion of a plan, the less the better."""


def improved(ground: Ground[P], rng: np.random.Generator, values: dict[P, float]) -> tuple[float, P]:
    """A random plan changed as long as that makes it better, with its criterion; ``values`` keeps those of all plans
    tried."""

    def value(plan: P) -> float:
        if plan not in values:
            values[plan] = ground.value(plan)
        return values[plan]

    best = ground.first(rng)
    better: P | None = best
    while better is not None:
        best, better = better, None
        changes: list[Any] = sorted(set(ground.changes(best)))
        for k in rng.permutation(len(changes)).tolist():
            if ground.fits(changes[k]) and value(changes[k]) < value(best):
                better = changes[k]
                break
    return value(best), best


def from_starts(
    work: Callable[[np.random.Generator], T],
    streams: Sequence[np.random.Generator],
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[T]:
    """The ``work`` from each random start, in the order of their ``streams`` of random numbers.

    Starts with streams of their own end with the same digits in any ``executor``, to which the work is pickled.
    ``progress`` is told (done, total) of the starts.
    """
    return numbered(_Start(work, tuple(streams)), len(streams), executor, progress)


@dataclass(frozen=True, eq=False)
class _Start(Generic[T]):
    """Work on random starts, by their numbers."""

    work: Callable[[np.random.Generator], T]
    streams: tuple[np.random.Generator, ...]

    def __call__(self, number: int) -> T:
        """The work from a start."""
        return self.work(self.streams[number])


class Compared(Protocol):
    """A plan beside others, with its figures."""

    @property
    def plan(self) -> Any:
        """The plan, of the system's own kind."""


C = TypeVar("C", bound=Compared)


@dataclass(frozen=True, eq=False)
class Designed(Generic[C]):
    """A plan that was searched for, or the study's own: the first to ``compare`` with others; a ``message`` on the
    search, and ``findings`` about the plan."""

    compare: tuple[C, ...]
    message: str
    findings: tuple[Finding, ...]

    @property
    def plan(self) -> Any:
        """The plan found."""
        return self.compare[0].plan
