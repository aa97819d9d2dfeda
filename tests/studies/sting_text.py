"""Studies of a sting as people write them, and calibrations beside them, for tests."""

import copy
import tomllib
from dataclasses import fields, is_dataclass

import numpy as np
from numpy.testing import assert_allclose

from inercal.faces.studies.aoa import aoa_study
from inercal.foundation.findings import Status
from inercal.foundation.results.files import save
from inercal.foundation.results.result import Estimate

# The study of the interface description, to the letter.
CONTRACT = """
# aoa
[site]
latitude = "40 deg"              # every study kind takes latitude and height; an explicit gravity wins
height = "0 m"
gravity = "9.80665 m/s^2"
[rig]
kind = "sting"
[sensors.a1]
axis = "-z"                      # or angle = "90 deg", lambda
r = "-0.25 m"
z = "0 m"
scale = "1"                      # optional: scale, bias, range, temperature terms, or calibration = "file"
[sensors.a2]
axis = "+x"
r = "0.20 m"
[sensors.a3]
axis = "+z"
r = "0.25 m"
[sensors.gyro]
range = "40 deg/s"               # optional; samples at or beyond a range, or flat at an extreme, are masked
[noise]                          # per sample
accelerometer = "1e-4 g"
accelerometer_bias = "1e-4 g"
gyro = "0.2 deg/s"
gyro_bias = "5 deg/h"
[motion]                         # for simulate
kind = "sine"
mean = "30 deg"
amplitude = "10 deg"
frequency = "1 Hz"
[timing]
gyro_delay = "estimate"          # the default, or a value; causal output uses only past samples for it
common_delay = "0.5(1) ms"
[estimator]
states = 19
prior = "last.json"              # optional: the posterior of an earlier run
"""


def study(path="s.toml", **tables):
    """The study of the contract with these tables in place of its own; None leaves one out."""
    data = tomllib.loads(CONTRACT) | tables
    return aoa_study({key: table for key, table in data.items() if table is not None}, path)


def with_sensor(path="s.toml", name="a1", **keys):
    """The study of the contract with more keys of a sensor; None leaves one out."""
    sensors = copy.deepcopy(tomllib.loads(CONTRACT)["sensors"])
    of = sensors.setdefault(name, {})
    of |= keys
    sensors[name] = {key: value for key, value in of.items() if value is not None}
    return study(path, sensors=sensors)


def same(found, expected):
    """Equal settings but for rounding."""
    if is_dataclass(expected):
        for each in fields(expected):
            same(getattr(found, each.name), getattr(expected, each.name))
    elif isinstance(expected, float | np.ndarray) and not isinstance(expected, bool):
        assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    else:
        assert found == expected


#: the reference scenarios as people write them: changes to the study of the contract
WRITTEN = {
    "base": {},
    "large": {
        "sensors": {
            "a1": {"angle": "90 deg", "r": "-250 mm"},
            "a2": {"angle": "0 deg", "r": "0.5 m"},
            "a3": {"angle": "-90 deg", "r": "25 cm"},
        },
        "motion": {"kind": "sine", "mean": "30 deg", "amplitude": "16 deg", "frequency": "1 Hz"},
    },
    "chirp": {
        "motion": {"kind": "chirp", "mean": "20 deg", "amplitude": "5 deg", "low": "0.1 Hz", "high": "5 Hz"}
    },
    "buffet": {
        "motion": {"kind": "buffet", "mean": "45 deg", "rms": "0.2 deg", "low": "2 Hz", "high": "15 Hz"}
    },
    "pitch-pause": {
        "motion": {
            "kind": "pitch-pause", "first": "-10 deg", "last": "90 deg", "step": "10 deg", "rms": "0.05 deg",
            "low": "3 Hz", "high": "15 Hz",
        }
    },
    "flexure": {
        "disturbances": {
            "pitch": {"rms": "0.1 deg", "low": "8 Hz", "high": "10 Hz"},
            "heave": {"rms": "0.03 g", "low": "8 Hz", "high": "10 Hz"},
            "axial": {"rms": "5 mg", "low": "14 Hz", "high": "16 Hz"},
        }
    },
    "pivot": {"disturbances": {"pivot": "3 mm"}},
    "heights": {"disturbances": {"heights": ["5 mm", "-3 mm", "5 mm"]}},
    "clipping": {
        "disturbances": {"clip": True},
        "sensors": {
            "a1": {"axis": "-z", "r": "-0.25 m", "range": "0.95 g"},
            "a2": {"axis": "+x", "r": "0.20 m", "range": "0.95 g"},
            "a3": {"axis": "+z", "r": "0.25 m", "range": "0.95 g"},
            "gyro": {"range": "40 deg/s"},
        },
    },
}  # fmt: skip


def calibrated(path, **parameters):
    """A calibration file with these parameters: value, unit."""
    names = tuple(parameters)
    values = np.array([value for value, _ in parameters.values()])
    units = tuple(unit for _, unit in parameters.values())
    n = len(names)
    made = Estimate("calibrate imu", names, units, values, np.eye(n), np.full(n, 9.0), Status.OK, "")
    save(made, path)
