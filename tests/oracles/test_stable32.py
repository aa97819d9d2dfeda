"""Stable32 1.60 on PHASE.DAT: overlapping Allan deviation with confidence limits; and NIST's ten points.

Stable32's limits come from the sums of Greenhall and Riley with white noise smoothed over one sample. Samples that are
means of white noise are independent, and their sums are those of white noise as it is: at one sample 666 degrees of
freedom in place of 782, at two 570 in place of 528, alike at long averaging times. A test does the sums both ways.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from inercal.foundation.noise.covariance import degrees_of_freedom
from inercal.foundation.noise.deviation import allan_deviation

FOLDER = Path(__file__).parents[1] / "data" / "stable32"
PHASE = np.loadtxt(FOLDER / "PHASE.DAT")
FACTOR, TAU, COUNT, ALPHA, LOWER, SIGMA, UPPER = np.loadtxt(FOLDER / "phase_dat_oadev_octave.txt").T
PRINTED = 0.5e-4 * 10.0 ** np.floor(np.log10(SIGMA))
"""Half a unit of the last of five digits."""


def analysed():
    return allan_deviation(np.diff(PHASE), 1.0, TAU)


@pytest.mark.slow
def test_deviations_to_the_printed_digits():
    found = analysed()
    assert np.all(np.abs(found.deviation[:, 0] - SIGMA) <= PRINTED * 1.001)
    np.testing.assert_array_equal(found.lengths, FACTOR)
    np.testing.assert_array_equal(found.terms[:, 0], COUNT)
    np.testing.assert_array_equal(found.alpha[:, 0], ALPHA)


def test_limits():
    """All within 0.25 % of sigma; to two units of the last digit where smoothing over a sample no longer matters."""
    found = analysed()
    for mine, theirs in ((found.lower, LOWER), (found.upper, UPPER)):
        assert np.all(np.abs(mine[:, 0] - theirs) < 0.0026 * SIGMA)
        assert np.all(np.abs(mine[6:, 0] - theirs[6:]) < 2.5e-4 * SIGMA[6:])


def greenhall_riley(n, m):
    """Degrees of freedom of white frequency noise, NIST SP 1065 section 5.4.1: F = m, S = m, d = 2, plain sums."""

    def smoothed(t):
        return m**2 * (2 * np.abs(t) ** 3 - np.abs(t - 1 / m) ** 3 - np.abs(t + 1 / m) ** 3)

    def differences(t):
        near = 4 * smoothed(t - 1) + 4 * smoothed(t + 1)
        return 6 * smoothed(t) - near + smoothed(t - 2) + smoothed(t + 2)

    count = n + 1 - 2 * m
    j = np.arange(1, min(count, 3 * m))
    z = differences(np.concatenate([[0.0], j / m])) ** 2
    return count * z[0] / (z[0] + 2 * np.sum((1 - j / count) * z[1:]))


def test_the_difference_is_the_smoothing():
    """Those sums give Stable32's limits within 4e-4 of sigma, for the factors where it makes them in full."""
    for k in range(6):
        dof = greenhall_riley(1000, int(FACTOR[k]))
        for q, theirs in ((0.8415, LOWER[k]), (0.1585, UPPER[k])):
            assert SIGMA[k] * np.sqrt(dof / stats.chi2.ppf(q, dof)) == pytest.approx(
                theirs, abs=4e-4 * SIGMA[k]
            )


def test_white_samples_scatter_as_stated_here():
    """3000 simulated sets of 1000: within 4.5 standard errors, where the smoothed sums are off by seven."""
    x = np.random.default_rng(1).standard_normal((1000, 3000))
    variance = np.mean(np.diff(x, axis=0) ** 2, axis=0)
    counted = 2 * variance.mean() ** 2 / variance.var(ddof=1)
    error = np.sqrt(2 / 3000)  # relative, of a variance that is near normal
    assert counted == pytest.approx(degrees_of_freedom(1000, 1, 0), rel=4.5 * error)
    assert abs(greenhall_riley(1000, 1) / counted - 1) > 4.5 * error


def test_ten_points_of_nist():
    """NBS Monograph 140, annex 8.E, NIST SP 1065 p. 107."""
    found = allan_deviation([892.0, 809, 823, 798, 671, 644, 883, 903, 677], 1.0, [1.0, 2.0])
    np.testing.assert_allclose(found.deviation[:, 0], [91.22945, 85.95287], atol=5e-6)
