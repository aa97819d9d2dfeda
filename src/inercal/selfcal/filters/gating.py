"""Compiled near-level gating: which accelerometers take part in an update.

Off unless asked for: it only loses information, as the comparison of bounds shows. An accelerometer near level
reads close to zero; it stops within a first angle of that and resumes beyond a second, larger one.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.geometry.kernels import Vector
from inercal.selfcal.settings import Gating

Array: TypeAlias = NDArray[np.float64]

_RULES: Final = {"any": 1.0, "two": 2.0, "channel": 3.0}


def gate_of(gating: Gating | None) -> Array:
    """Settings as kernels take them: (4,) rule (0 off), whether the whole step stops, sines of both angles."""
    if gating is None:
        return np.zeros(4)
    whole = 1.0 if gating.stops == "step" else 0.0
    return np.array([_RULES[gating.rule], whole, math.sin(gating.near), math.sin(gating.far)])


@kernel
def watch(f: Vector, gate: Array, near: NDArray[np.int64]) -> None:
    """Update which accelerometers are ``near`` (3,) level, from the specific force of the encoders' attitude."""
    if gate[0] == 0.0:
        return
    g = math.sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])
    for i in range(3):
        if abs(f[i]) < gate[2] * g:
            near[i] = 1
        elif abs(f[i]) > gate[3] * g:
            near[i] = 0


@kernel
def admitted(i: int, gate: Array, near: NDArray[np.int64]) -> bool:
    """True if accelerometer ``i`` takes part."""
    count = near[0] + near[1] + near[2]
    if gate[0] == 1.0:
        return bool(count == 0)
    if gate[0] == 2.0:
        return bool(count < 2)
    return bool(gate[0] == 0.0 or near[i] == 0)


@kernel
def updating(gate: Array, near: NDArray[np.int64]) -> bool:
    """False where the whole step of update stops, encoders too: with rule ``channel`` as soon as one is near level."""
    if gate[0] == 0.0 or gate[1] == 0.0:
        return True
    count = near[0] + near[1] + near[2]
    return bool(count < 2) if gate[0] == 2.0 else bool(count == 0)
