"""Commands that write a recording write it in the format that the suffix of --out names."""

import sys

import numpy as np
import pytest

from inercal.cli import run
from inercal.foundation.records.read import read
from inercal.foundation.records.write import SUFFIXES

STUDY = """
[site]
latitude = "39.1 deg"
[rig]
kind = "two_axis_turntable"
[positions]
plan = "24-position"
[instrument]
noise = "0.01 deg/h"
dwell = "2 s"
sample_rate = "5 Hz"
[instrument.coefficients]
DX_F = "50 deg/h"
k_x = "1"
"""


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.toml").write_text(STUDY)
    return "t.toml"


def simulate(study, out):
    return run(["simulate", "turntable", study, "--seed", "4", "--out", out, "--quiet"])


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".CSV"])
def test_every_suffix_holds_the_same_recording(study, suffix):
    assert simulate(study, "a.csv") == 0
    assert simulate(study, f"b{suffix}") == 0
    expected, found = read("a.csv"), read(f"b{suffix}")
    assert list(found.columns) == list(expected.columns)
    for name, column in expected.columns.items():
        assert found[name].unit == column.unit
        np.testing.assert_array_equal(found[name].values, column.values)
        np.testing.assert_array_equal(found[name].t, column.t)


def test_another_suffix_ends_before_any_work(study, capsys):
    assert simulate(study, "a.xlsx") == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(
        "inercal: error: a.xlsx: found the suffix '.xlsx' for --out, expected .csv"
    )
    assert captured.err.count("\n") == 1


def test_parquet_without_its_library_says_what_to_install(study, capsys, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert simulate(study, "a.parquet") == 2
    assert "pip install 'inercal[files]'" in capsys.readouterr().err
    assert not (tmp_path / "a.parquet").exists()


def test_rows_without_stamps_are_shown_without_a_rate(study, capsys, tmp_path):
    (tmp_path / "rows.csv").write_text("phi1 [deg],y_x [deg/h]\n0,1.5\n90,2.5\n180,1.0\n")
    assert run(["inspect", "rows.csv"]) == 0
    # samples, missing, rate, as the last cells before mean, sd, least and largest have them
    assert row_of("y_x", capsys)[-7:-4] == ["3", "0", "–"]
    assert simulate(study, "a.csv") == 0
    assert run(["inspect", "a.csv"]) == 0
    assert row_of("y_x", capsys)[-7:-4] == ["240", "0", "5"]


def row_of(channel, capsys):
    """The cells of a channel's row on standard output."""
    lines = capsys.readouterr().out.splitlines()
    return next(line.split() for line in lines if line.startswith(f"{channel} "))
