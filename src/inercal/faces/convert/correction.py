"""A calibration applied to a recording: outputs to truth, and back, with what the results are uncertain by."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from inercal.faces.convert.motion import interval
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import Unit, parse_unit

Samples = Mapping[str, Array]
"""Samples (*batch,) by column."""

BLOCK = 1 << 16
"""Rows that are corrected at a time, so that long records need no more memory than they take."""

TEMPERATURE_MARGIN = 5.0
"""Kelvin beyond 3 u of the temperature of a calibration at which a recording is said to be at another one."""


RANGE_MARGIN = 0.05
"""Part of a range that a calibration was made over by which samples may lie beyond it before that is said."""


def widened(low: float, high: float, unit: str) -> tuple[float, float, str]:
    """A range of `Correction`, with its margin."""
    more = RANGE_MARGIN * (high - low)
    return low - more, high + more, unit


@dataclass(frozen=True)
class Correction:
    """Correction of columns of a record, or its inverse, sample by sample.

    ``work`` takes samples (*batch,) of the columns in ``reads``, each as ``factor * value + zero``, and gives those of
    all that is written; the digits of a sample do not depend on those beside it. ``writes`` has name and unit of the
    column that takes the place of another, ``appends`` name and unit of those behind the others. ``settings`` is all
    that decides the results, ``findings`` name what the record does not hold, so that it is not corrected for, and
    ``ranges`` has the lowest and highest value of the calibration (as ``work`` has it) of a column, and their unit.

    With a ``reach`` ``work`` takes rows one after the other, with stamps ``t`` and their usual ``step`` [s], of which
    it says how many rows before and behind a row it needs. It then also gives ``applied``, 0 for rows whose neighbours
    have uneven stamps, so that they are corrected each by itself.
    """

    work: Callable[[Samples], Samples]
    reads: Mapping[str, tuple[float, float]]
    writes: Mapping[str, tuple[str, Unit]]
    settings: Mapping[str, object]
    appends: Mapping[str, Unit] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    ranges: Mapping[str, tuple[float, float, str]] = field(default_factory=dict)
    reach: Callable[[float], int] | None = None

    def __call__(self, samples: Samples) -> Samples:
        """All columns written, and those read as ``work`` has them, for samples in the units of the record."""
        taken = {}
        for name, (factor, zero) in self.reads.items():
            taken[name] = samples[name] * factor
            if zero:
                taken[name] = taken[name] + zero
        if self.reach is not None:
            taken |= {"t": samples["t"], "step": samples["step"]}
        return {**taken, **self.work(taken)}

    def rows(self, step: float) -> int:
        """Rows before and behind a row that its correction needs, of samples every ``step`` [s]."""
        return self.reach(step) if self.reach is not None and np.isfinite(step) else 0

    def outside(self, results: Samples) -> tuple[Finding, ...]:
        """``outside_range``: results of a call that lie beyond what the calibration was made over."""
        findings = []
        if "applied" in results and (left := int(np.sum(np.asarray(results["applied"]) == 0.0))):
            text = (
                f"{counted(left, 'row')} beside uneven steps of time: places of the accelerometers and delay are not "
                "applied there"
            )
            findings.append(Finding("not_held", text))
        for name, (low, high, unit) in self.ranges.items():
            values = np.asarray(results[name])
            beyond = int(np.sum((values < low) | (values > high)))
            if beyond:
                text = (
                    f"{name} goes from {np.nanmin(values):.4g} to {np.nanmax(values):.4g} {unit}, and the calibration "
                    f"holds from {low:.4g} to {high:.4g}: there the corrected values are extrapolated"
                )
                findings.append(Finding("outside_range", text))
        return tuple(findings)


class CalibratedInstrument(Protocol):
    """An instrument that a calibration describes."""

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record, whose columns may be without samples yet; raises `InputError`."""


@dataclass(frozen=True)
class Uncertain:
    """A ``model``, and the same with its coefficients moved up and down along each axis of their covariance.

    The standard uncertainty of a corrected value is the root of the sum of its squared changes: the covariance of the
    coefficients propagated to first order (GUM 5.2), whatever the model. Noise of the sample itself is not in it.
    """

    model: CalibratedInstrument
    moved: tuple[tuple[CalibratedInstrument, CalibratedInstrument], ...]

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of the model, with a column ``u_`` for each that it writes."""
        central = self.model.correction(record, invert)
        pairs = [(up.correction(record, invert), down.correction(record, invert)) for up, down in self.moved]
        units = {f"u_{name}": unit for name, unit in central.writes.values()}

        def work(samples: Samples) -> Samples:
            results = dict(central.work(samples))
            squares = {name: np.zeros(np.shape(results[name])) for name, _ in central.writes.values()}
            for up, down in pairs:
                high, low = up.work(samples), down.work(samples)
                for name, square in squares.items():
                    squares[name] = square + np.square(0.5 * (high[name] - low[name]))
            for name, square in squares.items():
                u = np.sqrt(square)
                results[f"u_{name}"] = np.where(np.isfinite(results[name]), u, np.nan)
            return results

        return replace(
            central, work=work, appends=units, settings={**central.settings, "uncertainty": len(pairs)}
        )


def uncertain(
    make: Callable[[Estimate], CalibratedInstrument], estimate: Estimate, where: object = "calibration"
) -> Uncertain:
    """The model that ``make`` makes of an estimate, with its uncertainty.

    Raises `InputError`: the estimate has no covariance, as one that another tool wrote.
    """
    u = estimate.u
    if not np.isfinite(estimate.covariance).all() or not u.any():
        raise InputError(where, "states no uncertainty of its coefficients, expected one for that of values")
    scale = np.where(u > 0.0, u, 1.0)
    lengths, axes = np.linalg.eigh(estimate.covariance / np.outer(scale, scale))
    steps = scale[:, None] * axes * np.sqrt(np.maximum(lengths, 0.0))
    taken = steps[:, lengths > 1e-12 * lengths[-1]].T
    moved = tuple(
        (make(replace(estimate, values=estimate.values + step)), make(replace(estimate, values=estimate.values - step)))
        for step in taken
    )  # fmt: skip
    return Uncertain(make(estimate), moved)


def apply_to(record: Record, model: CalibratedInstrument, invert: bool = False) -> Record:
    """Correct the columns of a record that a model covers, all others unchanged; raises as
    `CalibratedInstrument.correction` does.

    With ``invert`` the record holds true values and the outputs of the instrument are made of them. What of it is not
    corrected, or lies outside the range of the calibration, is among the findings.
    """
    correct = model.correction(record, invert)
    some = record[next(iter(correct.writes))]
    results = _in_blocks(record, correct, some)
    columns = {}
    for name, column in record.columns.items():
        new, unit = correct.writes.get(name, (name, column.unit))
        if name in correct.writes:
            column = Column(new, unit, results[new], column.t, column.source)
        columns[new] = column
    for name, unit in correct.appends.items():
        columns[name] = Column(name, unit, results[name], some.t, some.source)
    findings = (*record.findings, *correct.findings, *correct.outside(results))
    return Record(columns, findings, record.sources, record.labels)


def _in_blocks(record: Record, correct: Correction, some: Column) -> Samples:
    """Results of a correction for all rows, a block after the other; ``some`` is a column that is written."""
    rows, step = len(some.values), interval(some.t)
    reach, blocks = correct.rows(step), []
    for begin in range(0, max(rows, 1), BLOCK):
        first, last = max(begin - reach, 0), min(begin + BLOCK + reach, rows)
        samples = {name: record[name].values[first:last] for name in correct.reads}
        if correct.reach is not None:
            samples |= {"t": some.t[first:last], "step": np.array(step)}
        own = slice(begin - first, begin - first + BLOCK)
        blocks.append({name: np.atleast_1d(x)[own] for name, x in correct(samples).items() if name != "step"})
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def one_clock(record: Record, names: Sequence[str]) -> None:
    """Refuse columns that do not go together row by row; raises `InputError`."""
    first = record[names[0]]
    for name in names[1:]:
        column = record[name]
        if column.t is not first.t and not np.array_equal(column.t, first.t):
            raise InputError(
                column.source.path, f"{name} and {first.name} have different clocks, expected one"
            )


def factor_of(column: Column, wanted: Unit, of: str) -> tuple[float, float]:
    """Factor and zero by which a column is taken to ``wanted``; raises `InputError`, saying what it is ``of``.

    The factor is exactly 1 for one and the same unit.
    """
    if column.unit.dimension != wanted.dimension:
        raise InputError(
            column.source.path,
            f"{column.name} is in {column.unit.symbol}, expected {wanted.symbol} {of}".rstrip(),
        )
    return column.unit.factor / wanted.factor, (column.unit.zero - wanted.zero) / wanted.factor


def range_of(estimate: Estimate, name: str, where: object, axes: tuple[int, ...] = ()) -> Array | None:
    """Least and largest values (2, *axes) of what a calibration was made over; None where it does not say.

    Raises `InputError`: what stands there are no such numbers.
    """
    ranges = estimate.conditions.get("ranges") or {}
    try:
        if name not in ranges:
            return None
        ends = np.array(ranges[name], dtype=float)
    except (TypeError, ValueError):
        ends = np.empty(0)
    if ends.shape != (2, *axes):
        raise InputError(
            where, f"conditions.ranges.{name} is not two values, expected the least and the largest"
        )
    return ends


def temperature_range(estimate: Estimate) -> tuple[float, float, str] | None:
    """Lowest and highest temperature [degC] for which a calibration was made; None where it does not say."""
    ends = range_of(estimate, "temperature_degC", "calibration")
    if ends is not None:
        return float(ends[0]), float(ends[1]), "degC"
    stated = estimate.conditions.get("temperature")
    if not stated:
        return None
    half = 3.0 * float(stated.get("u") or 0.0) + TEMPERATURE_MARGIN
    return float(stated["value"]) - half, float(stated["value"]) + half, "degC"


def watching(correct: Correction, record: Record, span: tuple[float, float, str] | None) -> Correction:
    """The correction, which also reads the temperature where record and calibration both have one."""
    column = record.columns.get("temperature")
    if span is None or column is None or column.unit.dimension != "temperature":
        return correct
    first = record[next(iter(correct.writes))]
    if column.t is not first.t and not np.array_equal(column.t, first.t):
        return correct
    read = {"temperature": factor_of(column, parse_unit("degC"), "")}
    return replace(correct, reads={**correct.reads, **read}, ranges={**correct.ranges, "temperature": span})
