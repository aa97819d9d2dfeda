"""TDMS files as npTDMS writes them."""

import sys

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from inercal.foundation.errors import MapError, MissingExtraError, RecordError
from inercal.foundation.records.read import canonical_units, read
from inercal.foundation.records.recognise.map_text import guess_map

RNG = np.random.default_rng(24)
ACC = np.array([0.1, -0.2, 9.8]) + 0.01 * RNG.standard_normal((600, 3))
GYRO = RNG.standard_normal((300, 3))
BEGIN = np.datetime64("2024-05-06T07:08:09.500000")
LATE = BEGIN + np.timedelta64(2500, "us")


def waveform(group, sensor, values, unit, increment, begin):
    properties = {
        "unit_string": unit,
        "wf_increment": increment,
        "wf_start_offset": 0.0,
        "wf_start_time": begin,
    }
    return [
        ChannelObject(group, f"{sensor}_{axis}", column, properties)
        for axis, column in zip("xyz", values.T, strict=True)
    ]


def two_clocks(path, segments=3):
    """Accelerometers at 200 Hz, gyros at 100 Hz that begin 2.5 ms later, in several segments."""
    with TdmsWriter(path) as file:
        for acc, gyro in zip(np.split(ACC, segments), np.split(GYRO, segments), strict=True):
            channels = waveform("Acc", "acc", acc, "m/s^2", 0.005, BEGIN)
            file.write_segment(channels + waveform("Gyro", "gyro", gyro, "deg/s", 0.01, LATE))
    return path


def mapped(path, text):
    path.write_text(text)
    return path


def holds_both(record):
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    np.testing.assert_allclose(record["acc_x"].t, 0.005 * np.arange(600), atol=1e-12)
    np.testing.assert_allclose(record["gyro_x"].t, 0.0025 + 0.01 * np.arange(300), atol=1e-9)
    return record["gyro_x"].unit.symbol == "deg/s"


def test_waveforms_have_units_and_clocks_of_their_own(tmp_path):
    path = two_clocks(tmp_path / "run.tdms")
    record = read(path)
    assert holds_both(record)
    assert record.findings == ()
    assert canonical_units([path])["gyro_z"].symbol == "deg/s"
    assert holds_both(read(path, mapped(tmp_path / "guess.toml", guess_map(path))))
    text = "".join(
        f'[columns.{name}]\nfrom = "{group}/{name}"\nunit = "{unit}"\n'
        for group, sensor, unit in (("Acc", "acc", "m/s^2"), ("Gyro", "gyro", "deg/s"))
        for name in (f"{sensor}_{axis}" for axis in "xyz")
    )
    assert holds_both(read(path, mapped(tmp_path / "plain.toml", text)))
    with pytest.raises(RecordError, match="found columns of 300 and 600 rows"):
        read(path, mapped(tmp_path / "rate.toml", text + '[time]\nrate = "200 Hz"\n'))


def test_a_time_channel_and_text_go_with_their_rows(tmp_path):
    path = tmp_path / "run.tdms"
    stamps = BEGIN + (5000 * np.arange(600)).astype("timedelta64[us]")
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("Log", "when", stamps),
                ChannelObject("Log", "ax", (1000 * ACC[:, 0]).astype("i2")),
                ChannelObject("Log", "section", ["up"] * 300 + ["down"] * 300),
                ChannelObject("Log", "note", ["one"]),
            ]
        )
    text = (
        '[columns.t]\nfrom = "Log/when"\nunit = "s"\n[columns.acc_x]\nfrom = "ax"\nunit = "mg"\n'
        '[columns.label]\nfrom = "Log/section"\n'
    )
    record = read(path, mapped(tmp_path / "m.toml", text))
    np.testing.assert_allclose(record["acc_x"].t, 1714979289.5 + 0.005 * np.arange(600), atol=3e-7, rtol=0)
    np.testing.assert_array_equal(record["acc_x"].values, (1000 * ACC[:, 0]).astype("i2"))
    assert record.labels == ("up",) * 300 + ("down",) * 300
    with pytest.raises(MapError, match=r"found no 'ay' in .*the arrays Log/when \(600 x 1\), Log/ax"):
        read(path, mapped(tmp_path / "m.toml", text.replace('"ax"', '"ay"')))


def test_a_file_that_breaks_off_gives_what_is_there(tmp_path):
    path = two_clocks(tmp_path / "run.tdms")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    record = read(path)
    rows = len(record["acc_z"].values)
    assert 200 <= rows < 600
    np.testing.assert_array_equal(record["acc_z"].values, ACC[:rows, 2])
    assert "truncated" in {finding.code for finding in record.findings}


def test_what_cannot_be_read_is_said(tmp_path, monkeypatch):
    whole = two_clocks(tmp_path / "run.tdms").read_bytes()
    path = tmp_path / "cut.tdms"
    for content in (b"", b"junk" * 50, whole[:200]):
        path.write_bytes(content)
        with pytest.raises(RecordError) as caught:
            read(path)
        assert "\n" not in str(caught.value)
    monkeypatch.setitem(sys.modules, "nptdms", None)
    with pytest.raises(MissingExtraError, match=r"Reading TDMS files needs .*pip install 'inercal\[files\]'"):
        read(path)
