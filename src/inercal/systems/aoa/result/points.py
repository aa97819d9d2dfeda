"""Test points: one angle for each pause, with the uncertainty of the mean; tables of other systems joined to them.

Errors of biases, positions and axes are the same in all rows of a pause: the mean of n rows is no better known than one
of them, and its standard uncertainty is the mean of theirs. Noise and buffet add to it by the mean of rows that are
correlated (`inercal.systems.aoa.reading.recording`). A drift of the angle counts as scatter.

A table of another system of the tunnel, such as a balance, is joined by the numbers of the points, or by time.
By time the clocks may be apart. The offset is where the angle and a channel of the table, both less their means, are
most alike: the largest size of their correlation over all shifts at which half of the shorter one overlaps, of the
channel in which that is largest, refined by a parabola. Its standard uncertainty is that of a delay in white noise,
sqrt(1 - rho^2) / (|rho| sqrt(N) rms(x') / rms(x)).
"""

from __future__ import annotations

import csv
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.read import source_of
from inercal.foundation.records.titles import name_and_unit
from inercal.systems.aoa.angles import Angles, alpha_beta, continuous, unwrapped
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.pauses import pauses
from inercal.systems.aoa.reading.recording import Recording, later, mean_u, triggered, usual_step
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


_NUMBERS = ("point", "trigger")


@dataclass(frozen=True, eq=False)
class Balance:
    """A table: ``columns`` (n,) by title such as ``normal_force [N]``; ``numbers`` of points and ``t`` [s] where it has
    them."""

    source: Source
    columns: dict[str, Array]
    numbers: dict[str, Array]
    t: Array | None


@dataclass(frozen=True, eq=False)
class Joined:
    """Means of the table by title, (k,) for k points, and findings: the offset of the clocks, points without a row."""

    columns: dict[str, Array]
    findings: tuple[Finding, ...]


def read_balance(path: str | Path) -> Balance:
    """Read a CSV with a header of names and units; raises `InputError` naming row and column."""
    source = source_of(path)
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
        rows = [row for row in csv.reader(line for line in lines if not line.startswith("#")) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(path, "cannot be read as a table, expected a CSV with a header") from error
    if len(rows) < 2:
        raise InputError(path, "found no rows, expected a header such as point [1],normal_force [N] and rows")
    titles = [title.strip() for title in rows[0]]
    values = np.full((len(rows) - 1, len(titles)), np.nan)
    for k, row in enumerate(rows[1:]):
        if len(row) != len(titles):
            raise InputError(f"{path}, row {k + 1}", f"found {len(row)} values, expected {len(titles)}")
        for j, cell in enumerate(row):
            try:
                values[k, j] = float(cell) if cell.strip() else math.nan
            except ValueError as error:
                where = f"{path}, row {k + 1}, {titles[j]}"
                raise InputError(where, f"found {cell.strip()!r}, expected a number") from error
    by_name = {name_and_unit(title)[0].strip(): j for j, title in enumerate(titles)}
    numbers = {name: values[:, by_name[name]] for name in _NUMBERS if name in by_name}
    t = values[:, by_name["t"]] if "t" in by_name else None
    if t is not None and name_and_unit(titles[by_name["t"]])[1] != "s":
        raise InputError(path, f"found the column {titles[by_name['t']]!r}, expected t [s]")
    taken = {by_name[name] for name in (*numbers, *(["t"] if t is not None else []))}
    columns = {title: values[:, j] for j, title in enumerate(titles) if j not in taken}
    if not columns:
        raise InputError(path, "found no column to join, expected one beside point, trigger and t")
    if not numbers and t is None:
        raise InputError(path, "found neither point nor trigger nor t, expected one to join by")
    return Balance(source, columns, numbers, t)


def join(balance: Balance, points: Sequence[Point], recording: Recording, angles: Angles) -> Joined:
    """The table's means at the points, and their u by scatter where a point has several rows.

    By the number of ``point``, else of ``trigger``, where both sides have it; else by time. Raises `RecordError` where
    no point has a row, or no channel follows the angle.
    """
    where = balance.source.path
    for name in _NUMBERS:
        if name in balance.numbers and (name == "point" or recording.trigger is not None):
            number = balance.numbers[name]
            rows = [np.flatnonzero(number == (p.number if name == "point" else p.trigger)) for p in points]
            return _joined(balance, rows, None)
    if balance.t is None:
        raise RecordError(
            where, "found no column t and no numbers that the recording has, expected one to join by"
        )
    offset, u, rho, title = clock_offset(balance, recording, angles)
    t = balance.t - offset
    rows = [np.flatnonzero((t >= p.begin) & (t <= p.end)) for p in points]
    text = (
        f"{where}: joined by time; its clock is {offset:+.4f} s (u {u:.1g} s) from that of the sensors, by the "
        f"correlation {rho:+.3f} of {title} with theta"
    )
    return _joined(balance, rows, Finding("other_clock", text))


def clock_offset(balance: Balance, recording: Recording, angles: Angles) -> tuple[float, float, float, str]:
    """Time [s] that the table's clock is ahead, its standard uncertainty, the correlation and the channel."""
    assert balance.t is not None
    taken = later(recording.t)
    good = taken[np.isfinite(angles.theta[taken])]
    t, theta = recording.t[good], continuous(angles.theta[good])
    theirs = balance.t[np.isfinite(balance.t)]
    if len(t) < 2 or len(theirs) < 2 or not (np.diff(theirs) > 0.0).all():
        raise RecordError(balance.source.path, "t: found times that do not go on, expected them in order")
    step = max(usual_step(t), usual_step(theirs), (t[-1] - t[0]) / 2.0**18)
    x = np.interp(np.arange(t[0], t[-1], step), t, theta)
    best = (0.0, 0.0, 0.0, "")
    for title, values in balance.columns.items():
        seen = np.isfinite(values) & np.isfinite(balance.t)
        if seen.sum() < 2:
            continue
        y = np.interp(np.arange(theirs[0], theirs[-1], step), balance.t[seen], values[seen])
        lag, rho = _lag(x, y)
        if abs(rho) > abs(best[2]):
            slope = float(np.std(np.diff(x))) / step
            spread = float(np.std(x))
            count = min(len(x), len(y))
            u = math.sqrt(max(1.0 - rho**2, 0.0) / count) / abs(rho) * spread / slope if slope else math.inf
            best = (lag * step + float(theirs[0] - t[0]), math.hypot(u, step / math.sqrt(12.0)), rho, title)
    if not abs(best[2]) >= LIMITS.joined_correlation:
        text = (
            f"found no column that follows theta (largest correlation {best[2]:+.2f}), expected one to find the offset "
            "of the clocks by, or a column point"
        )
        raise RecordError(balance.source.path, text)
    return best


def _lag(x: Array, y: Array) -> tuple[float, float]:
    """Steps by which ``y`` comes later than ``x``, and their correlation there."""
    n = len(x) + len(y)
    size = 1 << (n - 1).bit_length()

    def sums(a: Array, b: Array) -> Array:
        """Sums of a[i] b[i + k] for k from -(len(x) - 1) to len(y) - 1."""
        spectrum = np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size)
        whole = np.fft.irfft(spectrum, size)
        return np.concatenate([whole[size - len(x) + 1 :], whole[: len(y)]])

    x, y = x - x.mean(), y - y.mean()
    ones_x, ones_y = np.ones(len(x)), np.ones(len(y))
    count = np.maximum(np.round(sums(ones_x, ones_y)), 1.0)
    mean_x, mean_y = sums(x, ones_y) / count, sums(ones_x, y) / count
    var_x = np.maximum(sums(x**2, ones_y) / count - mean_x**2, 0.0)
    var_y = np.maximum(sums(ones_x, y**2) / count - mean_y**2, 0.0)
    enough = (count >= 0.5 * min(len(x), len(y))) & (var_x > 1e-6 * x.var()) & (var_y > 1e-6 * y.var())
    with np.errstate(divide="ignore", invalid="ignore"):
        rho = np.where(enough, (sums(x, y) / count - mean_x * mean_y) / np.sqrt(var_x * var_y), 0.0)
    k = int(np.argmax(np.abs(rho)))
    shift = 0.0
    if 0 < k < len(rho) - 1 and enough[k - 1] and enough[k + 1]:
        left, mid, right = np.abs(rho[k - 1 : k + 2])
        curvature = left - 2.0 * mid + right
        shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
    return k - (len(x) - 1) + float(shift), float(rho[k])


def _joined(balance: Balance, rows: Sequence[NDArray[np.intp]], clock: Finding | None) -> Joined:
    """Means of the rows of each point."""
    if not any(len(each) for each in rows):
        raise RecordError(balance.source.path, "found no row of any point, expected rows of the same run")
    columns: dict[str, Array] = {}
    for title, values in balance.columns.items():
        parts = [values[each][np.isfinite(values[each])] for each in rows]
        columns[title] = np.array([float(x.mean()) if len(x) else math.nan for x in parts])
        if any(len(x) > 1 for x in parts):
            columns[f"u_{title}"] = np.array([mean_u(x) if len(x) > 1 else math.nan for x in parts])
    empty = sum(not len(each) for each in rows)
    found = [] if clock is None else [clock]
    if empty:
        found.append(Finding("gap", f"{balance.source.path}: {empty} of {len(rows)} points have no row"))
    return Joined(columns, tuple(found))
