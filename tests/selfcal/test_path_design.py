"""The search for a path: limits kept, at least as good as the known ones, and all there is in a space small enough."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from paper_study import study

from inercal.foundation.errors import StudyError
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.before.path_design import at_rest, design, lasting, stated_moves, with_stops
from inercal.systems.selfcal.before.path_search import criterion, search
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.plan import PATHS, PlatformPlan, Rest, Turn, motion, path
from inercal.systems.selfcal.settings import Search

FEW = Search(turns=3, angle=np.radians(60.0), criterion="mean")


def value(plan, asked):
    return criterion(bounds(motion(plan, asked.world), problem(asked)), asked.goal, asked.search.criterion)


@pytest.fixture(scope="module")
def designed():
    told = []
    made = design(study("paper", search=Search(criterion="mean")), lambda *done: told.append(done))
    return made, told


# the search


@pytest.mark.slow
def test_it_is_at_least_as_good_as_the_known_paths(designed):
    made, _ = designed
    found, *others = made.compare
    assert {each.name for each in others} == {"study", "paper two turns", "best", "plain"}
    assert all(found.criterion <= each.criterion for each in others)


@pytest.mark.parametrize("goal", [{}, {"ds_z": 1e-7, "do_y": 1e-7, "ka0_x": 1e-6}])
def test_it_is_at_least_as_good_by_the_worst_coefficient(goal, monkeypatch):
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=8))
    asked = study("best", goal=goal, search=Search(criterion="worst"))
    assert value(search(asked), asked) <= value(asked.plan, asked)


def test_in_a_small_space_it_finds_the_best_of_all(monkeypatch):
    """Two turns of 90° or 180° of any joints, 270 s at most: every sequence judged at full steps."""
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=6))
    asked = study("plain", search=Search(turns=2, angle=np.pi / 2, time=270.0, criterion="mean"))
    asked = replace(asked, limits={"th_y": (-np.pi / 3, np.pi / 3)})
    turns = [(joint, count * np.pi / 2) for joint in "xz" for count in (-3, -2, -1, 1, 2, 3)]
    every = [
        lasting(PlatformPlan(tuple(Turn(*turn) for turn in pair)), 270.0)
        for pair in itertools.product(turns, repeat=2)
        if abs(pair[0][1]) + abs(pair[1][1]) <= 1.5 * np.pi + 1e-9
    ]
    best = min(value(plan, asked) for plan in every)
    assert value(search(asked), asked) == pytest.approx(best, rel=2e-3)


def test_seeds_repeat_it():
    asked = study("best", search=replace(FEW, time=200.0))
    assert search(asked) == search(asked)
    other = search(replace(asked, search=replace(asked.search, seed=2)))
    assert value(other, asked) == pytest.approx(value(search(asked), asked), rel=0.05)


def test_it_keeps_time_number_and_limits():
    limits = {"th_x": (np.radians(-70.0), np.radians(50.0)), "th_z": (0.0, np.radians(130.0))}
    asked = study("best", limits=limits, search=replace(FEW, time=333.0, angle=np.radians(20.0)))
    found = search(asked)
    turns = [move for move in found.moves if isinstance(move, Turn)]
    assert 0 < len(turns) <= 3
    assert found.duration == pytest.approx(333.0, abs=asked.plan.step)
    assert found.beyond(limits) == []
    assert np.all(np.abs(np.cos(found.angles()[:, 1])) >= LIMITS.path_cosine)
    multiples = np.array([move.angle for move in turns]) / asked.search.angle
    assert multiples == pytest.approx(np.round(multiples))


@pytest.mark.parametrize("step", [0.7, 7.0])
def test_it_keeps_time_where_turns_take_no_whole_number_of_rows(step, monkeypatch):
    """Sixteen turns of 20 s fill 320 s, but each takes 20.3 or 21 s of rows: a rest fills what is left of one less."""
    monkeypatch.setattr("inercal.systems.selfcal.before.path_search.LIMITS", replace(LIMITS, path_starts=1))
    asked = study("best", search=replace(FEW, time=320.0, angle=np.radians(20.0)))
    found = search(replace(asked, plan=replace(asked.plan, step=step)))
    assert 320.0 - step < found.duration <= 320.0


def test_stated_limits_let_it_through_gimbal_lock():
    """With nothing but the inner gimbal to turn, it does so as far as it is let, and says that it comes to lock."""
    held = {"th_x": (0.0, 0.0), "th_z": (0.0, 0.0)}
    asked = study("best", limits=held, search=Search(turns=2, angle=np.pi / 6, time=360.0, criterion="mean"))
    kept = search(asked)
    assert np.abs(np.cos(kept.angles()[:, 1])).min() >= LIMITS.path_cosine
    free = replace(asked, limits=held | {"th_y": (-np.pi, np.pi)})
    made = design(free)
    assert np.abs(np.cos(made.plan.angles()[:, 1])).min() < LIMITS.path_cosine
    assert "gimbal_lock" in {finding.code for finding in made.findings}
    assert made.compare[0].criterion < value(kept, asked)
    assert "th_x" in next(each for each in made.compare if each.name == "paper two turns").beyond


def test_what_does_not_fit_is_said():
    with pytest.raises(StudyError, match=r"design\.time: missing"):
        search(study(plan=None, search=Search()))
    with pytest.raises(StudyError, match=r"design\.angle: found no turn of 30 deg within 20 s"):
        search(study(search=Search(time=20.0)))
    tight = dict.fromkeys(("th_x", "th_y", "th_z"), (-0.1, 0.1))
    with pytest.raises(StudyError, match=r"design\.angle: found no turn"):
        search(study(limits=tight))


# what is told


@pytest.mark.slow
def test_result_holds_what_a_study_and_a_program_need(designed):
    made, told = designed
    result = json.loads(json.dumps(made.result))
    names = {"turns", "rank", "condition", "d_efficiency", "predicted", "compare"}
    assert names <= set(result)
    assert result["rank"] == 18
    assert list(result["predicted"]) == list(made.bounds.names)
    assert result["compare"][0]["turns"] == result["turns"] == stated_moves(made.plan.moves)
    assert max(each["d_efficiency"] for each in result["compare"]) == 1.0
    assert min(each["d_efficiency"] for each in result["compare"]) > 0.0
    assert [each["time"] for each in result["compare"]] == pytest.approx([540.0] * 5)
    assert told == [(done, LIMITS.path_starts) for done in range(LIMITS.path_starts + 1)]
    assert made.table().count("\n") > 25
    assert made.plan.words() in made.message


def test_goals_that_the_path_misses_are_found():
    asked = study(
        "best", goal={"kg0_x": 1e-12, "ka0_x": 1.0}, search=replace(FEW, time=300.0, criterion="worst")
    )
    made = design(asked)
    assert {finding.message.split(":")[0] for finding in made.findings} >= {"kg0_x"}
    assert all(not finding.message.startswith("ka0_x") for finding in made.findings)


def test_moves_are_stated_as_in_a_study():
    moves = (Turn("z", np.pi), Turn("x", -np.pi / 6, np.radians(2.0)), Rest(60.0))
    assert stated_moves(moves) == [["z", "180 deg"], ["x", "-30 deg", "2 deg/s"], ["rest", "60 s"]]


# stops


@pytest.mark.parametrize("name", sorted(PATHS))
@pytest.mark.parametrize("angle", [30.0, 90.0])
def test_stops_take_the_same_path_in_the_same_time(name, angle):
    plan = path(name)
    stopping = with_stops(plan, np.radians(angle), np.radians(5.0))
    assert stopping.duration == pytest.approx(plan.duration, abs=plan.step)
    angles, rows = stopping.angles(), at_rest(stopping)
    assert angles[-1] == pytest.approx(plan.angles()[-1])
    assert angles.min(axis=0) == pytest.approx(plan.angles().min(axis=0))
    assert angles.max(axis=0) == pytest.approx(plan.angles().max(axis=0))
    assert rows.shape == (len(angles), 4)
    # measured exactly where the row before stands at the same angles
    standing = np.all(np.diff(angles, axis=0) == 0.0, axis=1)
    assert np.array_equal(rows[1:, 0], standing)
    assert not rows[0].any()


def test_stops_need_time():
    with pytest.raises(ValueError, match="longer than the plan"):
        with_stops(path("paper"), np.radians(90.0), np.radians(0.9))


def test_a_plan_lasts_by_a_rest():
    plan = path("plain")
    assert lasting(plan, plan.duration) == plan
    assert lasting(plan, 600.0).moves == (*plan.moves, Rest(60.0))
