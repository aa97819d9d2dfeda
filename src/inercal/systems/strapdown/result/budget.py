"""The covariance of a fit by its sources: noise of the sensors, the stand, priors, the site.

Each coefficient is a sum of all rows of the last linear problem, each row times its gain: the covariance of the
coefficients with what the solution says of the row, times the row's information. What a source adds to the covariance
is that of its part of the rows; all parts together are the whole. Noise that was found from the recording adds what its
size leaves open.
"""

from __future__ import annotations

import math

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.results.budget import TypeA, TypeB
from inercal.systems.strapdown.fit.batch import Fit, interval_covariance, variances_of
from inercal.systems.strapdown.fit.restricted import opened
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import GRAVITY, LATITUDE
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import StrapdownSettings


def sources(fit: Fit, samples: Samples, settings: StrapdownSettings, slope: Array) -> list[TypeA | TypeB]:
    """Sources of the covariance of results with the ``slope`` (q, p) by the coefficients of the fit."""
    noise, rests, dof = settings.noise, settings.rests, float(fit.dof)
    variances = variances_of(noise)
    gain = np.einsum("qp,kap,kab->kqb", slope, fit.said.coupled, fit.chain.W, optimize=True)
    levels = (
        ("angle random walk", noise.angle_random_walk, "rad/sqrt(s)"),
        ("velocity random walk", noise.velocity_random_walk, "m/s/sqrt(s)"),
        ("walk of gyro biases", noise.gyro_walk, "rad/s/sqrt(s)"),
        ("walk of accelerometer biases", noise.accelerometer_walk, "m/s^2/sqrt(s)"),
        ("attitude over turns", noise.turn_attitude, "rad"),
        ("velocity over turns", noise.turn_velocity, "m/s"),
    )
    parts: list[TypeA | TypeB] = []
    for k, (name, u, unit) in enumerate(levels):
        if u > 0.0:
            of_one = interval_covariance(fit, samples, settings, np.eye(6)[k] * variances[k])
            parts.append(TypeA(name, u, unit, np.einsum("kqa,kab,krb->qr", gain, of_one, gain), dof))
    if noise.estimate:
        more = slope @ opened(fit, samples, settings) @ slope.T
        parts.append(
            TypeA("noise found from the recording, as far as that leaves it open", 1.0, "1", more, dof)
        )
    chain, m = fit.chain, fit.chain.F.shape[1]
    nodes = np.einsum("qp,kap->qka", slope, fit.said.nodes)
    rows = nodes[:, :, 3:6]
    of_one = chain.velocity * np.einsum("qka,rka->qr", rows, rows)
    parts.append(TypeA("velocity at rest", rests.velocity, "m/s", of_one, dof))
    if rests.attitude is not None:
        rows = nodes[:, :, :3] - nodes[:, :, m:]
        of_one = chain.attitude * np.einsum("qka,rka->qr", rows, rows)
        parts.append(TypeA("attitude at rest", rests.attitude, "rad", of_one, dof))
    of_prior = slope @ fit.covariance / fit.prior
    nuisance = np.isin(fit.free, (GRAVITY, LATITUDE))
    parts.append(TypeB("prior", 1.0, "1", of_prior[:, ~nuisance]))
    for place, name, unit in ((GRAVITY, "gravity", "m/s^2"), (LATITUDE, "latitude", "rad")):
        for k in np.flatnonzero(fit.free == place).tolist():
            u = float(fit.prior[k])
            parts.append(TypeB(name, u, unit, of_prior[:, k] / u))
    if 1.0 < (times := excess(fit)) <= INFERENCE.gross:
        more = (times**2 - 1.0) * (slope @ fit.covariance @ slope.T)
        parts.append(TypeA("residuals beyond the stated noise", times, "1", more, dof))
    begun = np.einsum("qa,a,ra->qr", nodes[:, 0, :m], chain.start, nodes[:, 0, :m])
    return [*parts, TypeA("attitude at the start", float(chain.start[2] ** -0.5), "rad", begun, dof)]


def excess(fit: Fit) -> float:
    """Residuals over the stated noise (rms), where they are larger by more than chance; else 1."""
    from scipy.special import chdtri

    return math.sqrt(fit.chi2 / fit.dof) if fit.chi2 > float(chdtri(fit.dof, LIMITS.risk)) else 1.0
