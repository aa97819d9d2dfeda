"""Parquet tables as pyarrow writes them."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from inercal.foundation.errors import MissingExtraError, RecordError
from inercal.foundation.records.read import canonical_units, read
from inercal.foundation.records.recognise.map_text import guess_map

T = np.arange(40) / 50
ACC = np.array([0.1, -0.2, 9.8]) + 0.01 * np.random.default_rng(23).standard_normal((40, 3))
AXES = [f"acc_{axis}" for axis in "xyz"]


def written(path, columns, units=None):
    """A table of (name, array) pairs, with units in the metadata of the fields."""
    arrays = [array if isinstance(array, pa.Array) else pa.array(array) for array in columns.values()]
    fields = [
        pa.field(name, array.type, metadata={"units": units[name]} if units and name in units else None)
        for name, array in zip(columns, arrays, strict=True)
    ]
    parquet.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), path, row_group_size=15)
    return path


def mapped(path, text):
    path.write_text(text)
    return path


def test_units_stand_in_the_titles_or_beside_them(tmp_path):
    acc = dict(zip(AXES, ACC.T, strict=True))
    beside = written(tmp_path / "a.parquet", {"t": T, **acc}, {"t": "s", **dict.fromkeys(AXES, "m/s^2")})
    titled = {f"{name} [m/s^2]": column for name, column in acc.items()}
    within = written(tmp_path / "b.parquet", {"time [ms]": 1e3 * T, **titled, "label": ["up"] * 40})
    for path in (beside, within):
        record = read(path)
        np.testing.assert_array_equal(record.triad("acc").values, ACC)
        np.testing.assert_allclose(record["acc_y"].t, T)
        assert canonical_units([path])["acc_x"].symbol == "m/s^2"
    assert record.labels == ("up",) * 40
    with pytest.raises(RecordError, match="found 't' without a unit"):
        read(written(tmp_path / "c.parquet", {"t": T, **acc}))


def test_columns_go_by_number_or_name_and_may_be_of_many_types(tmp_path):
    stamps = pa.array(10**9 * 1_700_000_000 + 20_000_000 * np.arange(40), pa.timestamp("ns", "UTC"))
    imu = pa.StructArray.from_arrays([pa.array(ACC[:, 0]), pa.array(np.arange(40, dtype="i2"))], ["x", "y"])
    part = pa.array(["up"] * 20 + ["down"] * 20).dictionary_encode()
    gaps = pa.array([None, *range(1, 40)], pa.int32())
    path = written(
        tmp_path / "a.parquet", {"when": stamps, "imu": imu, "part": part, "n": gaps, "ok": [True] * 40}
    )
    text = (
        '[columns.t]\nfrom = 0\nunit = "s"\n[columns.acc_x]\nfrom = "imu.x"\nunit = "g"\n'
        '[columns.acc_y]\nfrom = 2\nunit = "count"\n[columns.acc_z]\nfrom = "n"\nunit = "count"\n'
        '[columns.label]\nfrom = "part"\n[columns.trigger]\nfrom = "ok"\n'
    )
    record = read(path, mapped(tmp_path / "m.toml", text))
    np.testing.assert_allclose(record["acc_x"].t, 1.7e9 + T, atol=3e-7, rtol=0)
    np.testing.assert_array_equal(record["acc_x"].values, ACC[:, 0])
    np.testing.assert_array_equal(record["acc_y"].values, np.arange(40))
    np.testing.assert_array_equal(record["acc_z"].values, [np.nan, *range(1, 40)])
    np.testing.assert_array_equal(record["trigger"].values, np.ones(40))
    assert record.labels == ("up",) * 20 + ("down",) * 20
    assert [finding.message for finding in record.findings if finding.code == "nan"] == [
        "acc_z: 1 missing value"
    ]


def test_a_table_over_dates_names_itself(tmp_path):
    """As pandas writes a DatetimeIndex: the dates carry their unit, and count from 1970."""
    stamps = pa.array(10**9 * 1_700_000_000 + 20_000_000 * np.arange(40), pa.timestamp("ns"))
    record = read(written(tmp_path / "a.parquet", {"acc_x [g]": ACC[:, 0], "time": stamps}))
    np.testing.assert_allclose(record["acc_x"].t, 1.7e9 + T, atol=3e-7, rtol=0)
    assert record.findings == ()


def test_a_column_without_any_number_is_kept(tmp_path):
    """As an empty column of a text file is; only where no column holds a number nothing is left to read."""
    nothing = pa.nulls(40)  # as pandas writes a column of None
    columns = {"t [s]": T, "acc_x [g]": np.full(40, np.nan), "acc_y [g]": nothing}
    record = read(written(tmp_path / "a.parquet", columns))
    assert np.isnan([record["acc_x"].values, record["acc_y"].values]).all()
    assert [f.message for f in record.findings if f.code == "nan"] == [
        "acc_x: 40 missing values",
        "acc_y: 40 missing values",
    ]
    with pytest.raises(RecordError, match="no row of numbers in the mapped columns"):
        read(written(tmp_path / "b.parquet", {"t [s]": nothing, "acc_x [g]": nothing}))


def test_a_guess_reads_the_table(tmp_path):
    path = written(
        tmp_path / "a.parquet", {"ts_us": 1e6 * T, "ax": ACC[:, 0], "ay": ACC[:, 1], "az": ACC[:, 2]}
    )
    record_map = mapped(tmp_path / "m.toml", guess_map(path))
    record = read(path, record_map)
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    assert record["acc_x"].unit.symbol == "m/s^2"


def test_what_cannot_be_read_is_said(tmp_path, monkeypatch):
    path = written(tmp_path / "a.parquet", {"t [s]": T, "acc_x [g]": ACC[:, 0]})
    whole = path.read_bytes()
    for content in (b"", whole[:-20], whole[:100], b"PAR1" + bytes(50) + b"PAR1"):
        path.write_bytes(content)
        with pytest.raises(RecordError, match="cannot be read as a Parquet file") as caught:
            read(path)
        assert "\n" not in str(caught.value)
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(
        MissingExtraError, match=r"Reading Parquet files needs .*pip install 'inercal\[files\]'"
    ):
        read(path)
