"""Attitude that another instrument recorded: a robot's flange, a body of motion capture, a table by three angles."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.rotations import conjugate, elementary, from_matrix, normalize, to_matrix
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.chain import Chain, Fixed
from inercal.systems.imu.aided.agreement import expected, match
from inercal.systems.imu.aided.blocks import Blocks
from inercal.systems.imu.aided.table import TableMotion, forward
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import AidedReference, axis_of

QUATERNION = ("q_ref_0", "q_ref_1", "q_ref_2", "q_ref_3")
ANGLES = ("phi1", "phi2", "phi3")


@dataclass(frozen=True, eq=False)
class AttitudeMotion(TableMotion):
    """Attitudes at times ``t`` (m,) [s]: quaternions ``angles`` (m, 4), scalar first and without jumps of sign, that
    take the axes of the body to those of the reference.

    ``reference`` says which of these is up, ``level`` (3, 3) turns it to the vertical; ``noise`` is that of an attitude
    about an axis [rad]. The chain has no joints: it is
    the errors of that level, and the mounting.
    """

    words: ClassVar[str] = "the attitude of the reference"

    reference: AidedReference = field(default_factory=AidedReference)
    level: Array = field(default_factory=lambda: np.eye(3))
    noise: float = 0.0

    def attitude(self, t: Array) -> Array:
        """Nominal attitude C_nb (*t.shape, 3, 3)."""
        q = self.at(t)
        turned = to_matrix(normalize(q))
        return np.asarray(self.level @ leveled(self.reference) @ turned @ self.mounting)

    @property
    def mounting(self) -> Array:
        """Rotation (3, 3) whose columns are the instrument's axes on those of the body."""
        *_, last = self.chain.elements
        assert isinstance(last, Fixed)
        return last.rotation

    def positions(self, t: Array) -> Array:
        """(n, 0): there are no joints."""
        return np.zeros((len(t), 0))

    def turned(self, by: float) -> Array:
        """Angles (m, 1) [rad] between the attitudes half of ``by`` [s] before and after each, less what noise makes."""
        change = self.at(self.t + 0.5 * by) - self.at(self.t - 0.5 * by)
        angle = 2.0 * np.linalg.norm(change, axis=1, keepdims=True)
        return np.asarray(np.maximum(angle - LIMITS.noise_of_rest * self.noise, 0.0))

    def seen_by(self, sensor: str) -> TableMotion:
        """Of the gyro that with one attitude throughout each rest."""
        return self._held if sensor == "gyro" else self

    @cached_property
    def _held(self) -> AttitudeMotion:
        """The motion with one attitude throughout each rest: cameras are noisy, and what rests does not turn."""
        q, edge = self.angles.copy(), 0.5 * LIMITS.speed_window
        for begin, end in self.rests():
            rows = (self.t > begin + edge) & (self.t < end - edge)
            if rows.any():
                q[rows] = q[rows].mean(axis=0)
        return replace(self, angles=q)

    def tilted(self, tilt: Array) -> AttitudeMotion:
        """The motion with a reference that is tilted more about north and west, (2,) [rad]."""
        turn = elementary("x", float(tilt[0])) @ elementary("y", float(tilt[1]))
        return replace(self, level=turn @ self.level)

    @property
    def travel(self) -> float:
        """Largest angle [rad] from the first attitude."""
        return float(2.0 * np.arccos(np.clip(np.min(np.abs(self.angles @ self.angles[0])), 0.0, 1.0)))

    def turns_by_errors(self, t: Array) -> Array:
        """Turns (n, k, 3) of the instrument, in its own axes, by the tilt of the reference about north and west."""
        axes = ["xyz".index(error.axis) for error in self.chain.errors]
        return self.attitude(t)[:, axes, :]

    def place(self, t: float) -> dict[str, list[float]]:
        """The attitude at a time, for a table."""
        return {"attitude": self.at(np.array(t)).tolist()}

    @property
    def curves(self) -> tuple[Sequence[str], Array, str]:
        """Names, values (m, k) and unit of what a picture shows of it."""
        return QUATERNION, self.angles, "quaternion"

    def readings(self) -> Iterator[tuple[str, TableMotion]]:
        """Other readings of the same columns, in words of the study, and what they say."""
        now = self.reference
        ups = [f"{sign}{axis}" for axis in "xyz" for sign in "+-"]
        for up, swapped, reversed_ in itertools.product(ups, (False, True), (False, True)):
            texts = [f'up = "{up}"'] if up != now.up else []
            q = self.angles
            if swapped:
                q = np.roll(q, 1 if now.scalar == "first" else -1, axis=1)
                texts.append(f'scalar = "{"last" if now.scalar == "first" else "first"}"')
            if reversed_:
                q = conjugate(q)
                other = "reference to body" if now.sense == "body to reference" else "body to reference"
                texts.append(f'sense = "{other}"')
            if texts:
                words = " and ".join(f"imu.aided.reference.{text}" for text in texts)
                yield words, replace(self, angles=_continuous(q), reference=replace(now, up=up))  # type: ignore[arg-type]


def attitudes_of(record: Record, chain: Chain, reference: AidedReference) -> AttitudeMotion:
    """The attitudes in a record, by four columns of a quaternion or three of angles.

    Raises
    ------
    RecordError
        Columns are missing, are no quaternion, or jump faster than anything turns; or a clock falls back.
    """
    path = record.sources[0].path if record.sources else "record"
    names = next((names for names in (QUATERNION, ANGLES) if all(name in record for name in names)), None)
    if names is None:
        raise RecordError(
            path,
            f"found no attitude of a reference, expected {', '.join(QUATERNION)}, or angles {', '.join(ANGLES)}, in a "
            'column map such as q_ref_0 = { from = "qw" }',
        )
    columns = [record[name] for name in names]
    t = columns[0].t
    if any(column.t is not t for column in columns):
        raise RecordError(path, f"found {', '.join(names)} on several clocks, expected one")
    values = np.column_stack([column.si() for column in columns])
    rows = forward(t, names[0], path)
    rows = rows[np.isfinite(values[rows]).all(axis=1)]
    rows = rows[np.diff(t[rows], prepend=-np.inf) > 0.0]
    if len(rows) < LIMITS.fewest_blocks:
        raise RecordError(path, f"found {len(rows)} rows with an attitude, expected those over the test")
    t, values = t[rows], values[rows]
    q = quaternions(values, path, reference) if names == QUATERNION else _of_angles(values, reference.angles)
    q = _continuous(q)
    speed = 2.0 * np.linalg.norm(np.diff(q, axis=0), axis=1) / np.diff(t)
    row = int(np.argmax(speed))
    if speed[row] > LIMITS.table_speed:
        jump = np.degrees(speed[row] * (t[row + 1] - t[row]))
        raise RecordError(
            path, f"the attitude jumps by {jump:.3g} deg at t {t[row]:.2f} s, expected a steady one"
        )
    q, noise = _smoothed(t, q)
    return AttitudeMotion(chain, t, q, path, (), reference, noise=noise)


def quaternions(values: Array, path: str, reference: AidedReference) -> Array:
    """Unit quaternions (m, 4), scalar first, that take body to reference; raises `RecordError` for others."""
    norm = np.linalg.norm(values, axis=1)
    row = int(np.argmax(np.abs(norm - 1.0)))
    if abs(norm[row] - 1.0) > LIMITS.quaternion_norm:
        raise RecordError(
            path,
            f"q_ref: found the norm {norm[row]:.4g} in row {row + 1}, expected quaternions of norm 1 (are its four "
            "columns those of the map?)",
        )
    q = values / norm[:, None]
    if reference.scalar == "last":
        q = np.roll(q, 1, axis=1)
    return np.asarray(q if reference.sense == "body to reference" else conjugate(q))


def _of_angles(angles: Array, axes: str) -> Array:
    """Quaternions (m, 4) of turns by three angles (m, 3) [rad], each about an axis of the frame reached so far."""
    C = np.eye(3)
    for angle, axis in zip(angles.T, axes, strict=True):
        C = C @ elementary(axis, angle)  # type: ignore[arg-type]
    return from_matrix(C)


def leveled(reference: AidedReference) -> Array:
    """The rotation (3, 3) from the axes of a reference to axes of which the third is up."""
    up = axis_of(reference.up)
    first = np.roll(np.abs(up), 1)
    return np.stack([first, np.cross(up, first), up])


def _continuous(q: Array) -> Array:
    """Quaternions (m, 4) without jumps of sign."""
    signs = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(q * np.cumprod(np.append(1.0, signs))[:, None])


def _smoothed(t: Array, q: Array) -> tuple[Array, float]:
    """Continuous quaternions (m, 4) on cubics through a short time, where their steps are even, and the standard
    deviation of their noise about an axis [rad]."""
    from scipy.signal import savgol_coeffs, savgol_filter

    noise = 2.0 * float(
        np.sqrt(np.mean(np.median(np.square(np.diff(q, n=2, axis=0)), axis=0)) / (6.0 * 0.455))
    )
    steps = np.diff(t)
    count = 2 * int(0.5 * LIMITS.reference_window / np.median(steps)) + 1
    if count < 5 or len(q) < count or np.max(np.abs(steps - np.median(steps))) > 0.2 * np.median(steps):
        return q, noise
    left = float(np.linalg.norm(savgol_coeffs(count, 3)))
    return np.asarray(savgol_filter(q, count, 3, axis=0)), noise * left


def _turn_between(blocks: Sequence[Blocks], motion: TableMotion) -> Array:
    """The rotation (3, 3) by which what the motion makes of the outputs of all triads comes nearest to these."""
    both = np.zeros((3, 3))
    for each in blocks:
        x = expected(each, motion)
        dx, dy = x - x.mean(axis=0), each.y - each.y.mean(axis=0)
        both += dy.T @ dx / max(float(np.linalg.norm(dx) * np.linalg.norm(dy)), 1e-300)
    U, _, Vt = np.linalg.svd(both)
    return np.asarray(U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt)


def mounted(motion: AttitudeMotion, blocks: Sequence[Blocks]) -> tuple[AttitudeMotion, list[Finding]]:
    """The motion with the mounting that the outputs show, where they do not follow the stated one but another."""
    if max(match(each, expected(each, motion)).miss for each in blocks) < LIMITS.agreement_miss:
        return motion, []
    turn = _turn_between(blocks, motion).T
    if max(match(each, expected(each, motion) @ turn).miss for each in blocks) > LIMITS.agreement_miss:
        return motion, []
    *others, _ = motion.chain.elements
    angle = np.degrees(np.arccos(np.clip(0.5 * (np.trace(turn) - 1.0), -1.0, 1.0)))
    finding = Finding(
        "mounting_found",
        f"The instrument is turned by {angle:.3g} deg to the axes of the reference, as its outputs show.",
        action="M and T are on axes turned with it: result.mounting has them.",
        harm=(),
    )
    return replace(motion, chain=Chain((*others, Fixed(motion.mounting @ turn)))), [finding]
