"""The two halves of the dialects: rules are written on the one, and the other is looked at once, at the end."""

import numpy as np

from .kinds import DIALECTS

SEED = 20261127
HALVES = ("development", "blind")


def half(name):
    """The dialects of a half, those with and without a sensor parted alike."""
    chosen = []
    for group in (
        [dialect for dialect in DIALECTS if dialect.acc or dialect.gyro],
        [dialect for dialect in DIALECTS if not dialect.acc and not dialect.gyro],
    ):
        order = np.random.default_rng(SEED).permutation(len(group))
        places = order[: (len(group) + 1) // 2] if name == "development" else order[(len(group) + 1) // 2 :]
        chosen += [group[place] for place in sorted(places)]
    return chosen
