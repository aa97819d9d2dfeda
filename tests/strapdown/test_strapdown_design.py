"""What turns tell before a test: the bounds beside the covariance of fits, and the search for better turns."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grades import GRADES, NAV, fitted, plan, u_by_kind

import inercal as ic
from inercal.cli import run
from inercal.foundation.designs.search import improved
from inercal.foundation.errors import InputError, StudyError
from inercal.systems.strapdown.before.bounds import Pieces, bounds
from inercal.systems.strapdown.before.design import NINETEEN, angles_of, by_kind, design
from inercal.systems.strapdown.before.path_search import TurnGround, attitudes
from inercal.systems.strapdown.model.coefficients import SIZE
from inercal.systems.strapdown.settings import Goal, PathDesign, TurnPlan
from inercal.systems.strapdown.simulate import start_attitude

LEVEL = (0.0, 0.0, 0.0)


def rests_of(planned, margin=0.2):
    """Begin and end [s] of the rests of a plan, less margins."""
    begin, rests = 0.0, []
    for angle, dwell in zip(
        [*(each for _, each in planned.turns), None],
        [planned.first_dwell, *[planned.dwell] * len(planned.turns)],
        strict=True,
    ):
        rests.append((begin + (margin if rests else 0.0), begin + dwell - margin))
        begin += dwell + (planned.time_of(angle) if angle else 0.0)
    return tuple(rests)


@pytest.mark.parametrize("grade", GRADES)
def test_bounds_are_the_covariance_of_a_fit(grade):
    """Of a perfect unit without noise that rests exactly as planned."""
    settings = GRADES[grade]
    # without earth rate nothing tells the heading of the fit, which matters where turns tell little
    some = slice(0, 18) if grade == "mems" else slice(5, 14)
    short = replace(settings.plan, turns=settings.plan.turns[some], first_dwell=20.0, dwell=8.0)
    planned = replace(
        settings,
        plan=short,
        rests=replace(settings.rests, list=rests_of(short), margin=settings.rests.margin),
    )
    fit = fitted(planned, np.zeros(SIZE), np.random.default_rng(1), noise=False)
    pieces = Pieces(planned)
    found = bounds(pieces, short)
    of_fit = pieces.slope @ fit.covariance @ pieces.slope.T
    # the first rest of the fit is 0.2 s longer; steps of the turn differ
    assert found.u == pytest.approx(np.sqrt(np.diag(of_fit)), rel=0.01)
    # information only grows; its inverse rounds: in units of the prior the largest eigenvalue is some 1e12
    assert np.all(np.diff(found.history, axis=0) <= 1e-7 * found.prior)
    assert np.all(found.history <= found.prior * (1.0 + 1e-9))


def test_the_path_of_19_positions_at_nav_grade():
    """Largest u of each kind as a prototype had it, within 20 %."""
    found = bounds(Pieces(NAV), NAV.plan)
    u = dict(zip(found.names, found.u, strict=True))
    largest = {
        kind: max(value for name, value in u.items() if name.rpartition("_")[0] == kind)
        for kind in ("S", "T", "K0", "K1", "M", "tau")
    }
    expected = {
        "S": 0.55e-6,
        "T": 1.35e-6,
        "K0": 0.83e-6 * 9.80665,
        "K1": 0.47e-6,
        "M": 1.2e-6,
        "tau": 3.1e-6,
    }
    assert largest == pytest.approx(expected, rel=0.2)


def test_turns_about_one_axis_leave_many_at_their_prior():
    """About the vertical nearly all of the gyros' terms."""
    turning = replace(NAV, plan=TurnPlan(((2, np.pi / 2),) * 4))
    found = design(turning)
    assert found.tried == 0
    (finding,) = found.findings
    assert finding.code == "at_prior"
    assert "a calibration would be unobservable" in finding.message
    left = dict(zip(found.bounds.names, found.bounds.u / found.bounds.prior, strict=True))
    assert min(left[name] for name in ("T_xy", "T_yx", "M_xy", "S_x", "S_y")) > 0.8


@pytest.mark.kernels
def test_attitudes_are_stated_as_they_are_read():
    for C in attitudes(TurnPlan(start=(0.3, -0.4, 1.0))) + attitudes(TurnPlan()):
        assert start_attitude(TurnPlan(start=angles_of(C))) == pytest.approx(C, abs=1e-12)
    assert len(attitudes(TurnPlan())) == 24


def test_a_changed_path_is_judged_as_if_it_were_new():
    """Of paths that begin alike the common part is computed once."""
    pieces = Pieces(NAV)
    moves = tuple((axis, sign * np.pi / 2) for axis in range(3) for sign in (1.0, -1.0))
    ground = TurnGround(pieces, attitudes(NAV.plan), moves, 6, bounds(pieces, NAV.plan).u, 244.0, 9.0, 70.0)
    values = {}
    least, best = improved(ground, np.random.default_rng(2), values)
    assert least == min(values.values()) == values[best]
    for path in (best, *list(values)[::97]):
        assert replace(ground).value(path) == pytest.approx(values[path], rel=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("turns", "start", "most"), [(18, (0.0, -np.pi / 2, 0.0), 0.85), (18, LEVEL, 0.85), (12, LEVEL, 1.3)]
)
def test_a_better_path_is_found(turns, start, most):
    """Than that of 19 positions: of 18 turns by 15 % in the same time, of 12 within 1.3 of it."""
    from time import process_time

    usual = bounds(Pieces(NAV), NAV.plan)
    settings = replace(
        NAV, plan=TurnPlan((), start, first_dwell=70.0), design=PathDesign(turns, start="plan")
    )
    clock = process_time()
    found = design(settings)
    assert process_time() - clock < 60.0
    assert found.plan.duration == pytest.approx(70.0 + 29.0 * turns)
    assert np.exp(np.mean(np.log(found.bounds.u / usual.u))) < most
    # and a fit of a simulated record knows it as well
    fit = fitted(replace(NAV, plan=found.plan), np.zeros(SIZE), np.random.default_rng(1), noise=False)
    assert u_by_kind(fit)["scale"] < 1.2


@pytest.mark.campaign
def test_twelve_turns_are_within_a_third_of_eighteen_in_the_same_time():
    """From a level start, in the 592 s of 19 positions; twelve leave more time for each rest."""
    usual, found = bounds(Pieces(NAV), NAV.plan), {}
    for turns in (12, 18):
        asked = PathDesign(turns, start="plan", time=592.0)
        found[turns] = design(replace(NAV, plan=TurnPlan((), LEVEL, first_dwell=70.0), design=asked))
        assert found[turns].plan.duration == pytest.approx(592.0)
    by_mean = {turns: np.exp(np.mean(np.log(each.bounds.u / usual.u))) for turns, each in found.items()}
    assert by_mean[18] < 0.85
    assert by_mean[12] < 1.3 * by_mean[18]


def test_goals_weigh():
    """A goal that is stated takes the place of the usual one; S_asym is twice the half that the study states."""
    settings = replace(
        NAV,
        terms=(*NAV.terms, "asymmetry"),
        plan=plan("y y z x", first_dwell=30.0),
        goal=Goal(scale=1e-7, asymmetry=1e-6),
    )
    found = design(settings)
    goal = dict(zip(found.bounds.names, found.goal, strict=True))
    assert (goal["S_x"], goal["S_asym_y"]) == (1e-7, 2e-6)
    assert goal["T_xy"] == goal["T_zx"]
    kinds, names = by_kind(found), found.bounds.names
    scales = [found.compare[0].ratio[names.index(f"S_{i}")] for i in "xyz"]
    assert kinds["scale"][-1] == pytest.approx(max(scales))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    site = ["--set", "site.latitude=34 deg", "--set", "site.gravity=9.7965(1) m/s^2"]
    assert run(["new", "strapdown", "--quiet", *site]) == 0
    return tmp_path


SEARCH = [
    "--set",
    "design.turns=5",
    "--set",
    "design.angles=['180 deg', '90 deg']",
    "--set",
    "design.time=4 min",
]


@pytest.mark.slow
def test_a_found_plan_is_a_table_of_a_study(folder, capsys):
    command = ["design", "strapdown", "strapdown.toml", *SEARCH]
    assert run([*command, "--out", "plan.toml", "--report", "page.html", "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "of prior  of goal" in said
    assert said.splitlines()[-1].startswith("ok: path of 5 turns in 240 s: u is ")
    assert "What the turns tell" in (folder / "page.html").read_text("utf-8")
    assert run([*command, "--out", "whole.json", "--quiet"]) == 0
    whole = json.loads((folder / "whole.json").read_text("utf-8"))["result"]
    study = (folder / "strapdown.toml").read_text("utf-8").partition("[plan]")[0]
    (folder / "again.toml").write_text(study + (folder / "plan.toml").read_text("utf-8"), "utf-8")
    again = ic.design("again.toml").estimate.result
    assert again["turns"] == whole["turns"]
    assert again["predicted"] == pytest.approx(whole["predicted"], rel=1e-6)
    means = [each["geometric_mean"] for each in whole["compare"]]
    assert means[0] < means[1]
    assert [each["name"] for each in whole["compare"]][:2] == ["found", "study"]
    assert sum(len(each["tells"]) > 0 for each in whole["by_turn"]) == 5


@pytest.mark.kernels
def test_what_cannot_be_designed_is_said(folder):
    text = (folder / "strapdown.toml").read_text("utf-8")
    without = text.partition("[plan]")[0]
    (folder / "none.toml").write_text(without, "utf-8")
    with pytest.raises(StudyError, match=r"plan\.turns: missing, expected turns, or a table \[design\]"):
        ic.design("none.toml")
    with pytest.raises(StudyError, match="plan: missing, expected turns"):
        ic.simulate("none.toml", np.random.default_rng(1))
    (folder / "none.toml").write_text(without + '[plan]\nturn_time = "4 s"\n', "utf-8")
    with pytest.raises(StudyError, match=r"plan\.turns: missing, expected turns"):
        ic.simulate("none.toml", np.random.default_rng(1))
    with pytest.raises(InputError, match="expected 'strapdown'"):
        ic.design("strapdown.toml", "positions")


@pytest.mark.kernels
def test_the_named_path_visits_19_positions():
    seen = [start_attitude(plan())]
    for axis, angle in NINETEEN:
        from inercal.foundation.geometry.rotations import elementary

        seen.append(seen[-1] @ elementary("xyz"[axis], angle))
    assert len(seen) == 19
    assert not any(np.allclose(one, other) for one, other in pairwise(seen))
    assert plan().turns == pytest.approx(np.array(NINETEEN))
