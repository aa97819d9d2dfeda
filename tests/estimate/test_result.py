"""Results: coverage factors of the GUM, intervals that hold, and values rounded to their uncertainty."""

from dataclasses import FrozenInstanceError
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.foundation.errors import CalibrationError
from inercal.foundation.findings import Status
from inercal.foundation.results.result import Estimate, Parameter, coverage_factor
from inercal.foundation.results.shown import rounded
from rows import for_each


def estimate(values=(1.0, 2.0), covariance=((0.04, 0.01), (0.01, 0.09)), dof=(5.0, np.inf), **more):
    p = len(values)
    settings = {"status": Status.OK, "message": "fine", "units": ("m/s^2",) * p} | more
    return Estimate(
        command="calibrate imu",
        names=("K0_x", "K1_x", "M_xy", "M_xz")[:p],
        values=np.array(values, dtype=float),
        covariance=np.array(covariance, dtype=float),
        dof=np.array(dof, dtype=float),
        **settings,
    )


# Coverage.


@for_each(
    ("dof", "k95", "k9545", "k99"),
    [
        (1, 12.71, 13.97, 63.66), (2, 4.30, 4.53, 9.92), (3, 3.18, 3.31, 5.84), (4, 2.78, 2.87, 4.60),
        (5, 2.57, 2.65, 4.03), (6, 2.45, 2.52, 3.71), (7, 2.36, 2.43, 3.50), (8, 2.31, 2.37, 3.36),
        (9, 2.26, 2.32, 3.25), (10, 2.23, 2.28, 3.17), (20, 2.09, 2.13, 2.85), (50, 2.01, 2.05, 2.68),
        (np.inf, 1.960, 2.000, 2.576),
    ],
)  # fmt: skip
def test_gum_table_g2(dof, k95, k9545, k99):
    assert coverage_factor(dof) == pytest.approx(k9545, abs=0.005001)
    assert coverage_factor(dof, 0.95) == pytest.approx(k95, abs=0.005001)
    assert coverage_factor(dof, 0.99) == pytest.approx(k99, abs=0.005001)


@settings(deadline=None)
@given(st.floats(0.5, 1e300), st.floats(0.01, 0.9999))
def test_factor_leaves_half_the_rest_on_each_side(dof, level):
    k = coverage_factor(dof, level)
    assert 2 * stats.t.sf(k, dof) == pytest.approx(1 - level, rel=1e-6)
    assert k >= coverage_factor(np.inf, level) * (1 - 1e-9)  # never narrower than the normal


def test_intervals_hold_what_they_claim():
    """Mean of five readings, 20 000 times; binomial limits with a risk of 1e-4."""
    rng, runs = np.random.default_rng(1), 20_000
    x = rng.normal(10.0, 3.0, (runs, 5))
    for level in (0.5, 0.9, 0.99):
        intervals = (
            Parameter("x", mean, s / np.sqrt(5), 4.0, "m").interval(level)
            for mean, s in zip(x.mean(axis=1), x.std(axis=1, ddof=1), strict=True)
        )
        held = sum(low <= 10.0 <= high for low, high in intervals)
        least, most = stats.binom.ppf([5e-5, 1 - 5e-5], runs, level)
        assert least <= held <= most


def test_expanded_uncertainty_and_interval_agree():
    p = estimate()["K0_x"]
    assert p.u == pytest.approx(0.2)
    assert pytest.approx(2.65 * 0.2, abs=0.001) == p.U
    low, high = p.interval(0.9545)
    assert (low, high) == (pytest.approx(1.0 - p.U), pytest.approx(1.0 + p.U))


# Rounding.


@for_each(
    ("value", "u", "texts"),
    [
        (10.05762, 0.027, ("10.058", "0.027")),  # GUM 7.2.6
        (100.02147, 0.00035, ("100.02147", "0.00035")),  # GUM 7.2.2
        (50.000838e-3, 32e-9, ("0.050000838", "3.2e-08")),  # GUM H.1.7, in metres
        (9.81744, 0.0996, ("9.82", "0.10")),
        (1234567.0, 1500.0, ("1234600", "1500")),
        (-0.5, 12.3, ("0", "12")),
        (3.0e-9, 1.2e-6, ("0e+00", "1.2e-06")),
        (9.9996e-4, 1.2e-6, ("1.0000e-03", "1.2e-06")),
        (2.9e8, 1.5e1, ("2.90000000e+08", "1.5e+01")),
    ],
)
def test_known_roundings(value, u, texts):
    assert tuple(text.lstrip("-") if text == "-0" else text for text in rounded(value, u)) == texts


@settings(deadline=None)
@given(
    u=st.floats(1e-30, 1e30),
    multiple=st.floats(-1e12, 1e12) | st.floats(-10, 10),
    k=st.floats(1.9, 15.0),
)
@example(u=1e-30, multiple=10.0, k=2.0)
@example(u=0.0996, multiple=1.0, k=2.0)
@example(u=9.96e-6, multiple=1e5, k=2.0)
@example(u=9.95e22, multiple=1.0, k=2.0)
@example(u=2.2e-6, multiple=0.01, k=2.0)
@example(u=1.2e-6, multiple=833.3, k=2.0)
def test_rounded_to_two_digits_of_u(u, multiple, k):
    """GUM 7.2.6: u to two digits, value to the same decimal place, neither off by more than half a unit of it."""
    value = u * multiple
    texts = rounded(value, u, k * u)
    number, uncertainty, expanded = map(Decimal, texts)
    place = Decimal(1).scaleb(Decimal(f"{u:.1e}").adjusted() - 1)  # value of the second digit of u
    slack = Decimal("0.5000001") * place
    assert abs(uncertainty - Decimal(u)) <= slack
    assert abs(number - Decimal(value)) <= slack + abs(Decimal(value)) * Decimal("1e-15")
    assert 10 <= uncertainty / place <= 99
    assert number % place == 0
    if number:
        assert number.as_tuple().exponent == uncertainty.as_tuple().exponent
    assert expanded == pytest.approx(Decimal(k * u), rel=Decimal("0.06"))


@pytest.mark.parametrize(
    ("value", "u"), [(1.0, 0.0), (1.0, np.nan), (1.0, np.inf), (np.nan, 1.0), (-np.inf, 1.0)]
)
def test_what_has_no_uncertainty_is_shown_all_the_same(value, u):
    text, spread = rounded(value, u)
    assert text == "–" if np.isnan(value) else float(text) == value
    assert (spread == "–") == np.isnan(u)


# The estimate.


def test_table_lines_up():
    lines = estimate((9.81744, -2e-7), np.diag([4e-6, 1e-18]), units=("m/s^2", "rad")).table().splitlines()
    assert lines[0].split() == ["value", "u", "U", "k", "unit"]
    assert lines[1].split() == ["K0_x", "9.8174", "0.0020", "0.0053", "2.65", "m/s^2"]
    assert lines[2].split() == ["K1_x", "-2.000e-07", "1.0e-09", "2.0e-09", "2.00", "rad"]
    ends = {
        line.index(cell) + len(cell)
        for line, cell in zip(lines, ("value", "9.8174", "-2.000e-07"), strict=True)
    }
    assert len(ends) == 1
    assert not any(line != line.rstrip() for line in lines)


def test_table_of_nothing():
    assert estimate((), np.zeros((0, 0)), ()).table().split() == ["value", "u", "U", "k", "unit"]


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.lists(st.integers(-8, 8), min_size=3, max_size=3))
def test_correlation_knows_no_units(seed, powers):
    root = np.random.default_rng(seed).standard_normal((3, 3))
    C, unit = root @ root.T, 10.0 ** np.array(powers)
    plain = estimate((0, 0, 0), C, (9.0,) * 3).correlation
    np.testing.assert_allclose(np.diag(plain), 1.0)
    np.testing.assert_allclose(plain, plain.T)
    assert np.abs(plain).max() <= 1 + 1e-9
    scaled = estimate((0, 0, 0), C * np.outer(unit, unit), (9.0,) * 3).correlation
    np.testing.assert_allclose(scaled, plain, atol=1e-9)


def test_no_correlation_with_what_is_certain():
    np.testing.assert_array_equal(estimate(covariance=((0.0, 0.0), (0.0, 4.0))).correlation, [[0, 0], [0, 1]])


@for_each("status", Status)
def test_raise_for_status(status):
    result = estimate(status=status, message="poses are missing")
    if status is Status.OK:
        assert result.raise_for_status() is result
        return
    with pytest.raises(CalibrationError, match=f"{status.value}: poses are missing") as caught:
        result.raise_for_status()
    assert caught.value.estimate is result
    if status is Status.SUSPECT:
        assert result.raise_for_status(suspect=True) is result
    else:
        with pytest.raises(CalibrationError):
            result.raise_for_status(suspect=True)


def test_every_status_says_what_it_means():
    assert {status.value for status in Status} == {
        "ok", "suspect", "ill_conditioned", "not_converged", "inconsistent", "unobservable", "too_few_intervals",
    }  # fmt: skip
    for status in Status:
        assert len(status.meaning) > 20


def test_parameters_keep_their_order_and_cannot_be_set():
    result = estimate()
    assert list(result.parameters) == ["K0_x", "K1_x"]
    assert (result["K1_x"].value, result["K1_x"].dof) == (2.0, np.inf)
    with pytest.raises(KeyError):
        result["K9"]
    with pytest.raises(FrozenInstanceError):
        result.values = np.zeros(2)


def test_citations_one_a_line():
    assert estimate(references=("first", "second")).citations() == "first\nsecond"


def test_other_units_are_other_words_for_the_same():
    """Intervals and what repeat runs share go with the values; correlations, k and dof stay."""
    found = estimate(common=np.array([[0.01, 0.02], [0.02, 0.04]]))
    shown = found.in_units([("mg", 0.00980665), ("km/s^2", 1000.0)])
    size = np.array([0.00980665, 1000.0])
    assert shown.units == ("mg", "km/s^2")
    for before, after, of in zip(found.parameters.values(), shown.parameters.values(), size, strict=True):
        assert np.multiply(after.interval(), of) == pytest.approx(before.interval(), rel=1e-12)
        assert (after.k, after.dof) == (before.k, before.dof)
    np.testing.assert_allclose(shown.correlation, found.correlation, rtol=1e-12)
    np.testing.assert_allclose(shown.common * np.outer(size, size), found.common, rtol=1e-12)
    assert estimate().in_units([("g", 9.80665), ("g", 9.80665)]).common is None
