"""Binary frames: checks against published values, frames found whatever lies between them, files of frames."""

import binascii
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.records.checksums import CHECKS
from inercal.foundation.records.frame_kernel import value
from inercal.foundation.records.frames import CounterTurns, Frame, frames_in
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from rows import for_each

#: name -> check of the text 123456789, as the catalogue of parametrised CRC algorithms publishes it
PUBLISHED = {
    "crc-8": 0xF4, "crc-8/autosar": 0xDF, "crc-8/dvb-s2": 0xBC, "crc-8/maxim": 0xA1, "crc-8/nrsc-5": 0xF7,
    "crc-8/sae-j1850": 0x4B, "crc-16/arc": 0xBB3D, "crc-16/ccitt-false": 0x29B1, "crc-16/kermit": 0x2189,
    "crc-16/modbus": 0x4B37, "crc-16/x-25": 0x906E, "crc-16/xmodem": 0x31C3, "crc-32": 0xCBF43926,
    "crc-32/bzip2": 0xFC891918, "crc-32/mpeg-2": 0x0376E6E7, "crc-32c": 0xE3069283,
}  # fmt: skip


def check_of(name, data):
    check = CHECKS[name]
    form = np.array([check.kind, check.width, check.start, check.reflected, check.end], np.int64)
    return int(value(np.frombuffer(data, np.uint8), 0, len(data), form, check.table))


@pytest.mark.kernels
def test_crcs_have_their_published_check_values():
    assert PUBLISHED.keys() == {name for name in CHECKS if name.startswith("crc")}
    assert {name: check_of(name, b"123456789") for name in PUBLISHED} == PUBLISHED


@pytest.mark.kernels
@given(st.binary(max_size=60))
def test_checks_agree_with_those_of_other_programs(data):
    assert check_of("crc-32", data) == zlib.crc32(data)
    assert check_of("crc-16/xmodem", data) == binascii.crc_hqx(data, 0)
    assert check_of("sum-8", data) == sum(data) % 256
    assert check_of("sum-32", data) == sum(data) % 2**32
    assert (check_of("sum-8/negated", data) + sum(data)) % 256 == 0
    assert check_of("xor-8", data) == int(np.bitwise_xor.reduce(np.frombuffer(data, np.uint8), initial=0))


@pytest.mark.kernels
def test_fletcher_has_the_values_of_its_literature():
    """abcde of the usual example; a message of a u-blox receiver (poll of UBX-MON-VER) with its own check bytes."""
    assert check_of("fletcher-16", b"abcde") == 0xC8F0
    assert check_of("fletcher-16/ubx", bytes.fromhex("0A 04 00 00")) == 0x340E


FRAME = Frame(
    b"\xaa\x55", ("n", "us", "a", "b"), ("u1", "<u4", "<f4", ">i2"), CHECKS["crc-16/modbus"], counter="n"
)


def framed(frame, *values):
    """A frame as a device makes it, by the struct and zlib of Python where there is one."""
    codes = {"u1": "B", "<u4": "<I", "<f4": "<f", ">i2": ">h", "<u2": "<H"}
    body = frame.sync + b"".join(
        struct.pack(codes[kind], each) for kind, each in zip(frame.types, values, strict=True)
    )
    crc = 0xFFFF  # MODBUS, bit by bit as its specification has it
    for byte in body[frame.check_begin :]:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return body + struct.pack("<H" if frame.order == "<" else ">H", crc)


@pytest.mark.kernels
def test_fields_have_their_types_and_byte_order():
    found = frames_in(framed(FRAME, 7, 123456, 1.5, -2), FRAME)
    assert found.rows.tolist() == [(7, 123456, 1.5, -2)]
    assert found[1:] == (15, 0, 0)


@pytest.mark.kernels
@given(
    st.lists(
        st.one_of(
            st.integers(0, 255),
            st.binary(max_size=20),
            st.sampled_from([b"\xaa", b"\xaa\x55", b"\xaa\xaa\x55\xaa"]),
        ),
        max_size=12,
    ),
    st.data(),
)
def test_every_frame_is_found_and_every_other_byte_passed_over(parts, data):
    """Whatever lies between, and in whatever pieces it comes; 16 bits err once in 65536."""
    stream = b"".join(
        part if isinstance(part, bytes) else framed(FRAME, part, 2 * part, 0.5, part) for part in parts
    )
    wanted = [(part, 2 * part, 0.5, part) for part in parts if isinstance(part, int)]
    whole = frames_in(stream + bytes(15), FRAME)  # so that no begun frame is waited for
    assert whole.rows.tolist() == wanted
    held, rows, passed = b"", [], 0
    rest = stream
    while rest:
        size = data.draw(st.integers(1, len(rest)))
        held, rest = held + rest[:size], rest[size:]
        found = frames_in(held, FRAME)
        held = held[found.consumed :]
        rows += found.rows.tolist()
        passed += found.passed_over
    found = frames_in(held + bytes(15), FRAME)
    assert rows + found.rows.tolist() == wanted
    assert passed + found.passed_over == whole.passed_over
    assert whole.passed_over + 15 * len(wanted) == whole.consumed


@pytest.mark.kernels
def test_a_damaged_frame_takes_no_sound_one_with_it():
    frames = [framed(FRAME, k, k, float(k), k) for k in range(100)]
    spoiled = bytearray(b"".join(frames))
    spoiled[15 * 40 + 9] ^= 4  # one bit of number 40
    del spoiled[15 * 70 + 3]  # one byte of number 70
    found = frames_in(bytes(spoiled), FRAME)
    assert [row[0] for row in found.rows.tolist()] == [k for k in range(100) if k not in (40, 70)]
    assert (found.passed_over, found.damaged) == (15 + 14, 2)


@pytest.mark.kernels
def test_counters_go_on_beyond_their_range():
    counter = np.array([254, 255, 0, 3, 2, 4, 100], np.uint8)
    turns, numbers = CounterTurns().on(counter)
    assert numbers.tolist() == [254, 255, 256, 259, 258, 260, 356]
    assert turns.missing == 1 + 95
    halves = CounterTurns()
    told = []
    for part in (counter[:2], counter[2:2], counter[2:5], counter[5:]):
        halves, some = halves.on(part)
        told += some.tolist()
    assert (halves, told) == (turns, numbers.tolist())


@for_each(
    "counter, wanted",
    [
    ([10, 11, 140, 13, 14], [10, 11, -116, 13, 14]),  # the highest bit is wrong
    ([10, 11, 137, 141, 14], [10, 11, 137, 141, 14]), ([254, 127, 0, 1], [254, 127, 256, 257]),
    ([254, 1, 255, 252, 2, 3], [254, 257, 255, 252, 258, 259]),
    ],
)  # fmt: skip
def test_one_wrong_counter_moves_no_others(counter, wanted):
    assert CounterTurns().on(np.array(counter, np.uint8))[1].tolist() == wanted


@given(
    st.lists(st.sampled_from([1, 1, 1, 2, 3, -1, 100]), max_size=60),
    st.dictionaries(st.integers(0, 59), st.integers(0, 255), max_size=4),
    st.integers(0, 60),
)
def test_each_counter_is_counted_from_the_newest(steps, wrong, cut):
    """Value by value as a whole, and in two parts."""
    counter = np.cumsum(steps, dtype=np.int64) % 256
    for row, number in wrong.items():
        counter[row : row + 1] = number
    wanted = []
    for each in counter.tolist():
        newest = max(wanted, default=each)
        wanted.append(newest + 128 - (128 - (each - newest)) % 256)
    counter = counter.astype(np.uint8)
    whole, numbers = CounterTurns().on(counter)
    assert numbers.tolist() == wanted
    first, one = CounterTurns().on(counter[:cut])
    both, two = first.on(counter[cut:])
    assert (both, [*one.tolist(), *two.tolist()]) == (whole, wanted)


MAP = """
[file]
sync = "AA 55"
binary = ["u1", "<u4", "<f4", ">i2"]
fields = ["n", "us", "a", "b"]
check = "crc-16/modbus"
counter = "n"
[columns.t]
from = "us"
unit = "us"
[columns.acc_x]
from = "a"
unit = "g"
scale = 2.0
[columns.acc_y]
from = "b"
unit = "count"
sign = -1
"""


@pytest.mark.kernels
def test_a_file_of_frames_is_read(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    stamps = [2**32 - 2000 + 1000 * k for k in range(6)]
    frames = [framed(FRAME, 250 + k, t % 2**32, 0.25 * k, k) for k, t in enumerate(stamps)]
    del frames[3]
    (tmp_path / "log.bin").write_bytes(b"\x00\xaa" + b"".join(frames) + frames[0][:7])
    record = read(tmp_path / "log.bin", tmp_path / "map.toml")
    assert np.allclose(record["acc_x"].t - record["acc_x"].t[0], [0.0, 0.001, 0.002, 0.004, 0.005])
    assert record["acc_x"].values.tolist() == [0.0, 0.5, 1.0, 2.0, 2.5]
    assert record["acc_y"].values.tolist() == [0.0, -1.0, -2.0, -4.0, -5.0]
    said = [(finding.code, finding.message) for finding in record.findings]
    assert ("bad_row", "2 bytes are in no sound frame; the check of 0 frames is wrong") in said
    assert ("gap", "1 frames are missing by their counter n") in said
    assert ("truncated", "the file ends within a frame: 7 bytes left of a frame of 15") in said
    (tmp_path / "none.bin").write_bytes(bytes(100))
    with pytest.raises(RecordError, match=r"found no frame of 15 bytes in 100 bytes"):
        read(tmp_path / "none.bin", tmp_path / "map.toml")


@pytest.mark.kernels
@for_each(
    "old, new, said",
    [
        ('"AA 55"', '"AA 5"', "expected 1 to 16 bytes in hexadecimal"),
        ('"crc-16/modbus"', '"crc-17"', "expected one of sum-8"),
        ('"n"\n[columns.t]', '"a"\n[columns.t]', "found the counter 'a'"),
        ('"n"\n[columns.t]', '"x"\n[columns.t]', "found the counter 'x'"),
        ('counter = "n"', "length = 14", "found a length of 14, expected 15"),
        ('counter = "n"', "check_begin = 13", "found check_begin 13"),
        ('sync = "AA 55"', "", "found check alone"),
        ('counter = "n"', "transpose = true", "found transpose with sync"),
        ('"<f4", ">i2"', '"x4"', "3 types of binary for 4 fields"),
    ],
)
def test_what_is_wrong_in_a_frame_is_said(tmp_path, old, new, said):
    assert old in MAP
    (tmp_path / "map.toml").write_text(MAP.replace(old, new, 1))
    with pytest.raises(MapError) as refused:
        read_map(tmp_path / "map.toml")
    assert said in str(refused.value)


@pytest.mark.kernels
def test_bytes_of_no_use_are_passed_over(tmp_path):
    """Those between the fields (x3), and those before the check by the length; the check begins behind the sync."""
    text = """
    [file]
    sync = "FA"
    binary = ["x3", "<u2"]
    fields = ["head", "t"]
    length = 12
    check = "sum-8/negated"
    check_begin = 1
    [columns.t]
    from = "t"
    unit = "ms"
    """
    (tmp_path / "map.toml").write_text(text)
    frame = read_map(tmp_path / "map.toml").parts[0].options.frame
    body = b"abc" + struct.pack("<H", 500) + b"-----"
    data = b"\xfa" + body + bytes([-sum(body) % 256])
    assert (frame.size, len(data)) == (12, 12)
    assert frames_in(data + data, frame).rows.tolist() == [(500,), (500,)]
