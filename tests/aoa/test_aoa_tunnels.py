"""The fusion in what tunnels do, on recordings by a simulator that shares no code with it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from independent.aoa import CASES, DEG, LINES, G, Tunnel, simulate
from sting_study import NOISE, study

from inercal.faces.stream.aoa_state import choice_of, chosen
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.diagnosis.choice import decided, of_vibration
from inercal.systems.aoa.diagnosis.examination import diagnose, implausible
from inercal.systems.aoa.diagnosis.gyro_scale import alone
from inercal.systems.aoa.diagnosis.passed import heard, pass_of
from inercal.systems.aoa.diagnosis.small import further_ahead, with_axis
from inercal.systems.aoa.diagnosis.spectrum import of_rectification
from inercal.systems.aoa.fusion.filter_result import estimate, of_fusion
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.result.verification import contradicting_reference
from inercal.systems.aoa.settings import Estimator, Heave

SEEDS = 2
BUFFETS = [name for name in CASES if name.startswith("buffet")]


def recorded(case, seed, **tunnel):
    """A recording of a case, and its run."""
    run = simulate(Tunnel(**CASES[case], **tunnel), seed)
    return plain(run.t, run.acc, run.gyro), run


def judged(case, settings=study(), seeds=SEEDS, **tunnel):  # noqa: B008  (frozen)
    """Rms error [deg] and rms of error over u after 2 s, over all seeds, and the last filter with its problem."""
    of, errors, ratios = problem(settings), [], []
    for seed in range(seeds):
        run = simulate(Tunnel(duration=12.0, **CASES[case], **tunnel), seed)
        filtered = estimate(plain(run.t, run.acc, run.gyro), of)
        late = run.t > 2.0
        errors.append((filtered.theta - run.theta)[late] / DEG)
        ratios.append(DEG * errors[-1] / filtered.u[late])
    return *(float(np.sqrt(np.mean(np.square(each)))) for each in (errors, ratios)), filtered, of


@pytest.mark.parametrize("late", ["0.5", "1", "5"])
def test_a_late_gyro_costs_nothing(late):
    """0.5 to 5 ms that nobody states: 0.03 to 0.44 deg where they are taken for none. Of two draws of
    constants the rms over u is below the root of 13.8 / 2 with 99.9 %."""
    error, ratio, filtered, of = judged(f"gyro late {late} ms")
    assert error < 0.02
    assert ratio < np.sqrt(13.8 / SEEDS)
    at = of.names.index("tau_g")
    u = np.sqrt(filtered.state.P[at, at])
    assert u < 5e-5
    assert abs(filtered.state.x[at] - 1e-3 * float(late)) < 4.0 * u


@pytest.mark.parametrize("kind", ["polar", "rest"])
def test_where_nothing_shows_a_delay_it_is_not_learned_from_noise(kind):
    """An acceleration that is only noise multiplies a delay: unguarded, the filter was sure of one by 60 u off."""
    error, ratio, filtered, of = judged("quiet", kind=kind)
    assert error < 0.02
    assert ratio < np.sqrt(13.8 / SEEDS)
    at = of.names.index("tau_g")
    assert abs(filtered.state.x[at]) < 3.0 * np.sqrt(filtered.state.P[at, at])


def test_an_offset_by_vibration_is_in_u_where_k2_is_stated_and_named_where_not():
    """3 g rms and a K2 of up to 100 ug/g^2, drawn for each of three sensors. Of eight draws the mean square over u^2 is
    below 26.1 / 8 with 99.9 %. Unstated it is named."""
    squares = np.zeros((2, 8))
    for seed in range(8):
        tunnel = Tunnel("rest", duration=6.0, fs=1e3, local=(3.0 * G, 300.0, 480.0))
        run, calm = simulate(tunnel, seed), simulate(replace(tunnel, local=None, acc_noise=0.0), seed)
        k2 = 1e-4 / G * np.random.default_rng(seed).uniform(-1.0, 1.0, 3)
        recording = plain(run.t, run.acc + k2 * (run.acc**2 - calm.acc**2), run.gyro)
        for k, stated in enumerate((0.0, 1e-4 / G)):
            told = study(noise=replace(NOISE, rectification=stated), band=Band(35.0))
            settings = decided(recording, told)
            found, late = estimate(recording, problem(settings)), run.t > 2.0
            squares[k, seed] = np.mean(np.square((found.theta - run.theta)[late] / found.u[late]))
            u = float(np.median(found.u[late]))
            codes = [each.code for each in of_rectification(recording, settings, u)]
            assert codes == ([] if stated else ["rectification"])
            assert chosen(told, choice_of(settings, final=True)).prior.rectified == settings.prior.rectified
    assert (squares.mean(axis=1) < 3.26).all()


def test_vibration_as_small_as_is_usual_makes_no_offset_to_speak_of():
    recording, _ = recorded("lines 0.3 g, 112 and 230 Hz", 0, duration=6.0)
    assert not of_rectification(recording, study(), 0.01 * DEG)


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["sine", *(pytest.param(each, marks=pytest.mark.campaign) for each in ("polar", "rest"))]
)
def test_in_a_buffet_the_snap_is_that_of_the_data(kind):
    """5 to 40 Hz, 0.05 to 0.3 deg rms: with the usual snap 3.5 u to 3900 u off; of ten draws, 1.4 u."""
    ratios = []
    for name in BUFFETS:
        for seed in range(2):
            recording, run = recorded(name, seed, duration=20.0, kind=kind)
            chosen = decided(recording, study())
            filtered = estimate(recording, problem(chosen))
            late = run.t > 2.0
            error = (filtered.theta - run.theta)[late]
            assert np.sqrt(np.mean(error**2)) < 0.05 * DEG, (name, seed)
            assert filtered.nis_mean < 0.5
            ratios.append(np.mean(np.square(error / filtered.u[late])))
    assert np.sqrt(np.mean(ratios)) < 1.4


def test_a_calm_motion_keeps_the_usual_snap():
    for kind in ("sine", "polar", "rest"):
        chosen = decided(recorded("quiet", 1, duration=12.0, kind=kind)[0], study())
        assert chosen.estimator.snap is None
        assert not len(chosen.band.sections)


def test_a_snap_is_chosen_by_its_size_and_not_by_noise():
    """0.1 deg rms of 5 to 40 Hz have 7e11 rad^2/s^7 at 40 Hz, 0.2 deg of 2 to 15 Hz 1e9 at 15 Hz; four times the stated
    noise alone asks for nothing."""
    for name, snap in (("buffet 0.1 deg, 5-40 Hz", 1e12), ("buffet 0.2 deg, 2-15 Hz", 1e9)):
        recording, _ = recorded(name, 1, duration=12.0)
        assert decided(recording, study()).estimator.snap == snap
    stated = study(estimator=Estimator(snap=3e9))
    assert decided(recording, stated).estimator.snap == 3e9
    loud, _ = recorded("quiet", 1, duration=12.0, acc_noise=4e-4 * G, gyro_noise=0.8 * DEG)
    assert decided(loud, study()).estimator.snap is None


@pytest.mark.parametrize("states", [8, 19])
@pytest.mark.parametrize("kind", ["sine", "rest"])
def test_at_20_hz_the_usual_snap_would_be_too_free(kind, states):
    """With it the square of what the rate may do in 50 ms counted as a bias of 3 mg: 0.1 deg at rest and 6 u with 8
    states, thousands of degrees in a sine with 19."""
    run = simulate(Tunnel(kind, duration=40.0, fs=20.0, constants=float(states == 19)), 1)
    recording, settings = plain(run.t, run.acc, run.gyro), study(states)
    filtered = estimate(recording, problem(decided(recording, settings)))
    error = (filtered.theta - run.theta)[run.t > 5.0]
    assert np.sqrt(np.mean(error**2)) < 0.06 * DEG
    assert np.sqrt(np.mean(np.square(error / filtered.u[run.t > 5.0]))) < 2.0


def test_pick_up_that_a_large_snap_could_take_for_motion_is_taken_out():
    """Its phases are such that a snap of 1e12 fits it at 50 Hz too: 0.09 deg and 3.4 u off."""
    recording, run = recorded("mains 50 mg", 1015, duration=30.0, kind="polar")
    chosen = decided(recording, study())
    assert chosen.band.notch == pytest.approx((50.0,), abs=0.1)
    error = (estimate(recording, problem(chosen)).theta - run.theta)[run.t > 2.0]
    assert np.sqrt(np.mean(error**2)) < 0.02 * DEG


VIBRATIONS = [name for name in LINES if name != "quiet"]


def test_lines_and_what_lies_above_the_motion_are_taken_out():
    """They are no rotation: no snap fits them. A line is notched; of vibration over a whole band is what is below."""
    chosen = {name: decided(recorded(name, 1, duration=12.0)[0], study()).band for name in VIBRATIONS}
    assert chosen["mains 50 mg"].notch == pytest.approx([50.0], abs=0.1)
    of_lines = chosen["lines 0.05 g, 47, 112, 230 Hz"].notch
    assert sorted(of_lines)[:2] == pytest.approx([47.0, 112.0], abs=0.2)
    assert 35.0 <= chosen["local 0.5 g, 120-240 Hz"].low_pass <= 70.0


def test_a_motion_that_is_there_keeps_its_band():
    """A buffet of 40 Hz beside lines: no low pass below 80 Hz."""
    both = {"lines": LINES["lines 0.3 g, 112 and 230 Hz"]["lines"], "buffet": (0.1 * DEG, 5.0, 40.0)}
    run = simulate(Tunnel("sine", duration=12.0, **both), 1)
    chosen = decided(plain(run.t, run.acc, run.gyro), study())
    assert chosen.band.low_pass > 2.0 * 38.0
    assert sorted(chosen.band.notch)[0] == pytest.approx(112.0, abs=0.2)


def test_a_plunge_is_allowed_for():
    """0.02 g at 2 Hz: with the usual flexure 0.1 deg and 9 u off; along the vertical it changes the size of gravity,
    not its direction, and costs a quarter of u at most."""
    ratios = []
    for seed in range(3):
        recording, run = recorded("plunge 0.02 g, 2 Hz", seed, duration=12.0)
        chosen = decided(recording, study())
        (said,) = of_vibration(study(), chosen)
        assert said.code == "wide_flexure"
        assert "plunges" in said.message
        assert chosen.prior.heave.vertical
        assert problem(chosen_again(said, chosen)).constants == problem(chosen).constants
        assert chosen_by_stream(chosen).prior == chosen.prior
        filtered, late = estimate(recording, problem(chosen)), run.t > 2.0
        quiet, _ = recorded("quiet", seed, duration=12.0)
        calm = estimate(quiet, problem(decided(quiet, study())))
        error = (filtered.theta - run.theta)[late]
        ratios.append(np.mean(np.square(error / filtered.u[late])))
        assert np.sqrt(np.mean(error**2)) < 0.03 * DEG
        assert np.median(filtered.u[late]) < 1.25 * np.median(calm.u[late])
    assert np.sqrt(np.mean(ratios)) < 1.4


def chosen_by_stream(settings):
    """The study that a stream has again from its state."""
    return chosen(study(), choice_of(settings, final=True))


def chosen_again(said, chosen):
    """The study with what the finding says to write, beside what else was chosen."""
    told = re.search(
        r'frequency = "(.*) Hz", damping = "(.*)", level = "(.*) g", direction = "vertical"', said.message
    )
    frequency, damping, level = map(float, told.groups())
    heave = Heave(frequency, damping, level * STANDARD_GRAVITY, "vertical")
    return replace(chosen, prior=replace(chosen.prior, heave=heave))


def test_single_spikes_do_not_contradict_the_model():
    """One sample in a thousand off by 0.5 g or 0.5 rad/s: held back, and no reason to give the angle up."""
    recording, run = recorded("quiet", 0, duration=12.0)
    rng = np.random.default_rng(0)
    acc = recording.acc + 0.5 * G * (rng.random(recording.acc.shape) < 1e-3)
    gyro = recording.gyro + 0.5 * (rng.random(len(run.t)) < 1e-3)
    filtered = estimate(plain(run.t, acc, gyro), problem(study()))
    assert filtered.nis_mean < 1.0
    assert np.sqrt(np.mean((filtered.theta - run.theta)[run.t > 2.0] ** 2)) < 0.03 * DEG


def test_a_reference_that_is_late_is_said():
    """3 ms at 63 deg/s are 13 u of the angle; 0.2 ms are none of its."""
    recording, run = recorded("quiet", 0, duration=12.0)
    angles = of_fusion(estimate(recording, problem(study())), 19)
    for late, words in ((3e-3, "3 ms later"), (-3e-3, "3 ms earlier"), (2e-4, "")):
        reference = np.interp(run.t - late, run.t, run.theta)
        said = [
            each.message for each in contradicting_reference(replace(recording, reference=reference), angles)
        ]
        assert ("theta_ref comes " + words in said[0]) if words else said == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "smoothed"),
    [
        ("sine", True),
        ("polar", False),
        ("rest", True),
        *(
            pytest.param(*each, marks=pytest.mark.campaign)
            for each in (("sine", False), ("polar", True), ("rest", False))
        ),
    ],
)
def test_in_vibration_the_angle_is_good_and_u_is_its_size(kind, smoothed):
    """Without a band 0.3 to 70 deg off, 24 to 210 u."""
    ratios = []
    for name in VIBRATIONS:
        for seed in range(2):
            recording, run = recorded(name, seed, duration=20.0, kind=kind)
            filtered = estimate(recording, problem(decided(recording, study())), smoothed)
            late = (run.t > 2.0) & (run.t < 19.8)
            error = (filtered.theta - run.theta)[late]
            assert np.sqrt(np.mean(error**2)) < 0.05 * DEG, (name, seed)
            ratios.append(np.mean(np.square(error / filtered.u[late])))
    assert np.sqrt(np.mean(ratios)) < 1.4


def said(recording, settings):
    """What the judge hears in a recording under a study."""
    of = problem(settings)
    return heard(pass_of(recording, of, settings, estimate(recording, of)))


@pytest.mark.slow
def test_a_gyro_that_is_no_such_gyro_has_a_wider_prior_and_u_holds():
    """1 % under one sine, where positions and heights take nearly all of it: 5 u off under the usual prior of 0.1 %.
    Of two draws of constants the mean square over u^2 is below 13.8 / 2 with 99.9 %."""
    squares, late = [], slice(1000, None)
    for seed in range(SEEDS):
        run = simulate(Tunnel(duration=15.2), seed)
        wrong = (1.0 + 0.01) / (1.0 + run.errors["k_g"])
        recording = plain(run.t, run.acc, run.gyro * wrong)
        settings = decided(recording, study())
        assert settings.prior.gyro_scale == 0.01
        assert [each.code for each in of_vibration(study(), settings)] == ["wide_gyro_scale"]
        assert chosen(study(), choice_of(settings, final=True)).prior == settings.prior
        of = problem(settings)
        found = estimate(recording, of)
        squares.append(np.mean(np.square((found.theta - run.theta)[late] / found.u[late])))
        k = of.names.index("k_g")
        assert abs(found.state.x[k] - 0.01) < 4.0 * np.sqrt(found.state.P[k, k])
    assert np.mean(squares) < 13.8 / SEEDS


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda of: with_axis(of, 0, 0.3 * DEG), "the axis of a1"),
        (lambda of: with_axis(of, 1, 0.1 * DEG), "the axis of a2|rolled|gravity"),
        (lambda of: further_ahead(of, 2, 0.02), "a3 looks to sit -.* mm"),
    ],
)
def test_another_error_is_not_taken_for_a_scale_of_the_gyro(change, words):
    """Under one sine a turned axis or a wrong position looks like a scale of up to 2 %; with a prior that allows for
    that nothing contradicted it, and the angle was 5 to 25 u off with `ok`."""
    stated = change(study())
    run = simulate(Tunnel(duration=15.2), 1)
    recording = plain(run.t, run.acc, run.gyro)
    settings = decided(recording, stated)
    assert settings.prior.gyro_scale == stated.prior.gyro_scale
    (found,) = diagnose(recording, settings) or [said(recording, settings)]
    assert found.harm
    assert re.search(words, str(found.to_json()))


@pytest.mark.slow
def test_arms_in_millimetres_are_named_where_the_motion_is_too_slow_to_show_them():
    """A polar of steps fits with arms of 250 m, by a snap and a plunge that allow for what they make: 5 u off."""
    run = simulate(Tunnel("polar", duration=30.0), 3000)
    recording, of = plain(run.t, run.acc, run.gyro), study()
    wrong = replace(of, layout=replace(of.layout, r=1000.0 * of.layout.r))
    assert [each.code for each in implausible(recording, decided(recording, wrong))] == ["unit_suspect"]
    assert implausible(recording, decided(recording, of)) == []


@pytest.mark.parametrize("kind", ["sine", "polar", "rest"])
def test_a_gyro_as_it_is_usual_keeps_its_prior(kind):
    """By a recording alone its scale is off by no more than it says, whatever the motion shows of it: 3.5 standard
    deviations of one of two draws with 99.9 %."""
    for seed in range(SEEDS):
        run = simulate(Tunnel(kind, duration=12.0), seed)
        recording, of = plain(run.t, run.acc, run.gyro), problem(study())
        found = alone(estimate(recording, of).state, of)
        assert found is None or abs(found.value - run.errors["k_g"]) < 3.5 * found.u


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: x, ""),
        (lambda x: -x, "the other sign"),
        (lambda x: x + 0.5 * DEG, "deg off the angle"),
        (lambda x: x / DEG, "57.3 times the angle, as if degrees"),
        (lambda x: 1.02 * x, "1.02"),
        (lambda x: x + 2.0 * DEG * np.sin(np.arange(len(x)) ** 1.5), "differs from the angle by"),
    ],
)
def test_a_reference_is_judged_like_a_reading(change, words):
    """Sign, zero, unit and scale of theta_ref are named, and noise far above the u of the angle is no agreement."""
    recording, run = recorded("quiet", 0, duration=12.0)
    angles = of_fusion(estimate(recording, problem(study())), 19)
    said = contradicting_reference(replace(recording, reference=change(run.theta)), angles)
    assert [one.harm for one in said] == ([("theta",)] if words else [])
    assert all(words in one.headline for one in said), said
