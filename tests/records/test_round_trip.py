"""What is written reads back the same, in every format: values to the bit, units, time stamps, labels."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column, clocks
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.records.stamps import with_sound_stamps
from inercal.foundation.records.write import SUFFIXES, write_record
from inercal.foundation.units import parse_unit

SOURCE = Source("run 7 °.csv", "0" * 64)
CHANNELS = [
    ("acc_x", "m/s^2"),
    ("acc_y", "ug"),
    ("gyro_z", "deg/h"),
    ("gyro", "count"),
    ("temperature", "degC"),
    ("phi1", "arcmin"),
    ("position", "1"),
    ("a12", "V"),
]
LABELS = ["", "rest", "a; b", "c\td", "x up, at rest", 'the "last" one', "Höhe 2", "5", "#1", "nan"]

known = st.floats(-1e29, 1e29)
numbers = known | st.just(np.nan)
stamps = st.floats(-1e9, 1e9) | st.just(np.nan)


def column(name, unit, values, t):
    return Column(name, parse_unit(unit), np.array(values), t, SOURCE)


@st.composite
def tables(draw):
    """Records of one clock; one number at least in the time and in a column, as readers ask for."""
    n = draw(st.integers(1, 12))
    t = np.array([draw(st.floats(-1e9, 1e9)), *draw(st.lists(stamps, min_size=n - 1, max_size=n - 1))])
    chosen = draw(st.lists(st.sampled_from(CHANNELS), min_size=1, unique=True))
    columns = [column(*each, draw(st.lists(numbers, min_size=n, max_size=n)), t) for each in chosen]
    columns[0].values[0] = draw(known)
    labels = draw(st.lists(st.sampled_from(LABELS), min_size=n, max_size=n)) if draw(st.booleans()) else ()
    return Record({each.name: each for each in columns}, sources=(SOURCE,), labels=tuple(labels))


def bits(values):
    """The bytes of numbers; of NaN there are many, which are one here."""
    return np.where(np.isnan(values), np.nan, values).tobytes()


def assert_same(found, record):
    assert sorted(found.columns) == sorted(record.columns)
    for name, written in with_sound_stamps(record.columns)[0].items():  # without those that are wrong
        back = found[name]
        assert (back.unit, back.sensor, back.axis, back.frame) == (
            written.unit,
            written.sensor,
            written.axis,
            written.frame,
        )
        assert bits(back.values) == bits(written.values), name
        assert bits(back.t) == bits(written.t), name
    assert found.labels == record.labels


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("written")


@pytest.mark.parametrize("suffix", SUFFIXES)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(record=tables())
def test_a_record_reads_back_the_same(suffix, folder, record):
    path = folder / f"record{suffix}"
    write_record(record, path)
    found = read(path)
    assert list(found.columns) == list(record.columns)
    assert_same(found, record)


def two_clocks(labels=()):
    slow, fast = np.arange(4.0) / 7, np.arange(9.0) / 70
    names = {"acc_x": slow, "gyro_x": fast, "gyro_y": fast, "acc_y": fast + 1.0, "temperature": slow}
    rng = np.random.default_rng(3)
    columns = [column(name, "count", rng.standard_normal(len(t)), t) for name, t in names.items()]
    findings = (Finding("gap", "t: 1 gap, °", "row 3"),)
    return Record({each.name: each for each in columns}, findings, (SOURCE,), labels)


@pytest.mark.parametrize("suffix", [".h5", ".nc"])
def test_several_clocks_are_kept(suffix, tmp_path):
    record = two_clocks(labels=("a", "b", "", "ä"))
    write_record(record, tmp_path / f"two{suffix}")
    assert_same(read(tmp_path / f"two{suffix}"), record)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_a_table_has_one_clock(suffix, tmp_path):
    path = tmp_path / f"two{suffix}"
    with pytest.raises(
        InputError, match="gyro_x has another clock than acc_x, expected one for a table, or a"
    ):
        write_record(two_clocks(), path)
    assert not path.exists()


def test_clocks_go_by_their_first_sensor():
    named = clocks(two_clocks().columns, "t")
    assert named.of_column == {
        "acc_x": "t_acc",
        "gyro_x": "t_gyro",
        "gyro_y": "t_gyro",
        "acc_y": "t_acc_2",
        "temperature": "t_acc",
    }


def test_equal_stamps_are_one_clock():
    t = np.array([0.0, np.nan, 1.0])
    columns = [column("acc_x", "g", t, t), column("acc_y", "g", t, t.copy())]
    assert list(clocks({each.name: each for each in columns}, "t").axes) == ["t"]


@pytest.mark.parametrize(("suffix", "engine"), [(".h5", "h5netcdf"), (".nc", "scipy")])
def test_other_programs_open_the_file(suffix, engine, tmp_path):
    """xarray sees a dimension coordinate for each clock, units, and where the record came from."""
    import json

    import xarray

    record = two_clocks(labels=("a", "b", "", "ä"))
    write_record(record, tmp_path / f"two{suffix}")
    with xarray.open_dataset(tmp_path / f"two{suffix}", engine=engine) as data:
        assert dict(data.sizes) == {"t_acc": 4, "t_gyro": 9, "t_acc_2": 9}
        assert data.gyro_y.dims == ("t_gyro",)
        np.testing.assert_array_equal(data.gyro_y, record["gyro_y"].values)
        np.testing.assert_array_equal(data.t_gyro, record["gyro_y"].t)
        assert data.t_gyro.attrs["units"] == "s"
        assert data.gyro_y.attrs == {"units": "count", "sensor": "gyro", "axis": "y", "frame": "b"}
        assert data.label.values.tolist() == ["a", "b", "", "ä"]
        (source,) = json.loads(data.attrs["sources"])
        assert source == {"path": SOURCE.path, "sha256": SOURCE.sha256}
        (finding,) = json.loads(data.attrs["findings"])
        assert finding == record.findings[0].to_json()


def test_a_parquet_file_states_units(tmp_path):
    from pyarrow import parquet

    t = np.arange(3.0)
    write_record(Record({"acc_x": column("acc_x", "ug", t, t)}), tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == ["t [s]", "acc_x [ug]"]
    assert [table.schema.field(k).metadata[b"units"] for k in (0, 1)] == [b"s", b"ug"]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_is_written_whole_or_not_at_all(suffix, tmp_path, monkeypatch):
    """A disk that fills up leaves the file there was, and nothing else."""
    import os

    t = np.arange(3.0)
    record = Record({"acc_x": column("acc_x", "g", t, t)})
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"before")
    monkeypatch.setattr(
        os, "fsync", lambda handle: (_ for _ in ()).throw(OSError(28, "No space left on device"))
    )
    with pytest.raises(InputError, match="cannot be written"):
        write_record(record, path)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_written(tmp_path, monkeypatch):
    t = np.arange(2.0)
    record = Record({"acc_x": column("acc_x", "g", t, t)}, labels=("one\ntwo", ""))
    with pytest.raises(InputError, match=r"found the suffix '\.doc', expected one of \.csv, \.npz, "):
        write_record(record, tmp_path / "a.doc")
    with pytest.raises(InputError, match="no columns"):
        write_record(Record({}), tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"expected one line for a \.csv file"):
        write_record(record, tmp_path / "a.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_extra_says_how_to_install_it(tmp_path, monkeypatch):
    import sys

    from inercal.foundation.errors import MissingExtraError

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    t = np.arange(2.0)
    with pytest.raises(MissingExtraError, match=r"pip install 'inercal\[files\]'"):
        write_record(Record({"acc_x": column("acc_x", "g", t, t)}), tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []
