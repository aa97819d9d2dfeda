"""New studies of each kind, with the keys in force, and keys of which a table of a study holds one."""

from __future__ import annotations

import tomllib
from collections.abc import Collection
from typing import Any, Final

#: keys of which a table of a study holds one: ways to state positions, a path, a distribution
POSITIONS: Final = ("grid", "plan", "list", "file")
PATHS: Final = ("turns", "path")
DISTRIBUTIONS: Final = ("uniform", "normal", "triangular", "two_point")

UNKNOWN: Final = "?"
"""The value of a key that the user must fill in."""

_COMMON = '[site]\nlatitude = "?"\n[traceability]\n[conditions]\n'

_TURNTABLE = (
    _COMMON
    + """
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = { uniform = "2 arcmin" }
[positions]
grid = { phi1 = 36, phi2 = 36, offset = "half" }
[analysis]
outputs = ["ax", "ay", "az", "wx", "wy"]
method = "exact"
[design]
positions = 24
criterion = "D"
"""
)

_SELFCAL = (
    _COMMON
    + """
[rig]
kind = "three_axis_gimbals"
heading = "0 deg"
[rig.limits]
[plan]
turns = [["z", "180 deg"], ["x", "90 deg"], ["z", "-180 deg"], ["x", "90 deg"]]
rate = "1 deg/s"
step = "0.2 s"
[truth]
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]
eta = ["60 arcsec", "-90 arcsec", "120 arcsec"]
ds = ["60 arcsec", "-45 arcsec", "90 arcsec"]
do = ["-75 arcsec", "50 arcsec", "-100 arcsec"]
ka0 = ["100 ug", "-150 ug", "200 ug"]
ka1 = ["500 ppm", "-300 ppm", "800 ppm"]
[noise]
angle_random_walk = "5e-4 deg/sqrt(h)"
accelerometer = "10 ug"
encoder = "2 arcsec"
[prior]
kg0 = "0.3 deg/h"
eta = "300 arcsec"
ds = "300 arcsec"
do = "300 arcsec"
ka0 = "500 ug"
ka1 = "1500 ppm"
[goal]
[filter]
kind = "error-state"
[disturbances]
[design]
turns = 5
"""
)

_AOA = (
    _COMMON
    + """
[rig]
kind = "sting"
[sensors.a1]
axis = "-z"
r = "-0.25 m"
[sensors.a2]
axis = "+x"
r = "0.20 m"
[sensors.a3]
axis = "+z"
r = "0.25 m"
[sensors.gyro]
[noise]
accelerometer = "1e-4 g"
accelerometer_bias = "1e-4 g"
gyro = "0.2 deg/s"
gyro_bias = "5 deg/h"
[prior]
[prior.heave]
[prior.axial]
[motion]
kind = "sine"
duration = "60 s"
sample_rate = "1 kHz"
mean = "30 deg"
amplitude = "10 deg"
frequency = "1 Hz"
[disturbances]
[timing]
[estimator]
states = 19
[methods]
[model]
[flow]
"""
)

_STRAPDOWN = (
    _COMMON
    + """
[strapdown]
frame = "upper"
terms = ["k2", "size", "delay"]
[noise]
angle_random_walk = "0.05 deg/sqrt(h)"
velocity_random_walk = "50 ug/sqrt(Hz)"
[rests]
velocity = "0.2 mm/s"
[start]
[prior]
gyro_bias = "30 deg/h"
scale = "1000 ppm"
misalignment = "300 arcsec"
bias = "5 mg"
k1 = "1000 ppm"
axes = "300 arcsec"
[plan]
start = ["0 deg", "-90 deg", "0 deg"]
turns = [["z", "90 deg"], ["y", "180 deg"], ["x", "90 deg"], ["y", "180 deg"], ["x", "90 deg"]]
turn_time = "4 s"
dwell = "20 s"
first_dwell = "60 s"
[motion]
"""
)


def imu_study(channels: Collection[str]) -> dict[str, Any]:
    """Keys of a new study of an IMU, whose method follows from the channels of the recording."""
    method = "aided" if "phi1" in channels else "ferraris" if "label" in channels else "multiposition"
    return _keys(f'{_COMMON}[imu]\nmethod = "{method}"\n')


def strapdown_study() -> dict[str, Any]:
    """Keys of a new study of a strapdown unit."""
    return _keys(_STRAPDOWN)


def turntable_study(channels: Collection[str]) -> dict[str, Any]:
    """Keys of a new study of a turntable: of a rate test where the channels of the recording have a rate."""
    return _keys(_TURNTABLE) | ({"rate_test": {}} if "rate" in channels else {})


def selfcal_study() -> dict[str, Any]:
    """Keys of a new study of a self-calibration."""
    return _keys(_SELFCAL)


def aoa_study() -> dict[str, Any]:
    """Keys of a new study of an angle of attack."""
    return _keys(_AOA)


def _keys(text: str) -> dict[str, Any]:
    """Keys of a study: it loads as it is, but for those that must be filled in."""
    return {"schema": 1, **tomllib.loads(text)}


def of_sections(table: str) -> dict[str, Any]:
    """The keys of a study that a table of sections by this name is by itself."""
    return {"site": {"latitude": UNKNOWN}, "imu": {"method": "sections", "sections": table}}
