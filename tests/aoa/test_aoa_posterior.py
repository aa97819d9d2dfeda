"""What one run learned of the sensors, as the prior of the next."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, NOISE, G, study

from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.files import save
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa.fusion.filter_result import estimate, of_fusion
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reference.corrections import corrected as put_right
from inercal.systems.aoa.reference.sensor_fit import fit
from inercal.systems.aoa.result.carry_over import corrected, load
from inercal.systems.aoa.result.outcome import assemble, assemble_angles
from inercal.systems.aoa.settings import SensorCalibration
from inercal.systems.aoa.simulate import drawn_biases, simulate
from rows import for_each

SWEEP = MotionPlan("pitch-pause", first=-10.0 * DEG, last=90.0 * DEG, step=20.0 * DEG, move=1.0, pause=1.0)
STILL = MotionPlan("static", duration=4.0, first=15.0 * DEG, last=15.0 * DEG)


def run(settings, rng, path):
    """Filter a simulated recording and save the result."""
    made = simulate(settings, rng).recording
    of = problem(settings)
    found = estimate(made, of)
    save(assemble(made, settings, of, found, [], None), path)
    return found


def all_errors(rng):
    """All constants of the default study from its prior."""
    truth = drawn_biases(NOISE, 3, rng)
    pivot = 3e-3 * rng.standard_normal()
    for k in range(1, 4):
        truth |= {f"dr_{k}": pivot + 1e-3 * rng.standard_normal(), f"zo_{k}": 5e-3 * rng.standard_normal()}
    return truth | {"k_g": 1e-3 * rng.standard_normal(), "tau_g": 0.0}


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "last.json"
    settings = study(motion=SWEEP)
    found = run(settings, np.random.default_rng(1), path)
    return path, settings, found


def test_what_was_saved_is_what_the_filter_knew(saved):
    path, settings, found = saved
    values, covariances = load(path, settings)
    of = problem(settings, posterior=(values, covariances))
    at = list(of.nuisances.values())
    assert set(values) == set(of.nuisances)
    np.testing.assert_allclose(of.mean[at], found.state.x[at], rtol=1e-15)
    np.testing.assert_allclose(of.covariance[np.ix_(at, at)], found.state.P[np.ix_(at, at)], rtol=1e-12)


def test_the_part_of_gravity_is_carried_from_run_to_run_as_one_error(tmp_path):
    """Handed on is what the filter knew. And had gravity been another all along, the second run would have ended where
    its slopes say, and its u holds that change whole, once."""
    made = [
        simulate(study(motion=replace(motion, sample_rate=200.0)), np.random.default_rng(seed)).recording
        for seed, motion in enumerate((SWEEP, STILL))
    ]

    def chain(gravity):
        uncertain = Site(gravity, (GravityInput("gravity", 3e-3, "m/s^2", 1.0),))
        settings, posterior = study(site=uncertain), None
        for k, recording in enumerate(made):
            of = problem(settings, posterior=posterior)
            state = estimate(recording, of).state
            result = assemble(recording, settings, of, estimate(recording, of), [], None)
            save(result, tmp_path / f"{k}.json")
            settings = replace(
                settings, estimator=replace(settings.estimator, prior=str(tmp_path / f"{k}.json"))
            )
            posterior = load(tmp_path / f"{k}.json", settings)
        return settings, result, of, state

    settings, last, of, state = chain(G)
    at, size = list(of.nuisances.values()), last.u
    after = problem(settings, posterior=load(tmp_path / "1.json", settings)).covariance[np.ix_(at, at)]
    assert np.abs((after - state.P[np.ix_(at, at)]) / np.outer(size, size)).max() < 1e-12
    slopes = np.array(list(last.result["gravity"]["slopes"].values()))
    assert (3e-3 * np.abs(slopes) > 0.3 * size).any()
    np.testing.assert_allclose(np.diag(last.common), (3e-3 * slopes) ** 2, rtol=1e-12)
    # what is known of another gravity is another error
    other = replace(settings, site=replace(settings.site, gravity=G + 1e-4))
    wider = problem(other, posterior=load(tmp_path / "1.json", other)).covariance[np.ix_(at, at)]
    np.testing.assert_allclose(wider, last.covariance, rtol=1e-12)
    _, moved, *_ = chain(G + 1e-3)
    np.testing.assert_allclose((moved.values - last.values) / 1e-3 / size, slopes / size, atol=0.02 / 3e-3)


@pytest.mark.parametrize("states", [8, 11])
def test_a_smaller_filter_takes_what_it_has_states_for(saved, states):
    path, settings, found = saved
    smaller = replace(settings, estimator=replace(settings.estimator, states=states))
    of = problem(smaller, posterior=load(path, smaller))
    whole = problem(settings)
    for name, k in of.nuisances.items():
        assert of.covariance[k, k] == pytest.approx(
            found.state.P[whole.names.index(name)][whole.names.index(name)]
        )


@pytest.mark.slow
def test_a_sweep_lowers_u_of_the_next_run_which_stays_consistent():
    """A sweep shows the biases, which make most of u at one angle. Sensors drawn from the study's prior, each with a
    run of its own: the mean of error^2/u^2, all but constant over a run at rest, is 1 at most within 5 standard
    deviations of chi-square of 8; it may be less, for nothing shakes the sting here."""
    ratios, lower = [], []
    rng = np.random.default_rng(7)
    first, second = study(motion=SWEEP), study(motion=STILL)
    before, of = problem(first), problem(second)
    for _ in range(8):
        errors = all_errors(rng)
        state = estimate(simulate(first, rng, errors).recording, before).state
        at = before.nuisances
        learned = (
            {name: state.x[k] for name, k in at.items()},
            {(a, b): state.P[i, j] for a, i in at.items() for b, j in at.items()},
        )
        made = simulate(second, rng, errors)
        found = estimate(made.recording, problem(second, posterior=learned), smoothed=True)
        ratios.append(np.mean(np.square((found.theta - made.theta) / found.u)))
        lower.append(np.median(found.u) / np.median(estimate(made.recording, of, smoothed=True).u))
    assert max(lower) < 0.6
    assert 0.1 < np.mean(ratios) < 1.0 + 5.0 * np.sqrt(2.0 / 8.0)


def test_the_budget_of_a_run_with_a_prior_names_the_earlier_run(saved):
    path, settings, _ = saved
    made = simulate(replace(settings, motion=STILL), np.random.default_rng(2)).recording
    of = problem(settings, posterior=load(path, settings))
    result = assemble(made, settings, of, estimate(made, of), [], None)
    sources = [item.source for item in result.budget]
    assert {"earlier run", "flexure of the sting"} <= set(sources)
    assert not {"accelerometer bias", "lever arms"} & set(sources)


def test_a_position_stated_anew_is_refused(saved):
    path, settings, _ = saved
    moved = replace(settings, layout=replace(settings.layout, r=np.array([-0.25, 0.205, 0.25])))
    with pytest.raises(StudyError, match=r"r = 0\.2 m of a2, expected r = 0\.205 m"):
        load(path, moved)


def test_another_calibration_is_refused(saved):
    path, settings, _ = saved
    with pytest.raises(StudyError, match=r"scale = 1 of a1, expected scale = 1\.001"):
        load(path, replace(settings, sensors={"a1": SensorCalibration(scale=1.001)}))
    with pytest.raises(StudyError, match=r"bias = 0 .* of gyro"):
        load(path, replace(settings, sensors={"gyro": SensorCalibration(bias=1e-4)}))
    # a range changes nothing of what was found
    load(path, replace(settings, sensors={"a1": SensorCalibration(range=20.0)}))


def test_other_sensors_are_refused(saved):
    path, settings, _ = saved
    of = settings.layout
    other = Layout(("a1", "a3", "a2"), of.angle, of.r, of.z)
    with pytest.raises(StudyError, match="sensors a1, a2, a3, expected those of the study, a1, a3, a2"):
        load(path, replace(settings, layout=other))


def test_another_instrument_is_refused(tmp_path):
    path = tmp_path / "a.json"
    settings = study(motion=STILL, traceability={"instrument": "no. 1"})
    run(settings, np.random.default_rng(1), path)
    load(path, replace(settings, traceability={}))
    with pytest.raises(StudyError, match=r"instrument no\. 1, expected that of the study, no\. 2"):
        load(path, replace(settings, traceability={"instrument": "no. 2"}))


def test_other_results_are_refused(saved, tmp_path):
    _, settings, found = saved
    made = simulate(settings, np.random.default_rng(1)).recording
    for result, words in (
        (Estimate.without(Basis("selfcal"), Status.OK, ""), "a result of selfcal"),
        (
            Estimate.without(Basis("aoa"), Status.INCONSISTENT, "mean NIS 9"),
            r"ended inconsistent \(mean NIS 9\)",
        ),
        (assemble_angles(made, settings, of_fusion(found, 19), [], None), "holds no coefficients"),
    ):
        save(result, tmp_path / "other.json")
        with pytest.raises(StudyError, match=words):
            load(tmp_path / "other.json", settings)
    with pytest.raises(InputError):
        load(tmp_path / "missing.json", settings)


FIT = {"converged": True, "parameters": [{"name": "S_1", "u": 1e-9}], "unseen": [], "covariance": [[1.0]]}


def used(path, settings):
    """What a run does with an earlier result."""
    return load(path, settings), corrected(path, settings)


@for_each(
    ("keys", "value"),
    [
        (("result", "gravity"), {}),
        (("result", "gravity"), {"value": "9.8", "u": 0.0, "slopes": {}}),
        (("result", "verified"), []),
        (("result", "verified"), {"converged": True}),
        (("result", "verified"), FIT),
        (("result", "corrections"), {"a1": {}}),
        (("result", "corrections"), {"a1": {"scale": 0.0, "angle_rad": 0.0}}),
        (("conditions", "sensors", "a1", "r_m"), "far"),
    ],
)
def test_a_result_without_its_form_is_refused_in_one_sentence(saved, tmp_path, keys, value):
    """As where a file was changed by hand: what is missing or of another type is the user's to put right."""
    path, settings, _ = saved
    whole = json.loads(path.read_text())
    table = whole
    for key in keys[:-1]:
        table = table[key]
    table[keys[-1]] = value
    other = tmp_path / "other.json"
    other.write_text(json.dumps(whole))
    with pytest.raises(StudyError, match=r"other\.json does not have the form of a result of aoa"):
        used(other, settings)


def test_what_is_no_covariance_is_refused(saved, tmp_path):
    path, settings, _ = saved
    whole = json.loads(path.read_text())
    whole["covariance"]["matrix"][0][1] = whole["covariance"]["matrix"][1][0] = 1e9
    (tmp_path / "other.json").write_text(json.dumps(whole))
    with pytest.raises(StudyError, match="holds a covariance with negative variances"):
        load(tmp_path / "other.json", settings)


TABLE = MotionPlan(
    "two-tone", duration=20.0, sample_rate=500.0, mean=20.0 * DEG, amplitude=25.0 * DEG, frequency=0.2,
    second_amplitude=5.0 * DEG, second_frequency=1.3,
)  # fmt: skip


def rig(settings, rng):
    """A study's sensors with scales and axes that the study does not know: the study they really follow."""
    off = 5e-4 * rng.standard_normal((2, 3))
    layout = replace(settings.layout, angle=settings.layout.angle + off[1])
    return replace(settings, layout=layout), 1.0 + off[0]


@pytest.mark.slow
def test_a_turntable_puts_scales_and_axes_right(tmp_path):
    """0.5 mrad of an axis and 0.05 % of scale are 0.03 deg each, and no fusion sees them; a turntable does.

    The angle after it is right within its u: mean of error^2/u^2 over 6 rigs, an error being all but one number a run,
    below 1 + 5 standard deviations of chi-square.
    """
    rng, settings = np.random.default_rng(11), study(motion=TABLE)
    ratios, better = [], []
    for k in range(6):
        truth, scale = rig(settings, rng)
        errors, path = all_errors(rng), tmp_path / f"{k}.json"

        def read(motion, truth=truth, scale=scale, errors=errors):
            made = simulate(replace(truth, motion=motion), rng, errors)
            return replace(made, recording=replace(made.recording, acc=made.recording.acc * scale))

        table = read(TABLE).recording
        of = problem(settings)
        fitted = fit(table, settings)
        save(assemble(table, settings, of, estimate(table, of), [], None, verified=fitted), path)
        made = read(replace(TABLE, duration=4.0, frequency=0.5))
        for name, value in zip(settings.layout.names, scale, strict=True):
            assert corrected(path, settings).calibration(name).scale == pytest.approx(1.0 / value, abs=3e-4)
        after = corrected(path, settings)
        gain = [after.calibration(name).scale for name in after.layout.names]
        put_right = replace(made.recording, acc=made.recording.acc * gain)
        found = estimate(put_right, problem(after, posterior=load(path, after)), smoothed=True)
        plain = estimate(made.recording, of, smoothed=True)
        ratios.append(np.mean(np.square((found.theta - made.theta) / found.u)))
        better.append(np.std(found.theta - made.theta) / np.std(plain.theta - made.theta))
    assert np.mean(ratios) < 1.0 + 5.0 * np.sqrt(2.0 / 6.0)
    assert np.median(better) < 0.5


def test_corrections_are_handed_on_from_run_to_run(tmp_path):
    settings = study(motion=STILL)
    after = put_right(
        Estimate.without(
            Basis("aoa"), Status.OK, "", result={"corrections": {"a1": {"scale": 1.002, "angle_rad": 1e-3}}}
        ),
        settings,
    )
    assert after.layout.angle[0] - settings.layout.angle[0] == pytest.approx(1e-3)
    assert after.calibration("a1").scale == pytest.approx(1.0 / 1.002)
    run(after, np.random.default_rng(1), tmp_path / "second.json")
    # the third run's study states the sensors as the first did
    third = corrected(tmp_path / "second.json", settings)
    np.testing.assert_allclose(third.layout.angle, after.layout.angle, rtol=1e-15)
    assert third.calibration("a1").scale == after.calibration("a1").scale
    load(tmp_path / "second.json", settings)
    load(tmp_path / "second.json", third)
