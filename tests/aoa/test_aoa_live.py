"""The live fusion is the batch fusion, digit for digit, however its samples come; and quick enough for 1 kHz."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from sting_study import BASE, DEG, G, study

from inercal.faces.stream.checkpoint import load, save
from inercal.foundation.errors import RecordError
from inercal.foundation.units import parse_quantity
from inercal.systems.aoa.fusion import run as fusion
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.live import Answers, Live, LiveState
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import Attitude
from inercal.systems.aoa.simulate import simulate

ROWS = 400


def rows_of(recording, chosen):
    """A recording of some rows of another."""
    return Recording(
        *(getattr(recording, name)[chosen] for name in ("t", "acc", "gyro", "turns", "zero_angle"))
    )


def flawed(seed=1, spatial=False):
    """Rows with all that is wrong with rows; and their problem."""
    of = study(
        motion=replace(BASE, duration=ROWS / 1000.0),
        attitude=Attitude(roll=parse_quantity("5.0(2) deg", "angle", "roll")) if spatial else Attitude(),
    )
    rng = np.random.default_rng(seed)
    recording = simulate(of, rng).recording
    t, acc, gyro = recording.t[:ROWS].copy(), recording.acc[:ROWS].copy(), recording.gyro[:ROWS].copy()
    turns, stated = np.full((ROWS, 2), np.nan), np.full((ROWS, 2), np.nan)
    t[:3] = np.nan, 5e-4, 4e-4  # no stamp, and one that runs backward before there is an angle
    acc[5], gyro[8] = np.nan, np.nan
    acc[60:64, 1], gyro[70:75] = np.nan, np.nan
    acc[90, 2] += 0.5 * G
    t[100], t[110], t[120:124], t[130] = t[99], t[80], np.nan, t[129] - 1e-9
    stated[40:50] = 30.0 * DEG, 0.05 * DEG
    t[150:] += 30.0  # theta is lost
    t[155] = t[150]
    acc[200:215] = np.nan
    t[230:] += 30.0  # lost, and what comes tells no angle
    acc[230:255] = np.nan
    t[395:] += 30.0  # lost, with fewer rows to come than a start waits for
    if spatial:
        turns[:] = rng.normal(0.0, 0.02, (ROWS, 2))
        turns[70:73, 0], turns[240:245] = np.nan, np.nan
    return Recording(t, acc, gyro, turns, stated), problem(of, spatial)


def joined(parts):
    """All that was said, in one."""
    return Answers(np.concatenate([part.t for part in parts]), np.concatenate([part.out for part in parts]))


def same(told, found, t):
    """Every row is answered, with the digits of the whole record."""
    assert_array_equal(told.t, t)
    for name in ("theta", "u", "rate", "rate_u"):
        assert_array_equal(getattr(told.angles, name), getattr(found, name))
    assert_array_equal(told.innovations, found.innovations)


@pytest.mark.parametrize("spatial", [False, True])
def test_sample_by_sample(spatial):
    recording, of = flawed(spatial=spatial)
    found = estimate(recording, of)
    assert len(found.starts) == 4  # at first, and after each of three gaps
    live = Live(of)
    parts = [live.feed(t, readings) for t, readings in zip(recording.t, recording.rows, strict=True)]
    # the first row has no stamp and is answered at once; then twenty are held, one more among them runs backward
    assert [len(part.t) for part in parts[:25]] == [1, *[0] * 20, 21, 1, 1, 1]
    same(joined([*parts, live.finish()]), found, recording.t)
    for one, other in zip(live.state.fusion, found.state, strict=True):
        assert_array_equal(one, other)


@settings(deadline=None, max_examples=40)
@given(
    st.lists(st.integers(0, 60), min_size=1, max_size=40),
    st.integers(0, 3),
    st.booleans(),
)
@example([1, 1, 400], 0, False)
@example([ROWS], 1, True)
@example([19, 1, 1, 19, 1], 2, True)
def test_in_blocks_of_any_size(sizes, seed, spatial):
    """Blocks, single samples among them, and states that are saved and taken up again between them."""
    recording, of = flawed(seed, spatial)
    live, at, parts = Live(of), 0, []
    for k, size in enumerate([*sizes, ROWS]):
        block = rows_of(recording, slice(at, at + size))
        at += len(block.t)
        if len(block.t) == 1:
            parts.append(live.feed(block.t[0], block.rows[0]))
        else:
            parts.append(live.feed_block(block))
        if k % 3 == 0:
            live = Live(of, live.state)
    parts.append(live.finish())
    same(joined(parts), estimate(recording, of), recording.t)


def test_a_state_is_saved_bit_for_bit_and_its_copy_stays(tmp_path):
    """Also among rows that are held; going on from a state does not touch it."""
    recording, of = flawed(2)
    whole = joined([(live := Live(of)).feed_block(recording), live.finish()])
    for at in (0, 7, 30, 153, 240):
        live = Live(of)
        first = live.feed_block(rows_of(recording, slice(0, at)))
        save(tmp_path / "state", "live", "", live.state)
        state = load(tmp_path / "state", "live", "", LiveState(fusion.initial(of), np.empty(0), 0))
        for _ in range(2):
            live = Live(of, state)
            rest = live.feed_block(rows_of(recording, slice(at, None)))
            told = joined([first, rest, live.finish()])
            assert_array_equal(told.out, whole.out)


def test_a_record_shorter_than_a_start_is_answered_at_its_end():
    recording, of = flawed(3)
    short = rows_of(recording, slice(3, 10))
    live = Live(of)
    assert len(live.feed_block(short).t) == 0
    told = live.finish()
    same(told, estimate(short, of), short.t)
    assert np.isfinite(told.angles.theta).all()
    assert len(live.finish().t) == 0


@pytest.mark.parametrize("at", [4, 60])
@pytest.mark.parametrize("size", [1, 7, 2 * LIMITS.backward_rows])
def test_a_clock_that_was_set_back_is_said(at, size):
    """As in a file: so many rows in a row that are not later, whether rows are held or not, and however they come."""
    recording, of = flawed()
    good = rows_of(recording, slice(3, 3 + at))
    back = rows_of(recording, np.full(2 * LIMITS.backward_rows, 3))
    back = replace(back, t=back.t - 1.0)
    live = Live(of, where="log.csv")
    live.feed_block(good)
    for k in range(0, LIMITS.backward_rows - size, size):
        live.feed_block(rows_of(back, slice(k, k + size)))
    first = LIMITS.backward_rows - 1 - (LIMITS.backward_rows - 1) % size
    with pytest.raises(RecordError, match=r"log\.csv.* rows in a row .*expected time to increase"):
        live.feed_block(rows_of(back, slice(first, first + size)))
    with pytest.raises(RecordError, match="rows in a row"):
        estimate(
            Recording(
                *(
                    np.concatenate([getattr(good, name), getattr(back, name)])
                    for name in ("t", "acc", "gyro", "turns", "zero_angle")
                )
            ),
            of,
        )


def test_fewer_late_rows_than_that_are_left_out_however_they_come():
    recording, of = flawed()
    good = rows_of(recording, slice(3, 60))
    back = replace(
        rows_of(good, np.zeros(LIMITS.backward_rows - 1, np.int64)), t=np.full(LIMITS.backward_rows - 1, -1.0)
    )
    live = Live(of)
    parts = [live.feed_block(good)]
    for _ in range(3):
        parts += [
            live.feed_block(rows_of(back, slice(k, k + 333))) for k in range(0, LIMITS.backward_rows - 1, 333)
        ]
        good = replace(good, t=good.t + 0.1)
        parts.append(live.feed_block(good))
    told = joined(parts)
    assert np.isnan(told.angles.theta).sum() == 3 * (LIMITS.backward_rows - 1)


def test_the_angle_comes_with_the_sample():
    """Fed live, the angle of a sample is known at once and within five u of the truth."""
    of = study(states=8, motion=replace(BASE, duration=2.0))
    made = simulate(of, np.random.default_rng(5))
    live, recording = Live(problem(of)), made.recording
    for k, truth in enumerate(made.theta):
        told = live.feed(recording.t[k], recording.rows[k])
        if k >= LIMITS.starting_rows:
            assert len(told.t) == 1
            assert abs(told.angles.theta[0] - truth) < 5.0 * told.angles.u[0]
