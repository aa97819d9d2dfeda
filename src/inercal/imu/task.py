"""Calibration of an IMU by whichever method the settings ask for: a recording in, an estimate out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from inercal.estimate.result import Estimate
from inercal.imu.settings import ImuSettings
from inercal.records.record import Record


class Calibrated(Protocol):
    """What every method brings back: an estimate, and the evidence behind it."""

    @property
    def estimate(self) -> Estimate:
        """Its status says whether the values can be used."""


def calibrate(
    record: Record, settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> Calibrated:
    """Calibrate an IMU.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and perhaps ``gyro_x..z``, in any unit, counts included; what else it must hold depends on the
        method.
    settings : ImuSettings
        Site and options; ``settings.method`` are those of a method other than multi-position.
    progress : callable
        Told, in words, what is being done.

    Returns
    -------
    `inercal.imu.multiposition.Calibration`, or that of the method asked for
        Nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record does not hold what the method needs.
    """
    from inercal.imu.aided.settings import AidedSettings
    from inercal.imu.ferraris.settings import FerrarisSettings

    match settings.method:
        case FerrarisSettings():
            from inercal.imu.ferraris.calibration import calibrate_ferraris

            return calibrate_ferraris(record, settings, settings.method, progress)
        case AidedSettings():
            from inercal.imu.aided.calibration import calibrate_aided

            return calibrate_aided(record, settings, settings.method, progress)
        case None:
            from inercal.imu.multiposition import calibrate_multiposition

            return calibrate_multiposition(record, settings, progress)
