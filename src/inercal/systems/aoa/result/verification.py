"""Errors of angles against a reference angle, as of a turntable."""

from __future__ import annotations

import math
from dataclasses import dataclass

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


def late_reference(recording: Recording, angles: Angles) -> list[Finding]:
    """``contradiction``: a reference that comes later, or earlier, than the angles, which their error shows as its
    product with the rate."""
    if recording.reference is None:
        return []
    rows = np.flatnonzero(
        np.isfinite(recording.reference) & np.isfinite(angles.theta) & np.isfinite(angles.rate)
        & (recording.t >= recording.t[0] + LIMITS.settling_time)
    )  # fmt: skip
    if len(rows) < LIMITS.compared_rows:
        return []
    off = principal(angles.theta[rows] - np.unwrap(recording.reference[rows]))
    rate, u = angles.rate[rows] - angles.rate[rows].mean(), angles.u[rows]
    off = off - off.mean()
    power = float(rate @ rate)
    delay = float(rate @ off) / power if power > 0.0 else 0.0
    explained = delay**2 * power
    small = explained <= LIMITS.reference_sigmas**2 * float(np.square(u[np.isfinite(u)]).sum())
    if small or explained < LIMITS.explained_share * float(off @ off):
        return []
    side = "later" if delay > 0.0 else "earlier"
    text = f"theta_ref comes {1e3 * abs(delay):.2g} ms {side} than the angle"
    action = (
        "correct its clock, or state under [timing] the common_delay of the sensors where it is they that are "
        f"{'early' if delay > 0.0 else 'late'}"
    )
    return [Finding("contradiction", text, harm=("theta",), action=action)]


def _error(off: Array, u: Array) -> AngleError:
    """Error of some rows."""
    if len(off) == 0:
        return AngleError(math.nan, math.nan, math.nan, math.nan, 0)
    usable = np.isfinite(u) & (u > 0.0)
    ratio = math.sqrt(float(np.mean((off[usable] / u[usable]) ** 2))) if usable.any() else math.nan
    rms = math.sqrt(float(np.mean(off**2)))
    return AngleError(float(np.abs(off).max()), rms, float(off.mean()), ratio, len(off))
