"""Quality of the fit of a recording to its study: the liveliest stretch, filtered with all nuisances."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array, remembered
from inercal.foundation.records.checks.values import outlying
from inercal.systems.aoa.estimators import States
from inercal.systems.aoa.fusion.band import fused_case
from inercal.systems.aoa.fusion.loop import OUTPUTS
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.fusion.run import FusionState, advance, initial
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, in_time, later
from inercal.systems.aoa.settings import AoaSettings

_BLOCK = 50
"""Rows that are filtered at a time."""

Case = tuple[Recording, AoaSettings]
"""A recording and its study, on which hypotheses are tried."""

_BY_MOTION = ("dr_", "zo_", "k_g", "tau_g")
"""Coefficients that only motion shows; at rest they follow noise."""


@dataclass(frozen=True, eq=False)
class FitQuality:
    """Result of the fusion of a stretch.

    ``innovations`` (m, N + 1) over their standard deviations; ``theta`` and ``rate`` (m,) [rad, rad/s]; ``off`` the
    distance of each coefficient from its prior, in standard deviations of the prior, by name, at rest without those
    that only motion shows; ``unlikely`` the squared distance of all of them together, over the largest expected one;
    ``misfit`` of all in one number.
    """

    innovations: Array
    theta: Array
    rate: Array
    off: dict[str, float]
    unlikely: float

    @property
    def by_sensor(self) -> Array:
        """(N + 1,) mean of log(1 + v^2) of each sensor: 0.53 for white innovations, little moved by single wild ones; 0
        for an absent sensor."""
        return np.array([_logarithm(v[np.isfinite(v)]) for v in self.innovations.T])

    @property
    def misfit(self) -> float:
        """Sum over the sensors, and over the coefficients of log(1 + (off / 3)^2); a gyro without noise misfits too."""
        of_gyro = float(self.by_sensor[-1])
        silent = max(0.0, LIMITS.white_log - of_gyro) if np.isfinite(self.innovations[:, -1]).any() else 0.0
        return float(self.by_sensor.sum() + silent + np.log1p(self._far**2).sum())

    @property
    def white(self) -> bool:
        """True where the innovations of no sensor are larger than its noise."""
        return bool(self.by_sensor.max() < LIMITS.loud_log)

    @property
    def fits(self) -> bool:
        """True where no sensor and no coefficient is beyond what its noise and its prior explain."""
        return bool(self.white and np.abs(self._far).max() < LIMITS.far_ratio and self.unlikely < 1.0)

    @property
    def _far(self) -> Array:
        """Distances of the coefficients from their priors, over the largest expected ones."""
        wide, wide_scale = LIMITS.prior_sigmas, LIMITS.gyro_scale_sigmas
        return np.array([0.0, *(v / (wide_scale if k == "k_g" else wide) for k, v in self.off.items())])


def _logarithm(v: Array) -> float:
    """Mean of log(1 + v^2), 0 without any."""
    with np.errstate(over="ignore"):
        return float(np.minimum(np.log1p(v**2), 700.0).mean()) if v.size else 0.0


@remembered
def stretch(recording: Recording) -> Recording:
    """The rows in which the sensors vary most, later ones only, without single wild samples."""
    taken, most = later(recording.t), LIMITS.judged_rows
    if len(taken) > most:
        rows = in_time(recording.t)
        read = [column[rows] for column in (*recording.acc.T, recording.gyro)]
        scale = _scatter(read)
        starts = np.arange(0, len(taken) - most + 1, most // 2)
        lively = [float((_scatter([c[k : k + most] for c in read]) / scale).sum()) for k in starts]
        first = int(starts[int(np.argmax(lively))])
        taken = taken[first : first + most]
    part = recording.of(taken)
    for column in (*part.acc.T, part.gyro, *part.turns.T):
        # mirrored at the ends, where a sample has one neighbour
        wild = outlying(np.concatenate([column[1:2], column, column[-2:-1]])) - 1
        column[wild[(wild >= 0) & (wild < len(column))]] = np.nan
    return part


def judged(recording: Recording, settings: AoaSettings) -> Case:
    """The stretch of the rows that are fused, and the study for these, without a band."""
    rows, settings = fused_case(recording, settings)
    return stretch(rows), settings


def _scatter(read: Sequence[Array]) -> Array:
    """Standard deviation of each column, 1 for an empty one."""
    return np.array([_deviation(column) or 1.0 for column in read])


def _deviation(x: Array) -> float:
    """Standard deviation of the numbers in ``x`` (n,), 0 without any."""
    finite = np.isfinite(x)
    if finite.all():
        return float(x.std())
    return float(x[finite].std()) if finite.any() else 0.0


def fit_quality(recording: Recording, settings: AoaSettings, states: States = 19) -> FitQuality:
    """Filter a stretch whose time goes on; of the last studies that were asked of it it is known."""
    asked = replace(settings, estimator=replace(settings.estimator, states=states))
    posed, known = problem(asked, recording.spatial), _qualities(recording)
    key = posed.covariance.tobytes(), posed.mean.tobytes(), posed.geometry.tobytes(), posed.constants
    if key not in known:
        known.clear()
        known[key] = _fit_quality(recording, settings, posed)
    return known[key]


@remembered
def _qualities(_: Recording) -> dict[Hashable, FitQuality]:
    """The quality of the last fit of a recording."""
    return {}


def _fit_quality(recording: Recording, settings: AoaSettings, posed: FusionProblem) -> FitQuality:
    """Filter a stretch whose time goes on."""
    with np.errstate(all="ignore"):
        state, outputs = _followed(posed, recording.t, recording.rows)
        still = rms(outputs[:, 2]) < settings.noise.gyro
        shown = {k: at for k, at in posed.nuisances.items() if not (still and k.startswith(_BY_MOTION))}
        at = [*shown.values()]
        off = (state.x[at] - posed.mean[at]) / np.sqrt(np.diag(posed.covariance)[at])
        off = np.nan_to_num(off, nan=1e6)
        together = _together(off, posed.covariance[np.ix_(at, at)], state.P[np.ix_(at, at)])
    named = dict(zip(shown, off.tolist(), strict=True))
    return FitQuality(outputs[:, OUTPUTS:], outputs[:, 0], outputs[:, 2], named, together)


def _together(off: Array, prior: Array, posterior: Array) -> float:
    """Squared distance of coefficients (p,) from their prior, over that which chance exceeds once in ten thousand.

    Estimates lie about the mean of the prior with its covariance less that of the posterior (p, p); counted are the
    combinations of which the recording shows a share. A fault that none shows alone, such as an axis that is turned
    where positions and heights take its effect, shows so.
    """
    from scipy.special import chdtri

    u = np.sqrt(np.diag(prior))
    gained = (prior - posterior) / np.outer(u, u)
    if not np.isfinite(gained).all():
        return math.inf
    variances, combinations = np.linalg.eigh(gained)
    seen = variances > LIMITS.shown_share
    squares = np.square(combinations.T @ off)[seen] / variances[seen]
    return float(squares.sum() / chdtri(seen.sum(), LIMITS.prior_chance)) if seen.any() else 0.0


def _followed(posed: FusionProblem, t: Array, rows: Array) -> tuple[FusionState, Array]:
    """The state after rows, and the outputs of the fusion (m, OUTPUTS + N + 1).

    A filter that loses the angle every few rows is given up, as a new start takes the time of a hundred steps: NaN from
    there on.
    """
    state, done, starts = initial(posed), 0, 0
    out = np.full((len(t), OUTPUTS + posed.count + 1), np.nan)
    for a in range(0, len(t), _BLOCK):
        b = min(a + _BLOCK, len(t))
        state, trace = advance(state, posed, t[a:b], rows[a:b], last=b == len(t))
        out[done : done + len(trace.out)] = trace.out
        done, starts = done + len(trace.out), starts + len(trace.starts)
        if starts > LIMITS.lost_share * b + LIMITS.lost_starts:
            break
    return state, out


def rms(rate: Array) -> float:
    """Root mean square of a rate (m,) [rad/s] once a filter has settled; infinite where it is not known."""
    settled = rate[len(rate) // 10 :]
    settled = settled[np.isfinite(settled)]
    return math.sqrt(float(np.mean(np.square(settled)))) if settled.size else math.inf
