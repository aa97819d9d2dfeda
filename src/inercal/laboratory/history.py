"""The history of an instrument: each coefficient over its calibrations, control charts, wandering, the value to come.

Control charts ask whether a coefficient stayed, but for its uncertainty and the scatter between calibrations.
*Individuals* (Shewhart): a calibration against those before it. The limits are the quantiles, at the probabilities of
three standard deviations, of the value to expect if the coefficient had stayed: by u and by the scatter s beyond u,
which is learned from the calibrations before and averaged over (`inercal.laboratory.wander`). *EWMA* (Roberts 1959),
for slow drift: deviations as standard normal numbers z_k, by their place in that same distribution, are smoothed,
e_k = (1 - L) e_(k-1) + L z_k with L = 0.2, and compared with three standard deviations of e_k. Without any change each
point of each chart alarms with a probability of 0.27 %, or less.

Sources: ISO 7870-2:2013 and 7870-6:2016; S. W. Roberts, Technometrics 1 (1959) 239.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.variances import solved, weighed
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.results.shown import units_shown
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.specification import Conformity, Specification, conformity, group_of
from inercal.laboratory.wander import CalibrationSeries, Interval, Wandering, prior_of, wandering

Mask: TypeAlias = NDArray[np.bool_]

_GRID = 40


@dataclass(frozen=True, eq=False)
class Chart:
    """Both charts; NaN at the first two calibrations, which teach the scatter.

    ``centre``, ``low`` and ``high`` (n,) in the unit of the coefficient; ``z`` (n,) deviations as standard normal
    numbers, ``ewma`` (n,) and the limit ``ewma_limit`` (n,) of its size.
    """

    centre: Array
    low: Array
    high: Array
    z: Array
    ewma: Array
    ewma_limit: Array

    @property
    def alarms(self) -> Mask:
        """Calibrations (n,) outside the limits of the chart of individuals."""
        return np.abs(self.z) > LIMITS.chart_sigmas

    @property
    def drift_alarms(self) -> Mask:
        """Calibrations (n,) outside the limits of the EWMA."""
        return np.abs(self.ewma) > self.ewma_limit


def chart(series: CalibrationSeries) -> Chart:
    """The control charts of a coefficient that should not change."""
    n, first, L = len(series.y), LIMITS.first_calibrations, LIMITS.ewma_weight
    centre, low, high, z = (np.full(n, np.nan) for _ in range(4))
    if n > first:
        expected = [_expected(series, k) for k in range(first, n)]
        weights, means, sigmas = (np.array(each) for each in zip(*expected, strict=True))
        below = (weights * ndtr((series.y[first:, None] - means) / sigmas)).sum(axis=1)
        with np.errstate(divide="ignore"):
            z[first:] = np.clip(ndtri(np.clip(below, 0.0, 1.0)), -40.0, 40.0)
        centre[first:] = (weights * means).sum(axis=1)
        low[first:], high[first:] = (
            _quantiles(weights, means, sigmas, float(ndtr(side * LIMITS.chart_sigmas)))
            for side in (-1.0, 1.0)
        )
    ewma, limit = np.full(n, np.nan), np.full(n, np.nan)
    smoothed = 0.0
    for k in range(first, n):
        smoothed = (1.0 - L) * smoothed + L * z[k]
        ewma[k] = smoothed
        limit[k] = LIMITS.chart_sigmas * np.sqrt(L / (2.0 - L) * (1.0 - (1.0 - L) ** (2 * (k - first + 1))))
    return Chart(centre, low, high, z, ewma, limit)


def _expected(series: CalibrationSeries, k: int) -> tuple[Array, Array, Array]:
    """Distribution of calibration k by those before it: weights, means and sigmas of a mixture over s.

    The common part of u is the same in all, and cancels.
    """
    y, own = series.y[:k], series.own[:k]
    largest = 30.0 * max(series.scale, float(np.std(y)))
    sizes = np.concatenate([[0.0], np.geomspace(0.03 * series.scale, largest, _GRID)])
    prior = prior_of(sizes / series.scale, 1.0)
    variances = np.maximum(own**2 + sizes[:, None] ** 2, 1e-300)
    fit = solved(np.stack(np.broadcast_arrays(1.0, y), axis=-1) / np.sqrt(variances)[..., None])
    weights = weighed(fit.likelihood(np.log(variances).sum(axis=1)) + np.log(prior))
    sigmas = np.sqrt(fit.inverse[:, 0, 0] ** 2 + series.own[k] ** 2 + sizes**2)
    return weights, fit.x[:, 0], sigmas


def _quantiles(weights: Array, means: Array, sigmas: Array, p: float) -> Array:
    """Quantiles (m,) of mixtures (m, g) of normal distributions, by bisection to 1e-12 of their span."""
    low, high = (means - 40.0 * sigmas).min(axis=1), (means + 40.0 * sigmas).max(axis=1)
    for _ in range(40):
        middle = 0.5 * (low + high)
        under = (weights * ndtr((middle[:, None] - means) / sigmas)).sum(axis=1) < p
        low, high = np.where(under, middle, low), np.where(under, high, middle)
    found: Array = 0.5 * (low + high)
    return found


YEAR = 365.25
"""Days."""

REFERENCES = (
    "ISO 7870-2:2013 and 7870-6:2016, Control charts (individuals; EWMA)",
    "ILAC-G24:2022, Guidelines for the determination of recalibration intervals of measuring equipment",
    "ILAC-G8:09/2019, Guidelines on decision rules and statements of conformity; JCGM 106:2012",
    "H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 "
    "(1971) 545-554",
    "ISO 13528:2022, Statistical methods for use in proficiency testing by interlaboratory comparison",
)


@dataclass(frozen=True, eq=False)
class Course:
    """A coefficient over its calibrations, in the unit for people.

    ``dates`` (n) and ``ids`` of the calibrations, ``U`` (n,) expanded uncertainties, ``E_n`` (n,) between neighbours
    (NaN at the first), and, where there are enough calibrations, its ``wandering``, what it should be at the date that
    was asked for, and the date at which it leaves its limits (None: not within `Limits.horizon_years`).
    """

    name: str
    unit: str
    dates: tuple[date, ...]
    ids: tuple[str, ...]
    series: CalibrationSeries
    U: Array
    E_n: Array
    chart: Chart
    wandering: Wandering | None
    expected: Interval | None
    conformity: Conformity | None
    due: date | None

    @property
    def last(self) -> int:
        """Index of the last calibration."""
        return len(self.dates) - 1


@dataclass(frozen=True, eq=False)
class History:
    """The history of an instrument: courses of its coefficients, the verdict on the last calibration, findings."""

    instrument: str
    at: date
    courses: tuple[Course, ...]
    status: Status
    message: str
    findings: tuple[Finding, ...]


def day_of(row: Mapping[str, Any]) -> tuple[date, bool]:
    """The day of a calibration, and True if the study states it (else the day of the keeping)."""
    for text, stated in ((row["measured"], True), (row["made"], False)):
        try:
            return date.fromisoformat(str(text)[:10]), stated
        except ValueError:
            continue
    return date(1970, 1, 1), False


def history(
    rows: Iterable[Mapping[str, Any]],
    instrument: str,
    names: Sequence[str] | None = None,
    specification: Specification | None = None,
    at: date | None = None,
) -> History:
    """The history of an instrument.

    Parameters
    ----------
    rows : iterable of mapping
        A row a coefficient and result, as `inercal.laboratory.catalog.values_of` gives them. Only results that are ok
        count.
    instrument : str
        What to call it.
    names : sequence of str, optional
        The coefficients wanted; groups such as ``K1`` too. All if absent.
    specification : Specification, optional
        Tolerances.
    at : date, optional
        The date for which values are predicted; a year after the last calibration if absent.

    Raises
    ------
    InputError
        No calibration that is ok, or no such coefficient.
    """
    rows = list(rows)
    sound = [
        row
        for row in rows
        if row["status"] == Status.OK.value and row["value"] is not None and row["u"] is not None
    ]
    if not sound:
        raise InputError(
            instrument,
            f"found no calibration that is ok among {counted(len({r['id'] for r in rows}), 'result')}",
        )
    by_name: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in sound:
        if names is None or row["name"] in names or group_of(row["name"]) in names:
            by_name.setdefault((row["name"], row["unit"]), []).append(row)
    _check_names(names, {name for name, _ in by_name}, {row["name"] for row in sound})
    days = [day_of(row)[0] for row in sound]
    at = max(days) + timedelta(days=round(YEAR)) if at is None else at
    courses = [_course(name, unit, found, specification, at) for (name, unit), found in by_name.items()]
    if specification is not None:
        unknown = [
            key for key in specification.limits if not any(key in (c.name, group_of(c.name)) for c in courses)
        ]
        if unknown and names is None:
            raise InputError(
                f"specification.{unknown[0]}",
                f"no such coefficient, expected one of {counted_names([c.name for c in courses], 6)}",
            )
    status, message = _verdict(courses)
    return History(instrument, at, tuple(courses), status, message, tuple(_findings(rows, sound)))


def _check_names(names: Sequence[str] | None, found: set[str], there: set[str]) -> None:
    """Refuse coefficients that no calibration has."""
    for name in names or ():
        if not any(name in (each, group_of(each)) for each in found):
            raise InputError(name, f"no such coefficient, expected one of {counted_names(sorted(there), 6)}")


def _course(
    name: str, unit: str, rows: Sequence[Mapping[str, Any]], specification: Specification | None, at: date
) -> Course:
    """The course of one coefficient."""
    rows = sorted(rows, key=lambda row: (day_of(row)[0], row["made"]))
    shown, size = _shown(rows[0]["command"], unit)
    dates = tuple(day_of(row)[0] for row in rows)
    begin = dates[0]

    def column(key: str, missing: float) -> Array:
        return np.array([missing if row[key] is None else row[key] for row in rows])

    u, common = column("u", 0.0) / size, column("common", 0.0) / size
    common = np.minimum(common, u)
    own, k = np.sqrt(u**2 - common**2), column("k", 2.0)
    t = np.array([(day - begin).days / YEAR for day in dates])
    series = CalibrationSeries(t, column("value", np.nan) / size, own, common)
    apart, U = np.diff(series.y), k * own
    with np.errstate(divide="ignore", invalid="ignore"):
        E_n = np.concatenate([[np.nan], np.abs(apart) / np.hypot(U[1:], U[:-1])])
    wander = wandering(series) if len(rows) > 2 and np.ptp(t) > 0 else None
    limits = None if specification is None else specification.of(name, unit, (shown, size))
    judged, due = None, None
    if specification is not None and limits is not None:
        ends = limits[0] / size, limits[1] / size
        dof = float(column("dof", np.inf)[-1])
        judged = conformity(specification, ends, float(series.y[-1]), float(u[-1]), float(k[-1] * u[-1]), dof)
        due = None if wander is None else _due(wander, ends, begin)
    expected = None if wander is None else wander.at((at - begin).days / YEAR)
    ids = tuple(row["id"] for row in rows)
    return Course(name, shown, dates, ids, series, k * u, E_n, chart(series), wander, expected, judged, due)


def _shown(command: str, unit: str) -> tuple[str, float]:
    """The unit for people, and how many of ``unit`` it is: in that of the field for what is in SI."""
    if command == "calibrate turntable" and unit != "1":
        return shown_unit(unit)
    return units_shown(command, [unit])[0]


def _due(wander: Wandering, limits: tuple[float, float], begin: date) -> date | None:
    """The first day, from the last calibration on, at which the value with its U may be outside the limits."""
    last = float(wander.series.t[-1])

    def outside(t: float) -> bool:
        there = wander.at(t)
        return there.value - there.U < limits[0] or there.value + there.U > limits[1]

    steps = last + np.concatenate([[0.0], np.geomspace(1.0 / 12.0, LIMITS.horizon_years, 30)])
    found = next((i for i, t in enumerate(steps) if outside(float(t))), None)
    if found is None:
        return None
    if found == 0:
        return begin + timedelta(days=round(last * YEAR))
    low, high = float(steps[found - 1]), float(steps[found])
    while (high - low) * YEAR > 0.5:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if outside(middle) else (middle, high)
    return begin + timedelta(days=int(low * YEAR))


def _verdict(courses: Sequence[Course]) -> tuple[Status, str]:
    """The verdict on the last calibration of each coefficient."""
    from scipy.special import ndtri

    judged = [course for course in courses if np.isfinite(course.chart.z[course.last])]
    limit = -float(ndtri(LIMITS.family_risk / max(4 * len(judged), 1)))  # both sides of both charts
    moved, drifted = [], []
    for course in judged:
        k = course.last
        if abs(course.chart.z[k]) > limit:
            moved.append(course.name)
        elif abs(course.chart.ewma[k]) / course.chart.ewma_limit[k] * 3.0 > limit:
            drifted.append(course.name)
    outside = [c.name for c in courses if c.conformity is not None and c.conformity.verdict != "conform"]
    texts = []
    if moved:
        texts.append(f"{counted_names(moved, 4)} moved at the last calibration")
    if drifted:
        texts.append(f"{counted_names(drifted, 4)} drifted")
    if outside:
        texts.append(f"{counted_names(outside, 4)} outside the specification")
    if texts:
        return Status.INCONSISTENT, "; ".join(texts)
    many = max((len(course.dates) for course in courses), default=0)
    tested = (
        f"{counted(len(judged), 'coefficient')} at the last calibration within what u and scatter explain"
    )
    few = f"{counted(many, 'calibration')}, three are needed to judge one"
    return Status.OK, tested if judged else few


def _findings(rows: Sequence[Mapping[str, Any]], sound: Sequence[Mapping[str, Any]]) -> list[Finding]:
    """Calibrations that do not count, or whose date or method is in doubt."""
    findings = []
    counting = {row["id"] for row in sound}
    bad = {row["id"]: row["status"] for row in rows if row["id"] not in counting}
    if bad:
        what = ", ".join(sorted(set(bad.values())))
        words = f"{counted(len(bad), 'calibration')} left out ({what}): only those that are ok count"
        findings.append(Finding("calibration_left_out", words))
    undated = {row["id"] for row in sound if not day_of(row)[1]}
    if undated:
        words = (
            f"{counted(len(undated), 'calibration')} without a date in the study: the day of keeping is taken"
        )
        findings.append(Finding("undated", words))
    commands = sorted({row["command"] for row in sound})
    if len(commands) > 1:
        findings.append(
            Finding(
                "other_model",
                f"the calibrations are by {counted_names(commands, 4)}: coefficients of one name may not mean the same",
            )
        )
    return findings
