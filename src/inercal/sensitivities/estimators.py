"""Sobol indices estimated from samples: rows drawn for two matrices, estimators, bootstrap.

SciPy and SALib hold the same estimators for one call at a time, SciPy for powers of two only. Here they are
applied at thousands of positions and for any number of rows; the tests compare with both.

Sources: Saltelli et al. 2010, "Variance based sensitivity analysis of model output", Computer Physics
Communications 181(2), table 2 (b) and (f), the latter being Jansen 1999, "Analysis of variance designs for
model output", Computer Physics Communications 117.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inercal.arrays import Array
from inercal.rigs.distribution import Distribution
from inercal.sensitivities.indices import Resampled

Sampling: TypeAlias = Literal["random", "sobol"]


@dataclass(frozen=True, eq=False)
class Parts:
    """Estimated parts of the variance of outputs (o,), by factor (o, k).

    ``variance``, ``first_variance`` V_i and ``interaction_variance`` VT_i - V_i in units of the outputs squared,
    ``mean`` in their units; ``resampled`` the same three from resampled rows. The differences VT_i - V_i of two
    estimates scatter about zero where a factor does not interact.
    """

    mean: Array
    variance: Array
    first_variance: Array
    interaction_variance: Array
    resampled: Resampled


def rows(samples: int, sampling: Sampling) -> int:
    """Rows drawn where ``samples`` are asked for: a Sobol sequence is balanced at powers of two only."""
    if samples < 2:
        raise ValueError(f"found {samples} samples, expected 2 or more")
    return samples if sampling == "random" else 2 ** math.ceil(math.log2(samples))


def draw(
    distributions: Sequence[Distribution], count: int, sampling: Sampling, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Two independent matrices A and B of errors, (count, k) each.

    Plain random rows, or one scrambled Sobol sequence in 2 k dimensions, through the quantiles of the
    distributions.
    """
    k = len(distributions)
    if sampling == "random":
        p = rng.random((count, 2 * k))
    else:
        from scipy.stats import qmc

        p = qmc.Sobol(2 * k, rng=rng).random(count)
    errors = np.empty_like(p)
    for column in range(2 * k):
        errors[:, column] = distributions[column % k].quantile(p[:, column])
    return errors[:, :k], errors[:, k:]


def evaluate(function: Callable[[Array], ArrayLike], A: Array, B: Array) -> tuple[Array, Array, Array]:
    """Outputs (n, o) at A and B (n, k), and (k, n, o) at A with one column after the other taken from B.

    Raises
    ------
    ValueError
        Outputs that are not one row for each row of errors, or not finite.
    """

    def outputs(errors: Array) -> Array:
        values = np.asarray(function(errors), dtype=float)
        if values.shape[:1] != (len(errors),) or values.ndim > 2:
            raise ValueError(f"found outputs of shape {values.shape}, expected ({len(errors)}, outputs)")
        if not np.isfinite(values).all():
            raise ValueError("found an output that is not finite")
        return values.reshape(len(errors), -1)

    f_A, f_B = outputs(A), outputs(B)
    f_AB = np.empty((A.shape[1], *f_A.shape))
    for i in range(A.shape[1]):
        exchanged = A.copy()
        exchanged[:, i] = B[:, i]
        f_AB[i] = outputs(exchanged)
    return f_A, f_B, f_AB


def estimate(f_A: Array, f_B: Array, f_AB: Array, resamples: int, rng: np.random.Generator) -> Parts:
    """Saltelli's estimate of V_i and Jansen's of VT_i, and the same from resampled rows.

    The outputs are centred first: a mean far from zero would drown the first order in noise. The bootstrap
    takes the rows for independent: for Sobol points it states too much, up to some twenty times where the
    outputs are almost linear.

    Parameters
    ----------
    f_A, f_B : (n, o)
    f_AB : (k, n, o)
    resamples : int, 2 or more
    rng : Generator, for the resampled rows
    """
    n = len(f_A)
    mean = 0.5 * (f_A.mean(axis=0) + f_B.mean(axis=0))
    y_A, y_B = f_A - mean, f_B - mean
    change = np.moveaxis(f_AB - f_A, 0, -1)  # (n, o, k)
    terms = (
        0.5 * (y_A + y_B),
        0.5 * (np.square(y_A) + np.square(y_B)),
        y_B[..., None] * change,
        0.5 * np.square(change),
    )
    variance, first, total = _moments(terms, np.full((1, n), 1.0 / n))
    chosen = rng.integers(n, size=(resamples, n)) + n * np.arange(resamples)[:, None]
    weights = np.bincount(chosen.ravel(), minlength=n * resamples).reshape(resamples, n) / n
    again, first_again, total_again = _moments(terms, weights)
    resampled = Resampled(again, first_again, total_again - first_again)
    return Parts(mean, variance[0], first[0], total[0] - first[0], resampled)


def _moments(terms: tuple[Array, ...], weights: Array) -> tuple[Array, Array, Array]:
    """Variance (b, o), V_i and VT_i (b, o, k) under weights (b, n) of the rows."""
    mean, square, first, total = (
        (weights @ term.reshape(len(term), -1)).reshape(len(weights), *term.shape[1:]) for term in terms
    )
    return square - np.square(mean), first, total
