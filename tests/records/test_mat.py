"""MAT files, the shipped Xsens recording among them."""

import struct
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.io import savemat

from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.records.read import mat, read
from inercal.foundation.records.recognise.map_text import guess_map

EXAMPLES = Path(str(files("inercal"))) / "examples"
TABLE = np.column_stack([np.arange(50) / 100, np.random.default_rng(0).standard_normal((50, 3))])


def saved(path, **arrays):
    savemat(path, arrays)
    return path


def mapped(path, variable=None, t="0", acc="{index}", rows=""):
    text = f'[columns.t]\nfrom = {t}\nunit = "s"\n' if t else ""
    for index, axis in enumerate("xyz", 1):
        text += f'[columns.acc_{axis}]\nfrom = {acc.format(index=index)}\nunit = "g"\n'
    text += f'[file]\nvariable = "{variable}"\n' if variable else ""
    path.write_text(text + rows)
    return path


def holds_table(record):
    return np.array_equal(record["acc_x"].t, TABLE[:, 0]) and np.array_equal(
        record.triad("acc").values, TABLE[:, 1:]
    )


def test_the_only_array_needs_no_name(tmp_path):
    path = saved(tmp_path / "a.mat", data=TABLE, note="hand held", gain=2.0)
    assert holds_table(read(path, mapped(tmp_path / "map.toml")))


def test_an_array_is_taken_by_its_name(tmp_path):
    path = saved(tmp_path / "a.mat", data=TABLE, other=TABLE + 1)
    assert holds_table(read(path, mapped(tmp_path / "map.toml", variable="data")))
    assert holds_table(read(path, mapped(tmp_path / "map.toml", t='["data", 0]', acc='["data", {index}]')))
    with pytest.raises(
        RecordError, match=r"holds the arrays data \(50 x 4\), other \(50 x 4\), expected `variable`"
    ):
        read(path, mapped(tmp_path / "map.toml"))


def test_vectors_are_taken_by_their_names_as_rows_or_columns(tmp_path):
    path = saved(tmp_path / "a.mat", time=TABLE[:, 0], acc=TABLE[:, 1:])
    record_map = mapped(tmp_path / "map.toml", t='"time"', acc='["acc", {index}]')
    record_map.write_text(record_map.read_text().replace("3]", "0]"))
    record = read(path, record_map)
    np.testing.assert_array_equal(record["acc_x"].t, TABLE[:, 0])
    np.testing.assert_array_equal(record["acc_z"].values, TABLE[:, 1])
    record_map.write_text('[columns.t]\nfrom = "acc"\nunit = "s"\n')
    with pytest.raises(RecordError, match=r'acc has 3 columns, expected \["acc", column\]'):
        read(path, record_map)


def test_missing_values_are_nan_and_their_rows_said(tmp_path):
    table = TABLE.copy()
    table[6:8, 2] = np.nan, np.inf
    record = read(saved(tmp_path / "a.mat", data=table), mapped(tmp_path / "map.toml"))
    assert np.isnan(record["acc_y"].values[6:8]).all()
    assert [(finding.code, finding.where) for finding in record.findings] == [("nan", "rows 7-8")]


def test_what_cannot_be_read_is_said(tmp_path):
    record_map = mapped(tmp_path / "map.toml")
    path = saved(tmp_path / "a.mat", data=TABLE)
    with pytest.raises(RecordError, match="a MAT file names no units, expected a column map"):
        read(path)
    with pytest.raises(MapError, match=r"columns.acc_z.from: found no 3 in .*the arrays data \(50 x 3\)"):
        read(saved(tmp_path / "b.mat", data=TABLE[:, :3]), record_map)
    with pytest.raises(RecordError, match="holds no two-dimensional array of numbers"):
        read(saved(tmp_path / "c.mat", note="nothing"), record_map)
    unequal = mapped(tmp_path / "unequal.toml", t='["time", 0]', acc='["data", {index}]')
    with pytest.raises(RecordError, match="found 49 rows of t, 50 rows of acc_x"):
        read(saved(tmp_path / "d.mat", time=TABLE[1:, :1], data=TABLE), unequal)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(RecordError, match=r"byte 128: found a part that ends \d+ bytes too late"):
        read(path, record_map)
    path.write_bytes(b"")
    with pytest.raises(RecordError, match="cannot be read as a MAT file"):
        read(path, record_map)


def test_the_xsens_recording_shares_one_clock_and_raises_no_suspicion(tmp_path):
    text = '[columns.t]\nfrom = ["IMU0x2Dalpha", 0]\nunit = "s"\n'
    for sensor, variable in (("acc", "IMU0x2Dalpha"), ("gyro", "IMU0x2Domega")):
        for index, axis in enumerate("xyz", 1):
            text += f'[columns.{sensor}_{axis}]\nfrom = ["{variable}", {index}]\nunit = "count"\n'
    (tmp_path / "map.toml").write_text(text)
    told = []
    record = read(
        [EXAMPLES / "xsens_acc.mat", EXAMPLES / "xsens_gyro.mat"],
        tmp_path / "map.toml",
        lambda done, total: told.append((done, total)),
    )
    assert record["acc_x"].values.shape == (51175,)
    assert record["acc_x"].t is record["gyro_z"].t
    assert record["acc_x"].values[0] == 33108
    assert record["gyro_z"].values[-1] == 13676
    assert abs(record.triad("gyro").rate - 100.0) < 0.01
    assert record.findings == ()
    assert told[-1][0] == told[-1][1]


def test_a_file_whose_parts_do_not_fit_is_refused_before_scipy_reads_it(tmp_path):
    """Eight bytes lost near the end of such a file crash SciPy; type 0 and a part that is too long are no MAT file."""
    whole = saved(tmp_path / "a.mat", data=TABLE, cell=np.array([["a", TABLE]], object)).read_bytes()
    record_map = mapped(tmp_path / "map.toml", variable="data")
    path = tmp_path / "b.mat"
    path.write_bytes(whole)
    assert holds_table(read(path, record_map))
    for spoiled, said in (
        (whole[:-24] + whole[-16:], r"found a part that ends 8 bytes too late: it is damaged or cut"),
        (whole[:128] + bytes(4) + whole[132:], r"byte 128: found a part of type 0, expected one of 1 to 18"),
        (whole[:180] + b"\xff\xff" + whole[182:], r"byte 176: found a part that ends \d+ bytes too late"),
    ):
        path.write_bytes(spoiled)
        with pytest.raises(RecordError, match=said):
            read(path, record_map)


def test_what_scipy_reads_has_parts_that_fit():
    """Its own 108 files, by MATLAB and others from 4.2 to 8, on machines of either order of bytes."""
    own = sorted((Path(scipy.io.__file__).parent / "matlab" / "tests" / "data").glob("*.mat"))
    if not own:
        pytest.skip("this SciPy came without its tests")
    taken = 0
    for path in own:
        if mat._is_hdf5(path):
            continue
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                scipy.io.loadmat(path)
        except Exception:
            continue
        mat._check_structure(path)
        taken += 1
    assert taken > 80


def element(kind, data):
    """An element of a MAT file of version 5: a tag and the data, filled up to eight bytes."""
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


@pytest.mark.parametrize(("kind", "writer"), [("timetable", "writetimetable"), ("table", "writetable")])
def test_a_timetable_says_how_matlab_writes_it(tmp_path, kind, writer):
    """An opaque object (class 17), as MATLAB saves a timetable: name, type system, class, reference."""
    reference = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    reference += element(6, struct.pack("<I", 7))
    parts = [
        element(6, struct.pack("<II", 17, 0)),
        element(1, b"imu"),
        element(1, b"MCOS"),
        element(1, kind.encode()),
    ]
    body = b"".join(parts) + element(14, reference)
    path = tmp_path / "imu.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + element(14, body))
    with pytest.raises(RecordError, match=rf"'imu' is a MATLAB {kind}.*run {writer}\(imu, 'imu.csv'\)"):
        guess_map(path)


@pytest.mark.parametrize("channels", [3, 7])
def test_arrays_that_lie_on_their_side_are_guessed_so(tmp_path, channels):
    """Channels in rows, as MATLAB users write them: the map says so, and reads the same values."""
    gyro = np.random.default_rng(1).standard_normal((channels - 3, 400))
    acc = np.array([[0.3], [-0.2], [9.8]]) + 0.01 * np.random.default_rng(2).standard_normal((3, 400))
    path = saved(tmp_path / "m.mat", t=np.arange(400) / 100, acc=acc, other=np.vstack([acc, gyro]))
    text = guess_map(path)
    assert "transpose = true" in text
    record_map = tmp_path / "map.toml"
    record_map.write_text(text)
    np.testing.assert_array_equal(read(path, record_map).triad("acc").values, acc.T)


@pytest.mark.parametrize("rows", [30, 60, 400])
def test_an_array_of_rows_is_left_as_it_is(tmp_path, rows):
    path = saved(tmp_path / "m.mat", acc=9.8 + np.random.default_rng(2).standard_normal((rows, 20)))
    assert "transpose" not in guess_map(path)
