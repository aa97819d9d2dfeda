import subprocess
import sys

import monte_carlo_tasks as tasks
import numpy as np
import pytest
from scipy import stats

from inercal.foundation.computing.executors import Threads
from inercal.foundation.computing.runs import run
from inercal.foundation.errors import InputError
from inercal.foundation.inference.consistency import coverage, nees
from rows import for_each


def correlated(rng, runs, m, r):
    """Standard normal errors (runs, m) that share a part of their variance."""
    return np.sqrt(r) * rng.standard_normal((runs, 1)) + np.sqrt(1 - r) * rng.standard_normal((runs, m))


# Coverage: the figures.


def test_figures_of_a_plain_loop():
    rng = np.random.default_rng(1)
    errors, u, dof = rng.standard_normal((60, 3)), rng.uniform(0.5, 2, (60, 3)), rng.integers(2, 9, 60)
    c = coverage(errors, u, dof, level=0.9)
    for j in range(3):
        hits = [abs(errors[i, j]) <= stats.t.ppf(0.95, dof[i]) * u[i, j] for i in range(60)]
        assert c.fraction[j] == np.mean(hits)
        assert c.rms[j] == pytest.approx(np.sqrt(sum((errors[:, j] / u[:, j]) ** 2) / 60))
    assert c.pooled == pytest.approx(c.fraction.mean())
    assert (c.runs, c.level) == (60, 0.9)


def test_broadcasting():
    rng = np.random.default_rng(2)
    errors, u, dof = rng.standard_normal((30, 30)), rng.uniform(0.5, 2, 30), rng.integers(1, 9, 30)
    short = coverage(errors, u, dof)
    long = coverage(errors, np.tile(u, (30, 1)), np.tile(dof[:, None], (1, 30)))
    assert short.table() == long.table()


def test_the_line_fit_holds_what_it_states():
    result = run(tasks.line_fit, runs=1000, seed=5, executor=Threads(2))
    c = coverage(result["errors"], result["u"], result["dof"])
    assert c.passed
    np.testing.assert_allclose(c.rms, np.sqrt(10 / 8), rtol=0.06)
    assert not coverage(result["errors"], result["u"]).passed  # normal intervals for an estimated variance


@pytest.mark.parametrize("level", [0.5, 0.683, 0.95, 0.99])
@pytest.mark.parametrize("r", [0.0, 0.7, 1.0])
def test_known_uncertainties_pass(level, r):
    rng = np.random.default_rng(3)
    sigma = np.array([1e-9, 1.0, 1e3, 7.0, 0.2])
    assert coverage(sigma * correlated(rng, 800, 5, r), sigma, level=level).passed


@pytest.mark.parametrize("factor", [0.8, 1.25])
@pytest.mark.parametrize("r", [0.0, 0.5, 0.9])
def test_uncertainties_wrong_by_a_fifth_fail(factor, r):
    errors = correlated(np.random.default_rng(4), 1000, 6, r)
    c = coverage(errors, factor * np.ones(6))
    assert not c.passed
    assert (c.pooled < c.pooled_limits[0]) == (factor < 1)
    np.testing.assert_allclose(c.rms, 1 / factor, rtol=0.1)


def test_one_wrong_coefficient_is_found_and_named():
    u = np.array([1.0, 1.0, 0.8, 1.0])
    c = coverage(np.random.default_rng(5).standard_normal((1000, 4)), u)
    outside = (c.fraction < c.limits[0]) | (c.fraction > c.limits[1])
    assert outside.tolist() == [False, False, True, False]
    assert not c.passed
    lines = c.table(["K0", "K1", "delta_o", "Kip"]).splitlines()
    assert lines[0] == "95 % intervals in 1000 runs"
    assert [line.split()[0] for line in lines[2:]] == ["K0", "K1", "delta_o", "Kip", "all"]
    assert [line.endswith("outside") for line in lines[2:6]] == [False, False, True, False]


# Coverage: the limits.


@pytest.mark.parametrize(("runs", "m", "level"), [(200, 6, 0.95), (60, 1, 0.5), (1000, 20, 0.99)])
def test_limits_of_each_coefficient_are_the_tightest_that_hold(runs, m, level):
    rng = np.random.default_rng(6)
    c = coverage(rng.standard_normal((runs, m)), np.ones(m), level=level, risk=0.1)
    draws = 400_000
    hits = rng.binomial(runs, level, draws)
    low, high = (round(runs * x) for x in c.limits)
    tail = 0.1 / 2 / m / 2
    slack = 4 * np.sqrt(tail / draws)
    assert np.mean(hits < low) <= tail + slack
    assert np.mean(hits > high) <= tail + slack
    assert np.mean(hits <= low) >= tail - slack
    assert np.mean(hits >= high) >= tail - slack


@pytest.mark.parametrize("dof", [np.inf, 4])
@pytest.mark.parametrize(("runs", "m", "r"), [(100, 8, 0.0), (100, 8, 0.5), (200, 20, 0.9), (100, 4, 1.0)])
def test_false_alarms(runs, m, r, dof):
    """The stated risk is kept, over many campaigns, whatever the coefficients have in common."""
    rng = np.random.default_rng(7)
    campaigns, risk = 400, 0.2
    pooled = passed = naive = 0
    low, high = stats.binom.ppf([risk / 4, 1 - risk / 4], runs * m, 0.95) / runs / m
    for _ in range(campaigns):
        u = np.sqrt(rng.chisquare(dof, (runs, 1)) / dof) if np.isfinite(dof) else np.ones((runs, 1))
        c = coverage(correlated(rng, runs, m, r), u, dof, risk=risk)
        pooled += c.pooled_limits[0] <= c.pooled <= c.pooled_limits[1]
        naive += low <= c.pooled <= high
        passed += c.passed
    slack = 3 * np.sqrt(risk * campaigns)
    assert pooled >= (1 - risk / 2) * campaigns - slack / np.sqrt(2)
    assert passed >= (1 - risk) * campaigns - slack
    if r >= 0.5:  # limits that take the coefficients for independent do not hold
        assert naive < (1 - 2 * risk / 2) * campaigns


def test_correlation_widens_the_pooled_limits():
    rng = np.random.default_rng(8)
    free, some, full = (coverage(correlated(rng, 400, 10, r), np.ones(10)) for r in (0.0, 0.8, 1.0))
    assert 1 <= free.design_effect < 1.3
    assert 3 < some.design_effect < 10
    assert full.design_effect == pytest.approx(10)
    widths = [c.pooled_limits[1] - c.pooled_limits[0] for c in (free, some, full)]
    assert widths[0] < widths[1] < widths[2]
    one = coverage(rng.standard_normal((400, 1)), np.ones(1))
    assert full.pooled_limits == pytest.approx(one.pooled_limits, abs=1 / 400)


def test_no_misses_at_all_are_no_proof_in_few_runs():
    errors = np.zeros((20, 30)) + 1e-3 * np.arange(1, 21)[:, None]
    c = coverage(errors, np.ones(30))
    assert c.pooled == 1.0
    assert c.design_effect == pytest.approx(30)
    assert c.passed
    assert not coverage(np.tile(errors, (20, 1)), np.ones(30)).passed


@for_each(
    ("bad", "said"),
    [
        ({"errors": np.zeros(5)}, r"errors: got shape \(5,\)"),
        ({"errors": np.zeros((1, 2))}, "2 runs or more"),
        ({"errors": np.array([[0, 0], [0, np.nan], [0, 0]])}, "errors: got nan in run 1"),
        ({"u": np.ones(3)}, r"u: got shape \(3,\), expected \(3, 2\)"),
        ({"u": np.array([1, 0])}, "u: got 0.0, expected numbers above zero"),
        ({"dof": [1, 1]}, "dof: got shape"),
        ({"dof": 0}, "dof: got 0.0"),
        ({"level": 95.0}, "level=95.0"),
        ({"risk": 0.0}, "risk=0.0"),
    ],
)
def test_bad_input_of_coverage(bad, said):
    with pytest.raises(InputError, match=said):
        coverage(**{"errors": np.zeros((3, 2)), "u": np.ones(2), **bad})


# NEES.


def covariances(rng, runs, m):
    """Random covariances over twelve orders of magnitude, and errors that obey them."""
    L = np.tril(rng.uniform(-1, 1, (runs, m, m))) + 2 * np.eye(m)
    scale = np.logspace(-6, 6, m)
    L = scale[:, None] * L
    return L @ np.swapaxes(L, -1, -2), (L @ rng.standard_normal((runs, m, 1)))[..., 0], scale


def test_nees_of_a_plain_loop():
    rng = np.random.default_rng(9)
    P, e, scale = covariances(rng, 50, 4)
    Q = P / np.outer(scale, scale)
    expected = np.mean([(e[i] / scale) @ np.linalg.inv(Q[i]) @ (e[i] / scale) for i in range(50)])
    n = nees(e, P)
    assert n.mean == pytest.approx(expected, rel=1e-10)
    assert (n.expected, n.runs, n.standard_error) == (4, 50, np.sqrt(8 / 50))


def test_nees_judges_right_and_wrong_covariances():
    P, e, _ = covariances(np.random.default_rng(10), 500, 6)
    assert nees(e, P).passed
    assert not nees(e, 0.8**2 * P).passed
    assert not nees(e, 1.25**2 * P).passed
    assert nees(e, 0.8**2 * P).table().endswith("outside")
    assert nees(e, P).table().startswith("NEES of 500 runs: ")


def test_nees_finds_an_invented_correlation_that_coverage_cannot():
    P = 0.2 * np.eye(3) + 0.8
    assert nees(correlated(np.random.default_rng(11), 500, 3, 0.8), P).passed
    independent = np.random.default_rng(11).standard_normal((500, 3))
    assert coverage(independent, np.sqrt(np.diag(P))).passed
    assert not nees(independent, P).passed


def test_nees_band_against_monte_carlo():
    rng = np.random.default_rng(12)
    n = nees(rng.standard_normal((20, 3)), np.eye(3), risk=0.1)
    means = (rng.standard_normal((40_000, 20, 3)) ** 2).sum(axis=2).mean(axis=1)
    np.testing.assert_allclose(np.quantile(means, [0.05, 0.95]), n.limits, rtol=0.01)
    assert means.std() == pytest.approx(n.standard_error, rel=0.02)


@for_each(
    ("P", "said"),
    [
        (np.eye(3), r"covariances: got shape \(3, 3\)"),
        (np.ones(2), "covariances: got shape"),
        (np.full((2, 2), np.nan), "finite"),
        (-np.eye(2), "variances: got -1.0"),
        (np.array([np.eye(2)] * 3 + [np.ones((2, 2))]), r"covariances\[3\]: is not positive definite"),
        (np.array([np.eye(2)] * 3), "expected"),
    ],
)
def test_bad_input_of_nees(P, said):
    with pytest.raises(InputError, match=said):
        nees(np.zeros((4, 2)), P)


def test_importing_loads_no_scipy():
    program = (
        "import sys, inercal.foundation.inference.consistency, inercal.foundation.computing.runs\n"
        "sys.exit('scipy' in sys.modules)"
    )
    path = {"PYTHONPATH": ":".join(p for p in sys.path if p)}
    assert subprocess.run([sys.executable, "-c", program], env=path, check=False).returncode == 0
