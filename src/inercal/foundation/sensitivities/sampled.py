"""Sobol indices from samples: the procedure of Zhao et al. 2023, and what the exact analysis does not cover.

Two matrices A and B of N rows of errors are drawn anew at each position, the outputs are centred, column after
column is exchanged, and first- and total-order indices are estimated. `analyse_function` does the same for any
function of errors: correlated ones, one variable at two places, outputs that are not linear in the attitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array
from inercal.foundation.computing.executors import Executor, numbered
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.outputs import Output
from inercal.foundation.rigs.patterns import Distribution
from inercal.foundation.sensitivities.indices import Indices, Resampled

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

    Raises `ValueError`: outputs that are not one row for each row of errors, or not finite.
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

    ``f_A``, ``f_B`` (n, o) and ``f_AB`` (k, n, o) are centred first: a mean far from zero would drown the first order
    in noise. The bootstrap, of 2 ``resamples`` or more, takes the rows for independent: for Sobol points it states too
    much, up to some twenty times where the outputs are almost linear.
    """
    n, o = f_A.shape
    k = len(f_AB)
    mean = 0.5 * (f_A.mean(axis=0) + f_B.mean(axis=0))
    y_A, y_B = f_A - mean, f_B - mean
    change = np.moveaxis(f_AB, 0, -1) - f_A[..., None]
    terms = np.empty((n, 2 * o * (1 + k)))  # one matrix, for one product with all resamples
    terms[:, :o] = 0.5 * (y_A + y_B)
    terms[:, o : 2 * o] = 0.5 * (np.square(y_A) + np.square(y_B))
    first, total = (part.reshape(n, o, k) for part in np.split(terms[:, 2 * o :], 2, axis=1))
    np.multiply(y_B[..., None], change, out=first)
    np.multiply(0.5 * change, change, out=total)
    chosen = rng.integers(n, size=(resamples, n)) + n * np.arange(resamples)[:, None]
    counts = np.bincount(chosen.ravel(), minlength=n * resamples).reshape(resamples, n)
    moments = np.vstack([np.ones(n), counts]) @ terms / n
    means, squares = moments[:, :o], moments[:, o : 2 * o]
    first, total = (part.reshape(-1, o, k) for part in np.split(moments[:, 2 * o :], 2, axis=1))
    variance, interaction = squares - np.square(means), total - first
    resampled = Resampled(variance[1:], first[1:], interaction[1:])
    return Parts(mean, variance[0], first[0], interaction[0], resampled)


RESAMPLES = 100
"""Resamples of the bootstrap: they give a standard uncertainty to 7 %."""

# Scatter of an output of which this many roundings make up the whole standard deviation is no variance.
_ROUNDING = 8.0 * np.finfo(float).eps


def analyse(
    chain: Chain,
    outputs: Sequence[Output],
    angles: ArrayLike,
    samples: int,
    rng: np.random.Generator,
    sampling: Sampling = "sobol",
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Indices:
    """Estimated indices of outputs of a rig at ``angles`` (n, joints) [rad], with rows drawn anew at each position.

    Parameters
    ----------
    samples : int, 2 or more
        Rows of A and of B, rounded up to a power of two for ``sampling = "sobol"`` (scrambled Sobol points; "random"
        are plain rows, as in the paper); `Indices.method` holds both numbers.
    rng : Generator
        Each position draws from a stream of its own that is spawned from it.
    progress : callable, optional
        Told the positions done and all of them.
    executor : Executor, optional
        Place in which the positions are computed; the digits are the same in any.
    """
    positions = np.atleast_2d(np.asarray(angles, dtype=float))
    sizes = np.array([np.linalg.norm(each.reference) * np.linalg.norm(each.axis) for each in outputs])
    work = _Position(chain, tuple(outputs), positions, samples, sampling, tuple(rng.spawn(len(positions))))
    found = numbered(work, len(positions), executor, progress)
    return _indices(
        [parts for parts, _ in found],
        np.array([ideal for _, ideal in found]),
        _ROUNDING * sizes,
        factors=chain.factors,
        outputs=tuple(each.name for each in outputs),
        units=tuple(each.unit for each in outputs),
        scales=np.array([each.scale for each in outputs]),
        angles=positions,
        method=_method(samples, sampling),
    )


@dataclass(frozen=True, eq=False)
class _Position:
    """The estimate at each of ``positions`` (n, joints) [rad], from its own stream of ``rngs``."""

    chain: Chain
    outputs: tuple[Output, ...]
    positions: Array
    samples: int
    sampling: Sampling
    rngs: tuple[np.random.Generator, ...]

    def __call__(self, number: int) -> tuple[Parts, Array]:
        """Estimated parts, and the outputs (o,) without errors."""
        chain, at, rng = self.chain, self.positions[number], self.rngs[number]

        def values(C_nb: Array) -> Array:
            return np.stack([each.value(C_nb) for each in self.outputs], axis=-1)

        distributions = [error.distribution for error in chain.errors]
        A, B = draw(distributions, rows(self.samples, self.sampling), self.sampling, rng)
        f_AB = values(chain.exchanged(at, A, B))
        parts = estimate(values(chain.attitude(at, A)), values(chain.attitude(at, B)), f_AB, RESAMPLES, rng)
        return parts, values(chain.attitude(at))


def analyse_function(
    function: Callable[[Array], ArrayLike],
    distributions: Mapping[str, Distribution],
    samples: int,
    rng: np.random.Generator,
    sampling: Sampling = "sobol",
    outputs: Sequence[str] = ("y",),
) -> Indices:
    """Estimated indices of any function of independent errors, as those of one position without angles.

    Correlated errors: let the function make them of the independent ones it is given, ``errors @ L.T`` with
    ``L L^T`` their covariance. An index then belongs to an independent variable (with the lower triangle of
    Cholesky: to what a factor adds to those before it), not to the correlated error itself, for which no single
    share is defined. One variable at two places: let the function put its column at both.

    Parameters
    ----------
    function : callable
        From errors (m, k), one column for each distribution, to outputs (m,) or (m, o).
    distributions : mapping
        Distribution by name of the factor.
    samples, rng, sampling
        As in `analyse`.
    outputs : sequence of str
        Names of the outputs (o,). They carry no unit, and scales of one.

    Returns
    -------
    Indices
        With n = 1; the bias is that against the output without errors.

    Raises
    ------
    ValueError
        Fewer than two samples, or outputs of another shape or not finite.
    """
    names = tuple(outputs)
    each = list(distributions.values())
    parts = _parts(function, each, samples, rng, sampling)
    ideal = np.asarray(function(np.zeros((1, len(each)))), dtype=float).reshape(1, -1)
    if len(parts.mean) != len(names):
        raise ValueError(f"found {len(parts.mean)} outputs, expected {len(names)}: {', '.join(names)}")
    return _indices(
        [parts],
        ideal,
        _ROUNDING * np.abs(parts.mean),
        factors=tuple(distributions),
        outputs=names,
        units=("",) * len(names),
        scales=np.ones(len(names)),
        angles=np.zeros((1, 0)),
        method=_method(samples, sampling),
    )


def _parts(
    function: Callable[[Array], ArrayLike],
    distributions: Sequence[Distribution],
    samples: int,
    rng: np.random.Generator,
    sampling: Sampling,
) -> Parts:
    """Draw, evaluate, estimate."""
    A, B = draw(distributions, rows(samples, sampling), sampling, rng)
    return estimate(*evaluate(function, A, B), RESAMPLES, rng)


def _method(samples: int, sampling: Sampling) -> dict[str, object]:
    """Settings of the sampled estimation of the indices."""
    return {
        "name": "sampled",
        "sampling": sampling,
        "samples": rows(samples, sampling),
        "asked": samples,
        "resamples": RESAMPLES,
    }


def _indices(
    positions: Sequence[Parts],
    ideal: Array,
    rounding: Array,
    *,
    factors: tuple[str, ...],
    outputs: tuple[str, ...],
    units: tuple[str, ...],
    scales: Array,
    angles: Array,
    method: Mapping[str, object],
) -> Indices:
    """The result of positions (n) one after the other; ``ideal`` (n, o), ``rounding`` (o,) of the outputs."""
    variance = np.stack([parts.variance for parts in positions], axis=1)
    return Indices(
        factors=factors,
        outputs=outputs,
        units=units,
        scales=scales,
        angles=angles,
        variance=np.where(variance > np.square(rounding)[:, None], variance, 0.0),
        bias=np.stack([parts.mean for parts in positions], axis=1) - ideal.T,
        first_variance=np.stack([parts.first_variance for parts in positions], axis=1),
        interaction_variance=np.stack([parts.interaction_variance for parts in positions], axis=1),
        method=method,
        resampled=Resampled(
            *(
                np.stack([getattr(parts.resampled, part) for parts in positions], axis=2)
                for part in ("variance", "first_variance", "interaction_variance")
            )
        ),
    )
