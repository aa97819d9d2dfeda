"""A simulated recording as a record: read with its study it means the same, in whatever unit it is recorded."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from sting_study import DEG, SCENARIOS, G, scenario

from inercal.foundation.errors import StudyError
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.motion import MotionPlan, buffet, course, duration
from inercal.systems.aoa.reading.from_record import recording_of
from inercal.systems.aoa.settings import SensorCalibration
from inercal.systems.aoa.simulate import simulate, to_record
from rows import for_each

#: sensors in volts and counts, with biases and temperature terms
RAW = {
    "a1": SensorCalibration(0.5 * G, 1.25 * G, 10.0 * G, 50e-6, 1e-4 * G, 25.0, "V"),
    "a2": SensorCalibration(-61e-6 * G, 0.01 * G, per="count"),
    "a3": SensorCalibration(1.002, -0.02, bias_slope=1e-3),
    "gyro": SensorCalibration(20.0 * DEG, 0.5 * DEG, scale_slope=-1e-4, per="V"),
}


def at(celsius):
    return Quantity(celsius, 0.0, parse_unit("degC"), f"{celsius} degC")


def same(found, expected, atol=1e-11):
    for name in ("t", "acc", "gyro", "turns", "reference"):
        assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-10, atol=atol, err_msg=name)
    if expected.point is None:
        assert found.point is None
    else:
        assert_array_equal(found.point, expected.point)


@for_each("name", [each for each in SCENARIOS if each != "clipping"])
@for_each("raw", [False, True])
def test_read_again_with_its_study_it_is_the_same(name, raw):
    settings = scenario(name) if name == "pitch-pause" else scenario(name, duration=2.0)
    if raw:
        settings = replace(settings, sensors=RAW, temperature=at(31.0))
    made = simulate(settings, np.random.default_rng(5)).recording
    record = to_record(made, settings)
    units = {column.name: column.unit.symbol for column in record.columns.values()}
    assert [units[each] for each in ("a1", "a2", "a3", "gyro")] == (
        ["V", "count", "g", "V"] if raw else ["g", "g", "g", "deg/s"]
    )
    assert ("temperature" in units) == raw
    same(recording_of(record, settings), made)


@given(
    n=st.integers(1, 400),
    begin=st.floats(-50.0, 50.0),
    step=st.floats(1e-4, 0.1),
    seed=st.integers(0, 99),
    uneven=st.booleans(),
)
def test_a_buffet_is_the_sum_of_its_sines_at_even_and_other_times(n, begin, step, seed, uneven):
    """With rate and acceleration, of 0.1 to 40 Hz within 60 s, whatever is computed from what."""
    rng = np.random.default_rng(seed)
    of, t = buffet(1.0, 0.1, 40.0, rng, 20), begin + step * np.arange(n)
    if uneven:
        t = t + 0.3 * step * rng.random(n)
    sines = np.exp(1j * (np.outer(t, of.omega) + of.phase)) * of.amplitude
    expected = (sines.imag.sum(1), (of.omega * sines).real.sum(1), -(of.omega**2 * sines).imag.sum(1))
    for k, (found, wanted) in enumerate(zip(of(t), expected, strict=True)):
        assert_allclose(found, wanted, rtol=0.0, atol=1e-10 * np.max(of.omega) ** k)


def test_volts_by_hand():
    """0.5 g/V about 2.5 V at 25 degC; 6 K warmer the scale is 300 ppm larger, the bias 0.6 mg."""
    settings = replace(scenario("base", duration=1.0), sensors=RAW, temperature=at(31.0))
    made = simulate(settings, np.random.default_rng(5)).recording
    volts = to_record(made, settings)["a1"].values
    assert_allclose(volts, (made.acc[:, 0] / G + 1.25 + 6e-4) / (0.5 * (1 + 3e-4)), rtol=1e-12)


def test_gyros_for_roll_and_yaw_come_with_such_motion(tmp_path):
    settings = scenario("base", duration=2.0)
    settings = replace(settings, disturbances=Disturbances(yaw=Oscillation(DEG, 8.0), dropouts=0.1))
    made = simulate(settings, np.random.default_rng(2)).recording
    write_record(to_record(made, settings), tmp_path / "a.csv")
    record = read(tmp_path / "a.csv")
    assert {"gyro_roll", "gyro_yaw", "theta_ref"} <= record.columns.keys()
    found = recording_of(record, settings)
    assert found.spatial
    same(found, made)


def test_saturation_is_that_of_what_is_measured_and_is_masked_on_reading():
    """A range is about the zero point, also of a sensor that indicates 2.5 V there: 0.95 g are 4.4 V and 0.6 V."""
    limit = 0.95 * G
    sensors = {
        "a2": SensorCalibration(0.5 * G, 1.25 * G, limit, per="V"),
        "gyro": SensorCalibration(range=40.0 * DEG),
    }
    plan = MotionPlan("sine", 4.0, amplitude=80.0 * DEG, frequency=0.5)
    settings = replace(scenario("clipping"), motion=plan, sensors=sensors)
    made = simulate(settings, np.random.default_rng(1)).recording
    record = to_record(made, settings)
    volts = record["a2"].values
    assert (volts.min(), volts.max()) == (pytest.approx(0.6), pytest.approx(4.4))
    found = recording_of(record, settings)
    ends = np.abs(made.acc[:, 1]) > limit - 1e-9
    assert ends.sum() > 500
    assert_array_equal(np.isnan(found.acc[:, 1]), ends)
    assert_array_equal(np.isnan(found.gyro), np.abs(made.gyro) > 40.0 * DEG - 1e-9)


def test_a_motion_from_a_file_is_followed(tmp_path):
    """A recorded angle through a spline: the angle itself, and its derivatives; no longer than the file."""
    path = tmp_path / "pitch.csv"
    t = np.arange(0.0, 3.0, 0.01)
    path.write_text(
        "t [s],theta_ref [deg]\n" + "".join(f"{a + 7.0:.17g},{5 * np.sin(4 * a):.17g}\n" for a in t.tolist())
    )
    plan = MotionPlan("file", path=path, duration=np.inf)
    assert duration(plan) == pytest.approx(t[-1])
    assert duration(replace(plan, duration=1.0)) == 1.0
    theta, rate, acceleration = course(plan, np.random.default_rng(0))(t)
    assert_allclose(theta, 5 * DEG * np.sin(4 * t), atol=1e-9)
    inner = slice(20, -20)  # at its ends a spline is less sure of derivatives
    assert_allclose(rate[inner], 20 * DEG * np.cos(4 * t[inner]), atol=1e-7)
    assert_allclose(acceleration[inner], -80 * DEG * np.sin(4 * t[inner]), atol=1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t [s],a1 [g]\n0,1\n1,1\n", "no column theta_ref"),
        ("t [s],theta_ref [deg]\n0,1\n1,1\n", "found no motion in .*expected 6 rows"),
        ("t [s],theta_ref [deg]\n" + "0,1\n" * 9, "found no motion in"),
        (None, "motion.file: .*cannot be read|motion.file: .*no such"),
    ],
)
def test_files_without_a_motion(text, words, tmp_path):
    path = tmp_path / "pitch.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(StudyError, match=words):
        course(MotionPlan("file", path=path), np.random.default_rng(0))
