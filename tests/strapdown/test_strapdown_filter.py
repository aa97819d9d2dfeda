"""The error-state filter against the batch: two estimators of one model, which must agree."""

import json
from dataclasses import replace

import numpy as np
import pytest
from grades import GRADES, drawn

import inercal as ic
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.strapdown.batch import fit
from inercal.strapdown.error_state import filtered, measured, predicted
from inercal.strapdown.rests import found_rests, nodes_of
from inercal.strapdown.simulate import simulated


def both(grade, seed, rate=50.0):
    """Batch and filter of a simulated run."""
    settings = replace(GRADES[grade], plan=replace(GRADES[grade].plan, sample_rate=rate))
    rng = np.random.default_rng([seed, 5])
    samples = simulated(settings, drawn(settings, rng), rng)
    nodes = nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)
    return fit(samples, nodes, settings), filtered(samples, nodes, settings)


def agree(grade, seed):
    batch, of_filter = both(grade, seed)
    assert batch.converged
    assert of_filter.converged
    u = np.sqrt(np.diag(batch.covariance))
    assert np.abs((of_filter.c - batch.c)[batch.free] / u).max() < 0.01
    assert np.sqrt(np.diag(of_filter.covariance)) == pytest.approx(u, rel=0.01)
    after = np.sqrt(np.einsum("kii->ki", of_filter.history))
    assert np.all(np.diff(after, axis=0) <= 1e-9 * after[0])
    assert 0.8 < of_filter.nis[1:].mean() < 1.2


@pytest.mark.parametrize("grade", ["nav", "tactical"])
def test_the_filter_is_the_batch(grade):
    """To 0.01 u; of tactical grade the heading at the start is not known, 90 deg off in this run."""
    agree(grade, 2)


@pytest.mark.campaign
@pytest.mark.parametrize("grade", ["nav", "tactical"])
def test_the_filter_is_the_batch_in_twenty_runs(grade):
    for seed in range(100, 120):
        agree(grade, seed)


def test_one_step_is_that_of_matrices():
    """Prediction and update of the kernels against the equations of Kalman as matrices."""
    rng = np.random.default_rng(3)
    m, p = 6, 4
    n = m + 6 + p
    root = rng.standard_normal((n, n))
    P, s = root @ root.T, rng.standard_normal(n)
    F, G, Q = rng.standard_normal((m, m)), rng.standard_normal((6, p)), np.eye(m)
    whole = np.eye(n)
    whole[:m, :m], whole[:m, -p:] = F, G
    noise = np.zeros((n, n))
    noise[:m, :m] = Q
    s1, P1 = s.copy(), P.copy()
    predicted(s1, P1, F, G, Q, np.empty((m, n)))
    np.testing.assert_allclose(s1, whole @ s, rtol=1e-12)
    np.testing.assert_allclose(P1, whole @ P @ whole.T + noise, rtol=1e-9, atol=1e-9)
    for i, j in ((4, -1), (1, 7)):
        h = np.zeros(n)
        h[i] += 1.0
        if j >= 0:
            h[j] -= 1.0
        S = h @ P1 @ h + 0.3
        K = P1 @ h / S
        off = 0.7 - h @ s1
        expected = s1 + K * off, P1 - np.outer(K, h @ P1)
        nis = measured(s1, P1, i, j, 0.7, 0.3, np.empty(n))
        assert nis == pytest.approx(off**2 / S)
        np.testing.assert_allclose(s1, expected[0], rtol=1e-9)
        np.testing.assert_allclose(P1, expected[1], rtol=1e-9, atol=1e-9)


def test_the_command_gives_both_and_the_history(tmp_path, capsys):
    out = tmp_path / "cal.json"
    command = ["calibrate", "strapdown", str(FOLDER / "strapdown.bin.gz"), "--map", str(FOLDER / "strapdown-map.toml"),
               "--study", str(FOLDER / "strapdown.toml"), "--out", str(out), "--quiet"]  # fmt: skip
    assert run([*command, "--filter", "error-state"]) == 0
    found = ic.load(out)
    result = json.loads(out.read_text())["result"]
    assert result["estimator"] == "error-state"
    assert len(result["history"]) == 19
    for name in found.names:
        one, two = result["compare"]["batch"][name], result["compare"]["error-state"][name]
        assert two["value"] == found.estimate[name].value
        assert abs(one["value"] - two["value"]) < 0.01 * one["u"], name
        # the coefficient is better known after each rest
        u = [each["u"][name] for each in result["history"]]
        assert np.all(np.diff(u) <= 1e-9 * u[0])


def test_biases_that_walk_far_are_for_the_batch():
    """MEMS: the filter says that it did not come to rest, or is within what its walks leave open."""
    batch, of_filter = both("mems", 1)
    assert batch.converged
    assert of_filter is None or not of_filter.converged
