"""Drifts by specific force that a study does not fit are in u, as far as the recording leaves them."""

from dataclasses import replace

import numpy as np
import pytest
import strapdown_faults as faults

from inercal.foundation.findings import Status

DRIFT = faults.CASES["drift of a gyro by force, 1 deg/h/g"]
PER_G = faults.DPH / 9.80665


def told(estimate):
    return [each for each in estimate.findings if each.code == "considered"]


def test_a_unit_without_drifts_hardly_pays_for_them():
    sound, _ = faults.estimated(0, *faults.CASES["none"])
    growth = [sound[name].u / sound.result["bounds"][name] for name in sound.names]
    assert np.exp(np.mean(np.log(growth))) < 1.1


def test_drifts_that_no_test_shows_are_in_u_and_said():
    # the draw whose largest error was 4.1 u
    estimate, errors = faults.estimated(0, *DRIFT)
    assert max(map(abs, errors.values())) < 3.5
    (finding,) = told(estimate)
    assert 'add "g_sensitivity" to terms' in finding.message
    (item,) = finding.items
    assert item["before"] == pytest.approx(1.0)
    assert item["left by this recording"] < 1.0
    assert 0.3 * PER_G < estimate.result["drifts"]["left"] < 3.0 * PER_G


@pytest.mark.parametrize("fitted", [False, True])
def test_a_study_that_knows_the_drifts_or_fits_them_has_none_in_u(fitted):
    if fitted:
        change = {"terms": ("k2", "size", "delay", "g_sensitivity")}
    else:
        prior = replace(faults.SETTINGS.prior, g_sensitivity=1e-3 * PER_G)
        change = {"prior": prior, "given": {"prior": {"g_sensitivity": "0.001 deg/h/g"}}}
    estimate, _ = faults.estimated(1, {}, {}, change | faults.STILL)
    assert not told(estimate)
    for name in estimate.names:
        assert estimate[name].u == pytest.approx(estimate.result["bounds"][name], rel=1e-3), name


@pytest.mark.campaign
def test_no_verdict_is_ok_with_an_error_beyond_four_u():
    for seed in range(20):
        estimate, errors = faults.estimated(seed, *DRIFT)
        assert estimate.status is not Status.OK or max(map(abs, errors.values())) < 4.0, seed
