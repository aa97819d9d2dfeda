"""A calibration by a swing in the form of an outcome: coefficients, their covariance, and what is said of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.findings import Finding
from inercal.foundation.records.places import counted
from inercal.systems.imu.sections import swing_gyro as of_gyro
from inercal.systems.imu.sections.cutting.between import SwingStretch
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.swing import NAMES, SwingCalibration, swing_calibration


@short_repr
@dataclass(frozen=True, eq=False)
class Swung:
    """Accelerometers by a swing, and the gyro by the turns of gravity in it where these tell its axes."""

    stretch: SwingStretch
    acc: SwingCalibration
    gyro: of_gyro.SwingGyro | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names (p,) of the coefficients."""
        return (*NAMES, *(of_gyro.NAMES if self.gyro is not None else ()))

    @property
    def x(self) -> Array:
        """Coefficients (p,)."""
        return self.acc.x if self.gyro is None else np.concatenate([self.acc.x, self.gyro.x])

    @property
    def covariance(self) -> Array:
        """Their covariance (p, p)."""
        if self.gyro is None:
            return self.acc.covariance
        return np.asarray(block_diag(self.acc.covariance, self.gyro.covariance))

    @property
    def dof(self) -> float:
        """Windows that count as independent, less the coefficients."""
        return max(self.acc.windows / self.acc.correlation - len(NAMES), LIMITS.fewest_dof)

    def findings(self) -> tuple[Finding, ...]:
        """All that is said of it."""
        file = self.stretch.where
        found = [
            Finding(
                "not_at_rest",
                "Nothing rests: the accelerometers are calibrated as a swing, by the size of gravity.",
                file,
                (),
                action="Hold the instrument still for a second or more in each pose for smaller uncertainties.",
            )
        ]
        if self.acc.by_prior:
            few = "is by" if len(self.acc.by_prior) == 1 else "are by"
            found.append(
                Finding(
                    "by_prior",
                    f"{counted(len(self.acc.by_prior), 'term')} {few} what was known before more than by the swing.",
                    file,
                    action="Turn each axis up and down in turn.",
                    items=tuple({"term": name} for name in self.acc.by_prior),
                )
            )
        if self.acc.outlying_count:
            lie = "lies" if self.acc.outlying_count == 1 else "lie"
            found.append(
                Finding(
                    "outlying_section",
                    f"{counted(self.acc.outlying_count, 'window')} of the swing {lie} off, and hardly count.",
                    file,
                    (),
                    action="Turn the instrument without knocks.",
                    items=tuple(
                        {"time [s]": float(self.stretch.t[one.row]), "off [sigma]": one.sigmas}
                        for one in self.acc.outlying
                    ),
                )
            )
        if self.stretch.gyro is not None and self.gyro is None:
            found.append(
                Finding(
                    "gyro_missing",
                    "The turns of gravity do not tell the axes of the gyro, which is not calibrated.",
                    file,
                    action="Turn the instrument about each of its axes, held level, with rests between.",
                )
            )
        return tuple(found)


def calibrate_swing(stretch: SwingStretch, priors: Priors) -> Swung:
    """Calibrate by a swing.

    Raises
    ------
    RecordError
        Too few windows, or all alike.
    """
    steps = np.diff(stretch.t)
    rate = 1.0 / float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else None
    gyro, scale = stretch.gyro, priors.gyro_scale
    turning = None if gyro is None or scale is None else gyro / scale.median
    found = swing_calibration(stretch.acc, priors, stretch.where, rate, turning)
    if gyro is None:
        return Swung(stretch, found, None)
    turns = of_gyro.gravity_turns(found.force(stretch.acc), gyro, stretch.t)
    if turns is None:
        return Swung(stretch, found, None)
    told = of_gyro.swing_gyro(turns)
    if told is not None and turning is None:
        turning = gyro @ turns.matrix.T + turns.x[9:]
        found = swing_calibration(stretch.acc, priors, stretch.where, rate, turning)
    return Swung(stretch, found, told)
