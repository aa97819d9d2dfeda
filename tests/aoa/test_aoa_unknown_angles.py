"""Where an angle of attack cannot be told it is unknown, and where all else can be told the rest is."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2
from sting_study import BASE, G, study

from inercal.faces.studies.aoa import aoa_study
from inercal.foundation.findings import Status
from inercal.systems.aoa.fusion.loop import root, significant
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper.methods import measure as by_method
from inercal.systems.aoa.reading.pauses import at_rest
from inercal.systems.aoa.reference.sensor_fit import fit
from inercal.systems.aoa.result.verdict import is_covariance, nis_limit
from inercal.systems.aoa.settings import Methods
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure


def test_a_clock_that_stands_shows_no_motion():
    """Windows have no length where most rows have one time; nothing is divided by it."""
    t = np.zeros(100)
    still, scatter = at_rest(t, np.linspace(0.0, 1.0, 100), np.full(100, 1e-5))
    assert still.all()
    np.testing.assert_array_equal(scatter, 0.0)


@pytest.mark.parametrize("value", [1e-170, 1e-162, 0.0])
def test_a_rate_whose_square_is_no_number_is_all_noise(value):
    assert significant(value, 1.0) == 0.0


def test_what_has_no_variance_has_no_uncertainty():
    """Rounding below zero is none at all; what is no number stays so, and is not taken for certain."""
    assert root(4.0) == 2.0
    assert root(-1e-20) == 0.0
    assert math.isnan(root(math.nan))


@pytest.mark.parametrize("static", ["improved", "segmented"])
def test_rows_without_accelerometers_have_no_angle_and_the_others_have_theirs(static):
    settings = study(motion=replace(BASE, duration=4.0))
    simulated = simulate(settings, np.random.default_rng(5))
    acc = simulated.recording.acc.copy()
    acc[100:120] = np.nan
    found = by_method(replace(simulated.recording, acc=acc), settings, Methods(static, "none", "none"))
    whole = by_method(simulated.recording, settings, Methods(static, "none", "none"))
    assert np.isnan(found.theta[100:120]).all()
    np.testing.assert_array_equal(found.theta[:100], whole.theta[:100])
    np.testing.assert_array_equal(found.theta[120:], whole.theta[120:])


def test_a_short_recording_is_judged_by_its_later_half():
    """1.5 s: a sound one is ok; one in which the accelerometer forward reads 0.1 g too much from there on is not."""
    settings = study(motion=replace(BASE, duration=1.5))
    simulated = simulate(settings, np.random.default_rng(6))
    found = measure(to_record(simulated.recording, settings), settings).estimate
    assert found.status is Status.OK
    assert 0.1 < found.statistics["nis_mean"] < 2.0
    acc = simulated.recording.acc.copy()
    acc[750:, 1] += 0.1 * G
    off = measure(to_record(replace(simulated.recording, acc=acc), settings), settings).estimate
    assert off.status is Status.INCONSISTENT


def test_a_recording_without_readings_to_judge_says_so():
    """The sensors are silent in the later half: nothing is held against the model, and no sentence says nan."""
    settings = study(motion=replace(BASE, duration=1.0))
    simulated = simulate(settings, np.random.default_rng(6))
    acc, gyro = simulated.recording.acc.copy(), simulated.recording.gyro.copy()
    acc[450:], gyro[450:] = np.nan, np.nan
    found = measure(to_record(replace(simulated.recording, acc=acc, gyro=gyro), settings), settings).estimate
    assert math.isnan(found.statistics["nis_mean"])
    assert "nan" not in found.message


def test_few_innovations_may_scatter_more():
    """Of sound filters one in 100 000 is above: the mean of m squares of standard normal numbers."""
    for count in (1, 5, 20, 1000):
        limit = nis_limit(count)
        assert limit == LIMITS.mean_nis or chi2.sf(count * limit, count) == pytest.approx(LIMITS.nis_chance)
    assert nis_limit(1) > nis_limit(5) > nis_limit(20) > nis_limit(1000) == LIMITS.mean_nis


def test_a_gyro_that_is_clipped_from_the_start_is_no_sound_second():
    """0.5 s of 10 deg at 1 Hz under a gyro that ends at 40 deg/s: five accelerometers alone take a wrong rate for
    theirs, and nothing but the innovations tells it."""
    places = {
        "a1": (0.46, 0.0),
        "a2": (0.49, -53.0),
        "a3": (0.32, -33.0),
        "a4": (0.49, 41.0),
        "a5": (0.24, 49.0),
    }
    told = {
        "site": {"latitude": "40.0(1) deg"},
        "rig": {"kind": "sting"},
        "sensors": {name: {"r": f"{r} m", "angle": f"{angle} deg"} for name, (r, angle) in places.items()}
        | {"gyro": {"range": "40 deg/s"}},
        "noise": {
            "accelerometer": "1e-4 g",
            "accelerometer_bias": "1e-4 g",
            "gyro": "0.2 deg/s",
            "gyro_bias": "5 deg/h",
        },
        "motion": {
            "kind": "sine",
            "sample_rate": "200 Hz",
            "duration": "0.465 s",
            "mean": "30 deg",
            "amplitude": "10 deg",
            "frequency": "1 Hz",
        },
        "estimator": {"states": 8},
    }
    settings = aoa_study(told, "study.toml")
    simulated = simulate(settings, np.random.default_rng(7))
    found = measure(to_record(simulated.recording, settings), settings)
    assert np.nanmax(np.abs(found.angles.theta - simulated.theta) / found.angles.u) > 100.0
    assert found.estimate.status is Status.INCONSISTENT


@pytest.mark.parametrize("noise", [1e-14, 1e-4, 1e6])
def test_variances_of_a_fit_to_a_reference_are_positive_whatever_the_noise(noise):
    """P = J^-1 (S + I) J^-T in units of the prior: positive definite, as S and J are sums of squares."""
    motion = replace(BASE, duration=6.0, sample_rate=100.0)
    settings = study(motion=motion)
    simulated = simulate(settings, np.random.default_rng(7))
    made = replace(simulated.recording, reference=simulated.theta)
    stated = replace(
        settings, noise=replace(settings.noise, accelerometer=noise * G, accelerometer_bias=noise * G)
    )
    found = fit(made, stated)
    assert (np.diag(found.covariance) > 0.0).all()
    assert (
        np.linalg.eigvalsh(found.covariance / np.sqrt(np.outer(*2 * [np.diag(found.covariance)]))).min()
        > -1e-9
    )


@given(st.integers(0, 10**6))
def test_what_is_no_covariance_is_not_taken_for_one(seed):
    """A A^T is one in any units; less 1.1 times its lowest part it is none."""
    rng = np.random.default_rng(seed)
    A, unit = rng.normal(size=(5, 5)), 10.0 ** rng.uniform(-8.0, 8.0, 5)
    P = A @ A.T + 0.1 * np.eye(5)
    values, vectors = np.linalg.eigh(P)
    none = P - 1.1 * values[0] * np.outer(vectors[:, 0], vectors[:, 0])
    assert is_covariance(P * np.outer(unit, unit))
    assert not is_covariance(none * np.outer(unit, unit))
    assert not is_covariance(np.full((2, 2), np.nan))
