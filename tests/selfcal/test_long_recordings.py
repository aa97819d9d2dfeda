"""Recordings of hours: filters by chunks give what they give at once, and means over blocks say what rows say."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from paper_study import ARCSEC, study

from inercal.systems.selfcal.diagnosis import small
from inercal.systems.selfcal.diagnosis.small import small_errors
from inercal.systems.selfcal.filters import averaged, run
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import to_linear
from inercal.systems.selfcal.settings import Filter, Noise
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


def few(monkeypatch, rows=400):
    """Blocks of rows as a recording of hours has them, for one of minutes."""
    monkeypatch.setattr(averaged, "LIMITS", replace(LIMITS, judged_rows=rows))


@pytest.mark.parametrize("size", [3, 7])
def test_means_over_blocks_say_what_all_rows_say(size, monkeypatch):
    """The filter finds the same coefficients, with the same u, from a seventh of the rows; each block turns by 1.4 deg,
    some end or begin a turn, and some hold rows that no encoder read."""
    recording = recorded()
    of = OF if size == 3 else problem(study("best", filter=Filter(extended=True)))
    whole = estimate(recording, of, brief=True)
    few(monkeypatch, len(recording.t) // size + 1)
    shorter, posed = averaged.averaged(recording, of, whole)
    assert len(shorter.t) == len(recording.t) // size
    assert posed.noise.encoder == pytest.approx(of.noise.encoder / np.sqrt(size))
    found = estimate(shorter, posed, brief=True)
    u = np.sqrt(np.diag(whole.covariance))
    more = np.diag(found.covariance) / u**2 - 1.0
    assert np.all((more > -1e-3) & (more < 0.03))
    # what another estimator of the same knows less is the variance of its difference
    apart = (found.coefficients - whole.coefficients) / u
    assert np.all(np.abs(apart) < 4.0 * np.sqrt(np.maximum(more, 0.0)) + 0.05)
    scatter = np.sqrt(12.0 / len(found.nis))
    assert np.nanmean(found.nis) == pytest.approx(np.nanmean(whole.nis), abs=4.0 * scatter)


def test_without_noise_a_mean_is_a_reading(monkeypatch):
    """Through turns and their ends, the angles and forces of a block are those of its middle row."""
    quiet = replace(SETTINGS, noise=Noise(1e-12, 1e-12, 1e-12))
    recording = simulate(experiment(quiet), np.random.default_rng(1)).recording
    of = problem(SETTINGS)
    found = estimate(recording, of, brief=True)
    truth = to_linear(SETTINGS.true_values[:18])
    few(monkeypatch)
    shorter, _ = averaged.averaged(recording, of, replace(found, coefficients=truth))
    middle = np.searchsorted(recording.t, shorter.t)
    assert_allclose(shorter.th, recording.th[middle], atol=5e-9)
    assert_allclose(shorter.acc[1:], recording.acc[middle][1:], atol=1e-8)


def test_nothing_is_averaged_over_a_wide_turn(monkeypatch):
    recording = recorded()
    few(monkeypatch, 20)
    monkeypatch.setattr(averaged, "LIMITS", replace(averaged.LIMITS, block_turn=np.radians(1.0)))
    assert averaged.block(recording) * 0.2 < 1.0 + 1e-9


def test_small_errors_are_those_of_all_rows(monkeypatch):
    """An error of the base and one of an encoder are found in means over blocks, as large as in all rows, and taken out
    of these."""
    made = recorded()
    th = made.th.copy()
    th[:, 2] += 6.0 * ARCSEC * np.sin(3.0 * th[:, 2])
    case = replace(made, th=th), OF
    (whole,), _ = small_errors(case)
    few(monkeypatch)
    (found,), (repaired, _) = small_errors(case)
    assert found.hypothesis.name == whole.hypothesis.name == "harmonic 3 of th_z"
    assert_allclose(found.values, whole.values, atol=0.3 * whole.u.max())
    assert_allclose(found.u, whole.u, rtol=0.2)
    missed = (repaired.th - made.th)[np.isfinite(made.th).all(axis=1)]
    assert np.abs(missed).max() < 5.0 * whole.u.max()


def test_late_commands_turn_the_platform_as_much_in_all():
    """Rates of steps are mixed with those before by the part of the step by which they are late."""
    recording = recorded()
    dt = recording.dt[0]
    rate = recording.rate
    for part in (0.3, -0.3):
        late, _ = small._delayed((recording, OF), np.array([part * dt]))
        before = np.vstack([rate[:1], rate[:-1]]) if part > 0.0 else np.vstack([rate[1:], rate[-1:]])
        assert_allclose(late.rate, rate + 0.3 * (before - rate), atol=1e-12)
    two, _ = small._delayed((recording, OF), np.array([2.0 * dt]))
    assert_allclose(two.rate[2:], rate[:-2], atol=1e-12)
