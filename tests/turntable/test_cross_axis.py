"""Misalignment of gyros across the turning axis, against a triad on a table simulated with SciPy's rotations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation
from turntable_studies import LATITUDE, study

from inercal.faces.convert.models import worth_knowing
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.records.record import record_of
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.rate.several_axes import axis_about
from inercal.systems.turntable.settings import RateTest
from inercal.systems.turntable.task import calibrate

DEG = np.pi / 180.0
ARCSEC = DEG / 3600.0
RATES = np.array([-50.0, -20.0, -5.0, 5.0, 20.0, 50.0, 50.0, 20.0, 5.0, -5.0, -20.0, -50.0]) * DEG
DWELL, WHOLE_TURNS, NOISE = 30.0, 72.0, 2e-7
TRUTH = {"T_xz": 300.0 * ARCSEC, "T_yz": -150.0 * ARCSEC}
S, U_S, U_RATE = {"x": 1.003, "y": 0.997, "z": 1.001}, 2e-3, 1e-3
MOUNTING, WOBBLE = 15.0 * ARCSEC, 3.0 * ARCSEC
ERRORS = {
    **dict.fromkeys(("dtheta_x", "dtheta_y", "dtheta_z"), MOUNTING),
    **dict.fromkeys(("dalpha_x2", "dalpha_y2"), WOBBLE),
}
W_N = EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)])


def readings(rng, mounting=0.0, wobble=0.0, noise=0.0, scale=S, rate_error=0.0, dwell=DWELL):
    """Means over each stay [rad/s], (n, 3): the table turns about z, the outer axis stands at 0."""
    t = dwell * (np.arange(400) + 0.5) / 400
    fixed = Rotation.from_euler("XYZ", mounting * rng.standard_normal(3))
    gain = np.array([[1.0, 2e-4, TRUTH["T_xz"]], [-1e-4, 1.0, TRUTH["T_yz"]], [3e-4, 1e-4, 1.0]])
    made = []
    for rate in RATES * (1.0 + rate_error):
        wobbled = Rotation.from_euler("XY", wobble * rng.standard_normal(2))
        C_nb = Rotation.from_rotvec(np.outer(rate * t, [0.0, 0.0, 1.0])) * wobbled * fixed
        # the turning axis stands; C_nb carries it to the instrument
        w = (wobbled * fixed).inv().apply([0.0, 0.0, rate]) + C_nb.inv().apply(W_N).mean(axis=0)
        made.append([scale[axis] * row @ w for axis, row in zip("xyz", gain, strict=True)])
    bias = np.array([3e-6, -2e-6, 1e-6])
    return np.array(made) + bias + noise * rng.standard_normal((len(RATES), 3))


def record(y, unit="rad/s", angle=0.0):
    columns = [("rate", parse_unit("rad/s"), RATES)]
    columns += [(f"phi{k}", parse_unit("deg"), np.full(len(RATES), angle)) for k in (1, 2)]
    columns += [(f"gyro_{axis}", parse_unit(unit), y[:, k]) for k, axis in enumerate("xyz")]
    return record_of(columns, np.arange(float(len(RATES))))


def settings(sizes=None, stated=("S_x", "S_y"), u_S=0.0, rate_u=0.0, unit="rad/s", noise=None, dwell=DWELL):
    chain = turntable(
        "two_axis_turntable", None, {name: normal(size) for name, size in (sizes or {}).items()}
    )
    made = study(
        chain=chain,
        kind="gyro",
        unit=unit,
        coefficients={name: S[name[-1]] for name in stated},
        coefficients_u=dict.fromkeys(stated, u_S) if u_S else {},
        dwell=dwell,
        noise=noise,
    )
    return replace(made, rate_test=RateTest("phi2", rate_u=rate_u))


def test_misalignment_is_recovered_beside_the_terms_of_the_gyro_along_the_axis():
    found = calibrate(record(readings(np.random.default_rng(1))), settings()).estimate
    assert found.status is Status.OK, found.message
    assert found.names == ("D_F_z", "S_z", "S_asym_z", "S_nl_z", "S_hyst_z", "D_F_x", "T_xz", "D_F_y", "T_yz")
    for name, value in TRUTH.items():
        # the earth rate seen through T_xy, T_yx and averaged over 400 samples is left
        assert found[name].value == pytest.approx(value, abs=1e-8)
        assert found[name].unit == "rad"
    assert not found.findings
    (said, _, _) = sorted(worth_knowing(found), key=lambda each: "across" not in each.message)
    assert said.message.startswith("D_F_x, T_xz, D_F_y, T_yz: not applied")


def test_counts_need_the_scale_factor_and_a_gyro_without_one_is_left_out():
    y = readings(np.random.default_rng(1), scale={axis: 1e5 * value for axis, value in S.items()})
    made = settings(unit="count", stated=("S_x",))
    counts = {"S_x": 1e5 * S["x"]}
    made = replace(made, instrument=replace(made.instrument, coefficients=counts))
    found = calibrate(record(y, "count"), made).estimate
    assert found["T_xz"].value == pytest.approx(TRUTH["T_xz"], abs=1e-8)
    assert "T_yz" not in found.names
    (said,) = found.findings
    assert said.message == (
        "gyro_y lies across the turning axis phi2 and is left out: with S_y under [instrument.coefficients] its T_yz "
        "is found"
    )


def test_without_the_angle_of_the_turning_axis_the_earth_is_not_known_across_it():
    whole = record(readings(np.random.default_rng(1)))
    blind = replace(whole, columns={name: each for name, each in whole.columns.items() if name != "phi2"})
    found = calibrate(blind, settings()).estimate
    assert "T_xz" not in found.names
    assert "with the angle phi2 where each stay begins its T_xz is found" in found.findings[0].message


def test_u_is_that_of_mounting_wobble_scale_factor_and_rate_written_out():
    """T is off by the mounting about the other axis, by wobble / sqrt(its weights), by (T - mounting) u(S)/S."""
    y = readings(np.random.default_rng(1))
    only = calibrate(record(y), settings({"dtheta_x": MOUNTING, "dtheta_y": MOUNTING}, noise=1e-12)).estimate
    assert only["T_xz"].u == pytest.approx(MOUNTING, rel=1e-4)
    only = calibrate(record(y), settings({"dalpha_y2": WOBBLE}, noise=1e-9)).estimate
    # each stay's slope is y/w, of one u: the mean of 12, but for the bias that is fitted
    assert WOBBLE / np.sqrt(12.0) < only["T_xz"].u < WOBBLE
    # over whole turns the Earth, at this noise, tells nothing of the scale factor
    y = readings(np.random.default_rng(1), dwell=WHOLE_TURNS)
    only = calibrate(record(y), settings(u_S=0.1, noise=1e-9, dwell=WHOLE_TURNS)).estimate
    assert only["T_xz"].u == pytest.approx(TRUTH["T_xz"] * 0.1 / S["x"], rel=1e-3)
    only = calibrate(record(y), settings(rate_u=0.01, noise=1e-9, dwell=WHOLE_TURNS)).estimate
    assert only["T_yz"].u == pytest.approx(-TRUTH["T_yz"] * 0.01, rel=1e-3)


def test_a_dead_gyro_across_the_axis_is_left_out_and_named():
    y = readings(np.random.default_rng(1))
    y[:, 0] = 0.25
    found = calibrate(record(y), settings()).estimate
    assert "T_xz" not in found.names
    assert any("gyro_x reads the same at all rates" in each.message for each in found.findings)


def test_what_bends_with_the_rate_harms_the_misalignment():
    """A sense of the square of the rate, as by the centripetal force on a gyro off the axis, at one sign of rate."""
    y = readings(np.random.default_rng(1))
    y[:, 0] += 1e-4 * RATES**2
    found = calibrate(record(y), settings(noise=NOISE)).estimate
    assert found.status is Status.SUSPECT
    (said,) = [each for each in found.findings if each.code == "excess_scatter"]
    assert said.harm == ("D_F_x", "T_xz")


def test_an_oblique_axis_tells_no_single_misalignment():
    assert axis_about(np.array([[1e-5, 0.0, 1.0], [0.0, -1e-5, 1.0]])) == "z"
    assert axis_about(np.array([[-1.0, 1e-4, 0.0]])) == "x"
    assert axis_about(np.array([[0.01, 0.0, 0.99995]])) == ""


@pytest.mark.slow
def test_intervals_of_misalignment_cover_as_they_say():
    """24 triads with mounting, wobble, scale factor, table rate and noise drawn: rms of the errors in u."""
    rng, runs = np.random.default_rng(20261122), 24
    z = np.empty((runs, 2))
    for run in range(runs):
        true = {axis: value + U_S * rng.standard_normal() for axis, value in S.items()}
        y = readings(rng, MOUNTING, WOBBLE, NOISE, true, U_RATE * rng.standard_normal())
        made = settings(ERRORS, u_S=U_S, rate_u=U_RATE, noise=NOISE if run % 2 else None)
        found = calibrate(record(y), made).estimate
        z[run] = [(found[name].value - value) / found[name].u for name, value in TRUTH.items()]
    low, high = stats.chi2.ppf([5e-4, 1.0 - 5e-4], runs) / runs
    squares = np.mean(z**2, axis=0)
    assert np.all((low < squares) & (squares < high)), squares
