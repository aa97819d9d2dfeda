"""Recordings of other laboratories through column maps: what physics says they must show."""

import gzip
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map

EXAMPLES = Path(str(files("inercal"))) / "examples"
EARTH_RATE = 7.292115e-5
NO_RATE = 'rate = "?"'


def mapped(path, text):
    path.write_text(text)
    return path


def columns(sensor, origins, rest):
    return "".join(
        f"[columns.{sensor}_{axis}]\nfrom = {origin!r}\n{rest}\n".replace("'", '"')
        for axis, origin in zip("xyz", origins, strict=True)
    )


def test_counts_of_increments_are_gravity_and_earth_rate(tmp_path):
    """PSINS: six whole numbers a row, 0.1 arcsec and 125 ug s a count at 100 Hz, after 14 lines of head.

    Its g is 9.780327 m/s^2, as the head says, where the unit g of a map is 9.80665 m/s^2; hence m/s.
    At rest the mean rate is the Earth's, less the bias of the gyros (some 0.1 deg/h), and its vertical part
    Earth rate times the sine of the latitude (34.246 deg).
    """
    text = (
        columns("gyro", range(3), 'unit = "arcsec"\nscale = 0.1\nkind = "increment"')
        + columns("acc", range(3, 6), 'unit = "m/s"\nscale = 1.222540875e-3\nkind = "increment"')
        + '[file]\nskip = 14\n[time]\nrate = "100 Hz"\n'
    )
    record = read(EXAMPLES / "lasergyro.txt.gz", mapped(tmp_path / "m.toml", text))
    acc, gyro = record.triad("acc"), record.triad("gyro")
    assert (acc.unit.symbol, gyro.unit.symbol) == ("m/s^2", "rad/s")
    assert acc.t[-1] == pytest.approx(1847.17)
    assert np.linalg.norm(acc.values.mean(axis=0)) == pytest.approx(9.7955, abs=0.001)
    rate = gyro.values.mean(axis=0)
    assert np.linalg.norm(rate) == pytest.approx(EARTH_RATE, rel=0.02)
    assert rate[2] == pytest.approx(EARTH_RATE * np.sin(np.radians(34.24604800)), abs=np.radians(0.2) / 3600)


def test_stamps_that_cannot_be_trusted_give_way_to_the_rate(tmp_path):
    """Tab-separated, with stamps in ns of 0.5 ms; the sensor lies still, z down, within 5 % of gravity."""
    path = EXAMPLES / "thermal.csv.gz"
    text = (
        columns("acc", [f"imu.acc.{axis}" for axis in "xyz"], 'unit = "m/s^2"')
        + columns("gyro", [f"imu.gyro.{axis}" for axis in "xyz"], 'unit = "rad/s"')
        + '[columns.temperature]\nfrom = "imu.temperature"\nunit = "degC"\n'
        '[columns.t]\nfrom = "timestamp"\nunit = "ns"\n'
    )
    trusted = read(path, mapped(tmp_path / "m.toml", text))
    assert trusted.triad("acc").rate == pytest.approx(1980, rel=0.02)
    record = read(path, mapped(tmp_path / "m.toml", text + '[time]\nrate = "10 Hz"\nignore = true\n'))
    assert len(record["acc_x"].values) == 8400
    np.testing.assert_array_equal(record["acc_x"].t, np.arange(8400) / 10)
    assert not {"gap", "backward_time", "duplicate_time", "rate_change"} & {f.code for f in record.findings}
    assert np.linalg.norm(record.triad("acc").values, axis=1).mean() == pytest.approx(9.8, rel=0.05)
    assert record["acc_z"].values.mean() < -9.0
    temperature = record["temperature"].values
    assert temperature.min() < -10 < 70 < temperature.max()


def test_the_sections_of_a_labelled_session(tmp_path):
    """imucal: three axes up and down (_p, _a) and turned about (_rot), said by the column ``part``."""
    path = EXAMPLES / "ferraris.csv.gz"
    record = read(
        path,
        mapped(
            tmp_path / "m.toml",
            guess_map(path).replace(NO_RATE, 'rate = "204.8 Hz"'),
        ),
    )
    labels = np.array(record.labels)
    assert set(record.labels) == {f"{axis}_{what}" for axis in "xyz" for what in ("p", "a", "rot")}
    assert len(labels) == len(record["acc_x"].values) == 9414
    for index, axis in enumerate("xyz"):
        up, down = (record[f"acc_{axis}"].values[labels == f"{axis}_{what}"].mean() for what in ("p", "a"))
        gravity = abs(up - down) / 2
        assert gravity == pytest.approx(2048, rel=0.05)  # counts a g of a 16 g range
        turn = record.triad("gyro").values[labels == f"{axis}_rot"]
        angles = np.abs(turn.sum(axis=0)) / 204.8 / 16.4  # counts a deg/s of a 2000 deg/s range
        assert int(np.argmax(angles)) == index
        assert angles[index] == pytest.approx(360, rel=0.05)


def test_a_european_table(tmp_path):
    """Decimal commas, semicolons, quoted names with blanks, Windows line ends, Latin-1; stated or found out."""
    t = np.arange(200) / 100
    acc = np.array([0.1, -0.2, 9.81]) + 0.01 * np.random.default_rng(8).standard_normal((200, 3))
    rows = [";".join(f"{value:.6f}".replace(".", ",") for value in row) for row in np.column_stack([t, acc])]
    path = tmp_path / "Messung.csv"
    path.write_bytes("\r\n".join(['"Zeit [s]";"Beschl. x [m/s²]";"y";"z"', *rows, ""]).encode("latin-1"))
    text = '[columns.t]\nfrom = "Zeit"\nunit = "s"\n' + columns("acc", [1, "y", "z"], 'unit = "m/s^2"')
    stated = '[file]\ndelimiter = ";"\ndecimal = ","\n'
    for options in ("", stated):
        record = read(path, mapped(tmp_path / "m.toml", text + options))
        np.testing.assert_allclose(record.triad("acc").values, acc, atol=6e-7)
        np.testing.assert_allclose(record["acc_x"].t, t)
        assert record.findings == ()


def test_one_text_file_may_hold_two_clocks(tmp_path):
    """Each part of the map names the same file and takes a time of its own from it."""
    path = tmp_path / "run.csv.gz"
    lines = [f"{0.01 * k:.2f},{k},{0.01 * k + 0.003:.3f},{-k}" for k in range(20)]
    path.write_bytes(gzip.compress("\n".join(["ta,a,tg,g", *lines, ""]).encode()))
    text = "".join(
        f'[file.{name}]\npath = "run.csv.gz"\n[file.{name}.columns.t]\nfrom = "t{name[0]}"\nunit = "s"\n'
        f'[file.{name}.columns.{name}_x]\nfrom = "{name[0]}"\nunit = "count"\n'
        for name in ("acc", "gyro")
    )
    record_map = mapped(tmp_path / "m.toml", text)
    assert len(read_map(record_map).parts) == 2
    record = read(path, record_map)
    np.testing.assert_allclose(record["gyro_x"].t - record["acc_x"].t, 0.003)
    np.testing.assert_array_equal(record["gyro_x"].values, -record["acc_x"].values)
    assert len(record.sources) == 2  # the recording once, and the map


def test_files_of_several_formats_are_one_record(tmp_path):
    """Accelerometers in NPZ and gyros in text, joined by a map with a part for each."""
    t = np.arange(100) / 50
    np.savez(tmp_path / "acc.npz", time=t, f=np.ones((100, 3)))
    (tmp_path / "gyro.txt").write_text(
        "".join(f"{1e3 * (s + 0.01):.1f}\t{k}\t0\t1\n" for k, s in enumerate(t))
    )
    text = '[file.acc]\npath = "acc.npz"\n[file.acc.columns.t]\nfrom = "time"\nunit = "s"\n'
    text += columns("acc", range(3), 'unit = "g"').replace("columns.", "file.acc.columns.")
    text += '[file.gyro]\npath = "gyro.txt"\n[file.gyro.columns.t]\nfrom = 0\nunit = "ms"\n'
    text += columns("gyro", range(1, 4), 'unit = "deg/s"').replace("columns.", "file.gyro.columns.")
    record = read([], mapped(tmp_path / "m.toml", text))
    np.testing.assert_allclose(record["gyro_x"].t - record["acc_x"].t, 0.01)
    np.testing.assert_array_equal(record["gyro_x"].values, np.arange(100))
