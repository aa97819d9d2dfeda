"""Units of a self-calibration for people."""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.instruments.terms import shown_unit
from inercal.selfcal.platform.coefficients import units


def of_field(p: int) -> tuple[tuple[str, ...], Array]:
    """Units of the first ``p`` coefficients for people, and how many SI units (p,) each is."""
    shown = [shown_unit(unit) for unit in units(p)]
    return tuple(unit for unit, _ in shown), np.array([size for _, size in shown])
