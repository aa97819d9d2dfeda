"""What a calibration of an IMU is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from inercal.geometry.site import Site
from inercal.imu.aided_settings import AidedSettings
from inercal.imu.ferraris_settings import FerrarisSettings
from inercal.keys import RELATIVE_U, TIME, option, quantity
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
    static_start, g_sensitivity, bias_drift, time_base_u
        As their keys say.
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
    static_start: float | None = quantity(
        "length of the still period at the start; found automatically if absent", "time", example="50 s",
        bounds=TIME,
    )  # fmt: skip
    g_sensitivity: bool = option("also estimate how the gyro's drift depends on specific force", False)
    bias_drift: bool = option("also estimate how the gyro's bias drifts with time", False)
    time_base_u: float = quantity(
        "relative standard uncertainty of the record's clock", "number", "0", example="20 ppm",
        bounds=RELATIVE_U, name="time_base",
    )  # fmt: skip
    traceability: Mapping[str, str] = field(default_factory=dict)
    method: FerrarisSettings | AidedSettings | None = None
    temperature: Quantity | None = None
    given: Mapping[str, Any] = field(default_factory=dict)
