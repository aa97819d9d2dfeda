"""Pictures of long recordings: what is drawn holds the extremes of what is there, down to single samples."""

import numpy as np
import pytest

import inercal as ic
from inercal.bench.workbench.charts import BLOCK, PIECES, course_figure, courses, line

RNG = np.random.default_rng(5)
LONG = 2 * PIECES * BLOCK + 100_000


def course(values, rate=100.0):
    return courses(ic.record(acc_x=values, rate=rate))[0]


@pytest.mark.parametrize("n", [1, 100, 2 * PIECES, 50_000, LONG])
def test_the_line_holds_least_and_greatest_of_all(n):
    values = RNG.normal(size=n)
    t, drawn = line(course(values))
    assert (drawn.min(), drawn.max()) == (values.min(), values.max())
    assert len(t) == len(drawn) <= 2 * PIECES
    assert np.all(np.diff(t) >= 0.0)


def test_a_single_spike_in_a_long_recording_is_drawn_where_it_is():
    values = np.zeros(LONG)
    values[1_234_567] = 1.0
    t, drawn = line(course(values))
    assert drawn.max() == 1.0
    assert abs(t[np.argmax(drawn)] - 12345.67) < LONG / PIECES / 100.0 + BLOCK / 100.0


def test_zooming_ends_at_the_samples_themselves():
    values = RNG.normal(size=LONG)
    t, drawn = line(course(values), 1000.0, 1001.0)
    inside = (t >= 1000.0) & (t <= 1001.0)
    assert inside.sum() == 101
    np.testing.assert_array_equal(drawn[inside], values[100_000:100_101])


def test_missing_samples_leave_no_number_and_no_warning():
    values = RNG.normal(size=10_000)
    values[2000:4000] = np.nan
    made = course_figure(courses(ic.record(acc_x=values, acc_y=values, rate=100.0)))
    assert None in made["data"][0]["y"]
    assert {each["yaxis"] for each in made["data"]} == {"y"}


def test_times_that_do_not_rise_are_counted():
    record = ic.record(acc_x=np.arange(5.0), t=np.array([0.0, 1.0, 1.0, 2.0, 3.0]))
    t, drawn = line(courses(record)[0])
    np.testing.assert_array_equal(t, np.arange(5.0))
    np.testing.assert_array_equal(drawn, np.arange(5.0))
