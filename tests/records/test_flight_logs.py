"""Logs of flight controllers: dataflash of ArduPilot, ULog of PX4. What a log states is what is read."""

import struct

import numpy as np
import pytest
from spoiled import dataflash_log, ulog_file

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map

RNG = np.random.default_rng(47)
GYRO = RNG.standard_normal((200, 3)).astype("f4")
ACC = (np.array([0.1, -0.2, 9.8]) + RNG.standard_normal((200, 3))).astype("f4")
ROWS = list(zip(GYRO.tolist(), ACC.tolist(), strict=True))


def mapped(path, text):
    path.write_text(text)
    return path


def written(path, parts):
    path.write_bytes(b"".join(parts))
    return path


def test_a_dataflash_log_is_read_by_what_it_says_of_itself(tmp_path):
    path = written(tmp_path / "00000012.BIN", dataflash_log.log(ROWS))
    record = read(path, mapped(tmp_path / "map.toml", guess_map(path)))
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    assert record["gyro_x"].unit.symbol == "rad/s"
    assert record["acc_x"].unit.symbol == "m/s^2"
    np.testing.assert_allclose(np.diff(record["acc_x"].t), 0.0025, atol=1e-12)
    assert record.findings == ()


def test_each_instance_and_each_scaled_field_is_an_array(tmp_path):
    path = written(tmp_path / "log.bin", dataflash_log.log(ROWS))
    text = (
        '[columns]\nacc_z = {from = "IMU[1]/AccZ", unit = "m/s^2"}\n'
        'temperature = {from = "BARO/Temp", unit = "degC"}'
    )
    record = read(path, mapped(tmp_path / "map.toml", text))
    np.testing.assert_allclose(record["acc_z"].values, ACC[:, 2] + 1.0, rtol=1e-6)
    np.testing.assert_allclose(record["temperature"].values, 25.12)  # the character c is already a hundredth
    assert len(record["temperature"].t) == 20


def test_a_log_without_units_still_parts_its_instances(tmp_path):
    path = written(tmp_path / "log.bin", dataflash_log.log(ROWS, units=False))
    text = '[columns]\nacc_z = {from = "IMU[1]/AccZ", unit = "m/s^2"}'
    record = read(path, mapped(tmp_path / "map.toml", text))
    np.testing.assert_allclose(record["acc_z"].values, ACC[:, 2] + 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.diff(record["acc_z"].t), 0.0025, atol=1e-12)


@pytest.mark.parametrize("place", [0.3, 0.6, 0.9])
def test_bytes_that_are_no_message_are_said_and_passed_over(tmp_path, place):
    parts = dataflash_log.log(ROWS)
    parts.insert(int(place * len(parts)), b"\x00\xff\xa3\x95\x07" * 3)
    path = written(tmp_path / "log.bin", parts)
    record = read(path, mapped(tmp_path / "map.toml", guess_map(path)))
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    (finding,) = (finding for finding in record.findings if finding.code == "bad_row")
    assert "15 bytes" in finding.headline


def test_a_cut_log_says_so_and_keeps_the_rest(tmp_path):
    path = written(tmp_path / "log.bin", dataflash_log.log(ROWS))
    path.write_bytes(path.read_bytes()[:-5])
    record = read(path, mapped(tmp_path / "map.toml", guess_map(path)))
    assert len(record["acc_x"].values) == 200
    assert "truncated" in {finding.code for finding in record.findings}


def test_another_binary_file_is_refused_with_the_way_out(tmp_path):
    path = tmp_path / "log.bin"
    path.write_bytes(struct.pack("<40d", *range(40)))
    with pytest.raises(
        RecordError, match=r"is binary \(zero byte at 0\), of no known format\. If your logger can write CSV"
    ):
        guess_map(path)


def topics():
    stamps = [5000 + 4000 * k for k in range(200)]
    triad = (("uint64_t", "timestamp"), ("float", "x"), ("float", "y"), ("float", "z"))
    combined = (("uint64_t", "timestamp"), ("float[3]", "gyro_rad"), ("float[3]", "accelerometer_m_s2"))
    return [
        ("sensor_accel", 0, triad, [(t, *acc) for t, acc in zip(stamps, ACC.tolist(), strict=True)]),
        (
            "sensor_accel",
            1,
            triad,
            [(t + 7, *(2 * a for a in acc)) for t, acc in zip(stamps, ACC.tolist(), strict=True)],
        ),
        ("sensor_combined", 0, combined, [(t, *w, *f) for t, (w, f) in zip(stamps, ROWS, strict=True)]),
    ]


def test_the_topics_of_a_ulog_file_are_arrays_with_units_and_clocks(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog_file.log(topics()[2:]))
    record = read(path, mapped(tmp_path / "map.toml", guess_map(path)))
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    assert (record["acc_x"].unit.symbol, record["gyro_x"].unit.symbol) == ("m/s^2", "rad/s")
    np.testing.assert_allclose(np.diff(record["acc_x"].t), 0.004, atol=1e-12)


def test_an_instance_of_a_topic_has_its_own_name_and_clock(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog_file.log(topics()))
    text = (
        '[columns]\nacc_x = {from = "sensor_accel[1]/x", unit = "m/s^2"}\n'
        'gyro_x = {from = "gyro_rad[0]", unit = "rad/s"}'
    )
    record = read(path, mapped(tmp_path / "map.toml", text))
    np.testing.assert_allclose(record["acc_x"].values, 2 * ACC[:, 0], rtol=1e-6)
    np.testing.assert_allclose(record["acc_x"].t[0] - record["gyro_x"].t[0], 7e-6, atol=1e-12)
