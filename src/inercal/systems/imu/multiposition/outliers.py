"""Poses and turns that lie off all others: named, with what they do to the coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.places import counted_names
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit
from inercal.systems.imu.multiposition.deletion import LinearisedFit, outlying
from inercal.systems.imu.multiposition.gyro import GyroFit
from inercal.systems.imu.multiposition.joint import JointTriads
from inercal.systems.imu.multiposition.poses import Poses


@dataclass(frozen=True)
class Outliers:
    """Places of ``poses`` and ``turns`` among those that were fitted."""

    poses: tuple[int, ...] = ()
    turns: tuple[int, ...] = ()

    def __bool__(self) -> bool:
        """True where there are any."""
        return bool(self.poses or self.turns)


def linear_poses(fit: AccelerometerFit) -> LinearisedFit:
    """The residuals of the poses, made linear."""
    n, p = fit.fit.jacobian.shape
    jacobian = fit.fit.jacobian[:, None, :]
    return LinearisedFit(fit.fit.residuals[:, None], jacobian, np.zeros((n, n)), np.ones(n), np.zeros((p, p)))


def outliers_of(poses: Poses, gyro: GyroFit | None) -> Outliers:
    """The outlying poses and turns of a calibration.

    A pose that is off spoils the turns to and from it: these are judged only where no pose is.
    """
    off = tuple(outlying(linear_poses(poses.accelerometer), LIMITS.outlier_risk))
    if off or gyro is None:
        return Outliers(off)
    return Outliers((), tuple(outlying(gyro.linear, LIMITS.turn_risk)))


def outlier_finding(
    outliers: Outliers,
    poses: Poses,
    t: Array,
    gyro: GyroFit | None,
    here: JointTriads,
    without: JointTriads,
    u: Array,
) -> Finding:
    """The finding about outliers.

    ``t`` (samples,) [s] of the accelerometers; ``gyro`` is its fit; ``without`` the
    calibration without the outliers, with ``u`` (p,) of its coefficients, of which those move that are off by more.
    """
    values = dict(zip(here.names, here.values, strict=True))
    shifts = {
        name: (values[name] - value) / each
        for name, value, each in zip(without.names, without.values, u, strict=True)
        if name in values and each > 0.0
    }
    harm = tuple(name for name, shift in shifts.items() if abs(shift) > 1.0)
    worst = max(shifts, key=lambda name: abs(shifts[name]))
    if outliers.poses:
        code, what = "outlying_pose", "pose"
        numbers = [poses.numbers[k] for k in outliers.poses]
        ends = [(poses.dwells[k].start, poses.dwells[k].stop - 1) for k in outliers.poses]
        places = [f"pose {number}" for number in numbers]
    else:
        code, what = "outlying_turn", "turn"
        first = [] if gyro is None else [gyro.first[k] for k in outliers.turns]
        ends = [(poses.dwells[k].stop - 1, poses.dwells[k + 1].start) for k in first]
        places = [f"{t[a]:.2f} s .. {t[b]:.2f} s" for a, b in ends]
    times = [f"t {t[a]:.2f} to {t[b]:.2f} s" for a, b in ends]
    listed = ", ".join(f'"{place}"' for place in places)
    lie, it = (f"{what}s lie", "them") if len(places) > 1 else (f"{what} lies", "it")
    way = "smaller" if shifts[worst] > 0 else "larger"
    return Finding(
        code,
        f"{len(places)} {lie} off what all others say ({counted_names(times)}), without {it} {worst} would be "
        f"{abs(shifts[worst]):.1f} u {way}",
        "; ".join(times),
        harm=harm,
        action=f"look for a knock or a hand that moved, and leave {it} out by imu.exclude = [{listed}]",
    )
