"""Raw binary files, and files that lie on their side."""

import gzip

import numpy as np
import pytest
import scipy.io

from inercal.foundation.errors import InputError, MapError, RecordError
from inercal.foundation.records.read import read
from rows import for_each

COLUMNS = "".join(
    f'[columns.gyro_{axis}]\nfrom = {origin}\nunit = "deg/s"\n'
    for axis, origin in zip("xyz", ('"a"', '"b"', 2), strict=True)
)
VALUES = np.arange(15.0).reshape(5, 3)


def mapped(folder, file, columns=COLUMNS):
    path = folder / "map.toml"
    path.write_text(f'[file]\n{file}\n[time]\nrate = "10 Hz"\n{columns}', encoding="utf-8")
    return path


def rows(record):
    return np.stack([record[f"gyro_{axis}"].values for axis in "xyz"], axis=1)


FIELDS = 'fields = ["a", "b", "c"]'


@for_each(
    "file, raw",
    [
        (f'binary = "<f4"\n{FIELDS}', VALUES.astype("<f4").tobytes()),
        (f'binary = ">i2"\n{FIELDS}', VALUES.astype(">i2").tobytes()),
        (f'binary = "<f8"\nskip = 7\n{FIELDS}', b"headers" + VALUES.astype("<f8").tobytes()),
        (f'binary = "<f8"\ntranspose = true\n{FIELDS}', VALUES.T.astype("<f8").tobytes()),
        (f'binary = "<u4"\n{FIELDS}', gzip.compress(VALUES.astype("<u4").tobytes())),
        (
            f'binary = ["<f4", "u1", ">i4"]\n{FIELDS}',
            b"".join(
                np.float32(a).tobytes() + bytes([int(b)]) + int(c).to_bytes(4, "big") for a, b, c in VALUES
            ),
        ),
    ],
)
def test_rows_of_a_binary_file(tmp_path, file, raw):
    (tmp_path / "log.bin").write_bytes(raw)
    np.testing.assert_array_equal(rows(read(tmp_path / "log.bin", mapped(tmp_path, file))), VALUES)


def test_half_a_row_at_the_end_is_said(tmp_path):
    (tmp_path / "log.bin").write_bytes(VALUES.astype("<f4").tobytes() + b"12345")
    record = read(tmp_path / "log.bin", mapped(tmp_path, f'binary = "<f4"\n{FIELDS}'))
    np.testing.assert_array_equal(rows(record), VALUES)
    assert "truncated" in {finding.code for finding in record.findings}


@for_each(
    "file, said",
    [
        ('binary = "f4"\nfields = ["a"]', "expected a type such as"),
        ('binary = "<f4"', "one for each, or one for all"),
        ('binary = ["<f4"]\nfields = ["a", "b"]', "found 1 types of binary for 2 fields"),
        ('fields = ["a"]', "found fields without binary"),
        ('binary = "<f4"\nfields = ["a"]\ndelimiter = ","', "expected none for a raw binary file"),
    ],
)
def test_maps_that_do_not_describe_a_binary_file_are_refused(tmp_path, file, said):
    with pytest.raises(MapError, match=said):
        read(tmp_path / "log.bin", mapped(tmp_path, file))


def test_what_is_too_short_or_missing_is_refused(tmp_path):
    where = mapped(tmp_path, f'binary = "<f4"\n{FIELDS}')
    with pytest.raises(RecordError, match="no such file"):
        read(tmp_path / "log.bin", where)
    (tmp_path / "log.bin").write_bytes(b"1234")
    with pytest.raises(RecordError, match="found 4 bytes, expected rows of 12 bytes"):
        read(tmp_path / "log.bin", where)
    with pytest.raises(InputError, match="say its frames in a map"):
        read(tmp_path / "log.bin")


def test_arrays_and_texts_on_their_side(tmp_path):
    numbered = COLUMNS.replace('"a"', "0").replace('"b"', "1")
    scipy.io.savemat(tmp_path / "a.mat", {"A": VALUES.T})
    np.savetxt(tmp_path / "a.csv", VALUES.T, delimiter=",")
    (tmp_path / "named.csv").write_text(
        "".join(f"{name},{','.join(map(str, row))}\n" for name, row in zip("abc", VALUES.T, strict=True))
    )
    where = mapped(tmp_path, "transpose = true", numbered)
    for name in ("a.mat", "a.csv"):
        np.testing.assert_array_equal(rows(read(tmp_path / name, where)), VALUES)
    np.testing.assert_array_equal(
        rows(read(tmp_path / "named.csv", mapped(tmp_path, "transpose = true"))), VALUES
    )


def test_rows_without_times_are_counted_where_that_is_asked_for(tmp_path):
    (tmp_path / "means.csv").write_text("acc_x [g],acc_y [g],acc_z [g]\n1,0,0\n0,1,0\n")
    np.testing.assert_array_equal(read(tmp_path / "means.csv", counted=True)["acc_x"].t, [0.0, 1.0])
    with pytest.raises(RecordError, match="no time column"):
        read(tmp_path / "means.csv")
