"""An orientation that lies off all others: found, and named with what it does to the coefficients."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.systems.imu.known_rates.fit import NAMES, RateFit
from inercal.systems.imu.known_rates.vector_sizes import without_rows
from inercal.systems.imu.limits import LIMITS


def outlying(rate_fit: RateFit) -> int | None:
    """Place of the orientation that lies off what all others say, at `LIMITS.outlier_risk` over all; None if none
    does."""
    fit = rate_fit.fit
    probability = without_rows(fit, rate_fit.dof[rate_fit.group]) * len(fit.row)
    worst = int(np.argmin(probability))
    return int(fit.row[worst]) if probability[worst] < LIMITS.outlier_risk else None


def outlying_finding(values: Array, without: Array, u: Array, place: str, number: int) -> Finding:
    """The finding about the orientation at that ``place``, the ``number`` th.

    ``values`` (9,) are the coefficients, ``without`` (9,) those without it with their ``u`` (9,), by more than which
    those move that are harmed.
    """
    shift = (values - without) / u
    leading = int(np.argmax(np.abs(shift)))
    text = (
        f"one orientation lies off what all others say ({place}); without it {NAMES[leading]} would be "
        f"{abs(shift[leading]):.1f} u {'smaller' if shift[leading] > 0 else 'larger'}: was it moved while the table "
        f'turned, or did the table turn at another rate? leave it out by imu.exclude = ["pose {number}"]'
    )
    harm = tuple(name for name, each in zip(NAMES, shift, strict=True) if abs(each) > 1.0)
    return Finding("outlying_pose", text, place, harm)
