"""Tolerances from a goal: against a covariance written out once more, and all combinations of small tables."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from turntable_studies import ARCMIN, DEG_H, TUMBLE, WHEEL_X, references, study, table, wheel_output

import inercal as ic
from inercal.cli import run
from inercal.foundation.designs.tolerances import LOOSEST, Price
from inercal.foundation.errors import StudyError
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.systems.turntable.figures.tolerances import page
from inercal.systems.turntable.positions.front import front
from inercal.systems.turntable.positions.tolerance_design import design_tolerances
from inercal.systems.turntable.positions.tolerance_result import result
from inercal.systems.turntable.settings import Constraint, Tolerances

NOISE = 0.01 * DEG_H
TERMS = ("DX_F", "DX_X", "DX_Y", "DX_Z", "DX_XX", "DX_YY", "DX_XY", "DX_XZ", "DX_YZ")
SIZES = {"dphi_y1": 2.0, "deps_y": 1.0, "dalpha_x2": 2.0, "dtheta_z": 0.5}
"""Present half widths [arcmin]."""
REDRAWN = {"dphi_y1": True, "deps_y": False, "dalpha_x2": True, "dtheta_z": False}
LEVELS = ((0.1, 8.0), (0.3, 3.0), (1.0, 1.0), (3.0, 0.2))
GOAL = {"DX_F": 0.007 * DEG_H, "DX_X": 0.0052 * DEG_H}


def settings(goal=GOAL, prices=None, position=0.0, compare=()):
    chain = turntable(
        "two_axis_turntable", None, {name: uniform(size * ARCMIN) for name, size in SIZES.items()}
    )
    made = study(TUMBLE, chain, coefficients=WHEEL_X, noise=NOISE, earth_rate="stated")
    given = prices or {name: Price(levels=LEVELS) for name in chain.factors}
    design = replace(made.design, candidates=grid((12, 12)), compare=compare)
    return replace(made, design=design, tolerances=Tolerances(goal, given, position))


def covariance(angles, half_widths, noise=NOISE):
    """Of the nine drift terms by least squares weighted for noise and table; derivatives by differences."""
    a, w = references(angles, {})
    A = np.stack(
        [wheel_output("x", {"DX_F": 0.0} | dict.fromkeys(WHEEL_X, 0.0) | {term: 1.0}, a, w) for term in TERMS]
    )
    V = noise**2 * np.eye(len(angles))
    for name, half in half_widths.items():
        step = 1e-5
        plus, minus = (wheel_output("x", WHEEL_X, *references(angles, {name: s * step})) for s in (1, -1))
        moved = (plus - minus) / (2.0 * step) * half / np.sqrt(3.0)
        V += np.diag(moved**2) if REDRAWN[name] else np.outer(moved, moved)
    return np.linalg.inv(A @ np.linalg.solve(V, A.T))


def u_of(designed, x):
    angles = np.tile(designed.best.test.plan.angles, (designed.best.test.repeats, 1))
    widths = {name: size * ARCMIN * by for (name, size), by in zip(SIZES.items(), x, strict=True)}
    return dict(zip(TERMS, np.sqrt(np.diag(covariance(angles, widths))), strict=True))


def test_the_chain_has_the_order_of_the_sizes():
    assert settings().chain.factors == tuple(SIZES)


def test_the_cheapest_of_all_combinations_is_found():
    """256 combinations of four errors on the 24-position tumble, each judged by that covariance."""
    made = settings()
    designed = design_tolerances(made)
    tumble = next(each for each in designed.tried if each.test.plan.name == "24-position")
    costs = {}
    for choice in itertools.product(LEVELS, repeat=4):
        widths = {n: s * ARCMIN * level for (n, s), (level, _) in zip(SIZES.items(), choice, strict=True)}
        u = dict(zip(TERMS, np.sqrt(np.diag(covariance(TUMBLE.angles, widths))), strict=True))
        if all(u[name] <= wanted for name, wanted in GOAL.items()):
            costs[tuple(level for level, _ in choice)] = sum(cost for _, cost in choice)
    assert 0 < len(costs) < 256
    assert tumble.cost == pytest.approx(min(costs.values()), rel=1e-9)
    assert designed.best.cost <= tumble.cost


def test_powers_reach_the_goals_and_no_more():
    """Goals that bind are met with equality, and every small loosening or exchange that reaches them costs more."""
    prices = dict(
        zip(SIZES, (Price(1.0, 1.0), Price(2.0, 1.0), Price(1.0, 2.0), Price(0.5, 1.0)), strict=True)
    )
    designed = design_tolerances(settings(prices=prices))
    u = u_of(designed, designed.x)
    slack = {name: u[name] / wanted for name, wanted in GOAL.items()}
    assert max(slack.values()) == pytest.approx(1.0, abs=1e-6)
    rng = np.random.default_rng(20261122)
    for _ in range(200):
        x = np.minimum(designed.x * np.exp(rng.normal(0.0, 0.1, 4)), LOOSEST)
        near = u_of(designed, x)
        if all(near[name] <= wanted for name, wanted in GOAL.items()):
            assert (
                sum(p.at(float(by)) for p, by in zip(prices.values(), x, strict=True))
                > designed.best.cost - 1e-6
            )
    made = result(designed, settings(prices=prices))
    assert [goal["u"] for goal in made["goals"]] == pytest.approx([u[name] for name in GOAL], rel=1e-5)
    for goal in made["goals"]:
        parts = [each["share"][goal["name"]] for each in made["tolerances"]]
        assert sum(parts) + goal["share_of_noise"] + sum(goal["share_of_inputs"].values()) == pytest.approx(
            1.0
        )
    present = u_of(designed, np.ones(4))
    assert [goal["u_present"] for goal in made["goals"]] == pytest.approx(
        [present[n] for n in GOAL], rel=1e-5
    )
    kept = designed.x.copy()
    kept[0] = 1.0
    worst = max(u_of(designed, kept)[name] / wanted for name, wanted in GOAL.items())
    assert made["tolerances"][0]["kept_present"] == pytest.approx(worst, rel=1e-5)


def test_the_drift_after_compensation_is_a_goal():
    """Its u is the root of the mean of r^T C r over directions of gravity, here 20000 drawn ones."""
    designed = design_tolerances(settings({"drift": 0.01 * DEG_H}))
    made = result(designed, settings({"drift": 0.01 * DEG_H}))["goals"][0]
    widths = {name: size * ARCMIN * by for (name, size), by in zip(SIZES.items(), designed.x, strict=True)}
    C = covariance(designed.best.test.plan.angles, widths)
    a = np.random.default_rng(7).standard_normal((3, 20_000))
    a /= np.linalg.norm(a, axis=0)
    rows = np.stack([np.ones(a.shape[1]), *a, a[0] ** 2, a[1] ** 2, a[0] * a[1], a[0] * a[2], a[1] * a[2]])
    mean = np.einsum("pn,pq,qn->n", rows, C, rows).mean()
    assert made["u"] == pytest.approx(np.sqrt(mean), rel=0.01)
    assert made["u"] <= 0.01 * DEG_H * (1.0 + 1e-9)


def test_positions_are_repeated_where_that_is_cheaper_than_tolerances():
    free = design_tolerances(settings())
    priced = design_tolerances(settings(position=1e-3))
    assert free.best.test.repeats == 1
    assert priced.best.test.repeats > 1
    assert priced.best.cost < free.best.cost
    at = priced.best.test
    costs = sum(Price(levels=LEVELS).at(float(x)) for x in priced.x) + 1e-3 * at.repeats * len(at.plan)
    assert priced.best.cost == pytest.approx(costs)
    u = u_of(priced, priced.x)
    assert all(u[name] <= wanted * (1.0 + 1e-9) for name, wanted in GOAL.items())


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ({"DX_F": 1e-5 * DEG_H}, r"goal.DX_F: no tolerances reach it: .* by the noise of the readings"),
        ({"k_x": 1e-3}, r"goal.k_x: found a term that is not fitted"),
        ({}, r"goal: missing"),
    ],
)
def test_goals_out_of_reach_end_in_one_sentence(goal, words):
    with pytest.raises(StudyError, match=words):
        design_tolerances(settings(goal))


def test_a_size_that_cannot_be_had_is_named():
    made = settings({"DX_X": 1e-4 * DEG_H})
    quiet = replace(made, instrument=replace(made.instrument, noise=1e-5 * DEG_H))
    with pytest.raises(StudyError, match=r"goal.DX_X: no tolerances reach it: .* by dtheta_z"):
        design_tolerances(quiet)


def test_a_study_without_noise_or_errors_is_refused():
    made = settings()
    with pytest.raises(StudyError, match=r"instrument.noise: missing"):
        design_tolerances(replace(made, instrument=replace(made.instrument, noise=None)))
    with pytest.raises(StudyError, match=r"rig.errors: found none"):
        design_tolerances(replace(made, chain=table(0.0)))


def test_a_page_of_tolerances():
    made = settings()
    found = ic.design(ic.study("turntable", **STUDY), "tolerances")
    text = page(design_tolerances(made), made, found.estimate)
    for words in (
        "Tolerances to ask for",
        "What each tolerance is bought for",
        "u over goal, if kept",
        "24-position",
    ):
        assert words in text
    assert "<script" not in text


STUDY = {
    "site": {"latitude": "39.1 deg", "gravity": "9.8 m/s^2"},
    "rig": {"kind": "two_axis_turntable", "errors": {"default": {"uniform": "2 arcmin"}}},
    "positions": {"plan": "12-position"},
    "design": {"positions": 12, "candidates": {"phi1": 12, "phi2": 12}, "compare": []},
    "instrument": {"kind": "accelerometer", "unit": "g", "noise": "20 ug", "coefficients": {"K1_x": 1.0}},
    "goal": {"K0_x": "50 ug", "K1_x": "50 ppm"},
    "cost": {
        "default": {"cost": 1.0, "exponent": 1.0},
        "dphi_y1": {"table": [["2 arcmin", 1], ["20 arcsec", 5]]},
    },
}
TOML = """
[site]
latitude = "39.1 deg"
gravity = "9.8 m/s^2"
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = { uniform = "2 arcmin" }
[positions]
plan = "12-position"
[design]
positions = 12
candidates = { phi1 = 12, phi2 = 12 }
compare = []
[instrument]
kind = "accelerometer"
unit = "g"
noise = "20 ug"
[instrument.coefficients]
K1_x = 1.0
[goal]
K0_x = "50 ug"
K1_x = "50 ppm"
[cost]
dphi_y1 = { table = [["2 arcmin", 1], ["20 arcsec", 5]] }
"""


def test_the_command_writes_tables_that_reach_the_goals(tmp_path, capsys):
    file, out = tmp_path / "table.toml", tmp_path / "tolerances.toml"
    file.write_text(TOML)
    assert run(["design", "tolerances", str(file), "--json", "--out", str(out)]) == 0
    made = json.loads(capsys.readouterr().out)["result"]
    assert {each["error"] for each in made["tolerances"]} >= {"dphi_y1", "dtheta_x"}
    errors, positions = out.read_text().split("\n\n")[:2]
    again = tmp_path / "again.toml"
    body = TOML.replace('[rig.errors]\ndefault = { uniform = "2 arcmin" }\n', errors.split("\n", 1)[1] + "\n")
    body = body.replace('[positions]\nplan = "12-position"\n', positions + "\n").split("[goal]")[0]
    again.write_text(body)
    assert run(["design", "positions", str(again), "--json"]) == 0
    compared = json.loads(capsys.readouterr().out)["result"]["compare"]
    taken = next(each for each in compared if each["name"] == "list")
    for goal in made["goals"]:
        assert taken["predicted"][goal["name"]] == pytest.approx(goal["u"], rel=1e-4)


def test_what_was_measured_and_harmonics_are_not_for_sale(tmp_path, capsys):
    file = tmp_path / "table.toml"
    measured = 'deps_x = { value = "3(1) arcsec", certificate = "K-1" }'
    harmonic = 'dphi_z2 = { uniform = "1 arcmin", harmonics = [{ order = 1, amplitude = "2 arcsec" }] }'
    kept = 'default = { uniform = "2 arcmin" }\n'
    file.write_text(TOML.replace(kept, f"{kept}{measured}\n{harmonic}\n"))
    assert run(["design", "tolerances", str(file), "--json"]) == 0
    by_name = {each["error"]: each for each in json.loads(capsys.readouterr().out)["result"]["tolerances"]}
    fixed = [each for name, each in by_name.items() if each["cost"] == 0.0]
    assert len(fixed) == 3  # the measured one, and two quadratures
    assert all(each["factor"] == 1.0 for each in fixed)
    assert by_name["dphi_z2"]["cost"] > 0.0
    assert run(["design", "tolerances", str(file), "--set", "cost.deps_x.cost=2"]) == 2
    assert "cost.deps_x: the table has no such tolerance" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('goal.K0_x="5 deg"', "goal.K0_x: found '5 deg'"),
        ('goal.DX_F="5 deg/h"', "goal.DX_F: unknown term"),
        ('goal.K0_x="0 ug"', "goal.K0_x: found '0 ug', expected a u above zero"),
        ("cost.dphi_y1.cost=2", "cost.dphi_y1: found a table beside cost or exponent"),
        ('cost.deta.table=[["1 um", 1]]', "cost.deta"),
        ('cost.dphi_y1.table=[["1 kg", 1]]', "cost.dphi_y1.table"),
    ],
)
def test_bad_goals_and_costs_get_one_line(tmp_path, capsys, line, words):
    file = tmp_path / "table.toml"
    file.write_text(TOML)
    assert run(["design", "tolerances", str(file), "--set", line]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert words in said.err
    assert said.err.count("\n") == 1


@pytest.mark.slow
def test_the_front_against_the_covariance_written_out():
    """Cheapest tolerances at each number of positions and u of the drift: u is that of the covariance written out here
    over random directions of gravity, 40000 of which tell the mean to 1 %; more positions never cost more,
    nor does a larger u."""
    of = settings(prices={name: Price() for name in SIZES})
    found = front(replace(of, design=replace(of.design, positions=16)))
    a = np.random.default_rng(4).standard_normal((3, 40000))
    a /= np.linalg.norm(a, axis=0)
    rows = np.stack(
        [
            wheel_output("x", {"DX_F": 0.0} | dict.fromkeys(WHEEL_X, 0.0) | {term: 1.0}, a, np.zeros_like(a))
            for term in TERMS
        ]
    )
    for point in found.points[::4]:
        widths = {name: size * ARCMIN * by for (name, size), by in zip(SIZES.items(), point.x, strict=True)}
        C = covariance(point.plan.angles, widths)
        assert np.sqrt(np.einsum("pn,pq,qn->n", rows, C, rows).mean()) == pytest.approx(point.drift, rel=0.02)
    cost = {(len(point.plan), point.drift): point.cost for point in found.points}
    for (number, drift), price in cost.items():
        assert all(price >= other for (n, u), other in cost.items() if u == drift and n > number)
        assert all(price >= other for (n, u), other in cost.items() if n == number and u > drift)


@pytest.mark.slow
def test_low_sensitivity_never_lowers_the_cost():
    """The constraint leaves fewer positions to choose from; what leaves none is refused."""
    of = settings(prices={name: Price() for name in SIZES})
    asked = replace(
        of.design, positions=12, constraint=Constraint(("dalpha_x2", "dtheta_z"), ("ax", "ay"), 0.6)
    )
    found = front(replace(of, design=asked)).points
    cost = {(point.constrained, len(point.plan), point.drift): point.cost for point in found}
    pairs = [(cost[False, n, u], price) for (constrained, n, u), price in cost.items() if constrained]
    assert pairs
    assert all(price >= 0.98 * free for free, price in pairs)  # searches are from random starts
    tight = replace(asked, constraint=replace(asked.constraint, below=1e-9))
    with pytest.raises(
        StudyError, match=r"design\.sensitivity\.below: found 1e-09, which leaves too few positions"
    ):
        front(replace(of, design=tight))
