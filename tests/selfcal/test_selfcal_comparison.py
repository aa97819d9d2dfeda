"""Estimators beside each other: what is stated is in all of them, and linearisation that shows is told."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import ARCSEC, DEG, MICRO_G, TRUTH, study

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput
from inercal.foundation.geometry.rotations import boxplus
from inercal.systems.selfcal.figures import pictures
from inercal.systems.selfcal.figures.filters import changes_of_turn
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn
from inercal.systems.selfcal.result.comparison import (
    attitude_errors,
    beside,
    differing,
    stated_variance,
    with_stated,
)
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate, compared

PLAIN = study("best")
SHORT = PlatformPlan((Turn("z", 60 * DEG), Rest(10.0), Turn("x", -30 * DEG)))
RECORDING = simulate(experiment(PLAIN), np.random.default_rng(3)).recording


@pytest.mark.slow
def test_u_of_all_contains_what_is_stated():
    """Gravity known to 20 ug and 0.1 deg of latitude: u as large as that of the result, in JSON and tables alike."""
    inputs = (GravityInput("gravity", 20 * MICRO_G, "m/s^2", 1.0),)
    settings = replace(PLAIN, site=replace(PLAIN.site, inputs=inputs, latitude_u=np.radians(0.1)))
    found = calibrate(to_record(RECORDING), settings, compare=True)
    noise = np.sqrt(np.diag(found.filtered.covariance))
    assert (found.estimate.u / noise).max() > 10.0
    parts = found.estimate.result["compare"]
    for kind in ("map", "svd-qukf", "gimbal-ukf"):
        u = [parts[kind]["parameters"][name]["u"] for name in found.estimate.names]
        assert_allclose(u, found.estimate.u, rtol=0.02)
    k = found.estimate.names.index("ka1_x")
    last = float(compared(found)[0].rows[k][-1])
    assert last == pytest.approx(1e6 * found.estimate.u[k], rel=0.05)


def test_stated_variance_is_added_to_each():
    found = estimate(RECORDING, problem(PLAIN), history=False)
    u = np.sqrt(np.diag(found.covariance))
    _, own = with_stated(found, np.zeros(18))
    stated = stated_variance(found, np.hypot(own, 3.0 * u))
    assert_allclose(stated, 9.0 * u**2)
    part = beside(found, Status.OK, stated)["parameters"]
    assert part["kg0_x"]["u"] == pytest.approx(np.hypot(own[0], 3.0 * u[0]))


def test_a_batch_optimum_elsewhere_is_told():
    """By the names beyond 0.3 u; the batch itself is right."""
    found = estimate(RECORDING, problem(PLAIN), history=False)
    u = np.sqrt(np.diag(found.covariance))
    moved = found.coefficients.copy()
    moved[[0, 12]] += 0.5 * u[[0, 12]]
    moved[1] += 0.2 * u[1]
    batch = replace(found, kind="map", coefficients=moved)
    (finding,) = differing(found, {"map": batch})
    assert (finding.code, finding.harm) == ("estimators_differ", ("kg0_x", "ka0_x"))
    assert "0.5 u from error-state" in finding.message
    assert differing(found, {}) == differing(found, {"map": found}) == []
    assert differing(found, {"map": replace(batch, converged=False)}) == []


@pytest.mark.kernels
def test_errors_of_attitudes_take_the_nearer_sign():
    q = boxplus(np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), np.array([[2e-6, 0.0, 0.0]] * 3))
    reference = np.tile([1.0, 0.0, 0.0, 0.0], (3, 1))
    reference[1] *= -1.0
    reference[2] = np.nan
    found = attitude_errors(q, reference)
    assert_allclose(found.q[:2, 1], [1e-6, -1e-6], rtol=1e-6)
    (_, x, *_), angle = found.rms
    assert (x, angle) == (pytest.approx(1e-6), pytest.approx(2e-6))


@pytest.mark.kernels
def test_changes_of_the_turn_are_found():
    """z for 60 s, 10 s of rest, x for 30 s; the ends of a record are none."""
    th, t = SHORT.angles(), 0.2 * np.arange(501)
    assert_allclose(changes_of_turn(t, th), [60.0, 70.0], atol=2.1)


@pytest.mark.slow
def test_a_record_that_knows_its_attitude_is_judged_by_it(tmp_path):
    """RMSE of q0 to q3 and of the angle in result, table and picture; a picture of the filters apart."""
    settings = study(plan=SHORT, truth=TRUTH)
    made = simulate(experiment(settings), np.random.default_rng(8))
    found = calibrate(to_record(made.recording, made.attitude), settings, compare=True)

    for kind, each in {"error-state": found.filtered, **found.compared}.items():
        off = each.history.attitude - made.attitude
        of = found.estimate.result if kind == "error-state" else found.estimate.result["compare"][kind]
        assert_allclose(of["reference"]["rms_q"], np.sqrt(np.mean(off**2, axis=0)), rtol=1e-9)
        angle = 2.0 * np.sqrt(np.mean(np.sum(off**2, axis=1)))
        assert of["reference"]["rms_rad"] == pytest.approx(angle, rel=1e-6)
    table = compared(found)[-1]
    assert table.title == "Errors of the attitude"
    assert [row[0] for row in table.rows] == ["error-state", *found.compared]
    assert float(table.rows[0][-1]) == pytest.approx(
        found.estimate.result["reference"]["rms_rad"] / ARCSEC, rel=0.01
    )
    titles = [each.title for each in pictures(found)]
    assert "Error of the attitude" in titles
    assert "Attitudes of the filters apart" in titles
    plain = calibrate(to_record(made.recording), settings)
    assert "reference" not in plain.estimate.result
    assert "Attitude against the encoders" in [each.title for each in pictures(plain)]
