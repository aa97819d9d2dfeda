"""Which candidates may be taken: limits of the axes modulo whole turns, limits of sensitivity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from positions import drift, efficiency, gravity

from inercal.foundation.designs.criteria import D, insensitive
from inercal.foundation.designs.exchange import exchange
from inercal.foundation.errors import InputError
from inercal.foundation.rigs.plans import grid, within


def test_whole_turns_do_not_matter():
    angles = np.radians(
        [[350.0, 5.0], [-10.0, 725.0], [20.0, -355.0], [21.0, 5.0], [339.9, 5.0], [0.0, 185.0]]
    )
    limits = [tuple(np.radians([-20.0, 20.0])), tuple(np.radians([0.0, 10.0]))]
    assert within(angles, limits).tolist() == [True, True, True, False, False, False]
    assert within(angles, [limits[0], None]).tolist() == [True, True, True, False, False, True]


@settings(deadline=None, max_examples=50)
@given(
    st.floats(-720.0, 720.0),
    st.floats(-180.0, 180.0),
    st.floats(0.0, 360.0),
    st.integers(-3, 3),
)
def test_inside_if_some_turn_of_it_is(angle, low, span, turns):
    """Against trying every turn; whole degrees, away from rounding at the ends."""
    angle, low, span = np.floor(angle) + 0.5, np.floor(low), np.floor(span)
    expected = any(low <= angle + 360.0 * k <= low + span for k in range(-5, 6))
    limits = [(np.radians(low), np.radians(low + span))]
    assert within(np.radians([[angle + 360.0 * turns]]), limits).tolist() == [expected]


def test_ends_count_as_inside_and_a_full_circle_has_none():
    assert within(np.radians([[-30.0], [30.0], [330.0], [390.0]]), [tuple(np.radians([-30.0, 30.0]))]).all()
    assert within(np.linspace(-10.0, 10.0, 101)[:, None], [(-np.pi, np.pi)]).all()


@pytest.mark.parametrize("limits", [[(0.0, 1.0)], [(1.0, 0.0), None], [(np.nan, 1.0), None]])
def test_limits_that_make_no_sense(limits):
    with pytest.raises(ValueError, match="expected"):
        within(np.zeros((3, 2)), limits)


def test_a_design_keeps_to_the_limits():
    """An outer axis of ±60°: less efficient than without limits, and never outside."""
    G = grid((36, 36))
    allowed = within(G.angles, [tuple(np.radians([-60.0, 60.0])), None])
    found = exchange(drift(G), 12, D, np.random.default_rng(2), starts=5, allowed=allowed)
    assert allowed[found.chosen].all()
    assert 0.1 < efficiency(drift(G).take(found.chosen)) < 0.9


def test_only_insensitive_candidates_are_left():
    G = grid((36, 36))
    indices = np.abs(gravity(G)[:, 2])
    indices[5] = np.nan
    allowed = insensitive(drift(G), indices, 0.8, 24)
    assert not allowed[5]
    assert allowed.sum() == np.sum(indices < 0.8)
    found = exchange(drift(G), 24, D, np.random.default_rng(2), starts=5, allowed=allowed)
    assert (indices[found.chosen] < 0.8).all()


def test_too_few_insensitive_candidates():
    G = grid((36, 36))
    order = np.arange(len(G)) / len(G)
    with pytest.raises(
        InputError, match=r"sensitivity limit 0\.007: found 10 of 1296 candidates that remain, exp"
    ):
        insensitive(drift(G), order, 0.007, 12)


def test_insensitive_candidates_that_do_not_identify():
    """Gravity in one plane of the instrument tells nothing of the terms odd in the third axis."""
    G = grid((36, 36), half_step=False)
    indices = np.abs(gravity(G)[:, 2])
    with pytest.raises(
        InputError, match=r"the 72 of 1296 candidates that remain identify 5 of 9 coefficients, not"
    ):
        insensitive(drift(G), indices, 1e-9, 12)
