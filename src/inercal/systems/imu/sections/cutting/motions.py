"""Motions between rests that leave the vertical where it was: any of them, or several in a row, may be a turn.

A turn by hand may pause where the hand takes a new grip, and next to it the instrument may be turned to where it is to
start from. So motions are taken apart at every pause, and all runs of them are candidates.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import Dwell, static_intervals
from inercal.systems.imu.limits import LIMITS

_NO_CUTS: NDArray[np.int64] = np.array([], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SectionMotion:
    """Samples ``start`` to ``stop`` of the accelerometers, the integral (3,) [output s] of the gyro over them and
    their ``duration`` [s], its ``rotation`` (3,) [output s] less a common bias, the direction ``up`` (3,) in it, the
    number of ``stretches`` between holds that it is made of, and whether it ``begins`` and ``ends`` with one."""

    start: int
    stop: int
    integral: Array
    duration: float
    rotation: Array
    up: Array
    begins: bool
    ends: bool
    stretches: int = 1

    def with_next(self, other: SectionMotion) -> SectionMotion:
        """This and the next one, with the pause between them."""
        return SectionMotion(
            self.start,
            other.stop,
            self.integral + other.integral,
            self.duration + other.duration,
            self.rotation + other.rotation,
            self.up,
            self.begins,
            other.ends,
            self.stretches + other.begins,
        )

    @property
    def single(self) -> bool:
        """True if the motion is the whole of one stretch between holds."""
        return self.begins and self.ends and self.stretches == 1

    @property
    def axis(self) -> int | None:
        """The axis of the motion, if it is about one."""
        axis = int(np.argmax(np.abs(self.rotation)))
        size = float(np.linalg.norm(self.rotation))
        return axis if abs(self.rotation[axis]) > LIMITS.axis_share * size > 0.0 else None


@dataclass(frozen=True, eq=False)
class AccelerometerLevel:
    """Level of uncalibrated accelerometers: output ``middle`` (3,) at no force, and ``size`` of gravity [output]."""

    middle: Array
    size: float

    @staticmethod
    def of(acc: Triad, holds: Sequence[Dwell]) -> AccelerometerLevel:
        """By the holds: each axis lies level in most of them."""
        means = np.array([hold.of(acc.values).mean(axis=0) for hold in holds])
        middle = np.median(means, axis=0)
        return AccelerometerLevel(middle, float(np.max(np.linalg.norm(means - middle, axis=1))))

    def up(self, values: Array) -> Array:
        """Direction (3,) of the mean specific force of samples (n, 3), as near as it shows; 0 where it does not."""
        f = values.mean(axis=0) - self.middle
        size = float(np.linalg.norm(f))
        return np.asarray(f / size if size > 0.5 * self.size else 0.0 * f)


def part(gyro: Triad, acc: Triad, start: int, stop: int) -> tuple[Array, Array]:
    """Times and outputs of the gyro between two samples of the accelerometers."""
    if gyro.t is acc.t:
        return gyro.t[start:stop], gyro.values[start:stop]
    inside = (gyro.t >= acc.t[start]) & (gyro.t <= acc.t[stop - 1])
    return gyro.t[inside], gyro.values[inside]


def motions(
    acc: Triad,
    gyro: Triad,
    holds: Sequence[Dwell],
    level: AccelerometerLevel,
    bias: Array,
    cuts: NDArray[np.int64],
) -> Iterator[SectionMotion]:
    """All runs of motions about an axis that leave the vertical where it was.

    ``bias`` (3,) is the mean output of the gyro at rest, ``cuts`` are the breaks of the time axis.
    """
    ends = {hold.stop: hold for hold in holds}
    begins = {hold.start: hold for hold in holds}
    resting = np.zeros(len(acc.t), dtype=bool)
    for hold in holds:
        resting[hold.start : hold.stop] = True
    smooth = max(3, round(LIMITS.rate_window * gyro.rate))
    still = [part(gyro, acc, hold.start, hold.stop)[1] - bias for hold in holds]
    noise = 4.0 * float(np.median([np.sqrt(np.mean(_smoothed(rate, smooth) ** 2)) for rate in still]))
    run: list[SectionMotion] = []
    for stretch in static_intervals(~resting, cuts, 3):
        before, after = ends.get(stretch.start), begins.get(stretch.stop)
        if run and (before is None or run[-1].stop != before.start):
            run = []
        edges, seen = _edges(acc, gyro, stretch, bias, noise, smooth)
        ups = [
            None if before is None else level.up(before.of(acc.values)),
            *(level.up(acc.values[a:b]) for a, b in seen),
            None if after is None else level.up(after.of(acc.values)),
        ]
        for k in range(len(edges) - 1):
            f = [each for each in ups[k : k + 2] if each is not None]
            own = _motion(acc, gyro, Dwell(edges[k], edges[k + 1]), bias, f, stretch)
            if own is None:
                run = []
                continue
            run = [*(earlier.with_next(own) for earlier in run), own]
            run = run[-LIMITS.motions_in_a_row :]
            yield from (each for each in run if each.axis is not None)


def _motion(
    acc: Triad, gyro: Triad, span: Dwell, bias: Array, ups: list[Array], stretch: Dwell
) -> SectionMotion | None:
    """A motion, or none where it is not known or takes the vertical elsewhere."""
    t, output = part(gyro, acc, span.start, span.stop)
    if (
        len(t) < 3
        or not np.isfinite(output).all()
        or (len(ups) == 2 and ups[0] @ ups[1] < LIMITS.upright_cosine)
    ):
        return None
    integral = np.asarray(np.trapezoid(output, t, axis=0), dtype=np.float64)
    length = float(t[-1] - t[0])
    up = ups[0] if ups else np.zeros(3)
    return SectionMotion(
        span.start,
        span.stop,
        integral,
        length,
        integral - length * bias,
        up,
        span.start == stretch.start,
        span.stop == stretch.stop,
    )


def _edges(
    acc: Triad, gyro: Triad, stretch: Dwell, bias: Array, noise: float, smooth: int
) -> tuple[list[int], list[tuple[int, int]]]:
    """The samples at which a stretch is taken apart, its ends and the middles of its pauses; and the pauses.

    A pause may hold a small motion between two rests, or a hand that is never quite at rest.
    """
    t, output = part(gyro, acc, stretch.start, stretch.stop)
    if len(t) < 3 * smooth:
        return [stretch.start, stretch.stop], []
    rate = _smoothed(output - bias, smooth)
    largest = float(np.max(rate, initial=0.0, where=np.isfinite(rate)))
    shortest = max(3, round(LIMITS.shortest_pause * gyro.rate))
    slow, still = (rate < max(share * largest, noise) for share in (LIMITS.pause_rate, LIMITS.rest_rate))
    rests = static_intervals(still, _NO_CUTS, shortest)
    pauses = []
    for pause in static_intervals(slow, _NO_CUTS, shortest):
        inner = [rest for rest in rests if pause.start <= rest.start and rest.stop <= pause.stop]
        pauses += [each for each in inner or [pause] if each.start > 0 and each.stop < len(t)]
    rows = np.array([(t[pause.start], t[pause.stop - 1]) for pause in pauses]).reshape(-1, 2)
    ends = stretch.start + np.searchsorted(acc.t[stretch.start : stretch.stop], rows)
    spans = [(int(a), int(b) + 1) for a, b in ends]
    return [stretch.start, *((a + b) // 2 for a, b in spans), stretch.stop], spans


def _smoothed(rate: Array, samples: int) -> Array:
    """Size (n,) of the moving mean of rates (n, 3)."""
    kernel = np.full(samples, 1.0 / samples)
    means = [np.convolve(column, kernel, mode="same") for column in rate.T]
    return np.asarray(np.linalg.norm(means, axis=0))
