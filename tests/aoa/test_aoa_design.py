"""Layouts of a model's sensors: bounds against closed forms and Monte Carlo, layouts side by side, the command."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, NOISE, G, layout, study

import inercal as ic
from inercal.cli import run
from inercal.faces.python.study import read_study
from inercal.foundation.errors import StudyError
from inercal.systems.aoa.design import compare, courses_of, sample_bound, settled_u, undisturbed
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.layout import axes, tangential_arms
from inercal.systems.aoa.paper.residuals import error_terms
from inercal.systems.aoa.settings import Goal, Noise, Prior
from inercal.systems.aoa.simulate import drawn_biases, simulate
from rows import for_each

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
    bound, squares = settled_u(of, of.layout, undisturbed(of, of.layout)), []
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


def test_one_accelerometer_more_is_better():
    """At the same places: a fourth one takes nothing of what three tell."""
    of = study(states=8, motion=QUICK, noise=WHITE, prior=EXACT)
    four = replace(
        of.layout,
        names=("a1", "a2", "a3", "a4"),
        angle=np.append(of.layout.angle, 0.0),
        r=np.append(of.layout.r, -0.05),
        z=np.zeros(4),
    )
    by_three, by_four = (sample_bound(of, each, courses_of(of)) for each in (of.layout, four))
    assert by_four < by_three


@pytest.fixture(scope="module")
def compared():
    """The stated layout, a short base line, and a fourth accelerometer."""
    short = layout((0.05, 0.2, 0.25))
    with_fourth = replace(
        short,
        names=("a1", "a2", "a3", "a4"),
        angle=np.append(layout().angle, 0.0),
        r=np.append(layout().r, -0.1),
        z=np.zeros(4),
    )
    of = study(motion=QUICK, goal=Goal(0.03 * DEG), layouts={"short": short, "fourth": with_fourth})
    return of, compare(of)


@pytest.mark.slow
def test_layouts_side_by_side_are_each_as_if_stated(compared):
    """Each has the bounds of a study whose [sensors] it is; u of the errors of its own sensors is below the prior."""
    of, found = compared
    assert [bound.name for bound in found.bounds] == ["stated", "short", "fourth"]
    for bound in found.bounds:
        (alone,) = compare(replace(of, layout=bound.layout, layouts={}, goal=Goal())).bounds
        assert (alone.fusion, alone.sample) == (bound.fusion, bound.sample)
        assert alone.sensors == bound.sensors
        posed = problem(replace(of, layout=bound.layout))
        prior = np.sqrt(np.diag(posed.covariance))
        assert list(bound.sensors) == list(posed.nuisances)
        for name, k in posed.nuisances.items():
            assert 0.0 < bound.sensors[name] <= prior[k] * (1.0 + 1e-9)
    stated, short, fourth = found.bounds
    assert fourth.fusion < stated.fusion
    assert short.sample > stated.sample
    told = found.result["layouts"]
    assert [layout["u"] for layout in told] == [bound.fusion for bound in found.bounds]
    assert told[2]["sensors"][3] == {"name": "a4", "angle_rad": 0.0, "r_m": -0.1, "z_m": 0.0}
    assert f"deg by {min(found.bounds, key=lambda bound: bound.fusion).name}" in found.message


@pytest.mark.slow
def test_accelerometers_as_good_as_the_goal_asks_for(compared):
    """With that factor on noise and bias u is the wanted one; no accelerometers reach a goal far below."""
    of, found = compared
    stated = found.bounds[0]
    assert 1.0 < stated.factor < 10.0
    noise = of.noise
    worse = replace(
        noise,
        accelerometer=noise.accelerometer * stated.factor,
        accelerometer_bias=noise.accelerometer_bias * stated.factor,
    )
    reached = settled_u(replace(of, noise=worse), of.layout, undisturbed(of, of.layout))
    assert reached == pytest.approx(0.03 * DEG, rel=0.03)
    assert found.result["layouts"][0]["accelerometer"] == pytest.approx(noise.accelerometer * stated.factor)
    never = compare(replace(of, goal=Goal(1e-6 * DEG), layouts={}))
    assert math.isnan(never.bounds[0].factor)
    assert never.result["layouts"][0]["accelerometer"] is None
    (missed,) = never.findings
    assert missed.code == "goal_missed"
    assert never.message.endswith("are reached by none")


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
[layouts.fourth]
a2.axis = "+z"
a3 = { angle = "10 deg", r = "5 cm", z = "1 cm" }
"""


def test_a_layout_differs_from_the_sensors_where_it_says_so(tmp_path):
    (tmp_path / "aoa.toml").write_text(STUDY)
    settings = ic.study(tmp_path / "aoa.toml").settings
    found = settings.layouts["fourth"]
    assert found.names == ("a1", "a2", "a3")
    np.testing.assert_allclose(np.degrees(found.angle), [90.0, -90.0, 10.0])
    np.testing.assert_allclose(found.r, [-0.1, 0.2, 0.05])
    np.testing.assert_allclose(found.z, [0.0, 0.0, 0.01])
    np.testing.assert_allclose(np.degrees(settings.layout.angle), [90.0, 0.0])


@pytest.mark.slow
def test_the_command_compares(tmp_path, capsys):
    (tmp_path / "aoa.toml").write_text(STUDY)
    words = ["design", "aoa", str(tmp_path / "aoa.toml")]
    assert run([*words, "--out", str(tmp_path / "all.toml"), "--report", str(tmp_path / "page.html")]) == 0
    told = capsys.readouterr().out
    assert "u, one sample [deg]" in told
    assert "noise for the goal" not in told
    page = (tmp_path / "page.html").read_text()
    assert "Layouts side by side" in page
    assert "Where the sensors are: fourth" in page
    assert run([*words, "--json", "--set", "goal.theta=0.1 deg"]) == 0
    stated, fourth = json.loads(capsys.readouterr().out)["result"]["layouts"]
    assert (stated["name"], fourth["name"]) == ("stated", "fourth")
    assert fourth["u"] < stated["u"]
    assert fourth["accelerometer"] > stated["accelerometer"] > 0.0
    assert set(fourth["predicted"]) - set(stated["predicted"]) == {"b_3", "dr_3", "zo_3"}


@for_each(
    ("key", "words"),
    [
        ('layouts.x.a4={axis="+x",r="1 cm"}', "layouts.x: found a4 without a3"),
        ('layouts.x.a3.r="1 cm"', "layouts.x: a3: found neither axis nor angle"),
        ('layouts.x.a2.axis="-z"', "layouts.x: found accelerometers whose axes are all parallel"),
        ('layouts.x.a1.r="1 km"', "layouts.x.a1.r: found '1 km', that is 1000 m, expected a position"),
        ('layouts.x.a1.bias="1 mg"', "layouts.x.a1.bias: unknown key"),
        ('layouts.stated.a1.r="1 cm"', "layouts: found the name 'stated', expected one of 40 characters"),
        ("design.places=3", "design: found, which is gone since 0.3.0, expected in its place [layouts.NAME]"),
    ],
)
def test_refusals(key, words, tmp_path):
    (tmp_path / "aoa.toml").write_text(STUDY.partition("[layouts")[0])
    with pytest.raises(StudyError) as refused:
        read_study("aoa", tmp_path / "aoa.toml", [key])
    assert words in str(refused.value)


def test_a_comparison_needs_a_motion():
    with pytest.raises(StudyError, match=r"motion: missing"):
        compare(study(motion=None))
