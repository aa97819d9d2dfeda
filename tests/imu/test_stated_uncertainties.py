"""The stated uncertainties are true: 500 simulated calibrations, the seed fixed before the first look.

The limits of one coefficient: 91 and 98.4 % are exact binomial limits for 500 runs at a risk of about 0.05 %
over 21 coefficients. The limits of all together, 94 and 96 %, are some four standard deviations of the pooled
fraction, its spread widened by the correlation between the coefficients of one run (design effect 1.2).
"""

import os

import numpy as np
import pytest

from inercal.estimate.coverage import coverage
from inercal.estimate.runs import Processes, run
from inercal.imu.campaign import one_calibration

SEED = 20261121
RUNS = 500


@pytest.mark.slow
def test_intervals_cover_the_truth_as_often_as_they_say():
    sample = run(one_calibration, runs=RUNS, seed=SEED, executor=Processes(min(2, os.cpu_count() or 1)))
    assert np.all(sample["sound"] == 1.0)
    found = coverage(sample["error"], sample["u"], sample["dof"])
    assert np.all((found.fraction >= 0.91) & (found.fraction <= 0.984)), found.table()
    assert 0.94 <= found.pooled <= 0.96, found.table()
    assert found.passed, found.table()
