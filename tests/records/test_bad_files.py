"""Damaged text and maps end in a record or in one clear sentence: never in another exception, never in a hang.

Binary formats are in `tests/hardening/test_spoiled_files.py`.
"""

import gzip
import re

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError
from inercal.foundation.findings import CODES
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map

ROWS = np.column_stack([np.arange(60) / 100, np.random.default_rng(5).standard_normal((60, 2))])
TEXT = (
    "t [s],acc_x [m/s^2],gyro_x [deg/s]\n" + "".join(f"{t!r},{a!r},{g!r}\n" for t, a, g in ROWS.tolist())
).encode()
MAP = b"""
[columns.t]
from = 0
unit = "s"
[columns.acc_x]
from = 1
unit = "g"
[time]
rate = "100 Hz"
[file]
skip = 1
[file.gyro]
path = "b.csv"
[file.gyro.columns.gyro_x]
from = ["v", 1]
unit = "deg/s"
"""

many = settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@st.composite
def damaged(draw, content):
    """The content after one to four accidents."""
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(content)))
        match draw(st.sampled_from(["cut", "flip", "insert", "drop lines", "repeat lines", "swap"])):
            case "cut":
                content = content[:at]
            case "flip":
                content = content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]
            case "insert":
                content = content[:at] + draw(st.binary(max_size=40)) + content[at:]
            case "drop lines":
                lines = content.splitlines(keepends=True)
                first = draw(st.integers(0, len(lines)))
                content = b"".join(lines[:first] + lines[first + draw(st.integers(1, 5)) :])
            case "repeat lines":
                lines = content.splitlines(keepends=True)
                first = draw(st.integers(0, len(lines)))
                content = b"".join(lines[:first] + lines[max(first - 3, 0) :])
            case "swap":
                old, new = draw(
                    st.sampled_from([(b",", b";"), (b".", b","), (b"\n", b"\r"), (b"\n", b""), (b",", b" ")])
                )
                content = content.replace(old, new, draw(st.integers(1, 200)))
    return content


def is_sound(call):
    """True if the call returns a record with one value and stamp a row, or raises an input error."""
    try:
        record = call()
    except InputError as error:
        return "\n" not in str(error)
    return all(
        column.values.shape == column.t.shape and not np.isinf(column.values).any()
        for column in record.columns.values()
    ) and all(finding.code in CODES for finding in record.findings)


def put(path, content):
    path.write_bytes(content)
    return path


@many
@given(content=damaged(TEXT))
@example(content=TEXT.replace(b".", b"_"))
@example(content=TEXT[:35] + b'"' + TEXT[35:])
@example(content=b"\xef\xbb\xbf")
@example(content=b"\xff\xfe" + TEXT.decode().encode("utf-16-le"))
def test_damaged_text_reads_or_is_refused(tmp_path, content):
    assert is_sound(lambda: read(put(tmp_path / "a.csv", content)))


@many
@given(content=damaged(gzip.compress(TEXT)))
def test_damaged_compressed_text_reads_or_is_refused(tmp_path, content):
    assert is_sound(lambda: read(put(tmp_path / "a.csv.gz", content)))


@many
@given(content=damaged(MAP))
def test_damaged_maps_are_read_or_refused(tmp_path, content):
    try:
        record_map = read_map(put(tmp_path / "map.toml", content))
    except InputError:
        return
    assert record_map.parts


@many
@given(content=damaged(TEXT.replace(b" [m/s^2]", b"").replace(b" [deg/s]", b"")))
def test_a_guess_about_a_damaged_file_is_a_map_or_refused(tmp_path, content):
    path = put(tmp_path / "a.csv", content)
    try:
        text = guess_map(path)
    except InputError:
        return
    if all(line.startswith("#") for line in text.splitlines()):  # nothing recognised: the columns, to fill in
        return
    record_map = put(tmp_path / "map.toml", re.sub('rate = "PUT .*"', 'rate = "100 Hz"', text).encode())
    assert read_map(record_map).parts
    assert is_sound(lambda: read(path, record_map))


@many
@given(content=st.binary(max_size=300))
def test_junk_is_read_or_refused(tmp_path, content):
    for name in ("a.csv", "a.txt.gz", "a.dat"):
        path = put(tmp_path / name, content)
        assert is_sound(lambda path=path: read(path))
