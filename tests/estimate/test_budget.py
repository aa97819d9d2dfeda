"""Budgets against the GUM's own examples, closed forms and Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.foundation.geometry.earth import gravity, gravity_gradient
from inercal.foundation.inference.least_squares import least_squares
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.result import coverage_factor


def scalar(source, u, dof=np.inf):
    """A source that acts on one output with that standard uncertainty."""
    return TypeA(source, u, "", np.array([[u**2]]), dof)


# Published.


def test_gum_h1_end_gauge():
    """JCGM 100:2008, H.1: u_c = 32 nm, 16.7 effective degrees of freedom, k = 2.92 and U = 93 nm at 99 %."""
    comparator = [
        scalar("repeated observations", 5.8, 24),
        scalar("random", 3.9, 5),
        scalar("systematic", 6.7, 8),
    ]
    covariance, (dof,), *_ = combine(["d"], comparator)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(9.7, abs=0.05)
    assert dof == pytest.approx(25.6, abs=0.2)  # the standard goes on with the rounded 9.7
    covariance, (dof,), budget, _ = combine(
        ["l"],
        [
            scalar("calibration of the standard", 25.0, 18),
            scalar("measured difference", 9.7, 25.6),
            scalar("difference of expansion coefficients", 2.9, 50),
            scalar("difference of temperatures", 16.6, 2),
        ],
    )
    u = float(np.sqrt(covariance[0, 0]))
    assert u**2 == pytest.approx(1002, abs=5)
    assert dof == pytest.approx(16.7, abs=0.1)  # the components are printed with two digits
    k = coverage_factor(np.floor(dof), 0.99)  # truncated to an integer, as G.4.1 has it
    assert k == pytest.approx(2.92, abs=0.005)
    assert k * u == pytest.approx(93, abs=1)
    assert max(budget, key=lambda item: item.share["l"]).source == "calibration of the standard"


def test_gum_g4_product_of_three():
    """JCGM 100:2008, G.4.1: relative u of 0.25, 0.57 and 0.82 % with 9, 4, 14: u = 1.03 % with 19.0."""
    parts = [scalar("X1", 0.25, 9), scalar("X2", 0.57, 4), scalar("X3", 0.82, 14)]
    covariance, dof, *_ = combine(["y"], parts)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(1.03, abs=0.005)
    assert dof[0] == pytest.approx(19.0, abs=0.1)


# Laws.

positive = st.floats(1e-6, 1e6)


@st.composite
def sources(draw):
    p = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    found = []
    for index in range(draw(st.integers(1, 6))):
        u = draw(positive)
        if draw(st.booleans()):
            root = u * rng.standard_normal((p, p))
            found.append(TypeA(f"A{index}", u, "V", root @ root.T, draw(st.floats(1, 1e4) | st.just(np.inf))))
        else:
            found.append(TypeB(f"B{index}", u, "V", rng.standard_normal(p) * rng.integers(0, 2, p)))
    return [f"b{i}" for i in range(p)], found


@settings(deadline=None)
@given(sources())
def test_shares_are_those_of_the_variance(case):
    names, parts = case
    covariance, dof, budget, _ = combine(names, parts)
    assert [(item.source, item.type) for item in budget] == [(s.source, s.source[0]) for s in parts]
    for i, name in enumerate(names):
        shares = [item.share.get(name, 0.0) for item in budget]
        assert sum(shares) == pytest.approx(1.0 if covariance[i, i] > 0 else 0.0)
        assert all(0 <= share <= 1 + 1e-12 for share in shares)
        for share, part in zip(shares, parts, strict=True):
            assert share * covariance[i, i] == pytest.approx(part.covariance[i, i])
    w = np.linalg.eigvalsh(covariance)
    assert w[0] >= -1e-12 * max(w[-1], 1e-300)
    # Welch-Satterthwaite: never less than the least of the type A sources, and inf without any
    finite = [part.dof for part in parts if isinstance(part, TypeA)]
    assert np.all(dof >= min([*finite, np.inf]) * (1 - 1e-9))


@settings(deadline=None)
@given(sources(), st.floats(1e-3, 1e3))
def test_units_change_no_shares_and_no_degrees_of_freedom(case, unit):
    names, parts = case
    scaled = [
        TypeA(s.source, s.u, s.unit, s.covariance * unit**2, s.dof)
        if isinstance(s, TypeA)
        else TypeB(s.source, s.u / unit, s.unit, s.sensitivity * unit**2)
        for s in parts
    ]
    covariance, dof, budget, _ = combine(names, parts)
    other, other_dof, other_budget, _ = combine(names, scaled)
    np.testing.assert_allclose(
        other, covariance * unit**2, rtol=1e-9, atol=1e-9 * np.abs(covariance * unit**2).max()
    )
    np.testing.assert_allclose(other_dof, dof, rtol=1e-9)
    for item, same in zip(budget, other_budget, strict=True):
        assert dict(same.share) == pytest.approx(dict(item.share))


def test_a_type_b_input_moves_all_parameters_together():
    """One unknown value, common to the whole test: correlations of exactly +1 and -1, no degrees of freedom lost."""
    covariance, dof, (item,), _ = combine("abc", [TypeB("gravity", 0.1, "m/s^2", np.array([2.0, -3.0, 0.0]))])
    np.testing.assert_allclose(covariance, [[0.04, -0.06, 0.0], [-0.06, 0.09, 0.0], [0.0, 0.0, 0.0]])
    assert np.all(np.isinf(dof))
    assert item.share == {"a": 1.0, "b": 1.0}
    assert (item.type, item.u, item.unit) == ("B", 0.1, "m/s^2")


@settings(deadline=None)
@given(st.floats(1, 1e3), st.integers(1, 10))
def test_pooling_equal_sources_adds_their_degrees_of_freedom(dof, count):
    _, (total,), *_ = combine(["y"], [scalar(str(i), 1.0, dof) for i in range(count)])
    assert total == pytest.approx(count * dof)


def test_welch_satterthwaite_holds_in_monte_carlo():
    """Two variances estimated from 5 and 9 readings: the t interval at the effective dof holds about 95 %.

    The formula is an approximation; for these sizes its coverage is known to stay within 1 %.
    """
    rng, runs = np.random.default_rng(1), 20_000
    a, b = rng.normal(0, 3.0, (runs, 5)), rng.normal(0, 2.0, (runs, 9))
    ua, ub = a.std(axis=1, ddof=1) / np.sqrt(5), b.std(axis=1, ddof=1) / 3.0
    held = 0
    for mean, u1, u2 in zip(a.mean(axis=1) - b.mean(axis=1), ua, ub, strict=True):
        covariance, (dof,), *_ = combine(["y"], [scalar("a", u1, 4), scalar("b", u2, 8)])
        held += abs(mean) <= coverage_factor(dof, 0.95) * np.sqrt(covariance[0, 0])
    assert held / runs == pytest.approx(0.95, abs=0.01 + 4 * np.sqrt(0.95 * 0.05 / runs))


# One accelerometer in six positions, 60 deg apart, on a dividing head: the input axis turns in a vertical plane.

THETA = np.radians(60.0) * np.arange(6)
LATITUDE, GRAVITY = np.radians(39.1), float(gravity(np.radians(39.1)))
TRUTH = np.array([2e-3, 0.1, 3e-4])  # K0 [V], K1 [V/(m/s^2)], K1 delta_o [V/(m/s^2)]
NAMES = ["K0", "K1", "K1_delta_o"]
U = {
    "noise": 2e-5,
    "gravity": 3e-5,
    "latitude": 1e-3,
    "table angle": 5e-5,
    "fixture": 8e-5,
    "time base": 2e-5,
}


def readings(truth, gravity, angle, eccentricity, time_base):
    """Indications: a fixture off the table's centre adds an angle e sin(theta); a slow clock raises all counts."""
    theta = THETA + angle + eccentricity * np.sin(THETA)
    K0, K1, cross = truth
    return (K0 + K1 * gravity * np.cos(theta) + cross * gravity * np.sin(theta)) * (1.0 + time_base)


DESIGN = np.column_stack([np.ones(6), GRAVITY * np.cos(THETA), GRAVITY * np.sin(THETA)])


def solved(y):
    return least_squares(DESIGN, y, NAMES)


def six_position_budget():
    """Every source through the same least squares: the shift of the solution per unit of each input."""
    K0, K1, cross = TRUTH
    cosine, sine = np.cos(THETA), np.sin(THETA)
    by_gravity = K1 * cosine + cross * sine
    by_angle = GRAVITY * (-K1 * sine + cross * cosine)
    by_input = {
        "gravity": by_gravity,
        "latitude": by_gravity * float(gravity_gradient(LATITUDE)[0]),
        "table angle": by_angle,
        "fixture": by_angle * sine,
        "time base": K0 + GRAVITY * (K1 * cosine + cross * sine),
    }
    fit = solved(readings(TRUTH, GRAVITY, 0.0, 0.0, 0.0))
    noise = TypeA("noise", U["noise"], "V", U["noise"] ** 2 * fit.unit_covariance, 3)
    return combine(
        NAMES, [noise, *(TypeB(name, U[name], "", solved(J).beta) for name, J in by_input.items())]
    )


def test_six_positions_against_the_closed_form():
    _, K1, cross = TRUTH
    by_latitude = float(gravity_gradient(LATITUDE)[0]) / GRAVITY
    shifts = {
        "gravity": np.array([0.0, K1, cross]) / GRAVITY,
        "latitude": np.array([0.0, K1, cross]) * by_latitude,
        "table angle": np.array([0.0, cross, -K1]),
        "fixture": np.array(
            [-K1 * GRAVITY / 2, 0.0, 0.0]
        ),  # cos sin and sin^2: the rest is a second harmonic
        "time base": TRUTH,
    }
    expected = U["noise"] ** 2 * np.diag([1 / 6, 1 / 3 / GRAVITY**2, 1 / 3 / GRAVITY**2])
    parts = {"noise": np.diag(expected).copy()}
    for name, shift in shifts.items():
        expected += U[name] ** 2 * np.outer(shift, shift)
        parts[name] = (U[name] * shift) ** 2
    covariance, dof, budget, _ = six_position_budget()
    np.testing.assert_allclose(covariance, expected, rtol=1e-9, atol=1e-9 * np.diag(expected).min())
    for item in budget:
        share = [item.share.get(name, 0.0) for name in NAMES]
        np.testing.assert_allclose(share, parts[item.source] / np.diag(expected), atol=1e-9)
    np.testing.assert_allclose(dof, 3 * np.diag(expected) ** 2 / parts["noise"] ** 2, rtol=1e-9)
    assert all(
        max(item.share.values()) > 0.005 for item in budget
    )  # every source matters to some coefficient


def test_six_positions_against_monte_carlo():
    """20 000 tests, each with its own gravity, latitude, table, fixture, clock and noise, and no linearisation."""
    rng, runs = np.random.default_rng(2), 20_000
    draw = {name: u * rng.standard_normal(runs) for name, u in U.items() if name != "noise"}
    local = gravity(LATITUDE + draw["latitude"]) + draw["gravity"]
    y = np.array(
        [
            readings(TRUTH, g, *rest)
            for g, *rest in zip(local, draw["table angle"], draw["fixture"], draw["time base"], strict=True)
        ]
    )
    y += U["noise"] * rng.standard_normal(y.shape)
    solution = np.column_stack([solved(e).beta for e in np.eye(6)])  # linear in the readings
    errors = y @ solution.T - TRUTH
    covariance, *_ = six_position_budget()
    u = np.sqrt(np.diag(covariance))
    # each mean, variance and correlation within 4.5 standard errors (12 figures: risk 1e-4), and all together
    np.testing.assert_allclose(errors.mean(axis=0) / u, 0.0, atol=4.5 / np.sqrt(runs))
    got = np.cov(errors.T) / np.outer(u, u)
    np.testing.assert_allclose(got, covariance / np.outer(u, u), atol=4.5 * np.sqrt(2 / runs))
    nees = np.sum(errors @ np.linalg.inv(covariance) * errors)
    low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], 3 * runs)
    assert low < nees < high


def test_independent_errors_of_each_position_are_a_source_each():
    """A table angle redrawn at each position: six inputs, whose variances add as those of the noise do."""
    u = 5e-5
    by_angle = GRAVITY * (-TRUTH[1] * np.sin(THETA) + TRUTH[2] * np.cos(THETA))
    parts = [
        TypeB(f"position {k}", u, "rad", solved(e * J).beta)
        for k, (e, J) in enumerate(zip(np.eye(6), by_angle, strict=True))
    ]
    covariance, *_ = combine(NAMES, parts)
    gain = np.linalg.pinv(DESIGN)
    np.testing.assert_allclose(
        covariance,
        gain @ np.diag((u * by_angle) ** 2) @ gain.T,
        rtol=1e-9,
        atol=1e-9 * np.diag(covariance).min(),
    )


@pytest.mark.parametrize("size", [1e-160, 1.0, 1e160])
def test_effective_degrees_of_freedom_do_not_depend_on_the_unit(size):
    """Welch-Satterthwaite is homogeneous of degree 0 in the variances, even where their squares leave the range."""
    sources = [scalar("a", 3.0 * np.sqrt(size), 10.0), scalar("b", 1.0 * np.sqrt(size), 4.0)]
    _, (dof,), *_ = combine(["y"], sources)
    assert dof == pytest.approx(10.0**2 / (9.0**2 / 10.0 + 1.0 / 4.0), rel=1e-12)
