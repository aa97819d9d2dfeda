"""One pass of the filter of what moves, at fixed constants: white innovations, and their columns by all constants and
errors (`inercal.foundation.inference.scores`).

What moves are the attitude's error x (3,) and biases that walk. Constants have errors dc, errors of the model sizes b:
the pass carries the sensitivity S of x by both, ``S+ = F S + G``, ``s = h S + d``, ``S <- S - K s``. Whitened
innovations and columns are summed over the rows through which the platform turns by `LIMITS.summed_turn`, or
`LIMITS.summed_time` where it rests, over the root of their number: as white, and as good where no course changes within
them.

Where nobody knows how the platform turns, before the first row, behind the last, and behind a gap, a delay is noise of
the angle that it may have turned by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import boxminus
from inercal.foundation.inference.scores import PassSums
from inercal.systems.selfcal.filters.gaps import anew, doubtful
from inercal.systems.selfcal.filters.problem import FilterModel, FilterProblem, encoders_at
from inercal.systems.selfcal.filters.whitening import PassRows, PassSlots, whiten
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.linearised import WALK_TIME
from inercal.systems.selfcal.platform.recording import Recording, Steps
from inercal.systems.selfcal.platform.states import ALL, LEVER, TAU, WALK

BLOCKS = 40
"""Blocks of time."""

_ROWS = 256
"""Rows of a chunk: what they make stays in the cache."""

CHANNELS = 9
"""Channels of courses: gyros, accelerometers, encoders, x, y, z each."""


@dataclass(frozen=True, eq=False)
class PassErrors:
    """PassErrors outside a model: ``names`` of states of the rig that are not fitted; with ``world`` the earth rate
    [rad/s] and specific force at rest [m/s^2] in b, x, y, z each, come next; then ``counts`` (9,) courses of each
    channel, ``courses`` of some rows (m, k)."""

    names: tuple[str, ...] = ()
    world: bool = False
    counts: tuple[int, ...] = (0,) * CHANNELS
    courses: Callable[[slice], Array] = lambda rows: np.zeros((rows.stop - rows.start, 0))

    @property
    def columns(self) -> int:
        """Number of all columns."""
        return len(self.names) + 6 * self.world + sum(self.counts)


class WhitenedPass(NamedTuple):
    """A pass: its ``sums``, and the whitened innovations ``z`` (n - 1, 6), accelerometers first, NaN where nothing was
    read. Biases that walk are no constants of the sums; ``covariance`` (p, p) is that of all states, of these at the
    end."""

    sums: PassSums
    z: Array
    covariance: Array


def whitened(
    recording: Recording,
    problem: FilterProblem,
    c: Array,
    u: Array,
    errors: PassErrors = PassErrors(),
    restarts: Sequence[int] = (),
) -> WhitenedPass:
    """One pass at states ``c`` (p,), linear form, so far known to ``u`` (p,).

    At ``restarts``, rows, the attitude is taken anew from the encoders, as in the filter's result.
    """
    states, wide = problem.states, replace(problem.states, names=(*problem.states.names, *errors.names))
    walking = states.walks
    n, p = 3 + int(walking.sum()), int((~walking).sum())
    into = np.arange(3 + len(wide.names))
    into[3:][: len(walking)][walking] = np.arange(3, n)
    constant = np.append(~walking, np.ones(len(errors.names), dtype=bool))
    into[3:][constant] = n + np.arange(int(constant.sum()))
    first = int(constant.sum())
    low = first + 6 * errors.world + np.append(0, np.cumsum(errors.counts)).astype(np.int64)
    slots = PassSlots(into, low, first if errors.world else -1)
    full, m = states.full(c), int(low[-1])
    full[WALK:] = 0.0
    model = problem.model._replace(layout=wide.layout)
    every = replace(problem, prior=np.ones(len(wide.names)), vector=wide)
    begin = _EncoderStart(recording, every, full, _known(problem, u), into[3:] - n)
    steps, sigma, variance = _readings(recording, problem, full, u)
    noise = problem.model.noise
    gained = noise.angle_random_walk**2 * recording.walking
    group, chunks = _groups(recording, restarts)
    z = np.full((len(steps.dt), 6), np.nan)
    fitted, across = np.zeros((BLOCKS, 1 + p, 1 + p)), np.zeros((BLOCKS, 1 + p, m - p))
    products, squares, near = np.zeros((m - p, m - p)), 0.0, np.zeros(3, dtype=np.int64)
    q, P, S = begin.at(0, n, m)
    prior = states.index[walking] - WALK
    P[3:, 3:] = np.diag(np.where(prior < 3, noise.gyro_walk, noise.accelerometer_walk) ** 2)
    ends = np.linspace(0, len(z), BLOCKS + 1)[1:]
    for one in chunks:
        if one.stop in restarts and one.stop - one.start == 1:  # the step to a restart counts for nothing
            _wait(P, S, full, float(steps.dt[one][0]), model, into, n)
            q, P[:3, :3], S[:3] = begin.anew(one.stop, m)
            P[:3, 3:], P[3:, :3] = 0.0, 0.0
            continue
        own = group[one] - group[one.start]
        J = np.zeros((int(own[-1]) + 1, 6, m))
        rows = PassRows(
            steps.part(one), gained[one], sigma[one], variance[one],
            errors.courses(slice(one.start + 1, one.stop + 1)), own,
        )  # fmt: skip
        whiten(q, P, S, near, rows, slots, full, model, z[one], J)
        there = np.isfinite(z[one])
        starts = np.flatnonzero(np.diff(own, prepend=-1))
        count = np.sqrt(np.maximum(np.add.reduceat(there.astype(float), starts, axis=0), 1.0))
        seen = np.where(there, z[one], 0.0)
        Y = np.column_stack(
            [(np.add.reduceat(seen, starts, axis=0) / count).ravel(), J.reshape(-1, m) / count.reshape(-1, 1)]
        )
        b = int(np.searchsorted(ends, one.start, side="right"))
        A, X = Y[:, : 1 + p], Y[:, 1 + p :]
        fitted[b] += A.T @ A
        across[b] += A.T @ X
        products += X.T @ X
        squares += float(np.sum(np.square(seen)))
    sums = PassSums(
        problem.prior[~walking], (problem.mean - c)[~walking], fitted, across, products, squares,
        int(np.isfinite(z).sum()),
    )  # fmt: skip
    return WhitenedPass(sums, z, _covariance(sums, P, S, p, walking))


def load_kernels(problem: FilterProblem) -> None:
    """Load, or compile, the kernel of `whitened`."""
    still = np.zeros((2, 3))
    recording = Recording(np.array([0.0, 1.0]), still[1:], still, np.full((2, 3), np.nan))
    whitened(recording, problem, problem.mean, problem.prior)


def _covariance(sums: PassSums, P: Array, S: Array, p: int, walking: NDArray[np.bool_]) -> Array:
    """Covariance (p, p) of all states, those that walk at the end."""
    by = np.zeros((len(walking), p))
    by[~walking], by[walking] = np.eye(p), S[3:, :p]
    whole = by @ sums.covariance @ by.T
    whole[np.ix_(walking, walking)] += P[3:, 3:]
    return whole


def _wait(
    P: Array, S: Array, full: Array, dt: float, model: FilterModel, into: NDArray[np.int64], n: int
) -> None:
    """Let biases that walk do so through a step that counts for nothing, in place."""
    keep = math.exp(-dt / WALK_TIME)
    full[WALK:] *= keep
    S[3:] *= keep
    P[3:, 3:] *= keep * keep
    for j in range(6 if n > 3 else 0):
        at = model.layout.place[WALK + j]
        if at >= 0:
            sigma = model.noise.gyro_walk if j < 3 else model.noise.accelerometer_walk
            P[into[at], into[at]] += sigma**2 * (1.0 - keep**2)


def _known(problem: FilterProblem, u: Array) -> Array:
    """Standard uncertainties (2,) [s] of the delays that are states, 0 of the others."""
    of = dict(zip(problem.names, u.tolist(), strict=True))
    return np.array([of.get(name, 0.0) for name in ALL[TAU : TAU + 2]])


def _readings(
    recording: Recording, problem: FilterProblem, full: Array, u: Array
) -> tuple[Steps, Array, Array]:
    """Steps, without accelerometers that wait for the encoders behind a gap; the noise (m,) of encoders [rad] and the
    variance (m,) [m^2/s^4] of accelerometers, with what delays and levers are at rows where the rate changes."""
    steps, noise, known = recording.steps, problem.noise, _known(problem, u)
    waiting = np.array(doubtful(recording.held, steps.th), dtype=np.int64)
    acc = steps.acc.copy()
    acc[waiting[~np.isfinite(steps.th[waiting]).all(axis=1)]] = np.nan
    unknown = np.isnan(steps.later[:, 0])
    change = np.linalg.norm(np.where(unknown[:, None], 0.0, steps.later) - steps.rate, axis=1)
    turned = []
    for k, late in enumerate(full[TAU : TAU + 2]):
        undecided = 0.0 if abs(late) > 3.0 * known[k] else known[k]
        behind = 0.0 if late > 3.0 * known[k] else math.hypot(late, known[k])
        turned.append(np.where(unknown, behind, undecided) * change)
    up, levers = problem.world.up, full[LEVER : LEVER + 9] @ full[LEVER : LEVER + 9]
    if problem.states.has("levers"):
        levers += float(np.sum(np.square(u[[problem.names.index(name) for name in ALL[LEVER : LEVER + 9]]])))
    variance = noise.accelerometer**2 + turned[1] ** 2 * (up @ up) + levers * (change / steps.dt) ** 2
    return steps._replace(acc=acc), np.hypot(noise.encoder, turned[0]), variance


class _EncoderStart(NamedTuple):
    """The start of the attitude by the encoders, in a problem of all states and errors with full vector ``full``,
    delays known to ``known`` (2,) [s], and the ``column`` (K,) of each."""

    recording: Recording
    problem: FilterProblem
    full: Array
    known: Array
    column: NDArray[np.int64]

    def at(self, k: int, n: int, m: int) -> tuple[Array, Array, Array]:
        """Attitude (4,), covariance (n, n) and sensitivities (n, m) at row ``k``."""
        P, S = np.zeros((n, n)), np.zeros((n, m))
        q, P[:3, :3], S[:3] = self.anew(k, m)
        return q, P, S

    def anew(self, k: int, m: int) -> tuple[Array, Array, Array]:
        """Attitude (4,), its covariance (3, 3) and sensitivities (3, m) at row ``k``."""
        recording, states = self.recording, self.problem.states
        after = recording.rate[min(k, len(recording.rate) - 1)]
        full, late, known = self.full.copy(), float(self.full[TAU]), float(self.known[0])
        decided = late < -3.0 * known  # read when the platform turned as behind the row
        full[TAU] = late if decided else 0.0
        q, slope = encoders_at(self.problem, recording.th[k], full[states.index], after)
        S, P = np.zeros((3, m)), np.eye(3) * anew(self.problem, recording.th[k]).sigma ** 2
        S[:, self.column[self.column >= 0]] = slope[:, self.column >= 0]
        size = math.hypot(late, known)
        if size > 0.0 and not decided:
            full[TAU] = 1e-3
            there, _ = encoders_at(self.problem, recording.th[k], full[states.index], after)
            by = boxminus(there, q) * 1e3 * size
            P += np.outer(by, by)
        if "tau_enc" in states.names and not decided and known > 0.0:
            S[:, self.column[states.names.index("tau_enc")]] = 0.0
        return q, P, S


def _groups(recording: Recording, restarts: Sequence[int]) -> tuple[NDArray[np.int64], list[slice]]:
    """The group (n - 1,) of each step, and the chunks of steps that are gone through at once."""
    count = len(recording.dt)
    turn = np.linalg.norm(recording.rate, axis=1) * recording.dt
    through = np.cumsum(np.maximum(turn / LIMITS.summed_turn, recording.dt / LIMITS.summed_time))
    group = np.floor(through - through[0]).astype(np.int64)
    alone = np.array([k - 1 for k in restarts], dtype=np.int64)
    edges = {0, count, *np.ceil(np.linspace(0, count, BLOCKS + 1)).astype(int).tolist(), *alone.tolist()}
    edges |= {int(k) + 1 for k in alone}
    new = np.zeros(count, dtype=bool)
    new[[k for k in edges if k < count]] = True
    new |= np.diff(group, prepend=-1) > 0
    group = np.cumsum(new) - 1
    chunks, first = list[slice](), 0
    fixed = sorted(edges)
    for end in fixed[1:]:
        while first < end:
            last = min(first + _ROWS, end)
            if last < end:  # not within a group
                whole = int(np.searchsorted(group, group[last]))
                last = whole if whole > first else min(int(np.searchsorted(group, group[last] + 1)), end)
            chunks.append(slice(first, last))
            first = last
    return group, chunks
