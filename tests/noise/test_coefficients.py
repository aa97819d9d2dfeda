"""Noise coefficients: exact where the deviation is, in any unit, and silent about what is not there."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError
from inercal.foundation.instruments.noise import SYMBOLS, NoiseModel
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.deviation import AllanDeviation, allan_deviation


def exact(model, n=100_000, interval=0.01):
    """The expected Allan deviation, as if it were that of a recording."""
    lengths = np.unique(np.rint(10 ** np.arange(0, np.log10(n / 3), 1 / 8)))
    tau = lengths * interval
    deviation = np.sqrt(model.variance(tau))[:, None]
    ones, counts = np.ones((len(tau), 1)), (n + 1 - 2 * lengths)[:, None].astype(np.int64)
    gain = np.ones((len(tau), 1, len(SYMBOLS)))
    return AllanDeviation(
        tau, deviation, deviation, deviation, ones, 0 * counts, counts, gain, 0.683, n, interval
    )


def simulated(model, seed, n=20_000, interval=0.01):
    return allan_deviation(model.simulate(n, interval, np.random.default_rng(seed)), interval)


# What is there is found.


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=0.3),
        NoiseModel(B=0.02),
        NoiseModel(K=0.1),
        NoiseModel(Q=5.0),
        NoiseModel(N=0.3, R=0.05),
        NoiseModel(N=0.1, B=0.2, K=0.3),
        NoiseModel(N=0.1, Q=0.05, R=0.02),
        NoiseModel(N=0.3, B=0.3, K=0.5, Q=0.02),
    ],
)
def test_an_exact_deviation_gives_the_exact_coefficients(model):
    found = noise_coefficients(exact(model))
    assert found.names == tuple(name for name in SYMBOLS if getattr(model, name))
    truth = [getattr(model, name) for name in found.names]
    np.testing.assert_allclose(found.values, truth, rtol=1e-6)
    assert found.chi2 == pytest.approx(
        0.0, abs=0.5
    )  # the mean of a cube root is not the cube root of the mean
    assert not found.findings
    np.testing.assert_allclose(found.variance(np.array([0.5, 50.0])), model.variance([0.5, 50.0]), rtol=1e-6)


def test_the_floor_is_0_664_b():
    """A curve that is flat at 1: B = 1/0.664."""
    found = noise_coefficients(exact(NoiseModel(B=1 / np.sqrt(2 * np.log(2) / np.pi))))
    assert found.names == ("B",)
    assert found.values[0] == pytest.approx(1 / 0.664, rel=1e-3)


def test_n_is_read_at_one_second_and_k_at_three():
    """On the slope -1/2 at 1 s, on +1/2 at 3 s."""
    white, walk = exact(NoiseModel(N=0.7)), exact(NoiseModel(K=0.4))
    assert np.interp(1.0, white.tau, white.deviation[:, 0]) == pytest.approx(0.7, rel=1e-9)
    assert noise_coefficients(white).values[0] == pytest.approx(0.7, rel=1e-9)
    assert NoiseModel(K=0.4).variance(3.0) == pytest.approx(0.16)
    assert noise_coefficients(walk).values[0] == pytest.approx(0.4, rel=1e-9)


@settings(deadline=None, max_examples=15)
@given(st.floats(1e-8, 1e8), st.floats(1e-4, 1e4), st.integers(0, 2**32 - 1))
def test_units_of_the_samples_and_of_time(unit, second, seed):
    """N goes as unit sqrt(s), B as unit, K as unit/sqrt(s), R as unit/s, Q as unit s."""
    x = NoiseModel(N=1.0, B=0.2, K=0.02, Q=1.0).simulate(2000, 1.0, np.random.default_rng(seed))
    plain = noise_coefficients(allan_deviation(x, 1.0))
    other = noise_coefficients(allan_deviation(unit * x, second))
    factor = dict(zip(SYMBOLS, unit * second ** np.array([0.5, 0.0, -0.5, -1.0, 1.0]), strict=True))
    assert other.names == plain.names
    scale = [factor[name] for name in plain.names]
    np.testing.assert_allclose(other.values, plain.values * scale, rtol=1e-6)
    np.testing.assert_allclose(other.u, plain.u * scale, rtol=1e-5)
    np.testing.assert_allclose(other.dof, plain.dof, rtol=1e-5)
    for name, limit in plain.bounds.items():
        assert other.bounds[name] == pytest.approx(limit * factor[name], rel=1e-5)


def test_u_of_white_noise():
    """N of white noise alone: u/N = 1/sqrt(2 dof) with at most one degree of freedom a sample, and not many less."""
    ratio = []
    for seed in range(20):
        found = noise_coefficients(simulated(NoiseModel(N=0.01), seed))
        assert found.names[0] == "N"
        ratio.append(found.u[0] / found.values[0] * np.sqrt(2 * 20_000))
    assert min(ratio) >= 1.0
    assert np.median(ratio) < 2.0


def test_covariance_of_coefficients_is_that_of_their_scatter():
    """Of N, B and K in 150 recordings: 3 x 3, within 4.5 standard errors of the counted correlations and spreads."""
    model, found = NoiseModel(N=1e-4, B=2e-4, K=3e-4), []
    for seed in range(150):
        one = noise_coefficients(simulated(model, seed), terms=("N", "B", "K"))
        if one.names == ("N", "B", "K"):
            found.append(one)
    assert len(found) > 140
    values = np.array([one.values for one in found])
    stated = np.mean([one.covariance for one in found], axis=0)
    size = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    counted = np.cov(values.T)
    np.testing.assert_allclose(counted / size, stated / size, atol=4.5 * np.sqrt(3 / len(found)))
    assert stated[0, 1] < 0  # what the floor takes, white noise loses


# What is not there is not reported, but bounded.


def test_white_noise_shows_nothing_else():
    """In 60 recordings another term at most 6 times (of 2.5 standard deviations, four terms: 1 to 2 expected)."""
    more = [
        noise_coefficients(simulated(NoiseModel(N=0.01), seed)).names != ("N",) for seed in range(100, 160)
    ]
    assert sum(more) <= 6


@pytest.mark.parametrize(("name", "size"), [("B", 1.5e-5), ("K", 2e-6), ("R", 3e-8), ("Q", 2e-7)])
def test_limits_of_what_is_not_seen_hold(name, size):
    """A term too weak to be seen: its one-sided 95 % limit holds it in 40 recordings, but for at most 6."""
    model = NoiseModel(**{"N": 1e-4, name: size})
    limits = []
    for seed in range(200, 240):
        found = noise_coefficients(simulated(model, seed))
        limits.append(found.bounds.get(name, np.inf))
    assert sum(limit < size for limit in limits) <= 6
    assert np.median(limits) < 200 * size


# Noise that is none of the five.


def humped(seed):
    """White noise and a dither of 5 Hz whose phase wanders."""
    rng = np.random.default_rng(seed)
    x = NoiseModel(N=0.01).simulate(40_000, 0.01, rng)[:, 0]
    phase = np.cumsum(2 * np.pi * 5 * 0.01 + 0.3 * rng.standard_normal(40_000))
    return allan_deviation(x + 0.5 * np.cos(phase), 0.01)


def test_short_means_whose_noise_is_another_are_left_out():
    found = noise_coefficients(humped(1))
    assert found.fit_range[0] > 0.2
    assert [each.code for each in found.findings] == ["noise_misfit"]
    assert f"shorter than {found.fit_range[0]:.3g} s" in found.findings[0].message


def test_only_the_terms_asked_for():
    found = noise_coefficients(exact(NoiseModel(N=0.3, K=0.2)), terms=("N", "B"))
    assert set(found.names) | set(found.bounds) == {"N", "B"}


def test_gaps_cost_certainty_and_nothing_else():
    x = NoiseModel(N=1e-4, B=3e-4).simulate(20_000, 0.01, np.random.default_rng(3))
    whole = noise_coefficients(allan_deviation(x, 0.01))
    x[5000:9000] = np.nan
    gappy = noise_coefficients(allan_deviation(x, 0.01))
    assert gappy.names == whole.names == ("N", "B")
    assert np.all(gappy.u > whole.u)
    assert np.all(np.abs(gappy.values - whole.values) < 3 * gappy.u)


# Hardly anything.


@pytest.mark.parametrize("x", [np.full(1000, 9.81), np.full(1000, np.nan), [1.0, 2.0, 4.0, 3.0]])
def test_no_noise_to_be_fitted(x):
    found = noise_coefficients(allan_deviation(x, 0.01))
    assert found.names == ()
    assert found.findings[0].code == "few_degrees_of_freedom"
    assert found.variance(np.array([1.0])).tolist() == [0.0]


@settings(deadline=None, max_examples=25)
@given(st.integers(16, 40), st.integers(0, 2**32 - 1), st.sampled_from([1.0, 0.0]))
def test_short_records_are_fitted_all_the_same(n, seed, white):
    rng = np.random.default_rng(seed)
    x = white * rng.standard_normal(n) + np.cumsum(rng.standard_normal(n))
    found = noise_coefficients(allan_deviation(x, 0.01))
    assert np.all(np.isfinite(found.values) & (found.values > 0) & (found.u > 0) & (found.dof > 0))


def test_a_ramp_and_quantised_samples_alone():
    """Nothing scatters but the rounding: the ramp is found; of a ramp without any noise nothing is claimed."""
    ramp = np.arange(20_000) * 0.0137
    found = noise_coefficients(allan_deviation(np.round(ramp), 1.0))
    assert found.values[found.names.index("R")] == pytest.approx(0.0137, rel=0.1)
    line = noise_coefficients(allan_deviation(ramp, 1.0), terms=("R",))
    assert line.names == ()
    assert line.findings[0].code == "noise_misfit"


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"terms": ("N", "W")}, "found W, expected some of N, B, K, R, Q"),
        ({"terms": ()}, "found none"),
    ],
)
def test_what_cannot_be_fitted_is_said(given, says):
    with pytest.raises(InputError, match=says):
        noise_coefficients(exact(NoiseModel(N=1.0)), **given)
