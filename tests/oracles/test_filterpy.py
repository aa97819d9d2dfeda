"""The filter of the paper against filterpy's unscented filter, told the same model."""

import numpy as np
import plain_filterpy
import pytest
from paper_study import study

from inercal.foundation.inference.sigma_point import EIGEN, root
from inercal.systems.selfcal.filters import quaternion
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.settings import Filter
from inercal.systems.selfcal.simulate import experiment, simulate

STEPS = 400


def our_eigen(P):
    """Transpose of our root: that of a diagonal covariance may be turned at will, and the points with it."""
    A, work = np.empty_like(P), np.empty_like(P)
    root(np.ascontiguousarray(P), EIGEN, A, work)
    return A.T


@pytest.mark.parametrize(
    ("factor", "theirs", "limit"),
    [
        ("cholesky", plain_filterpy.cholesky_first, 1e-6),
        ("eigen", our_eigen, 1e-6),
        ("eigen", plain_filterpy.eigen, 1e-4),
    ],
)
def test_as_filterpy(factor, theirs, limit):
    """Attitude, coefficients and their covariance after each of 400 steps in which all three joints turn."""
    moves = (Turn("y", 0.5), Turn("z", -0.6), Turn("x", 0.4))
    settings = study(
        plan=PlatformPlan(moves, start=(0.3, -0.2, 0.1)), filter=Filter("svd-qukf", factor=factor)
    )
    told = problem(settings)
    recording = simulate(experiment(settings), np.random.default_rng(20261121)).recording
    x, P, nis = plain_filterpy.run(told, recording, STEPS, theirs)
    steps = recording.steps.part(slice(STEPS))
    state, trace = quaternion.advance(quaternion.initial(told, recording.th[0]), told, steps)
    u = np.sqrt(np.diagonal(P[:, 4:, 4:], axis1=1, axis2=2))
    assert np.max(np.abs(trace.estimates.coefficients - x[:, 4:]) / u) < limit
    assert np.max(np.abs(trace.estimates.u / u - 1.0)) < limit
    assert np.max(np.abs(trace.estimates.attitude - x[:, :4]) / trace.estimates.attitude_u.min()) < limit
    np.testing.assert_allclose(trace.estimates.nis, nis, atol=100.0 * limit)
    scale = np.sqrt(np.diag(P[-1]))
    assert np.max(np.abs(state.covariance - P[-1])[4:, 4:] / np.outer(scale, scale)[4:, 4:]) < limit
