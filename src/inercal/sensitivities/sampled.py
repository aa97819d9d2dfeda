"""Sobol indices from samples: the procedure of Zhao et al. 2023, and what the exact analysis does not cover.

Two matrices A and B of N rows of errors are drawn anew at each position, the outputs are centred, column after
column is exchanged, and first- and total-order indices are estimated (`inercal.sensitivities.estimators`).
`analyse_function` does the same for any function of errors: correlated ones, one variable at two places,
outputs that are not linear in the attitude.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from inercal.arrays import Array
from inercal.rigs.chain import Chain
from inercal.rigs.distribution import Distribution
from inercal.rigs.outputs import Output
from inercal.sensitivities.estimators import Parts, Sampling, draw, estimate, evaluate, rows
from inercal.sensitivities.indices import Indices, Resampled

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
) -> Indices:
    """Estimated indices of outputs of a rig, with rows drawn anew at each position.

    Parameters
    ----------
    chain : Chain
    outputs : sequence of Output
    angles : (n, joints) positions [rad]
    samples : int
        Rows of A and of B. With ``sampling = "sobol"`` rounded up to a power of two; `Indices.method` holds
        both numbers.
    rng : Generator
    sampling : "random" or "sobol"
        Plain random rows (the paper), or scrambled Sobol points.
    progress : callable, optional
        Told the positions done and all of them.

    Raises
    ------
    ValueError
        Fewer than two samples.
    """
    positions = np.atleast_2d(np.asarray(angles, dtype=float))
    distributions = [error.distribution for error in chain.errors]
    sizes = np.array([np.linalg.norm(each.reference) * np.linalg.norm(each.axis) for each in outputs])
    parts, ideal = [], []
    for done, at in enumerate(positions, start=1):

        def function(errors: Array, at: Array = at) -> Array:
            C_nb = chain.attitude(at, errors)
            return np.stack([each.value(C_nb) for each in outputs], axis=-1)

        parts.append(_parts(function, distributions, samples, rng, sampling))
        ideal.append(function(np.zeros((1, len(distributions))))[0])
        if progress is not None:
            progress(done, len(positions))
    return _indices(
        parts,
        np.array(ideal),
        _ROUNDING * sizes,
        factors=chain.factors,
        outputs=tuple(each.name for each in outputs),
        units=tuple(each.unit for each in outputs),
        scales=np.array([each.scale for each in outputs]),
        angles=positions,
        method=_method(samples, sampling),
    )


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
