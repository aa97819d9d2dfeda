"""Wrong stamps: told of a column and row by row alike, and from gaps, clocks that were set, and jitter."""

import gzip
import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

import inercal as ic
from inercal.faces.stream.doubt import Doubt, HeldRows
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Saving, run
from inercal.foundation.records.read import read
from inercal.foundation.records.stamps import Order, outlying
from inercal.foundation.records.write import SUFFIXES, write_record
from rows import for_each

T = np.round(np.arange(400) * 0.004, 3)


def row_by_row(t):
    order, wrong, row = Order(), [], 0
    for stamp in t.tolist():
        order, sound = order.on(stamp)
        wrong += [row + k for k, each in enumerate(sound) if not each]
        row += len(sound)
    return wrong + [row + k for k, each in enumerate(order.end()) if not each]


def with_stamps(changes, t=T):
    t = t.copy()
    for row, stamp in changes.items():
        t[row] = stamp
    return t


@for_each(
    "changes",
    [
    {199: 97.996}, {199: 0.096}, {199: -0.796}, {199: 796.0}, {200: 0.809}, {0: 97.0}, {0: -5.0}, {1: 90.004},
    {2: 90.008}, {399: 91.596}, {399: 0.596}, {399: -1.596}, {199: 97.996, 200: 98.0}, {10: 5.0, 100: 0.1, 300: 9.0},
    ],
)  # fmt: skip
def test_wrong_digits_are_found_and_no_others(changes):
    t = with_stamps(changes)
    assert outlying(t).tolist() == row_by_row(t) == list(changes)


@for_each(
    "t",
    [
    np.r_[T, T + 60.0], np.r_[T + 5.0, T], np.r_[T, T], np.repeat(T, 4), np.r_[T, 1.6 + 2.5 * T],
    T[::-1].copy(), np.delete(T, [50, 51, 52, 90]), with_stamps({100: 0.404, 101: 0.4}), with_stamps({200: 0.803}),
    np.floor(np.arange(400) / 5) * 0.1 + np.arange(400) % 5 * 1e-4, np.array([0.0, 60.0, 150.0, 400.0, 2000.0]),
    np.r_[T, 1.7, 1.704], np.r_[T, with_stamps({1: 0.008, 2: 0.004}) + 60.0],
    ],
)  # fmt: skip
def test_gaps_clocks_that_were_set_bursts_and_rows_that_came_late_stay(t):
    assert outlying(t).tolist() == row_by_row(t) == []


def test_a_wrong_stamp_beside_a_gap():
    t = np.r_[T, T + 60.0]
    for row in (399, 400, 401):
        wrong = with_stamps({row: 97.0}, t)
        assert outlying(wrong).tolist() == row_by_row(wrong) == [row]


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["even", "jitter", "bursts", "gaps", "repeated"]),
    st.integers(0, 8),
)
def test_a_column_and_rows_one_by_one_are_judged_alike(seed, kind, count):
    random = np.random.default_rng(seed)
    n = int(random.integers(1, 1500))
    t = {
        "even": np.arange(n) * 0.01,
        "jitter": np.arange(n) * 0.01 + random.normal(0.0, 0.002, n),
        "bursts": np.floor(np.arange(n) / 4) * 0.04 + np.arange(n) % 4 * 1e-4,
        "gaps": np.cumsum(np.where(random.random(n) < 0.02, 1.0, 0.01)),
        "repeated": np.floor(np.arange(n) / 3) * 0.03,
    }[kind]
    for _ in range(count):
        t[random.integers(n)] += random.choice([9.0, -9.0, 90.0, -90.0, 0.09, -0.09, np.nan])
    assert outlying(t).tolist() == row_by_row(t)


MAP = """[columns]
t = { from = "t", unit = "s" }
acc_x = { from = "acc_x", unit = "m/s^2" }
"""


def logged(path, t):
    """Write a recording with these stamps as a logger would; the map it needs, or None."""
    made = ic.record(t=T, acc_x=np.sin(T))
    arrays = {"t": t, "acc_x": np.sin(T)}
    match path.suffix:
        case ".mat":
            savemat(path, arrays)
        case ".tdms":
            with TdmsWriter(path) as file:
                file.write_segment([ChannelObject("log", name, values) for name, values in arrays.items()])
        case ".bin":
            path.write_bytes(np.column_stack(list(arrays.values())).astype("<f8").tobytes())
        case _:
            column = replace(made.columns["acc_x"], t=t)
            write_record(replace(made, columns={"acc_x": column}), path)
            return None
    binary = '[file]\nbinary = "<f8"\nfields = ["t", "acc_x"]\n' if path.suffix == ".bin" else ""
    (path.parent / "map.toml").write_text(binary + MAP)
    return path.parent / "map.toml"


@pytest.mark.parametrize("ending", [*SUFFIXES, ".csv.gz", ".mat", ".tdms", ".bin"])
def test_a_wrong_stamp_in_a_file_is_set_aside_and_said(ending, tmp_path):
    path = tmp_path / f"log{ending.removesuffix('.gz')}"
    record_map = logged(path, with_stamps({199: 97.996}))
    if ending.endswith(".gz"):
        packed = tmp_path / f"log{ending}"
        packed.write_bytes(gzip.compress(path.read_bytes()))
        path = packed
    found = read(path, record_map)
    (finding,) = [each for each in found.findings if each.code == "outlying_time"]
    assert finding.where == "row 200"
    assert "97.996 s beside 0.792 and 0.8 s" in finding.message
    assert np.flatnonzero(np.isnan(found["acc_x"].t)).tolist() == [199]
    assert not {"backward_time", "gap"} & {each.code for each in found.findings}


def test_a_wrong_first_stamp_does_not_move_begin():
    record = ic.record(t=with_stamps({0: -50.0}), acc_x=np.sin(T))
    assert record.between(0.0999, 0.2)["acc_x"].t[0] == pytest.approx(0.104)


class Echo:
    """Gives the row and time of each sample."""

    kind, columns, settings = "echo", ("t [s]", "row"), {"none": 0.0}

    def initial(self):
        return {"rows": 0}

    def step(self, state, sample):
        return {"rows": state["rows"] + 1}, [[sample.t, float(sample.row)]]

    def finish(self, state):
        return ()


def echoed(t, saving=None, rows=slice(None)):
    lines = [f"{stamp!r},{row}\n" for row, stamp in enumerate(t.tolist())]
    said, out = [], []
    stream = Lines(
        io.BytesIO(("t [s],acc_x [m/s^2]\n" + "".join(lines[rows])).encode()), "log", None, said.append
    )
    run(Echo(), stream, out.append, saving)
    return out[1:], said


def test_a_stream_gives_each_row_once_and_a_wrong_stamp_is_empty():
    out, said = echoed(with_stamps({199: 97.996}))
    assert [line.split(",")[1] for line in out] == [f"{float(row)}" for row in range(400)]
    assert [row for row, line in enumerate(out) if line.startswith(",")] == [199]
    (finding,) = said
    assert (finding.code, finding.where) == ("outlying_time", "line 201")
    assert "97.996 s beside 0.792 and 0.8 s" in finding.message


@pytest.mark.parametrize("cut", [198, 199, 200, 201, 202])
@pytest.mark.parametrize("again", ["the same", "one that goes on", "one that overlaps"])
def test_a_doubt_outlives_its_process(cut, again, tmp_path):
    t = np.r_[with_stamps({199: 97.996}), T + 60.0]
    whole, _ = echoed(t)
    saving = Saving(tmp_path / "state", 1000)
    echoed(t, saving, slice(None, cut))
    first = {"the same": 0, "one that goes on": cut, "one that overlaps": 150}[again]
    out, _ = echoed(t, saving, slice(first, None))
    seen = {float(line.split(",")[1]) for line in out}
    assert [line.split(",")[0] for line in out] == [line.split(",")[0] for line in whole[-len(out) :]]
    assert len(seen) == len(out)


def test_a_sound_row_is_given_at_once():
    lines = Lines(io.BytesIO(b"t [s],acc_x [g]\n" + b"".join(b"%g,1\n" % t for t in T)), "log", None, print)
    doubt, given = Doubt.of(HeldRows()), []
    for row, line in enumerate(iter(lines.next, None)):
        doubt, decided = doubt.on(lines.sample(line, row), line.number, lines)
        given.append(len(decided))
    assert given == [0, 0, 3, *[1] * 397]
