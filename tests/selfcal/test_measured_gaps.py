"""Gaps in records of measured rates: the noise of the reading that is held gathers faster than that of a command."""

import numpy as np
import pytest
from independent import selfcal as platform
from independent.selfcal import BEST, NOMINAL, TRUTH, Drive, Faults
from numpy.testing import assert_allclose
from scipy.stats import chi2

from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.records.read import read
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.filters.gaps import walked
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.reading import recording_of

DRIVE = Drive(BEST, ramp=0.4, measured=True)
GAPS = {"30 s": ((150.0, 180.0),), "three": ((40.0, 50.0), (150.0, 180.0), (400.0, 404.0))}


def recorded(folder, seed, gaps, noise=NOMINAL):
    """A recording of measured rates with gaps, and its study."""
    (folder / "study.toml").write_text(platform.study(noise, '[model]\nstates = "paper"\n'))
    made = platform.simulated(np.random.default_rng(seed), DRIVE, noise=noise, faults=Faults(gaps=gaps))
    made.write(folder / "record.csv")
    settings = load_selfcal_study(folder / "study.toml")
    return recording_of(read(folder / "record.csv"), settings), settings


def test_noise_of_one_reading():
    """Rows every 0.2 s: a gap of 10 s has 10^2/0.2, and two rows without rates 3 and 5 times 0.2 s besides."""
    t = np.append(0.2 * np.arange(20), 3.8 + 10.0 + 0.2 * np.arange(5))
    rate = np.zeros((len(t) - 1, 3))
    rate[7:9] = np.nan
    found = walked(t, rate, (7, 8, 19))
    wanted = np.diff(t)
    wanted[[7, 8, 19]] = 0.6, 1.0, 10.0**2 / 0.2
    assert_allclose(found, wanted)


@pytest.mark.parametrize("kind", ["svd-qukf", "gimbal-ukf", "map"])
def test_estimators_find_the_same_over_a_gap(kind, tmp_path):
    """A tenth of u apart."""
    recording, settings = recorded(tmp_path, [20261122, 90], GAPS["30 s"])
    mine, theirs = (estimate(recording, problem(settings), each) for each in ("error-state", kind))
    u = np.sqrt(np.diag(theirs.covariance))
    assert_allclose(theirs.coefficients / u, mine.coefficients / u, atol=0.1)


@pytest.mark.parametrize("gaps", GAPS.values(), ids=GAPS)
def test_errors_are_what_u_says(gaps, tmp_path):
    """Mean of NEES over its 18 degrees of freedom within 99.9 % of chance in 8 runs; bounds know it too."""
    found = []
    for seed in range(8):
        recording, settings = recorded(tmp_path, [20261122, seed], gaps)
        of = problem(settings)
        result = estimate(recording, of)
        slope = product_slope(result.coefficients)
        P, miss = slope @ result.covariance @ slope.T, to_product(result.coefficients) - TRUTH
        found.append(miss @ np.linalg.solve(P, miss))
    low, high = chi2.ppf([0.0005, 0.9995], 18 * len(found)) / (18 * len(found))
    assert low < np.mean(found) / 18 < high
    along = recorded_bounds(
        recording, of, result.history.attitude, result.coefficients, restarts=result.restarts
    )
    assert_allclose(along.u, np.sqrt(np.diag(P)), rtol=0.01)
