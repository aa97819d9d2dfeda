"""Runs of equal values: stretches that are no data, values that stand several rows, and steps of an output."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.places import counted, counted_names, places


def erased(values: Array) -> NDArray[np.bool_]:
    """Rows (n,) of sensors' ``values`` (n, c) in stretches that repeat one row, as erased memory or a dead link does.

    A stretch counts if it is far longer than those that coarse outputs, or outputs written several times, have
    elsewhere, and if what is elsewhere is noisy: a rest in a simulation without noise is one row, too.
    """
    lengths = _runs(values)
    out = np.zeros(len(values), dtype=bool)
    if not len(lengths) or lengths.max() < LIMITS.erased_rows:
        return out
    short = lengths[lengths < LIMITS.erased_rows]
    usual = float(np.quantile(short, 0.95)) if len(short) else float(lengths.max())
    long = lengths > max(LIMITS.erased_rows, LIMITS.erased_ratio * usual)
    if lengths[~long].sum() < LIMITS.erased_rows:
        return out
    starts = np.cumsum(lengths) - lengths
    return np.repeat(long, lengths) if _noisy(values[starts[~long]]) else out


def _noisy(values: Array) -> bool:
    """True where neighbours of values (n, c) in some column are no smooth motion."""
    told = values[:, np.isfinite(values).sum(axis=0) > LIMITS.erased_rows]
    told = told[np.isfinite(told).all(axis=1)]
    if len(told) < LIMITS.fewest_runs:
        return False
    once, twice = (np.median(np.abs(np.diff(told, k, axis=0)), axis=0) for k in (1, 2))
    return bool(np.any(twice > LIMITS.noisy_steps * once))


def held(values: Array) -> float:
    """Rows for which each of the ``values`` (n,) stands all along; 1 where they do not stand.

    By chance coarse values stand, too, but for one row as often as for two.
    """
    lengths = _runs(values[:, None])[1:-1]
    if len(lengths) < LIMITS.fewest_runs:
        return 1.0
    usual = float(np.median(lengths))
    if usual < 2.0 or np.mean(lengths < np.floor(usual)) > LIMITS.short_runs:
        return 1.0
    whole = np.maximum(np.rint(lengths / usual), 1.0)
    return float(lengths.sum() / whole.sum())


def once(values: Array, rows: float) -> NDArray[np.int64]:
    """Places of values (n,) that stand for so many ``rows`` each, one for each time that they were measured."""
    lengths = _runs(values[:, None])
    starts = np.cumsum(lengths) - lengths
    times = np.maximum(np.rint(lengths / rows), 1.0).astype(np.int64)
    return np.asarray(np.repeat(starts, times))


def coarse_step(values: Array) -> float:
    """Step of an output at rest whose noise is less than that step, so that rounding is no noise; 0 for any other."""
    moves = np.abs(np.diff(values[np.isfinite(values)]))
    if not moves.any():
        return 0.0
    step = float(np.min(moves, where=moves > 0.0, initial=np.inf))
    return step if np.sqrt(0.5 * np.mean((moves / step) ** 2)) < LIMITS.coarse_noise else 0.0


def of_stretches(values: Array, names: list[str]) -> list[Finding]:
    """``no_data`` of sensors' columns (n, c) of one clock, by their ``names``."""
    rows = np.flatnonzero(erased(values))
    if not rows.size:
        return []
    return [
        Finding(
            "no_data",
            f"{counted_names(names, 2)}: {counted(rows.size, 'row')} repeat one row, and are no data.",
            places("row", rows + 1),
            tuple(names),
            action="Leave them out with --begin and --end, or take them out of the file.",
        )
    ]


def _runs(values: Array) -> NDArray[np.int64]:
    """Lengths of the runs of equal rows of values (n, c); none where a row lacks a value."""
    if len(values) < 2:
        return np.zeros(0, dtype=np.int64)
    same = (values[1:] == values[:-1]) | (np.isnan(values[1:]) & np.isnan(values[:-1]))
    starts = np.concatenate([[0], np.flatnonzero(~same.all(axis=1)) + 1])
    return np.diff(np.append(starts, len(values)))
