"""Gimbals, base and plans: angles, attitudes and rates of a platform against chains of rotations and closed forms."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from paper_study import DEG

from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.geometry.kernels import exp, multiply, rotate
from inercal.foundation.geometry.rotations import attitude_difference, elementary, from_matrix, to_matrix
from inercal.systems.selfcal.filters.residuals import gimbals as all_gimbals
from inercal.systems.selfcal.platform.kinematics import all_angles, angles, attitude, joint_axes
from inercal.systems.selfcal.platform.model import propagate
from inercal.systems.selfcal.platform.plan import PATHS, PlatformPlan, Rest, Turn, motion, path
from inercal.systems.selfcal.platform.rig import JOINTS, Base, Gimbals, World, world

LATITUDE = 40.0 * DEG
SITE = Site(9.8, (), LATITUDE)
NORTH, UP = EARTH_RATE * math.cos(LATITUDE), EARTH_RATE * math.sin(LATITUDE)
RIGS = [
    Gimbals(axes, signs)
    for axes in itertools.permutations("xyz")
    for signs in itertools.product((1, -1), repeat=3)
]
ANGLE = st.floats(-10.0, 10.0)
#: inner angle clear of gimbal lock, on both branches
CLEAR = st.floats(-10.0, 10.0).filter(lambda a: abs(math.cos(a)) > 0.05)
EVERY_RIG = st.sampled_from(RIGS)
#: kernels compile within the first example
QUICK = settings(deadline=None, max_examples=60)


def q_of(th, rig):
    return np.array(attitude(np.array(th), rig.index, rig.sign))


def J_of(th, rig):
    return np.column_stack(joint_axes(np.array(th), rig.index, rig.sign))


@QUICK
@given(th=st.tuples(ANGLE, ANGLE, ANGLE), rig=EVERY_RIG)
def test_the_attitude_is_that_of_the_chain(th, rig):
    """C_bp = R(x) R(y) R(z), each about its own axis of the frame reached so far."""
    chain = rig.chain()
    assert chain.joints == JOINTS
    C_bp = chain.pose(rig.sign * th)[:3, :3]
    assert_allclose(to_matrix(q_of(th, rig)), C_bp, atol=1e-13)
    by_hand = np.eye(3)
    for axis, sign, angle in zip(rig.axes, rig.signs, th, strict=True):
        by_hand = by_hand @ elementary(axis, sign * angle)
    assert_allclose(C_bp, by_hand, atol=1e-13)


@QUICK
@given(th=st.tuples(ANGLE, ANGLE, ANGLE))
def test_the_half_angle_formula_of_the_paper(th):
    """q0 = cx cy cz - sx sy sz, and so on: q = qz(thx) qx(thy) qy(thz)."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.array(th) / 2), np.sin(np.array(th) / 2)
    expected = [
        cx * cy * cz - sx * sy * sz,
        cx * sy * cz - sx * cy * sz,
        cx * cy * sz + sx * sy * cz,
        sx * cy * cz + cx * sy * sz,
    ]
    assert_allclose(q_of(th, Gimbals()), expected, atol=1e-14)


@QUICK
@given(th=st.tuples(ANGLE, ANGLE, ANGLE))
def test_the_closed_form_of_J_and_its_inverse(th):
    """w_np^p = J th'; T = J^-1 is singular where cos thy = 0."""
    _, (cy, cz), (sy, sz) = th, np.cos(th[1:]), np.sin(th[1:])
    J = np.array([[-sz * cy, cz, 0.0], [sy, 0.0, 1.0], [cz * cy, sz, 0.0]])
    assert_allclose(J_of(th, Gimbals()), J, atol=1e-13)
    assert np.linalg.det(J) == pytest.approx(cy, abs=1e-12)


@QUICK
@given(th=st.tuples(ANGLE, ANGLE, ANGLE), rate=st.tuples(*[st.floats(-1.0, 1.0)] * 3), rig=EVERY_RIG)
def test_J_is_the_rate_of_the_platform(th, rate, rig):
    """Against central differences of the attitude."""
    th, rate, h = np.array(th), np.array(rate), 1e-5
    turn = attitude_difference(q_of(th + h * rate, rig), q_of(th - h * rate, rig))
    assert turn == pytest.approx(2 * h * np.linalg.norm(J_of(th, rig) @ rate), abs=1e-9)
    C, C2 = to_matrix(q_of(th - h * rate, rig)), to_matrix(q_of(th + h * rate, rig))
    skew = (C.T @ C2 - C2.T @ C) / (4 * h)
    w = np.array([skew[2, 1], skew[0, 2], skew[1, 0]])
    assert_allclose(J_of(th, rig) @ rate, w, atol=1e-6)


@QUICK
@given(th=st.tuples(ANGLE, CLEAR, ANGLE), rig=EVERY_RIG, off=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_angles_come_back_on_their_turn_and_branch(th, rig, off):
    """From an attitude (q or -q) to the angles nearest to those before, beyond +-90 deg of the inner joint too."""
    q = q_of(th, rig)
    # the two branches are (pi, pi - 2 y, pi) apart: 0.3 rad about each cannot exchange them
    near = np.array(th) + np.array(off) * abs(math.cos(th[1]))
    for sign in (1.0, -1.0):
        found = angles(sign * q, near, rig.index, rig.sign)
        assert_allclose(found, th, atol=1e-11)


@QUICK
@given(th=st.tuples(ANGLE, CLEAR, ANGLE), rig=EVERY_RIG)
def test_the_second_branch_is_the_same_attitude(th, rig):
    x, y, z = th
    # angles count with their signs: right-handed, the second branch is (x + pi, pi - y, z + pi)
    other = (x + math.pi, rig.sign[1] * (math.pi - rig.sign[1] * y), z + math.pi)
    assert attitude_difference(q_of(th, rig), q_of(other, rig)) < 1e-7
    found = angles(q_of(th, rig), np.array(other), rig.index, rig.sign)
    assert_allclose(found, other, atol=1e-11)


def test_angles_are_followed_through_whole_turns_and_over_the_pole():
    """The inner joint turns from -300 to 300 deg, through both locks; neither rows nor turns get lost."""
    rig = Gimbals()
    # rows step over the locks themselves, where outer and platform angle are not unique
    inner = np.linspace(-300.0, 300.0, 1202) * DEG
    th = np.column_stack([np.linspace(0.0, 800.0, 1202) * DEG, inner, np.linspace(50.0, -500.0, 1202) * DEG])
    q, out = np.array([q_of(each, rig) for each in th]), np.empty_like(th)
    q[::3] *= -1.0
    all_angles(q, th[0], rig.index, rig.sign, out)
    assert_allclose(out, th, atol=1e-9)


@QUICK
@given(rig=EVERY_RIG, seed=st.integers(0, 99))
def test_all_rows_at_once_are_the_kernels_row_by_row(rig, seed):
    th = np.random.default_rng(seed).uniform(-4.0, 4.0, (7, 3))
    q, J = all_gimbals(th, World(np.zeros(3), np.zeros(3), rig.index, rig.sign))
    assert_allclose(q, [q_of(each, rig) for each in th], atol=1e-14)
    assert_allclose(J, [J_of(each, rig) for each in th], atol=1e-14)


@pytest.mark.parametrize(("axes", "signs"), [("xxy", (1, 1, 1)), ("xyz", (1, 0, 1)), ("xy", (1, 1))])
def test_gimbals_that_are_none(axes, signs):
    with pytest.raises(ValueError, match="expected x, y, z once each"):
        Gimbals(tuple(axes), signs)


def on(base):
    found = world(SITE, base, Gimbals())
    return found.earth, found.up


def test_level_and_north_the_base_is_north_up_east():
    """w_In^n = we [cos L, sin L, 0], specific force +g along up."""
    earth, up = on(Base())
    assert_allclose(earth, [NORTH, UP, 0.0], atol=1e-18)
    assert_allclose(up, [0.0, 9.8, 0.0], atol=1e-14)


def test_the_other_frames():
    earth, up = on(Base("enu"))
    assert_allclose(earth, [0.0, NORTH, UP], atol=1e-18)
    assert_allclose(up, [0.0, 0.0, 9.8], atol=1e-14)
    earth, up = on(Base("ned"))
    assert_allclose(earth, [NORTH, 0.0, -UP], atol=1e-18)
    assert_allclose(up, [0.0, 0.0, -9.8], atol=1e-14)


@QUICK
@given(heading=st.floats(-7.0, 7.0))
def test_a_heading_turns_the_base_from_north_to_east(heading):
    """North then has components cos h along X_b and -sin h along Z_b, which looks to the right of X_b."""
    earth, up = on(Base(heading=heading))
    assert_allclose(earth, [NORTH * math.cos(heading), UP, -NORTH * math.sin(heading)], atol=1e-18)
    assert_allclose(up, [0.0, 9.8, 0.0], atol=1e-14)


def test_tilts_are_right_handed_about_north_and_east():
    """About north, up leans from up to east... seen from the base, up leans to where the base was turned away from."""
    t = 0.1
    _, up = on(
        Base(tilt=(t, 0.0))
    )  # base turned about north: its east axis goes down, its up axis to the east
    assert_allclose(up, [0.0, 9.8 * math.cos(t), -9.8 * math.sin(t)], atol=1e-14)
    _, up = on(Base(tilt=(0.0, t)))  # about east: its north axis goes up, its up axis to the south
    assert_allclose(up, [9.8 * math.sin(t), 9.8 * math.cos(t), 0.0], atol=1e-14)


@QUICK
@given(
    heading=st.floats(-7.0, 7.0),
    tilt=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    frame=st.sampled_from(["nue", "enu", "ned"]),
)
def test_any_base_is_a_rotation(heading, tilt, frame):
    base = Base(frame, heading, tilt)
    C = base.from_geographic()
    assert_allclose(C @ C.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(C) == pytest.approx(1.0)
    earth, up = on(base)
    assert np.linalg.norm(earth) == pytest.approx(EARTH_RATE)
    assert float(earth @ up) == pytest.approx(UP * 9.8)


def test_a_site_must_have_a_latitude():
    with pytest.raises(ValueError, match="without latitude"):
        world(Site(9.8), Base(), Gimbals())


@pytest.mark.parametrize("name", PATHS)
def test_named_paths_take_the_times_of_the_paper(name):
    plan = path(name)
    assert plan.duration == pytest.approx(360.0 if name == "paper two turns" else 540.0)
    th = plan.angles()
    assert len(th) == round(plan.duration / 0.2) + 1
    step = np.diff(th, axis=0)
    assert_allclose(np.abs(step).sum(axis=1), 0.2 * DEG, rtol=1e-9)  # one joint at a time, at 1 deg/s


def test_an_unknown_path():
    with pytest.raises(KeyError):
        path("worst")


def test_the_path_of_the_paper_by_hand():
    th = path("paper").angles()
    corners = [[0, 0, 0], [0, 0, 180], [90, 0, 180], [90, 0, 0], [180, 0, 0]]
    assert_allclose(th[[0, 900, 1350, 2250, 2700]], np.array(corners) * DEG, atol=1e-12)


MOVES = st.lists(
    st.one_of(
        st.builds(
            Turn, st.sampled_from(["x", "y", "z"]), st.floats(0.01, 4.0), st.none() | st.floats(0.05, 1.0)
        ),
        st.builds(Rest, st.floats(0.1, 20.0)),
    ),
    min_size=1,
    max_size=4,
)


@QUICK
@given(moves=MOVES, step=st.floats(0.05, 0.7))
def test_every_move_takes_a_whole_number_of_rows_and_is_never_too_fast(moves, step):
    plan = PlatformPlan(tuple(moves), rate=0.2, step=step, start=(0.1, -0.2, 0.3))
    th = plan.angles()
    assert len(th) == sum(plan.steps(move) for move in moves) + 1
    assert_array_equal(th[0], [0.1, -0.2, 0.3])
    total = np.array([0.1, -0.2, 0.3])
    row = 0
    for move in moves:
        n = plan.steps(move)
        part, row = th[row : row + n + 1], row + n
        if isinstance(move, Turn):
            total["xyz".index(move.joint)] += move.angle
            rate = move.rate or plan.rate
            assert np.abs(np.diff(part, axis=0)).max() <= rate * step * (1 + 1e-6)
            assert (n - 1) * step <= move.angle / rate + 1e-6 * step
        else:
            assert_array_equal(part, np.broadcast_to(part[0], part.shape))
            assert n * step >= move.duration - 1e-6
        assert_allclose(th[row], total, atol=1e-12)


def test_limits_that_a_plan_exceeds():
    plan = path("best")  # x to -240 deg, z to -210 deg
    assert plan.beyond({}) == []
    assert plan.beyond({"th_x": (-240 * DEG, 0.0), "th_z": (-210 * DEG, 0.0)}) == []
    assert plan.beyond({"th_x": (-239 * DEG, 0.0), "th_y": (0.0, 0.0), "th_z": (-3.0, 0.0)}) == [
        "th_x",
        "th_z",
    ]


def test_moves_in_words():
    assert PlatformPlan((Turn("z", math.pi), Rest(60.0), Turn("x", -math.pi / 2))).words() == (
        "(z +180 deg), (rest 60 s), (x -90 deg)"
    )


def test_commands_by_their_definition():
    """w_c = J(th) th' + C_pb w_Ib^b in the middle of each step; a rest is commanded earth rate."""
    place = world(SITE, Base(heading=0.4, tilt=(0.1, -0.2)), Gimbals(("x", "z", "y"), (1, -1, 1)))
    plan = PlatformPlan((Turn("y", 0.5), Turn("x", 1.0, 0.1), Rest(1.0)), start=(0.2, -0.3, 0.5))
    found = motion(plan, place)
    th = plan.angles()
    assert_array_equal(found.angles, th)
    assert_allclose(found.t, 0.2 * np.arange(len(th)), rtol=1e-15)
    rig = Gimbals(("x", "z", "y"), (1, -1, 1))
    for k in (0, 57, len(th) - 2):
        middle, rate = (th[k] + th[k + 1]) / 2, (th[k + 1] - th[k]) / 0.2
        C = to_matrix(q_of(middle, rig))
        assert_allclose(found.rate[k], J_of(middle, rig) @ rate + C.T @ place.earth, atol=1e-15)
    assert_allclose(np.linalg.norm(found.rate[-1]), EARTH_RATE, rtol=1e-12)


@QUICK
@given(rig=EVERY_RIG, heading=st.floats(-3.0, 3.0), rates=st.tuples(*[st.floats(0.01, 0.1)] * 3))
def test_commands_take_the_platform_through_the_nominal_angles(rig, heading, rates):
    """A perfect platform that is commanded so, held over each step, ends where the plan ends.

    What is left is the turn of earth rate in p within a step, of the second order: 1e-4 arcsec a step.
    """
    place = world(SITE, Base(heading=heading, tilt=(0.05, -0.1)), rig)
    x, y, z = rates
    plan = PlatformPlan(
        (Turn("z", 1.0, z), Turn("x", -1.5, x), Turn("y", 0.8, y), Rest(3.0), Turn("x", 1.0, x))
    )
    commanded = motion(plan, place)
    q = q_of(commanded.angles[0], rig)
    out = np.empty_like(commanded.angles)
    rows = [q]
    for rate in commanded.rate:
        q = np.array(propagate(q, tuple(rate), tuple(place.earth), plan.step))
        rows.append(q)
    all_angles(np.array(rows), commanded.angles[0], rig.index, rig.sign, out)
    assert_allclose(out, commanded.angles, atol=1e-9 * len(rows))
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)


@QUICK
@given(
    w=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    e=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
    dt=st.floats(0.01, 5.0),
)
def test_the_exact_step(w, e, dt):
    """q+ = qexp(-e dt) q qexp(w dt): against its own halves, and against the differential equation at its start."""
    q0 = from_matrix(elementary("x", 0.3) @ elementary("y", -1.2))
    whole = np.array(propagate(q0, w, e, dt))
    half = np.array(propagate(np.array(propagate(q0, w, e, dt / 2)), w, e, dt / 2))
    assert_allclose(whole, half, atol=1e-13)
    h = 1e-5
    slope = (np.array(propagate(q0, w, e, h)) - np.array(propagate(q0, w, e, -h))) / (2 * h)
    e_p = rotate(tuple(q0 * [1, -1, -1, -1]), e)
    pure = (0.0, w[0] - e_p[0], w[1] - e_p[1], w[2] - e_p[2])
    assert_allclose(slope, 0.5 * np.array(multiply(tuple(q0), pure)), atol=1e-8)
    assert_allclose(np.array(exp((0.0, 0.0, 0.0))), [1, 0, 0, 0])
