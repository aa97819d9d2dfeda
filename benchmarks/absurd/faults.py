"""What can be wrong with a recording: faults put into one that was simulated."""

from dataclasses import replace

import numpy as np

from inercal.foundation.records.read.table import LARGEST
from inercal.foundation.records.record import Record


def spoiled(record, draws, groups, most=3):
    """The record with up to so many faults in columns of the ``groups`` (lists of names), and their names in words.

    None where ``draws`` makes no absurd values, so that these recordings obey the model.
    """
    said = []
    while len(said) < most and draws.chance(min(2.0 * draws.wild, 0.7)):
        fault = draws.pick(*FAULTS)
        record = fault(record, draws, [name for name in draws.pick(*groups) if name in record.columns])
        said.append(fault.__name__)
    return record, said


def _changed(record, values, t=None):
    """The record with the values of some columns changed; all on one clock, and as it is once it was read."""
    t = next(iter(record.columns.values())).t if t is None else _read(t)
    columns = {
        name: replace(column, values=_read(values[name]) if name in values else column.values, t=t)
        for name, column in record.columns.items()
    }
    return Record(columns, record.findings, record.sources)


def _read(values):
    """Numbers as every reader takes them: what is beyond the largest is missing."""
    return np.where(np.abs(values) < LARGEST, values, np.nan)


def _one(draws, names):
    return [draws.pick(*names)] if names else []


def _some(draws, names):
    """One of the columns, or all."""
    return _one(draws, names) if draws.chance(0.6) else names


def _stretch(draws, n):
    """Rows of a stretch, or scattered rows."""
    if draws.chance(0.5):
        a, b = sorted(draws.rng.integers(0, n + 1, 2))
        return np.arange(a, b)
    return np.flatnonzero(draws.rng.random(n) < draws.pick(0.001, 0.05, 0.5, 0.99))


def _rows(record, kept):
    """The record with some of its rows."""
    t = next(iter(record.columns.values())).t
    return _changed(record, {name: each.values[kept] for name, each in record.columns.items()}, t[kept])


def _put(record, draws, names, make):
    """Values in some rows of columns changed by ``make(values)``."""
    values = {}
    for name in names:
        values[name] = record[name].values.copy()
        rows = _stretch(draws, len(values[name]))
        values[name][rows] = make(values[name][rows])
    return _changed(record, values)


def missing(record, draws, names):
    return _put(record, draws, _some(draws, names), lambda x: np.full_like(x, np.nan))


def spikes(record, draws, names):
    size = draws.log(1e-3, 1e9)
    return _put(record, draws, _some(draws, names), lambda x: x + size * draws.rng.standard_normal(len(x)))


def held(record, draws, names):
    return _put(record, draws, _some(draws, names), lambda x: np.full_like(x, x[0]) if len(x) else x)


def zero(record, draws, names):
    return _changed(record, {name: np.zeros_like(record[name].values) for name in _some(draws, names)})


def saturated(record, draws, names):
    def clipped(x):
        known = np.abs(x[np.isfinite(x)])
        limit = draws.rng.random() * known.max() if len(known) else 0.0
        return np.clip(x, -limit, limit)

    return _changed(record, {name: clipped(record[name].values) for name in _some(draws, names)})


def reversed_sign(record, draws, names):
    return _changed(record, {name: -record[name].values for name in _some(draws, names)})


def swapped(record, draws, names):
    if len(names) < 2:
        return record
    a, b = draws.rng.permutation(names)[:2]
    return _changed(record, {a: record[b].values, b: record[a].values})


def scaled(record, draws, names):
    by = draws.pick(57.29577951308232, 1e-3, 9.80665, 1e6, 1e-12, 1e150, 1e300, draws.log(1e-9, 1e9))
    with np.errstate(over="ignore"):
        return _changed(record, {name: by * record[name].values for name in _some(draws, names)})


def noise(record, draws, names):
    return _changed(
        record, {name: draws.rng.standard_normal(len(record[name].values)) for name in _some(draws, names)}
    )


def shifted(record, draws, names):
    by = int(draws.rng.integers(-3, 4))
    return _changed(record, {name: np.roll(record[name].values, by) for name in _some(draws, names)})


def offset(record, draws, names):
    by = draws.pick(-1.0, 1.0) * draws.log(1e-6, 1e12)
    return _changed(record, {name: record[name].values + by for name in _some(draws, names)})


def left_out(record, draws, names):
    if not names or names[0] not in record.columns:
        return record
    gone = set(_some(draws, names))
    columns = {name: each for name, each in record.columns.items() if name not in gone}
    return Record(columns, record.findings, record.sources) if columns else record


def gap(record, draws, names):
    n = len(next(iter(record.columns.values())).t)
    kept = np.setdiff1d(np.arange(n), _stretch(draws, n))
    return _rows(record, kept) if len(kept) else record


def few_rows(record, draws, names):
    n = len(next(iter(record.columns.values())).t)
    return _rows(record, np.arange(min(n, draws.pick(1, 2, 3, 9, 10, 11, 20))))


def later_start(record, draws, names):
    n = len(next(iter(record.columns.values())).t)
    return _rows(record, np.arange(int(draws.rng.integers(0, n)), n))


def time_scaled(record, draws, names):
    t = next(iter(record.columns.values())).t
    return _changed(record, {}, t * draws.pick(1e-9, 1e-3, 1e3, 1e9, 1e-200, 0.0, -1.0))


def time_offset(record, draws, names):
    t = next(iter(record.columns.values())).t
    return _changed(record, {}, t + draws.pick(1.7e9, -1e6, 1e12, 1e17))


def time_jitter(record, draws, names):
    t = next(iter(record.columns.values())).t
    step = np.median(np.diff(t)) if len(t) > 1 else 1.0
    return _changed(record, {}, t + draws.pick(0.1, 0.5, 3.0) * step * draws.rng.standard_normal(len(t)))


def time_missing(record, draws, names):
    t = next(iter(record.columns.values())).t.copy()
    t[_stretch(draws, len(t))] = np.nan
    return _changed(record, {}, t)


def jump(record, draws, names):
    t = next(iter(record.columns.values())).t.copy()
    if len(t):
        t[int(draws.rng.integers(len(t))) :] += draws.pick(1.0, 60.0, 1e6, 1e15, -1.0)
    return _changed(record, {}, t)


FAULTS = (
    missing,
    missing,
    spikes,
    spikes,
    held,
    held,
    zero,
    saturated,
    reversed_sign,
    swapped,
    scaled,
    scaled,
    noise,
    shifted,
    offset,
    left_out,
    gap,
    gap,
    few_rows,
    later_start,
    time_scaled,
    time_offset,
    time_jitter,
    time_missing,
    jump,
)
