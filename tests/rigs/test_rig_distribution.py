"""Distributions of errors: quantiles against SciPy, nodes against closed forms, draws against both."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from inercal.foundation.rigs.patterns import density, normal, triangular, two_point, uniform
from rows import for_each

H = np.radians(2.0 / 60.0)


def ramp(x):
    """Density x + 1 on ±1, not normalised: mean 1/3, variance 2/9."""
    return x + 1.0


KINDS = [
    (uniform(H), stats.uniform(-H, 2.0 * H)),
    (normal(H), stats.norm(0.0, H)),
    (triangular(H), stats.triang(0.5, -H, 2.0 * H)),
    (density(ramp, -1.0, 1.0), stats.triang(1.0, -1.0, 2.0)),
    (
        density(lambda x: np.exp(-0.5 * np.square(x)), -2.0, 3.0),
        stats.truncnorm(-2.0, 3.0),
    ),
    (density(lambda x: 1.0, -0.3, 0.1), stats.uniform(-0.3, 0.4)),
]
IDS = ["uniform", "normal", "triangular", "ramp", "truncated normal", "off-centre uniform"]


@pytest.mark.parametrize(("law", "scipy_law"), KINDS, ids=IDS)
def test_quantiles_and_moments(law, scipy_law):
    p = np.linspace(0.0005, 0.9995, 2000)
    width = scipy_law.std()
    # a density is integrated on 4096 steps
    assert_allclose(
        law.quantile(p), scipy_law.ppf(p), atol=(1e-5 if law.kind == "density" else 1e-13) * width
    )
    assert law.mean == pytest.approx(scipy_law.mean(), abs=1e-13 * width)
    assert law.std == pytest.approx(width, rel=1e-12)
    assert law.weights.sum() == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize(("law", "scipy_law"), KINDS, ids=IDS)
def test_draws_follow_the_law(law, scipy_law):
    """Kolmogorov-Smirnov at 1e-4, once for each law."""
    drawn = law.sample(np.random.default_rng(5), (100, 50))
    assert drawn.shape == (100, 50)
    assert stats.kstest(drawn.ravel(), scipy_law.cdf).pvalue > 1e-4


def closed_form(kind, size):
    """Expectations of cos d and cos 2d."""
    t = np.array([1.0, 2.0]) * size
    return {
        "uniform": np.sinc(t / np.pi),
        "normal": np.exp(-0.5 * t**2),
        "triangular": np.sinc(0.5 * t / np.pi) ** 2,
        "two_point": np.cos(t),
    }[kind]


@pytest.mark.parametrize("make", [uniform, normal, triangular, two_point])
@pytest.mark.parametrize("degrees", [1.0 / 3600.0, 1.0, 20.0, 50.0, 60.0])
def test_nodes_integrate_cosines_and_sines(make, degrees):
    """Characteristic functions; the sines of a symmetric law vanish."""
    law = make(np.radians(degrees))
    t = np.outer([1.0, 2.0], law.nodes)
    assert_allclose(np.cos(t) @ law.weights, closed_form(law.kind, law.size), atol=1e-14)
    assert_allclose(np.sin(t) @ law.weights, 0.0, atol=1e-15)


def test_nodes_serve_half_widths_up_to_half_a_turn():
    law = uniform(np.pi)
    assert_allclose(np.cos(np.outer([1.0, 2.0], law.nodes)) @ law.weights, 0.0, atol=1e-14)


def test_nodes_integrate_an_asymmetric_density():
    """Of x + 1 on ±1: E cos d = sin 1, E sin d = sin 1 - cos 1."""
    law = density(ramp, -1.0, 1.0)
    assert law.weights @ np.cos(law.nodes) == pytest.approx(np.sin(1.0), rel=1e-14)
    assert law.weights @ np.sin(law.nodes) == pytest.approx(np.sin(1.0) - np.cos(1.0), rel=1e-14)
    assert (law.mean, law.size) == pytest.approx((1.0 / 3.0, np.sqrt(2.0 / 9.0)), rel=1e-14)


def test_two_points():
    law = two_point(0.2)
    drawn = law.sample(np.random.default_rng(6), 10_000)
    assert set(np.unique(drawn)) == {-0.2, 0.2}
    assert abs(np.mean(drawn > 0.0) - 0.5) < 5.0 * 0.5 / 100.0
    assert (law.mean, law.std) == (0.0, pytest.approx(0.2))


def test_extreme_probabilities_stay_finite():
    """A Sobol sequence may hit zero."""
    for law in (uniform(1.0), normal(1.0), triangular(1.0), two_point(1.0), density(ramp, -1.0, 1.0)):
        ends = law.quantile(np.array([0.0, 1.0 - 2.0**-53]))
        assert np.isfinite(ends).all()
        assert ends[0] < -0.9 < 0.9 < ends[1]


@pytest.mark.parametrize(("law", "_"), KINDS, ids=IDS)
def test_scaling(law, _):
    p = np.linspace(0.01, 0.99, 9)
    wide = law.scaled(3.0)
    assert_allclose(wide.quantile(p), 3.0 * law.quantile(p), rtol=1e-15)
    assert (wide.mean, wide.std, wide.size) == pytest.approx((3 * law.mean, 3 * law.std, 3 * law.size))
    assert_array_equal(wide.weights, law.weights)


@for_each("make", [uniform, normal, triangular, two_point])
@for_each("size", [0.0, -1.0, np.nan, np.inf])
def test_a_law_without_spread_is_refused(make, size):
    with pytest.raises(ValueError, match="expected a number above zero"):
        make(size)


def spike(x):
    """Between two nodes, seen by the finer grid alone."""
    return np.exp(-0.5 * np.square((x - 0.01) / 0.005)) + 1e-9


@for_each(
    ("pdf", "low", "high", "message"),
    [
        (ramp, -2.0, 1.0, "negative, not finite or zero"),
        (lambda x: np.where(np.abs(x) < 1e-3, -1.0, 1.0), -1.0, 1.0, "negative, not finite or zero"),
        (lambda x: 0.0 * x, -1.0, 1.0, "negative, not finite or zero"),
        (lambda x: np.nan * x, -1.0, 1.0, "negative, not finite or zero"),
        (lambda x: np.where(x == 0.0, np.inf, 1.0), -1.0, 1.0, "negative, not finite or zero"),
        (spike, -1.0, 1.0, "too rough or too narrow"),
        (ramp, 1.0, -1.0, "two finite ends in order"),
        (ramp, 0.0, np.inf, "two finite ends in order"),
    ],
)
def test_a_bad_density_is_refused(pdf, low, high, message):
    with pytest.raises(ValueError, match=message):
        density(pdf, low, high)
