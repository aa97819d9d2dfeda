"""The batch estimator: all of a recording in one least-squares problem, by Gauss-Newton and multiple shooting.

Unknowns are attitude and velocity at every node (and the deviations of walking biases from the first node's), a
reference attitude for each rest where it is held, and the coefficients. From each node's present state the solution is
carried to the next; what is left between the two is weighted by the noise gained on the way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.geometry.rotations import conjugate, exp, log, multiply, skew
from inercal.systems.strapdown.fit.arrow import NodeChain, backward, followed, forward
from inercal.systems.strapdown.fit.rests import Nodes
from inercal.systems.strapdown.fit.start import beginning, carried_through, first_coefficients
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import GRAVITY, LATITUDE, SIZE, free_places
from inercal.systems.strapdown.model.kernels import NodeState, Shot, UnitWorld, shoot
from inercal.systems.strapdown.model.samples import Samples, freed, gains
from inercal.systems.strapdown.settings import Noise, StrapdownSettings


class Followed(NamedTuple):
    """Content of a solution: covariance ``out`` (k, m, m) of that of each interval, and with the coefficients that of
    intervals ``coupled`` (k, m, p) and of nodes and references of their rests ``nodes`` (k + 1, m + 3, p)."""

    out: Array
    coupled: Array
    nodes: Array


@short_repr
@dataclass(frozen=True, eq=False)
class Fit:
    """A fit: coefficients ``c`` (51,), their places ``free`` (p,) that were estimated with ``covariance`` (p, p) and
    ``prior`` (p,) standard deviations, attitudes ``q_nb`` (k + 1, 4) and velocities (k + 1, 3) of the nodes.

    ``chi2`` with ``dof`` degrees of freedom is of the data, without the prior; of each interval its part ``squares``
    (k,) and its ``redundancy`` (k,), the expected value of that; ``passes`` until it ``converged``; ``chain`` is the
    last linear problem, ``sensitivities`` (k, 6, 51) its derivatives by all coefficients, ``said`` what it says.
    """

    c: Array
    free: NDArray[np.int64]
    covariance: Array
    prior: Array
    q_nb: Array
    velocity: Array
    nodes: Nodes
    chi2: float
    dof: float
    squares: Array
    redundancy: Array
    passes: int
    converged: bool
    chain: NodeChain
    sensitivities: Array
    said: Followed


def world_of(settings: StrapdownSettings, c: Array, ts: float) -> UnitWorld:
    """Earth rate and gravity at the site, as corrected by ``c`` (51,)."""
    latitude = settings.latitude + c[LATITUDE]
    earth = EARTH_RATE * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    return UnitWorld(earth, settings.site.gravity + float(c[GRAVITY]), ts)


def variances_of(noise: Noise) -> Array:
    """Variances (6,): [per s] of attitude, velocity, and the biases of gyros and accelerometers, of which one that does
    not walk beside one that does is given so little that it does not matter; of attitude and velocity over a turn."""
    white = np.array([noise.angle_random_walk, noise.velocity_random_walk])
    walks = np.array([noise.gyro_walk, noise.accelerometer_walk])
    turns = [noise.turn_attitude, noise.turn_velocity]
    return np.asarray(np.square(np.concatenate([white, np.maximum(walks, 1e-5 * white), turns])))


def add_turns(Q: Array, turns: NDArray[np.int64], variances: Array) -> None:
    """Add to the covariances ``Q`` (k, m, m) of intervals what turns add to the noise of the sensors."""
    for at, variance in ((0, variances[4]), (3, variances[5])):
        for i in range(at, at + 3):
            Q[turns, i, i] += variance


def empty_shot(count: int, m: int) -> Shot:
    """Room for a solution of so many intervals with ``m`` errors each."""
    return Shot(
        np.empty((count, 4)),
        np.empty((count, 3)),
        np.empty((count, m, m)),
        np.empty((count, 6, SIZE)),
        np.empty((count, m, m)),
    )


def fit(samples: Samples, nodes: Nodes, settings: StrapdownSettings, before: Fit | None = None) -> Fit | None:
    """Fit the model to a recording with nodes in its rests, from another fit on where there was one ``before``; None
    where the solution runs off to no numbers."""
    with np.errstate(all="ignore"):
        try:
            found = _fitted(samples, nodes, settings, before)
        except np.linalg.LinAlgError:
            return None
    return found if np.isfinite(found.chi2) and np.isfinite(found.covariance).all() else None


def _fitted(samples: Samples, nodes: Nodes, settings: StrapdownSettings, begun: Fit | None) -> Fit:
    """The fit; raises `numpy.linalg.LinAlgError` where a matrix is singular or no matrix of numbers."""
    noise, m = settings.noise, 12 if settings.noise.walks else 6
    variances = variances_of(noise)
    deviations = settings.deviations()
    free = free_places(settings.terms, settings.gravity_u > 0.0, settings.site.latitude_u > 0.0)
    prior, c = deviations[free], first_coefficients(samples, nodes)
    motion = freed(samples, c)
    begin = beginning(motion, nodes, settings)
    count = len(nodes.sample)
    v, bias, shot = np.zeros((count, 3)), np.zeros((count, 6)), empty_shot(count - 1, m)
    if begun is None:
        q = carried_through(motion, nodes, begin)
    else:
        c, q, v = begun.c.copy(), begun.q_nb, begun.velocity
        motion = freed(samples, c)
    reference = q[np.unique(nodes.rest, return_index=True)[1]][nodes.rest]
    n = 2 * m + 3 + len(free)
    H, g = np.empty((n, n)), np.empty(n)
    rows, right = np.empty((count, m + 3, n)), np.empty((count, m + 3))
    x, angles = np.empty((count, m)), np.empty((count, 3))
    held = settings.rests.attitude
    passes, converged, before = 0, False, None
    while True:
        world, by = world_of(settings, c, samples.ts), gains(c)
        shoot(motion, nodes.cuts, nodes.first, NodeState(q, v, bias), by, world, variances, shot)
        add_turns(shot.Q, nodes.turns, variances)
        apart = log(multiply(shot.q, conjugate(q[1:]))), shot.v - v[1:], bias[:-1] - bias[1:]
        e = np.ascontiguousarray(np.hstack(apart)[:, :m])
        # the force through an interval is known by the velocities at its ends: its noise would tell of the heading
        expected = 5.0 * np.sqrt(np.einsum("kii->k", shot.Q[:, 3:6, 3:6]))
        shot.F[:, 3:6, :3] += skew(apart[1] * (np.linalg.norm(apart[1], axis=1) < expected)[:, None])
        chain = NodeChain(
            shot.F,
            _wide(shot.G[:, :, free], m),
            e,
            np.asarray(np.linalg.inv(shot.Q), dtype=float),
            nodes.rest,
            v,
            settings.rests.velocity**-2,
            log(multiply(q, conjugate(reference))),
            0.0 if held is None else held**-2,
            start_information(begin.u, variances, m),
            np.concatenate([log(multiply(q[0], conjugate(begin.q_nb))), v[0], bias[0]])[:m],
            prior**-2,
            c[free].copy(),
        )
        forward(chain, H, g, rows, right)
        information = information_of(H, len(free))
        covariance = inverse(information, prior)
        step = covariance @ g[-len(free) :]
        backward(nodes.rest, rows, right, step, x, angles)
        passes += 1
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
        enough = LIMITS.step if passes < LIMITS.patience else LIMITS.late_step
        if size < enough or passes >= LIMITS.iterations or not np.isfinite(size):
            converged = size < (enough if passes < LIMITS.iterations else LIMITS.last_step)
            break
        ahead = _longer(step, before, information)
        before = step if ahead == 1.0 else None
        c[free] += ahead * step
        q, v, bias = multiply(exp(ahead * x[:, :3]), q), v + ahead * x[:, 3:6], bias + ahead * _biases(x)
        reference = multiply(exp(ahead * angles), reference) if held is not None else reference
        motion = freed(samples, c)
    c[free] += step
    chi2, squares = _chi2(chain, step, x, angles)
    rows_more = 3 * count - 3 + (0 if held is None else 3 * (count - len(np.unique(nodes.rest))))
    # what the data tell of a coefficient goes from the degrees of freedom, what the prior tells does not
    dof = float(rows_more - np.sum(1.0 - np.diag(covariance) / prior**2))
    q, v = multiply(exp(x[:, :3]), q), v + x[:, 3:6]
    said = followed_by(chain, rows, covariance)
    return Fit(
        c,
        free,
        covariance,
        prior,
        q,
        v,
        nodes,
        chi2,
        dof,
        squares,
        m - np.einsum("kab,kba->k", chain.W, said.out),
        passes,
        converged,
        chain,
        shot.G,
        said,
    )


def followed_by(chain: NodeChain, rows: Array, covariance: Array) -> Followed:
    """Content of the solution of a chain, with the ``rows`` of its elimination and the ``covariance`` (p, p) of the
    coefficients."""
    n, p, m, count = rows.shape[2], len(covariance), chain.F.shape[1], len(chain.rest)
    Z = np.zeros((n, n))
    Z[n - p :, n - p :] = covariance
    said = Followed(np.zeros((count - 1, m, m)), np.zeros((count - 1, m, p)), np.zeros((count, m + 3, p)))
    followed(chain, rows, Z, *said)
    return said


def _longer(step: Array, before: Array | None, information: Array) -> float:
    """Factor on a step (p,) that goes on as the one ``before``: where earth rate hardly tells the heading, steps shrink
    by an even ratio, and all that are to come are one geometric sum (Aitken)."""
    if before is None:
        return 1.0
    length = before @ information @ before
    ratio = float(step @ information @ before / length)
    return float(np.clip(1.0 / (1.0 - ratio), 0.5, 5.0)) if length < LIMITS.near**2 and ratio < 1.0 else 1.0


def _biases(x: Array) -> Array:
    """Deviations (k, 6) of biases among errors of states (k, m); 0 where none walk."""
    return np.asarray(x[:, 6:]) if x.shape[1] == 12 else np.zeros((len(x), 6))


def _wide(G: Array, m: int) -> Array:
    """Derivatives (k, 6, p) with rows of zeros for biases that walk."""
    return np.ascontiguousarray(np.pad(G, ((0, 0), (0, m - 6), (0, 0))))


def start_information(u: Array, variances: Array, m: int) -> Array:
    """Information (m,) of the state of the first node, its attitude known to ``u`` (3,) [rad], its velocity not at all;
    biases do not deviate there."""
    held = 1e6 / np.repeat(variances[2:4], 3)
    return np.concatenate([u**-2, np.zeros(3), held])[:m]


def interval_covariance(fit: Fit, samples: Samples, settings: StrapdownSettings, variances: Array) -> Array:
    """Covariance (k, m, m) of what sensor noise, walks and turns of ``variances`` (6,) gain over the intervals of a
    fit: it is linear in these."""
    m, count = fit.chain.F.shape[1], len(fit.nodes.sample)
    shot, state = empty_shot(count - 1, m), NodeState(fit.q_nb, fit.velocity, np.zeros((count, 6)))
    world = world_of(settings, fit.c, samples.ts)
    shoot(freed(samples, fit.c), fit.nodes.cuts, fit.nodes.first, state, gains(fit.c), world, variances, shot)
    add_turns(shot.Q, fit.nodes.turns, variances)
    return shot.Q


def information_of(H: Array, p: int) -> Array:
    """Information (p, p) of the coefficients, of which the upper triangle is at the end of ``H``."""
    upper = np.triu(H[-p:, -p:])
    return np.asarray(upper + np.triu(upper, 1).T)


def inverse(information: Array, prior: Array) -> Array:
    """Inverse (p, p) of an information matrix, by Cholesky in units of the prior."""
    scaled = information * np.outer(prior, prior)
    root = np.linalg.inv(np.linalg.cholesky(scaled))
    return np.asarray(root.T @ root * np.outer(prior, prior))


def left_over(chain: NodeChain, step: Array, x: Array) -> Array:
    """Residuals (k, m) of the intervals at a solution."""
    return np.asarray(chain.e + np.einsum("kij,kj->ki", chain.F, x[:-1]) + chain.G @ step - x[1:])


def _chi2(chain: NodeChain, step: Array, x: Array, angles: Array) -> tuple[float, Array]:
    """Sum of squares of the data at the solution, and its parts (k,) by interval."""
    left = left_over(chain, step, x)
    squares = np.einsum("ki,kij,kj->k", left, chain.W, left)
    velocity = chain.velocity * np.sum((chain.v + x[:, 3:6]) ** 2)
    attitude = chain.attitude * np.sum((chain.angles + x[:, :3] - angles) ** 2)
    begin = np.sum(chain.start * (chain.begin + x[0]) ** 2)
    return float(squares.sum() + velocity + attitude + begin), np.asarray(squares)
