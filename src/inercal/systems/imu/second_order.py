"""Second-order coefficients of the accelerometers that no fit has: their size, and what is said of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.budget import Uncertainty
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import ImuSettings

SOURCE = "K2 of the accelerometers"
"""Its name in budgets."""


def k2_size(settings: ImuSettings, scatter: float) -> float:
    """Standard deviation [1/(m/s^2)] about 0 of K2: as stated, or ordinary for a ``scatter`` [m/s^2] of means."""
    if settings.k2_u is not None:
        return settings.k2_u
    return LIMITS.fine_k2 if scatter <= LIMITS.fine_scatter else LIMITS.ordinary_k2


def shares(names: Sequence[str], uncertainty: Uncertainty) -> Array:
    """Parts (p,) of the variances that K2 causes, by the budget."""
    (own,) = [item.share for item in uncertainty.budget if item.source == SOURCE] or [{}]
    return np.array([min(own.get(name, 0.0), 1.0) for name in names])


def k2_finding(
    names: Sequence[str], uncertainty: Uncertainty, settings: ImuSettings, size: float, cure: str = ""
) -> Iterator[Finding]:
    """A finding where most of some u is by K2 of an ordinary ``size`` that nobody stated."""
    part = shares(names, uncertainty)
    worst = int(np.argmax(part))
    if settings.k2_u is not None or part[worst] < 0.5:
        return
    unit, factor = shown_unit("1/(m/s^2)")
    yield Finding(
        "unmodelled_k2",
        f"Most of u({names[worst]}) is a guess about nonlinearity (K2 = 0 ± {size / factor:.0f} {unit}), and falls to "
        f"{100.0 * np.sqrt(1.0 - part[worst]):.2g} % without.",
        harm=(),
        action=f'State the K2 of the data sheet, such as imu.k2 = "0(20) {unit}"{cure and f", or {cure}"}.',
    )
