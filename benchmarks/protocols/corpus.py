"""All protocols, and the two halves into which a seed parted them before any was run."""

from __future__ import annotations

import inspect
import zlib
from pathlib import Path

import numpy as np

from . import bench, hand, refused, rows

SEED = 4711
HALVES = ("development", "put_away")


def protocols():
    """The maker of each protocol by name: its files into a folder, from a generator of its own."""
    found = {}
    for module in (bench, hand, rows, refused):
        for name, maker in vars(module).items():
            own = inspect.isfunction(maker) and maker.__module__ == module.__name__
            if own and list(inspect.signature(maker).parameters) == ["folder", "rng"]:
                found[name] = maker
    return found


def half(name):
    """Names of the protocols of a half, in order."""
    names = sorted(protocols())
    order = np.random.default_rng(SEED).permutation(len(names))
    first = {names[k] for k in order[: len(names) // 2]}
    return [one for one in names if (one in first) == (name == HALVES[0])]


def made(name, folder):
    """A protocol's files in a folder, and its case."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return protocols()[name](folder, np.random.default_rng([SEED, zlib.crc32(name.encode())]))
