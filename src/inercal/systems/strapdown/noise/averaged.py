"""Coefficients averaged over the sizes that noise may have which was found from a recording.

A walk of biases that hardly shows may be found as next to nothing, and u that believes it is too small. Given the size
of a noise, the last linear problem of a fit has the likelihood of that size
(`inercal.systems.strapdown.noise.restricted`), with the coefficients c and their covariance P. Beforehand all sizes
(standard deviations) are alike. The second moment about the values of the fit,

    E[P + (c - c_fit) (c - c_fit)^T]

is what is known of them; what it has beyond the covariance of the fit counts in u. Noises are taken one by one, the
others as they were found.
"""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.variances import second_moment, weighed
from inercal.systems.strapdown.fit.batch import Fit
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.noise.restricted import Solved, separated, solved
from inercal.systems.strapdown.settings import StrapdownSettings


def opened(fit: Fit, samples: Samples, settings: StrapdownSettings) -> Array:
    """Addition to the covariance (p, p) of the coefficients by noise that was found, that which ``estimate`` names."""
    fixed, parts, s = separated(fit, samples, settings, settings.noise.estimate)
    covariance, more = fit.covariance, np.zeros_like(fit.covariance)
    for k in range(len(s)):
        others = fixed + np.einsum("q,qkab->kab", np.delete(s, k), np.delete(parts, k, axis=0))
        more += _second_moment(fit, others, parts[k], math.sqrt(s[k])) - covariance
    # only what makes u larger, in units of the covariance
    root = np.linalg.cholesky(covariance)
    by = np.linalg.inv(root)
    ratio, axes = np.linalg.eigh(by @ more @ by.T)
    wider = root @ axes * np.sqrt(np.maximum(ratio, 0.0))
    return np.asarray(wider @ wider.T)


def _second_moment(fit: Fit, others: Array, part: Array, found: float) -> Array:
    """Second moment (p, p) about the values of the fit, over the sizes of one noise: its ``part`` (k, m, m) of the
    covariance of intervals for a variance of 1, beside that of ``others`` (k, m, m); ``found`` is the likeliest."""
    here, count = _at(fit, others, part, found), LIMITS.noise_sizes

    def unlikely(size: float) -> bool:
        return _at(fit, others, part, size).deviance - here.deviance > LIMITS.unlikely

    reach = next((size for size in found * 2.0 ** np.arange(1, 30) if unlikely(size)), found * 2.0**30)
    while reach > 2.0 * found and unlikely(0.75 * reach):
        reach *= 0.75
    sizes = reach * (np.arange(count) + 0.5) / count
    tried = [_at(fit, others, part, size) for size in sizes.tolist()]
    return second_moment(
        weighed(np.array([-0.5 * each.deviance for each in tried])),
        np.array([each.covariance for each in tried]),
        np.array([each.step - here.step for each in tried]),
    )


def _at(fit: Fit, others: Array, part: Array, size: float) -> Solved:
    """The last linear problem of a fit with a noise of another size."""
    W = np.asarray(np.linalg.inv(others + size**2 * part))
    return solved(fit.chain._replace(W=W), fit.prior)
