"""What a calibration of an IMU is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from inercal.geometry.site import Site
from inercal.imu.aided.settings import AidedSettings
from inercal.imu.ferraris.settings import FerrarisSettings
from inercal.units import Quantity

MASKED = ("saturation",)
"""Codes of a recording's findings whose samples no fit uses: turns in which a sensor saturates are left out."""

COMMAND = "calibrate imu"
"""The command behind every method of this room, as its results have it."""


@dataclass(frozen=True)
class ImuSettings:
    """Settings of a calibration, in SI.

    Attributes
    ----------
    site : Site
        Local gravity and what it is uncertain by.
    static_start : float or None
        Length of the still period at the start [s]; None: to be found.
    g_sensitivity : bool
        Also estimate the g-sensitive drift of the gyro.
    bias_drift : bool
        Also estimate how the bias of the gyro drifts with time.
    time_base_u : float
        Relative standard uncertainty of the record's clock.
    traceability : mapping
        ``instrument``, ``operator``, ``date``, ``reference``; empty texts where not given.
    method : FerrarisSettings, AidedSettings or None
        Options of the method; None: multi-position, un-aided.
    temperature : Quantity or None
        Temperature of the instrument.
    given : mapping
        The keys of the study that were given, and their values as typed; ready for JSON.
    """

    site: Site
    static_start: float | None = None
    g_sensitivity: bool = False
    bias_drift: bool = False
    time_base_u: float = 0.0
    traceability: Mapping[str, str] = field(default_factory=dict)
    method: FerrarisSettings | AidedSettings | None = None
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
