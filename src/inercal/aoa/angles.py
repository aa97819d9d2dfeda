"""Angles of a recording, by whatever method."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.filtered import Filtered

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Angles:
    """What a ``method`` says at each of n rows, NaN where it says nothing.

    ``theta`` pitch and its standard uncertainty ``u`` [rad]; ``rate`` and ``rate_u`` [rad/s].
    """

    method: str
    theta: Array
    u: Array
    rate: Array
    rate_u: Array


def of_fusion(filtered: Filtered, states: int) -> Angles:
    """The angles of the fusion with so many ``states`` (of three accelerometers): ``fusion 19``, ``smoothed 19``."""
    way = "smoothed" if filtered.smoothed else "fusion"
    return Angles(f"{way} {states}", filtered.theta, filtered.u, filtered.rate, filtered.rate_u)
