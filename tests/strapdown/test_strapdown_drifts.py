"""Two effects outside the model that look alike: which of them is shown, by least squares with all columns."""

import numpy as np
import pytest

from inercal.strapdown.left_out import Candidate, Posed, told_apart

ROWS, COEFFICIENTS = 400, 4


def problem(alike, first, second, seed=0):
    """Observations of unit noise with four coefficients and two effects of three parameters each, ``first`` and
    ``second`` in size; a part ``alike`` of the columns of the second is that of the first."""
    rng = np.random.default_rng([20261126, seed])
    known, one, other = (rng.standard_normal((ROWS, k)) for k in (COEFFICIENTS, 3, 3))
    other = alike * one + np.sqrt(1.0 - alike**2) * other
    size = np.array([1.0, -1.0, 1.0]) / np.sqrt(3.0 * ROWS)
    y = rng.standard_normal(ROWS) + first * one @ size + second * other @ size
    J = np.hstack([known, one, other])
    candidates = [Candidate(name, "bias_drift", "", "", np.empty(0), np.ones(3)) for name in ("one", "other")]
    places = [COEFFICIENTS + np.arange(3), COEFFICIENTS + 3 + np.arange(3)]
    return Posed(candidates, places, J.T @ J, J.T @ y, np.ones(COEFFICIENTS)), J, y


def names(alike, first, second, seed=0):
    return [each.candidate.name for each in told_apart(problem(alike, first, second, seed)[0], [0, 1])]


def left(J, y):
    """The sum of squares that a fit of these columns leaves."""
    return np.sum((y - J @ np.linalg.lstsq(J, y)[0]) ** 2)


@pytest.mark.parametrize("alike", [0.0, 0.5, 0.95])
def test_falls_and_shifts_are_those_of_fits_with_and_without_the_columns(alike):
    made, J, y = problem(alike, 10.0, 5.0)
    p, q, r = COEFFICIENTS, COEFFICIENTS + 3, COEFFICIENTS + 6
    alone, beside = made.tested(1), made.tested(1, beside=0)
    assert alone.drop == pytest.approx(left(J[:, :p], y) - left(J[:, [*range(p), *range(q, r)]], y))
    assert beside.drop == pytest.approx(left(J[:, :q], y) - left(J, y))
    shift = (np.linalg.lstsq(J, y)[0] - np.append(np.linalg.lstsq(J[:, :q], y)[0], np.zeros(3)))[:p]
    np.testing.assert_allclose(beside.shift, shift, atol=1e-12)


def test_the_weaker_one_that_is_the_image_of_the_stronger_is_not_shown():
    """Of 0.6 of its columns a strong effect makes 36 % of its fall there: beyond chance, and nothing of its own."""
    for seed in range(20):
        made, *_ = problem(0.6, 12.0, 0.0, seed)
        assert made.tested(1).significant
        assert names(0.6, 12.0, 0.0, seed) == ["one"]


def test_both_are_shown_where_both_are_there():
    for seed in range(20):
        assert set(names(0.6, 12.0, 12.0, seed)) == {"one", "other"}


def test_both_are_shown_where_each_hides_the_other():
    """Alone each leaves 0 and 1.6 standard deviations, by which 3 % of them are significant, and together 8."""
    alone = 0
    for seed in range(20):
        made, *_ = problem(0.98, 40.0, -40.0 / 0.98, seed)
        alone += made.tested(0).significant + made.tested(1).significant
        assert {each.candidate.name for each in told_apart(made, [0, 1])} == {"one", "other"}
    assert alone <= 5


def test_which_of_two_it_is_nobody_can_tell_where_they_explain_as_much():
    for seed in range(20):
        assert set(names(0.995, 8.0, 0.0, seed)) == {"one", "other"}


def test_chance_is_not_shown():
    assert sum(len(names(0.6, 0.0, 0.0, seed)) > 0 for seed in range(200)) <= 8  # 1 %: 9 and more at 5e-5
