"""What the model leaves out is named, or ends the verdict; a sound record does neither.

Records come from benchmarks/independent/strapdown.py, which shares no code with the program.
"""

from dataclasses import replace

import numpy as np
import pytest
import strapdown_faults as faults
from scipy.stats import chi2

from inercal.foundation.findings import Status


def result_of(name, seed=0):
    return faults.estimated(seed, *faults.CASES[name])


@pytest.mark.slow
@pytest.mark.parametrize("runs", [2, pytest.param(6, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("name", ["none", pytest.param("no walk, stated as 0", marks=pytest.mark.campaign)])
def test_a_sound_record_of_another_simulator_is_ok_and_met(name, runs):
    """With walks that the study leaves to the recording u is rather too large, for no record excludes small ones: the
    squared error may be half of what chance leaves."""
    found = [result_of(name, seed) for seed in range(runs)]
    for estimate, _ in found:
        assert estimate.status is Status.OK
        assert {each.code for each in estimate.findings} <= {
            "at_prior",
            "stated_exact",
            "considered",
            "blind",
        }
    z = np.array([list(errors.values()) for _, errors in found])
    # coefficients of a run are correlated: their covariance tells the size of all together
    assert np.abs(z).max() < 4.5
    squares = []
    for estimate, errors in found:
        off = np.array([errors[name] * estimate[name].u for name in estimate.names])
        squares.append(off @ np.linalg.solve(estimate.covariance, off))
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], z.size)
    assert (0.5 * low if name == "none" else low) < np.sum(squares) < high


def named(name, words):
    """Assert that the effect of a case is the one that is named, and that it does harm."""
    estimate, _ = result_of(name)
    assert estimate.status in (Status.SUSPECT, Status.INCONSISTENT)
    (finding,) = (
        each for each in estimate.findings if each.code in ("unmodelled", "bias_drift", "site_suspect")
    )
    assert words.casefold() in finding.message.casefold()
    assert finding.harm


def test_a_term_outside_the_model_is_named():
    named("drift of a gyro by force, 10 deg/h/g", 'add "g_sensitivity" to terms')


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("asymmetry of 200 ppm", 'add "asymmetry" to terms'),
        ("accelerometers 4 ms late, not fitted", 'add "delay" to terms'),
        ("accelerometers 20 mm apart, not fitted", 'add "size" to terms'),
        ("K2 of 50 ug/g^2, not fitted", 'add "k2" to terms'),
        ("gyros drift by 10 deg/h", "biases of the gyros drift"),
        ("accelerometers drift by 500 ug", "biases of the accelerometers drift"),
        (
            "both drift, by 10 deg/h and 500 ug",
            "biases of gyros and of accelerometers drift",
        ),
        ("latitude wrong by 10 deg", "check site.latitude"),
    ],
)
def test_every_effect_outside_the_model_is_named(name, words):
    named(name, words)


@pytest.mark.campaign
@pytest.mark.parametrize(
    "name", ["sway of 5 mm/s at rest", "5 samples lost in a turn", "gyro clips at 1.0 rad/s"]
)
def test_what_no_term_explains_ends_the_verdict(name):
    assert not result_of(name)[0].status.done


def test_a_prior_that_cannot_be_is_doubted():
    narrow = replace(faults.SETTINGS.prior, scale=2e-5)
    estimate, _ = faults.estimated(0, {}, {}, {"prior": narrow})
    assert "prior_suspect" in {each.code for each in estimate.findings}
    assert estimate.status is not Status.OK
