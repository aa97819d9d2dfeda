"""Bounds before the test: how well any unbiased estimator can know the coefficients along a path.

The covariance of the error-state filter along the true path is the Cramer-Rao bound (Van Trees and Bell, Bayesian
Bounds, 2007): its Riccati recursion needs no measurements. Split by source, it says how much each adds:

    P_s+ = (1 - K h)(F P_s F^T + Q_s)(1 - K h)^T + K R_s K^T,   sum of all P_s = P,   K the gain of the whole
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import allocating, kernel, merged
from inercal.foundation.arrays import Array
from inercal.foundation.inference.kalman import SlopeRow, empty_row
from inercal.systems.selfcal.filters.gaps import anew, walking
from inercal.systems.selfcal.filters.problem import (
    FilterModel,
    FilterProblem,
    admitted,
    apart,
    encoders_at,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.coefficients import product_slope, to_linear
from inercal.systems.selfcal.platform.kinematics import attitude
from inercal.systems.selfcal.platform.layout import StateLayout
from inercal.systems.selfcal.platform.linearised import (
    Transition,
    decorrelated_row,
    encoder_roots,
    propagate_covariance,
    transition,
    wander,
)
from inercal.systems.selfcal.platform.model import (
    WIDEST,
    EncoderWorld,
    Rates,
    Room,
    accelerometers,
    base_of,
    encoders,
    force_within,
    room,
    specific_force,
    turning,
)
from inercal.systems.selfcal.platform.plan import CommandedMotion
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.truth import PlatformTruth, simulate_truth

Mask: TypeAlias = NDArray[np.bool_]

BAYESIAN_BOUNDS: Final = (
    "H. L. Van Trees, K. L. Bell (editors), Bayesian Bounds for Parameter Estimation and Nonlinear Filtering/Tracking, "
    "Wiley (2007)"
)
"""The publication behind these bounds."""

SOURCES: Final = ("angle random walk", "accelerometer", "encoder", "prior")
"""Sources of the errors of an estimate, in the order of `PathBounds.contributions`."""


#: parts of accelerometer and encoder; an array, for numba compiles a kernel anew for each literal number
_PARTS: Final = np.array([2, 3])


@dataclass(frozen=True, eq=False)
class PathBounds:
    """Cramer-Rao bounds of the coefficients along a path.

    ``covariance`` (p, p) at its end, product form, and ``prior`` (p,) standard deviations before it; ``history`` (n, p)
    standard uncertainties from row to row, linear form, no rows unless asked for. ``contributions``: source (`SOURCES`)
    -> its part (p, p) of the covariance, to which they add up; empty unless asked for. The first encoder reading, which
    gives the attitude at the start, belongs to the encoder.
    """

    names: tuple[str, ...]
    covariance: Array
    prior: Array
    history: Array
    contributions: Mapping[str, Array] = field(default_factory=dict)

    @property
    def u(self) -> Array:
        """(p,) standard uncertainties at the end of the path."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def shares(self) -> Mapping[str, Array]:
        """Source -> its share (p,) of each coefficient's variance; they add up to 1."""
        variance = np.diag(self.covariance)
        return {source: np.diag(part) / variance for source, part in self.contributions.items()}


def bounds(
    motion: CommandedMotion,
    problem: FilterProblem,
    truth: Array | None = None,
    measured: Mask | None = None,
    history: bool = False,
    contributions: bool = False,
    warm: Array | None = None,
    known: Array | None = None,
) -> PathBounds:
    """Bounds along a commanded motion, with noise, prior and near-level gate of the problem.

    ``truth`` (p,) or longer, product form, makes the path, the nominal one if absent; ``measured`` (n, 4) rows that
    accelerometers x, y, z and the encoders measure, all if absent. The first row's accelerometers play no part.
    ``warm`` (n,) [K] above the temperature of the coefficients, 0 if absent. ``known`` (p, p) is their covariance at
    the start, linear form, in the place of the prior.
    """
    c = problem.mean if truth is None else to_linear(truth[problem.states.index])
    n, rate, dt = len(motion.t), motion.rate, np.diff(motion.t)
    q = nominal_attitudes(motion, problem, c, warm)
    above = np.zeros(n) if warm is None else warm
    seen = np.ones((n, 4), dtype=np.bool_) if measured is None else measured
    return _along(
        Path(q, motion.angles, dt, rate, seen, above), c, problem, history, contributions, known=known
    )


def nominal_attitudes(motion: CommandedMotion, problem: FilterProblem, c: Array, warm: Array | None) -> Array:
    """Attitudes q_bp (n, 4) along a commanded motion with coefficients ``c`` (p,), linear form; ``warm`` as of
    `bounds`."""
    world, n, rate = problem.world, len(motion.t), motion.rate
    q = np.empty((n, 4))
    first = np.array(attitude(motion.angles[0], world.axes, world.signs))
    without, unused = np.zeros((n - 1, 1, 3)), np.empty((n, 3))
    above = np.zeros(n) if warm is None else warm
    step, states, truth = np.diff(motion.t)[0], problem.states, PlatformTruth(q, unused, motion.angles.copy())
    simulate_truth(first, rate[:, None], step, without, above, states.full(c), states.layout, world, truth)
    return q


def recorded_bounds(
    recording: Recording,
    problem: FilterProblem,
    attitudes: Array,
    coefficients: Array,
    history: bool = False,
    contributions: bool = False,
    restarts: Sequence[int] = (),
) -> PathBounds:
    """Bounds along a path as it was estimated, with the measurements that a recording has.

    ``attitudes`` (n, 4) estimated q_bp at its rows, ``coefficients`` (p,) in the linear form; ``restarts`` the rows at
    which the attitude was taken anew from the encoders.
    """
    seen = np.column_stack([np.isfinite(recording.acc), np.all(np.isfinite(recording.th), axis=1)])
    warm = np.zeros(len(attitudes)) if recording.warm is None else recording.warm
    walked = None if recording.walked is None else recording.walked / recording.dt
    path = Path(attitudes, recording.th, recording.dt, recording.rate, seen, warm)
    return _along(path, coefficients, problem, history, contributions, restarts, walked)


def _along(
    whole_path: Path,
    c: Array,
    problem: FilterProblem,
    history: bool,
    contributions: bool,
    restarts: Sequence[int] = (),
    walked: Array | None = None,
    known: Array | None = None,
) -> PathBounds:
    """Bounds along a path with coefficients (p,), linear form; ``walked`` (n - 1,) factors of the variance of the angle
    random walk in each step; ``known`` as of `bounds`."""
    q, th, dt, rate, seen, warm = whole_path
    p, noise = len(c), problem.noise
    u = np.empty((len(q) if history else 0, p))
    start = np.zeros((2, 3 + p))
    start[0, :3], start[1, 3:] = noise.encoder**2, problem.prior**2
    P = np.zeros((1 + len(SOURCES) if contributions else 1, 3 + p, 3 + p))
    P[0] = np.diag(start[0] + start[1])
    if known is not None:
        P[0, 3:, 3:] = known
    if contributions:
        P[3], P[4] = np.diag(start[0]), np.diag(start[1])
    if len(rate):
        _tie(P, problem, th[0], c, rate[0])
    first, angles = 0, np.arange(3)
    for last in (*restarts, len(q)):
        for begin, end, own in _evenly(first, last, problem, walked):
            rows, steps = slice(begin, end), slice(begin, max(end - 1, 0))
            path = Path(q[rows], th[rows], dt[steps], rate[steps], seen[rows], warm[rows])
            riccati(P, path, problem.states.full(c), own.model, u[rows])
        if last < len(q):
            P[:, :3], P[:, :, :3] = 0.0, 0.0
            P[:, angles, angles] = [
                [anew(problem, th[last]).sigma ** 2 if s in (0, 3) else 0.0] for s in range(len(P))
            ]
            _tie(P, problem, th[last], c, rate[min(last, len(rate) - 1)])
        first = last
    slope = product_slope(c)
    whole, *parts = (slope @ each[3:, 3:] @ slope.T for each in P)
    split = dict(zip(SOURCES, parts, strict=True)) if contributions else {}
    return PathBounds(problem.names, whole, problem.prior, u, split)


def _tie(P: Array, problem: FilterProblem, th: Array, c: Array, rate: Array) -> None:
    """Put into covariance and parts (s, 3 + p, 3 + p) that errors of the attitude are those of the encoders' states."""
    if not problem.states.of_rig:
        return
    whole = np.eye(P.shape[1])
    whole[:3, 3:] = encoders_at(problem, th, c, rate)[1]
    P[:] = whole @ P @ whole.T


def _evenly(
    first: int, last: int, problem: FilterProblem, walked: Array | None
) -> Iterator[tuple[int, int, FilterProblem]]:
    """Rows from ``first`` to ``last`` in parts of one random walk, with the problem of each; a part begins with the
    last row of the one before, which counts there."""
    begin = first
    for k in () if walked is None else np.flatnonzero(walked[first : max(last - 1, first)] != 1.0) + first:
        yield begin, int(k) + 1, problem
        yield int(k), int(k) + 2, walking(problem, float(walked[k]))  # type: ignore[index]
        begin = int(k) + 1
    yield begin, last, problem


@kernel
def _observe(P: Array, row: SlopeRow, size: int, r: float, source: int, work: Array) -> None:
    """Covariance ``P[0]`` and its parts ``P[1:]`` (m, m) after a scalar measurement, in place.

    ``row`` is its derivative by the state, ``r`` its variance, which belongs to the part ``source``; ``work`` (2, m) is
    used up.
    """
    places, values = row.places, row.values
    m = P.shape[1]
    gain, own = work[0], work[1]
    for s in range(len(P)):
        inner, part = r if s == 0 or s == source else 0.0, P[s]
        own.fill(0.0)
        for k in range(size):
            line, value = part[places[k]], values[k]  # rows are columns, and near each other
            for i in range(m):
                own[i] += line[i] * value
        for k in range(size):
            inner += values[k] * own[places[k]]
        if s == 0:
            for i in range(m):
                gain[i] = own[i] / inner
        for i in range(m):
            own[i] -= 0.5 * inner * gain[i]
        for i in range(m):
            by_gain, by_own, line = gain[i], own[i], part[i]
            for k in range(m):
                line[k] -= by_gain * own[k] + by_own * gain[k]  # symmetric to the last digit


class Path(NamedTuple):
    """A path of n rows: attitudes ``q`` (n, 4), gimbal angles ``th`` (n, 3) [rad], steps ``dt`` (n - 1,) [s], commanded
    ``rate`` (n - 1, 3) [rad/s], rows ``measured`` (n, 4) by accelerometers x, y, z and the encoders, and how ``warm``
    (n,) [K] they are."""

    q: Array
    th: Array
    dt: Array
    rate: Array
    measured: Mask
    warm: Array


@merged
def arrived(
    path: Path, k: int, c: Array, base: EncoderWorld, layout: StateLayout, own: Room
) -> tuple[Transition, Rates]:
    """The step to row ``k`` of a path, and the rates there; quantities of the rate in ``own``."""
    w, dt, warm, following = path.rate, path.dt[k - 1], path.warm[k], min(k, len(path.rate) - 1)
    at = (path.q[k, 0], path.q[k, 1], path.q[k, 2], path.q[k, 3])
    commanded = (w[k - 1, 0], w[k - 1, 1], w[k - 1, 2])
    read = Rates(commanded, (w[following, 0], w[following, 1], w[following, 2]))
    f = force_within(at, commanded, -0.5 * dt, base.up, layout.by_force)
    rate = turning(commanded, f, warm, c, layout, own)
    return transition(commanded, rate, dt, at, base.earth, c, layout.based), read


@allocating
def riccati(P: Array, path: Path, c: Array, model: FilterModel, u: Array) -> None:
    """Covariance of the error state along a path, in place.

    ``P`` (1 or 1 + sources, 3 + p, 3 + p) is that at the first row, the whole and then its parts; ``c`` is the
    full vector, linear form; ``u`` (n or 0, p) receives standard uncertainties.
    """
    q, th, seen, warm = path.q, path.th, path.measured, path.warm
    world, noise, gate, layout = model
    m, place = P.shape[1], layout.place
    top, spare, work, row, own = (
        np.empty((3, m)),
        np.empty((3, m)),
        np.empty((2, m)),
        empty_row(WIDEST),
        room(),
    )
    near = np.zeros(3, dtype=np.int64)
    base, mean = base_of(c, layout.based, world), c.copy()
    variance = noise.accelerometer * noise.accelerometer
    for k in range(len(q)):
        if k > 0:
            F, read = arrived(path, k, c, base, layout, own)
            at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
            walk = noise.angle_random_walk * noise.angle_random_walk * F.dt
            for s in range(len(P)):
                propagate_covariance(P[s], F, layout, own, walk if s < 2 else 0.0, top, spare)
                if layout.walking:  # how far biases walk is known before, as a prior is
                    known = 1.0 if s == 0 or s == 4 else 0.0
                    of_gyros, of_accelerometers = known * noise.gyro_walk, known * noise.accelerometer_walk
                    wander(P[s], mean, place, of_gyros, of_accelerometers, F.dt)
            if seen[k, 3]:
                watch(specific_force(attitude(th[k], world.axes, world.signs), base.up), gate, near)
            if updating(gate, near):
                if seen[k, 3]:
                    sigma = noise.encoder
                    floor = apart(noise, F.dt, sigma)
                    roots, _ = encoder_roots(th[k], world.axes, world.signs, sigma, noise.joints, floor)
                    if len(layout.columns) > 0:
                        encoders(th[k], read, base, c, layout, world, own)
                    for i in range(3):
                        size = decorrelated_row(i, roots[i], layout.columns, own.axes, row)
                        _observe(P, row, size, 1.0, _PARTS[1], work)
                accelerometers(at, read, warm[k], base, c, layout, own)
                for i in range(3):
                    if seen[k, i] and admitted(i, gate, near):
                        of_row = SlopeRow(layout.rows[i], own.entries[i])
                        _observe(P, of_row, layout.sizes[i], variance, _PARTS[0], work)
        if len(u) > 0:
            for i in range(u.shape[1]):
                u[k, i] = math.sqrt(P[0, 3 + i, 3 + i])
