"""A guessed map says why, and reads the files it was guessed from."""

import gzip
import re
import tomllib
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map
from rows import for_each

EXAMPLES = Path(str(files("inercal"))) / "examples"
RNG = np.random.default_rng(3)
N = 200
T = np.arange(N) / 100
REST = np.array([0.1, -0.2, 9.8])
ACC = REST + 0.01 * RNG.standard_normal((N, 3))
GYRO = 0.3 * RNG.standard_normal((N, 3))


def guessed(tmp_path, paths):
    """The map guessed for the files, and the record it reads from them."""
    record_map = tmp_path / "guess.toml"
    record_map.write_text(guess_map(paths), encoding="utf-8")
    return read_map(record_map), read(paths, record_map)


def table(path, header, rows, delimiter=",", leading=""):
    lines = [header.replace(",", delimiter)] if header else []
    lines += [delimiter.join(f"{value:.10g}" for value in row) for row in rows]
    path.write_text(leading + "\n".join(lines) + "\n")
    return path


def units(record):
    return [column.unit.symbol for column in record.columns.values()]


def test_the_xsens_files_are_read_as_counts_on_their_clock(tmp_path):
    record_map, record = guessed(tmp_path, [EXAMPLES / "xsens_acc.mat", EXAMPLES / "xsens_gyro.mat"])
    assert [part.name for part in record_map.parts] == ["acc", "gyro"]
    assert list(record.columns) == [f"{sensor}_{axis}" for sensor in ("acc", "gyro") for axis in "xyz"]
    assert set(units(record)) == {"count"}
    assert record["acc_y"].values[0] == 33329
    assert record["gyro_x"].values[-1] == 48789
    assert record["acc_x"].t[-1] == 511.718
    assert record.findings == ()


@for_each(
    "header",
    [
        "time,ax,ay,az,gx,gy,gz",
        "t,accX,accY,accZ,gyrX,gyrY,gyrZ",
        "elapsed,AcX,AcY,AcZ,GyX,GyY,GyZ",
        "timestamp,imu.acc.x,imu.acc.y,imu.acc.z,imu.gyro.x,imu.gyro.y,imu.gyro.z",
        "Zeit (s),ax (m/s2),ay (m/s2),az (m/s2),wx (rad/s),wy (rad/s),wz (rad/s)",
        "Time [s],Accel_X,Accel_Y,Accel_Z,Gyro_X,Gyro_Y,Gyro_Z",
        "t,linear_acceleration_x,linear_acceleration_y,linear_acceleration_z,"
        "angular_velocity_x,angular_velocity_y,angular_velocity_z",
        "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]",
        "",
    ],
)
@for_each("delimiter", [",", "\t", ";"])
def test_many_headers_mean_the_same(tmp_path, header, delimiter):
    path = table(tmp_path / "run.csv", header, np.column_stack([T, ACC, GYRO]), delimiter)
    _, record = guessed(tmp_path, [path])
    assert list(record.columns) == [f"{sensor}_{axis}" for sensor in ("acc", "gyro") for axis in "xyz"]
    assert units(record) == ["m/s^2"] * 3 + ["rad/s"] * 3
    np.testing.assert_allclose(record.triad("acc").values, ACC, rtol=1e-8)
    np.testing.assert_allclose(record["acc_x"].t, T)


@pytest.mark.parametrize(
    ("factor", "offset", "unit"),
    [(1, 0, "m/s^2"), (1 / 9.8, 0, "g"), (400, 0, "count"), (400, 32768, "count")],
)
def test_gravity_tells_the_unit(tmp_path, factor, offset, unit):
    rows = np.column_stack([T, ACC * factor + offset])
    _, record = guessed(tmp_path, [table(tmp_path / "acc.csv", "", rows)])
    assert set(units(record)) == {unit}


@pytest.mark.parametrize(("factor", "unit"), [(1, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_the_interval_tells_the_unit_of_time(tmp_path, factor, unit):
    path = table(tmp_path / "a.csv", "timestamp,ax,ay,az", np.column_stack([T * factor, ACC]))
    assert f'unit = "{unit}"' in guess_map(path)
    _, record = guessed(tmp_path, [path])
    np.testing.assert_allclose(record["acc_x"].t, T, atol=1e-9)


def test_a_rate_is_looked_for_in_the_lines_before_the_header(tmp_path):
    leading = "Fs,50\nLogging Type,0\nWaiting time,3\n"
    path = table(
        tmp_path / "a.csv",
        "ax,ay,az,gx,gy,gz",
        np.round(np.column_stack([ACC, GYRO]) * 1000),
        leading=leading,
    )
    packed = tmp_path / "a.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes()))
    for file in (path, packed):
        record_map, record = guessed(tmp_path, [file])
        assert (record_map.rate, record_map.parts[0].options.skip) == (50.0, 3)
        assert len(record["acc_x"].values) == N
        assert set(units(record)) == {"count"}
        assert record.findings == ()


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("phi1_deg,phi2_deg,ax,ay,az", "deg"),
        ("Phi 1,Phi 2,acc_x,acc_y,acc_z", "deg"),
        ("phi1 (rad),phi2 (rad),accX,accY,accZ", "rad"),
        ("phi1_rad,phi2_rad,ax,ay,az", "rad"),
    ],
)
def test_angles_of_a_table_are_no_rates_and_need_no_time(tmp_path, header, unit):
    angles = np.column_stack([np.arange(N) % 7, np.arange(N) % 5])
    path = table(tmp_path / "a.csv", header, np.column_stack([angles, ACC]))
    record_map, record = guessed(tmp_path, [path])
    assert list(record.columns) == ["phi1", "phi2", "acc_x", "acc_y", "acc_z"]
    assert units(record) == [unit] * 2 + ["m/s^2"] * 3
    assert record_map.rate is None
    np.testing.assert_array_equal(record["phi2"].values, angles[:, 1])


def test_on_a_table_columns_without_names_are_not_guessed(tmp_path):
    """Time, two angles and an output look like a time and a triad."""
    path = table(tmp_path / "a.csv", "", np.column_stack([T, np.arange(N) % 7, np.arange(N) % 5, ACC[:, 0]]))
    assert "gyro_x" in guess_map(path)
    skeleton = guess_map(path, on_table=True)
    assert all(line.startswith("#") for line in skeleton.splitlines())
    assert "# [columns.phi1]" in skeleton
    assert "likewise t, phi2, acc_x" in skeleton
    assert "# [columns.a1]" in guess_map(path, of_model=True)


def test_a_table_and_a_model_have_names_of_their_own(tmp_path):
    """Outer and inner axes are phi1 and phi2, with a row a minute; the triad of a model that pitches has numbers."""
    rows = np.column_stack([60.0 * np.arange(N), np.arange(N) % 7, np.arange(N) % 5, ACC])
    on_table = table(tmp_path / "a.csv", "time,outer [deg],Inner axis,out_x,Out Y,z", rows)
    found = tomllib.loads(guess_map(on_table, on_table=True))["columns"]
    assert {name: column["from"] for name, column in found.items()} == {
        "t": "time", "phi1": "outer [deg]", "phi2": "Inner axis", "y_x": "out_x", "y_y": "Out Y",
    }  # fmt: skip
    assert found["t"]["unit"] == "s"
    pitching = table(tmp_path / "b.csv", "time,AX,AY,AZ,gyro_y,gyro_z", rows)
    of_model = tomllib.loads(guess_map(pitching, of_model=True))["columns"]
    assert list(of_model) == ["t", "a1", "a2", "a3", "gyro", "gyro_yaw"]


def test_sensors_whose_names_say_nothing_go_by_their_norm(tmp_path):
    """A table's log in German: readings B of a converter, and a temperature as it counts, which is no channel."""
    angles = np.column_stack([np.arange(1, N + 1), np.arange(N) % 7, np.arange(N) % 5])
    rows = np.column_stack([angles, 130.0 * ACC, np.full(N, -3400.0)])
    path = table(tmp_path / "a.txt", "Pos;Achse 1 (°);Achse 2 (°);Bx (mV);By (mV);Bz (mV);Tmp", rows, ";")
    found = tomllib.loads(guess_map(path, on_table=True))["columns"]
    assert list(found) == ["position", "phi1", "phi2", "acc_x", "acc_y", "acc_z"]
    assert (found["acc_z"]["from"], found["acc_z"]["unit"]) == ("Bz (mV)", "mV")


def test_a_model_with_two_accelerometers_along_one_axis(tmp_path):
    """They are numbered as they stand, and q is the rate of pitch."""
    header = "Time[s],AX_fwd[g],AZ_fwd[g],AZ_aft[g],Q[deg/s],AoA_inclinometer[deg]"
    path = table(tmp_path / "a.dat", header, np.column_stack([T, ACC / 9.8, GYRO[:, :2]]))
    found = tomllib.loads(guess_map(path, of_model=True))["columns"]
    assert [each["from"].partition("[")[0] for each in found.values()] == [
        "Time", "AX_fwd", "AZ_fwd", "AZ_aft", "Q", "AoA_inclinometer",
    ]  # fmt: skip
    assert list(found) == ["t", "a1", "a2", "a3", "gyro", "theta_ref"]


def test_without_time_or_rate_one_is_asked_for(tmp_path):
    path = table(tmp_path / "a.csv", "n,ax,ay,az", np.column_stack([np.arange(N), ACC]))
    with pytest.raises(InputError, match=r"no time column t, expected one, or the sample rate.*100 Hz"):
        guessed(tmp_path, [path])
    record_map = tmp_path / "guess.toml"
    record_map.write_text(re.sub('rate = ".*"', 'rate = "100 Hz"', record_map.read_text()))
    assert len(read(path, record_map)["acc_x"].values) == N


def test_labels_and_temperatures_are_found(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("part,t,acc_x,acc_y,acc_z,temp\n" + "".join(f"up,{t},0.0,0.1,1.0,25.5\n" for t in T))
    _, record = guessed(tmp_path, [path])
    assert set(record.labels) == {"up"}
    assert record["temperature"].unit.symbol == "degC"


def test_arrays_of_one_mat_file_are_put_together(tmp_path):
    path = tmp_path / "run.mat"
    savemat(path, {"K": np.eye(3), "omega": GYRO, "time": T, "accel": ACC})
    _, record = guessed(tmp_path, [path])
    assert set(record.columns) == {f"{sensor}_{axis}" for sensor in ("acc", "gyro") for axis in "xyz"}
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    np.testing.assert_array_equal(record["acc_x"].t, T)


def test_of_repeat_runs_the_first_is_described(tmp_path):
    first, second = (
        table(tmp_path / name, "t,ax,ay,az", np.column_stack([T, ACC])) for name in ("a.csv", "b.csv")
    )
    assert guess_map([first, second]) == guess_map(first)


def test_each_guess_says_why(tmp_path):
    text = guess_map(table(tmp_path / "a.csv", "t,ax,ay,az", np.column_stack([T, ACC])))
    columns = tomllib.loads(text)["columns"].values()
    assert len(columns) == 4
    assert all(column["grade"] in ("certain", "likely") and column["because"] for column in columns)


G_MG = ACC / 9.80665 * 1000
RATES = 5000.0 * GYRO


@pytest.mark.parametrize(
    ("header", "time", "found"),
    [
        ("t (s),ax (mg),ay (mg),az (mg),wx (mGrad/s),wy (mGrad/s),wz (mGrad/s)", 1.0, "mdeg/s"),
        ("t (s),ax (mg),ay (mg),az (mg),wx (m°/s),wy (m°/s),wz (m°/s)", 1.0, "mdeg/s"),
        ("t_ms,acc_x_mg,acc_y_mg,acc_z_mg,gyro_x_mdps,gyro_y_mdps,gyro_z_mdps", 1e3, "mdeg/s"),
        ("temps (ms),gX [mg],gY [mg],gZ [mg],wx (dps),wy (dps),wz (dps)", 1e3, "deg/s"),
        (
            "Laufzeit [ms],Beschl. X [mg],Beschl. Y [mg],Beschl. Z [mg],"
            "Drehrate X [Grad/s],Drehrate Y [Grad/s],Drehrate Z [Grad/s]",
            1e3,
            "deg/s",
        ),
        ("t,K1 1 [mg],K1 2 [mg],K1 3 [mg],K2 1 [mdeg/s],K2 2 [mdeg/s],K2 3 [mdeg/s]", 1.0, "mdeg/s"),
        ("t,ax,ay,az,gx,gy,gz", 1.0, "mdeg/s"),
    ],
)
def test_units_tell_the_channel_and_never_become_counts(tmp_path, header, time, found):
    """In brackets, as the end of a name, beside names in other languages, and by size alone."""
    path = table(tmp_path / "a.csv", header, np.column_stack([T * time, G_MG, 20.0 * RATES]))
    _, record = guessed(tmp_path, [path])
    assert units(record) == ["mg"] * 3 + [found] * 3
    np.testing.assert_allclose(record.triad("gyro").values, 20.0 * RATES, rtol=1e-8)
    np.testing.assert_allclose(record["acc_x"].t, T, atol=1e-9)


def test_whole_numbers_of_the_size_of_a_thousand_are_counts(tmp_path):
    """A converter of 1000 counts per g looks like mg, but for its whole numbers."""
    path = table(tmp_path / "a.csv", "t,ax,ay,az", np.column_stack([T, np.round(G_MG)]))
    _, record = guessed(tmp_path, [path])
    assert set(units(record)) == {"count"}


def test_an_unknown_unit_is_said(tmp_path):
    path = table(tmp_path / "a.csv", "t,ax [foo],ay [foo],az [foo]", np.column_stack([T, ACC]))
    because = tomllib.loads(guess_map(path))["columns"]["acc_x"]["because"]
    assert '"foo" is no unit known here; the median norm' in because


def test_an_interval_in_seconds_is_no_time(tmp_path):
    rows = np.column_stack([0.01 + 0.001 * GYRO[:, 0], T, ACC])
    text = guess_map(table(tmp_path / "a.csv", "dt [s],elapsed [s],ax,ay,az", rows))
    assert '[columns.t]\nfrom = "elapsed [s]"' in text
    assert '# not used: "dt [s]"' in text


def test_dates_are_times(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"2026-01-01T00:00:{t:05.2f},{x},{y},{z}" for t, (x, y, z) in zip(T, ACC, strict=True)]
    path.write_text("\n".join(["time,ax,ay,az", *rows]) + "\n")
    (tmp_path / "map.toml").write_text(guess_map(path))
    record = read(path, tmp_path / "map.toml")
    np.testing.assert_allclose(record["acc_z"].values, ACC[:, 2])
    np.testing.assert_allclose(record["acc_z"].t, T, atol=1e-12)


@pytest.mark.parametrize(
    ("header", "rows", "held"),
    [
        (
            "foo,temp,bar",
            np.column_stack([T, T, T]),
            ['"foo" (0, 0.01, 0.02)', '"temp" (perhaps temperature)'],
        ),
        ("", np.column_stack([GYRO, GYRO, 0 * T]), ["6 (0, 0, 0)"]),
    ],
)
def test_where_no_sensor_is_told_the_columns_are_listed(tmp_path, header, rows, held):
    path = table(tmp_path / "a.csv", header, rows)
    text = guess_map(path)
    assert all(line.startswith("#") for line in text.splitlines())
    assert all(f"#   {each}" in text for each in held)
    (tmp_path / "map.toml").write_text(text)
    with pytest.raises(InputError, match="columns: missing, expected at least one"):
        read_map(tmp_path / "map.toml")


@pytest.mark.parametrize("content", ["", "\x00\x00", "hello\n"])
def test_nothing_to_guess_is_said(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(RecordError):
        guess_map(path)
    with pytest.raises(RecordError, match="no such file"):
        guess_map(tmp_path / "none.csv")
