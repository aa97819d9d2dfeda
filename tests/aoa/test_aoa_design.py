"""Where accelerometers sit best: bounds against closed forms and Monte Carlo, the search, the command."""

import json
import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, NOISE, G, layout, study

import inercal as ic
from inercal.aoa import design as designs
from inercal.aoa.design import design, fusion_bound, sample_bound, study_tables
from inercal.aoa.fusion.filter_result import estimate
from inercal.aoa.fusion.problem import problem
from inercal.aoa.layout import axes, tangential_arms
from inercal.aoa.paper.residuals import error_terms
from inercal.aoa.settings import Design, Goal, Noise, Prior
from inercal.aoa.simulate import drawn_biases, simulate
from inercal.cli import run
from inercal.errors import StudyError

TINY = 1e-15
WHITE = Noise(1e-4 * G, TINY, 0.2 * DEG, TINY)
EXACT = Prior(lever_common=TINY, lever=TINY, height=TINY, gyro_scale=TINY)
QUICK = replace(BASE, duration=8.0, sample_rate=100.0)


def still(*degrees):
    theta = np.array(degrees) * DEG
    return theta, np.zeros(len(theta)), np.zeros(len(theta))


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, -50.0])
def test_the_papers_layout_in_closed_form(angle):
    """White errors, the pivot midway: the arms are square to the slopes, u = dA / (g sqrt(cos^2 + 2 sin^2))."""
    of = study(noise=WHITE, prior=EXACT)
    expected = 1e-4 / math.sqrt(1.0 + math.sin(angle * DEG) ** 2)
    assert sample_bound(of, of.layout, still(angle)) == pytest.approx(expected, rel=1e-6)


def test_the_base_line_is_that_of_the_dual_accelerometer():
    """A1 + r1 al, by al = (A1 + A3)/L: noise sqrt(r1^2 + r3^2)/|r3 - r1|, at 90 deg all of u."""
    of = study(noise=WHITE, prior=EXACT)
    for r1, r3 in ((-0.25, 0.25), (-0.05, 0.45), (0.1, 0.3), (0.2, 0.3)):
        found = sample_bound(of, layout((r1, 0.0, r3)), still(90.0))
        assert found == pytest.approx(1e-4 * math.hypot(r1, r3) / abs(r3 - r1), rel=1e-6)


def test_two_accelerometers_in_motion_cannot_tell_angle_and_acceleration_at_zero_arm():
    of = study(noise=WHITE, prior=EXACT)
    assert sample_bound(of, layout((0.2, 0.0, 0.2)).of(0, 2), still(40.0)) == math.inf


def test_the_bound_of_a_sample_is_that_of_many_draws():
    """The best linear estimate of one row with all errors drawn, as they act: its rms over 20000 draws scatters by
    0.5 %, and second-order parts of 3 mm and 5 mm are below that."""
    of = study()
    theta, w, al = np.array([35.0 * DEG]), np.array([1.0]), np.array([-3.0])
    n, N = 3, 20000
    rng = np.random.default_rng(8)
    prior, noise, r, z = of.prior, of.noise, of.layout.r, of.layout.z
    dr = prior.lever_common * rng.standard_normal((N, 1)) + prior.lever * rng.standard_normal((N, n))
    zo = prior.height * rng.standard_normal((N, n))
    b = (
        math.sqrt(0.5)
        * noise.accelerometer_bias
        * (rng.standard_normal((N, 1)) + rng.standard_normal((N, n)))
    )
    scale = 1.0 + prior.gyro_scale * rng.standard_normal((N, 1))
    gyro = (
        scale * w + noise.gyro * rng.standard_normal((N, 1)) + noise.gyro_bias * rng.standard_normal((N, 1))
    )
    cos, sin = np.cos(of.layout.angle), np.sin(of.layout.angle)
    read = (-(r + dr) * w**2 - (z + zo) * al) * cos - ((r + dr) * al - (z + zo) * w**2) * sin
    read = read + b + noise.accelerometer * rng.standard_normal((N, n)) + r * cos * gyro**2
    expected = -z * al * cos - r * al * sin
    e = read - expected
    C = sum(
        np.broadcast_to(weight, 1)[0] * matrix
        for weight, matrix in error_terms(of, "dual", of.layout, 1.0, w, al, np.ones(1), 1.0)
    )
    direction = axes(of.layout)
    H = np.column_stack(
        [G * (np.cos(theta) * direction[:, 0] - np.sin(theta) * direction[:, 1]), tangential_arms(of.layout)]
    )
    gain = np.linalg.solve(H.T @ np.linalg.solve(C, H), H.T) @ np.linalg.inv(C)
    found = float(np.sqrt(np.mean((e @ gain[0]) ** 2)))
    assert found == pytest.approx(sample_bound(of, of.layout, (theta, w, al)), rel=0.03)


@pytest.mark.slow
def test_the_bound_of_the_fusion_is_that_of_many_runs():
    """Constants drawn from the prior, flexure none: the filter expects one, so errors are at most the bound, and no
    less than half of it; 16 runs, whose rms of about one degree of freedom each scatters by 0.18."""
    of = study(motion=QUICK)
    bound, squares = fusion_bound(of, of.layout), []
    for seed in range(16):
        rng = np.random.default_rng([5, seed])
        prior = of.prior
        errors = drawn_biases(NOISE, 3, rng)
        common = prior.lever_common * rng.standard_normal()
        for k in (1, 2, 3):
            errors[f"dr_{k}"] = common + prior.lever * rng.standard_normal()
            errors[f"zo_{k}"] = prior.height * rng.standard_normal()
        errors["k_g"] = prior.gyro_scale * rng.standard_normal()
        told = simulate(of, rng, errors)
        found = estimate(told.recording, problem(of))
        squares.append(np.mean((found.theta - told.theta)[told.recording.t >= 2.0] ** 2))
    ratio = math.sqrt(float(np.mean(squares))) / bound
    assert 0.4 < ratio < 1.0 + 4.0 * 0.18


def test_exchange_finds_what_all_layouts_hold(monkeypatch):
    of = study(motion=QUICK, design=Design(3, -0.2, 0.3, 4))
    states = designs.courses_of(of)
    spots = [
        (angle, float(r)) for angle in (0.0, 0.5 * math.pi, -0.5 * math.pi) for r in np.linspace(-0.2, 0.3, 4)
    ]
    whole = designs._search(of, spots, 3, states)
    monkeypatch.setattr(designs, "_MOST_LAYOUTS", 1)
    assert designs._search(of, spots, 3, states)[0].sample == pytest.approx(whole[0].sample, rel=1e-6)


def test_one_accelerometer_more_is_better():
    of = study(states=8, motion=QUICK, noise=WHITE, prior=EXACT)
    spots = [(angle, float(r)) for angle in (0.0, -0.5 * math.pi) for r in np.linspace(-0.05, 0.4, 3)]
    three, four = (designs._search(of, spots, count, designs.courses_of(of))[0].sample for count in (3, 4))
    assert four < three


@pytest.mark.slow
def test_accelerometers_as_good_as_the_goal_asks_for():
    of = study(motion=QUICK, design=Design(3, places=2), goal=Goal(0.02 * DEG))
    found = design(of)
    assert 1.0 < found.factor < 10.0
    reached = fusion_bound(designs._times(of, found.factor), found.best.layout)
    assert reached == pytest.approx(0.02 * DEG, rel=0.03)
    assert found.result["accelerometer"] == pytest.approx(1e-4 * G * found.factor)
    times, u = np.array(found.qualities).T
    assert (np.diff(u) > 0.0).all()
    assert u[times == pytest.approx(1.0)] == pytest.approx(found.best.fusion)
    assert designs._factor(of, found.best.layout, 0.02 * DEG, found.qualities) == found.factor
    never = design(replace(of, goal=Goal(1e-6 * DEG)))
    assert math.isnan(never.factor)
    (missed,) = never.findings
    assert missed.code == "goal_missed"


STUDY = """
[site]
gravity = "9.80665 m/s^2"
[rig]
kind = "sting"
[sensors.a1]
axis = "-z"
r = "-0.1 m"
[sensors.a2]
axis = "+x"
r = "0.20 m"
[sensors.gyro]
[noise]
accelerometer = "1e-4 g"
accelerometer_bias = "1e-4 g"
gyro = "0.2 deg/s"
gyro_bias = "5 deg/h"
[motion]
kind = "sine"
mean = "30 deg"
amplitude = "10 deg"
frequency = "1 Hz"
duration = "6 s"
sample_rate = "100 Hz"
[design]
accelerometers = 3
places = 3
axes = ["+x", "+z", "-z"]
"""


@pytest.mark.slow
def test_the_command_writes_sensors_that_a_study_can_have(tmp_path, capsys):
    (tmp_path / "aoa.toml").write_text(STUDY)
    words = ["design", "aoa", str(tmp_path / "aoa.toml")]
    assert (
        run([*words, "--out", str(tmp_path / "sensors.toml"), "--report", str(tmp_path / "page.html")]) == 0
    )
    assert "as stated" in capsys.readouterr().out
    assert "How u depends on base line and accelerometers" in (tmp_path / "page.html").read_text()
    sensors = tomllib.loads((tmp_path / "sensors.toml").read_text())["sensors"]
    assert sorted(sensors) == ["a1", "a2", "a3"]
    head, _, tail = STUDY.partition("[sensors.a1]")
    other = head + (tmp_path / "sensors.toml").read_text() + tail[tail.index("[sensors.gyro]") :]
    (tmp_path / "best.toml").write_text(other)
    assert len(ic.study(tmp_path / "best.toml").settings.layout.names) == 3
    assert run([*words, "--json", "--set", "goal.theta=0.02 deg"]) == 0
    told = json.loads(capsys.readouterr().out)["result"]
    assert told["best"]["u"] <= told["stated"]["u"]
    assert told["accelerometer"] > 0.0


def test_study_tables_of_any_axis():
    assert 'axis = "-z"\nr = "-250 mm"' in study_tables(layout())


def test_refusals(tmp_path):
    with pytest.raises(StudyError, match=r"motion: missing"):
        design(study(motion=None))
    with pytest.raises(StudyError, match=r"design\.accelerometers: found 9, expected 8 at most"):
        design(study(design=Design(9, places=2)))
    (tmp_path / "aoa.toml").write_text(STUDY.replace("places = 3", 'places = 3\nrearmost = "1 m"'))
    with pytest.raises(StudyError, match=r"design\.rearmost: found 1 m with foremost 0.25 m"):
        ic.study(tmp_path / "aoa.toml")
