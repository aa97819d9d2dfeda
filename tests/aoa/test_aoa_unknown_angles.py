"""Where an angle of attack cannot be told it is unknown, and where all else can be told the rest is."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sting_study import BASE, DEG, G, layout, study

from inercal.aoa.methods import measure as by_method
from inercal.aoa.pauses import at_rest
from inercal.aoa.recursion import told
from inercal.aoa.sensor_fit import fit
from inercal.aoa.settings import Methods
from inercal.aoa.simulate import simulate, to_record
from inercal.aoa.static import gls
from inercal.aoa.task import measure
from inercal.aoa.verdict import is_covariance
from inercal.estimate.status import Status


def test_readings_that_do_not_change_with_the_angle_tell_nothing_of_it():
    """Directions without errors tell nothing of theta. Where -z alone has errors, which reads -g cos theta and does not
    change at 0 deg, theta is uncertain without bound there, and by 1/g a quarter turn away."""
    covariance = np.diag([1.0, 0.0, 0.0])
    theta = np.array([0.0, 90.0]) * DEG
    acc = np.stack([-np.cos(theta), np.sin(theta), np.cos(theta)], axis=-1) * G
    found = gls(acc, layout(), G, covariance=covariance)
    assert not np.abs(found.gain[0, 0]) * G < 1e13  # unknown, or uncertain by as much as cos 90 deg rounds to
    np.testing.assert_allclose(found.gain[1, 0] * G, 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.theta[1], theta[1], atol=1e-12)


def test_a_clock_that_stands_shows_no_motion():
    """Windows have no length where most rows have one time; nothing is divided by it."""
    t = np.zeros(100)
    still, scatter = at_rest(t, np.linspace(0.0, 1.0, 100), np.full(100, 1e-5))
    assert still.all()
    np.testing.assert_array_equal(scatter, 0.0)


@pytest.mark.parametrize("value", [1e-170, 1e-162, 0.0])
def test_a_rate_whose_square_is_no_number_is_all_noise(value):
    assert told(value, 1.0) == 0.0


@pytest.mark.parametrize("static", ["improved", "gls"])
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


def test_a_recording_too_short_for_a_nis_says_so():
    """The NIS is judged from 2 s on: before there is none, and its mean is no number."""
    settings = study(motion=replace(BASE, duration=1.5))
    simulated = simulate(settings, np.random.default_rng(6))
    found = measure(to_record(simulated.recording, settings), settings).estimate
    assert found.status is Status.OK
    assert "too short for a NIS" in found.message
    assert "nan" not in found.message


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
