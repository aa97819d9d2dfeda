"""Which error of the table matters for which coefficient: shares of the variance, and other tolerances."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turntable_studies import (
    ARCMIN,
    DEG_H,
    FULL_RANK,
    LATITUDE,
    TUMBLE,
    WHEEL,
    study,
    table,
    u_without_doubts,
)

from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.plans import grid
from inercal.systems.turntable.model import table_model
from inercal.systems.turntable.positions.tolerance import (
    alternatives,
    coefficient_shares,
    drift_shares,
    shifts,
    sphere_moments,
)
from inercal.systems.turntable.regression import fit
from inercal.systems.turntable.simulate import simulate_positions
from inercal.systems.turntable.task import calibrate

NOISE = 0.01 * DEG_H


def fitted(chain=None, plan=FULL_RANK, channels=("y_x", "y_y"), left_out=(), noise=NOISE):
    model = table_model(study(plan, chain or table()), channels, left_out)
    c = np.array([WHEEL[symbol] for symbol in model.symbols])
    return fit(model, plan.angles, model.outputs(plan.angles, c), [noise] * len(channels), start=c)


def calibrated(kind="gyrowheel", **more):
    settings = study(chain=table(), kind=kind, noise=NOISE, **more)
    return calibrate(simulate_positions(settings, np.random.default_rng(2)), settings)


def test_noise_and_errors_of_the_table_make_up_the_covariance_of_the_fit():
    done = fitted()
    total = sum(shift @ shift.T for shift in shifts(done))
    total = total + NOISE**2 * np.einsum("pnc,qnc->pq", done.gain, done.gain)
    size = np.sqrt(np.diag(done.covariance))
    assert np.abs((total - done.covariance) / np.outer(size, size)).max() < 1e-9


@pytest.mark.parametrize("shares", ["budget", "table"])
def test_the_shares_of_each_coefficient_sum_to_one(shares):
    """All sources in the budget; errors of the table alone among the tolerance shares."""
    site = Site(9.8, (GravityInput("gravity", 1e-4, "m/s^2", 1.0),), LATITUDE, 1e-3)
    estimate = calibrated(site=site, coefficients_u={"k_x": 0.01}).estimate
    for name in estimate.names:
        if shares == "budget":
            parts = [item.share.get(name, 0.0) for item in estimate.budget]
        else:
            parts = list(estimate.result["tolerance_shares"][name].values())
        assert min(parts) >= 0.0
        assert sum(parts) == pytest.approx(1.0, abs=1e-9)
    assert sum(estimate.result["drift_shares"].values()) == pytest.approx(1.0, abs=1e-9)


def test_the_budget_adds_up_to_the_covariance_also_with_relative_terms():
    """An accelerometer triad: K2, K3 and misalignments are quotients of linear coefficients."""
    coefficients = {f"K1_{i}": 1.0 for i in "xyz"} | {"M_xy": 1e-3, "K2_x": 1e-5, "K3_y": 1e-6, "Kip_z": 2e-5}
    settings = study(
        grid((7, 8)), table(), kind="accelerometer", unit="m/s^2", coefficients=coefficients, noise=1e-4
    )
    done = calibrate(simulate_positions(settings, np.random.default_rng(2)), settings)
    fit_, estimate = done.fitting.fit, done.estimate
    slope = np.zeros((len(fit_.c), len(fit_.c)))
    for channel, block in zip(fit_.model.channels, fit_.model.blocks, strict=True):
        slope[block, block] = channel.terms(fit_.c[block])[1]
    # the weights of a fit are of its last round but one
    expected = np.diag(slope @ fit_.covariance @ slope.T)
    assert np.abs(np.square(u_without_doubts(estimate)) / expected - 1.0).max() < 1e-5
    error = estimate.values - np.array([coefficients.get(name, 0.0) for name in estimate.names])
    assert np.abs(error / estimate.u).max() < 4.5


def test_a_share_is_the_part_of_the_variance_that_monte_carlo_gives_it():
    """One error alone is drawn, the fit being the same: its part of the variance of each coefficient.

    2000 draws: relative standard error of a variance 3 %, of a normal variable.
    """
    chain = table()
    done = fitted(chain, channels=("y_x",))
    rng = np.random.default_rng(4)
    perfect = done.model.outputs(FULL_RANK.angles, done.c)
    variances = []
    for k, error in enumerate(chain.errors):
        errors = np.zeros((2000, 36, len(chain.errors)))
        errors[..., k] = error.distribution.sample(rng, (2000, 1 if error.scope.constant else 36))
        moved = done.model.outputs(FULL_RANK.angles, done.c, errors) - perfect
        variances.append(np.var(np.einsum("pnc,rnc->rp", done.gain, moved), axis=0))
    found = coefficient_shares(done, np.eye(12))
    shares = np.array([list(found[symbol].values()) for symbol in done.model.symbols]).T
    drawn = np.array(variances) / np.sum(variances, axis=0)
    assert np.abs(drawn - shares).max() < 4.5 * np.sqrt(2.0 / 2000) * shares.max()


@pytest.mark.parametrize("plan", [FULL_RANK, TUMBLE], ids=lambda plan: plan.name)
def test_halving_a_tolerance_never_makes_a_coefficient_worse(plan):
    """Generalised least squares is the best linear unbiased fit, so less variance in can only mean less out."""
    left_out = () if plan is FULL_RANK else ("k_x", "k_y", "k_z", "kY_x", "kY_y", "kY_z")
    done = fitted(plan=plan, left_out=left_out)
    other = alternatives(done, np.eye(len(done.c)))
    stated = other.scopes["stated"]
    assert_allclose(stated, np.sqrt(np.diag(done.covariance)), rtol=1e-9)
    assert set(other.halved) == set(done.model.chain.factors)
    for u in other.halved.values():
        assert np.all(u <= stated * (1 + 1e-9))
    assert any(np.any(u < 0.99 * stated) for u in other.halved.values())


def test_halving_a_tolerance_is_a_fit_with_that_table():
    chain = table()
    done = fitted(chain)
    error = next(e for e in chain.errors if e.name == "dtheta_z")
    half = fitted(chain.with_errors(replace(error, distribution=error.distribution.scaled(0.5))))
    found = alternatives(done, np.eye(24)).halved["dtheta_z"]
    assert_allclose(found, np.sqrt(np.diag(half.covariance)), rtol=1e-6)


def test_the_scopes_say_what_errors_that_stay_constant_cost():
    done = fitted()
    other = alternatives(done, np.eye(24))
    for name, scope in (("random", Scope.POSITION), ("constant", Scope.RUN)):
        direct = fitted(table().with_scope(scope))
        assert_allclose(other.scopes[name], np.sqrt(np.diag(direct.covariance)), rtol=1e-6)
    assert other.scopes["constant"][4] > other.scopes["random"][4]


def test_only_the_variance_of_an_error_counts():
    """A normal error of the same standard deviation has the same effect to first order."""
    uniform_, normal_ = (
        fitted(table(0.0) if d is None else chain)
        for d, chain in (
            (1, table()),
            (2, table(0.0, errors={n: normal(2 * ARCMIN / np.sqrt(3)) for n in table().factors})),
        )
    )
    assert_allclose(uniform_.covariance, normal_.covariance, rtol=1e-6)


def test_moments_of_the_sphere():
    """Mean of a_i^2 is 1/3, of a_i^4 1/5, of a_i^2 a_j^2 1/15; odd ones vanish; rates take no part."""
    model = table_model(study(), ("y_x",))
    B = sphere_moments(model)
    at = model.symbols.index
    for first, second, mean in (
        ("DX_F", "DX_F", 1.0),
        ("DX_X", "DX_X", 1 / 3),
        ("DX_F", "DX_YY", 1 / 3),
        ("DX_XX", "DX_XX", 1 / 5),
        ("DX_XX", "DX_YY", 1 / 15),
        ("DX_XY", "DX_XY", 1 / 15),
        ("DX_X", "DX_F", 0.0),
        ("DX_XY", "DX_XZ", 0.0),
        ("k_x", "k_x", 0.0),
    ):
        assert B[at(first), at(second)] == pytest.approx(mean, abs=1e-14)
    third = table_model(study(kind="accelerometer", unit="m/s^2", coefficients={}), ("acc_x",))
    k3 = third.symbols.index("K3_x")
    assert sphere_moments(third)[k3, k3] == pytest.approx(9.8**6 / 7, rel=1e-12)


def test_drift_shares_are_shares_of_the_mean_square_over_the_sphere():
    """One error only redrawn, one only constant: parts by direct summation over many directions."""
    done = fitted(channels=("y_x",))
    rng = np.random.default_rng(5)
    a = rng.normal(size=(20000, 3))
    a /= np.linalg.norm(a, axis=1)[:, None]
    rows = done.model.channels[0].regressors(a, np.zeros(3))
    parts = np.array([np.mean(np.square(rows @ shift).sum(axis=1)) for shift in shifts(done)])
    found = np.array(list(drift_shares(done).values()))
    assert_allclose(found, parts / parts.sum(), atol=5e-3)


def test_a_table_without_errors_has_no_shares():
    done = fitted(table(0.0))
    assert drift_shares(done) == {}
    assert all(share == {} for share in coefficient_shares(done, np.eye(24)).values())
