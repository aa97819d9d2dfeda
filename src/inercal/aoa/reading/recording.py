"""A recording of a wind-tunnel model for the estimators: in SI, calibrated, on one clock, NaN where samples lack."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.findings import Finding
from inercal.inputs import Source
from inercal.units import Quantity


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of the sensors of a model, one row for each row of the record.

    Attributes
    ----------
    t : (n,) s
        As recorded. Time may stand still or run backward; estimators leave these rows out.
    acc : (n, N) m/s^2
        Calibrated accelerometers, in the order of the layout. Samples that are missing or saturated are NaN.
    gyro : (n,) rad/s
        Nose-up; all NaN where there is none.
    turns : (n, 2) rad/s
        Roll gyro (about x) and yaw gyro (about z), right-handed; all NaN where there are none.
    zero_angle : (n, 2) rad
        Angle known from elsewhere, as at wind-off, and its standard uncertainty; NaN in other rows.
    point, trigger, reference : (n,) or None
        Numbers of test points and triggers, to be handed on; the reference angle ``theta_ref`` [rad], without jumps
        of a turn.
    masked : (n, N + 1) bool or None
        Samples of accelerometers and gyro that were saturated.
    temperature : Quantity or None
        Mean and standard deviation of the recorded temperature.
    """

    t: Array
    acc: Array
    gyro: Array
    turns: Array
    zero_angle: Array
    point: Array | None = None
    trigger: Array | None = None
    reference: Array | None = None
    masked: NDArray[np.bool_] | None = None
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    temperature: Quantity | None = None

    @property
    def rows(self) -> Array:
        """(n, N + 5) as `inercal.aoa.fusion.loop.advance` takes them."""
        return np.column_stack([self.acc, self.gyro, self.zero_angle, self.turns])

    @property
    def spatial(self) -> bool:
        """True where roll and yaw gyros are there."""
        return bool(np.isfinite(self.turns).all(axis=1).any())


def plain(t: Array, acc: Array, gyro: Array) -> Recording:
    """A recording of accelerometers and one gyro alone."""
    none = np.full((len(t), 2), np.nan)
    return Recording(t, acc, gyro, none, none.copy())
