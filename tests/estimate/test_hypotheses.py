"""One search for what happened: readings of a straight line stand for a system, with a table of three hypotheses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom, chi2

from inercal.foundation.inference import hypotheses
from inercal.foundation.inference.hypotheses import (
    Hypothesis,
    least_squares,
    likeliest,
    normal_equations,
    refitted,
    search,
    sigmas,
    tried,
)

T = np.linspace(-1.0, 1.0, 40)
N = len(T)
LINE = 1.0 + 2.0 * T


class Readings:
    """Judge of readings (n,) with noise of standard deviation 1: what they are off the line."""

    def residuals(self, readings):
        return readings - LINE

    def misfit(self, readings):
        return float(np.sum((readings - LINE) ** 2))


JUDGE = Readings()
OFFSET = Hypothesis(
    "offset", "unmodelled",
    lambda fit: f"the line is off by {fit.values[0]:.2g}: correct it",
    lambda readings, values: readings - values[0],
    ("offset",),
)  # fmt: skip
SLOPE = Hypothesis(
    "slope", "unmodelled",
    lambda fit: f"the line is too steep by {fit.values[0]:.2g}",
    lambda readings, values: readings - values[0] * T,
    ("slope",),
)  # fmt: skip
SWAP = Hypothesis(
    "swap",
    "channel_swap",
    "the halves are exchanged: put them in order",
    lambda readings, _: np.roll(readings, N // 2),
)


def table(_):
    """All that may have happened; an entry says what, and what the readings would be without it."""
    return OFFSET, SLOPE, SWAP


def measured(seed, offset=0.0, slope=0.0, swapped=False):
    readings = LINE + offset + slope * T + np.random.default_rng([71, seed]).standard_normal(N)
    return np.roll(readings, N // 2) if swapped else readings


def found(line, risk=1e-3, **more):
    return search(line, table, JUDGE, risk, 3, **more)


def names(fits):
    return [fit.hypothesis.name for fit in fits]


def test_sound_readings_are_left_alone_but_for_the_risk():
    """False alarms of 1000 runs are binomial, within 1e-4 on both sides.

    Offset and slope leave independent parts of the noise, each of chi-square of 1 over the mean square left, where that
    is above 1; exchanged halves are found with a third of the risk at most (Markov).
    """
    risk, runs = 0.3, 1000
    left = np.maximum(1.0, chi2.ppf((np.arange(2000) + 0.5) / 2000, N - 1) / N)
    share = float(np.mean(chi2.sf(chi2.isf(risk / 3.0, 1) * left, 1)))
    either = 1.0 - (1.0 - share) ** 2
    alarms = sum(bool(found(measured(seed), risk)[0]) for seed in range(runs))
    assert binom.ppf(1e-4, runs, either) <= alarms <= binom.isf(1e-4, runs, either + risk / 3.0)


@pytest.mark.parametrize(
    "truth", [{"offset": 1.5}, {"slope": 3.0}, {"offset": -1.5, "slope": 4.0}, {"swapped": True}]
)
def test_what_happened_is_found_at_its_size(truth):
    """Errors over their u are standard normal: the mean of their squares is 1 to four standard errors."""
    squares = []
    for seed in range(40):
        fits, left = found(measured(seed, **truth), 1e-4)
        assert sorted(names(fits)) == (["swap"] if "swapped" in truth else sorted(truth))
        assert JUDGE.misfit(left) < N + 5.0 * math.sqrt(2.0 * N)
        squares += [
            ((fit.values[0] - truth[fit.hypothesis.name]) / fit.u[0]) ** 2 for fit in fits if len(fit.u)
        ]
    assert not squares or abs(np.mean(squares) - 1.0) < 4.0 * math.sqrt(2.0 / len(squares))


def test_what_is_stated_with_an_uncertainty_is_no_error_within_it():
    """Readings that are off by as much as is stated are no error; where they are off by far more the fit says so."""
    doubted = replace(OFFSET, name="stated", prior=2.0)
    assert names(found(measured(0, offset=2.0))[0]) == ["offset"]
    fits, left = search(measured(0, offset=2.0), lambda _: [SLOPE, SWAP], JUDGE, 1e-3, 3, systematic=doubted)
    assert fits == []
    assert abs(np.mean(left - LINE)) < 0.1
    for offset, within in ((2.0, True), (20.0, False)):
        line = measured(0, offset=offset)
        (fit,) = refitted(line, [tried(doubted, line)], JUDGE)
        assert (abs(fit.values[0]) < sigmas(1e-3) * doubted.prior) == within
        if within:  # the weighted mean of the prior and of all readings
            assert fit.values[0] == pytest.approx(np.mean(line - LINE) * N / (N + 0.25), rel=0.03)


def test_a_choice_among_the_likeliest_and_what_is_alike():
    """A judge that trusts no chance takes the fit it likes, and names others beside it."""

    def choose(line, fits):
        best, *others = fits
        return [*best[:-1], replace(best[-1], alike=tuple(fit[-1] for fit in others))]

    fits, _ = search(measured(3, offset=5.0, slope=5.0), table, JUDGE, 1.0, 1, choose=choose)
    finding = fits[0].finding
    assert (finding.code, finding.harm) == ("unmodelled", ("*",))
    assert finding.headline.startswith("the line is off by 5")
    assert finding.headline.endswith("equally possible)")
    assert finding.action == "correct it"
    assert finding.items[0]["equally possible"].startswith("the line is too steep by")


def test_values_beyond_their_bounds_are_not_believed():
    bounded = replace(OFFSET, bounds=(-1.0, 1.0))
    for offset, expected in ((5.0, []), (0.8, ["offset"])):
        assert names(search(measured(0, offset=offset), lambda _: [bounded], JUDGE, 1e-3, 3)[0]) == expected


def test_the_likeliest_of_hypotheses_without_parameters():
    best = likeliest(measured(1, swapped=True), [SWAP], JUDGE, 1e-3)
    assert best.finding.message == "the halves are exchanged: put them in order"
    np.testing.assert_array_equal(best.case, measured(1))
    assert likeliest(measured(1), [SWAP], JUDGE, 1e-3) is None


def test_what_chance_explains():
    """Of parameters chi-square, else a likelihood ratio; a reading that is left out counts 1."""
    assert OFFSET.chance(0.05) == pytest.approx(1.959964**2, rel=1e-6)
    assert replace(OFFSET, alternatives=5.0).chance(0.05) == pytest.approx(chi2.isf(0.01, 1))
    assert replace(SWAP, times=3, alternatives=7.0, left_out=2).chance(0.1) == pytest.approx(
        2.0 + 6.0 * math.log(70.0)
    )


def test_what_has_no_effect_is_not_fitted():
    """A column of zeros beside others of any size: its parameter stays what it is, and is not clear of zero."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        Z = rng.standard_normal((50, 6, 8)) * 10.0 ** rng.uniform(0.0, 8.0, 8)
        Z[..., 6] = 0.0
        values = rng.standard_normal(8)
        fit = least_squares(normal_equations([Z], rng.standard_normal((50, 6))), values, np.full(8, np.inf))
        assert fit.change[6] == 0.0
        assert np.isfinite(fit.u).all()
        others = np.delete(Z, 6, axis=-1).reshape(300, 7)
        size = np.linalg.norm(others, axis=0)
        u = np.sqrt(fit.left * np.diag(np.linalg.inv((others / size).T @ (others / size)))) / size
        np.testing.assert_allclose(np.delete(fit.u, 6), u, rtol=1e-9)


def test_columns_beside_others_are_those_of_all_together():
    """The normal equations put together for one hypothesis after the other, also where residuals are left out that
    only its own columns lack."""
    rng = np.random.default_rng(5)
    z, held = rng.standard_normal((40, 6)), [rng.standard_normal((40, 6, m)) for m in (2, 3)]
    z[3, 2], held[1][7, 1, 0] = np.nan, np.nan
    beside = hypotheses._Beside(held, z)
    for gone in (False, True):
        more = rng.standard_normal((40, 6, 2))
        more[3, 2] = np.nan
        more[9, 5, 1] = np.nan if gone else 1.0
        whole = np.concatenate([*held, more], axis=-1).reshape(240, 7)
        used = np.isfinite(z.ravel()) & np.isfinite(whole).all(axis=1)
        whole, of = whole[used], z.ravel()[used]
        found = beside.and_with(more)
        np.testing.assert_allclose(found.matrix, whole.T @ whole, rtol=1e-12)
        np.testing.assert_allclose(found.right, whole.T @ of, rtol=1e-12, atol=1e-12)
        assert (found.rows, found.square) == (len(of), pytest.approx(float(of @ of)))
