"""The loop over a stream: resumed anywhere, the digits are those of a run without interruption."""

import contextlib
import io
import math
import os
import signal
import threading
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Saving, run
from inercal.foundation.errors import InputError

HEADER = "t [s],acc_x [g]\n"


class State(NamedTuple):
    x: np.ndarray
    n: int


class Smoother:
    """A recursive mean that forgets, whose every digit depends on all samples before; changes its state in place."""

    kind = "smoother"
    columns = ("t [s]", "row", "x")

    def __init__(self, gain=0.3, every=1):
        self.gain, self.every = gain, every
        self.stop_at = None

    @property
    def settings(self):
        return {"gain": self.gain}

    def initial(self):
        return State(np.zeros(1), 0)

    def step(self, state, sample):
        if sample.row == self.stop_at:
            raise RuntimeError("killed")
        if math.isfinite(sample.values[0]):
            state.x[:] += self.gain * (sample.values[0] - state.x)
        outputs = [[sample.t, sample.row, float(state.x[0])]] if sample.row % self.every == 0 else []
        return State(state.x, state.n + 1), outputs

    def finish(self, state):
        return []


class Held(NamedTuple):
    state: State
    rows: np.ndarray


class Holding(Smoother):
    """It holds its lines, seven at a time."""

    def initial(self):
        return Held(super().initial(), np.empty((0, 3)))

    def step(self, state, sample):
        inner, outputs = super().step(state.state, sample)
        rows = np.vstack([state.rows, *outputs])
        full = len(rows) == 7
        return Held(inner, rows[:0] if full else rows), self.told(rows) if full else []

    def finish(self, state):
        return self.told(state.rows)

    def told(self, rows):
        return [[t, int(row), x] for t, row, x in rows.tolist()]


def recording(n, seed=1, t0=0.0):
    rng = np.random.default_rng(seed)
    return [f"{t0 + i / 100!r},{x!r}\n" for i, x in enumerate(rng.standard_normal(n).tolist())]


def play(estimator, rows, saving=None, said=None, header=HEADER):
    """Output lines of a stream, less the titles; those of a run that was killed too."""
    out = []
    data = (header + "".join(rows)).encode()
    lines = Lines(io.BytesIO(data), "stdin", None, lambda finding: None)
    with contextlib.suppress(RuntimeError):
        run(estimator, lines, out.append, saving, (said if said is not None else []).append)
    assert out[0] == "t [s],row,x"
    return out[1:]


def row_of(line):
    return int(line.split(",")[1])


@settings(deadline=None, max_examples=25)
@given(
    st.sampled_from([Smoother, Holding]),
    st.integers(1, 60),
    st.integers(1, 20),
    st.lists(st.integers(0, 60), max_size=3),
    st.integers(1, 3),
)
def test_killed_anywhere_and_resumed(tmp_path_factory, kind, n, every, kills, thinned):
    """Of the replayed stream each row is answered, those answered twice with the same digits, and none is lost."""
    saving = Saving(tmp_path_factory.mktemp("loop") / "state", every)
    rows, found = recording(n), {}
    expected = play(Smoother(every=thinned), rows)
    assert play(kind(every=thinned), rows) == expected
    for kill in (*sorted(kills), None):
        estimator = kind(every=thinned)
        estimator.stop_at = kill
        for line in play(estimator, rows, saving):
            assert found.setdefault(row_of(line), line) == line
    assert [found[row] for row in sorted(found)] == expected


def test_after_the_end_there_is_nothing_more_to_say(tmp_path):
    saving, said = Saving(tmp_path / "state", 1000), []
    rows = recording(30)
    assert len(play(Smoother(), rows, saving)) == 30
    assert play(Smoother(), rows, saving, said) == []
    assert said == [f"resumed after row 30 of {tmp_path / 'state'}", "30 rows passed over"]
    # the recording has grown since
    more = recording(50)
    assert play(Smoother(), more, saving) == play(Smoother(), more)[30:]


def test_lines_held_at_the_end_are_given_and_once_more_where_the_stream_goes_on(tmp_path):
    saving, rows = Saving(tmp_path / "state", 4), recording(40)
    whole = play(Smoother(), rows)
    assert play(Holding(), rows[:17], saving) == whole[:17]
    assert play(Holding(), rows[:17], saving) == whole[14:17]
    assert play(Holding(), rows[17:], saving) == whole[14:]


def test_a_live_stream_goes_on(tmp_path):
    """What is sent again is passed over, by its time; then the digits are as if nothing had happened."""
    rows = recording(100)
    whole = play(Smoother(), rows)
    for begin in (40, 39, 25, 1):
        saving, said = Saving(tmp_path / f"{begin}", 7), []
        assert play(Smoother(), rows[:40], saving) == whole[:40]
        assert play(Smoother(), rows[begin:], saving, said) == whole[40:]
        passed = "1 row" if begin == 39 else f"{40 - begin} rows"
        assert said[1:] == ["rows up to t = 0.39 s are passed over", f"{passed} passed over"]
        said.clear()
        assert play(Smoother(), rows[begin:90], saving, said) == []
        assert said[-1] == f"the stream ended after {90 - begin} rows, all passed over"


def test_a_live_stream_without_stamps_goes_on(tmp_path):
    """There every row of another stream is a new one, and rows are counted on."""
    rows = [f"{i},{x}\n" for i, x in enumerate(np.random.default_rng(2).standard_normal(20))]
    assert counted_on(tmp_path, rows[:8], rows[8:])[0] == rows_of(8, 20)


COARSE = [f"1,{x}\n" for x in np.random.default_rng(3).integers(0, 2, 150)]
OTHER = [*COARSE[:5], f"1,{7}\n", *COARSE[6:]]


@pytest.mark.parametrize(
    ("first", "second", "new", "words"),
    [
        # rows all alike do not tell one stream from another: nothing is lost
        (["1,5\n"] * 100, ["1,5\n"] * 60, 60, "the stream goes on, no row is passed over"),
        (["1,5\n"] * 100, ["1,5\n"] + ["1,6\n"] * 150, 151, "the stream goes on, no row is passed over"),
        # of coarse counts, the first row does not tell, all of the first 64 do
        (COARSE[:100], COARSE, 50, "100 rows passed over"),
        (COARSE[:10], COARSE, 140, "10 rows passed over"),
        (COARSE[:1], COARSE, 149, "1 row passed over"),
        (COARSE[:100], OTHER, 150, "the stream goes on, no row is passed over"),
        (COARSE[:100], COARSE[:40], 0, "the stream ended after 40 of these rows, all passed over"),
        (COARSE[:100], COARSE[:80], 0, "the stream ended after 80 of these rows, all passed over"),
    ],
)
def test_coarse_rows_without_stamps(first, second, new, words, tmp_path):
    """A stream is only taken for the saved one where its rows can tell; what is passed over is always said."""
    rows, said = counted_on(tmp_path, first, second)
    assert rows == rows_of(len(first), len(first) + new)
    assert said[1:] == [words]


def rows_of(begin, end):
    """Numbers of rows, as texts."""
    return [str(row) for row in range(begin, end)]


def counted_on(tmp_path, first, second):
    """Numbers of the rows answered in a second stream without stamps, and what is said; the digits are checked."""

    class Second(Smoother):
        def step(self, state, sample):
            return super().step(state, sample._replace(values=sample.values[1:]))

    header, saving, said = "position,y_x [deg/h]\n", Saving(tmp_path / "state", 3), []
    before = play(Second(), first, saving, header=header)
    after = play(Second(), second, saving, said, header=header)
    assert before + after == play(Second(), [*first, *second[len(second) - len(after) :]], header=header)
    return [line.split(",")[1] for line in after], said


def test_another_stream_that_begins_alike_is_refused(tmp_path):
    saving = Saving(tmp_path / "state", 5)
    play(Smoother(), recording(20), saving)
    other = recording(20)
    other[11] = "0.11,5.0\n"
    with pytest.raises(InputError, match="found other rows than the 20 of the checkpoint"):
        play(Smoother(), other, saving)


def test_a_replay_that_ends_too_soon_gives_no_line(tmp_path):
    saving, said = Saving(tmp_path / "state", 5), []
    play(Smoother(), recording(20), saving)
    before = saving.path.read_bytes()
    assert play(Smoother(), recording(20)[:10], saving, said) == []
    assert said[1:] == ["the stream ended after 10 of these rows, all passed over"]
    assert saving.path.read_bytes() == before


def test_a_row_without_its_end_is_answered_but_not_kept(tmp_path):
    """`0.1,1.2` may have been the beginning of `0.1,1.25`: the longer row takes its place after a resumption."""
    saving = Saving(tmp_path / "state", 5)
    rows = recording(20)
    cut = [*rows[:10], rows[10][:-4]]
    assert len(play(Smoother(), cut, saving)) == 11
    assert play(Smoother(), rows, saving) == play(Smoother(), rows)[10:]


def test_bad_rows_count(tmp_path):
    rows = recording(30)
    rows[3] = "junk\n"
    rows[12] = ",\n"
    saving, expected = Saving(tmp_path / "state", 4), play(Smoother(), rows)
    estimator = Smoother()
    estimator.stop_at = 14
    first = play(estimator, rows, saving)
    again = play(Smoother(), rows, saving)
    assert [*first[:12], *again] == expected
    assert expected[3].startswith(",3,")


@pytest.mark.parametrize(("gain", "header"), [(0.30000000000000004, HEADER), (0.3, "t [s],acc_x [m/s^2]\n")])
def test_a_state_of_other_settings_or_columns_is_refused(gain, header, tmp_path):
    saving = Saving(tmp_path / "state", 5)
    play(Smoother(), recording(20), saving)
    with pytest.raises(InputError, match="other settings or inputs"):
        play(Smoother(gain), recording(20), saving, header=header)


def test_a_state_that_cannot_be_saved_is_one_sentence(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        play(Smoother(), recording(20), Saving(tmp_path / "none" / "state", 5))


def test_a_reader_that_leaves_loses_no_row(tmp_path):
    """Lines it did not take are in no saved state, and so are given again."""
    saving, rows = Saving(tmp_path / "state", 4), recording(20)
    taken = []

    def write(text):
        if len(taken) == 12:
            raise BrokenPipeError
        taken.append(text)

    lines = Lines(io.BytesIO((HEADER + "".join(rows)).encode()), "stdin", None, print)
    with pytest.raises(BrokenPipeError):
        run(Smoother(), lines, write, saving)
    again = play(Smoother(), rows, saving)
    expected = play(Smoother(), rows)
    assert taken[1:] == expected[:11]
    assert again == expected[8:]


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_an_interrupt_finishes_the_row_in_work_and_saves(name, tmp_path):
    """As on Ctrl-C, so where a service is stopped or a terminal closed."""
    signum = signal.Signals[name]
    saving, rows = Saving(tmp_path / "state", 1000), recording(20)
    out = []

    def write(text):
        out.append(text)
        if len(out) == 8:
            os.kill(os.getpid(), signum)
            out.append(out.pop())  # still here: the interrupt waits

    lines = Lines(io.BytesIO((HEADER + "".join(rows)).encode()), "stdin", None, print)
    before = signal.getsignal(signum)
    with pytest.raises(KeyboardInterrupt):
        run(Smoother(), lines, write, saving)
    assert signal.getsignal(signum) is before
    assert out[1:] + play(Smoother(), rows, saving) == play(Smoother(), rows)
    assert len(out) == 8


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_an_interrupt_does_not_wait_for_a_line(tmp_path):
    """A silent stream is left at once, the state saved."""
    read, write_end = os.pipe()
    os.write(write_end, (HEADER + "".join(recording(5))).encode())
    saving = Saving(tmp_path / "state", 1000)
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    with os.fdopen(read, "rb") as stream:
        lines = Lines(stream, "stdin", None, print)
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            run(Smoother(), lines, lambda text: None, saving)
    os.close(write_end)
    assert play(Smoother(), recording(9), saving) == play(Smoother(), recording(9))[5:]


@pytest.mark.skipif(os.name == "nt", reason="locks as on POSIX")
def test_a_checkpoint_is_for_one_run_at_a_time(tmp_path):
    """A second run at the same time is refused and harms nothing; the lock goes with the run, and none hinders."""
    saving, rows, refused = Saving(tmp_path / "state", 4), recording(20), []

    class Nested(Smoother):
        def step(self, state, sample):
            if sample.row == 10:
                with pytest.raises(InputError, match=r"state: is in use by another run") as caught:
                    play(Smoother(), rows, saving)
                refused.append(caught)
            return super().step(state, sample)

    assert play(Nested(), rows, saving) == play(Smoother(), rows)
    assert len(refused) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["state"]
    (tmp_path / "state.lock").touch()  # as a killed run leaves it
    assert play(Smoother(), rows, saving) == []


def test_runs_in_another_thread_too():
    """Where signals cannot be handled."""
    out = []
    thread = threading.Thread(target=lambda: out.extend(play(Smoother(), recording(5))))
    thread.start()
    thread.join(10.0)
    assert out == play(Smoother(), recording(5))


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_an_interrupt_does_not_lose_the_total_of_flaws(tmp_path):
    """The first few of a kind are said as they come, the number of the others at the end, however it comes."""
    said, out = [], []

    def write(text):
        out.append(text)
        if len(out) == 15:
            os.kill(os.getpid(), signal.SIGINT)

    rows = [row if k % 2 else "oops\n" for k, row in enumerate(recording(40))]
    lines = Lines(io.BytesIO((HEADER + "".join(rows)).encode()), "stdin", None, said.append)
    with pytest.raises(KeyboardInterrupt):
        run(Smoother(), lines, write)
    assert [finding.code for finding in said] == ["bad_row"] * 6
    assert said[-1].message.endswith(": 2 more")
