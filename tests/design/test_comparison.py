"""Figures of plans: ranks, condition, D-efficiency and prediction of the drift model of a two-axis table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from positions import RATES, TERMS, drift, from_monomials, gravity, with_rates

from inercal.foundation.designs.criteria import (
    NAMES,
    Candidates,
    D,
    a_criterion,
    basis,
    i_criterion,
    judge,
    plain,
)
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.plans import grid, named

LATITUDE = np.radians(45.0)
SPHERE = a_criterion(np.eye(9))


def figures(plan, **kwargs):
    candidates = drift(plan, **kwargs)
    return judge(plan.name, candidates, candidates.rows[:, 0], SPHERE)


def judged_with_rates(plan, latitude=LATITUDE):
    weights = np.zeros((9, 12))
    weights[:, :9] = from_monomials()
    return judge(plan.name, with_rates(plan, latitude), basis(gravity(plan)), a_criterion(weights))


def test_ten_quadratic_terms_have_rank_nine():
    """a.a = 1 on any table: the constant and the three squares are one too many."""
    plan = grid((12, 12))
    a = gravity(plan)
    ten = plain((*TERMS, "ZZ"), np.hstack([drift(plan).rows[:, 0], a[:, 2:] ** 2]))
    told = judge("ten", ten, basis(a), i_criterion(ten.rows))
    assert told.rank == 9
    assert told.u[1:4] == pytest.approx(judge("", drift(plan), basis(a), SPHERE).u[1:4])


@pytest.mark.parametrize(("degrees", "rank"), [(0.0, 12), (45.0, 12), (-60.0, 12), (89.0, 12), (90.0, 9)])
def test_full_rank_with_earth_rate(degrees, rank):
    """Thirteen terms have rank 12, and 9 at the pole, where earth rate is along gravity."""
    plan = grid((12, 12))
    twelve = with_rates(plan, np.radians(degrees))
    assert judge("12", twelve, basis(gravity(plan)), i_criterion(twelve.rows)).rank == rank
    rows = np.concatenate([twelve.rows, gravity(plan)[:, None, 2:] ** 2], axis=-1)
    thirteen = plain((*twelve.names, "ZZ"), rows)
    assert judge("13", thirteen, basis(gravity(plan)), i_criterion(rows)).rank == rank


def test_classic_24_positions():
    """Nine drift terms: full rank and D-efficiency 0.944. With earth rate: 11 of 12, and a null vector of linear
    terms alone."""
    plan = named("24-position")
    nine, twelve = figures(plan), judged_with_rates(plan)
    assert (nine.rank, nine.unidentified, nine.positions) == (9, (), 24)
    assert nine.d_efficiency == pytest.approx(0.944, abs=5e-4)
    assert nine.condition == pytest.approx(np.sqrt(2.5), rel=1e-12)
    assert twelve.rank == 11
    (words,) = twelve.unidentified
    assert {word for word in words.split() if word[0].isalpha()} == {"X", "Y", "Z", "k_x", "k_y"}
    names = (*TERMS, *RATES)
    lost = {name for name, u in zip(names, twelve.u, strict=True) if np.isinf(u)}
    assert lost == {"X", "Y", "Z", "k_x", "k_y"}
    assert np.isinf(twelve.rms_prediction)
    # the drift functions are seen as before
    assert (twelve.condition, twelve.d_efficiency) == (nine.condition, nine.d_efficiency)


def test_sixteen_cube_positions():
    """Six directions of gravity: no product is seen."""
    plan = named("16-cube")
    nine, twelve = figures(plan), judged_with_rates(plan)
    assert (nine.rank, twelve.rank) == (6, 9)
    assert np.isinf(nine.u).tolist() == [name in ("xy", "xz", "yz") for name in NAMES]
    assert np.isinf(twelve.u).tolist() == [name in ("XY", "XZ", "YZ") for name in (*TERMS, *RATES)]
    assert nine.d_efficiency == 0.0
    assert np.isinf(nine.condition)
    assert np.isinf(nine.rms_prediction)


def icosahedron():
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    corners = [(0.0, s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    a = np.array([np.roll(corner, k) for corner in corners for k in range(3)])
    return a / np.linalg.norm(a, axis=1, keepdims=True)


def test_a_perfect_design_meets_the_bound():
    """The corners of an icosahedron average quartic functions exactly: X^T X = N I, rms sigma sqrt(9/N)."""
    X, sigma = basis(icosahedron()), 0.04
    told = judge("icosahedron", Candidates(NAMES, X[:, None], np.full((12, 1), sigma**2)), X, SPHERE)
    assert told.d_efficiency == pytest.approx(1.0, abs=1e-12)
    assert told.condition == pytest.approx(1.0, abs=1e-12)
    assert told.rms_prediction == pytest.approx(sigma * np.sqrt(9.0 / 12.0), rel=1e-12)
    np.testing.assert_allclose(told.u, sigma / np.sqrt(12.0), rtol=1e-12)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(9, 40))
def test_no_design_predicts_better_than_the_bound(seed, n):
    """rms >= sigma sqrt(9/N), since the squares of the basis sum to nine in every direction."""
    a = np.random.default_rng(seed).standard_normal((n, 3))
    X = basis(a / np.linalg.norm(a, axis=1, keepdims=True))
    told = judge("random", plain(NAMES, X), X, SPHERE)
    assert told.rms_prediction >= np.sqrt(9.0 / n) * (1.0 - 1e-12)
    assert told.d_efficiency <= 1.0 + 1e-12
    assert told.condition >= 1.0


@settings(deadline=None, max_examples=20)
@given(*[st.floats(-np.pi, np.pi) for _ in range(4)])
def test_turning_instrument_or_base_changes_nothing(azimuth, x, y, z):
    """The basis spans a space that rotations leave as it is; azimuth leaves gravity as it is."""
    turned = figures(
        named("24-position"),
        mounting=elementary("z", z) @ elementary("y", y) @ elementary("x", x),
        base=(azimuth, 0.0, 0.0),
    )
    straight = figures(named("24-position"))
    assert turned.d_efficiency == pytest.approx(straight.d_efficiency, rel=1e-10)
    assert turned.condition == pytest.approx(straight.condition, rel=1e-10)
    assert turned.rms_prediction == pytest.approx(straight.rms_prediction, rel=1e-10)


def test_constant_errors_are_in_the_figures():
    """An offset common to all readings goes into the constant term and the prediction, squared and added."""
    plain_plan = drift(named("24-position"))
    common = Candidates(NAMES, plain_plan.rows, plain_plan.variance, np.full((24, 1, 1), 2.0))
    without, told = (judge("", each, each.rows[:, 0], SPHERE) for each in (plain_plan, common))
    assert told.u[0] ** 2 == pytest.approx(without.u[0] ** 2 + 4.0, rel=1e-9)
    np.testing.assert_allclose(told.u[1:], without.u[1:], rtol=1e-9)
    assert told.rms_prediction**2 == pytest.approx(without.rms_prediction**2 + 4.0, rel=1e-9)


def test_prediction_may_be_known_where_a_coefficient_is_not():
    """x and y always equal: their sum is known, and so is a prediction that needs no more."""
    rows = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [1.0, 2.0, 2.0]])
    plan = plain(("one", "x", "y"), rows)
    told = judge("", plan, rows[:, :1], i_criterion(rows))
    assert np.isinf(told.u).tolist() == [False, True, True]
    # a fit of rank 2 to three readings predicts these with a mean variance of 2/3
    assert told.rms_prediction == pytest.approx(np.sqrt(2.0 / 3.0))
    assert told.rank == 2


def test_prediction_needs_weights():
    plan = drift(named("24-position"))
    with pytest.raises(ValueError, match="prediction"):
        judge("", plan, plan.rows[:, 0], D)
