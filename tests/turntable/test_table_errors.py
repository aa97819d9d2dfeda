"""Errors of a table as laboratories know them: by angle, harmonics, measured; and their second order.

The tests are simulated by `benchmarks/independent/table_errors.py`, which shares no code with the program. Limits of
coverage: binomial for the tests, not for coefficients, which the errors of one test move together; seeds fixed before
the first look.
"""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from independent import table_errors
from numpy.testing import assert_allclose
from turntable_studies import ARCMIN, DEG_H, TUMBLE, WHEEL, study, table

from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.rigs.chain import Chain, Error, Joint, Scope
from inercal.foundation.rigs.patterns import Harmonic, Known, Tabulated, normal
from inercal.foundation.rigs.plans import listed
from inercal.systems.turntable.model import table_model
from inercal.systems.turntable.positions.tolerance import shifts
from inercal.systems.turntable.regression import fit
from inercal.systems.turntable.second_order import second_order
from inercal.systems.turntable.sensitivity import analyse
from inercal.systems.turntable.simulate import simulate_positions, simulate_rate_test, truth
from inercal.systems.turntable.task import calibrate

RUNS = 8


def calibrations(case, runs, plain=None):
    """Normalised errors (runs, p) and the share of tests that end ok."""
    tests = [table_errors.one_test(case, seed, plain) for seed in range(runs)]
    z = np.array([list(test["z"].values()) for test in tests])
    return z, np.mean([test["status"] == "ok" for test in tests])


@pytest.mark.slow
@pytest.mark.parametrize("runs", [RUNS, pytest.param(100, marks=pytest.mark.campaign)])
@pytest.mark.parametrize("case", ["angle", "harmonics", "measured", "large"])
def test_intervals_hold(case, runs):
    """The coverage of one test scatters by at most sqrt(0.05 0.95), if all coefficients moved together."""
    z, ok = calibrations(case, runs)
    # faults are named in 0.5 % of sound records: of 8 in more than one, of 100 in more than three by chance in 2e-3
    assert runs * (1.0 - ok) < (1.5 if runs == RUNS else 3.5)
    covered = np.mean(np.abs(z) < 1.96)
    assert covered > 0.95 - 4.0 * np.sqrt(0.05 * 0.95 / runs)
    # means of z over the tests, each of unit variance; squares of z by their design effect at most the tests alone
    assert np.all(np.abs(z.mean(axis=0)) < 4.5 / np.sqrt(runs))
    assert np.mean(z**2) < 1.0 + 4.5 * np.sqrt(2.0 / runs)


def test_without_the_words_they_do_not():
    """The scope left out: u far too small, as errors of one angle come back with it."""
    z, _ = calibrations("angle", 4, plain={', scope = "angle"': ""})
    assert np.mean(z**2) > 2.0


def test_harmonics_are_a_fault_beyond_those_that_are_stated_alone():
    """Two minutes of the first harmonic of phi1, stated as that, and as 2 arcsec; nothing stated of the noise."""
    without_noise = {'noise = "0.003 deg/h"\n': ""}
    few = without_noise | {'amplitude = "120.0 arcsec"': 'amplitude = "2.0 arcsec"'}
    for seed in range(4):
        assert table_errors.one_test("harmonics", seed, without_noise)["status"] == "ok"
        test = table_errors.one_test("harmonics", seed, few)
        assert test["status"] == "suspect"
        assert {"angle_harmonic", "approach_hysteresis"} & set(test["findings"])


def test_values_of_an_angle_are_one_unknown_each():
    """The covariance of the fit against draws of the errors by hand, through the derivatives: equal to rounding."""
    plan = listed(np.radians([[a, b] for a in (0, 60, 120, 200) for b in (10, 80, 130, 220, 290)] * 2))
    chain = table(1.0 * ARCMIN).with_scope(Scope.ANGLE)
    settings = study(plan, chain, noise=0.001 * DEG_H, earth_rate="stated")
    estimate = calibrate(simulate_positions(settings, np.random.default_rng(1)), settings)
    done = estimate.fitting.fit
    table_part = np.zeros((len(done.c), len(done.c)))
    joints = {"dphi_y1": 0, "dalpha_x1": 0, "dalpha_z1": 0, "deps_x": 0, "deps_y": 0}
    for k, error in enumerate(chain.errors):
        own = np.round(np.degrees(plan.angles[:, joints.get(error.name, 1)]))
        for angle in np.unique(own):
            shift = np.einsum("pnc,nc->p", done.gain, done.slopes[..., k] * (own == angle)[:, None])
            table_part += error.distribution.std**2 * np.outer(shift, shift)
    noise = np.einsum("pnc,qnc->pq", done.gain * done.noise**2, done.gain)
    assert_allclose(done.covariance, table_part + noise, rtol=1e-6, atol=1e-6 * np.abs(done.covariance).max())
    assert [shift.shape[1] for shift in shifts(done)] == [4] * 5 + [5] * 6


def test_what_is_known_is_corrected_and_its_u_stands_under_its_certificate(tmp_path):
    (tmp_path / "encoder.csv").write_text(
        "angle [deg],error [arcsec],u [arcsec]\n0,10,1\n90,-20,2\n180,5,1\n270,0,1\n"
    )
    text = """
        site.latitude = "39.1 deg"
        rig.kind = "two_axis_turntable"
        [rig.errors]
        deps_x = { value = "200(5) arcsec", certificate = "K-1" }
        dphi_z2 = { table = "encoder.csv", certificate = "K-2", normal = "1 arcsec" }
        [positions]
        plan = "24-position"
        [instrument]
        unit = "deg/h"
        noise = "0.001 deg/h"
        coefficients = { DX_F = "50 deg/h", DX_X = "60 deg/h", DX_Y = "40 deg/h", k_x = 1.0 }
    """
    settings = turntable_study(tomllib.loads(text), tmp_path / "study.toml")
    known = [each for each in settings.chain.elements if isinstance(each, Known)]
    assert [each.axis for each in known] == ["x", "z"]
    assert_allclose(
        known[1].at(np.radians([90.0, 135.0, 315.0])), np.radians([-20, -7.5, 5]) / 3600, rtol=1e-12
    )
    assert settings.chain.factors == ("deps_x", "dphi_z2_table", "dphi_z2")
    estimate = calibrate(simulate_positions(settings, np.random.default_rng(3)), settings).estimate
    assert {"K-1: deps_x", "K-2: dphi_z2_table"} <= {item.source for item in estimate.budget}
    assert [source.path for source in estimate.inputs][-1].endswith("encoder.csv")
    # without the correction the drift is off by what 200 arcsec turn of it, many u
    errors = np.abs(estimate.values - [WHEEL["DX_F"] * (n == "DX_F") for n in estimate.names])
    assert errors[list(estimate.names).index("DX_F")] < 4.5 * estimate.u[list(estimate.names).index("DX_F")]


def test_sensitivity_of_harmonics_is_that_of_their_size_at_the_angle():
    """Of a turn about y of gravity along -z: a_x changes by g e cos(phi), e of one or other quadrature."""
    text = """
        site = { latitude = "39.1 deg", gravity = "9.8 m/s^2" }
        rig.kind = "two_axis_turntable"
        rig.errors.dphi_y1 = { harmonics = [{ order = 2, amplitude = "1 arcmin" }], normal = "0.5 arcmin" }
        positions.list = [["20 deg", "0 deg"], ["55 deg", "0 deg"]]
        analysis.outputs = ["ax"]
    """
    indices = analyse(turntable_study(tomllib.loads(text), "s")).indices
    phi = np.radians([20.0, 55.0])
    sizes = np.stack([np.sin(2 * phi) ** 2, np.cos(2 * phi) ** 2, np.full(2, 0.25)], axis=-1)
    assert indices.factors == ("dphi_y1_s2", "dphi_y1_c2", "dphi_y1")
    assert_allclose(indices.first[0], sizes / 1.25, rtol=1e-5)
    assert_allclose(indices.variance[0], 1.25 * (9.8 * np.cos(phi) * ARCMIN) ** 2, rtol=1e-5)


def test_drift_is_an_output_of_the_sensitivity_by_every_method():
    text = """
        site.latitude = "39.1 deg"
        rig.kind = "two_axis_turntable"
        rig.errors.default = { uniform = "2 arcmin" }
        positions.grid = { phi1 = 3, phi2 = 3 }
        analysis = { outputs = ["y_x", "wx"], samples = 4096 }
        instrument.unit = "deg/h"
        instrument.coefficients = { DX_X = "60 deg/h", DX_XX = "20 deg/h", DX_YZ = "25 deg/h" }
    """
    settings = turntable_study(tomllib.loads(text), "s")
    exact, sampled, local = (
        analyse(replace(settings, analysis=replace(settings.analysis, method=method))).indices
        for method in ("exact", "sampled", "local")
    )
    assert exact.outputs == sampled.outputs == local.outputs == ("wx", "y_x")
    assert_allclose(local.first, exact.first, atol=1e-4)
    assert np.all(np.abs(sampled.first - exact.first) < 5.0 * sampled.u_first + 1e-5)
    # rms of the drift over the sphere, by directions on a grid of heights
    rng = np.random.default_rng(1)
    a = rng.normal(size=(200_000, 3))
    a /= np.linalg.norm(a, axis=1)[:, None]
    drift = (60.0 * a[:, 0] + 20.0 * a[:, 0] ** 2 + 25.0 * a[:, 1] * a[:, 2]) * DEG_H
    assert exact.scales[1] == pytest.approx(drift.std(), rel=0.01)


def test_second_order_is_that_of_the_chain_itself():
    """Means and standard deviations of what the readings have beyond the derivatives, against 4e4 draws (1.5 %)."""
    chain = table(60.0 * ARCMIN)
    settings = study(
        TUMBLE, chain, kind="accelerometer", unit="m/s^2", coefficients={"K1_x": 1.0, "K2_x": 0.01}
    )
    model, c = truth(settings)
    angles = TUMBLE.angles[[0, 3, 10, 20]]
    bent = second_order(model, angles, c, np.ones(4, dtype=np.int64))
    errors = chain.draw(np.random.default_rng(7), 4, runs=40_000)
    beyond = model.outputs(angles, c, errors) - model.outputs(angles, c)
    beyond -= np.einsum("nck,rnk->rnc", model.by_errors(angles, c), errors)
    std = np.sqrt(np.square(bent.redrawn).sum(axis=-1) + np.square(bent.shared).sum(axis=-1))
    assert_allclose(beyond.std(axis=0), std, rtol=0.03, atol=2e-3 * std.max())
    assert np.all(
        np.abs(beyond.mean(axis=0) - bent.mean) < 5.0 * std / 200.0 + 1e-3 * np.abs(bent.mean).max()
    )


def test_second_order_waits_until_it_matters():
    """By the same readings: an accelerometer of little noise needs it, one of much noise does not."""
    chain = table(10.0 * ARCMIN)
    for noise, there in ((2e-5, True), (1e-2, False)):
        settings = study(
            TUMBLE,
            chain,
            kind="accelerometer",
            unit="m/s^2",
            coefficients={},
            terms=("K0_x", "K1_x"),
            noise=noise,
        )
        model = table_model(settings, ["acc_x"])
        y = model.outputs(TUMBLE.angles, np.array([0.0, 1.0]))
        assert (fit(model, TUMBLE.angles, y, [noise]).second is not None) is there


def test_a_pattern_needs_a_joint_and_one_value_for_an_angle_needs_angles():
    wave = Error("e", "x", normal(1e-3), Scope.RIG, pattern=Harmonic(1, 0.0))
    with pytest.raises(ValueError, match="e follows an angle, expected it after a joint"):
        Chain((wave,))
    chain = Chain((Joint("phi1", "y"), Error("a", "x", normal(1e-3), Scope.ANGLE), wave))
    with pytest.raises(ValueError, match="expected their angles"):
        chain.draw(np.random.default_rng(1), 3)
    turns = np.radians([[0.0], [90.0], [360.0], [-270.0], [359.99]])
    drawn = chain.draw(np.random.default_rng(1), turns)
    assert len(np.unique(drawn[:, 0])) == 2
    assert drawn[0, 0] == drawn[2, 0] == drawn[4, 0] != drawn[1, 0] == drawn[3, 0]
    assert_allclose(chain.sizes(turns)[:, 1], np.sin(turns[:, 0]), atol=1e-15)
    known = Known("x", 1e-3, ((1.0, Tabulated(np.array([0.0, np.pi]), np.array([0.0, 2e-3]))),))
    stood = Chain((Joint("phi1", "y"), known, wave)).standing(turns[1])
    whole = Chain((Joint("phi1", "y"), known, wave))
    error = np.array([2e-3])
    assert_allclose(
        stood.attitude(turns[1], error * stood.std / 1e-3), whole.attitude(turns[1], error), atol=1e-15
    )


def test_a_chain_of_its_own_is_the_table_that_it_describes():
    """The two-axis table written out as a chain: the same attitudes, errors and results, but for the words."""
    usual = turntable_study(tomllib.loads(TWO_AXES), "s")
    slots = [e for e in usual.chain.elements if isinstance(e, Error | Joint)]
    rows = [
        f'{{ joint = "{e.name}", axis = "{e.axis}" }}'
        if isinstance(e, Joint)
        else f'{{ error = "{e.name}", axis = "{e.axis}", uniform = "2 arcmin", scope = "{e.scope.value}" }}'
        for e in slots
    ]
    text = TWO_AXES.replace("two_axis_turntable", "chain").replace(
        DEFAULT, f"rig.chain = [{', '.join(rows)}]"
    )
    own = turntable_study(tomllib.loads(text), "s")
    record = simulate_positions(usual, np.random.default_rng(5))
    assert_allclose(
        simulate_positions(own, np.random.default_rng(5))["y_x"].values, record["y_x"].values, rtol=1e-12
    )
    first, second = calibrate(record, usual).estimate, calibrate(record, own).estimate
    assert_allclose(second.values, first.values, rtol=1e-9)
    assert_allclose(second.covariance, first.covariance, rtol=1e-9)


DEFAULT = 'rig.errors.default = { uniform = "2 arcmin" }'
TWO_AXES = f"""
    site.latitude = "39.1 deg"
    rig.kind = "two_axis_turntable"
    {DEFAULT}
    positions.plan = "24-position"
    instrument.unit = "deg/h"
    instrument.noise = "0.01 deg/h"
    instrument.coefficients = {{ DX_F = "50 deg/h", DX_X = "60 deg/h", k_x = 1.0 }}
"""


def test_a_joint_that_errs_turns_by_the_difference_between_the_ends():
    """Mean rates of a turn by hand: (phi + e) at the end less that at the beginning, over the time."""
    text = """
        site.latitude = "39.1 deg"
        rig.kind = "two_axis_turntable"
        rig.errors.dphi_z2 = { harmonics = [{ order = 2, amplitude = "60.0 arcsec", phase = "20 deg" }] }
        instrument = { kind = "gyro", unit = "deg/s", dwell = "30 s", coefficients = { S_z = "1" } }
        rate_test = { rates = ["1 deg/s", "-2 deg/s", "12 deg/s"], at = { phi2 = "10 deg" } }
    """
    settings = turntable_study(tomllib.loads(text), "s")
    made = simulate_rate_test(settings, np.random.default_rng(1))
    none = turntable_study(tomllib.loads(text.replace("60.0 arcsec", "1e-9 arcsec")), "s")
    plain = simulate_rate_test(none, np.random.default_rng(1))
    ends = 10.0 + 30.0 * np.array([1.0, -2.0, 12.0])
    e = [60.0 / 3600.0 * np.sin(np.radians(2.0 * at + 20.0)) for at in (ends, 10.0)]
    assert_allclose(made["gyro_z"].values - plain["gyro_z"].values, (e[0] - e[1]) / 30.0, atol=1e-12)
