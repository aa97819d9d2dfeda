"""A recording, shown: numbers, a line of blocks, figures, and a page of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from inercal.faces.report.html import Picture, page
from inercal.faces.report.marks import Axis, Line, Mark, Note, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, envelope, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column, counted_rows
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table

_BLOCKS = "▁▂▃▄▅▆▇█"
_ROWS = re.compile(r"(?:.*, )?rows? ((?:\d+(?:-\d+)?(?:, )?)+)")


@dataclass(frozen=True)
class ChannelSummary:
    """A channel in numbers.

    ``samples`` counts all rows and ``missing`` those that hold no finite number; ``rate`` [Hz] is the median
    one, NaN where rows have no time stamps and are counted; ``mean``, ``deviation`` (standard deviation),
    ``minimum`` and ``maximum`` are in ``unit``. What cannot be said is NaN.
    """

    name: str
    unit: str
    samples: int
    missing: int
    rate: float
    mean: float
    deviation: float
    minimum: float
    maximum: float


def summary(record: Record) -> tuple[ChannelSummary, ...]:
    """The channels of a record in numbers, in the order they were read."""
    clocks = {id(column.t): column.t for column in record.columns.values()}
    counted = counted_rows(record.columns)
    rates = {key: float("nan") if counted else _rate(t) for key, t in clocks.items()}
    return tuple(_summary(column, rates[id(column.t)]) for column in record.columns.values())


@np.errstate(over="ignore", invalid="ignore")
def norms(record: Record) -> tuple[ChannelSummary, ...]:
    """The length of each whole triad of accelerometers or gyros in numbers: at rest that of ``acc`` is gravity."""
    counted = counted_rows(record.columns)
    summaries = []
    for sensor in ("acc", "gyro"):
        axes = [record.columns[name] for axis in "xyz" if (name := f"{sensor}_{axis}") in record.columns]
        x = axes[0] if len(axes) == 3 else None
        if x is None or any(axis.t is not x.t or axis.unit != x.unit for axis in axes):
            continue
        length = replace(x, name=f"|{sensor}|", values=np.linalg.norm([axis.values for axis in axes], axis=0))
        summaries.append(_summary(length, float("nan") if counted else _rate(x.t)))
    return tuple(summaries)


def channels_table(record: Record) -> Table:
    """The channels of a record and the norms of its triads, for people."""
    rows = [(row, sparkline(record[row.name].values)) for row in summary(record)]
    rows += [(row, "") for row in norms(record)]
    heads = ("samples", "missing"), ("mean", "sd", "min", "max")
    columns = (
        *((name, "") for name in ("channel", "", "unit", *heads[0])),
        ("rate", "Hz"),
        *((name, "") for name in heads[1]),
    )
    cells = tuple(
        (
            row.name,
            line,
            row.unit,
            str(row.samples),
            str(row.missing),
            "–" if np.isnan(row.rate) else f"{row.rate:.5g}",
            *(
                "–" if np.isnan(x) else f"{x:.{digits}g}"
                for x, digits in ((row.mean, 6), (row.deviation, 3), (row.minimum, 6), (row.maximum, 6))
            ),
        )
        for row, line in rows
    )
    return Table("Channels", "", columns, cells, 3)


@np.errstate(over="ignore", invalid="ignore")
def _summary(column: Column, rate: float) -> ChannelSummary:
    """One channel in numbers."""
    finite = column.values[np.isfinite(column.values)]
    numbers = (
        finite.mean() if finite.size else np.nan,
        finite.std(ddof=1) if finite.size > 1 else np.nan,
        finite.min() if finite.size else np.nan,
        finite.max() if finite.size else np.nan,
    )
    total = len(column.values)
    return ChannelSummary(
        column.name, column.unit.symbol, total, total - finite.size, rate, *(float(x) for x in numbers)
    )


@np.errstate(over="ignore", invalid="ignore")
def _rate(t: Array) -> float:
    """Median sample rate [Hz] of the stamps that go forward; NaN if none does."""
    steps = np.diff(t)
    steps = steps[np.isfinite(steps) & (steps > 0)]
    return float(1.0 / np.median(steps)) if steps.size else float("nan")


def sparkline(values: Array, width: int = 24) -> str:
    """A signal as a line of at most ``width`` blocks, each the mean of a piece of it.

    A piece without a number is a space; a signal that never changes runs at half height.

    Examples
    --------
    >>> sparkline(np.array([0.0, 1.0, 2.0, np.nan, 7.0]))
    '▁▂▃ █'
    """
    finite = np.isfinite(values)
    size = float(np.max(np.abs(values), initial=0.0, where=finite))
    if not finite.any():
        return " " * min(width, len(values))
    edges = np.linspace(0, len(values), min(width, len(values)), endpoint=False).astype(np.int64)
    sums = np.add.reduceat(np.where(finite, values, 0.0) / (size or 1.0), edges)
    counts = np.add.reduceat(finite.astype(float), edges)
    means = np.divide(sums, counts, out=np.full(len(edges), np.nan), where=counts > 0)
    low, high = np.nanmin(means), np.nanmax(means)
    height = (means - low) / (high - low) if high > low else np.where(counts > 0, 0.5, np.nan)
    return "".join(
        " " if np.isnan(h) else _BLOCKS[min(int(h * len(_BLOCKS)), len(_BLOCKS) - 1)] for h in height
    )


def inspection_pictures(record: Record) -> list[Picture]:
    """One picture for each sensor of a record: its channels over time, with the findings that have a place."""
    sensors: dict[str, list[Column]] = {}
    for column in record.columns.values():
        sensors.setdefault(column.sensor, []).append(column)
    axis = "row, counted from 0" if counted_rows(record.columns) else "time [s]"
    return [_picture(sensor, columns, record.findings, axis) for sensor, columns in sensors.items()]


def _picture(sensor: str, columns: Sequence[Column], findings: Sequence[Finding], axis: str) -> Picture:
    """The channels of one sensor above each other, over an ``axis`` of that title."""
    panels = []
    for k, column in enumerate(columns):
        marks: list[Mark] = [Line(*envelope(column.t, column.values), "", COLOURS[k % len(COLOURS)], 0.6)]
        for number, (begin, end) in _marks(column, findings):
            marks.append(Strips((begin, end), ALARM, 0.25, edge=0.8))
            marks.append(Note((begin, 1.0), f"{number}", ALARM, ha="center", va="bottom", of_panel="y"))
        across = Axis(axis if k == len(columns) - 1 else "", margin=0.005)
        panels.append([Panel(marks, across, Axis(f"{column.name}\n[{plain_unit(column.unit.symbol)}]"))])
    return draw(
        sensor,
        "Channels as they were read; where there are more samples than fit, the least and greatest values of "
        "pieces of the recording. Red: findings, by their number.",
        panels,
        0.5 + 1.15 * len(columns),
    )


def _marks(column: Column, findings: Sequence[Finding]) -> list[tuple[int, tuple[float, float]]]:
    """Number and time span of the findings about a column, for each place they name."""
    subjects = (column.name, "t", f"t of {Path(column.source.path).name}")
    marks = []
    for number, finding in enumerate(findings, 1):
        rows = _ROWS.match(finding.where)
        if rows is None or finding.message.partition(":")[0] not in subjects:
            continue
        for first, last in re.findall(r"(\d+)(?:-(\d+))?", rows[1]):
            stamps = column.t[int(first) - 1 : int(last or first)]
            stamps = stamps[np.isfinite(stamps)]
            if stamps.size:
                marks.append((number, (float(stamps.min()), float(stamps.max()))))
    return marks


def render_inspection(record: Record, estimate: Estimate, pictures: Sequence[Picture]) -> str:
    """The page of a recording: its findings, channels in numbers (see `summary`) and pictures.

    Returns
    -------
    str
        HTML that needs nothing but itself.
    """
    files = ", ".join(Path(source.path).name for source in record.sources)
    return page(
        "inspection.html",
        estimate,
        f"Recording {files}".strip(),
        (),
        rows=(*summary(record), *norms(record)),
        pictures=pictures,
    )
