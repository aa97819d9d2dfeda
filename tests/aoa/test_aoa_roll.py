"""The roll from row to row: that of the truth, also where the kept times do not resolve it."""

from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, study

from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.fusion import filter_result
from inercal.systems.aoa.fusion.filter_result import estimate, of_fusion, tracked_roll
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.result.points import points
from inercal.systems.aoa.result.systematic import by_fusion
from inercal.systems.aoa.settings import Attitude
from inercal.systems.aoa.simulate import simulate

ROLL = Quantity(10.0 * DEG, 0.5 * DEG, parse_unit("rad"), "")
COUPLED = Disturbances(roll=Oscillation(1.0 * DEG, 6.0), yaw=Oscillation(1.0 * DEG, 8.0))


def turned(**changes):
    """Rolled by 10 deg + 1 deg sin 2 pi 6 t, while it yaws and pitches."""
    motion = replace(BASE, duration=20.0, sample_rate=500.0)
    settings = study(motion=motion, disturbances=COUPLED, attitude=Attitude(roll=ROLL), **changes)
    made = simulate(settings, np.random.default_rng(81)).recording
    return settings, made, problem(settings, made.spatial)


def true_roll(t):
    return 10.0 * DEG + 1.0 * DEG * np.sin(2.0 * np.pi * 6.0 * t)


@pytest.mark.parametrize("smoothed", [False, True])
def test_the_roll_of_each_row_is_as_good_as_that_of_the_kept_ones(smoothed, monkeypatch):
    # kept each 0.4 s: at 6 Hz a line between them is off by the oscillation's 0.7 deg rms
    monkeypatch.setattr(filter_result, "KEPT", 50)
    _, made, of = turned()
    found = estimate(made, of, smoothed)
    assert len(found.kept_t) == 50
    roll, u = tracked_roll(made, of, found)
    error = roll - true_roll(made.t)
    late = made.t > 2.0
    assert np.std(error[late]) < 0.03 * DEG
    at = np.searchsorted(made.t, found.kept_t)
    np.testing.assert_allclose(roll[at], found.states[:, of.names.index("phi")], atol=1e-12)
    assert np.mean(np.square(error[late] / u[late])) < 2.0
    straight = np.interp(made.t, found.kept_t, found.states[:, of.names.index("phi")])
    assert np.std((straight - true_roll(made.t))[late]) > 0.3 * DEG


def test_alpha_of_a_row_is_that_of_its_own_roll():
    settings, made, of = turned()
    angles = by_fusion(made, settings, of, estimate(made, of))
    np.testing.assert_array_equal(angles.u, angles.known_u)  # the roll is a state: it is in u already
    numbered = replace(made, point=np.where(np.arange(len(made.t)) < 9000, 1.0, 2.0))
    _, last = points(numbered, angles, settings)
    # over whole periods of all motions the mean of alpha's arguments is that of the means
    assert last.beta == pytest.approx(np.arcsin(np.sin(last.theta) * np.sin(10.0 * DEG)), abs=0.1 * DEG)


def test_no_gyros_track_no_roll_and_lost_rows_have_none():
    settings, made, of = turned()
    flat = replace(made, turns=np.full_like(made.turns, np.nan))
    of_pitch = problem(settings, flat.spatial)
    found = estimate(flat, of_pitch)
    assert tracked_roll(flat, of_pitch, found) is None
    told = by_fusion(flat, settings, of_pitch, found)
    assert told.roll is None
    assert (told.u >= of_fusion(found, 19).u).all()
    t = made.t.copy()
    t[3000] = t[2990]
    back = replace(made, t=t)
    roll, u = tracked_roll(back, of, estimate(back, of))
    assert np.isnan([roll[3000], u[3000]]).all()
    assert np.isfinite(np.delete(roll, 3000)).all()
