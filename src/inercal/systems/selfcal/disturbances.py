"""Disturbances of a simulated platform that its model does not have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from inercal.foundation.keys import (
    FREQUENCY,
    PART,
    REQUIRED,
    above_zero,
    option,
    quantities,
    quantity,
    table,
    within,
)


@dataclass(frozen=True)
class EncoderHarmonic:
    """An error of an encoder that repeats with its angle: amplitude times sin(order times angle + phase)."""

    axis: Literal["x", "y", "z"] = option("the joint")
    order: int = option("periods in a full turn", least=1, most=100_000)
    amplitude: float = quantity("of the error", "angle", REQUIRED, example="5 arcsec")
    phase: float = quantity("at angle 0; 0 if absent", "angle", 0.0, example="40 deg")


@dataclass(frozen=True)
class Sway:
    """Sway of the base about two level axes, a quarter of a period apart."""

    amplitude: float = quantity(
        "about each axis", "angle", REQUIRED, example="2 arcsec", bounds=above_zero("an angle")
    )
    frequency: float = quantity("of both", "frequency", REQUIRED, example="0.3 Hz", bounds=FREQUENCY)


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that a simulation adds to the model; none if absent.

    ``substeps`` of the truth lie between two rows.
    """

    harmonics: tuple[EncoderHarmonic, ...] = table(
        "errors of the encoders; none if absent", (),
        example=[{"axis": "z", "order": 2, "amplitude": "5 arcsec", "phase": "0 deg"}],
    )  # fmt: skip
    base_sway: Sway | None = table(
        "sway of the base; none if absent", None, example={"amplitude": "2 arcsec", "frequency": "0.3 Hz"}
    )
    dropouts: float = quantity(
        "part of the rows without accelerometers and angles", "number", "0", example="1 %", bounds=PART
    )
    command_delay: float = quantity(
        "by which the platform acts later than commanded", "time", "0 s", example="0.2 s",
        bounds=within(0.0, math.inf, "a time of 0 or more"),
    )  # fmt: skip
    accelerometer_walk: float = quantity(
        "of their biases about their means, within 60 s", "acceleration random walk", "0 ug/sqrt(s)",
        example="0.35 ug/sqrt(s)", bounds=within(0.0, math.inf, "a walk of 0 or more"),
    )  # fmt: skip
    gyro_walk: float = quantity(
        "the same of the gyros", "rate random walk", "0 deg/h/sqrt(s)", example="1e-4 deg/h/sqrt(s)",
        bounds=within(0.0, math.inf, "a walk of 0 or more"),
    )  # fmt: skip
    temperature: tuple[float, ...] = quantities(
        "of the platform, at times evenly from the first row to the last; constant if absent", "temperature",
        example=["20 degC", "21 degC"], at_least=2,
    )  # fmt: skip
    flicker: float = quantity(
        "1/f noise of the accelerometers, the floor of their Allan deviation", "acceleration", "0 ug", example="1 ug",
        bounds=within(0.0, math.inf, "a deviation of 0 or more"),
    )  # fmt: skip
    gyro_flicker: float = quantity(
        "the same of the gyros", "rate", "0 deg/h", example="0.001 deg/h",
        bounds=within(0.0, math.inf, "a deviation of 0 or more"),
    )  # fmt: skip
    servo_jitter: float = quantity(
        "random rate of the drive about each axis, which is commanded too", "rate", "0 deg/s", example="0.01 deg/s",
        bounds=within(0.0, math.inf, "a rate of 0 or more"),
    )  # fmt: skip
    stamp_jitter: float = quantity(
        "standard deviation of the time stamps", "time", "0 s", example="0.1 ms",
        bounds=within(0.0, math.inf, "a time of 0 or more"),
    )  # fmt: skip
    quantisation: float = quantity(
        "step of the encoders' readings", "angle", "0 arcsec", example="1 arcsec",
        bounds=within(0.0, math.inf, "an angle of 0 or more"),
    )  # fmt: skip
    lost_rows: float = quantity(
        "part of the rows that are not in the file", "number", "0", example="1 %", bounds=PART
    )
    vibration: float = quantity(
        "root mean square along each axis, of many frequencies above those of the rows", "acceleration", "0 ug",
        example="1 mg", bounds=within(0.0, math.inf, "a vibration of 0 or more"),
    )  # fmt: skip
    substeps: int = 10
