"""The history of an instrument, shown: a table, pictures of the charts, a page, rows for other programs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as template
from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, QUIET
from inercal.foundation.arrays import Array
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.basis import Basis, Formula
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import aligned, csv_text, rounded
from inercal.laboratory.history import REFERENCES, YEAR, Course, History, Mask
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.specification import group_of
from inercal.laboratory.wander import Interval

COMMAND = "history"

MODEL = Formula(
    "$x(t) = a + b t + w(t)$, $w$ a random walk of variance $q t$; $y_k = x(t_k) + c + v_k + e_k$: $c$ of $u$ common "
    "to all calibrations, $v_k$ its rest, $e_k$ of variance $s^2$; $q$ and $s^2$ averaged over by their restricted "
    "likelihood"
)


def estimate_of(history: History, inputs: Iterable[Source] = ()) -> Estimate:
    """The history as a result without parameters: all of it is in ``result``."""
    basis = Basis(COMMAND, MODEL, inputs=tuple(inputs), references=REFERENCES)
    result = {
        "instrument": history.instrument,
        "at": history.at.isoformat(),
        "coefficients": [_course(course, history) for course in history.courses],
    }
    return Estimate.without(basis, history.status, history.message, findings=history.findings, result=result)


def _course(course: Course, history: History) -> dict[str, Any]:
    """A coefficient as plain objects."""
    wander, judged, chart = course.wandering, course.conformity, course.chart
    return {
        "name": course.name,
        "unit": course.unit,
        "calibrations": [
            {
                "date": day.isoformat(),
                "id": course.ids[k],
                "value": course.series.y[k],
                "u": course.series.u[k],
                "U": course.U[k],
                "normalised_error": course.E_n[k],
                "low": chart.low[k],
                "high": chart.high[k],
                "alarm": bool(chart.alarms[k]),
                "ewma": chart.ewma[k],
                "ewma_limit": chart.ewma_limit[k],
                "drift_alarm": bool(chart.drift_alarms[k]),
            }
            for k, day in enumerate(course.dates)
        ],
        "drift_per_year": None if wander is None else _interval(wander.drift),
        "random_walk_per_sqrt_year": None if wander is None else _sizes(wander.range_of(wander.walk)),
        "calibration_noise": None if wander is None else _sizes(wander.range_of(wander.noise)),
        "expected": None
        if course.expected is None
        else {"at": history.at.isoformat(), **_interval(course.expected)},
        "conformity": None if judged is None else vars(judged),
        "due": None if course.due is None else course.due.isoformat(),
    }


def _interval(interval: Interval) -> dict[str, float]:
    """Value and U."""
    return {"value": interval.value, "U": interval.U}


def _sizes(sizes: tuple[float, float, float]) -> dict[str, float]:
    """Median and interval of 95 % of a standard deviation."""
    return dict(zip(("median", "low", "high"), sizes, strict=True))


HEAD = (
    "",
    "calibrations",
    "last",
    "U",
    "drift a year",
    "U",
    "expected",
    "U",
    "unit",
    "alarms",
    "conform",
    "due",
)


def rows(history: History) -> list[tuple[str, ...]]:
    """The table, a row a coefficient, as texts."""
    found = []
    for course in history.courses:
        k, U = course.last, float(course.U[course.last])
        last, shown_U, *_ = rounded(float(course.series.y[k]), U)
        wander, judged = course.wandering, course.conformity
        drift = ("–", "–") if wander is None else rounded(wander.drift.value, wander.drift.U)[:2]
        expected = (
            ("–", "–") if course.expected is None else rounded(course.expected.value, course.expected.U)[:2]
        )
        alarms = int(course.chart.alarms.sum()), int(course.chart.drift_alarms.sum())
        words = ", ".join(
            f"{many} {what}" for many, what in zip(alarms, ("single", "drift"), strict=True) if many
        )
        conform = (
            ""
            if judged is None
            else f"{'yes' if judged.verdict == 'conform' else 'no'} ({judged.probability:.1%})"
        )
        due = (
            ""
            if judged is None or wander is None
            else course.due.isoformat()
            if course.due
            else f"> {LIMITS.horizon_years:.0f} years"
        )
        found.append(
            (course.name, str(k + 1), last, shown_U, *drift, *expected, course.unit, words, conform, due)
        )
    return found


def table(history: History) -> str:
    """The table as aligned text."""
    lines = [(*HEAD[:6], f"on {history.at}", *HEAD[7:]), *rows(history)]
    kept = [i for i in range(len(HEAD)) if i < 9 or any(line[i] for line in lines[1:])]
    words = {place for place, i in enumerate(kept) if not 0 < i < 8}
    return "\n".join(aligned([[line[i] for i in kept] for line in lines], words))


def rows_csv(history: History) -> str:
    """A CSV line for each coefficient of each calibration."""
    head = "date result coefficient value u U unit E_n low high ewma ewma_limit"
    lines: list[Sequence[object]] = [head.split()]
    for course in history.courses:
        chart, series = course.chart, course.series
        numbers = (
            series.y,
            series.u,
            course.U,
            course.E_n,
            chart.low,
            chart.high,
            chart.ewma,
            chart.ewma_limit,
        )
        for day, identity, y, u, U, *more in zip(course.dates, course.ids, *numbers, strict=True):
            lines.append((day.isoformat(), identity, course.name, y, u, U, course.unit, *more))
    return csv_text(lines)


_COLUMNS = 150
"""Points of a curve."""


def pictures(history: History) -> list[Picture]:
    """A picture for each group of coefficients (K1, M, ...), those with an alarm at the last calibration first."""
    groups: dict[str, list[Course]] = {}
    for course in history.courses:
        groups.setdefault(group_of(course.name), []).append(course)

    def alarmed(courses: Sequence[Course]) -> bool:
        return any(c.chart.alarms[c.last] or c.chart.drift_alarms[c.last] for c in courses)

    ordered = sorted(groups.items(), key=lambda item: not alarmed(item[1]))
    return [_picture(name, courses, history) for name, courses in ordered]


def _picture(name: str, courses: Sequence[Course], history: History) -> Picture:
    """Coefficients of a group: values with charts of individuals at the left, EWMA at the right."""
    panels = []
    for k, course in enumerate(courses):
        begin = course.dates[0]
        first = begin.year + (begin.timetuple().tm_yday - 1) / YEAR
        last = first + max((history.at - begin).days / YEAR, float(course.series.t[-1]))
        over = Axis("year" if k == len(courses) - 1 else "", limits=_padded(first, last), few=True)
        up = Axis(course.unit, limits=_value_limits(course))
        value = Panel(_values(course, first, last), over, up, title=course.name, grid="y")
        ewma = Panel(
            _ewma(course, first), over, Axis("", limits=_ewma_limits(course)), title="EWMA", grid="y"
        )
        panels.append([value, ewma])
    of = term(courses[0].name)
    title = f"{name}: {of.name}" if of is not None and len(courses) == 1 else name
    return draw(
        title,
        "Left: calibrations with U, and the value with its U by the model of wandering (line and band), to the date "
        "for which it is predicted; dashes: limits for each calibration by those before it. Right: the EWMA of the "
        "deviations, in standard deviations of one; dashes: its limits. Red: alarms; where nothing changes, a point in "
        "370 is one by chance.",
        panels,
        0.35 + 1.15 * len(courses),
    )


def _padded(first: float, last: float) -> tuple[float, float]:
    """Limits of an axis, with a margin."""
    room = 0.03 * max(last - first, 0.1)
    return first - room, last + room


def _value_limits(course: Course) -> tuple[float, float]:
    """Limits of the axis of values: the calibrations and the expected value with their U, the specification if near."""
    ends = [course.series.y - course.U, course.series.y + course.U]
    if course.expected is not None:
        ends.append(course.expected.value + course.expected.U * np.array([-1.0, 1.0]))
    low, high = float(np.min(np.concatenate(ends))), float(np.max(np.concatenate(ends)))
    if course.conformity is not None:
        near = (high - low) or 1.0
        low = min(low, course.conformity.low) if low - course.conformity.low < near else low
        high = max(high, course.conformity.high) if course.conformity.high - high < near else high
    room = 0.08 * (high - low) or 1.0
    return low - room, high + room


def _values(course: Course, first: float, last: float) -> list[Mark]:
    """Marks of the values."""
    t, chart, marks = course.series.t + first, course.chart, list[Mark]()
    if course.wandering is not None:
        times = np.linspace(0.0, last - first, _COLUMNS)
        found = [course.wandering.at(float(each)) for each in times]
        middle, U = np.array([each.value for each in found]), np.array([each.U for each in found])
        marks += [Area(times + first, middle - U, middle + U, "by the model"), Line(times + first, middle)]
    for limit, label in ((chart.low, "limits"), (chart.high, "")):
        marks.append(Line(t, limit, label, QUIET, style="--"))
    marks += _points(t, course.series.y, chart.alarms, course.U, "calibration, U")
    if course.conformity is not None:
        marks += [
            Level(end, "specification" * (end == course.conformity.low), ALARM, style=":")
            for end in (course.conformity.low, course.conformity.high)
        ]
    return marks


def _points(t: Array, y: Array, alarms: Mask, U: Array | None, label: str) -> list[Mark]:
    """Points, those with an alarm in red."""
    marks: list[Mark] = []
    for chosen, colour, words in ((~alarms, COLOURS[0], label), (alarms, ALARM, "")):
        up = None if U is None else U[chosen]
        marks.append(Dots(t[chosen], y[chosen], words, colour, up=up))
    return marks


def _ewma(course: Course, first: float) -> list[Mark]:
    """Marks of the EWMA."""
    t, chart = course.series.t + first, course.chart
    marks: list[Mark] = [Line(t, sign * chart.ewma_limit, "", QUIET, style="--") for sign in (-1.0, 1.0)]
    return [*marks, Line(t, chart.ewma), *_points(t, chart.ewma, chart.drift_alarms, None, "")]


def _ewma_limits(course: Course) -> tuple[float, float]:
    """Limits of the axis of the EWMA: its own limits at least."""
    sizes = np.abs(course.chart.ewma)
    far = 1.15 * max(LIMITS.chart_sigmas / 3.0, float(np.nanmax(sizes)) if np.isfinite(sizes).any() else 0.0)
    return -far, far


def page(history: History, estimate: Estimate) -> str:
    """The page of a history: HTML that needs nothing but itself."""
    days = [day for course in history.courses for day in course.dates]
    facts = [
        ("instrument", "", history.instrument),
        ("calibrations", "", f"{len({each for course in history.courses for each in course.ids})}"),
        ("from", "", min(days).isoformat()),
        ("to", "", max(days).isoformat()),
    ]
    return template(
        "history.html",
        estimate,
        f"History of {history.instrument}",
        facts,
        pictures=pictures(history),
        at=history.at.isoformat(),
        rows=rows(history),
        sizes=[_in_words(course) for course in history.courses if course.wandering is not None],
        rule=next((c.conformity.rule for c in history.courses if c.conformity is not None), ""),
    )


def _in_words(course: Course) -> tuple[str, str, str, str]:
    """Name, random walk and noise of calibration of a coefficient, each as median and interval; the unit."""
    assert course.wandering is not None
    texts = []
    for sizes in (course.wandering.walk, course.wandering.noise):
        middle, low, high = course.wandering.range_of(sizes)
        texts.append(f"{middle:.2g} ({low:.2g} to {high:.2g})")
    return course.name, texts[0], texts[1], course.unit
