"""The table during a test: its angles over time, where it rests, and how its errors turn the instrument."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.chain import Chain, Error, Scope
from inercal.foundation.rigs.patterns import Numbers
from inercal.systems.imu.limits import LIMITS

_FACTORS = ((1.0, ""), (180.0 / np.pi, "57.3 times as large"), (np.pi / 180.0, "57.3 times as small"))


@dataclass(frozen=True, eq=False)
class TableMotion:
    """Angles (m, joints) [rad] of the chain's joints at times ``t`` (m,) [s], without jumps at full turns.

    ``findings`` say which readings were left out.
    """

    words: ClassVar[str] = "the table's angles"

    chain: Chain
    t: Array
    angles: Array
    path: str
    findings: tuple[Finding, ...] = ()

    def at(self, t: Array) -> Array:
        """Angles (*t.shape, joints) [rad]; held beyond the ends.

        By cubics through neighbouring angles: straight lines would cut the corners of every turn, and a rate that
        is always found too small or too large is a scale factor.
        """
        return np.asarray(self._cubics(np.clip(t, self.t[0], self.t[-1])))

    @cached_property
    def _cubics(self) -> Callable[[Array], Array]:
        """TemperaturePolynomial through each pair of angles, with the slopes of parabolas through three."""
        from scipy.interpolate import CubicHermiteSpline

        slopes = np.gradient(self.angles, self.t, axis=0, edge_order=1)
        return CubicHermiteSpline(self.t, self.angles, slopes)

    def attitude(self, t: Array) -> Array:
        """Nominal attitude C_nb (*t.shape, 3, 3)."""
        return self._nominal.attitude(self.at(t))

    @cached_property
    def _nominal(self) -> Chain:
        """The table without its errors."""
        return Chain(tuple(each for each in self.chain.elements if not isinstance(each, Error)))

    def positions(self, t: Array) -> Array:
        """Angles (n, joints) [rad] of the chain at times ``t`` (n,)."""
        return self.at(t)

    def turned(self, by: float) -> Array:
        """Sizes (m, joints) [rad] of the turns from half of ``by`` [s] before each of the times to half of it after."""
        return np.asarray(np.abs(self.at(self.t + 0.5 * by) - self.at(self.t - 0.5 * by)))

    @property
    def travel(self) -> float:
        """Largest angle [rad] between two attitudes about one axis."""
        return float(np.max(np.ptp(self.angles, axis=0)))

    def turns_by_errors(self, t: Array) -> Array:
        """Turns (n, k, 3) [rad/rad] of the instrument, in its own axes, by each error of the chain."""
        turned = np.einsum("nji,nkjl->nkil", self.attitude(t), self.chain.slopes(self.at(t)))
        return np.stack([turned[..., 2, 1], turned[..., 0, 2], turned[..., 1, 0]], axis=-1)

    def place(self, t: float) -> dict[str, list[float]]:
        """The angles at a time, for a table."""
        return {"angles_rad": self.at(np.array(t)).tolist()}

    @property
    def curves(self) -> tuple[Sequence[str], Array, str]:
        """Names, values (m, k) and axis of what a picture shows of it."""
        return self.chain.joints, np.degrees(self.angles), "angle [deg]"

    def seen_by(self, sensor: str) -> TableMotion:
        """The motion that the outputs of a sensor are compared with."""
        return self

    def readings(self) -> Iterator[tuple[str, TableMotion]]:
        """Other readings of the angles, in words, and what they say."""
        joints = self.chain.joints
        for factor, size in _FACTORS:
            for order in itertools.permutations(range(len(joints))):
                for signs in itertools.product((1.0, -1.0), repeat=len(joints)):
                    texts = []
                    if size:
                        texts.append(f"the angles are {size} (check whether they are in deg or rad)")
                    if order != tuple(range(len(joints))):
                        texts.append(f"the columns {', '.join(joints)} are exchanged")
                    wrong = [name for name, sign in zip(joints, signs, strict=True) if sign < 0.0]
                    if wrong:
                        texts.append(f"the sign of {' and '.join(wrong)} is reversed")
                    if texts and len(texts) < 3:
                        angles = factor * self.angles[:, order] * np.array(signs)
                        yield " and ".join(texts), replace(self, angles=angles)

    @property
    def step(self) -> float:
        """Median interval of the angles [s]."""
        return float(np.median(np.diff(self.t)))

    def rests(self) -> Array:
        """Begin and end (k, 2) [s] of the rests."""
        still = np.all(self.turned(LIMITS.speed_window) < LIMITS.rest_speed * LIMITS.speed_window, axis=1)
        edges = np.diff(still.astype(np.int8), prepend=0, append=0)
        starts, stops = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
        spans = np.column_stack([self.t[starts], self.t[stops]])
        return spans[spans[:, 1] - spans[:, 0] >= LIMITS.shortest_rest]


def motion_of(record: Record, chain: Chain) -> TableMotion:
    """The table's motion in a record.

    Raises
    ------
    RecordError
        An angle is missing, or jumps faster than any table turns; or a clock falls back.
    """
    path = record.sources[0].path if record.sources else "record"
    missing = [name for name in chain.joints if name not in record]
    if missing:
        raise RecordError(
            path,
            f"found no column {' and no column '.join(missing)}, expected the table's angles "
            f'{", ".join(chain.joints)} (a table of one axis has imu.aided.rig.kind = "chain" and chain = [{{ joint = '
            '"phi1", axis = "z" }]; without a table there is imu.method = "sections")',
        )
    columns = [record[name] for name in chain.joints]
    t = columns[0].t
    values = np.column_stack([c.si() if c.t is t else _at(t, c) for c in columns])
    rows = forward(t, chain.joints[0], path)
    rows = rows[np.isfinite(values[rows]).all(axis=1)]
    rows = rows[np.diff(t[rows], prepend=-np.inf) > 0.0]
    t, values = t[rows], values[rows]
    if len(t) < 10:
        raise RecordError(path, f"found {len(t)} rows with angles, expected the table's angles over the test")
    angles = np.unwrap(values, axis=0)
    wrong = [_glitches(column) for column in angles.T]
    findings = tuple(
        Finding(
            "outlier",
            f"{counted(len(rows), 'reading')} of {joint} far from both neighbours, at t {times(t[rows])} s: left out",
            harm=(),
        )
        for joint, rows in zip(chain.joints, wrong, strict=True)
        if len(rows)
    )
    t, angles = (np.delete(x, np.concatenate(wrong), axis=0) for x in (t, angles))
    speed = np.abs(np.diff(angles, axis=0)) / np.diff(t)[:, None]
    row, joint = np.unravel_index(int(np.argmax(speed)), speed.shape)
    if speed[row, joint] > LIMITS.table_speed:
        jump = np.degrees(angles[row + 1, joint] - angles[row, joint])
        raise RecordError(
            path,
            f"{chain.joints[joint]} jumps by {jump:.4g} deg at t {t[row]:.2f} s, expected the angles that the table "
            "passes through, as its encoders give them",
        )
    return TableMotion(chain, t, angles, path, findings)


def forward(t: Array, name: str, path: str) -> NDArray[np.int64]:
    """Rows of stamps ``t`` (n,) [s] that are numbers and do not run backward; equal ones stay.

    Of two stamps in the wrong order the first is stray if the second goes with the one before both, else the second.

    Raises
    ------
    RecordError
        The clock falls back; ``name`` says what it belongs to, ``path`` where it was read.
    """
    rows = np.flatnonzero(np.isfinite(t))
    for _ in range(LIMITS.stray_stamps + 1):
        stamps = t[rows]
        back = np.flatnonzero(np.diff(stamps) < 0.0)
        if not back.size:
            return rows
        ahead = stamps[back + 1] >= stamps[np.maximum(back - 1, 0)]
        rows = np.delete(rows, np.where(ahead | (back == 0), back, back + 1))
    row = int(back[0])
    raise RecordError(
        path,
        f"the clock of {name} falls back from {stamps[row]:.6g} s to {stamps[row + 1]:.6g} s, expected one that goes "
        "forward",
    )


def _at(t: Array, column: Column) -> Array:
    """The angle of a joint that has a clock of its own, at times ``t`` (n,) [s]; NaN where these are none."""
    rows = forward(column.t, column.name, column.source.path)
    return np.asarray(np.interp(t, column.t[rows], column.si()[rows]))


def _glitches(angle: Array) -> NDArray[np.int64]:
    """Rows of single angles (m,) off the curve through two neighbours on either side, which agree with each other."""
    middle = angle[2:-2]
    off = np.abs(middle - (4.0 * (angle[1:-3] + angle[3:-1]) - angle[:-4] - angle[4:]) / 6.0)
    step = np.abs(angle[3:-1] - angle[1:-3])
    rows = np.flatnonzero((off > LIMITS.glitch_angle) & (step < 0.5 * off)) + 2
    near = [slice(max(row - 22, 0), row + 19) for row in rows]
    far = [
        off[row - 2] > LIMITS.glitch_ratio * np.median(off[at]) for row, at in zip(rows, near, strict=True)
    ]
    peak = [off[row - 2] >= np.max(off[max(row - 4, 0) : row + 1]) for row in rows]
    return np.asarray(rows[np.logical_and(far, peak)], dtype=np.int64)


def times(t: Array) -> str:
    """Up to four times [s] in words."""
    return ", ".join(f"{each:.2f}" for each in t[:4]) + (" and later" if len(t) > 4 else "")


@dataclass(frozen=True, eq=False)
class ErrorNodes:
    """An error of the table as unknowns: one for each value that it takes, with straight lines between the rests.

    ``slopes`` (n, 3) [rad/rad] turn of the instrument, in its own axes, by the error at its nodes' times;
    ``hats`` (n, q) the part of each unknown in the error at those times.
    """

    error: Error
    slopes: Array
    hats: Array


def error_nodes(motion: TableMotion, t: Array, rests: Array) -> Iterator[ErrorNodes]:
    """The errors of the table at times ``t`` (n,); offsets turn nothing and are left out."""
    chain = motion.chain
    if not chain.errors:
        return
    vectors, numbers = motion.turns_by_errors(t), values_of(motion, rests)
    each_rest = np.stack(
        [np.interp(t, rests.ravel(), np.repeat(row, 2)) for row in np.eye(len(rests))], axis=-1
    ) if len(rests) else np.ones((len(t), 1))  # fmt: skip
    for k, error in enumerate(chain.errors):
        if error.name not in numbers:
            continue
        own = numbers[error.name]
        if error.scope.constant:
            hats = np.ones((len(t), 1))
        else:
            hats = each_rest @ (own[:, None] == np.arange(own.max() + 1)) if len(rests) else each_rest
        yield ErrorNodes(error, vectors[:, k], hats)


def values_of(motion: TableMotion, rests: Array) -> Mapping[str, Numbers]:
    """Number (k,) of the value that each error of the table has in each rest (k, 2) [s], at least one rest.

    Offsets turn nothing and are left out, as is what is left to the scatter: errors of scope ``sample``.
    """
    groups = motion.chain.groups(motion.positions(rests.mean(axis=1) if len(rests) else motion.t[:1]))
    return {
        error.name: numbers
        for error, numbers in zip(motion.chain.errors, groups, strict=True)
        if not error.is_offset and error.scope is not Scope.SAMPLE
    }


def shifted(motion: TableMotion, by: float) -> TableMotion:
    """The motion ``by`` [s] later."""
    return replace(motion, t=motion.t + by)
