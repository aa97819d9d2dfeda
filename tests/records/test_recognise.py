"""Recognised is what words, numbers and physics say; what none of them says is asked, and no sensor is invented."""

import time
import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.clocks import clock
from inercal.foundation.records.recognise.lines import heading
from inercal.foundation.records.recognise.map_text import guess_map
from inercal.foundation.records.recognise.physics import G0, gravity_unit, lattice_unit, turns
from inercal.foundation.records.recognise.words import said
from rows import for_each

HZ = 100.0


def turned(seed=5, rows=3000):
    """Accelerometers [m/s^2], gyro [rad/s] (n, 3) and times [s] of a unit turned slowly about all axes."""
    rng = np.random.default_rng(seed)
    t = np.arange(rows) / HZ
    rate = np.stack(
        [np.sin(t * f + p) for f, p in zip((0.7, 0.5, 0.9), rng.uniform(0, 6, 3), strict=True)], axis=1
    )
    attitude, acc = Rotation.identity(), np.empty((rows, 3))
    for k in range(rows):
        acc[k] = attitude.inv().apply([0.0, 0.0, G0])
        attitude = attitude * Rotation.from_rotvec(rate[k] / HZ)
    return acc + 0.02 * rng.standard_normal((rows, 3)), rate + 0.002 * rng.standard_normal((rows, 3)), t


ACC, GYRO, T = turned()


def written(path, head, rows, delimiter=","):
    lines = [delimiter.join(f"{value:.9g}" for value in row) for row in rows]
    path.write_text(head + "\n".join(lines) + "\n")
    return path


@for_each(
    ("name", "sensor", "axis", "unit"),
    [
        ("gyro_rad[0]", "gyro", "x", "rad/s"),
        ("accelerometer_m_s2[2]", "acc", "z", "m/s^2"),
        ("accelerometerAccelerationX(G)", "acc", "x", "g"),
        ("field.linear_acceleration.y", "acc", "y", "m/s^2"),
        ("field.angular_velocity.y", "gyro", "y", "rad/s"),
        ("ang_vel_z", "gyro", "z", ""),
        ("aceleracion_x", "acc", "x", ""),
        ("giroscopio_z", "gyro", "z", ""),
        ("Shimmer_7A1B_Accel_LN_X_CAL", "acc", "x", ""),
        ("XACCL_OUT", "acc", "x", ""),
        ("Gyro2_dps", "gyro", "y", "deg/s"),
        ("gX [mg]", "acc", "x", "mg"),
        ("mag_x", "mag", "x", ""),
        ("vel_x", "other", "x", ""),
        ("GyX", "gyro", "x", ""),
        ("gy", "gyro", "y", ""),
        ("", "", "", ""),
        ("tiempo_ms", "t", "", "ms"),
        ("X [s]", "t", "", "s"),
        ("ms", "t", "", "ms"),
        ("Kanal 2 [m/s²]", "acc", "y", "m/s^2"),
    ],
)
def test_words_say_the_sensor_its_axis_and_unit(name, sensor, axis, unit):
    words = said(name)
    assert (words.sensor, words.axis, words.unit) == (sensor, axis, unit)


def test_words_that_no_output_of_a_sensor_bears():
    assert said("bias_acc_x").never
    assert said("linear_acceleration_covariance_0").never
    assert said("userAcceleration.x").seldom
    assert not said("acc_x").never


def test_a_norm_tells_the_unit_of_gravity_and_directions_from_sensors():
    for unit, size in (("m/s^2", 1.0), ("g", 1 / G0), ("mg", 1000 / G0), ("count", 2048 / G0)):
        numbers = ACC * size
        assert gravity_unit(np.round(numbers) if unit == "count" else numbers) == unit
    assert gravity_unit(ACC / np.linalg.norm(ACC, axis=1)[:, np.newaxis]) == ""
    assert gravity_unit(GYRO) == ""


@for_each(("size", "sign"), [(1.0, 1), (180 / np.pi, 1), (500.0, -1)])
def test_turns_tell_the_unit_and_the_signs(size, sign):
    seen = turns(ACC, GYRO * [size, size, sign * size], T)
    assert seen is not None
    assert seen.size == pytest.approx(1 / size, rel=0.02)
    assert {(place, axis) for place, axis in enumerate(seen.axes, 1) if axis} <= {
        (1, 1),
        (2, 2),
        (3, 3 * sign),
    }


def test_turns_are_not_seen_where_nothing_turns_or_numbers_are_others():
    rng = np.random.default_rng(1)
    still = np.array([0.0, 0.0, G0]) + 0.02 * rng.standard_normal((3000, 3))
    assert turns(still, 0.002 * rng.standard_normal((3000, 3)), T) is None
    assert turns(ACC, rng.standard_normal((3000, 3)), T) is None


def test_steps_of_a_converter_tell_the_unit():
    counts = np.random.default_rng(2).integers(-300, 300, (500, 3))
    assert lattice_unit(np.round(counts / 131.0, 5)) == "deg/s"
    assert lattice_unit(np.round(np.radians(counts / 16.4), 6)) == "rad/s"
    assert lattice_unit(np.round(GYRO, 6)) == ""


@for_each(
    ("name", "start", "step", "unit"),
    [
        ("time", 0.0, 0.01, "s"),
        ("timestamp", 5e6, 1e4, "us"),
        ("stamp", 1.764e12, 10.0, "ms"),
        ("time_ms", 0.0, 2.0, "ms"),
    ],
)
def test_a_time_is_told_by_its_words_and_its_rate(name, start, step, unit):
    values = np.stack([np.arange(300.0), start + step * np.arange(300)], axis=1)
    found = clock(("sample", name), (), values)
    assert found is not None
    assert (found.column, found.unit) == (1, unit)
    assert clock(("sample", "n"), (), values[:, [0, 0]]) is None  # counters


@for_each("unit", ["rad/s", "deg/s"])
def test_a_gyro_without_a_unit_is_read_by_its_turns(tmp_path_factory, unit):
    """The numbers that are read are those that were measured, whatever they were written in."""
    size = 1.0 if unit == "rad/s" else 180 / np.pi
    path = written(
        tmp_path_factory.mktemp("a") / "log.csv",
        "time,ax,ay,az,gx,gy,gz\n",
        np.column_stack([T, ACC, GYRO * size]),
    )
    text = guess_map(path)
    assert "guess" not in text
    assert "certain" in text
    (path.parent / "map.toml").write_text(text)
    np.testing.assert_allclose(read(path, path.parent / "map.toml")["gyro_x"].si(), GYRO[:, 0], atol=1e-7)


@for_each(("head", "unit"), [("gx,gy,gz", "deg/s"), ("gyroADC[0],gyroADC[1],gyroADC[2]", "deg/s")])
def test_whole_degrees_per_second_are_no_counts(tmp_path_factory, head, unit):
    """By the turns; of Betaflight by its name, for a log at rest too."""
    whole = np.round(np.degrees(GYRO))
    rows = np.column_stack([T, ACC, whole if "ADC" not in head else np.sign(whole)])
    path = written(tmp_path_factory.mktemp("a") / "log.csv", f"time,ax,ay,az,{head}\n", rows)
    assert tomllib.loads(guess_map(path))["columns"]["gyro_x"]["unit"] == unit


def test_what_nothing_tells_is_asked_once(tmp_path):
    """A gyro at rest alone, without a unit."""
    rows = np.column_stack([T, 0.0123457 * GYRO])
    text = guess_map(written(tmp_path / "log.csv", "time,gx,gy,gz\n", rows))
    assert len({line for line in text.splitlines() if line.startswith('question = "Is the gyro in ')}) == 1


@for_each(
    ("header", "rows"),
    [
        ("time,x,y,z", np.column_stack([T, np.cumsum(GYRO, axis=0)])),
        ("time,nx,ny,nz", np.column_stack([T, ACC / np.linalg.norm(ACC, axis=1)[:, np.newaxis]])),
        ("time,mag_x,mag_y,mag_z", np.column_stack([T, 5 * ACC])),
        ("time,bias_acc_x,bias_acc_y,bias_acc_z", np.column_stack([T, 0.01 * ACC])),
        ("time,vel_x,vel_y,vel_z", np.column_stack([T, ACC])),
    ],
)
def test_no_sensor_is_invented(tmp_path_factory, header, rows):
    text = guess_map(written(tmp_path_factory.mktemp("a") / "log.csv", header + "\n", rows))
    assert all(line.startswith("#") for line in text.splitlines())


@for_each(
    "head",
    [
        "# time ax ay az gx gy gz\n",
        "%time,field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z,"
        "field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z\n",
        "time,ax,ay,az,gx,gy,gz\ns,m/s^2,m/s^2,m/s^2,rad/s,rad/s,rad/s\n",
    ],
)
def test_names_in_a_comment_and_units_in_a_row_of_their_own_are_read_again(tmp_path_factory, head):
    folder = tmp_path_factory.mktemp("a")
    delimiter = "," if "," in head else " "
    path = written(folder / "log.txt", head, np.column_stack([T, ACC, GYRO]), delimiter)
    (folder / "map.toml").write_text(guess_map(path))
    record = read(path, folder / "map.toml")
    np.testing.assert_allclose(record["acc_z"].si(), ACC[:, 2], atol=1e-7)
    np.testing.assert_allclose(record["gyro_x"].si(), GYRO[:, 0], atol=1e-7)
    np.testing.assert_allclose(record["gyro_x"].t, T, atol=1e-9)
    assert record.findings == ()


def test_a_text_without_names_has_no_heading():
    assert heading([f"{k},{2 * k},{k / 7:.3f}" for k in range(60)]) is None


def test_rates_of_an_aircraft_are_a_gyro_beside_accelerometers(tmp_path):
    path = written(tmp_path / "log.csv", "t,fx,fy,fz,p,q,r\n", np.column_stack([T, ACC, GYRO]))
    columns = tomllib.loads(guess_map(path))["columns"]
    assert [columns[f"gyro_{axis}"]["from"] for axis in "xyz"] == ["p", "q", "r"]


def test_ten_thousand_rows_take_at_most_a_second(tmp_path):
    acc, gyro, t = (np.concatenate([each] * 4)[:10_000] for each in (ACC, GYRO, T))
    path = written(tmp_path / "log.csv", "time,ax,ay,az,gx,gy,gz\n", np.column_stack([t, acc, gyro]))
    begin = time.process_time()
    guess_map(path)
    assert time.process_time() - begin < 1.0


def test_names_with_odd_characters_leave_a_map(tmp_path):
    """A comment of the map holds the name as TOML writes it."""
    path = written(tmp_path / "log.csv", "time\x01,a\x01x,a\x01y,a\x01z\n", np.column_stack([T, ACC]))
    tomllib.loads(guess_map(path))
    path = written(tmp_path / "log.csv", "\x00 [s],acc_x,acc_y,acc_z\n", np.column_stack([T, ACC]))
    assert "t" in tomllib.loads(guess_map(path))["columns"]


@for_each("words", ["Cmd{} (deg/s)", "cmd_rate_{} [deg/s]", "Rate demand {} (deg/s)", "desired_w{} [deg/s]"])
def test_a_commanded_rate_is_no_gyro(tmp_path, words):
    """A platform that is told how to turn; its command is the rate of a platform or nothing, never a gyro's output."""
    head = ",".join(
        ["Time (s)", *(words.format(axis) for axis in "XYZ"), *(f"Acc{axis} (m/s^2)" for axis in "XYZ")]
    )
    path = written(tmp_path / "log.csv", head + "\n", np.column_stack([T, np.degrees(GYRO), ACC]))
    columns = tomllib.loads(guess_map(path))["columns"]
    assert {"acc_x", "acc_y", "acc_z"} <= columns.keys()
    assert not any(name.startswith("gyro") for name in columns)
