"""What is worked out in parts, or without copies, so that long records fit the memory: the same as of the whole."""

import gc
import weakref

import numpy as np
from sting_study import DEG

from inercal.foundation.arrays import remembered
from inercal.systems.aoa.angles import unwrapped
from inercal.systems.aoa.paper.delay import _moved
from inercal.systems.aoa.reading import pauses, recording
from inercal.systems.aoa.reading.recording import in_time, later, plain
from rows import for_each


@for_each(
    "t",
    [
        [],
        [0.0],
        [np.nan, 1.0],
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0],
        [0.0, 1.0, 2.0, 2.0, 3.0, 4.0, 5.0],
        [0.0, 1.0, 2.0, 3.0, 2.5, 2.9, 4.0],
        [0.0, np.nan, 1.0, np.nan, np.nan, 2.0],
        [-np.inf, 0.0, np.inf, np.inf],
    ],
)
def test_rows_that_go_on_in_time_are_those_later_than_all_before(monkeypatch, t):
    monkeypatch.setattr(recording, "_PART", 3)
    t, highest, expected = np.array(t), -np.inf, []
    for row, stamp in enumerate(t.tolist()):
        if stamp > highest:
            highest, expected = stamp, [*expected, row]
    assert later(t).tolist() == expected
    np.testing.assert_array_equal(t[in_time(t)], t[expected])
    assert later(t, 1.0).tolist() == [row for row in expected if t[row] > 1.0]


def test_a_record_that_goes_on_is_not_copied():
    t = np.arange(10.0)
    assert np.shares_memory(t, t[in_time(t)])


@for_each("steps", [0.3, -0.3, 4.75, -4.75, 3.0, -3.0, 27.5, -27.5])
def test_samples_are_moved_by_steps_and_parts_of_steps(steps):
    """A sine of a fifth of the sample rate, away from the ends; a fortieth of a step would be 0.03."""
    rows, omega = np.arange(200.0), 0.4 * np.pi
    moved = _moved(np.sin(omega * rows), steps)
    np.testing.assert_allclose(moved[40:-40], np.sin(omega * (rows + steps))[40:-40], atol=1e-3)


def test_nothing_is_left_of_samples_that_are_moved_beyond_their_end():
    assert _moved(np.arange(5.0), 4.5) is None
    assert _moved(np.arange(5.0), -4.5) is None


def test_rest_is_the_same_in_parts_of_any_size(monkeypatch):
    """A pause, a move and a pause, 100 Hz; parts shorter than a window, too."""
    rng, t = np.random.default_rng(12), np.arange(1500) / 100.0
    theta = 10.0 * DEG * np.clip(t - 6.0, 0.0, 2.0) + 1e-4 * rng.standard_normal(len(t))
    u = np.full(len(t), 1e-4)
    still, scatter = pauses.at_rest(t, theta, u)
    assert still[:500].all()
    assert not still[650:750].any()
    for part in (7, 1499, 400):
        monkeypatch.setattr(pauses, "_PART", part)
        again, same = pauses.at_rest(t, theta, u)
        np.testing.assert_array_equal(again, still)
        # sums of squares of 0.1 rad, of which 1e-4 rad is left
        np.testing.assert_allclose(same, scatter, rtol=1e-7)


def test_angles_without_a_jump_of_a_turn_are_as_they_were():
    plain_sine, jumping = np.sin(np.arange(9.0)), np.array([3.0, -3.0, 3.1])
    assert unwrapped(plain_sine) is plain_sine
    np.testing.assert_array_equal(unwrapped(jumping), np.unwrap(jumping))


def test_the_interval_is_that_of_rows_that_go_on():
    t = np.array([0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0])
    assert plain(t, np.zeros((7, 3)), np.zeros(7)).interval == 1.0
    assert np.isnan(plain(t[:1], np.zeros((1, 3)), np.zeros(1)).interval)


def test_what_is_remembered_is_computed_once_and_does_not_outlive_its_argument():
    asked = []

    class Thing:
        pass

    @remembered
    def size(thing):
        asked.append(1)
        return len(asked)

    one, other = Thing(), Thing()
    assert [size(one), size(one), size(other), size(one)] == [1, 1, 2, 1]
    gone = weakref.ref(one)
    del one
    gc.collect()
    assert gone() is None
