"""The linear filter of the misalignment angles: the model of the literature, and what linearising once costs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import ARCSEC, TRUTH, study

from inercal.geometry.rotations import boxminus, boxplus
from inercal.selfcal.before.simulate import experiment, simulate, to_record
from inercal.selfcal.figures import pictures
from inercal.selfcal.figures.filters import changes_of_turn
from inercal.selfcal.filters.problem import problem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.platform.plan import Plan, Rest, Turn
from inercal.selfcal.result.comparison import attitude_errors
from inercal.selfcal.task import calibrate, compared

DEG = np.pi / 180.0
SHORT = Plan((Turn("z", 60 * DEG), Rest(10.0), Turn("x", -30 * DEG)))


def recorded(truth, seed=3, **changes):
    settings = study(truth=truth, **changes)
    return simulate(experiment(settings), np.random.default_rng(seed)), problem(settings)


def in_u(made, of):
    """Coefficients less those of the error-state filter, over its u; and the ratio of the uncertainties."""
    mine, theirs = (estimate(made.recording, of, kind) for kind in ("error-state", "linear"))
    u = np.sqrt(np.diag(mine.covariance))
    return (theirs.coefficients - mine.coefficients) / u, np.sqrt(np.diag(theirs.covariance)) / u, theirs


@pytest.mark.parametrize("path", ["paper", "best"])
def test_of_errors_a_hundred_times_smaller_it_is_as_good_as_any(path):
    """Products of two of them are nothing then: 0.01 u, from row to row too, innovations white and of size 1."""
    made, of = recorded(0.01 * TRUTH, path=path, noise="low")
    off, ratio, found = in_u(made, of)
    assert np.abs(off).max() < 0.01
    assert_allclose(ratio, 1.0, rtol=1e-3)
    other = estimate(made.recording, of)
    assert_allclose(found.history.u, other.history.u, rtol=0.01)
    assert_allclose(boxminus(found.history.attitude, other.history.attitude), 0.0, atol=1e-3 * ARCSEC)
    assert_allclose(np.nanstd(found.innovations, axis=0), 1.0, atol=0.06)
    assert found.nis_mean == pytest.approx(other.nis_mean, rel=1e-3)


def test_of_the_papers_errors_it_is_off_by_their_products():
    """By 60 to 100 arcsec in 540 s: 2 u at nominal noise, 20 at low, of which NIS says nothing, and u the same."""
    for noise, low, high in (("nominal", 1.0, 5.0), ("low", 10.0, 40.0)):
        off, ratio, found = in_u(*recorded(TRUTH, path="paper", noise=noise))
        assert low < np.abs(off).max() < high
        assert_allclose(ratio, 1.0, rtol=0.01)
        assert found.nis_mean == pytest.approx(6.0, abs=0.15)


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
