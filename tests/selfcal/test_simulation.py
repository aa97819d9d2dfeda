"""Simulated recordings: the truth against integration by SciPy and by plain NumPy, outputs against the product form,
noise against its statistics, and what real rigs add."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from paper_study import ARCSEC, DEG, PPM, TRUTH, study
from scipy.integrate import solve_ivp
from scipy.stats import chi2, kstest

from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import (
    attitude_difference,
    conjugate,
    exp,
    multiply,
    normalize,
    rotate,
)
from inercal.systems.selfcal.disturbances import Disturbances, EncoderHarmonic, Sway
from inercal.systems.selfcal.filters.plain import accelerometers, on_the_base, platform_rate
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.platform import model
from inercal.systems.selfcal.platform.coefficients import BETA, DO, DS, ETA, KA0, KA1, KG0, KG1, to_linear
from inercal.systems.selfcal.platform.model import specific_force
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn, motion
from inercal.systems.selfcal.platform.rig import Base, Gimbals
from inercal.systems.selfcal.platform.states import ALL, EXTENDED_MODEL, PAPER, StateVector, state_vector
from inercal.systems.selfcal.platform.truth import PlatformTruth, simulate_truth
from inercal.systems.selfcal.settings import Noise
from inercal.systems.selfcal.simulate import experiment, flicker, simulate, to_record

PLAN = PlatformPlan(
    (Turn("z", 60 * DEG), Turn("x", 90 * DEG), Turn("y", 40 * DEG), Rest(4.0)),
    rate=6 * DEG,
    start=(0.1, 0.2, -0.3),
)
SILENT = Noise(1e-30, 1e-30, 1e-30)
# the extended model, everything larger than life
LARGE = 30.0 * np.concatenate(
    [TRUTH[:18], 5 * PPM * np.array([1.0, -2.0, 3.0]), 4 * ARCSEC * np.array([1.0, 2.0, -1.0])]
)
RIG = {
    "plan": PLAN,
    "truth": LARGE,
    "base": Base(heading=0.7, tilt=(0.05, -0.1)),
    "gimbals": Gimbals(("x", "z", "y"), (1, -1, 1)),
}


def run(seed=1, **changes):
    settings = replace(study(**RIG), **changes)
    return settings, simulate(experiment(settings), np.random.default_rng(seed))


def error_matrix(c):
    """M of w + M w + kg0."""
    (sx, sy, sz), (ox, oy, oz), (gx, gy, gz) = c[DS], c[DO], c[KG1]
    return np.array([[gx, sx, -ox], [-oy, gy, sy], [sz, -oz, gz]])


def product_form(f, c):
    """Accelerometers (n, 3) as the paper writes them."""
    pz, oy, oz = c[ETA]
    bracket = np.stack([f[:, 0], f[:, 1] - oy * f[:, 0], f[:, 2] + pz * f[:, 0] - oz * f[:, 1]], axis=-1)
    return c[KA0] + (1.0 + c[KA1]) * bracket


def test_the_truth_is_the_solution_of_the_differential_equation():
    """q' = q (w + M w + kg0) / 2 - w_Ie q / 2 by SciPy, step by step of the commands."""
    settings, run_ = run(noise=SILENT)
    found = run_.recording
    c, place = settings.truth, settings.world
    earth = rotate(exp(c[BETA]), place.earth)
    M, q = error_matrix(c), run_.attitude[0]
    for k in range(len(found.rate)):
        rate = found.rate[k] + M @ found.rate[k] + c[KG0]

        def slope(_, q, rate=rate):
            of_platform, of_earth = multiply(q, np.append(0.0, rate)), multiply(np.append(0.0, earth), q)
            return 0.5 * (of_platform - of_earth)

        q = solve_ivp(slope, (0.0, 0.2), q, rtol=1e-11, atol=1e-13).y[:, -1]
        assert attitude_difference(q, run_.attitude[k + 1]) < 1e-8


def test_noise_is_integrated_at_the_finer_step_as_in_plain_numpy():
    """The kernel against its twin, row by row: noise, commands that change within a row, all 24 coefficients."""
    rng, place = np.random.default_rng(5), study(**RIG).world
    n, m, dt = 40, 7, 0.03
    w, noise = rng.normal(0, 0.1, (n - 1, m, 3)), rng.normal(0, 0.01, (n - 1, m, 3))
    c = to_linear(LARGE)
    q, acc = np.empty((n, 4)), np.empty((n, 3))
    q0 = normalize(rng.normal(size=4))
    full = np.append(c, np.zeros(len(ALL) - 24))
    out = PlatformTruth(q, acc, np.empty((n, 3)))
    simulate_truth(q0, w, dt, noise, np.zeros(n), full, StateVector((), full).layout, place, out)
    zero = exp(c[BETA])
    earth, up, M, at = rotate(zero, place.earth), rotate(zero, place.up), error_matrix(c), q0
    pz, oy, oz = c[ETA]
    A = np.eye(3) + np.diag(c[KA1]) + np.array([[0, 0, 0], [-oy, 0, 0], [pz, -oz, 0]])
    for k in range(n):
        for j in range(m if k else 0):
            rate = w[k - 1, j] + M @ w[k - 1, j] + c[KG0] + noise[k - 1, j]
            at = normalize(multiply(multiply(exp(-earth * dt), at), exp(rate * dt)))
        assert_allclose(q[k], at, atol=1e-13)
        assert_allclose(acc[k], c[KA0] + A @ rotate(conjugate(at), up), atol=1e-12)


@pytest.mark.parametrize("size", [18, 24])
def test_the_kernels_of_the_model_by_hand(size):
    rng = np.random.default_rng(2)
    c, v = np.zeros(24), rng.normal(size=3)
    c[:size] = rng.normal(0.0, 0.1, size)
    q = normalize(rng.normal(size=4))
    assert_allclose(platform_rate(v, c[:size], size > 18), v + error_matrix(c) @ v + c[KG0], atol=1e-14)
    assert_allclose(on_the_base(v, c[:size], size > 18), rotate(exp(c[BETA]), v), atol=1e-14)
    assert_allclose(specific_force(q, v), rotate(conjugate(q), v), atol=1e-14)
    # they are those of the one model, without its rig
    full, own, up = np.append(c, np.zeros(len(ALL) - 24)), model.room(), study(**RIG).world.up
    layout = state_vector(EXTENDED_MODEL if size == 24 else PAPER).layout
    base, still = model.base_of(full, layout.based, study(**RIG).world), (0.0, 0.0, 0.0)
    assert_allclose(
        model.turning(tuple(v), still, 0.0, full, layout, own), platform_rate(v, c, size > 18), atol=1e-14
    )
    f = specific_force(tuple(q), on_the_base(up, c, size > 18))
    read = model.accelerometers(tuple(q), model.Rates(still, still), 0.0, base, full, layout, own)
    assert_allclose(read, (accelerometers(f, c), f), atol=1e-12)
    # product form in, linear form inside: the same outputs
    assert_allclose(accelerometers(tuple(v), to_linear(c[:size])), product_form(v[None], c)[0], atol=1e-14)


def test_accelerometers_read_the_product_form():
    """Of the specific force that the true attitude gives, in the base turned by beta."""
    settings, found = run(noise=SILENT)
    force = rotate(conjugate(found.attitude), rotate(exp(settings.truth[BETA]), settings.world.up))
    assert_allclose(np.linalg.norm(force, axis=1), settings.site.gravity)
    assert_allclose(found.recording.acc[1:], product_form(force, settings.truth)[1:], atol=1e-12)


def test_angles_are_those_of_the_true_attitude_and_start_at_the_plan():
    settings, found = run(noise=SILENT)
    q, _ = gimbals(found.angles, settings.world)
    assert attitude_difference(q, found.attitude).max() < 1e-7
    assert_allclose(found.angles[0], PLAN.start, atol=1e-12)
    assert_allclose(found.recording.th, found.angles, atol=1e-15)
    assert np.abs(np.diff(found.angles, axis=0)).max() < 3 * DEG


def test_a_perfect_platform_goes_as_commanded():
    """No coefficients, no noise: nominal angles, and accelerometers that read gravity."""
    settings, found = run(noise=SILENT, truth=np.zeros(24))
    assert_allclose(found.angles, PLAN.angles(), atol=1e-7)
    assert_allclose(np.linalg.norm(found.recording.acc[1:], axis=1), settings.site.gravity, rtol=1e-12)


def test_the_same_seed_the_same_digits_another_seed_others():
    (_, a), (_, b), (_, c) = run(7), run(7), run(8)
    assert_array_equal(a.recording.th, b.recording.th)
    assert_array_equal(a.recording.acc, b.recording.acc)
    assert not np.array_equal(a.attitude, c.attitude)


def within(sample, sigma, p=1e-4):
    """A sum of squares between the quantiles of chi-squared."""
    n = sample.size
    assert chi2.ppf(p / 2, n) < np.sum((sample / sigma) ** 2) < chi2.ppf(1 - p / 2, n)


def test_the_noise_of_encoders_and_accelerometers():
    """White, normal, of the stated size, in every axis; the first row has no accelerometers but angles."""
    settings, found = run(3)
    truth = product_form(
        rotate(conjugate(found.attitude), rotate(exp(settings.truth[BETA]), settings.world.up)),
        settings.truth,
    )
    recording = found.recording
    assert np.isnan(recording.acc[0]).all()
    for sigma, noise in (
        (settings.noise.accelerometer, recording.acc[1:] - truth[1:]),
        (settings.noise.encoder, recording.th - found.angles),
    ):
        for k in range(3):
            within(noise[:, k], sigma)
            assert kstest(noise[:, k] / sigma, "norm").pvalue > 1e-3
            rho = np.corrcoef(noise[1:, k], noise[:-1, k])[0, 1]
            assert abs(rho) < 4 / np.sqrt(len(noise))


def test_the_random_walk_of_the_platform():
    """The angle that the noise of the gyros makes over a time T has the variance ARW^2 T about each axis.

    A platform at rest for 20 s, 300 runs; 5 s of it are a quarter of the variance, and independent of the rest.
    """
    still = PlatformPlan((Rest(20.0),))
    settings = study(plan=still, truth=np.zeros(24))
    prepared, rng = experiment(settings), np.random.default_rng(4)
    ends = []
    for _ in range(300):
        q = simulate(prepared, rng).attitude
        ends.append([q[25], q[100]])
    silent = simulate(experiment(replace(settings, noise=SILENT)), rng).attitude
    turned = 2.0 * multiply(conjugate(silent[[25, 100]]), np.array(ends))[..., 1:]
    arw = settings.noise.angle_random_walk
    for k in range(3):
        within(turned[:, 0, k], arw * np.sqrt(5.0))
        within(turned[:, 1, k] - turned[:, 0, k], arw * np.sqrt(15.0))
        assert abs(np.corrcoef(turned[:, 0, k], turned[:, 1, k] - turned[:, 0, k])[0, 1]) < 4 / np.sqrt(300)


def test_the_finer_step_does_not_change_the_truth_without_noise():
    """Commands are held over a row and the step is exact: any number of finer steps gives the same."""
    runs = [run(noise=SILENT, disturbances=Disturbances(substeps=m))[1].attitude for m in (1, 10, 17)]
    assert attitude_difference(runs[0], runs[1]).max() < 5e-8
    assert attitude_difference(runs[0], runs[2]).max() < 5e-8


def test_dropouts_take_whole_rows_at_the_stated_part():
    settings, found = run(6, disturbances=Disturbances(dropouts=0.2))
    recording = found.recording
    lost = np.isnan(recording.th).all(axis=1)
    assert_array_equal(np.isnan(recording.th).any(axis=1), lost)
    assert_array_equal(np.isnan(recording.acc[1:]).all(axis=1), lost[1:])
    assert not lost[0]
    n = len(lost) - 1
    assert abs(lost.sum() - 0.2 * n) < 4 * np.sqrt(0.2 * 0.8 * n)
    assert np.isfinite(recording.rate).all()
    assert recording.scalars == 6 * (n - lost.sum())
    assert settings.disturbances.dropouts == 0.2


def test_harmonics_are_errors_of_the_encoders_alone():
    """a sin(k th + phase) of the joint's own true angle; the platform does not know of them."""
    waves = [("z", 2, 300 * ARCSEC, 0.4), ("x", 1, 100 * ARCSEC, 0.0), ("z", 5, 50 * ARCSEC, -1.0)]
    harmonics = tuple(EncoderHarmonic(*wave) for wave in waves)
    _, plain = run(9, noise=SILENT)
    _, found = run(9, noise=SILENT, disturbances=Disturbances(harmonics=harmonics))
    assert_array_equal(found.attitude, plain.attitude)
    error = found.recording.th - found.angles
    z, x = found.angles[:, 2], found.angles[:, 0]
    assert_allclose(error[:, 0], 100 * ARCSEC * np.sin(x), atol=1e-15)
    assert_allclose(error[:, 1], 0.0, atol=1e-15)
    expected = 300 * ARCSEC * np.sin(2 * z + 0.4) + 50 * ARCSEC * np.sin(5 * z - 1.0)
    assert_allclose(error[:, 2], expected, atol=1e-15)


@pytest.mark.parametrize("rows", [1, 2])
def test_a_delay_of_whole_rows_shifts_the_motion_and_not_the_log(rows):
    """The platform does at t what was commanded at t - delay; from a rest on, all it does comes so much later.

    Earth rate, for which commands make up at the nominal attitude, is what is left: 1e-4 rad.
    """
    plan = PlatformPlan((Rest(4.0), *PLAN.moves), rate=PLAN.rate, start=PLAN.start)
    changes = {"plan": plan, "noise": SILENT, "truth": np.zeros(24)}
    _, late = run(**changes, disturbances=Disturbances(command_delay=0.2 * rows))
    _, perfect = run(**changes)
    assert_array_equal(late.recording.rate, perfect.recording.rate)
    assert_allclose(late.angles[rows:], plan.angles()[:-rows], atol=1e-4)


def test_a_part_of_a_row_of_delay():
    """A quarter of a row late: at the row after a start from rest, three quarters of a step have been made."""
    plan = PlatformPlan((Rest(2.0), Turn("z", 10 * DEG)), rate=1 * DEG)
    changes = {"plan": plan, "noise": SILENT, "truth": np.zeros(24), "base": Base(), "gimbals": Gimbals()}
    _, late = run(**changes, disturbances=Disturbances(command_delay=0.05, substeps=8))
    assert late.angles[11, 2] == pytest.approx(0.75 * 0.2 * DEG, rel=1e-3)


def test_a_tilted_base_is_felt_by_the_accelerometers():
    """At rest with the joints at zero: f = g (sin of the tilt about east along north), and so on."""
    tilt = (3.0 * DEG, -2.0 * DEG)
    changes = {
        "plan": PlatformPlan((Rest(4.0),)),
        "noise": SILENT,
        "truth": np.zeros(24),
        "gimbals": Gimbals(),
    }
    settings, found = run(**changes, base=Base(tilt=tilt))
    g0 = settings.site.gravity
    read = found.recording.acc[1:].mean(axis=0)
    assert read[0] == pytest.approx(g0 * np.sin(tilt[1]), rel=2e-3)
    assert read[2] == pytest.approx(-g0 * np.sin(tilt[0]), rel=2e-3)
    # beta of the extended model is the same turn of the base, seen from the encoders: q_enc = qexp(beta) q
    truth = np.zeros(24)
    truth[BETA] = [1e-4, 0.0, -2e-4]
    _, turned = run(**(changes | {"truth": truth}), base=Base())
    expected = rotate(exp(truth[BETA]), np.array([0.0, g0, 0.0]))
    # but for earth rate, for which the commands do not make up quite: 7e-5 rad/s times beta over 2 s
    assert_allclose(turned.recording.acc[1:].mean(axis=0), expected, atol=5e-7)


def test_what_a_simulation_needs():
    with pytest.raises(StudyError, match="plan: missing"):
        experiment(study(plan=None))
    with pytest.raises(StudyError, match="truth: missing"):
        experiment(study(truth=None))


def test_the_record_of_a_recording():
    """Nine columns on one clock, in units of the field; what nobody can know is empty."""
    _, found = run()
    record = to_record(found.recording)
    assert list(record.columns) == [f"{s}_{i}" for s in ("wc", "th", "acc") for i in "xyz"]
    assert {column.unit.symbol for column in record.columns.values()} == {"deg/h", "deg", "m/s^2"}
    assert np.isnan(record["wc_y"].values[-1])
    assert np.isnan(record["acc_z"].values[0])
    assert_allclose(record["wc_y"].si()[:-1], found.recording.rate[:, 1], rtol=1e-14)
    commanded = motion(PLAN, study(**RIG).world)
    assert_allclose(found.recording.rate, commanded.rate)


def test_flicker_has_the_floor_that_is_stated():
    """Allan deviation of means of 16 and 256 rows, to 10 %, of eight times three records of 65536."""
    drawn = np.hstack([flicker(2.0, 2**16, np.random.default_rng(seed)) for seed in range(8)])
    for octave in (4, 8):
        means = drawn.reshape(2 ** (16 - octave), 2**octave, 24).mean(axis=1)
        assert np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2)) == pytest.approx(2.0, rel=0.1)


def test_a_base_that_sways_moves_the_encoders_alone():
    """About two level axes, a quarter of a period apart: a turn of one size, and none about the vertical."""
    size = 3 * ARCSEC
    settings, still = run(noise=SILENT)
    _, swaying = run(noise=SILENT, disturbances=Disturbances(base_sway=Sway(size, 0.3)))
    assert_allclose(swaying.recording.acc, still.recording.acc, atol=1e-15)
    read, _ = gimbals(swaying.recording.th, settings.world)
    was, _ = gimbals(still.recording.th, settings.world)
    turn = 2.0 * multiply(read, conjugate(was))[:, 1:]
    assert_allclose(np.linalg.norm(turn, axis=1), size, rtol=1e-4)
    assert np.abs(turn @ settings.world.up).max() < 1e-4 * size * 9.8


def test_what_a_logger_does():
    """Readings in steps, stamps that jitter, rows that are lost; the rest of each record is as it was."""
    _, plain = run()
    whole = plain.recording
    _, coarse = run(disturbances=Disturbances(quantisation=5 * ARCSEC))
    steps = coarse.recording.th / (5 * ARCSEC)
    assert_allclose(steps, np.round(steps), atol=1e-6)
    assert np.abs(coarse.recording.th - whole.th).max() <= 2.5 * ARCSEC * (1 + 1e-9)
    _, late = run(disturbances=Disturbances(stamp_jitter=1e-3))
    assert np.std(late.recording.t - whole.t) == pytest.approx(1e-3, rel=0.2)
    assert_array_equal(late.recording.th, whole.th)
    with pytest.raises(StudyError, match=r"disturbances\.stamp_jitter: found 0\.5 s for rows every 0\.2 s"):
        run(disturbances=Disturbances(stamp_jitter=0.5))
    _, lost = run(disturbances=Disturbances(lost_rows=0.3))
    rows = np.searchsorted(whole.t, lost.recording.t)
    assert len(rows) / len(whole.t) == pytest.approx(0.7, abs=0.15)
    for name, of in (("t", rows), ("th", rows), ("acc", rows), ("rate", rows[:-1])):
        assert_array_equal(getattr(lost.recording, name), getattr(whole, name)[of])
    assert_array_equal(lost.attitude, plain.attitude[rows])


def test_what_a_servo_adds_is_commanded():
    """Rates that are random, and a platform that turns at them: as far as the sum of them takes it."""
    size = 1e-4
    settings, made = run(noise=SILENT, truth=0.0 * LARGE, disturbances=Disturbances(servo_jitter=size))
    rate, nominal = made.recording.rate, motion(PLAN, settings.world).rate
    assert np.std(rate - nominal) == pytest.approx(size, rel=0.1)
    q = made.attitude[0]
    for each in rate:
        q = multiply(multiply(exp(-0.2 * settings.world.earth), q), exp(0.2 * each))
    assert attitude_difference(q, made.attitude[-1]) < 1e-8
