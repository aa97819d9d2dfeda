"""Consistency of the estimators: stated covariances are true, and reach the Cramer-Rao bound.

20 seeds each in the test run, 100 (50 of the slowest filter) by `make campaign`; 1000 and more are kept in
docs/uncertainty/self-calibration.md. The limits follow from the statistics: the mean of 100 NEES of 21 degrees of
freedom has a standard error of 0.65, a root mean square of 100 errors one of 7 %, and the mean NIS of 135 000 rows one
of 0.01; they grow as the root of the runs falls.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from paper_study import TRUTH, study

from inercal.foundation.computing.executors import Threads
from inercal.systems.selfcal.monte_carlo import campaign

SEED, FEW, RUNS = 20261121, 20, 100
ALL = pytest.mark.campaign


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["nominal", pytest.param("low", marks=pytest.mark.campaign)])
@pytest.mark.parametrize(
    ("kind", "runs"),
    [(kind, FEW) for kind in ("error-state", "svd-qukf")]
    + [
        pytest.param("error-state", RUNS, marks=ALL),
        pytest.param("svd-qukf", RUNS // 2, marks=ALL),
    ],
)
def test_stated_uncertainties_are_true(kind, runs, noise):
    """NEES is 21, rms error over bound 1 and NIS 6, and 95 % intervals hold the truth.

    Of 100 runs NEES within 2 and rms error within 0.25: 3.1 and 3.5 standard errors, which fall with the root of runs.
    """
    found = campaign(study("paper", noise), runs, SEED, kind)
    wider = np.sqrt(100 / runs)
    assert found.runs == found.attempted
    assert found.nees.expected == 21
    assert found.nees.mean == pytest.approx(21.0, abs=2.0 * wider)
    assert found.nees.passed
    assert (np.abs(found.rms_over_bound - 1.0) < 0.25 * wider).all()
    assert found.nis.mean() == pytest.approx(6.0, abs=0.03 * wider)
    assert found.nis_limits[0] <= found.nis.mean() <= found.nis_limits[1]
    assert found.coverage.passed


@pytest.mark.parametrize("runs", [FEW, pytest.param(RUNS, marks=ALL)])
def test_the_gimbal_angle_filter_too(runs):
    """Away from gimbal lock gimbal angles are a good model; NEES is of 18, for there is no attitude in p."""
    found = campaign(study(), runs, SEED, "gimbal-ukf")
    assert found.runs == found.attempted
    assert found.nees.expected == 18
    assert found.nees.passed
    assert (np.abs(found.rms_over_bound - 1.0) < 0.25 * np.sqrt(100 / runs)).all()


@pytest.mark.slow
@pytest.mark.parametrize("runs", [FEW, pytest.param(40, marks=ALL)])
def test_the_batch_too(runs):
    """The MAP estimate over all attitudes: fewer runs, for each takes longer."""
    found = campaign(study(), runs, SEED, "map")
    assert found.runs == found.attempted
    assert found.nees.passed
    # 4.5 standard errors
    assert (np.abs(found.rms_over_bound - 1.0) < 4.5 / np.sqrt(2 * runs)).all()


def test_the_table_says_all_of_it():
    """Figures of a campaign as people read them."""
    text = campaign(study(), 20, SEED).table()
    for word in ("20 runs", "NEES", "NIS", "rms error over the bound", "kg0_x"):
        assert word in text


def test_runs_do_not_depend_on_the_place_in_which_they_are_done(tmp_path):
    """Each run has a random stream of its own; a pool of concurrent.futures stays open, a folder is picked up again."""
    with ThreadPoolExecutor(2) as pool:
        places = (Threads(1), Threads(2), pool)
        found = [campaign(study(), 6, 5, executor=place, folder=tmp_path) for place in places]
        found.append(campaign(study(), 6, 5, executor=pool))
        assert pool.submit(int, "1").result() == 1
    for each in found[1:]:
        assert np.array_equal(found[0].error, each.error)
        assert np.array_equal(found[0].joint_covariance, each.joint_covariance)


def test_errors_are_those_of_the_product_form():
    """With a scale error of 5 % the two forms of a misalignment differ by hundreds of standard deviations."""
    truth = TRUTH.copy()
    truth[16:18] = 0.05
    prior = study().prior.copy()
    prior[15:18] = 0.1
    found = campaign(study(truth=truth, prior=prior), 40, SEED)
    assert found.nees.passed
