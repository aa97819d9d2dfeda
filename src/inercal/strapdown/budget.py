"""The covariance of a fit by its sources: noise of the sensors, the stand, priors, the site.

The covariance is homogeneous of first degree in all variances that go into it, so that by Euler's theorem it is the sum
of its derivatives by the logarithms of these: each derivative is what a source adds.
"""

from __future__ import annotations

import numpy as np

from inercal.arrays import Array
from inercal.estimate.budget import TypeA, TypeB
from inercal.strapdown.arrow import Chain
from inercal.strapdown.batch import Fit, covariance_of, interval_noise
from inercal.strapdown.coefficients import GRAVITY, LATITUDE
from inercal.strapdown.samples import Samples
from inercal.strapdown.settings import StrapdownSettings

_BY = 1e-3
"""Relative change of a variance for its derivative."""


def sources(fit: Fit, samples: Samples, settings: StrapdownSettings, slope: Array) -> list[TypeA | TypeB]:
    """Sources of the covariance of results with the ``slope`` (q, p) by the coefficients of the fit."""
    noise, rests, dof = settings.noise, settings.rests, float(fit.dof)
    levels = (
        ("angle random walk", noise.angle_random_walk, "rad/sqrt(s)"),
        ("velocity random walk", noise.velocity_random_walk, "m/s/sqrt(s)"),
        ("walk of gyro biases", noise.gyro_walk, "rad/s/sqrt(s)"),
        ("walk of accelerometer biases", noise.accelerometer_walk, "m/s^2/sqrt(s)"),
    )
    parts: list[TypeA | TypeB] = []
    for k, (name, u, unit) in enumerate(levels):
        if u > 0.0:
            more = np.ones(4)
            more[k] += _BY
            changed = fit.chain._replace(W=interval_noise(fit, samples, settings, more))
            parts.append(TypeA(name, u, unit, _part(fit, changed, slope), dof))
    chain, by = fit.chain, 1.0 + _BY
    changed = chain._replace(velocity=chain.velocity / by)
    parts.append(TypeA("velocity at rest", rests.velocity, "m/s", _part(fit, changed, slope), dof))
    if rests.attitude is not None:
        changed = chain._replace(attitude=chain.attitude / by)
        parts.append(TypeA("attitude at rest", rests.attitude, "rad", _part(fit, changed, slope), dof))
    of_prior = slope @ fit.covariance / fit.prior
    nuisance = np.isin(fit.free, (GRAVITY, LATITUDE))
    parts.append(TypeB("prior", 1.0, "1", of_prior[:, ~nuisance]))
    for place, name, unit in ((GRAVITY, "gravity", "m/s^2"), (LATITUDE, "latitude", "rad")):
        for k in np.flatnonzero(fit.free == place).tolist():
            u = float(fit.prior[k])
            parts.append(TypeB(name, u, unit, of_prior[:, k] / u))
    begun = _part(fit, chain._replace(start=chain.start / by), slope)
    return [*parts, TypeA("attitude at the start", float(chain.start[2] ** -0.5), "rad", begun, dof)]


def _part(fit: Fit, changed: Chain, slope: Array) -> Array:
    """Part of a source in the covariance, of the chain with its variance a little larger; never negative."""
    part = slope @ (covariance_of(changed, fit.prior) - fit.covariance) @ slope.T / _BY
    values, vectors = np.linalg.eigh(0.5 * (part + part.T))
    return np.asarray(vectors * np.maximum(values, 0.0) @ vectors.T)
