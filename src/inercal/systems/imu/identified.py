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


def spread_words(means: Array) -> str:
    """Spread of the mean outputs of the poses, in words, where they do not fill a sphere."""
    s = np.linalg.svd(means - means.mean(axis=0), compute_uv=False)
    if s[1] < 0.05 * s[0]:
        return "along one line"
    return "in one plane" if s[2] < 0.05 * s[0] else "too unevenly"
