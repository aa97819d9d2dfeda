"""The static poses of a hand-held recording: found, averaged, and the threshold chosen.

An interval is static where the windowed variance stays below a multiple of that at rest;
the multiple is the one whose poses the accelerometer model fits best per degree of freedom.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.records.dwells import Dwell, static_intervals
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import PARAMETERS, AccelerometerFit, fit_accelerometer
from inercal.systems.imu.recording import Recording
from inercal.systems.imu.settings import ImuSettings

MULTIPLES = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 14.0, 20.0, 28.0, 40.0)
"""Thresholds tried, as multiples of the variance at rest."""


@dataclass(frozen=True)
class Poses:
    """Static poses at one threshold, and the accelerometer fit to them.

    ``numbers`` count them from 1, those left out too; ``times`` (n,) [s] their middles, ``means`` (n, 3) mean outputs,
    ``noise_variance`` (n,) the variance [(m/s^2)^2] of each pose's |f| that the sensors' noise explains, with
    ``noise_dof`` degrees of freedom.
    """

    dwells: tuple[Dwell, ...]
    numbers: tuple[int, ...]
    multiple: float
    with_gyro: bool
    times: Array
    means: Array
    accelerometer: AccelerometerFit
    noise_variance: Array
    noise_dof: float

    @property
    def misfit(self) -> float:
        """Residual variance per degree of freedom [(m/s^2)^2], the noise counted in as prior knowledge.

        Without that, one degree of freedom would let luck choose the threshold.
        """
        fit, noise = self.accelerometer.fit, float(np.mean(self.noise_variance))
        return (fit.chi2 + self.noise_dof * noise) / (fit.dof + self.noise_dof)


def dwells_at(recording: Recording, multiple: float, with_gyro: bool) -> tuple[Dwell, ...]:
    """Static intervals at a threshold, on the accelerometers' time axis."""
    still = recording.restlessness["acc"] < multiple
    if with_gyro:
        still = still & (recording.restlessness["gyro"] < multiple)
    return static_intervals(still, recording.cuts, recording.window)


def distinct(dwells: tuple[Dwell, ...], y: Array, window: int) -> tuple[Dwell, ...]:
    """Intervals of different poses: of a pose that was only jolted, the longer interval stands.

    Two intervals less than a ``window`` of samples apart whose mean outputs ``y`` (n, 3) differ by less than
    `LIMITS.same_pose` of the range of all are one pose, and would not be independent.
    """
    if not dwells:
        return ()
    means = np.array([dwell.of(y).mean(axis=0) for dwell in dwells])
    size = 0.5 * float(np.max(np.ptp(means, axis=0)))
    kept, last = [dwells[0]], means[0]
    for dwell, mean in zip(dwells[1:], means[1:], strict=True):
        jolted = (
            dwell.start - kept[-1].stop < window and np.linalg.norm(mean - last) < LIMITS.same_pose * size
        )
        if not jolted:
            kept.append(dwell)
        elif dwell.samples > kept[-1].samples:
            kept[-1] = dwell
        last = mean
    return tuple(kept)


def sweep(recording: Recording, gravity: float) -> Iterator[Poses]:
    """Poses at every threshold that yields enough of them, with and without the gyro's help."""
    y = recording.accelerometer.values
    seen: set[tuple[Dwell, ...]] = set()
    start: Array | None = None
    for with_gyro in (True, False) if recording.gyro is not None else (False,):
        for multiple in MULTIPLES:
            dwells = distinct(dwells_at(recording, multiple, with_gyro), y, recording.window)
            if len(dwells) < LIMITS.fewest_poses or dwells in seen:
                continue
            seen.add(dwells)
            means = np.array([dwell.of(y).mean(axis=0) for dwell in dwells])
            accelerometer = fit_accelerometer(means, gravity, start)
            full_rank = accelerometer.fit.identifiability.rank == PARAMETERS
            if not accelerometer.fit.converged or not full_rank or np.any(accelerometer.model.scale <= 0):
                continue
            start = accelerometer.fit.x
            numbers = tuple(range(1, len(dwells) + 1))
            yield _poses(recording, dwells, numbers, multiple, with_gyro, means, accelerometer)


def _poses(
    recording: Recording,
    dwells: tuple[Dwell, ...],
    numbers: tuple[int, ...],
    multiple: float,
    with_gyro: bool,
    means: Array,
    accelerometer: AccelerometerFit,
) -> Poses:
    """Poses with their times, and what noise makes of them."""
    t, noise = recording.accelerometer.t, recording.noise["acc"]
    lengths = np.array([dwell.samples for dwell in dwells]) / recording.accelerometer.rate
    of_means = noise.variance(lengths) + recording.resolution["acc"] ** 2 / 12.0
    variance = np.sum(accelerometer.output_gradient() ** 2 * of_means, axis=1)
    dof = 3.0 * noise.dof(float(np.median(lengths)))
    times = np.array([t[(d.start + d.stop) // 2] for d in dwells])
    return Poses(dwells, numbers, multiple, with_gyro, times, means, accelerometer, variance, dof)


def excluded(candidates: list[Poses], recording: Recording, settings: ImuSettings) -> set[int]:
    """Numbers of the poses that the study leaves out, of those chosen; raises `StudyError` where that does not go."""
    poses, exclude, t = choose(candidates), settings.exclude, recording.accelerometer.t
    for number in exclude.poses:
        if number not in poses.numbers:
            raise StudyError("imu.exclude", f"found pose {number}, expected one of 1 to {len(poses.numbers)}")
    for begin, end in exclude.times:
        if begin >= t[-1] or end <= t[0]:
            raise StudyError(
                "imu.exclude",
                f"found {begin:g} s .. {end:g} s, expected a time of the record, {t[0]:g} s to {t[-1]:g} s",
            )
    middles = zip(poses.numbers, poses.times, strict=True)
    out = set(exclude.poses) | {number for number, middle in middles if exclude.touches(middle, middle)}
    left, needed = len(poses.numbers) - len(out), LIMITS.poses_with_k2 if settings.k2 else LIMITS.fewest_poses
    if left < needed:
        key = "imu.exclude" if out else "imu.k2"
        raise StudyError(key, f"found {left} poses to fit, expected {needed} at least")
    return out


def refitted(
    poses: Poses, recording: Recording, gravity: float, left_out: Collection[int], squares: bool
) -> Poses:
    """The poses but those of the numbers ``left_out``, fitted again, with K2 where ``squares`` are asked for."""
    kept = [k for k, number in enumerate(poses.numbers) if number not in left_out]
    if len(kept) == len(poses.numbers) and squares == poses.accelerometer.squares:
        return poses
    means = poses.means[kept]
    accelerometer = fit_accelerometer(means, gravity, poses.accelerometer.fit.x[:PARAMETERS], squares)
    dwells, numbers = tuple(poses.dwells[k] for k in kept), tuple(poses.numbers[k] for k in kept)
    return _poses(recording, dwells, numbers, poses.multiple, poses.with_gyro, means, accelerometer)


def choose(candidates: list[Poses]) -> Poses:
    """The threshold with the least misfit, with the gyro's help if that leaves most of the poses."""
    alone = [poses for poses in candidates if not poses.with_gyro]
    aided = [poses for poses in candidates if poses.with_gyro]
    most = max((len(poses.dwells) for poses in alone), default=0)
    enough = [poses for poses in aided if 2 * len(poses.dwells) >= most]
    return min(enough or alone, key=lambda poses: poses.misfit)
