"""The error-state filter: the coefficients of a strapdown unit rest by rest, and the same numbers as the batch.

States are the errors x (m,) of the solution, those a (3,) of the reference attitude of the present rest, those (3,) of
the attitude at the start, and those of the coefficients c (p,). The first pass is closed: errors are taken out of the
solution at each node. Passes after it are open: along one solution the filter is linear, and begins with the prior as
it is seen from there. The first open solution is of the coefficients and the start of the closed pass; each one after
it is the one before with its errors at the nodes taken out, as the coefficients at its end have them. That is
Gauss-Newton; a filter that goes on correcting its solution would be linearised at its own early headings. Where biases
walk so far that an open solution tips over, it fails, and only the batch is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.geometry.rotations import conjugate, exp, log, multiply, normalize, skew
from inercal.systems.strapdown.fit.batch import add_turns, empty_shot, variances_of, world_of
from inercal.systems.strapdown.fit.rests import Nodes
from inercal.systems.strapdown.fit.start import beginning, first_coefficients
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import free_places
from inercal.systems.strapdown.model.kernels import NodeState, shoot
from inercal.systems.strapdown.model.samples import Samples, freed, gains
from inercal.systems.strapdown.settings import StrapdownSettings


@short_repr
@dataclass(frozen=True, eq=False)
class Filtered:
    """Coefficients ``c`` (51,) and attitude at the start ``q_nb`` (4,) by the filter, with the ``covariance`` (p, p)
    of coefficients that are free, its ``passes`` until it ``converged``; after each rest that covariance ``history``
    (rests, p, p) and the mean ``nis`` (rests,) of the squares of innovations over their variance, of the last pass."""

    c: Array
    q_nb: Array
    covariance: Array
    passes: int
    converged: bool
    history: Array
    nis: Array


@kernel
def predicted(s: Array, P: Array, F: Array, G: Array, Q: Array, top: Array) -> None:
    """Carry mean ``s`` (n,) and covariance ``P`` (n, n) through an interval; ``top`` (m, n) is used up."""
    n, m, p = len(s), len(F), G.shape[1]
    at = n - p
    for i in range(m):
        for j in range(n):
            total = 0.0
            for k in range(m):
                total += F[i, k] * P[k, j]
            if i < 6:
                for k in range(p):
                    total += G[i, k] * P[at + k, j]
            top[i, j] = total
    for i in range(m):
        for j in range(m, n):
            P[i, j] = P[j, i] = top[i, j]
        for j in range(m):
            total = Q[i, j]
            for k in range(m):
                total += top[i, k] * F[j, k]
            if j < 6:
                for k in range(p):
                    total += top[i, at + k] * G[j, k]
            P[i, j] = total
    for i in range(m):
        total = 0.0
        for k in range(m):
            total += F[i, k] * s[k]
        if i < 6:
            for k in range(p):
                total += G[i, k] * s[at + k]
        top[i, 0] = total
    for i in range(m):
        s[i] = top[i, 0]


@kernel
def measured(s: Array, P: Array, i: int, j: int, z: float, variance: float, column: Array) -> float:
    """Take in the measurement ``z`` of s_i - s_j, or of s_i where j is below 0; the square of its innovation over the
    variance of that. ``column`` (n,) is used up."""
    n = len(s)
    for k in range(n):
        column[k] = P[k, i] - (P[k, j] if j >= 0 else 0.0)
    spread = column[i] - (column[j] if j >= 0 else 0.0) + variance
    off = z - s[i] + (s[j] if j >= 0 else 0.0)
    for k in range(n):
        gain = column[k] / spread
        s[k] += gain * off
        for other in range(n):
            P[k, other] -= gain * column[other]
    return float(off * off / spread)


class NodePath(NamedTuple):
    """A solution at the nodes: attitude ``q`` (k, 4) C_nb and velocity ``v`` (k, 3)."""

    q: Array
    v: Array


class Node(NamedTuple):
    """A node of an open pass: attitude ``q`` (4,), velocity ``v`` (3,), their ``error`` (6,) but for what the errors of
    start and coefficients do, and its ``gain`` (6, 3 + p) by these."""

    q: Array
    v: Array
    error: Array
    gain: Array


class _Run:
    """One run over a recording with the coefficients ``c`` (51,), and the places ``free`` of those that are errors."""

    def __init__(
        self, samples: Samples, nodes: Nodes, settings: StrapdownSettings, c: Array, free: NDArray[np.int64]
    ) -> None:
        self.nodes, self.settings, self.free = nodes, settings, free
        self.m = 12 if settings.noise.walks else 6
        self.variances = variances_of(settings.noise)
        self.motion, self.by, self.world = freed(samples, c), gains(c), world_of(settings, c, samples.ts)
        self.shot = empty_shot(1, self.m)
        self.s, self.nis, self.open = np.zeros(0), 0.0, False
        self.P = np.zeros((0, 0))
        self.kept = list[Node]()

    def begun(self, off: Array, u: Array, deviation: Array, prior: Array) -> None:
        """Begin ``off`` (3,) the prior of the attitude, of ``u`` (3,), and ``deviation`` (p,) that of coefficients."""
        m, n = self.m, self.m + 6 + len(prior)
        self.s, self.P = np.zeros(n), np.zeros((n, n))
        self.s[:3] = self.s[m + 3 : m + 6] = off
        self.s[m + 6 :] = deviation
        start = np.diag(u**2)
        self.P[:3, :3] = self.P[m + 3 : m + 6, m + 3 : m + 6] = start
        self.P[:3, m + 3 : m + 6] = self.P[m + 3 : m + 6, :3] = start
        self.P[range(3, 6), range(3, 6)] = LIMITS.start_speed**2
        self.P[range(m + 6, n), range(m + 6, n)] = prior**2

    def on(self, k: int, q: Array, v: Array, bias: Array) -> tuple[Array, Array]:
        """Carry solution and errors from node k to the next."""
        first = self.nodes.first[k : k + 2]
        state, shot = NodeState(q[None], v[None], bias[None]), self.shot
        shoot(self.motion, self.nodes.cuts, first, state, self.by, self.world, self.variances, shot)
        if self.nodes.rest[k + 1] != self.nodes.rest[k]:
            add_turns(shot.Q, np.zeros(1, dtype=np.int64), self.variances)
        # the force through an interval is known by the velocities at its ends: its noise would tell of the heading
        apart = shot.v[0] - v
        if self.open or np.linalg.norm(apart) < 5.0 * np.sqrt(np.trace(shot.Q[0, 3:6, 3:6])):
            shot.F[0, 3:6, :3] += skew(apart)
        G = np.ascontiguousarray(shot.G[0][:, self.free])
        predicted(self.s, self.P, shot.F[0], G, shot.Q[0], np.empty((self.m, len(self.s))))
        return shot.q[0].copy(), shot.v[0].copy()

    def at_rest(self, v: Array, angles: Array, begins: bool) -> None:
        """Take in velocity (3,) and attitude ``angles`` (3,) against the reference of a rest, which may begin here."""
        rests, column, m = self.settings.rests, np.empty(len(self.s)), self.m
        for i in range(3):
            self.nis += measured(self.s, self.P, 3 + i, -1, -float(v[i]), rests.velocity**2, column)
        if rests.attitude is None:
            return
        if begins:  # the reference is this attitude, but for its sway
            self.s[m : m + 3] = self.s[:3] + angles
            self.P[m : m + 3] = self.P[:3]
            self.P[:, m : m + 3] = self.P[:, :3]
            self.P[range(m, m + 3), range(m, m + 3)] += rests.attitude**2
            return
        for i in range(3):
            self.nis += measured(self.s, self.P, i, m + i, -float(angles[i]), rests.attitude**2, column)

    def through(self, q: Array, feed: bool, path: NodePath | None = None) -> tuple[Array, Array]:
        """Run from the attitude ``q`` (4,) of the first node to the last; ``feed`` takes errors out of the solution at
        each node, which otherwise goes on by itself or along a ``path``. Covariance (rests, p, p) of the coefficients
        and mean NIS (rests,) after each rest."""
        v, bias, reference, m, self.open = np.zeros(3), np.zeros(6), q, self.m, not feed
        rest, history, nis, begun = self.nodes.rest, list[Array](), list[float](), 0
        for k in range(len(rest)):
            begins = k == 0 or rest[k] != rest[k - 1]
            if k:
                q, v = self.on(k - 1, q, v, bias)
                if path is not None:
                    self.s[:6] += np.concatenate([log(multiply(q, conjugate(path.q[k]))), v - path.v[k]])
                    q, v = path.q[k], path.v[k]
            if begins:
                reference, begun = q, k
            self.at_rest(v, log(multiply(q, conjugate(reference))), begins)
            if feed:
                q, v = normalize(multiply(exp(self.s[:3]), q)), v + self.s[3:6]
                bias = bias + np.pad(self.s[6:m], (0, 12 - m))
                self.s[:m] = 0.0
            else:
                self._keep(q, v)
            if k == len(rest) - 1 or rest[k + 1] != rest[k]:
                history.append(self.P[m + 6 :, m + 6 :].copy())
                rows = (3 if self.settings.rests.attitude is None else 6) * (k - begun) + 3
                nis.append(self.nis / rows)
                self.nis = 0.0
        return np.array(history), np.array(nis)

    def _keep(self, q: Array, v: Array) -> None:
        """Keep the solution at a node, its errors without those of the start and of the coefficients, and their
        derivatives by these."""
        constant = slice(self.m + 3, None)
        size = np.sqrt(np.diag(self.P)[constant])
        scaled = self.P[constant, constant] / np.outer(size, size)
        gain = np.linalg.solve(scaled, self.P[constant, :6] / size[:, None]).T / size
        self.kept.append(Node(q, v, self.s[:6] - gain @ self.s[constant], gain))

    def path(self) -> NodePath:
        """The solution at the nodes with its errors taken out, as the start and the coefficients at the end have them:
        along it the next pass is linear."""
        constant = self.s[self.m + 3 :]
        errors = np.array([each.error + each.gain @ constant for each in self.kept])
        q, v = np.array([each.q for each in self.kept]), np.array([each.v for each in self.kept])
        return NodePath(normalize(multiply(exp(errors[:, :3]), q)), v + errors[:, 3:])


def filtered(
    samples: Samples, nodes: Nodes, settings: StrapdownSettings, before: Filtered | None = None
) -> Filtered | None:
    """The filter over a recording with nodes in its rests, by open passes alone from a result ``before`` of a part of
    it; None where its solution runs off."""
    with np.errstate(all="ignore"):
        found = _passes(samples, nodes, settings, before)
    return found if np.isfinite(found.c).all() and np.isfinite(found.history).all() else None


def _passes(samples: Samples, nodes: Nodes, settings: StrapdownSettings, before: Filtered | None) -> Filtered:
    """Passes until the coefficients stay."""
    free = free_places(settings.terms, settings.gravity_u > 0.0, settings.site.latitude_u > 0.0)
    prior, c = settings.deviations()[free], first_coefficients(samples, nodes)
    at = beginning(freed(samples, c), nodes, settings)

    def ran(q: Array, feed: bool, path: NodePath | None = None) -> tuple[_Run, Array, Array]:
        run = _Run(samples, nodes, settings, c, free)
        off, u = log(multiply(at.q_nb, conjugate(q))), at.u
        if feed:  # a closed pass is of a start that is nearly known
            off, u = np.zeros(3), np.minimum(u, LIMITS.unknown_heading)
        run.begun(off, u, -c[free], prior)
        return run, *run.through(q, feed, path)

    if before is None:
        tried = 1 if at.u[2] <= LIMITS.unknown_heading else LIMITS.headings
        runs = []
        for k in range(tried):
            q = normalize(multiply(exp(np.array([0.0, 0.0, 2.0 * np.pi * k / tried])), at.q_nb))
            runs.append((*ran(q, True), q))
        run, history, nis, q = min(runs, key=lambda each: float(np.mean(each[2])))
    else:
        c, q = before.c.copy(), before.q_nb
        run, history, nis = ran(q, False)
    passes = 1
    while True:
        step, start = run.s[-len(free) :], run.s[run.m + 3 : run.m + 6]
        c[free] += step
        q = normalize(multiply(exp(start), q))
        covariance = run.P[-len(free) :, -len(free) :]
        size = float(np.max(np.abs(step) / np.sqrt(np.diag(covariance))))
        done = size < LIMITS.step and (passes > 1 or before is not None)
        if done or passes >= LIMITS.filter_passes or not np.isfinite(size):
            return Filtered(c, q, covariance, passes, size < LIMITS.step, history, nis)
        path = run.path() if run.kept else None
        run, history, nis = ran(q if path is None else path.q[0], False, path)
        passes += 1
