"""Names of the sections, as in the program imucal, and what each of them asks for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.instruments.terms import ACCELEROMETERS_IN_A_FRAME, GYRO_G_SENSITIVITY, GYRO_TRIAD

TERMS_OF_FERRARIS = (*ACCELEROMETERS_IN_A_FRAME, *GYRO_TRIAD, *GYRO_G_SENSITIVITY)
"""The 33 coefficients that six sides and three turns tell."""

POSITIONS = ("x_p", "x_a", "y_p", "y_a", "z_p", "z_a")
"""Axis parallel (p, reads +g) and antiparallel (a, reads -g) to the specific force of rest, which is upward."""

TURNS = ("x_rot", "y_rot", "z_rot")
"""The turn about each axis, which stands upright meanwhile."""

NAMES = POSITIONS + TURNS

UP: NDArray[Any] = np.array([sign * row for row in np.eye(3) for sign in (1.0, -1.0)])
"""Direction of the specific force (6, 3) in the positions."""


def in_words(name: str) -> str:
    """The action that records a section, in words."""
    axis = name[0]
    if name in TURNS:
        return f"the turn about {axis}"
    return f"{'+' if name.endswith('p') else '-'}{axis} up"
