"""What is shown of a recording: numbers that survive bad data, a line of blocks, marked findings."""

import math
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from inercal.faces.report.inspection import (
    channels_table,
    inspection_pictures,
    norms,
    render_inspection,
    sparkline,
    summary,
)
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit

SOURCE = Source("runs/a <b>.csv", "0f" * 32)


def record(columns, t=None, findings=(), unit="m/s^2"):
    n = len(next(iter(columns.values()), ()))
    t = np.arange(n) / 100.0 if t is None else t
    return Record(
        {
            name: Column(name, parse_unit(unit), np.asarray(x, dtype=float), t, SOURCE)
            for name, x in columns.items()
        },
        findings,
        (SOURCE,),
    )


def test_channels_in_numbers():
    (row,) = summary(record({"acc_x": [1.0, 2.0, np.nan, 6.0, np.inf]}))
    assert (row.name, row.unit, row.samples, row.missing) == ("acc_x", "m/s^2", 5, 2)
    assert (row.mean, row.minimum, row.maximum) == (3.0, 1.0, 6.0)
    assert row.deviation == pytest.approx(math.sqrt(7.0))
    assert row.rate == pytest.approx(100.0)


def test_rows_of_a_table_without_stamps_have_no_rate():
    """Dwell rows are counted 0, 1, 2, ...: no sample rate follows from that."""
    counted = record({"phi1": [0.0, 90.0, 180.0], "y_x": [1.0, 2.0, 3.0]}, np.arange(3.0), unit="deg")
    assert [math.isnan(row.rate) for row in summary(counted)] == [True, True]
    assert "row, counted from 0" in inspection_pictures(counted)[0].svg
    timed = record({"phi1": [0.0, 90.0, 180.0]}, 60.0 * np.arange(3.0), unit="deg")
    assert summary(timed)[0].rate == pytest.approx(1.0 / 60.0)


@pytest.mark.parametrize(
    ("values", "t"),
    [
        ([], []),
        ([1.0], [0.0]),
        ([np.nan, np.nan], [0.0, 1.0]),
        ([1e308, -1e308, 1e308], [0.0, 0.0, 0.0]),
        ([np.inf, -np.inf, 0.0], [np.nan, np.nan, np.nan]),
        ([1.0, 2.0, 3.0], [3.0, 2.0, 1.0]),
    ],
)
def test_bad_data_is_described_and_drawn_without_a_warning(values, t):
    r = record({"acc_x": values}, np.array(t))
    rows = summary(r)
    assert rows[0].samples == len(values)
    assert len(sparkline(np.array(values))) == len(values)
    render_inspection(r, told(r), inspection_pictures(r))


values = arrays(float, st.integers(0, 200), elements=st.floats() | st.just(np.nan))


@given(values, st.integers(1, 40))
def test_sparkline(x, width):
    line = sparkline(x, width)
    assert len(line) == min(width, len(x))
    assert set(line) <= set(" ▁▂▃▄▅▆▇█")
    if len(x) <= width:
        assert [c == " " for c in line] == [not math.isfinite(v) for v in x]


@given(st.integers(2, 200))
def test_sparkline_of_a_ramp_climbs_from_bottom_to_top(n):
    line = sparkline(np.arange(n, dtype=float))
    assert list(line) == sorted(line)
    assert (line[0], line[-1]) == ("▁", "█")


def test_sparkline_does_not_depend_on_scale_or_offset():
    x = np.array([0.0, 1.0, 5.0, 3.0, np.nan, 2.0])
    assert sparkline(x) == sparkline(1e300 * x) == sparkline(4096.0 + 256.0 * x)
    assert sparkline(np.full(5, 3.0)) == "▅▅▅▅▅"


def test_one_picture_for_each_sensor():
    x = np.sin(np.arange(500.0))
    r = record({"acc_x": x, "acc_y": x, "gyro_x": x, "temperature": x})
    assert [picture.title for picture in inspection_pictures(r)] == ["acc", "gyro", "temperature"]


def reds(picture):
    return picture.svg.count("c03a2b")


@pytest.mark.parametrize(
    ("message", "where", "marked"),
    [
        ("acc_x: 3 samples in runs", "rows 3-10", True),
        ("acc_x: 3 samples in runs", "rows 3-10, 40 and 2 more", True),
        ("acc_x: one", "row 5", True),
        ("t: 1 gap", "rows 5-6", True),
        ("t of a <b>.csv: 1 gap", "rows 5-6", True),
        ("acc_x: of several files", "a <b>.csv, row 5", True),
        ("acc_x: beyond the end", "row 5000", False),
        ("acc_y: another channel", "row 5", False),
        ("t of other.csv: another file", "row 5", False),
        ("acc_x: lines of the text are not rows", "line 17", False),
        ("acc_x: no place", "", False),
    ],
)
def test_findings_are_marked_in_their_place(message, where, marked):
    clean = record({"acc_x": np.arange(100.0)})
    found = record({"acc_x": np.arange(100.0)}, findings=(Finding("nan", message, where),))
    assert (reds(inspection_pictures(found)[0]) > reds(inspection_pictures(clean)[0])) is marked


class Text(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.words, self.open = [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def told(r):
    """What the command brings back of a record, without its numbers."""
    return Estimate.without(Basis("inspect", inputs=r.sources), Status.OK, "", findings=r.findings)


def test_page():
    r = record({"acc_x": [1.0, 2.0, np.nan, 6.0]}, findings=(Finding("nan", "acc_x: <i>1 missing", "row 3"),))
    text = render_inspection(r, told(r), inspection_pictures(r))
    words = " ".join(" ".join(Text(text).words).split())
    for expected in (
        "Recording a <b>.csv",
        "acc_x m/s² 4 1 100 3 2.645751 1 6",
        "acc_x: <i>1 missing",
        "0f" * 32,
    ):
        assert expected in words
    assert "http" not in text
    assert text == render_inspection(r, told(r), inspection_pictures(r))


def test_the_norm_of_a_whole_triad_is_told_and_of_no_other():
    """(3, 0, 4) has length 5; a triad that lacks an axis, or has two units, has none; a missing sample is missing."""
    whole = {"acc_x": [3.0, np.nan], "acc_y": [0.0, 0.0], "acc_z": [4.0, 1.0], "gyro_x": [1.0, 1.0]}
    (norm,) = norms(record(whole))
    assert (norm.name, norm.mean, norm.missing) == ("|acc|", 5.0, 1)
    assert "|acc|" in channels_table(record(whole)).text()
    del whole["acc_z"]
    assert norms(record(whole)) == ()


def test_page_of_nothing():
    empty = Record({})
    assert "no channels" in render_inspection(empty, told(empty), inspection_pictures(empty))


def test_a_million_rows_stay_small():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(6, 1_000_000))
    r = record(
        {
            f"{sensor}_{axis}": x[3 * i + j]
            for i, sensor in enumerate(("acc", "gyro"))
            for j, axis in enumerate("xyz")
        }
    )
    pictures = inspection_pictures(r)
    assert all(len(picture.svg) < 300_000 for picture in pictures)
    assert len(render_inspection(r, told(r), pictures)) < 1_000_000
