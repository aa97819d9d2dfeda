"""Terms of a triad that its poses or orientations leave open: the verdict in words, and directions in words."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Status
from inercal.foundation.inference.identifiability import WORST_BY_SIZE
from inercal.foundation.inference.least_squares import NonlinearFit
from inercal.foundation.results.shown import rounded
from inercal.systems.imu.limits import LIMITS


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


def weakness(
    fit: NonlinearFit, u: Array, outputs: Array, curing: Array, rows: str
) -> tuple[Status, str] | None:
    """Status and message of a fit that leaves some term open or weak; None for a sound one.

    Parameters
    ----------
    fit : NonlinearFit
        Of biases (3), scale factors (3), misalignments, and perhaps second-order coefficients.
    u : (p,)
        Standard uncertainties.
    outputs : (n, 3)
        Mean outputs that were fitted.
    curing : (3,)
        Direction that tells most of the weakest combination.
    rows : str
        The number of poses or orientations, in words.
    """
    identified, names = fit.identifiability, fit.identifiability.names
    scale = np.abs(fit.x[3:6])
    sizes = np.concatenate([0.5 * np.ptp(outputs, axis=0), scale, np.ones(3)])
    with np.errstate(divide="ignore", invalid="ignore"):
        unknown = ~(u[:9] / sizes < LIMITS.unknown_coefficient_u)
    cure = f"add some with {pose_words(curing)} up, and its opposite"
    if not fit.converged or np.any(fit.x[3:6] <= 0.0) or identified.rank < len(names) or np.any(unknown):
        open_terms = ", ".join(name for name, each in zip(names, unknown, strict=False) if each)
        which = open_terms or f"the combination {identified.weakest()}"
        return (
            Status.UNOBSERVABLE,
            f"the {rows} leave {which} open (they lie {spread_words(outputs)}): {cure}",
        )
    if identified.condition > WORST_BY_SIZE:
        term = identified.leading_term()
        k = names.index(term)
        number = " ± ".join(rounded(float(fit.x[k]), float(u[k])))
        return (
            Status.ILL_CONDITIONED,
            f"the {rows} hardly fix {term} ({number}; weak combination {identified.weakest()}, condition "
            f"{identified.condition:.0f}): {cure}",
        )
    return None
