"""Errors of angles against a reference angle, as of a turntable."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.pauses import at_rest
from inercal.systems.aoa.reading.recording import Recording


@dataclass(frozen=True)
class AngleError:
    """Angle less reference over some ``rows`` [rad]: largest magnitude, root mean square and mean; NaN without rows.

    ``ratio`` is the root mean square of the error over its standard uncertainty: about 1, or below, where u is right.
    """

    max_abs: float
    rms: float
    mean: float
    ratio: float
    rows: int


@dataclass(frozen=True)
class Errors:
    """Errors of a ``method`` over ``all`` rows, and where the reference stands still or moves."""

    method: str
    all: AngleError
    static: AngleError
    moving: AngleError


def errors(recording: Recording, angles: Angles, after: float = LIMITS.settling_time) -> Errors:
    """Errors of angles against the recording's reference from ``after`` [s] on, while a filter settles before.

    The reference stands still in the windows of `inercal.systems.aoa.reading.pauses.at_rest`. Raises `RecordError`
    without one.
    """
    if recording.reference is None or not np.isfinite(recording.reference).any():
        raise RecordError("theta_ref", "missing, expected a reference angle to verify angles against")
    rows = np.flatnonzero(np.isfinite(recording.reference) & np.isfinite(recording.t))
    t, reference = recording.t[rows], np.unwrap(recording.reference[rows])
    off, u = principal(angles.theta[rows] - reference), angles.u[rows]
    still, _ = at_rest(t, reference, np.full(len(t), LIMITS.reference_creep))
    taken = np.isfinite(off) & (t >= t[0] + after)
    parts = (_error(off[chosen], u[chosen]) for chosen in (taken, taken & still, taken & ~still))
    return Errors(angles.method, *parts)


class _Compared(NamedTuple):
    """A reference beside the angle, in rows where both are: ``reference``, ``theta`` and ``u`` (n,) [rad], ``rate``
    (n,) [rad/s]; the reference on the turn of the angle."""

    reference: Array
    theta: Array
    rate: Array
    u: Array

    def left(self, factor: float, *columns: Array) -> tuple[float, Array]:
        """Sum of squares that is left of the reference by so many times the angle, a constant and further columns (n,),
        with the sizes of these."""
        X = np.column_stack([np.ones(len(self.theta)), *columns])
        y = self.reference - factor * self.theta
        sizes = np.linalg.lstsq(X, y, rcond=None)[0]
        return float(np.sum(np.square(y - X @ sizes))), np.asarray(sizes, dtype=float)


def contradicting_reference(recording: Recording, angles: Angles) -> list[Finding]:
    """``contradiction``: a reference that differs from the angle by more than the u of it explains, with its cause:
    sign, unit, scale, offset, or a delay, which its error shows as its product with the rate."""
    of = _compared(recording, angles)
    if of is None:
        return []
    off = of.reference - of.theta
    if float(np.mean(np.square(off / of.u))) <= LIMITS.reference_off**2:
        return _late(of)
    causes = [
        (left, sentence, action)
        for left, sentence, action in _causes(of)
        if left < (1.0 - LIMITS.explained_share) * float(off @ off)
    ]
    if not causes:
        times = math.sqrt(float(np.mean(np.square(off / of.u))))
        size = math.degrees(math.sqrt(float(np.mean(np.square(off)))))
        text = f"theta_ref differs from the angle by {size:.2g} deg rms, {times:.2g} times its u"
        action = "check which sensor theta_ref is of, its unit, sign and clock"
        return [Finding("contradiction", text, harm=("theta",), action=action)]
    # those that are picked from a few come first where they leave about as little
    agrees = LIMITS.reference_off**2 * float(np.sum(np.square(of.u)))
    enough = 2.0 * min(left for left, *_ in causes) + agrees
    _, sentence, action = next(cause for cause in causes if cause[0] <= enough)
    return [Finding("contradiction", sentence, harm=("theta",), action=action)]


def _compared(recording: Recording, angles: Angles) -> _Compared | None:
    """The rows that are compared; None where there are few."""
    if recording.reference is None:
        return None
    rows = np.flatnonzero(
        np.isfinite(recording.reference) & np.isfinite(angles.theta) & np.isfinite(angles.rate)
        & np.isfinite(angles.u) & (angles.u > 0.0) & (recording.t >= recording.t[0] + LIMITS.settling_time)
    )  # fmt: skip
    if len(rows) < LIMITS.compared_rows:
        return None
    reference, theta = np.unwrap(recording.reference[rows]), np.unwrap(angles.theta[rows])
    turns = 2.0 * math.pi * round(float(np.median(reference - theta)) / (2.0 * math.pi))
    return _Compared(reference - turns, theta, angles.rate[rows], angles.u[rows])


_UNITS = {
    180.0 / math.pi: "as if degrees were taken for radians",
    math.pi / 180.0: "as if radians were taken for degrees",
    60.0: "as if minutes of arc were taken for degrees",
    1.0 / 60.0: "as if degrees were taken for minutes of arc",
}
"""Times that a reference is too large -> how that comes."""


def _causes(of: _Compared) -> Iterator[tuple[float, str, str]]:
    """Sums of squares that each cause leaves, with its sentence and what to do; those without a free size first."""
    left, (offset,) = of.left(-1.0)
    yield left, "theta_ref has the other sign than the angle", "reverse theta_ref, or the axes of the sensors"
    for factor, how in _UNITS.items():
        for sign in (1.0, -1.0):
            left, _ = of.left(sign * factor)
            left /= max(factor, 1.0) ** 2  # errors of the angle count as often
            yield left, f"theta_ref is {factor:.3g} times the angle, {how}", "correct the unit of theta_ref"
    left, (offset,) = of.left(1.0)
    text = f"theta_ref is {math.degrees(offset):.3g} deg off the angle all the time"
    yield left, text, "correct the zero of theta_ref, or state a zero under [zero]"
    left, (_, late) = of.left(1.0, -of.rate)
    side = "later" if late > 0.0 else "earlier"
    text = f"theta_ref comes {1e3 * abs(late):.2g} ms {side} than the angle"
    yield left, text, _clock(late)
    left, (_, scale) = of.left(1.0, of.theta)
    text = f"theta_ref is {1.0 + scale:.4g} times the angle"
    yield left, text, "correct the scale of theta_ref, or of the sensors"


def _clock(delay: float) -> str:
    """Remedy of a reference that is late [s]."""
    early = "early" if delay > 0.0 else "late"
    return (
        "correct its clock, or state under [timing] the common_delay of the sensors where it is they that are "
        f"{early}"
    )


def _late(of: _Compared) -> list[Finding]:
    """``contradiction``: a reference that comes later, or earlier, than the angles."""
    off = of.theta - of.reference
    rate, off = of.rate - of.rate.mean(), off - off.mean()
    power = float(rate @ rate)
    delay = float(rate @ off) / power if power > 0.0 else 0.0
    explained = delay**2 * power
    small = explained <= LIMITS.reference_sigmas**2 * float(np.square(of.u).sum())
    if small or explained < LIMITS.explained_share * float(off @ off):
        return []
    side = "later" if delay > 0.0 else "earlier"
    text = f"theta_ref comes {1e3 * abs(delay):.2g} ms {side} than the angle"
    return [Finding("contradiction", text, harm=("theta",), action=_clock(delay))]


def _error(off: Array, u: Array) -> AngleError:
    """Error of some rows."""
    if len(off) == 0:
        return AngleError(math.nan, math.nan, math.nan, math.nan, 0)
    usable = np.isfinite(u) & (u > 0.0)
    ratio = math.sqrt(float(np.mean((off[usable] / u[usable]) ** 2))) if usable.any() else math.nan
    rms = math.sqrt(float(np.mean(off**2)))
    return AngleError(float(np.abs(off).max()), rms, float(off.mean()), ratio, len(off))
