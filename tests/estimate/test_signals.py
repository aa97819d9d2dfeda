"""Readings that are copies of others, and parts of a test that scatter more than the rest, are named."""

from dataclasses import replace

import numpy as np
import pytest

from inercal.foundation.inference.judge import evidence_of, judge
from inercal.foundation.inference.questions import JudgedFit
from inercal.foundation.inference.signals import copies, uneven

ROWS = 60


def line(seed, sigma=lambda row, channel: 1e-3, channels=("acc_x", "acc_y", "acc_z")):
    """Three channels that follow one input along a line, in three files of 20 rows each."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, ROWS)
    row, channel = np.repeat(np.arange(ROWS), 3), np.tile(np.arange(3), ROWS)
    size = np.array([sigma(*at) for at in zip(row, channel, strict=True)])
    y = x[row] + size * rng.standard_normal(3 * ROWS)
    A = np.zeros((3 * ROWS, 6))
    A[np.arange(3 * ROWS), channel], A[np.arange(3 * ROWS), 3 + channel] = 1.0, x[row]
    gain = np.linalg.pinv(A)
    names = ("K0_x", "K0_y", "K0_z", "K1_x", "K1_y", "K1_z")
    u = 1e-3 * np.sqrt(np.diag(gain @ gain.T))
    return JudgedFit(
        names, gain @ y, u, gain, A, np.zeros((3 * ROWS, 0)), y, y - A @ gain @ y, 1e-6 * np.eye(3 * ROWS), row,
        channel, row.astype(float), channels, (), 0.0, row // 20, ("a.csv", "b.csv", "c.csv"),
    )  # fmt: skip


def said(fit):
    return list(uneven(fit, evidence_of(fit), 1.0))


def test_a_file_that_scatters_more_is_named():
    (finding,) = said(line(1, lambda row, channel: 6e-3 if row >= 40 else 1e-3))
    assert finding.code == "excess_scatter"
    assert finding.headline.startswith("c.csv scatters")
    assert finding.harm


def test_a_channel_that_scatters_more_is_named():
    (finding,) = said(line(2, lambda row, channel: 6e-3 if channel == 1 else 1e-3))
    assert finding.headline.startswith("acc_y scatters")


def test_even_scatter_is_not_named():
    """Of 300 sound tests 0.3 are named by chance."""
    assert sum(bool(said(line(100 + seed))) for seed in range(300)) <= 3


def test_a_block_that_was_written_twice_is_named():
    fit = line(3)
    y = fit.readings.copy()
    y[30:45] = y[:15]
    (finding,) = copies(replace(fit, readings=y, residuals=fit.residuals + y - fit.readings))
    assert finding.code == "row_copies"
    assert "5 rows" in finding.headline


@pytest.mark.parametrize("seed", [4, 5])
def test_a_sound_line_is_judged_sound(seed):
    assert judge(line(seed)) == ()
