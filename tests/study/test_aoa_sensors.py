"""Sensors in the study of an angle of attack: scales and biases as data sheets state them, calibrations of ours."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from numpy.testing import assert_allclose
from sting_study import DEG, G
from sting_text import calibrated, same, study, with_sensor

from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.sensors import MOST
from inercal.foundation.errors import InputError, StudyError
from inercal.systems.aoa.settings import SensorCalibration
from rows import for_each

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


@for_each(
    ("sensor", "text", "scale", "per"),
    [
        ("a1", "1", 1.0, "1"),
        ("a1", 1.002, 1.002, "1"),
        ("a1", "0.5 g/V", 0.5 * G, "V"),
        ("a1", "0.5 g / V", 0.5 * G, "V"),
        ("a1", "500 mg/mV", 500.0 * G, "V"),
        ("a1", "2 V/g", 0.5 * G, "V"),
        ("a1", "-61 ug/count", -61e-6 * G, "count"),
        ("a1", "16384 LSB/g", G / 16384.0, "count"),
        ("a1", "200 mV/(m/s^2)", 5.0, "V"),
        ("a1", "5 m/s^2/V", 5.0, "V"),
        ("gyro", "20 deg/s/V", 20.0 * DEG, "V"),
        ("gyro", "0.02 (deg/s)/mV", 20.0 * DEG, "V"),
        ("gyro", "50 mV/(deg/s)", 20.0 * DEG, "V"),
        ("gyro", "50 mV/deg/s", 20.0 * DEG, "V"),
        ("gyro", "131 count/(deg/s)", DEG / 131.0, "count"),
        ("gyro", "7.63 mdeg/s/LSB", 7.63e-3 * DEG, "count"),
    ],
)
def test_scales_as_data_sheets_state_them(sensor, text, scale, per):
    """So much per volt or count, or volts or counts per so much: one is the inverse of the other."""
    found = with_sensor(name=sensor, scale=text).calibration(sensor)
    assert found.scale == pytest.approx(scale, rel=1e-12)
    assert found.per == per


def test_biases_and_temperature_terms():
    found = with_sensor(
        scale="0.5 g/V", bias="2.5 V", range="2 g", scale_slope="50 ppm/K", bias_slope="-10 ug/degC",
        temperature="25 degC",
    ).calibration("a1")  # fmt: skip
    expected = SensorCalibration(0.5 * G, 1.25 * G, 2.0 * G, 50e-6, -10e-6 * G, 25.0, "V")
    same(found, expected)
    assert with_sensor(scale="0.5 g/V", bias="3 mg").calibration("a1").bias == pytest.approx(3e-3 * G)
    gyro = with_sensor(name="gyro", bias="0.1 deg/s", bias_slope="1 deg/h/K").calibration("gyro")
    assert (gyro.bias, gyro.bias_slope) == pytest.approx((0.1 * DEG, DEG / 3600.0))


@given(
    scale=st.floats(0.1, 1e3), bias=st.floats(-10.0, 10.0), slope=st.floats(-1e-3, 1e-3), warmer=st.floats(-50.0, 50.0)
)  # fmt: skip
def test_what_is_indicated_means_what_was_measured(scale, bias, slope, warmer):
    """The calibration and its inverse, at any temperature."""
    of = SensorCalibration(scale, bias, scale_slope=slope, bias_slope=slope, temperature=20.0)
    value = np.linspace(-20.0, 20.0, 5)
    assert_allclose(of.measured(of.indicated(value, 20.0 + warmer), 20.0 + warmer), value, atol=1e-12)
    # f = indication x scale - bias, by hand
    expected = 3.0 * scale * (1 + slope * warmer) - bias - slope * warmer
    assert of.measured(np.array(3.0), 20.0 + warmer) == pytest.approx(expected, abs=1e-12)


def test_a_calibration_of_ours_in_place_of_scale_and_bias(tmp_path):
    """output = K0 + K1 a, so a = output / K1 - K0 / K1; a channel that the map negates turns the bias alone."""
    k1 = 1660.0
    calibrated(
        tmp_path / "imu.json",
        K0_x=(739.0, "count"), K1_x=(k1, "count/(m/s^2)"), K0_y=(-3.0, "count"), K1_y=(1000.0, "count/(m/s^2)"),
        D_F_y=(2.0, "mV"), S_y=(50.0, "mV/(rad/s)"),
    )  # fmt: skip
    where = tmp_path / "s.toml"
    found = with_sensor(where, scale=None, calibration="imu.json", channel="x").calibration("a1")
    truth = np.array([-9.0, 0.0, 3.0])
    assert_allclose(found.measured(739.0 + k1 * truth), truth, atol=1e-12)
    assert found.per == "count"
    gyro = with_sensor(where, "gyro", calibration="imu.json", channel="-y").calibration("gyro")
    # the record holds -(D_F + S w) in volts, of a sensor whose axis points nose-down: w = -theta'
    assert_allclose(gyro.measured(-(2.0 + 50.0 * -truth) * 1e-3), truth, atol=1e-12)
    assert gyro.per == "V"
    assert with_sensor(where, "gyro", calibration="imu.json").calibration("gyro").bias == pytest.approx(0.04)
    calibrated(tmp_path / "g.json", K0_z=(0.01, "g"), K1_z=(1.002 / G, "g/(m/s^2)"))
    found = with_sensor(where, scale=None, calibration="g.json").calibration("a1")
    assert (found.scale, found.bias, found.per) == pytest.approx((1 / 1.002, 0.01 * G / 1.002, "1"))


def test_calibrations_that_do_not_fit(tmp_path):
    where = tmp_path / "s.toml"
    calibrated(tmp_path / "two.json", K0_x=(0.0, "g"), K1_x=(1.0, "1"), K0_y=(0.0, "g"), K1_y=(1.0, "1"))
    for keys, words in (
        ({"calibration": "none.json"}, r"sensors.a1.calibration: .*none.json: cannot be read"),
        ({"calibration": "two.json"}, "sensors.a1.channel: missing, expected which of x, y this sensor is"),
        ({"calibration": "two.json", "channel": "z"}, "sensors.a1.channel: found 'z', expected one of x, y"),
        ({"calibration": "two.json", "bias": "1 g"}, "sensors.a1: found calibration and bias"),
        ({"channel": "x"}, "sensors.a1: channel: found without calibration"),
    ):
        with pytest.raises(StudyError, match=words):
            with_sensor(where, scale=None, **keys)
    with pytest.raises(
        StudyError, match=r"sensors\.gyro\.calibration: found no S_x and D_F_x, .. in two.json"
    ):
        with_sensor(where, "gyro", calibration="two.json")
    for scale, offset, unit, words in (
        (0.0, 1.0, "g", "found K1_x = 0 and K0_x = 1 in one.json, expected a scale factor and an offset"),
        (1e-320, 1.0, "g", "expected a scale factor and an offset"),
        (1.0, math.nan, "g", "found K1_x = 1 and K0_x = nan"),
        (1.0, 0.0, "deg", "found K0_x in deg, expected a unit of acceleration, V or count"),
        (1.0, 0.0, "junk", r"s\.toml: sensors\.a1\.calibration: found the unit 'junk'"),
    ):
        calibrated(tmp_path / "one.json", K0_x=(offset, unit), K1_x=(scale, "1"))
        with pytest.raises(InputError, match=words):
            with_sensor(where, scale=None, calibration="one.json")


def test_more_accelerometers_and_gyros():
    sensors = {f"a{k}": {"angle": f"{15 * k} deg", "r": "10 mm", "z": f"{k} mm"} for k in range(1, MOST + 1)}
    found = study(sensors=sensors | {"gyro_roll": {}, "gyro_yaw": {"range": "1 rad/s"}})
    assert found.layout.names == tuple(sensors)
    assert_allclose(found.layout.angle, np.arange(1, MOST + 1) * 15.0 * DEG)
    assert_allclose(found.layout.z, np.arange(1, MOST + 1) * 1e-3)
    assert found.calibration("gyro_yaw").range == 1.0
    VALIDATOR.validate(found.given)


def test_examples_in_the_schema_are_accepted():
    """Of sensors, where a scale has many forms."""
    for table, sensor in (("AccelerometerTable", "a1"), ("RateGyroTable", "gyro")):
        for key, node in SCHEMA["$defs"][table]["properties"].items():
            for example in node.get("examples", ()) if key not in ("calibration", "angle", "bias") else ():
                assert with_sensor(name=sensor, **{key: example}), (table, key, example)


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    text=st.from_regex(
        r"[+-]?[0-9.]{1,4}(e[+-]?[0-9])? ?(g|V|deg|s|count|/|\(|\)|m|\^2| |K){0,7}", fullmatch=True
    )
)
def test_any_scale_is_read_or_refused_in_one_sentence(text):
    try:
        found = with_sensor(scale=text, bias=text).calibration("a1")
    except StudyError as error:
        said = str(error)
    else:
        said = ""
        assert 0.0 < abs(found.scale) < math.inf
        assert math.isfinite(found.bias)
    assert "\n" not in said
