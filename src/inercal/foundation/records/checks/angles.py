"""Checks of angles: full turns, encoders that stand still, commands that are shifted in time.

The chain of axes that the angles belong to is not known here, so only what holds for any chain is used: the
rate of the innermost body is at most the sum of the rates about the axes. Angles may be in any unit of angle;
raw counts are not looked at.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import of_a_table
from inercal.foundation.records.checks.values import known, plateaus
from inercal.foundation.records.column import Column, counted_rows
from inercal.foundation.records.places import counted, places

_ANGLE = re.compile(r"phi[123]|th_[xyz]|theta_ref")
_TURN = 2.0 * np.pi
_DEG = np.pi / 180.0
_GIMBALS = ("th_x", "th_y", "th_z")
_LOOK = "Look at the encoder and how it is read, and take these rows again or out."


def angle_findings(columns: Mapping[str, Column]) -> list[Finding]:
    """``wrap_2pi``, ``stuck_encoder`` and ``command_shift``; nothing where a row is a position of a table."""
    if _positions(columns):
        return []
    findings: list[Finding] = []
    for column in columns.values():
        if _ANGLE.fullmatch(column.name) and column.unit.dimension == "angle":
            position = columns.get("position")
            findings += wraps(column, None if position is None else position.values)
            findings += frozen(column)
    for sensor in ("wc", "gyro"):
        if (whole := _gimbals(columns, sensor)) is not None:
            rows, t, th, rate = whole
            shifted = command_shift(t, th, rate) if sensor == "wc" else []
            return findings + (shifted or stuck(rows, t, th, rate, biased=sensor == "gyro"))
    return findings


def _positions(columns: Mapping[str, Column]) -> bool:
    """True where a row is not a sample but a position of a table: rows are counted, or 1 s apart or more."""
    if not of_a_table(columns):
        return False
    steps = np.concatenate([np.diff(column.t) for column in columns.values()])
    return counted_rows(columns) or bool(2 * np.count_nonzero(steps >= 1.0) > steps.size)


def wraps(column: Column, position: Array | None = None) -> list[Finding]:
    """``wrap_2pi``: neighbouring samples a full turn apart, where those around them are close to each other.

    Close means modulo full turns, by at most 5 deg, and the jump is a full turn but for twice that and 1 deg: a
    table that steps from position to position of its plan does not do that, and rows of different ``position``
    numbers are not compared. Jumps across missing samples are not found.
    """
    angle, rows = known(column.si())
    if angle.size < 6:
        return []
    step = np.diff(angle)
    turns = np.rint(step / _TURN)
    slow = np.abs(step - _TURN * turns)
    padded = np.pad(slow, 2)
    near = np.maximum.reduce([padded[k : k + slow.size] for k in (0, 1, 3, 4)])
    wrapped = (turns != 0) & (near <= 5.0 * _DEG) & (slow <= 2.0 * near + _DEG) & (np.diff(rows) == 1)
    dt = np.diff(column.t[rows])
    wrapped &= ~(dt > 1.5 * np.median(dt))
    if position is not None and len(position) == len(column.values):
        wrapped &= np.diff(position[rows]) == 0
    if not wrapped.any():
        return []
    text = f"{column.name}: {counted(int(np.count_nonzero(wrapped)), 'jump')} by a full turn"
    return [Finding("wrap_2pi", text, places("row", rows[1:][wrapped] + 1))]


def frozen(column: Column) -> list[Finding]:
    """``stuck_encoder``: an angle in steady motion keeps one value for six samples or more, then catches up.

    The ten steps before and the ten after go the same way, as those of motion do, and the step after the
    standstill makes up for it to 30 %. An encoder coarser than the motion from sample to sample is not looked at,
    nor one that is read less often than its rows are written.
    """
    angle, rows = known(column.si())
    step = np.diff(angle)
    step = step - _TURN * np.rint(step / _TURN)
    starts, ends = plateaus(step)
    long = (ends - starts >= 5) & (starts >= 10) & (ends + 10 < step.size)
    starts, ends = starts[long], ends[long]
    leap = np.abs(step[ends]) > 3.0 * np.maximum(np.abs(step[starts - 1]), np.abs(step[ends + 1]))
    standstills = []
    for start, end in zip(starts[leap], ends[leap], strict=True):
        around = np.concatenate([step[start - 10 : start], step[end + 1 : end + 11]])
        rate = float(np.median(around))
        steady = np.abs(around - rate).max() < 0.5 * abs(rate)
        lost = (end - start + 1) * rate
        if steady and abs(step[end] - lost) < 0.3 * abs(lost):
            standstills.append(np.arange(start, end + 1))
    if not standstills:
        return []
    text = f"{column.name}: stands still {counted(len(standstills), 'time')} amid steady motion, then catches up."
    where = places("row", rows[np.concatenate(standstills)] + 1)
    return [Finding("stuck_encoder", text, where, (column.name,), action=_LOOK)]


def stuck(rows: NDArray[np.int64], t: Array, th: Array, rate: Array, biased: bool) -> list[Finding]:
    """``stuck_encoder``: no gimbal angle moves while the platform turns by 5 deg or more.

    Rates are means over about a second. Where the platform turns faster than a limit, 0.1 deg/s by command or
    1 deg/s by gyro, at least one of three axes turns at a third of it; none at a tenth is a standstill. One
    encoder of three is found so where its axis turns alone.

    ``rows`` (n,) of the record count from 0, ``t`` (n,) is in s; ``th`` (n, 3) [rad] are all angles of the gimbals,
    ``rate`` (n, 3) [rad/s] is that of the platform about any axes of its own. ``biased`` is true for a gyro: its rate
    counts from the median over the standstill, and a standstill in which the platform turns for most of the time is not
    found.
    """
    limit = (1.0 if biased else 0.1) * _DEG
    size = max(1, round(min(1.0 / np.median(np.diff(t)), len(t))))
    count = len(t) // size
    if count < 3:
        return []

    def mean(x: Array) -> Array:
        return np.asarray(x[: count * size].reshape(count, size, -1).mean(axis=1))

    dt = np.diff(mean(t)[:, 0])
    speed = np.abs(np.diff(mean(np.unwrap(th, axis=0)), axis=0)).max(axis=1) / dt
    still = np.maximum(np.append(speed, 0.0), np.append(0.0, speed)) < 0.1 * limit
    # at the ends one neighbour is not known: a swing about its turning point has two equal means
    still[0], still[-1] = still[0] and still[1], still[-1] and still[-2]
    rate = mean(rate)
    turns_missed = []
    for stay in _runs(still):
        centre = np.median(rate[stay], axis=0) if biased else 0.0
        away = np.linalg.norm(rate[stay] - centre, axis=1)
        turns_missed += [
            stay[turn] for turn in _runs(away > limit) if away[turn].sum() * np.median(dt) >= 5.0 * _DEG
        ]
    if not turns_missed:
        return []
    at = np.concatenate([rows[turn[0] * size : (turn[-1] + 1) * size] for turn in turns_missed])
    who = "gyro" if biased else "command"
    text = f"th: no angle moves while the platform turns according to the {who}."
    return [Finding("stuck_encoder", text, places("row", at + 1), _GIMBALS, action=_LOOK)]


def command_shift(t: Array, th: Array, command: Array) -> list[Finding]:
    """``command_shift``: the gimbals start and stop later or earlier than commanded, by two rows or more.

    What is compared is whether the platform moves: the size of the commanded rate and that of the rates of the
    angles, both cut off at half the usual commanded rate, for the chain changes one into the other. A shift is
    said where the two then match (correlation above 0.95) at least twice as well as without it. Motion that never
    rests, or never stops, and rows at uneven times are not looked at, nor shifts of more than 30 s or a quarter
    of the recording.

    Parameters
    ----------
    t : (n,) s
    th : (n, 3) rad, all angles of the gimbals
    command : (n, 3) rad/s, of the platform, from a row to the next
    """
    step = np.diff(t)
    dt = float(np.median(step))
    if np.abs(step - dt).max() > 0.5 * dt:
        return []
    commanded = np.linalg.norm(command[:-1], axis=1)
    moved = np.linalg.norm(np.diff(np.unwrap(th, axis=0), axis=0), axis=1) / dt
    moving = commanded > 0.1 * _DEG
    if not 0.02 < moving.mean() < 0.98:
        return []
    level = 0.5 * np.median(commanded[moving])
    box = np.ones(max(1, round(0.5 / dt)))
    x, y = (np.minimum(np.convolve(a, box / box.size, "same"), level) for a in (commanded, moved))
    most = min(len(x) // 4, round(30.0 / dt))
    lags = np.arange(-most, most + 1)
    size = 2 * len(x)
    cross = np.fft.irfft(np.fft.rfft(y - y.mean(), size) * np.conj(np.fft.rfft(x - x.mean(), size)), size)
    lag = int(lags[np.argmax(cross[lags])])
    match, plain = _correlation(x, y, lag), _correlation(x, y, 0)
    if abs(lag) < 2 or not match > 0.95 or not 1.0 - match < 0.5 * (1.0 - plain):
        return []
    how = "follow" if lag > 0 else "run ahead of"
    text = f"th: the angles {how} the commanded rates by {abs(lag) * dt:.4g} s."
    return [
        Finding("command_shift", text, harm=_GIMBALS, action="Shift the times of commands or angles by that.")
    ]


def _correlation(x: Array, y: Array, lag: int) -> float:
    """Of x (n,) with y (n,) that comes ``lag`` rows later."""
    x, y = (x[: len(x) - lag], y[lag:]) if lag >= 0 else (x[-lag:], y[:lag])
    return float(np.corrcoef(x, y)[0, 1])


def _runs(true: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Indices of each run of True."""
    at = np.flatnonzero(true)
    return [run for run in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1) if run.size]


def _gimbals(
    columns: Mapping[str, Column], sensor: str
) -> tuple[NDArray[np.int64], Array, Array, Array] | None:
    """Rows (from 0) of which all is known, their time (n,), angles (n, 3) and rates (n, 3) of a sensor, in SI.

    None where not all are there, on one clock that goes forward.
    """
    names = [f"{each}_{axis}" for each in ("th", sensor) for axis in "xyz"]
    present = [columns[name] for name in names if name in columns]
    dimensions = [column.unit.dimension for column in present]
    if dimensions != ["angle"] * 3 + ["rate"] * 3 or any(column.t is not present[0].t for column in present):
        return None
    table = np.column_stack([present[0].t, *(column.si() for column in present)])
    rows = np.flatnonzero(np.isfinite(table).all(axis=1))
    table = table[rows]
    if len(table) < 50 or not np.median(np.diff(table[:, 0])) > 0:
        return None
    return rows, table[:, 0], table[:, 1:4], table[:, 4:]
