"""Paths within the limits of joints: sampled finely, by differences, apart from how the search checks them."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from paper_study import study

import inercal as ic
from inercal.foundation.errors import StudyError
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.before.path_design import design
from inercal.systems.selfcal.before.path_search import criterion, search, shifts, unmodelled
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import to_product
from inercal.systems.selfcal.platform.joint_limits import ForbiddenAngles, JointLimits, beyond
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn, motion, path
from inercal.systems.selfcal.platform.states import ALL
from inercal.systems.selfcal.settings import Search
from inercal.systems.selfcal.simulate import experiment, simulate

D = np.pi / 180.0
SLOW_OUTER = JointLimits(rate=(0.5 * D, 1.0 * D, 1.0 * D))
PARTS = 20


def finely(plan):
    """Angles, rates and accelerations (m, 3) at parts of the rows, the last two by differences."""
    angles, h = plan.angles(PARTS), plan.step / PARTS
    rates = np.diff(angles, axis=0) / h
    return angles, rates, np.diff(rates, axis=0) / h


def inside(angles, region):
    """Rows whose angles lie in a region, whole turns aside."""
    within = np.ones(len(angles), dtype=bool)
    for k, (low, high) in enumerate(region.ranges):
        if np.isfinite(low):
            turned = np.mod(angles[:, k] - low, 2.0 * np.pi)
            within &= (turned > 1e-6) & (turned < high - low - 1e-6)
    return within


def test_turns_gain_and_lose_their_rates():
    most = (0.02, 0.03, 0.001)
    plan = PlatformPlan(
        (Turn("x", 1.0), Turn("y", -0.01), Rest(3.0), Turn("z", 2.0, 0.05)), 0.1, acceleration=most
    )
    angles, rates, accelerations = finely(plan)
    assert angles[-1] == pytest.approx([1.0, -0.01, 2.0], abs=1e-12)
    assert angles[::PARTS] == pytest.approx(plan.angles(), abs=1e-12)
    assert np.all(np.abs(accelerations).max(axis=0) <= np.array(most) * (1.0 + 1e-6))
    assert np.abs(rates[:, 0]).max() == pytest.approx(0.1, rel=0.02)
    # 1 rad at 0.1 rad/s and 5 s of ramps; the two others never come to their rates: twice the root of angle over most
    lasts = 1.0 / 0.1 + 0.1 / 0.02 + 2.0 * np.sqrt(0.01 / 0.03) + 3.0 + 2.0 * np.sqrt(2.0 / 0.001)
    assert lasts <= plan.duration <= lasts + 4 * plan.step


def test_a_region_is_the_same_whole_turns_on():
    region = ForbiddenAngles((80 * D, 130 * D), (20 * D, 60 * D))
    rng = np.random.default_rng(20261124)
    for _ in range(200):
        start = rng.uniform(-720 * D, 720 * D, 3)
        joint, by = rng.choice(["x", "y", "z"]), rng.uniform(-300 * D, 300 * D)
        plan = PlatformPlan((Turn(joint, by),), rate=1.0, step=0.002, start=tuple(start))
        limits = JointLimits(forbidden=(region,))
        met = bool(inside(plan.angles(), region).any())
        assert (beyond(plan, {}, limits) == ["forbidden region 1"]) == met


@pytest.fixture(scope="module")
def limited():
    joints = JointLimits(
        rate=(1.0 * D, 0.5 * D, np.inf), acceleration=(0.05 * D, 0.1 * D, 2.0 * D),
        forbidden=(ForbiddenAngles((80 * D, 130 * D), (20 * D, 70 * D)),
                   ForbiddenAngles(None, None, (100 * D, 140 * D))),
    )  # fmt: skip
    asked = Search(turns=6, angle=30.0 * D, time=500.0, closed=True, rest=6.0, criterion="mean")
    present = replace(path("paper"), rate=2.0 * D)
    limits = {"th_y": (-60 * D, 60 * D), "th_z": (-180 * D, 90 * D)}
    return replace(study("paper", limits=limits, search=asked), joints=joints, plan=joints.kept(present))


def test_the_path_found_keeps_every_limit(limited, monkeypatch):
    """A present plan that breaks two of them is judged, and refused to nobody but the simulation."""
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=2))
    made = design(limited)
    plan = made.plan
    angles, rates, accelerations = finely(plan)
    for k, name in enumerate(("th_x", "th_y", "th_z")):
        low, high = limited.limits.get(name, (-np.inf, np.inf))
        assert low - 1e-9 <= angles[:, k].min() <= angles[:, k].max() <= high + 1e-9
    assert np.all(
        np.abs(rates).max(axis=0) <= np.minimum(limited.joints.rate, limited.plan.rate) * (1.0 + 1e-6)
    )
    assert np.all(np.abs(accelerations).max(axis=0) <= np.array(limited.joints.acceleration) * (1.0 + 1e-4))
    assert not any(inside(angles, region).any() for region in limited.joints.forbidden)
    assert angles[-1] == pytest.approx(angles[0], abs=1e-9)
    assert plan.duration == pytest.approx(500.0, abs=plan.step)
    turns = [k for k, move in enumerate(plan.moves) if isinstance(move, Turn)]
    assert 2 <= len(turns) <= 6
    assert all(isinstance(plan.moves[k + 1], Rest) and plan.moves[k + 1].duration >= 6.0 for k in turns)
    assert made.compare[0].beyond == ()
    present = next(each for each in made.compare if each.name == "study")
    assert present.beyond == ("th_z", "forbidden region 2")
    with pytest.raises(StudyError, match="plan: found turns that take th_z"):
        experiment(limited)


def test_every_sequence_in_a_small_space_is_judged_alike(limited, monkeypatch):
    """Two turns of 90 deg that are then turned back, one joint slower than the other: the best of all is found."""
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=6))
    asked = replace(limited.search, turns=4, angle=90.0 * D, rest=0.0, time=900.0)
    wide = replace(
        limited, search=asked, limits={"th_y": (0.0, 0.0)}, joints=JointLimits(rate=(1.0 * D,) * 3)
    )

    def value(plan):
        return criterion(bounds(motion(plan, wide.world), problem(wide)), {}, "mean")

    best = np.inf
    for one, two in itertools.permutations("xz"):
        for a, b in itertools.product((-2, -1, 1, 2), repeat=2):
            there = [Turn(one, a * 90 * D), Turn(two, b * 90 * D)]
            for back in itertools.permutations([Turn(one, -a * 90 * D), Turn(two, -b * 90 * D)]):
                plan = SLOW_OUTER.kept(PlatformPlan((*there, *back), rate=1.0 * D))
                if plan.duration <= 900.0:
                    rest = () if plan.duration == 900.0 else (Rest(900.0 - plan.duration),)
                    best = min(best, value(replace(plan, moves=(*plan.moves, *rest))))
    assert value(search(wide)) <= best * 1.002


class Silent:
    """Random numbers that are none."""

    def standard_normal(self, shape=None):
        return np.zeros(shape) if shape is not None else 0.0


def test_shifts_by_errors_left_out_are_those_of_the_filter():
    """Two records without noise, with K2 and without: what the filter makes of them differs by what is said before."""
    asked = study("best", search=Search(robust=("k2",)))
    of, sizes = unmodelled(asked), 1e-3
    told = shifts(motion(asked.plan, asked.world), problem(asked), of)
    assert of.names == ("K2_x", "K2_y", "K2_z")
    plain = experiment(asked)
    found = []
    for k in (None, 0, 1, 2):
        truth = np.zeros(len(asked.priors))
        if k is not None:
            truth[ALL.index("K2_x") + k] = sizes * of.sizes[k]
        made = simulate(replace(plain, truth=truth), Silent())
        found.append(to_product(estimate(made.recording, problem(asked), history=False).coefficients))
    by_filter = (np.array(found[1:]) - found[0]).T / sizes
    u = bounds(motion(asked.plan, asked.world), problem(asked)).u
    assert told / u[:, None] == pytest.approx(by_filter / u[:, None], rel=0.03, abs=0.3)
    assert np.abs(told / u[:, None]).max() > 10.0


def test_errors_left_out_count_in_the_criterion(monkeypatch):
    """The path found for both bound and errors beats, by both, the one found for the bound alone."""
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=6))
    asked = study("best", search=Search(turns=3, angle=60 * D, time=300.0, robust=("k2", "sag")))

    def judged(plan):
        """Variance of the shifts (18,), and the criterion."""
        along = motion(plan, asked.world)
        shifted = np.square(shifts(along, problem(asked), unmodelled(asked))).sum(axis=1)
        ratio = np.sqrt(bounds(along, problem(asked)).u ** 2 + shifted) / asked.prior[:18]
        return shifted, np.exp(np.log(ratio).mean())

    made = design(asked)
    shifted, value = judged(made.plan)
    assert made.compare[0].criterion == pytest.approx(value)
    assert made.result["left_out"]["ka0_x"] == pytest.approx(np.sqrt(shifted[12]))
    bound_alone = search(replace(asked, search=replace(asked.search, robust=())))
    assert value <= judged(bound_alone)[1] * 1.001


HEAD = """
[site]
latitude = "48.1 deg"
[plan]
turns = [["z", "180 deg"], ["x", "90 deg"{}]]
rate = "2 deg/s"
[noise]
angle_random_walk = "1e-3 deg/sqrt(h)"
accelerometer = "20 ug"
encoder = "2 arcsec"
[truth]
kg0 = ["0.1 deg/h", "0 deg/h", "0 deg/h"]
[rig]
kind = "three_axis_gimbals"
"""


def written(tmp_path, more="", typed=""):
    file = tmp_path / "rig.toml"
    file.write_text(HEAD.format(typed) + more)
    return file


def test_a_study_states_what_joints_can(tmp_path):
    more = 'joint_rate = ["1 deg/s", "9 deg/s", "9 deg/s"]\njoint_acceleration = "0.1 deg/s^2"\n'
    settings = ic.study(written(tmp_path, more)).settings
    _, rates, accelerations = finely(settings.plan)
    assert np.abs(rates).max(axis=0) == pytest.approx([1.0 * D, 0.0, 2.0 * D], rel=0.02)
    assert np.abs(accelerations[:, 2]).max() == pytest.approx(0.1 * D, rel=0.02)
    made = ic.simulate(written(tmp_path, more), np.random.default_rng(1))
    assert made["th_x"].values[-1] == pytest.approx(np.degrees(np.pi / 2), abs=0.01)


@pytest.mark.parametrize(
    ("more", "typed", "said"),
    [
        ("forbidden = [{}]\n", "", r"rig\.forbidden\.0: found no angles"),
        (
            '[[rig.forbidden]]\nx = ["9 deg", "1 deg"]\n',
            "",
            r"rig\.forbidden\.0\.x: found .*lower end first",
        ),
        ('joint_rate = "0 deg/s"\n', "", r"rig\.joint_rate: .*above zero"),
        ('[design]\nrobust = ["warp"]\n', "", r"design\.robust"),
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, more, typed, said):
    with pytest.raises(StudyError, match=said):
        ic.study(written(tmp_path, more, typed))


@pytest.mark.parametrize(
    ("more", "typed", "said"),
    [
        (
            'joint_rate = "2 deg/s"\n',
            ', "3 deg/s"',
            "plan: found rate of th_x beyond the limits of the rig",
        ),
        ('forbidden = [{ x = ["40 deg", "50 deg"] }]\n', "", "plan: found forbidden region 1 beyond"),
    ],
)
def test_a_plan_beyond_the_joints_is_not_simulated(tmp_path, more, typed, said):
    with pytest.raises(StudyError, match=said):
        experiment(ic.study(written(tmp_path, more, typed)).settings)


def test_a_search_that_cannot_begin_is_refused(limited):
    at_start = JointLimits(forbidden=(ForbiddenAngles(None, (-1 * D, 1 * D)),))
    with pytest.raises(StudyError, match="start of the path in a forbidden region"):
        search(replace(limited, joints=at_start))
    with pytest.raises(StudyError, match=r"design\.robust: found kg0, which is among the states"):
        search(replace(limited, search=replace(limited.search, robust=("kg0",))))
