"""Test points: one angle for each pause, with the uncertainty of the mean.

Errors of biases, positions and axes are the same in all rows of a pause: the mean of n rows is no better known than one
of them, and its standard uncertainty is the mean of theirs. Noise and buffet add to it by the mean of rows that are
correlated (`inercal.systems.aoa.reading.recording`). A drift of the angle counts as scatter.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.systems.aoa.angles import Angles, alpha_beta, unwrapped
from inercal.systems.aoa.reading.pauses import pauses
from inercal.systems.aoa.reading.recording import Recording, mean_u, triggered
from inercal.systems.aoa.settings import AoaSettings

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Point:
    """One test point.

    ``number`` of the record's ``point`` column, or counted from 1; ``trigger`` and ``last_trigger`` the first and last
    number of its ``trigger`` column, NaN without any. ``begin`` and ``end`` [s] of the first and last row with an
    angle, from row ``start`` of the recording up to ``stop``; ``rows`` of them have an angle.

    ``theta`` [rad] is the mean and ``u`` its standard uncertainty: ``u_angle`` common to all rows and ``u_scatter`` of
    noise and buffet, not to be counted where another quantity is averaged over the same rows. ``scatter`` [rad] is the
    standard deviation about the mean, ``rate`` [rad/s] the slope of the line through the point; ``alpha`` and ``beta``
    [rad] are at the mean angle, and the mean roll where it is tracked.
    """

    number: float
    trigger: float
    last_trigger: float
    begin: float
    end: float
    start: int
    stop: int
    rows: int
    theta: float
    u: float
    u_angle: float
    u_scatter: float
    scatter: float
    rate: float
    alpha: float
    u_alpha: float
    beta: float
    u_beta: float


def points(recording: Recording, angles: Angles, settings: AoaSettings) -> tuple[Point, ...]:
    """The test points of a recording.

    A point is a stretch with one number in the record's ``point`` column; the same number later is another point.
    Without that column a point is a pause of the angle itself (`inercal.systems.aoa.reading.pauses`). The study may ask
    for one of these, or for those of the ``trigger`` (`inercal.systems.aoa.reading.recording`). Rows without an angle
    are left out, and end no point. Raises `RecordError` where the column that is asked for is missing.
    """
    by = settings.points.by
    if by == "auto":
        by = "pause" if recording.point is None else "point"
    answered = np.isfinite(angles.theta) & np.isfinite(recording.t)
    rows = slice(None) if answered.all() else np.flatnonzero(answered)
    t, theta = recording.t[rows], unwrapped(angles.theta[rows])
    if by == "pause":
        dwells = pauses(t, theta, angles.known_u[rows])
        stretches = [(float(k), each.start, each.stop) for k, each in enumerate(dwells, start=1)]
    else:
        column = recording.point if by == "point" else recording.trigger
        if column is None:
            raise RecordError(by, f'missing, expected the column that [points] by = "{by}" asks for')
        numbers = column[rows]
        stretches = _numbered(numbers) if by == "point" else triggered(t, numbers, settings.points)
    return tuple(
        _point(
            number,
            np.arange(a, b) if isinstance(rows, slice) else rows[a:b],
            theta[a:b],
            recording,
            angles,
            settings,
        )
        for number, a, b in stretches
    )


def _numbered(number: Array) -> list[tuple[float, int, int]]:
    """Stretches of one number: the number, the first row and the one after the last."""
    last, now = number[:-1], number[1:]
    changes = np.flatnonzero((last != now) & ~(np.isnan(last) & np.isnan(now))) + 1
    bounds = [0, *changes.tolist(), len(number)]
    return [
        (float(number[a]), a, b) for a, b in itertools.pairwise(bounds) if b > a and not np.isnan(number[a])
    ]


def _point(
    number: float,
    rows: Indices,
    theta: Array,
    recording: Recording,
    angles: Angles,
    settings: AoaSettings,
) -> Point:
    """The point of some ``rows``, at which the angle is ``theta``, without jumps."""
    t = recording.t[rows]
    mean = math.remainder(float(theta.mean()), 2.0 * math.pi)
    common, left = float(angles.u[rows].mean()), mean_u(theta)
    own = math.hypot(float(angles.known_u[rows].mean()), left)
    roll, roll_u, by_roll = (
        None if each is None else each[rows].mean(keepdims=True)
        for each in (angles.roll, angles.roll_u, angles.by_roll)
    )
    flow = alpha_beta(np.array([mean]), np.array([own]), settings.attitude, roll, roll_u, by_roll)
    triggers = np.empty(0) if recording.trigger is None else recording.trigger[rows]
    triggers = triggers[np.isfinite(triggers)] if np.isfinite(triggers).any() else np.full(1, np.nan)
    since = t - t.mean()
    power = float(since @ since)
    return Point(
        number=number,
        trigger=float(triggers[0]),
        last_trigger=float(triggers[-1]),
        begin=float(t[0]),
        end=float(t[-1]),
        start=int(rows[0]),
        stop=int(rows[-1]) + 1,
        rows=len(rows),
        theta=mean,
        u=math.hypot(common, left),
        u_angle=common,
        u_scatter=left,
        scatter=float(theta.std()),
        rate=float(since @ theta) / power if power > 0.0 else 0.0,
        alpha=float(flow.alpha[0]),
        u_alpha=float(flow.u_alpha[0]),
        beta=float(flow.beta[0]),
        u_beta=float(flow.u_beta[0]),
    )
