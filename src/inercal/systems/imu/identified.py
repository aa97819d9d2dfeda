"""Poses of a triad in words: directions, and how the outputs of all spread."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array


def pose_words(direction: Array) -> str:
    """A direction of specific force in words: ``+x +y`` is half-way between +x up and +y up."""
    size = np.max(np.abs(direction))
    return " ".join(
        f"{'+' if c > 0 else '-'}{axis}"
        for c, axis in zip(direction, "xyz", strict=True)
        if abs(c) > 0.3 * size
    )
