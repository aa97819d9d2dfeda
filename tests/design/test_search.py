"""A plan is improved until no small change makes it better, from each random start alike in any place."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.foundation.computing.executors import Threads
from inercal.foundation.designs.search import from_starts, improved


@dataclass
class Line:
    """Whole numbers from 0 on, of heights that are drawn; only so many fit."""

    heights: tuple[float, ...]
    fitting: frozenset[int]
    asked: list[int] = field(default_factory=list)

    def first(self, rng):
        return int(rng.choice(sorted(self.fitting)))

    def changes(self, plan):
        return (plan - 1, plan + 1, plan + 3)

    def fits(self, plan):
        return plan in self.fitting

    def value(self, plan):
        self.asked.append(plan)
        return self.heights[plan]


@pytest.mark.kernels
@given(st.lists(st.integers(0, 20), min_size=8, max_size=30), st.integers(0, 9), st.data())
def test_no_change_that_fits_is_better_than_the_end(heights, seed, data):
    places = st.integers(0, len(heights) - 1)
    ground = Line(tuple(map(float, heights)), frozenset(data.draw(st.sets(places, min_size=1))))
    values = {}
    value, plan = improved(ground, np.random.default_rng(seed), values)
    assert ground.fits(plan)
    assert value == heights[plan] == min(values.values())
    assert all(heights[other] >= value for other in ground.changes(plan) if ground.fits(other))
    assert sorted(values) == sorted(ground.asked)  # each once
    assert set(ground.asked) <= ground.fitting


def test_plans_tried_by_an_earlier_start_are_not_judged_again():
    ground, values = Line(tuple(np.arange(30.0) % 7.0), frozenset(range(30))), {}
    rng = np.random.default_rng(4)
    ends = from_starts(lambda of: improved(ground, of, values), (rng,) * 20)
    assert len(set(ground.asked)) == len(ground.asked) == len(values)
    assert len({plan for _, plan in ends}) > 1  # from where it starts


def test_starts_end_with_the_same_digits_in_any_place():
    def drawn(rng):
        return rng.standard_normal()

    def streams():
        return np.random.default_rng(1).spawn(9)

    told = []
    here = from_starts(drawn, streams(), progress=lambda done, total: told.append((done, total)))
    assert from_starts(drawn, streams(), Threads(3)) == here
    assert len(set(here)) == 9
    assert told[0] == (0, 9)
    assert told[-1] == (9, 9)
