"""NPZ archives, the shipped table test among them."""

import threading
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map

EXAMPLES = Path(str(files("inercal"))) / "examples"
T = np.arange(50) / 100
ACC = np.array([0.1, -0.2, 9.8]) + 0.01 * np.random.default_rng(22).standard_normal((50, 3))


def mapped(path, text):
    path.write_text(text)
    return path


def test_keys_are_canonical_titles(tmp_path):
    path = tmp_path / "run.npz"
    columns = {f"acc_{axis} [m/s^2]": column for axis, column in zip("xyz", ACC.T, strict=True)}
    np.savez_compressed(path, **{"t [ms]": 1e3 * T}, **columns, gain=2.0, label=np.array(["up"] * 50))
    record = read(path)
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_allclose(record["acc_x"].t, T)
    assert record.labels == ("up",) * 50
    text = '[columns.t]\nfrom = "t"\nunit = "ms"\n[columns.acc_y]\nfrom = "acc_y"\nunit = "g"\n'
    np.testing.assert_array_equal(read(path, mapped(tmp_path / "m.toml", text))["acc_y"].values, ACC[:, 1])


def test_dates_are_seconds(tmp_path):
    stamps = np.datetime64("2024-05-06T07:08:09.5", "us") + (1e6 * T).astype("timedelta64[us]")
    stamps[3] = np.datetime64("NaT")
    path = tmp_path / "run.npz"
    np.savez(path, when=stamps, data=np.array(list(zip(stamps, ACC[:, 2], strict=True)), "M8[us],f4"))
    text = '[columns.t]\nfrom = "{}"\nunit = "s"\n[columns.acc_z]\nfrom = "data/f1"\nunit = "m/s^2"\n'
    for name in ("when", "data/f0"):
        t = read(path, mapped(tmp_path / "m.toml", text.format(name)))["acc_z"].t
        np.testing.assert_allclose(np.delete(t, 3), np.delete(1714979289.5 + T, 3), atol=3e-7, rtol=0)
        assert np.isnan(t[3])
    with pytest.raises(RecordError, match='when holds dates, which are read in seconds, expected unit = "s"'):
        read(path, mapped(tmp_path / "m.toml", text.replace('"s"', '"ms"').format("when")))


def test_dates_need_no_unit(tmp_path):
    """They carry it: a channel of dates is in seconds since 1970, one of durations in seconds."""
    path = tmp_path / "run.npz"
    steps = (1e6 * T).astype("timedelta64[us]")
    for stamps, zero in ((np.datetime64("1970-01-02") + steps, 86400.0), (steps, 0.0)):
        np.savez(path, **{"time": stamps, "acc_z [g]": ACC[:, 2]})
        np.testing.assert_allclose(read(path)["acc_z"].t, zero + T, rtol=0, atol=1e-10)
        assert 'unit = "s"' in guess_map(path)


def test_whole_numbers_with_too_many_digits_are_said(tmp_path):
    """A count is kept if it has 53 bits between its first and last 1, whatever its size and sign."""
    path = tmp_path / "run.npz"
    counts = [2**53 + 2, 2**53 + 1, -(2**53) - 1, -(2**63), 2**62 + 2**9, 2**62 + 2**10, 7, 2**63 - 1]
    sizes = np.array([2**64 - 1, 2**63, 2**63 + 2**11, 0, 1, 2, 3, 4], np.uint64)
    stamps = 1_700_000_000_123_456_789 + 10**7 * np.arange(8)
    np.savez(path, **{"t [ns]": stamps, "acc_x [count]": counts, "acc_y [count]": sizes})
    found = [(f.message, f.where) for f in read(path).findings if f.code == "resolution"]
    assert found == [
        ("acc_x: 4 whole numbers beyond 2^53, rounded to 53 bits", "rows 2-3, 5, 8"),
        ("acc_y: 1 whole number beyond 2^53, rounded to 53 bits", "row 1"),
    ]
    for name, exact in (("acc_x", counts), ("acc_y", sizes.tolist())):  # Python compares integers exactly
        kept = [int(value) == number for value, number in zip(read(path)[name].values, exact, strict=True)]
        assert kept == (
            [True, False, False, True, False, True, True, False] if name == "acc_x" else [False] + [True] * 7
        )


def test_only_wanted_arrays_are_read_and_no_objects(tmp_path):
    """An array of objects, which could run any code on loading, is as if it were not there."""
    path = tmp_path / "run.npz"
    np.savez(path, acc=ACC, t=T, evil=np.array([{"a": 1}, None], dtype=object))
    text = '[columns.acc_x]\nfrom = ["acc", 0]\nunit = "g"\n[columns.t]\nfrom = "t"\nunit = "s"\n'
    np.testing.assert_array_equal(read(path, mapped(tmp_path / "m.toml", text))["acc_x"].values, ACC[:, 0])
    evil = mapped(tmp_path / "m.toml", text.replace('["acc", 0]', '"evil"'))
    with pytest.raises(MapError, match=r"found no 'evil' in .*\(the arrays acc \(50 x 3\), t \(50 x 1\)\)"):
        read(path, evil)


def test_the_table_test_names_itself():
    """26530 samples at 100 Hz on a two-axis table: gravity at any angle, and rates when it turns."""
    record = read(EXAMPLES / "table.npz")
    assert list(record.columns)[-2:] == ["phi1", "phi2"]
    assert len(record["acc_x"].values) == 26530
    assert record.triad("acc").rate == pytest.approx(100.0)
    assert np.median(np.linalg.norm(record.triad("acc").values, axis=1)) == pytest.approx(9.815, rel=0.02)
    turned = np.diff(record["phi2"].si())
    assert np.abs(turned).max() * 100 == pytest.approx(np.abs(record.triad("gyro").values).max(), rel=0.05)


def test_arrays_without_units_need_a_map(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, t=T, accel=ACC.astype("f4"), slow=ACC[::10], label=np.array([b"up", b"down"] * 25))
    with pytest.raises(RecordError, match="found 't' without a unit"):
        read(path)
    record_map = mapped(tmp_path / "m.toml", guess_map(path))
    assert 'from = ["accel", 0]' in record_map.read_text()
    record = read(path, record_map)
    np.testing.assert_array_equal(record.triad("acc").values, ACC.astype("f4"))
    assert record.labels == ("up", "down") * 25
    record_map.write_text(record_map.read_text().replace('"accel"', '"slow"'))
    with pytest.raises(RecordError, match=r"found 50 rows of t, .*5 rows of acc_x"):
        read(path, record_map)


def test_damaged_archives_end_in_one_sentence(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, **{"t [s]": T, "acc_x [g]": ACC[:, 0]})
    whole = path.read_bytes()
    for content in (b"", whole[:40], whole[:-30], whole[:90] + bytes(40) + whole[130:]):
        path.write_bytes(content)
        with pytest.raises(RecordError, match="cannot be read as an NPZ file") as caught:
            read(path)
        assert "\n" not in str(caught.value)


def test_an_archive_is_read_beside_another_thread():
    """As in a server: the child is then no fork, and is handed all it needs."""
    ended = threading.Event()
    beside = threading.Thread(target=ended.wait)
    beside.start()
    try:
        record = read(EXAMPLES / "table.npz")
    finally:
        ended.set()
        beside.join()
    assert len(record["acc_x"].values) > 10_000
