"""Spoiled addresses, maps of frames and bytes by wire: measured, or refused in one sentence; every byte is counted."""

import random
import struct
import zlib

import pytest
from wires import HEADER, rows

from inercal.bench.live.address import SINKS, SOURCES, sink_of, source_of
from inercal.bench.live.feed import LONGEST, Feed
from inercal.bench.live.sources import Arrival, Piece
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.monitor import Monitor
from inercal.faces.stream.run import run
from inercal.foundation.errors import InercalError, InputError
from inercal.foundation.records.maps import read_map

MANY = pytest.mark.parametrize("many", [150, pytest.param(3000, marks=pytest.mark.campaign)])

PIECES = [
    b"", b":", b"//", b"?", b"&", b"=", b"%00", b"%ff", b"\0", b"\n", b"\r\n", b"\x1b[2J", b"\xff\xfe", b"[", b"@",
    b"..", b"9" * 400, b"nan", b"-", "é".encode(), b"u1", b"\xfa\xce", b"[[", b"1e999", b"x" * 70_000, b",,,,", b'"',
]  # fmt: skip


def spoiled(rng, data, pieces=PIECES):
    """Bytes with some changed, cut, doubled, or with something put in."""
    data = bytearray(data)
    for _ in range(rng.randint(1, 4)):
        at, to = sorted(rng.choices(range(len(data) + 1), k=2))
        to = min(to, at + 200)
        match rng.randrange(4):
            case 0:
                data[at:to] = b""
            case 1:
                data[at:at] = rng.choice(pieces)
            case 2:
                data[at:at] = data[at:to]
            case 3 if at < len(data):
                data[at] = rng.randrange(256)
    return bytes(data)


def in_one_sentence(error):
    said = str(error)
    assert "\n" not in said
    assert 10 < len(said) < 3000
    return said


@MANY
def test_spoiled_addresses_are_parsed_or_refused(many):
    rng, parsed = random.Random(20261125), 0
    for _ in range(many):
        text = spoiled(rng, rng.choice(SOURCES + SINKS).encode()).decode("utf-8", "replace")
        for parse in (source_of, sink_of):
            try:
                found = parse(text)
            except InputError as error:
                in_one_sentence(error)
            else:
                parsed += 1
                assert str(found).isprintable()
                if hasattr(found, "port"):
                    assert 1 <= found.port <= 65535
    assert parsed


MAP = b"""
[file]
sync = "FA CE"
binary = ["u1", "<u4", "<f8", "x2", "<f4"]
fields = ["n", "us", "ax", "gap", "az"]
check = "crc-32"
check_begin = 2
length = 27
counter = "n"
[columns.t]
from = "us"
unit = "us"
[columns.acc_x]
from = "ax"
unit = "m/s^2"
[columns.acc_z]
from = "az"
unit = "m/s^2"
"""


def frame(k):
    """A sound frame of the map."""
    body = struct.pack("<BId2xf2x", k % 256, 1000 * k, 0.01 * (k % 7), 9.81)
    return b"\xfa\xce" + body + struct.pack("<I", zlib.crc32(body))


class Pieces:
    """Stands for an intake: bytes in pieces, now and then after a break."""

    def __init__(self, rng, data, whole=False, breaks=0.05):
        self.pieces = []
        while data:
            size = rng.choice([1, 7, 60, 500, 5000, 80_000])
            self.pieces.append(Arrival(Piece(data[:size], whole), 0.0, rng.random() < breaks))
            data = data[size:]
        self.received = sum(len(each.piece.data) for each in self.pieces)

    def next(self, timeout):
        return self.pieces.pop(0) if self.pieces else None

    @property
    def ended(self):
        return not self.pieces


def measured(source, record_map, may_be_cut):
    """Rows out of a source, and the sentence of a refusal; every byte that was taken is used or left out."""
    out, said = [], ""
    try:
        feed = Feed(source, record_map, may_be_cut, None, out.append)
    except InercalError as error:
        return 0, in_one_sentence(error)
    try:
        lines = Lines(feed, "the wire", feed.record_map, lambda finding: None)
        run(Monitor(lines), lines, out.append)
    except InercalError as error:
        said = in_one_sentence(error)
    left = sum(len(each.piece.data) for each in source.pieces)
    assert feed.used + feed.left_out + len(feed._held) + left == source.received
    assert len(feed._held) <= LONGEST
    if not said:
        assert not feed._held
        assert not left
    return len(out), said


@MANY
def test_spoiled_lines_are_measured_or_refused(many):
    rng, good = random.Random(7), 0
    sound = HEADER + b"".join(rows(40))
    for _ in range(many):
        data = spoiled(rng, sound)
        count, said = measured(Pieces(rng, data, rng.random() < 0.3), None, rng.random() < 0.5)
        good += count > 20 and not said
    assert good > many / 4


@MANY
def test_spoiled_frames_are_found_or_counted(tmp_path, many):
    (tmp_path / "map.toml").write_bytes(MAP)
    record_map = read_map(tmp_path / "map.toml")
    rng = random.Random(8)
    sound = b"".join(map(frame, range(40)))
    assert measured(Pieces(rng, sound, breaks=0.0), record_map, False) == (41, "")
    for _ in range(many):
        count, said = measured(Pieces(rng, spoiled(rng, sound)), record_map, True)
        assert (count > 5) != bool(said)


@MANY
def test_spoiled_maps_of_frames_are_read_or_refused(tmp_path, many):
    rng, path, read = random.Random(9), tmp_path / "map.toml", 0
    sound = b"".join(map(frame, range(10)))
    words = [*PIECES, b"<f8", b"x9", b"crc-8", b"length = 3\n", b"sync = 'AA'\n", b"transpose = true\n"]
    for _ in range(many):
        path.write_bytes(spoiled(rng, MAP, words))
        try:
            record_map = read_map(path)
        except InercalError as error:
            said = in_one_sentence(error)
        else:
            said, read = str(path), read + 1
            measured(Pieces(rng, sound), record_map, False)
        assert said.startswith(str(path))
    assert 0 < read < many
