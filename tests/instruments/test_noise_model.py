"""Noise processes: simulated samples have the stated Allan variance, at every averaging time; units of noise."""

import numpy as np
import pytest
from scipy import stats

from inercal.foundation.instruments.noise import BIAS_FLOOR, SYMBOLS, NoiseModel, allan_terms, flicker
from inercal.foundation.instruments.terms import NOISE_TERMS, noise_shown, noise_term
from inercal.foundation.units import parse_quantity, parse_unit
from rows import for_each


def allan(x, m):
    """Overlapping Allan variance (channels,) by its definition."""
    means = np.apply_along_axis(lambda c: np.convolve(c, np.full(m, 1 / m), "valid"), 0, x)
    return np.mean((means[m:] - means[:-m]) ** 2, axis=0) / 2


MODELS = {
    "N": NoiseModel(N=0.3),
    "B": NoiseModel(B=0.02),
    "K": NoiseModel(K=0.1),
    "Q": NoiseModel(Q=5.0),
    "all": NoiseModel(N=0.1, B=0.2, K=0.05, R=0.02, Q=0.05),
}


@pytest.mark.parametrize("kind", MODELS)
@pytest.mark.parametrize("interval", [0.5, 2.0])
def test_allan_variance_at_every_averaging_time(kind, interval):
    """Means over 1500 recordings within 4.5 standard errors, from one sample to half the record; no filter's edge."""
    model = MODELS[kind]
    x = model.simulate(256, interval, np.random.default_rng(1), 1500)
    assert x.shape == (256, 1500)
    for m in (1, 2, 3, 10, 40, 128):
        v = allan(x, m)
        assert abs(v.mean() - model.variance(m * interval)) < 4.5 * v.std() / np.sqrt(1500), m


def test_flicker_is_flat_over_four_decades():
    """Its Allan variance is the floor from one sample to 10000, within 4.5 standard errors of 60 recordings."""
    x = np.vstack([np.zeros((1, 60)), np.cumsum(flicker(30_000, np.random.default_rng(2), 60), axis=0)])
    for m in (1, 10, 100, 1000, 10_000):
        v = np.mean((x[2 * m :] - 2 * x[m:-m] + x[: -2 * m]) ** 2, axis=0) / (2.0 * m * m)
        assert abs(v.mean() - BIAS_FLOOR) < 4.5 * v.std() / np.sqrt(60), m


def test_flicker_is_normal_and_its_channels_are_independent():
    x = np.diff(flicker(4000, np.random.default_rng(3), 2), axis=0)
    assert stats.kstest(x[::20, 0] / x[:, 0].std(), "norm").pvalue > 1e-4
    assert abs(np.corrcoef(x.T)[0, 1]) < 4.5 / np.sqrt(4000)


def test_spectrum_of_flicker():
    """Two-sided 1/(2 pi f) per unit B^2: power in bands of 100 channels, away from the ends of the spectrum."""
    n = 4096
    x = flicker(n, np.random.default_rng(4), 100)
    window = np.hanning(n)[:, None]
    power = np.mean(np.abs(np.fft.rfft(x * window, axis=0)) ** 2, axis=1) / np.sum(window**2)
    f = np.fft.rfftfreq(n)
    band = (f > 0.004) & (f < 0.05)
    ratio = power[band] * 2 * np.pi * f[band]
    assert ratio.mean() == pytest.approx(1.0, abs=0.03)
    low, high = ratio[: band.sum() // 2].mean(), ratio[band.sum() // 2 :].mean()
    assert low / high == pytest.approx(1.0, abs=0.05)


def test_the_ramp_is_the_mean_over_each_sample():
    """R t averaged over [k, k+1] intervals: nothing random, with its sign."""
    x = NoiseModel(R=-0.5).simulate(5, 0.2, np.random.default_rng(5))
    np.testing.assert_allclose(x[:, 0], -0.5 * 0.2 * (np.arange(5) + 0.5))


def test_the_same_seed_gives_the_same_samples():
    model = MODELS["all"]
    one, other = (model.simulate(100, 0.1, np.random.default_rng(6), 2) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_each_term_where_the_standards_read_it():
    """N at 1 s, K at 3 s, B at the floor over 0.664, Q at sqrt(3) s, R at sqrt(2) s."""
    at = allan_terms([1.0, 17.0, 3.0, np.sqrt(2.0), np.sqrt(3.0)])
    np.testing.assert_allclose(np.diag(at), [1.0, 0.664**2, 1.0, 1.0, 1.0], rtol=1e-3)
    tau = np.array([0.1, 1.0, 10.0])
    slopes = np.diff(np.log10(np.sqrt(allan_terms(tau))), axis=0)
    np.testing.assert_allclose(slopes, np.tile([-0.5, 0.0, 0.5, 1.0, -1.0], (2, 1)), atol=1e-12)


# Units.


def test_pins_of_units():
    """1 deg/sqrt(h) is 2.90888209e-4 rad/sqrt(s), and what follows from hours and degrees."""
    pins = {
        ("1 deg/sqrt(h)", "angle random walk"): 2.90888209e-4,
        ("1 deg/h/sqrt(h)", "rate random walk"): 4.84813681e-6 / 60,
        ("1 deg/h/h", "rate ramp"): 4.84813681e-6 / 3600,
        ("1 deg/h^2", "rate ramp"): 4.84813681e-6 / 3600,
        ("1 ug/sqrt(Hz)", "velocity random walk"): 9.80665e-6,
        ("1 ug/sqrt(h)", "acceleration random walk"): 9.80665e-6 / 60,
        ("1 ug/h", "acceleration ramp"): 9.80665e-6 / 3600,
        ("1 ug*s", "velocity"): 9.80665e-6,
    }
    for (text, dimension), si in pins.items():
        assert parse_quantity(text, dimension, "key").value == pytest.approx(si, rel=1e-8)


@for_each("channel", ["rad/s", "m/s^2"])
@for_each("symbol", SYMBOLS)
def test_units_of_inertial_channels(channel, symbol):
    """The unit in a result is SI, and the one for people is of the same dimension."""
    si, shown = parse_unit(noise_term(symbol, channel)), parse_unit(noise_shown(symbol, channel))
    assert si.factor == 1.0
    assert si.si == si.symbol
    assert shown.dimension == si.dimension
    assert shown.factor != 1.0


def test_units_of_other_channels():
    assert [noise_term(symbol, "count") for symbol in SYMBOLS] == [
        "count*sqrt(s)", "count", "count/sqrt(s)", "count/s", "count*s",
    ]  # fmt: skip
    assert noise_shown("K", "V") == "V/sqrt(s)"
    assert tuple(NOISE_TERMS) == SYMBOLS
