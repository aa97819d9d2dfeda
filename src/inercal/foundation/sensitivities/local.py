"""Local sensitivity: variances to first order in the errors, from the derivatives at the ideal rig."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.outputs import Output
from inercal.foundation.sensitivities.indices import Indices

# Derivatives below it, against the size of the reference, are rounding.
_ROUNDING = 8.0 * np.finfo(float).eps


def analyse(chain: Chain, outputs: Sequence[Output], angles: ArrayLike) -> Indices:
    """Parts of variance (dY/derror_k)^2 var_k at ``angles`` (n, joints) [rad], without interactions; bias of mean
    errors alone.

    Good where the errors act linearly. Where the derivatives vanish (an axis along gravity), the quadratic
    terms rule and these indices mislead or, if all derivatives are zero, do not exist.
    """
    positions = np.atleast_2d(np.asarray(angles, dtype=float))
    by_error = chain.slopes(positions)  # (n, k, 3, 3)
    C_nb = chain.attitude(positions)[:, None]
    slopes = np.stack([each.slope(C_nb, by_error) for each in outputs])
    sizes = np.array([np.linalg.norm(each.reference) * np.linalg.norm(each.axis) for each in outputs])
    slopes[np.abs(slopes) < _ROUNDING * sizes[:, None, None]] = 0.0
    first = np.square(slopes * chain.std)
    means = np.array([error.distribution.mean for error in chain.errors])
    return Indices(
        factors=chain.factors,
        outputs=tuple(each.name for each in outputs),
        units=tuple(each.unit for each in outputs),
        scales=np.array([each.scale for each in outputs]),
        angles=positions,
        variance=first.sum(axis=-1),
        bias=slopes @ means,
        first_variance=first,
        interaction_variance=np.zeros_like(first),
        method={"name": "local"},
    )
