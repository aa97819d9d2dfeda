"""Terms of a triad that vectors of known size leave open: the verdict in words, and the vector that would cure it."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.identifiability import WORST_BY_SIZE
from inercal.estimate.rounding import rounded
from inercal.findings import Finding, Status
from inercal.imu.limits import LIMITS
from inercal.imu.vector_sizes import SizeFit, fit_sizes, residuals_of, without_rows
from inercal.records.places import counted


def weakness(fit: SizeFit, u: Array, rows: str) -> tuple[Status, str] | None:
    """Status and message of a fit that leaves some term open or weak; None for a sound one.

    ``u`` (9,) are the standard uncertainties; ``rows`` says what was fitted, such as "12 poses".
    """
    identified, names = fit.fit.identifiability, fit.fit.identifiability.names
    relative = u / np.concatenate([np.full(3, np.inf), np.abs(fit.fit.x[3:6]), np.ones(3)])
    relative[~np.isfinite(u)] = np.inf
    unknown = relative > LIMITS.unknown_coefficient_u
    cure = f"add some along {_words(_curing(fit))} and its opposite"
    if not fit.fit.converged or np.any(fit.fit.x[3:6] <= 0.0) or identified.rank < len(names) or np.any(unknown):
        open_terms = ", ".join(name for name, each in zip(names, unknown, strict=True) if each)
        which = open_terms or f"the combination {identified.weakest()}"
        return (
            Status.UNOBSERVABLE,
            f"the {rows} leave {which} open (they lie {spread_words(fit.x)}): {cure}",
        )
    if identified.condition > WORST_BY_SIZE:
        term = identified.leading_term()
        k = names.index(term)
        number = " ± ".join(rounded(float(fit.fit.x[k]), float(u[k])))
        return (
            Status.ILL_CONDITIONED,
            f"the {rows} hardly fix {term} ({number}; weak combination {identified.weakest()}, condition "
            f"{identified.condition:.0f}): {cure}",
        )
    return None


def spread_words(x: Array) -> str:
    """Spread of vectors (n, 3) that do not fill a sphere, in words."""
    s = np.linalg.svd(x - x.mean(axis=0), compute_uv=False)
    if s[1] < 0.05 * s[0]:
        return "along one line"
    return "in one plane" if s[2] < 0.05 * s[0] else "too unevenly"


def _words(direction: Array) -> str:
    """A direction in words: ``+x +y`` is half-way between +x and +y."""
    size = np.max(np.abs(direction))
    return " ".join(
        f"{'+' if c > 0 else '-'}{axis}"
        for c, axis in zip(direction, "xyz", strict=True)
        if abs(c) > 0.3 * size
    )


def _curing(fit: SizeFit) -> Array:
    """The direction (3,) along axes, edges and corners of a cube that tells most of the weakest combination."""
    identified = fit.fit.identifiability
    weak = identified.directions[-1] / identified.scale
    grid = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    grid /= np.linalg.norm(grid, axis=1, keepdims=True)
    size = float(np.max(np.linalg.norm(fit.x, axis=1)))
    gain = residuals_of(fit.model, size * grid) @ weak
    return np.asarray(grid[np.argmax(np.abs(gain))])


def outlying(
    fit: SizeFit, outputs: Array, sizes: Array, u: Array, variance: float, dof: float, code: str, rows: NDArray[np.int64]
) -> tuple[Finding, ...]:
    """A finding where one row lies off what all others say, at `LIMITS.outlying_risk` over all rows.

    ``rows`` (n,) number the rows as the file has them, the first 1; the harm is in coefficients that move by more than
    their ``u`` (9,) without it.
    """
    if dof < 2.0:
        return ()
    deviation, probability = without_rows(fit, variance, dof)
    worst = int(np.argmin(probability))
    if probability[worst] * len(probability) > LIMITS.outlying_risk:
        return ()
    at = int(fit.row[worst])
    kept, names = np.arange(len(outputs)) != at, fit.fit.identifiability.names
    others = fit.row != at
    again = fit_sizes(outputs[kept], sizes[kept], names, fit.covariance[np.ix_(others, others)], fit.fit.x)
    shift = (fit.fit.x - again.fit.x) / u
    leading = int(np.argmax(np.abs(shift)))
    text = (
        f"row {rows[at]} lies {abs(deviation[worst]) / max(sizes):.2g} of the known size off what all others say (by "
        f"chance in {probability[worst] * len(probability):.1g} of tests); without it {names[leading]} would be "
        f"{abs(shift[leading]):.1f} u {'smaller' if shift[leading] > 0 else 'larger'}: was it moving, or another pose or "
        "rate? leave it out"
    )
    harm = tuple(name for name, each in zip(names, shift, strict=True) if abs(each) > 1.0)
    return (Finding(code, text, f"row {rows[at]}", harm),)


def few_findings(dof: float, rows: str) -> tuple[Finding, ...]:
    """A finding where hardly more is known than asked."""
    if dof >= 5:
        return ()
    text = f"{rows} leave {counted(round(dof), 'degree')} of freedom for nine parameters: the uncertainties themselves "
    return (Finding("few_degrees_of_freedom", text + "are uncertain, record more"),)
