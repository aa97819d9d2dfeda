"""Disturbances of a simulation: a sting that bends, a tunnel that shakes, sensors that err."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from inercal.foundation.errors import InputError
from inercal.foundation.keys import FREQUENCY, PART, REQUIRED, option, quantities, quantity, table, within

SIZE = within(0.0, math.pi, "an angle from 0 to 180 deg")
DELAY = within(-1.0, 1.0, "a delay from -1 s to 1 s")

_FORCE = within(0.0, math.inf, "an acceleration of 0 or more")
_SHIFT = within(-1.0, 1.0, "a length within 1 m (mm given as m?)")
_AXIS = within(-0.5, 0.5, "an angle within 0.5 rad")
_RATE = within(0.0, math.inf, "a rate of 0 or more")
_JITTER = within(0.0, 1.0, "a time from 0 to 1 s")
_K2 = within(-0.1, 0.1, "a coefficient within 0.1 s^2/m")


def check_band(low: float, high: float) -> None:
    """Raise `InputError` for a band [Hz] without width."""
    if not low < high:
        raise InputError("low", f"found {low:g} Hz with high {high:g} Hz, expected the lower one here")


@dataclass(frozen=True)
class Shaking:
    """A random vibration, equal sines of random frequency and phase."""

    rms: float = quantity("in all", "acceleration", REQUIRED, example="0.03 g", bounds=_FORCE)
    low: float = quantity("lowest frequency", "frequency", REQUIRED, example="8 Hz", bounds=FREQUENCY)
    high: float = quantity("highest frequency", "frequency", REQUIRED, example="10 Hz", bounds=FREQUENCY)

    def __post_init__(self) -> None:
        """Refuse a band without width."""
        check_band(self.low, self.high)


@dataclass(frozen=True)
class AngleShaking(Shaking):
    """A random vibration of an angle, equal sines of random frequency and phase."""

    rms: float = quantity("in all", "angle", REQUIRED, example="0.1 deg", bounds=SIZE)


@dataclass(frozen=True)
class Oscillation:
    """A rigid oscillation: a sine."""

    amplitude: float = quantity("of the angle", "angle", REQUIRED, example="1 deg", bounds=SIZE)
    frequency: float = quantity("of the sine", "frequency", REQUIRED, example="8 Hz", bounds=FREQUENCY)


@dataclass(frozen=True)
class VibrationLine:
    """A line of the tunnel's vibration: a sine of random phase that shakes the whole model along z and x."""

    frequency: float = quantity("of the line", "frequency", REQUIRED, example="112 Hz", bounds=FREQUENCY)
    level: float = quantity("amplitude along z", "acceleration", REQUIRED, example="0.3 g", bounds=_FORCE)
    axial: float = quantity("amplitude along x", "acceleration", "0 g", example="0.1 g", bounds=_FORCE)


@dataclass(frozen=True)
class Mains:
    """Pick-up of the mains: a sine in each channel by itself, of random phase."""

    level: float = quantity(
        "amplitude in each accelerometer", "acceleration", REQUIRED, example="50 mg", bounds=_FORCE
    )
    rate: float = quantity("amplitude in each gyro", "rate", "0 deg/s", example="0.5 deg/s", bounds=_RATE)
    frequency: float = quantity("of the mains", "frequency", "50 Hz", bounds=FREQUENCY)


@dataclass(frozen=True)
class Plunge:
    """The whole model goes up and down: a sine of random phase along the vertical."""

    level: float = quantity("amplitude", "acceleration", REQUIRED, example="0.02 g", bounds=_FORCE)
    frequency: float = quantity("of the plunge", "frequency", REQUIRED, example="2 Hz", bounds=FREQUENCY)


@dataclass(frozen=True)
class Disturbances:
    """Disturbances that a simulation adds to the rigid, well-known model; none if absent.

    ``heights`` are added to each z, ``axis_errors`` to each lambda; ``rectification`` is K2 of f + K2 f^2. Spikes of
    gyros are ``spike`` over 9.80665 in rad/s.
    """

    pitch: AngleShaking | None = table(
        "flexure of the sting in pitch", None, example={"rms": "0.1 deg", "low": "8 Hz", "high": "10 Hz"}
    )
    heave: Shaking | None = table(
        "flexure along z", None, example={"rms": "0.03 g", "low": "8 Hz", "high": "10 Hz"}
    )
    axial: Shaking | None = table(
        "flexure along x", None, example={"rms": "0.005 g", "low": "14 Hz", "high": "16 Hz"}
    )
    roll: Oscillation | None = table(
        "roll coupled in; adds gyro_roll and gyro_yaw",
        None,
        example={"amplitude": "1 deg", "frequency": "8 Hz"},
    )
    yaw: Oscillation | None = table(
        "yaw coupled in; adds gyro_roll and gyro_yaw",
        None,
        example={"amplitude": "1 deg", "frequency": "8 Hz"},
    )
    buffet: AngleShaking | None = table(
        "random pitching by the stream, 150 sines, beside the motion", None,
        example={"rms": "0.1 deg", "low": "5 Hz", "high": "40 Hz"},
    )  # fmt: skip
    plunge: Plunge | None = table(
        "the whole model goes up and down", None, example={"level": "0.02 g", "frequency": "2 Hz"}
    )
    lines: tuple[VibrationLine, ...] = table(
        "lines of the tunnel's vibration, which shake the whole model", (),
        example=[{"frequency": "112 Hz", "level": "0.3 g"}],
    )  # fmt: skip
    local_vibration: Shaking | None = table(
        "of each accelerometer by itself, as of the structure that it sits on", None,
        example={"rms": "0.5 g", "low": "120 Hz", "high": "240 Hz"},
    )  # fmt: skip
    mains: Mains | None = table(
        "pick-up in each channel by itself", None, example={"level": "50 mg", "frequency": "50 Hz"}
    )
    sample_rates: Mapping[str, float] = quantity(
        "of sensors that are slower than motion.sample_rate, which is a whole number of times theirs; the recording "
        "then goes to .h5 or .nc", "frequency", {}, example={"gyro": "250 Hz"}, bounds=FREQUENCY, exact=True,
    )  # fmt: skip
    pivot: float = quantity("added to all positions r", "length", "0 m", example="3 mm", bounds=_SHIFT)
    heights: tuple[float, ...] = quantities(
        "added to the heights z, one for each accelerometer; 0 if absent", "length",
        example=["5 mm", "-3 mm", "5 mm"], bounds=_SHIFT,
    )  # fmt: skip
    axis_errors: tuple[float, ...] = quantities(
        "added to the angles of the axes, one for each accelerometer; 0 if absent", "angle",
        example=["0 deg", "0.3 deg", "0 deg"], bounds=_AXIS,
    )  # fmt: skip
    rectification: float = quantity(
        "second-order coefficient K2 of all accelerometers, which makes an offset of vibration", "quadratic",
        "0 ug/g^2", example="500 ug/g^2", bounds=_K2,
    )  # fmt: skip
    bias_drift: tuple[float, ...] = quantities(
        "change of the bias from begin to end, one for each accelerometer; 0 if absent", "acceleration",
        example=["0 mg", "1 mg", "0 mg"],
    )  # fmt: skip
    gyro_scale: float = quantity(
        "scale error of the gyro", "number", "0", example="0.1 %", bounds=within(-0.5, 0.5, "within 50 %")
    )
    gyro_delay: float = quantity(
        "by which the gyro comes later than the accelerometers", "time", "0 s", example="2 ms", bounds=DELAY
    )
    common_delay: float = quantity(
        "by which all sensors come later than their stamps", "time", "0 s", example="0.5 ms", bounds=DELAY
    )
    stamp_jitter: float = quantity(
        "standard deviation of the times of the samples about their stamps", "time", "0 s", example="0.1 ms",
        bounds=_JITTER,
    )  # fmt: skip
    bandwidth: float = quantity(
        "of all sensors, first order; without limit if absent", "frequency", math.inf, example="100 Hz",
        bounds=FREQUENCY,
    )  # fmt: skip
    spikes: float = quantity(
        "part of the samples of each sensor that are spikes", "number", "0", example="0.01 %", bounds=PART
    )
    spike: float = quantity(
        "size of a spike, of a gyro 1 rad/s for each g", "acceleration", "0.5 g", bounds=_FORCE
    )
    clip: bool = option("limit sensors to their ranges", False)
    dropouts: float = quantity("part of the rows that are empty", "number", "0", example="1 %", bounds=PART)
