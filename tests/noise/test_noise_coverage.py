"""The intervals of noise coefficients hold the truth: 250 simulated recordings, the seed fixed before the first look.

The limits of one coefficient, 89.2 and 99.2 %, are exact binomial limits for 250 runs, at a risk of 1e-4 each. Of a
coefficient that is not there, 7.3 and 12 % are four standard deviations above the 3 and 6 % in which many runs see it.
The test run makes the first 20: 14 hits are the exact limit at a risk of 4e-5, 7 sightings of a coefficient that is not
there have a risk of 1e-4 at 6 %. `make campaign` makes all, `benchmarks/noise_coverage.py` more.
"""

from functools import partial

import numpy as np
import pytest
from campaigns.noise import MIXES, one_recording

from inercal.foundation.computing.runs import run
from inercal.foundation.instruments.noise import SYMBOLS
from inercal.foundation.results.result import coverage_factor

SEED, RUNS = 20261121, 250


@pytest.mark.parametrize("runs", [20, pytest.param(RUNS, marks=pytest.mark.campaign)])
@pytest.mark.parametrize(
    ("mix", "lost", "least", "most"),
    [
        ("mems", 0.0, 0.95, 0.073),
        ("counting", 0.0, 0.95, 0.073),
        ("steps", 0.005, 0.9, 0.12),
        ("steps", 0.02, 0.9, 0.12),
    ],
)
def test_intervals_hold_the_truth_as_often_as_they_say(mix, lost, least, most, runs):
    """A coefficient that was not seen counts as a hit where its upper limit holds the truth; ``least`` is the share of
    recordings in which every coefficient of a mix must be seen, ``most`` that of any other."""
    fewest, all_but = 0.892, 0.992
    if runs != RUNS:
        least, most, fewest, all_but = 0.7, 0.35, 0.7, 1.0
    task = partial(one_recording, mix, lost)
    sample = run(task, runs=runs, seed=SEED)
    truth = {name: getattr(MIXES[mix], name) for name in SYMBOLS}
    for k, name in enumerate(SYMBOLS):
        seen = np.isfinite(sample["error"][:, k])
        if truth[name] == 0.0:
            assert np.mean(seen) <= most, name  # hardly ever seen where there is none
            continue
        half = np.array([coverage_factor(dof, 0.95) for dof in sample["dof"][seen, k]]) * sample["u"][seen, k]
        hits = np.sum(np.abs(sample["error"][seen, k]) <= half)
        hits += np.sum(sample["limit"][~seen, k] >= truth[name])
        assert np.mean(seen) >= least, name
        assert fewest <= hits / runs <= all_but, (name, hits / runs)
    assert np.mean(sample["sound"]) > (0.98 if runs == RUNS else 0.8)
