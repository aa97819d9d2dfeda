"""``inercal inspect`` and ``inercal new`` on each format that can be read."""

import json

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from rosbags import rosbag2
from rosbags.typesys import Stores, get_typestore

from inercal.cli import run
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.records.write import SUFFIXES, write_record
from inercal.foundation.units import parse_unit

N = 500
T = np.arange(N) / 100
VALUES = {
    **{f"acc_{axis}": offset for axis, offset in zip("xyz", (0.1, -0.2, 9.81), strict=True)},
    **{f"gyro_{axis}": 0.01 for axis in "xyz"},
}
RNG = np.random.default_rng(26)
DATA = {name: offset + 0.01 * RNG.standard_normal(N) for name, offset in VALUES.items()}
UNITS = {name: "m/s^2" if name.startswith("acc") else "rad/s" for name in DATA}


def as_tdms(path):
    with TdmsWriter(path) as file:
        file.write_segment(
            [
                ChannelObject("IMU", name, values, {"unit_string": UNITS[name], "wf_increment": 0.01})
                for name, values in DATA.items()
            ]
        )


def as_bag(path):
    store = get_typestore(Stores.ROS2_HUMBLE)
    kind = "sensor_msgs/msg/Imu"
    header, time, vector, turn = (
        store.types[name]
        for name in (
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
            "geometry_msgs/msg/Vector3",
            "geometry_msgs/msg/Quaternion",
        )
    )
    with rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as file:
        connection = file.add_connection("/imu", kind, typestore=store)
        rows = np.column_stack(list(DATA.values())).tolist()
        for index, row in enumerate(rows):
            stamp = 10_000_000 * (index + 1)
            message = store.types[kind](
                header(time(*divmod(stamp, 10**9)), "imu"),
                turn(0.0, 0.0, 0.0, 1.0),
                np.zeros(9),
                vector(*row[3:]),
                np.zeros(9),
                vector(*row[:3]),
                np.zeros(9),
            )
            file.write(connection, stamp, store.serialize_cdr(message, kind))


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".tdms", ""])
def test_a_self_describing_file_needs_no_map(suffix, tmp_path, monkeypatch, capsys):
    path = tmp_path / f"run{suffix}"
    if suffix in SUFFIXES:
        source = Source("", "")
        columns = {
            name: Column(name, parse_unit(UNITS[name]), values, T, source) for name, values in DATA.items()
        }
        write_record(Record(columns), path)
    else:
        (as_tdms if suffix else as_bag)(path)
    assert run(["inspect", str(path), "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    channels = {channel["name"]: channel for channel in data["result"]["channels"]}
    assert list(channels) == list(DATA)
    assert data["findings"] == []
    for name, values in DATA.items():
        assert channels[name]["samples"] == N
        assert channels[name]["mean"] == pytest.approx(values.mean())
        assert channels[name]["rate"] == pytest.approx(100.0, rel=1e-6)
        assert channels[name]["unit"] == UNITS[name]
    monkeypatch.chdir(tmp_path)
    assert run(["new", "imu", str(path), "--quiet"]) == 0
    capsys.readouterr()
    assert run(["inspect", str(path), "--map", "imu-map.toml", "--json", "--quiet"]) == 0
    mapped = json.loads(capsys.readouterr().out)["result"]["channels"]
    assert {channel["name"]: channel["mean"] for channel in mapped} == {
        name: channel["mean"] for name, channel in channels.items()
    }
