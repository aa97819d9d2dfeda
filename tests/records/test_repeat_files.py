"""Repeat runs: which files belong together, told by their channels."""

import itertools

import pytest

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read import read, read_runs


def csv(folder, name, channels, start=0.0):
    path = folder / name
    header = ",".join(
        ["t [s]", *(f"{channel} [g]" if "acc" in channel else f"{channel} [deg/s]" for channel in channels)]
    )
    rows = [",".join([f"{0.1 * k}", *(f"{start + k}" for _ in channels)]) for k in range(4)]
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


ACC, GYRO = ["acc_x", "acc_y", "acc_z"], ["gyro_x", "gyro_y", "gyro_z"]


def test_files_with_distinct_channels_are_one_run(tmp_path):
    (record,) = read_runs([csv(tmp_path, "a.csv", ACC), csv(tmp_path, "g.csv", GYRO)])
    assert set(record.columns) == {*ACC, *GYRO}


def test_files_with_the_same_channels_are_runs(tmp_path):
    files = [csv(tmp_path, f"{k}.csv", ACC + GYRO, k) for k in range(3)]
    runs = read_runs(files)
    assert [run["acc_x"].values[0] for run in runs] == [0.0, 1.0, 2.0]
    with pytest.raises(RecordError, match="expected each channel in one file"):
        read(files)


def test_pairs_in_any_order_find_each_other(tmp_path):
    """Accelerometers 1 and 2 and gyros 1 and 2, each kind in the order of the runs."""
    a = [csv(tmp_path, f"a{k}.csv", ACC, k) for k in (1, 2)]
    g = [csv(tmp_path, f"g{k}.csv", GYRO, k) for k in (1, 2)]
    for order in itertools.permutations([*a, *g]):
        if order.index(a[0]) < order.index(a[1]) and order.index(g[0]) < order.index(g[1]):
            for k, run in enumerate(read_runs(order), start=1):
                assert (run["acc_x"].values[0], run["gyro_x"].values[0]) == (k, k)


def test_one_recording_is_not_two_runs(tmp_path):
    path = csv(tmp_path, "a.csv", ACC)
    with pytest.raises(RecordError, match="given twice"):
        read_runs([path, tmp_path / "." / "a.csv"])
    copy = tmp_path / "copy.csv"
    copy.write_bytes(path.read_bytes())
    with pytest.raises(RecordError, match=r"holds the same as .*expected each run once"):
        read_runs([path, copy])
