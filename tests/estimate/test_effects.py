"""Effects outside a model, averaged over their sizes: against weighted samples, and against what is drawn."""

import numpy as np
from numpy.testing import assert_allclose

from inercal.foundation.inference.effects import joint_second_moment, second_moment


def test_the_second_moment_is_that_of_a_weighted_sample():
    rng = np.random.default_rng(20261124)
    information = np.array([[3.0, 1.0], [1.0, 0.5]])
    score, usual = np.array([2.5, 0.2]), 0.7
    count = 400_000
    size = usual * np.abs(rng.standard_cauchy(count))
    effects = size[:, None] * rng.standard_normal((count, 2))
    log = effects @ score - 0.5 * np.einsum("ka,ab,kb->k", effects, information, effects)
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    products = np.einsum("ka,kb->kab", effects, effects)
    expected = np.einsum("k,kab->ab", weight, products)
    u = np.sqrt(np.einsum("k,kab->ab", weight**2, (products - expected) ** 2))
    assert np.all(np.abs(second_moment(score, information, usual) - expected) < 4.5 * u + 0.01 * usual**2)


def test_effects_of_one_kind_are_those_of_one_kind():
    """Two ways to the same: the size that leaves as much of all of them together, of three alike."""
    score, information = np.array([4.0, 1.0, -2.0]), 6.0 * np.eye(3)
    found = joint_second_moment(score, information, np.zeros(3, dtype=int))
    assert_allclose(np.trace(found), np.trace(second_moment(score, information, 1.0)), rtol=0.01)


def test_errors_of_several_kinds_are_as_large_as_said():
    """Effects of 3 kinds drawn with their sizes, correlated in what a recording shows: their squares over the second
    moment are 1 on average, within 5 standard errors of 600 draws and a tenth for sizes taken one kind at a time."""
    rng = np.random.default_rng(20261125)
    kinds = np.array([0, 0, 0, 1, 1, 2, 2, 2])
    columns = rng.standard_normal((40, 8)) @ (np.eye(8) + 0.4)
    information, ratios = columns.T @ columns, []
    for _ in range(600):
        effects = np.abs(rng.standard_cauchy(3))[kinds] * rng.standard_normal(8)
        score = columns.T @ (columns @ effects + rng.standard_normal(40))
        ratios.append(np.mean(effects**2 / np.diag(joint_second_moment(score, information, kinds))))
    off = 5.0 * np.std(ratios) / np.sqrt(len(ratios))
    assert abs(np.mean(ratios) - 1.0) < 0.1 + off


def test_what_a_recording_shows_to_be_small_hardly_counts():
    """Of effects whose u is a hundredth of what is usual and that are not there, less than u is left; one that is there
    in another kind changes nothing about it; one that no recording shows stays as large as usual, and more."""
    information = np.diag([1e4, 1e4, 1e4, 1e4, 0.0])
    kinds = np.array([0, 0, 1, 1, 2])
    nothing = joint_second_moment(np.zeros(5), information, kinds)
    assert np.all(np.sqrt(np.diag(nothing))[:4] < 0.01)
    assert np.sqrt(nothing[4, 4]) > 1.0
    there = joint_second_moment(np.array([0.0, 0.0, 3000.0, 0.0, 0.0]), information, kinds)
    assert_allclose(np.diag(there)[:2], np.diag(nothing)[:2], rtol=1e-6)
    assert_allclose(np.sqrt(there[2, 2]), 0.3, rtol=0.02)
