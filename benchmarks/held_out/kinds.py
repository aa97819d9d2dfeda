"""The kinds of faults, and which half each belongs to.

The list is `kinds.csv`. Its halves were drawn by `halves` before anything was run: rules may be made while looking at
the half `development`; the half `held-out` judges them.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np

FILE = Path(__file__).parent / "kinds.csv"
SEED = 20261127
"""Of the draw of the halves."""


@dataclass(frozen=True)
class Kind:
    """A kind of fault: ``name`` is unique within a ``method`` of a ``system``; ``half`` is development or held-out."""

    system: str
    method: str
    name: str
    half: str
    sentence: str


def kinds(half: str | None = None) -> list[Kind]:
    """All kinds of the list, or those of a half, in the order of the list."""
    with FILE.open(newline="") as file:
        listed = [Kind(**row) for row in csv.DictReader(file)]
    return [kind for kind in listed if half in (None, kind.half)]


def halves(names: list[tuple[str, str, str]]) -> list[str]:
    """The half of each (system, method, name): of every method one half of its kinds, by chance."""
    rng = np.random.default_rng(SEED)
    methods = list(dict.fromkeys(name[:2] for name in names))
    found = [""] * len(names)
    for method in methods:
        places = rng.permutation([k for k, name in enumerate(names) if name[:2] == method])
        first = (len(places) + int(rng.integers(2))) // 2
        for k, place in enumerate(places):
            found[place] = "development" if k < first else "held-out"
    return found


def check() -> None:
    """Raise where the halves of the file are not those drawn."""
    listed = kinds()
    drawn = halves([(kind.system, kind.method, kind.name) for kind in listed])
    if drawn != [kind.half for kind in listed]:
        raise ValueError(f"{FILE.name}: the halves are not those of the seed {SEED}")
