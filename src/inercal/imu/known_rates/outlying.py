"""An orientation that lies off all others: named, with what it does to the coefficients."""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.findings import Finding
from inercal.imu.known_rates.vector_sizes import SizeFit, fit_sizes, without_rows
from inercal.imu.limits import LIMITS


def outlying(
    fit: SizeFit, outputs: Array, sizes: Array, u: Array, dof: float, places: tuple[str, ...]
) -> tuple[Finding, ...]:
    """A finding where one orientation lies off what all others say, at `LIMITS.outlier_risk` over all.

    ``outputs`` (n, 3) at the rates ``sizes`` (n,), named by their ``places``; ``u`` (9,) are those of the
    coefficients, of which those are harmed that move by more without it.
    """
    if dof < LIMITS.outlier_dof:
        return ()
    probability = without_rows(fit, dof) * len(fit.row)
    worst = int(np.argmin(probability))
    if probability[worst] > LIMITS.outlier_risk:
        return ()
    at = int(fit.row[worst])
    kept, others, names = np.arange(len(outputs)) != at, fit.row != at, fit.fit.identifiability.names
    again = fit_sizes(outputs[kept], sizes[kept], names, fit.covariance[np.ix_(others, others)], fit.fit.x)
    shift = (fit.fit.x - again.fit.x) / u
    leading = int(np.argmax(np.abs(shift)))
    text = (
        f"one orientation lies off what all others say ({places[at]}); without it {names[leading]} would be "
        f"{abs(shift[leading]):.1f} u {'smaller' if shift[leading] > 0 else 'larger'}: was it moved while the table "
        "turned, or did the table turn at another rate? leave it out"
    )
    harm = tuple(name for name, each in zip(names, shift, strict=True) if abs(each) > 1.0)
    return (Finding("outlying_pose", text, places[at], harm),)
