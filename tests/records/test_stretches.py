"""Runs of equal rows: erased stretches are no data, values that stand several rows are found, coarse noise is none."""

import numpy as np
import pytest

from inercal.foundation.records.checks.stretches import coarse_step, erased, held, of_stretches, once

RNG = np.random.default_rng(31)


def test_an_erased_tail_is_no_data_and_the_rest_is():
    noise = RNG.normal(size=(2000, 3))
    noise[1700:] = -0.0
    assert np.flatnonzero(erased(noise)).tolist() == list(range(1700, 2000))
    (finding,) = of_stretches(noise, ["acc_x", "acc_y", "acc_z"])
    assert finding.code == "no_data"
    assert finding.where == "rows 1701-2000"
    assert finding.harm


@pytest.mark.parametrize("rows", [1, 7])
def test_noise_has_no_erased_stretch_however_often_its_values_are_written(rows):
    assert not erased(np.repeat(RNG.normal(size=(3000, 1)), rows, axis=0)).any()


def test_a_coarse_output_at_rest_is_data():
    """Noise of 0.15 steps stands for some 600 rows at times, as it does elsewhere."""
    assert not erased(np.rint(RNG.normal(0.0, 0.15, (20_000, 1)))).any()


def test_one_channel_that_moves_makes_a_row_data():
    values = np.zeros((2000, 2))
    values[:, 1] = RNG.normal(size=2000)
    assert not erased(values).any()


@pytest.mark.parametrize(("rows", "tick"), [(2, 2.0), (7, 7.0), (7, 7.14)])
def test_values_that_stand_are_counted_once(rows, tick):
    source = RNG.normal(size=4000)
    written = source[(np.arange(int(len(source) * tick)) / tick).astype(int)]
    assert held(written) == pytest.approx(tick, rel=0.03)
    np.testing.assert_array_equal(written[once(written, held(written))], source)


@pytest.mark.parametrize("noise", [0.3, 0.6, 1.0, 30.0])
def test_coarse_noise_does_not_stand(noise):
    """Rounded white noise has equal neighbours by chance, of all lengths."""
    assert held(np.rint(RNG.normal(0.3, noise, 20_000))) == 1.0


@pytest.mark.parametrize(("noise", "coarse"), [(0.2, True), (0.4, True), (1.0, False), (5.0, False)])
def test_noise_below_a_step_is_not_known(noise, coarse):
    assert (coarse_step(0.01 * np.rint(RNG.normal(0.5, noise, 5000))) > 0.0) == coarse
