"""Recordings of hours: filters by chunks give what they give at once."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from paper_study import study

from inercal.systems.selfcal.filters import run
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.simulate import experiment, simulate

SETTINGS = study("best")
OF = problem(SETTINGS)


def recorded():
    """A recording with silent encoders, and rates held, where chunks would end."""
    made = simulate(experiment(SETTINGS), np.random.default_rng(7)).recording
    th = made.th.copy()
    th[495:520, 0], th[1001] = np.nan, np.nan
    return replace(made, th=th, held=(400, 498, 1000))


@pytest.mark.parametrize("chunk", [100, 500, 1001])
def test_by_chunks_as_at_once(chunk, monkeypatch):
    """To the last digit; of the history only attitudes stay."""
    recording = recorded()
    whole = estimate(recording, OF, brief=True)
    monkeypatch.setattr(run, "_CHUNK", chunk)
    found = estimate(recording, OF, brief=True)
    for name in ("nis", "dims", "innovations", "coefficients", "covariance", "attitude"):
        assert_array_equal(getattr(found, name), getattr(whole, name))
    assert (found.restarts, found.gimbal_cosine) == (whole.restarts, whole.gimbal_cosine)
    assert_array_equal(found.history.attitude, whole.history.attitude)
    assert len(found.history.coefficients) == 1
    assert len(estimate(recording, OF).history.coefficients) == len(recording.t)
    assert_array_equal(estimate(recording, OF, history=False, brief=True).nis, whole.nis)
