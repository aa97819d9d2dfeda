"""Estimators beside each other: what is stated is in all of them, and linearisation that shows is told."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import MICRO_G, study

from inercal.findings import Status
from inercal.geometry.site import GravityInput
from inercal.selfcal.before.simulate import experiment, simulate, to_record
from inercal.selfcal.filters.problem import problem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.result.comparison import beside, differing, stated_variance, with_stated
from inercal.selfcal.task import calibrate, compared

PLAIN = study("best")
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
    for kind in ("map", "mukf", "svd-qukf", "gimbal-ukf"):
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
    """By the names beyond 0.3 u; lm weighs noise otherwise, and the batch itself is right."""
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
    assert differing(replace(found, kind="lm"), {"map": batch}) == []
    assert differing(found, {"map": replace(batch, converged=False)}) == []
