"""What was recognised is read again by the map that is written, to the same values, however lines are written."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from line_variants import ACC, FIRST_HALF, GYRO, SECOND_HALF, VARIANTS, T

from inercal.cli import run
from inercal.foundation.errors import MapError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map
from rows import for_each


def outcome(name, folder):
    """The flaw of what is recognised and read of a variant, empty where all is as it was measured."""
    text, timed = VARIANTS[name]
    path = folder / "log.txt"
    path.write_text(text, encoding="utf-8")
    (folder / "map.toml").write_text(guess_map(path, rate=None if timed else "50 Hz"), encoding="utf-8")
    record = read(path, folder / "map.toml")
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        for k, axis in enumerate("xyz"):
            if f"{sensor}_{axis}" not in record:
                return f"no {sensor}_{axis}"
            column = record[f"{sensor}_{axis}"]
            if len(column.values) != len(T):
                return f"{len(column.values)} rows"
            if np.abs(column.si() - truth[:, k]).max() > 1e-5:
                return f"{sensor}_{axis} differs"
            if np.abs(column.t - column.t[0] - T).max() > 1.1e-3:
                return f"times of {column.t[-1] - column.t[0]:.4g} s"
    return ", ".join(finding.line for finding in record.findings)


@pytest.mark.parametrize("name", [*FIRST_HALF, *SECOND_HALF])
def test_lines_are_recognised_and_read_again(name, tmp_path):
    assert outcome(name, tmp_path) == ""


UNITS = {
    "acc": {"m/s^2": 1.0, "g": 1 / 9.80665, "mg": 1000 / 9.80665},
    "gyro": {"rad/s": 1.0, "deg/s": 180 / np.pi, "mdeg/s": 180e3 / np.pi},
    "t": {"s": 1.0, "ms": 1e3, "us": 1e6},
}
NAMES = {
    "acc": ("a{}", "acc_{}", "Accel {}", "imu.acc.{}", "linear_acceleration_{}"),
    "gyro": ("g{}", "gyr_{}", "Gyro {}", "imu.gyro.{}", "angular_velocity_{}"),
}


@st.composite
def tables(draw):
    """The text of a table whose names, units, marks and order are drawn."""
    units = {sensor: draw(st.sampled_from(sorted(known))) for sensor, known in UNITS.items()}
    style = draw(st.integers(0, 4))
    where = draw(st.sampled_from(["brackets", "row"]))
    mark = draw(st.sampled_from([",", ";", "\t"]))
    columns = [("time", units["t"], T * UNITS["t"][units["t"]])]
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        size = UNITS[sensor][units[sensor]]
        columns += [
            (NAMES[sensor][style].format(axis), units[sensor], size * truth[:, k])
            for k, axis in enumerate("xyz")
        ]
    columns = draw(st.permutations(columns))
    heads = [f"{name} [{unit}]" if where == "brackets" else name for name, unit, _ in columns]
    lines = [mark.join(heads), *([mark.join(unit for _, unit, _ in columns)] if where == "row" else [])]
    body = np.column_stack([values for _, _, values in columns])[:200]
    return "\n".join([*lines, *(mark.join(f"{value:.12g}" for value in row) for row in body)]) + "\n"


@given(text=tables())
def test_names_units_marks_and_orders_are_read_again(text, tmp_path_factory):
    folder = tmp_path_factory.mktemp("a")
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    (folder / "map.toml").write_text(guess_map(path), encoding="utf-8")
    record = read(path, folder / "map.toml")
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        for k, axis in enumerate("xyz"):
            column = record[f"{sensor}_{axis}"]
            np.testing.assert_allclose(column.si(), truth[:200, k], rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(column.t, T[:200], atol=1e-9)
    assert record.findings == ()


@for_each(
    ("layout", "message"),
    [
        ('lines = "json"\nmessage = "IMU"', "lines, message beside .* expected one alone"),
        ('pattern = ["a {}"]\ndelimiter = ","', "pattern beside delimiter"),
        ('pattern = ["a"]', "a pattern without {}, expected one for each number"),
    ],
)
def test_a_layout_that_contradicts_itself_is_refused(tmp_path_factory, layout, message):
    place = tmp_path_factory.mktemp("a") / "map.toml"
    place.write_text(f'[file]\n{layout}\n[columns.gyro_x]\nfrom = 0\nunit = "deg/s"\n')
    with pytest.raises(MapError, match=message):
        read_map(place)


def test_damaged_objects_and_messages_are_rows_that_cannot_be_read(tmp_path):
    """A row that is cut is said with its line, and stays as NaN; lines of other kinds are none."""
    path = tmp_path / "log.txt"
    rows = [f'{{"t": {k}, "gyro": {{"z": {k}.5}}}}' for k in range(40)]
    rows[7] = rows[7][:-4]
    path.write_text("\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(
        '[file]\nlines = "json"\n[columns]\nt = { from = "t", unit = "s" }\n'
        'gyro_z = { from = "gyro.z", unit = "deg/s" }\n'
    )
    record = read(path, tmp_path / "map.toml")
    assert len(record["gyro_z"].values) == 40
    assert np.isnan(record["gyro_z"].values[7])
    assert [finding.code for finding in record.findings if finding.where == "line 8"] == ["bad_row"]


def test_a_stream_takes_rows_of_numbers_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.txt").write_text(VARIANTS["json nested"][0])
    (tmp_path / "map.toml").write_text(guess_map(tmp_path / "log.txt"))
    assert run(["monitor", "log.txt", "--map", "map.toml"]) == 2
    assert "expected rows of numbers and plain times for a stream" in capsys.readouterr().err
