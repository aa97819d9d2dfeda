"""ROS 1 bags, ROS 2 bags and MCAP files as rosbags writes them."""

import sys

import numpy as np
import pytest
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from inercal.foundation.errors import MapError, MissingExtraError, RecordError
from inercal.foundation.records.read import canonical_units, read
from inercal.foundation.records.recognise.map_text import guess_map

N = 300
RNG = np.random.default_rng(25)
ACC = np.array([0.1, -0.2, 9.8]) + 0.01 * RNG.standard_normal((N, 3))
GYRO = 0.1 * RNG.standard_normal((N, 3))
BEGIN = 1_700_000_000 * 10**9
STAMPS = BEGIN + 5_000_000 * np.arange(N)
DELAY = 1_000_000
RAW = "int16[3] acc\nint32 temperature\nfloat64[] samples\nstring section\n"


def writer(kind, path):
    """A writer, the type store of its ROS, and the path that is read."""
    if kind == "bag":
        return rosbag1.Writer(path / "run.bag"), get_typestore(Stores.ROS1_NOETIC), path / "run.bag"
    plugin = rosbag2.StoragePlugin.SQLITE3 if kind in ("folder", "db3") else rosbag2.StoragePlugin.MCAP
    inside = {"folder": "run", "mcap folder": "run", "db3": "run/run.db3", "mcap": "run/run.mcap"}[kind]
    file = rosbag2.Writer(path / "run", version=9, storage_plugin=plugin)
    return file, get_typestore(Stores.ROS2_HUMBLE), path / inside


def imu_message(types, row, stamp):
    names = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time", "geometry_msgs/msg/Vector3")
    header, time, vector = (types[name] for name in names)
    seconds, rest = divmod(int(stamp), 10**9)
    first = (row,) if "seq" in header.__dataclass_fields__ else ()
    return types["sensor_msgs/msg/Imu"](
        header(*first, time(seconds, rest), "imu"),
        types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
        np.zeros(9),
        vector(*GYRO[row].tolist()),
        np.zeros(9),
        vector(*ACC[row].tolist()),
        np.zeros(9),
    )


def recorded(kind, path, topics=("/imu/data",), headers=STAMPS, raw=False):
    """A bag with topics of sensor_msgs/Imu, perhaps one of a type of its own, and a topic of text."""
    file, store, result = writer(kind, path)
    store.register(get_types_from_msg(RAW, "lab/msg/Raw"))
    serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
    kinds = dict.fromkeys(topics, "sensor_msgs/msg/Imu") | {"/note": "std_msgs/msg/String"}
    kinds |= {"/raw": "lab/msg/Raw"} if raw else {}
    with file:
        connections = {
            topic: file.add_connection(topic, each, typestore=store) for topic, each in kinds.items()
        }
        for row, stamp in enumerate(STAMPS.tolist()):
            for topic, each in kinds.items():
                if each == "sensor_msgs/msg/Imu":
                    message = imu_message(store.types, row, headers[row])
                elif each == "std_msgs/msg/String":
                    message = store.types[each]("hello")
                else:
                    counts = np.array([row, -row, 1000], "i2")
                    message = store.types[each](
                        counts, 20 + row, np.ones(2 + row % 2), "up" if row < 9 else "down"
                    )
                file.write(connections[topic], stamp + DELAY, serialize(message, each))
    return result


def mapped(path, text):
    path.write_text(text)
    return path


def holds_imu(record, t=STAMPS):
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    np.testing.assert_allclose(record["acc_x"].t, t / 1e9, atol=3e-7, rtol=0)
    return [record[name].unit.symbol for name in ("acc_x", "gyro_x")] == ["m/s^2", "rad/s"]


@pytest.mark.parametrize("kind", ["bag", "folder", "mcap folder", "db3", "mcap"])
def test_the_only_imu_topic_needs_no_map(tmp_path, kind):
    path = recorded(kind, tmp_path)
    told = []
    record = read(path, progress=lambda done, total: told.append((done, total)))
    assert holds_imu(record)
    assert record.findings == ()
    assert told[-1][0] == told[-1][1] > 0
    assert len(record.sources[0].sha256) == 64
    assert canonical_units([path])["gyro_y"].symbol == "rad/s"
    assert holds_imu(read(path, mapped(tmp_path / "guess.toml", guess_map(path))))


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_a_wrong_stamp_is_set_aside(tmp_path, kind):
    headers = STAMPS + np.where(np.arange(N) == 99, 90 * 10**9, 0)
    record = read(recorded(kind, tmp_path, headers=headers))
    assert [(each.code, each.where) for each in record.findings] == [("outlying_time", "row 100")]
    assert np.flatnonzero(np.isnan(record["acc_x"].t)).tolist() == [99]


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_without_header_stamps_the_times_of_recording_are_used(tmp_path, kind):
    path = recorded(kind, tmp_path, headers=0 * STAMPS)
    record = read(path)
    assert holds_imu(record, STAMPS + DELAY)
    (finding,) = record.findings
    assert finding.message == "all header stamps of /imu/data are zero, the times of recording are used"
    assert "/imu/data/time" in guess_map(path)


def test_of_several_imu_topics_one_is_asked_for(tmp_path):
    path = recorded("bag", tmp_path, topics=("/imu/data", "/imu/data_raw"))
    with pytest.raises(
        RecordError, match=r"found the topics /imu/data and /imu/data_raw of .*Imu, expected one, or a"
    ):
        read(path)
    text = '[columns.acc_z]\nfrom = "imu/data_raw/linear_acceleration.z"\nunit = "m/s^2"\n'
    np.testing.assert_array_equal(read(path, mapped(tmp_path / "m.toml", text))["acc_z"].values, ACC[:, 2])
    with pytest.raises(
        MapError, match=r"found no .*acceleration.w' in .*the topics /imu/data \(sensor_msgs/msg/Imu\)"
    ):
        read(path, mapped(tmp_path / "m.toml", text.replace("acceleration.z", "acceleration.w")))


@pytest.mark.parametrize("kind", ["bag", "folder"])
def test_fields_of_any_message_may_be_mapped(tmp_path, kind):
    path = recorded(kind, tmp_path, topics=(), raw=True)
    with pytest.raises(
        RecordError, match=r"found the topics .*/raw \(lab/msg/Raw\), none of sensor_msgs/msg/Imu"
    ):
        read(path)
    text = (
        '[columns.t]\nfrom = "/raw/time"\nunit = "s"\n[columns.acc_y]\nfrom = ["/raw/acc", 1]\nunit = "count"\n'
        '[columns.temperature]\nfrom = "/raw/temperature"\nunit = "count"\n[columns.label]\nfrom = "/raw/section"\n'
    )
    record = read(path, mapped(tmp_path / "m.toml", text))
    np.testing.assert_array_equal(record["acc_y"].values, -np.arange(N))
    np.testing.assert_array_equal(record["temperature"].values, 20 + np.arange(N))
    assert record.labels == ("up",) * 9 + ("down",) * (N - 9)
    np.testing.assert_allclose(record["acc_y"].t, (STAMPS + DELAY) / 1e9, atol=3e-7, rtol=0)
    ragged = mapped(tmp_path / "m.toml", text.replace("/raw/acc", "/raw/samples"))
    with pytest.raises(RecordError, match="/raw/samples has lists of several lengths, expected one"):
        read(path, ragged)


def test_a_bag_that_breaks_off_gives_what_is_there(tmp_path):
    path = recorded("bag", tmp_path)
    content = path.read_bytes()
    middle = len(content) // 2
    path.write_bytes(content[:middle] + bytes(50) + content[middle + 50 :])
    record = read(path)
    rows = len(record["acc_x"].values)
    assert 100 < rows < 200
    np.testing.assert_array_equal(record.triad("acc").values[: rows - 1], ACC[: rows - 1])
    (finding,) = (finding for finding in record.findings if finding.code == "truncated")
    assert finding.message.startswith("the bag breaks off after ")


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_damaged_bags_end_in_one_sentence(tmp_path, kind):
    path = recorded(kind, tmp_path)
    whole = path.read_bytes()
    for content in (b"", whole[:100], whole[:-40] if kind != "db3" else whole[:5000], b"junk" * 99):
        path.write_bytes(content)
        with pytest.raises(RecordError) as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_a_folder_of_ros_2_must_be_whole(tmp_path):
    path = recorded("folder", tmp_path)
    (path / "run.db3").unlink()
    with pytest.raises(RecordError, match=r"cannot be read as a bag .*missing"):
        read(path)
    (path / "metadata.yaml").unlink()
    with pytest.raises(RecordError, match=r"a folder without metadata\.yaml \(a ROS 2 bag has one\)"):
        read(path)


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    path = recorded("bag", tmp_path)
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(MissingExtraError, match=r"Reading bags needs .*pip install 'inercal\[files\]'"):
        read(path)
