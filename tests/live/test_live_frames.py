"""Binary frames by wire: the digits of the same numbers as text, whatever is damaged between; recorded and replayed."""

import struct
import zlib

import numpy as np
import pytest
from wires import HEADER, by_stream, rows, until, waiting, wire

from inercal.bench.live.measurement import measure
from inercal.foundation.records.read import read

MAP = """
[file]
sync = "FA CE"
binary = ["u1", "<u4", "<f8", "<f8", "<f4"]
fields = ["n", "us", "ax", "ay", "az"]
check = "crc-32"
check_begin = 2
counter = "n"
[columns.t]
from = "us"
unit = "us"
[columns.acc_x]
from = "ax"
unit = "m/s^2"
[columns.acc_y]
from = "ay"
unit = "m/s^2"
[columns.acc_z]
from = "az"
unit = "m/s^2"
"""


def frame(k, line, start):
    """Row k as a recorder sends it: a counter of a byte, microseconds that begin anew at 2^32."""
    _, x, y, z = map(float, line.split(b","))
    body = struct.pack("<BIddf", k % 256, (start + 1000 * k) % 2**32, x, y, z)
    return b"\xfa\xce" + body + struct.pack("<I", zlib.crc32(body))


def as_text(k, line, start):
    """The same row as a line of text."""
    x, y, z = line.split(b",")[1:]
    single = struct.unpack("<f", struct.pack("<f", float(z)))[0]
    return b"%r,%b,%b,%r\n" % (1e-6 * (start + 1000 * k), x, y, single)


@pytest.fixture
def record_map(tmp_path):
    path = tmp_path / "map.toml"
    path.write_text(MAP)
    return path


@pytest.mark.parametrize("kind", ["serial", "udp"])
def test_frames_by_wire_have_the_digits_of_text(kind, study, record_map, tmp_path, request):
    near, address = wire(kind, tmp_path)
    request.addfinalizer(near.close)
    out, raw = tmp_path / "out.csv", tmp_path / "raw.bin"
    running = waiting(address, study, map=record_map, record=raw, to=[f"text:{out}"])
    start, sent = 2**32 - 150_000, rows(400)
    frames = [frame(k, line, start) for k, line in enumerate(sent)]
    spoiled = bytearray(frames[100])
    spoiled[20] ^= 1
    stream = [
        frames[0][7:],
        b"\xfa",
        *frames[:100],
        bytes(spoiled),
        *frames[101:250],
        b"noise",
        *frames[253:],
    ]
    for piece in stream:
        near.send(piece)
    kept = [k for k in range(400) if k != 100 and not 250 <= k < 253]
    assert until(lambda: running.counts.rows == len(kept)), running.counts
    running.stop(wait=20.0)
    counts = running.counts
    assert running.failure == ""
    assert (counts.lost, counts.damaged) == (4, 1)
    assert counts.left_out == len(frames[0]) - 7 + 1 + len(frames[0]) + len(b"noise")
    assert counts.received == counts.used + counts.left_out == sum(map(len, stream))
    assert counts.used == len(kept) * len(frames[0])
    assert raw.read_bytes() == b"".join(stream)
    wanted = by_stream([HEADER, *(as_text(k, sent[k], start) for k in kept)])
    assert out.read_text().splitlines(keepends=True) == wanted

    again = tmp_path / "again.csv"
    replayed = measure(f"replay:{raw}?speed=0", study, map=record_map, to=[f"text:{again}"])
    assert replayed.join(60.0)
    assert replayed.failure == ""
    assert again.read_text() == out.read_text()
    record = read(raw, record_map)
    assert record["acc_x"].values.tolist() == [float(sent[k].split(b",")[1]) for k in kept]
    assert record["acc_x"].t[-1] - record["acc_x"].t[0] == pytest.approx(0.399)


@pytest.mark.parametrize("bit", [26, 31])
def test_one_wrong_bit_in_the_stamp_of_a_frame_ends_nothing(bit, study, record_map, tmp_path, request):
    """Where no check finds it; also the bit by which the stamps seem to begin anew."""
    record_map.write_text(MAP.replace('check = "crc-32"\ncheck_begin = 2\n', ""))
    near, address = wire("udp", tmp_path)
    request.addfinalizer(near.close)
    out, raw = tmp_path / "out.csv", tmp_path / "raw.bin"
    running = waiting(address, study, map=record_map, record=raw, to=[f"text:{out}"])
    sent = rows(300)
    frames = [bytearray(frame(k, line, 10_000)[:-4]) for k, line in enumerate(sent)]
    frames[200][3 + bit // 8] ^= 1 << bit % 8
    for each in frames:
        near.send(bytes(each))
    assert until(lambda: running.counts.rows == 300), running.counts
    running.stop(wait=20.0)
    assert (running.failure, running.counts.outlying, running.counts.lost) == ("", 1, 0)
    (alarm,) = (alarm for alarm in running.alarms if alarm.code.endswith("_time"))
    assert "beside 0.209 and 0.211 s" in alarm.message
    lines = [as_text(k, line, 10_000) for k, line in enumerate(sent)]
    lines[200] = b"9" + lines[200]
    assert out.read_text().splitlines(keepends=True) == by_stream([HEADER, *lines])
    record = read(raw, record_map)
    assert [each.where for each in record.findings] == ["row 201"]
    assert np.flatnonzero(np.isnan(record["acc_x"].t)).tolist() == [200]


def test_a_break_within_a_frame_makes_no_frame(study, record_map, tmp_path, request, quick):
    """Also where nothing checks the frames: the begun one is left out with its end."""
    record_map.write_text(MAP.replace('check = "crc-32"\ncheck_begin = 2\n', ""))
    near, address = wire("serial", tmp_path)
    request.addfinalizer(near.close)
    raw, start = tmp_path / "raw.bin", 0
    running = waiting(address, study, map=record_map, record=raw)
    frames = [frame(k, line, start)[:-4] for k, line in enumerate(rows(60))]
    near.send(b"".join(frames[:20]) + frames[20][:15])
    assert until(lambda: running.counts.received == 20 * len(frames[0]) + 15)
    near.unplug()
    assert until(lambda: not running.alive)
    near.plug()
    assert until(lambda: running.alive)
    near.send(b"".join(frames[30:]))
    assert until(lambda: running.counts.rows == 50), running.counts
    running.stop(wait=20.0)
    counts = running.counts
    assert (counts.lost, counts.left_out, counts.cut, counts.reconnections) == (10, 15, 1, 1)
    assert raw.read_bytes() == b"".join([*frames[:20], *frames[30:]])


def test_numbers_without_sync_are_refused_live(study, record_map, tmp_path):
    (tmp_path / "raw.bin").write_bytes(bytes(1000))
    cut = MAP.replace('sync = "FA CE"\n', "").replace(
        'check = "crc-32"\ncheck_begin = 2\ncounter = "n"\n', ""
    )
    record_map.write_text(cut)
    running = measure(f"replay:{tmp_path / 'raw.bin'}?speed=0", study, map=record_map)
    assert running.join(60.0)
    assert running.failure.startswith(f"{record_map}: file.sync: missing")
    record_map.write_text(MAP.replace('from = "ax"', 'from = "aw"'))
    running = measure(f"replay:{tmp_path / 'raw.bin'}?speed=0", study, map=record_map)
    assert running.join(60.0)
    assert "columns.acc_x.from: found no 'aw' in the frame (n, us, ax, ay, az)" in running.failure
