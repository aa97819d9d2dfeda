"""Angle of attack and sideslip: rotations by another program, limits as theorems, propagation by differences."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.angles import alpha_beta, gives_alpha, theta_by_roll
from inercal.systems.aoa.settings import Attitude
from rows import for_each

DEG = math.pi / 180.0
RAD = parse_unit("rad")

angles = st.floats(-math.pi, math.pi)
small = st.floats(-0.4, 0.4)


def known(value, u=0.0):
    return Quantity(value, u, RAD, "")


def attitude(roll=0.0, yaw=0.0, upwash=0.0, sidewash=0.0, **u):
    values = {"roll": roll, "yaw": yaw, "upwash": upwash, "sidewash": sidewash}
    return Attitude(**{name: known(value, u.get(name, 0.0)) for name, value in values.items()})


def flow(theta, u=0.0, **how):
    theta = np.atleast_1d(np.asarray(theta, dtype=float))
    return alpha_beta(theta, np.full(len(theta), u), attitude(**how))


@given(theta=angles, roll=angles, yaw=small, upwash=small, sidewash=small)
def test_rotations_of_another_program_give_the_same(theta, roll, yaw, upwash, sidewash):
    # yaw about z, pitch about -y, roll about x; the air flows along -X, rises and drifts to the left
    body = Rotation.from_euler("ZYX", [yaw, -theta, roll])
    air = np.array(
        [-math.cos(upwash) * math.cos(sidewash), math.cos(upwash) * math.sin(sidewash), math.sin(upwash)]
    )
    x, y, z = body.inv().apply(-air)
    found = flow(theta, roll=roll, yaw=yaw, upwash=upwash, sidewash=sidewash)
    assert found.beta[0] == pytest.approx(math.asin(np.clip(-y, -1.0, 1.0)), abs=2e-8)
    if math.hypot(x, z) > 1e-6:
        off = found.alpha[0] - math.atan2(-z, x)
        assert math.remainder(off, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(theta=angles)
def test_alpha_is_theta_without_roll_yaw_and_flow_all_around(theta):
    found = flow(theta, u=1e-4)
    assert math.remainder(found.alpha[0] - theta, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)
    assert found.beta[0] == 0.0
    assert found.u_alpha[0] == pytest.approx(1e-4)
    assert found.u_beta[0] == 0.0


@given(theta=st.floats(-1.5, 1.5))
def test_a_roll_of_90_deg_turns_pitch_into_sideslip(theta):
    found = flow(theta, u=1e-4, roll=0.5 * math.pi)
    assert found.beta[0] == pytest.approx(theta, abs=1e-9)
    assert found.alpha[0] == pytest.approx(0.0, abs=1e-12)
    assert found.u_beta[0] == pytest.approx(1e-4)


@given(theta=angles, upwash=small)
def test_upwash_adds_to_alpha_without_roll(theta, upwash):
    found = flow(theta, upwash=upwash)
    assert math.remainder(found.alpha[0] - theta - upwash, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert found.beta[0] == pytest.approx(0.0, abs=1e-12)


@given(yaw=small, sidewash=small)
def test_yaw_and_sidewash_add_to_beta_of_a_level_model(yaw, sidewash):
    assert flow(0.0, yaw=yaw, sidewash=sidewash).beta[0] == pytest.approx(yaw + sidewash, abs=1e-12)


@given(theta=angles, roll=angles)
def test_an_upside_down_model_sees_the_opposite(theta, roll):
    up, down = flow(theta, roll=roll), flow(theta, roll=roll + math.pi)
    assert down.beta[0] == pytest.approx(-up.beta[0], abs=1e-9)
    assert math.cos(down.alpha[0]) == pytest.approx(math.cos(up.alpha[0]), abs=1e-6)


@for_each("theta", [0.3, -0.6, 1.57, 2.8])
@for_each("source", ["theta", "yaw", "upwash", "sidewash"])
def test_each_uncertainty_goes_on_by_the_derivative(theta, source):
    at = {"theta": theta, "roll": 0.5, "yaw": 0.2, "upwash": 0.03, "sidewash": -0.05}

    def moved(by):
        there = dict(at)
        there[source] += by
        return flow(there.pop("theta"), **there)

    step, u = 1e-6, 2e-3
    d_alpha = (moved(step).alpha[0] - moved(-step).alpha[0]) / (2.0 * step)
    d_beta = (moved(step).beta[0] - moved(-step).beta[0]) / (2.0 * step)
    there = {name: value for name, value in at.items() if name != "theta"}
    how = attitude(**there, **{})
    of_source = {} if source == "theta" else {source: known(there[source], u)}
    how = Attitude(**{name: of_source.get(name, getattr(how, name)) for name in there})
    found = alpha_beta(np.array([theta]), np.array([u if source == "theta" else 0.0]), how)
    assert found.u_alpha[0] == pytest.approx(abs(d_alpha) * u, rel=1e-6, abs=1e-12)
    assert found.u_beta[0] == pytest.approx(abs(d_beta) * u, rel=1e-6, abs=1e-12)


def fitted(true_theta, true_roll, roll):
    """Theta that fits forward and upward specific force best under a roll that is taken as known."""
    read = np.array([math.sin(true_theta), math.cos(true_roll) * math.cos(true_theta)])

    def misfit(theta):
        return float(np.sum((read - [math.sin(theta), math.cos(roll) * math.cos(theta)]) ** 2))

    return minimize_scalar(
        misfit, bounds=(true_theta - 0.2, true_theta + 0.2), method="bounded", options={"xatol": 1e-12}
    ).x


@pytest.mark.parametrize(("theta", "roll"), [(0.5, 0.5), (0.5, -0.9), (-0.7, 0.3), (2.5, 0.4)])
def test_an_error_of_the_stated_roll_comes_in_through_theta_too(theta, roll):
    # the model lies at a roll that is off by `by` from the stated one, with which theta was found
    by, u = 1e-3, 1e-3
    found = fitted(theta, roll + by, roll) - theta
    assert found == pytest.approx(float(theta_by_roll(np.array([theta]), roll)[0]) * -by, rel=5e-3)
    true, told = flow(theta, roll=roll + by), flow(theta + found, roll=roll)
    of_roll = flow(theta, roll=roll, **{})
    how = Attitude(roll=known(roll, u))
    of_roll = alpha_beta(np.array([theta]), np.zeros(1), how)
    assert of_roll.u_alpha[0] == pytest.approx(abs(told.alpha[0] - true.alpha[0]), rel=1e-2)
    assert of_roll.u_beta[0] == pytest.approx(abs(told.beta[0] - true.beta[0]), rel=1e-2)


def test_a_tracked_roll_row_by_row_is_that_roll_stated():
    theta, roll = np.array([0.2, 0.4, 3.0]), np.array([0.1, -0.5, 1.2])
    rows = alpha_beta(theta, np.zeros(3), Attitude(), roll, np.full(3, 1e-3))
    for k in range(3):
        one = flow(theta[k], roll=roll[k])
        assert rows.alpha[k] == pytest.approx(one.alpha[0], abs=1e-12)
        assert rows.beta[k] == pytest.approx(one.beta[0], abs=1e-12)
        step = 1e-6
        d = (flow(theta[k], roll=roll[k] + step).beta[0] - one.beta[0]) / step
        assert rows.u_beta[k] == pytest.approx(abs(d) * 1e-3, rel=1e-4)


def test_wind_straight_from_the_side_leaves_alpha_unknown():
    found = flow(0.5 * math.pi, u=1e-4, roll=0.5 * math.pi)
    assert found.beta[0] == pytest.approx(0.5 * math.pi, abs=1e-7)
    assert found.u_alpha[0] == pytest.approx(math.pi / math.sqrt(3.0))
    assert found.u_beta[0] <= 1e-4 * (1.0 + 1e-9)


def test_an_unknown_theta_gives_no_angles():
    found = flow([np.nan, 0.1], u=1e-3, roll=0.2)
    for each in (found.alpha, found.u_alpha, found.beta, found.u_beta):
        assert np.isnan(each[0])
        assert np.isfinite(each[1])


def test_alpha_is_told_from_theta_only_where_the_study_states_how_the_model_lies():
    assert not gives_alpha(Attitude())
    assert gives_alpha(Attitude(upwash=known(0.0)))
