"""Where a self-calibration has no numbers to give it says why, instead of giving some."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from paper_study import DEG, study

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput
from inercal.foundation.results.budget import combine
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.before.observability import not_positive
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import ETA, KA1, divisor, names, product_slope, to_product
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.result import budget as sources
from inercal.systems.selfcal.result.columns import history_record
from inercal.systems.selfcal.result.outcome import assemble
from inercal.systems.selfcal.settings import Filter, Noise
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate

SHORT = study(
    plan=PlatformPlan((Turn("x", np.pi), Turn("y", np.pi), Turn("z", np.pi)), rate=6.0 * DEG, step=1.0)
)


def recorded(settings, seed=3):
    return simulate(experiment(settings), np.random.default_rng(seed)).recording


def estimated(settings, made):
    return calibrate(to_record(made), settings).estimate


@pytest.mark.parametrize("kind", ["error-state", "svd-qukf", "map"])
def test_nothing_measured_tells_nothing(kind):
    """Commands alone do not tell the coefficients: unobservable, and no fault is named of what was not measured."""
    settings = replace(SHORT, filter=Filter(kind))
    made = recorded(settings)
    made = replace(
        made, acc=np.full_like(made.acc, np.nan), th=np.vstack([made.th[:1], np.nan * made.th[1:]])
    )
    of = problem(settings)
    by = estimate(made, of)
    assert diagnose(made, of, by) == []
    bounds = recorded_bounds(made, of, by.history.attitude, by.coefficients, contributions=True)
    found = assemble(made, settings, by, bounds, [])
    assert found.status is Status.UNOBSERVABLE
    assert "no row after the first has a measurement" in found.message
    assert not len(found.names)


@given(st.lists(st.floats(-12.0, 12.0), min_size=3, max_size=3))
def test_whether_a_covariance_is_one_does_not_depend_on_units(powers):
    """C is positive definite if and only if D C D is, for any diagonal D."""
    unit = 10.0 ** np.array(powers)
    sound, none = np.array([[1.0, 0.9, 0.1], [0.9, 1.0, 0.2], [0.1, 0.2, 1.0]]), np.ones((3, 3)) - np.eye(3)
    assert not_positive(unit, sound * np.outer(unit, unit)) is None
    status, said = not_positive(unit, none * np.outer(unit, unit))
    assert status is Status.ILL_CONDITIONED
    assert "check their units" in said


def test_noise_and_prior_beside_a_prior_in_the_wrong_unit_are_ill_conditioned():
    """A bias of 1e18 prior u beside encoders of 1e-12: no double holds both."""
    prior = SHORT.prior.copy()
    prior[:3] *= 1e14
    settings = replace(SHORT, prior=prior, noise=Noise(1e-16, 1e-12, 1e-14))
    found = estimated(settings, recorded(settings))
    assert found.status in (Status.ILL_CONDITIONED, Status.NOT_CONVERGED)
    assert not len(found.names)


def test_gravity_stated_so_uncertainly_that_no_filter_follows_is_said():
    site = replace(SHORT.site, inputs=(GravityInput("gravity", 1e12, "m/s^2", 1.0),))
    found = estimated(replace(SHORT, site=site), recorded(SHORT))
    assert found.status is Status.ILL_CONDITIONED
    assert found.message.startswith("gravity: stated so uncertainly")


def test_the_parts_of_a_covariance_are_symmetric_and_add_up_to_it():
    """P_noise + P_prior = P of the filter, each equal to its transpose to the last digit."""
    done = calibrate(to_record(recorded(SHORT)), SHORT)
    slope = product_slope(done.filtered.coefficients)
    P = slope @ done.filtered.covariance @ slope.T
    parts = sources.within(P, done.bounds, SHORT.noise, 100.0)
    total, *_ = combine(names(18), parts)
    for part in parts:
        u = np.sqrt(np.diag(part.covariance)) + 1e-300
        np.testing.assert_allclose(
            part.covariance / np.outer(u, u), part.covariance.T / np.outer(u, u), atol=1e-12
        )
    u = np.sqrt(np.diag(P))
    np.testing.assert_allclose(total / np.outer(u, u), P / np.outer(u, u), atol=1e-6)


@pytest.mark.parametrize("converged", [True, False])
def test_an_accelerometer_without_a_scale_has_no_misalignment(converged):
    """az = ka0z + 0 (fz + eta_pz fx - eta_oy fy): any eta gives the same; all else is told, and no number used."""
    done = calibrate(to_record(recorded(SHORT)), SHORT)
    lost = done.filtered.coefficients.copy()
    lost[KA1.stop - 1] = -1.0
    unknown = np.isin(names(18), ("eta_pz", "eta_oz"))
    np.testing.assert_array_equal(np.isnan(to_product(lost)), unknown)
    np.testing.assert_array_equal(
        to_product(lost)[~unknown], (lost / divisor(done.filtered.coefficients))[~unknown]
    )
    np.testing.assert_array_equal(np.isnan(product_slope(lost)).any(axis=1), unknown)

    history = replace(done.filtered.history, coefficients=np.tile(lost, (len(done.recording.t), 1)))
    by = replace(
        done.filtered, coefficients=lost, history=history, converged=converged, message="it ran away"
    )
    along = recorded_bounds(done.recording, done.problem, history.attitude, lost, contributions=True)
    found = assemble(done.recording, SHORT, by, along, [])
    assert not len(found.names)
    assert found.status is (Status.ILL_CONDITIONED if converged else Status.NOT_CONVERGED)
    columns = history_record(by, done.recording, done.problem.world).columns
    for eta, each in zip(names(18)[ETA], unknown[ETA], strict=True):
        assert np.isnan(columns[f"u_{eta}"].values).all() == each


@pytest.mark.parametrize("seed", [2, 3])
def test_no_numbers_where_the_bound_of_the_base_is_lost_in_rounding(seed):
    """Clocks that jump by 1e13 s leave a variance of 1e26 times the encoders', beside which no double holds these."""
    made = recorded(SHORT, seed)
    t = made.t.copy()
    t[40:] += 1e13
    settings = replace(SHORT, base=replace(SHORT.base, heading=0.0), heading_unknown=True)
    found = estimated(settings, replace(made, t=t))
    assert found.status in (Status.ILL_CONDITIONED, Status.NOT_CONVERGED)
    assert not len(found.names)
