"""Recordings of hours: what the judge of the diagnosis computes by chunks is what it computes at once."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from paper_study import study

from inercal.selfcal.before import considered
from inercal.selfcal.before.simulate import experiment, simulate
from inercal.selfcal.diagnosis import fit_quality, small
from inercal.selfcal.diagnosis.fit_quality import JUDGE, filtered
from inercal.selfcal.diagnosis.rig_errors import rig_errors
from inercal.selfcal.filters import run
from inercal.selfcal.filters.problem import problem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.limits import LIMITS

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


def test_joints_by_chunks_as_at_once(monkeypatch):
    recording = recorded()
    now = estimate(recording, OF, brief=True)
    whole = small._found_angles((recording, OF), now)
    monkeypatch.setattr(small, "_CHUNK", 512)
    for mine, theirs in zip(small._found_angles((recording, OF), now), whole, strict=True):
        assert_array_equal(mine, theirs)


def sums_of(values, used, size):
    """Sums of so many rows, over the root of those used; NaN where there are none."""
    rows = []
    for first in range(0, len(values), size):
        some, of = values[first : first + size], used[first : first + size]
        count = of.sum(axis=0)
        total = np.where(of.reshape(*of.shape, *[1] * (values.ndim - 2)), some, 0.0).sum(axis=0)
        count = np.where(count > 0, count, np.nan).reshape(*count.shape, *[1] * (values.ndim - 2))
        rows.append(total / np.sqrt(count))
    return np.array(rows)


def test_small_errors_are_sought_in_sums_of_rows(monkeypatch):
    """Residuals and columns of the judge, of a recording that is too long for it, are sums of those of its rows."""
    case = recorded(), OF
    now = filtered(case)
    z = JUDGE.residuals(case)
    used = np.isfinite(z)
    each = next(error for error in rig_errors(case, now) if error.name == "gamma")
    columns = each.derivative(case)
    monkeypatch.setattr(considered, "_CHUNK", 500)
    at_once = next(error for error in rig_errors(case, now) if error.name == "gamma").derivative(case)
    assert_allclose(at_once, columns, rtol=1e-9, atol=1e-6 * np.nanmax(np.abs(columns)))
    monkeypatch.setattr(fit_quality, "LIMITS", replace(LIMITS, judged_rows=400))
    size = fit_quality.together(case[0])
    assert size == 7
    assert_allclose(JUDGE.residuals(case), sums_of(z, used, size), atol=1e-12)
    found = next(error for error in rig_errors(case, now) if error.name == "gamma").derivative(case)
    assert_allclose(found, sums_of(columns, used, size), atol=1e-6 * np.nanmax(np.abs(columns)))
