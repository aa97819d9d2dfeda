"""A stream without a header of ours is recognised as a file of the same lines is, and read from its first line."""

import io
import sys

import numpy as np
import pytest

from inercal.cli import run
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.recognised import recognised_stream
from inercal.foundation.errors import InputError

RNG = np.random.default_rng(20261127)
ROWS = np.column_stack([0.01 * np.arange(1200), [0.02, -0.03, 9.81] + 0.01 * RNG.standard_normal((1200, 3))])


def text(head, rows=ROWS):
    return (head + "\n".join(",".join(f"{x:.6f}" for x in row) for row in rows) + "\n").encode()


def test_all_rows_come_with_their_channels():
    stream, record_map = recognised_stream(io.BytesIO(text("time,ax,ay,az\n")), "here")
    lines = Lines(stream, "here", record_map, lambda finding: None)
    assert list(lines.record.columns) == ["acc_x", "acc_y", "acc_z"]
    read = []
    while (line := lines.next()) is not None:
        sample = lines.sample(line, len(read))
        read.append([sample.t, *sample.values])
    np.testing.assert_allclose(read, ROWS, atol=1e-6)


def test_a_header_of_ours_is_read_at_once():
    """After three lines, and without a map."""
    source = io.BytesIO(text("t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n"))
    stream, record_map = recognised_stream(source, "here")
    assert record_map is None
    assert source.tell() < 200
    assert stream.readline(2) == b"t "
    assert stream.readline().startswith(b"[s],acc_x")


def test_a_guess_is_asked_and_answered():
    still = text("time,gx,gy,gz\n", ROWS * [1, 0.0123, 0.0123, 0.00123])
    with pytest.raises(InputError, match=r"here: Is the gyro in rad/s or deg/s\?"):
        recognised_stream(io.BytesIO(still), "here")
    _, record_map = recognised_stream(io.BytesIO(still), "here", ["gyro=deg/s"])
    assert record_map.taken["gyro"].endswith("certain: as answered") or "deg/s" in record_map.taken["gyro"]
    with pytest.raises(InputError, match=r"^here"):
        recognised_stream(io.BytesIO(b"nothing of use\n" * 30), "here")


def test_monitor_needs_no_map(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.csv").write_bytes(text("time,ax,ay,az\n"))
    assert run(["monitor", "log.csv", "--every", "2 s"]) == 0
    by_file = capsys.readouterr()
    assert "acc: columns" in by_file.err
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text("time,ax,ay,az\n"))))
    assert run(["monitor", "--every", "2 s"]) == 0
    assert capsys.readouterr().out == by_file.out != ""
