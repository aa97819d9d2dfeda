"""Ferraris calibration of simulated sessions: the truth comes back, and the stated uncertainties hold."""

import math
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))
from campaigns.ferraris import one_calibration
from ferraris_sessions import SETTINGS, session, with_values

from inercal.faces.convert.correct import imu_model
from inercal.foundation.computing.runs import run
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE, GravityInput, Site
from inercal.foundation.inference.consistency import coverage
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.units import parse_unit
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.ferraris.method import NAMES, Inputs, coefficients, derivatives
from inercal.systems.imu.ferraris.simulate import true_values
from inercal.systems.imu.settings import FerrarisSettings, ImuSettings

FULL = 2.0 * math.pi
OPTIONS = FerrarisSettings()


def solved(record, settings=SETTINGS, options=OPTIONS):
    return calibrate_ferraris(record, settings, options).estimate


def size_of(name):
    """What a coefficient is compared with: misalignments with 1, the others with a typical value."""
    return {"K0": 3e4, "K1": 415.0, "D_F": 3e4, "S": 4775.0, "G": 1.0}.get(name.rpartition("_")[0], 1.0)


@pytest.mark.parametrize("turn", [FULL, -FULL, 0.5 * math.pi, 4.0 * math.pi])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_truth_comes_back_without_noise(seed, turn):
    """estimate(simulate(theta)) == theta: earth rate apart, to the rounding of outputs near 3e4 and of the sums."""
    record, truth = session(seed, turn=turn)
    estimate = solved(record, options=FerrarisSettings(turn=turn))
    assert estimate.status is Status.OK
    assert estimate.names == NAMES
    error = (estimate.values - true_values(truth)) / [size_of(name) for name in NAMES]
    assert np.max(np.abs(error)) < 1e-8


def test_names_units_and_parts_of_the_result():
    record, _ = session(3)
    estimate = solved(record)
    assert all(name in TERMS for name in estimate.names)
    assert len(estimate.names) == 33
    assert estimate["M_zy"].unit == "rad"
    assert estimate["G_xy"].unit == "count/(m/s^2)"
    assert estimate.statistics["dof"] == 6
    assert {row["section"] for row in estimate.result["sections"]} == {
        *("x_p", "x_a", "y_p", "y_a", "z_p", "z_a", "x_rot", "y_rot", "z_rot")
    }


def test_the_result_corrects_the_recording():
    """In every position the corrected outputs are gravity along the axis named, and no rate."""
    record, _ = session(4)
    model = imu_model(solved(record))
    f, omega = model.correct(record.triad("acc").values, record.triad("gyro").values)
    for name, up in (("x_p", [1, 0, 0]), ("y_a", [0, -1, 0]), ("z_p", [0, 0, 1])):
        rows = np.array(record.labels) == name
        assert np.allclose(f[rows], 9.81 * np.array(up), atol=1e-7)
        assert np.allclose(omega[rows], 0.0, atol=1e-8)
    turn = np.array(record.labels) == "y_rot"
    assert np.sum(omega[turn], axis=0) / 50.0 == pytest.approx([0.0, FULL, 0.0], abs=1e-6)


def test_derivatives_are_those_of_finite_differences():
    rng = np.random.default_rng(5)
    A, B = (
        400.0 * (np.eye(3) + 0.05 * rng.normal(size=(3, 3))),
        4800.0 * (np.eye(3) + 0.05 * rng.normal(size=(3, 3))),
    )
    up = np.repeat(np.eye(3), 2, axis=0) * np.tile([[1.0], [-1.0]], (3, 1))
    x = Inputs(
        9.8 * up @ A.T + 100.0,
        0.2 * 9.8 * up @ rng.normal(size=(3, 3)) + 50.0,
        9.8 * np.eye(3) @ A.T + 100.0,
        1.2 * np.eye(3) @ B.T + 50.0,
        np.array([5.0, 5.5, 6.0]),
        np.full(3, FULL),
        np.array(9.8),
        np.array(4e-5),
    )
    weights = np.array([0.1, 0.2, 0.2, 0.1, 0.25, 0.15])
    by = derivatives(x, weights)
    for field in fields(x):
        value = np.asarray(getattr(x, field.name))
        for index in np.ndindex(value.shape):
            step = 1e-4 * max(1.0, abs(value[index]))
            moved = [value.copy(), value.copy()]
            moved[0][index] += step
            moved[1][index] -= step
            ahead, behind = (coefficients(replace(x, **{field.name: each}), weights) for each in moved)
            numeric = (ahead - behind) / (2.0 * step)
            exact = by[field.name][(slice(None), *index)]
            rounding = 10.0 * np.finfo(float).eps * np.max(np.abs(ahead)) / step
            assert np.allclose(exact, numeric, rtol=1e-6, atol=rounding)


def test_outputs_in_another_unit_are_the_same_instrument():
    record, _ = session(6, noisy=True)
    counts = solved(record)
    scaled = with_values(
        record,
        **{f"acc_{i}": lambda v: v / 400.0 for i in "xyz"},
        **{f"gyro_{i}": lambda v: v / 80.0 for i in "xyz"},
    )
    columns = {
        name: replace(column, unit=parse_unit("m/s^2" if name.startswith("acc") else "deg/s"))
        for name, column in scaled.columns.items()
    }
    other = solved(replace(scaled, columns=columns))
    assert other.status is Status.OK
    for name in NAMES:
        factor = {"K": 400.0, "D": 80.0, "S": 80.0, "G": 80.0}.get(name[0], 1.0)
        assert other[name].value * factor == pytest.approx(counts[name].value, rel=1e-9, abs=1e-9)
        assert other[name].u * factor == pytest.approx(counts[name].u, rel=1e-6)


def test_a_known_latitude_takes_the_vertical_earth_rate_off_the_g_sensitivity():
    """Earth rate about an axis that points up looks like drift by gravity, S T times its vertical part over g."""
    latitude = 0.8
    record, truth = session(7, latitude=latitude)
    known = solved(record, ImuSettings(Site(9.81, latitude=latitude)))
    unknown = solved(record)
    scale = true_values(truth)[NAMES.index("S_z")]
    by_earth = scale * EARTH_RATE * math.sin(latitude) / 9.81
    assert unknown["G_zz"].value - known["G_zz"].value == pytest.approx(by_earth, rel=1e-3)
    # the horizontal part, of unknown heading, still acts through the misalignments of some 0.02
    true = dict(zip(NAMES, true_values(truth), strict=True))
    for name in ("G_xx", "G_yy", "G_zz"):
        assert known[name].value == pytest.approx(true[name], abs=0.06 * by_earth)
    # the scale factors are against the Earth either way
    for axis in "xyz":
        assert known[f"S_{axis}"].value == pytest.approx(true[f"S_{axis}"], rel=3e-5)
        assert unknown[f"S_{axis}"].value == pytest.approx(known[f"S_{axis}"].value, rel=1e-12)
    assert unknown["G_zz"].u > 5.0 * known["G_zz"].u


def test_unequal_holds_leave_a_part_of_the_g_sensitivity_in_the_bias_which_its_uncertainty_holds():
    """The gyro's bias is the mean of all samples: off by G times the mean specific force over them."""
    holds = (5.0, 5.0, 10.0, 5.0, 5.0, 5.0)
    record, truth = session(8, holds=holds)
    estimate = solved(record)
    mean = 9.81 * 5.0 / 35.0
    for i, axis in enumerate("xyz"):
        off = truth.g_sensitivity[i, 1] * mean
        assert estimate[f"D_F_{axis}"].value - truth.gyro.bias[i] == pytest.approx(off, rel=1e-6)
        assert estimate[f"D_F_{axis}"].u >= abs(off) * (1.0 - 1e-9)


def test_tilted_positions_show_as_half_the_difference_of_their_tilts():
    """Two positions tilted alike leave nothing over; their mean tilt is a misalignment."""
    record, _ = session(9, alignment=math.radians(0.5))
    estimate = solved(record)
    left = np.array([[row[f"on_{i}_m_s2"] for i in "xyz"] for row in estimate.result["positions"]]) / 9.81
    across = left[~np.eye(3, dtype=bool)]
    assert estimate.statistics["position_scatter_rad"] == pytest.approx(
        math.sqrt(2.0 * np.mean(across**2)), rel=0.03
    )
    assert 0.2 < math.degrees(estimate.statistics["position_scatter_rad"]) < 1.0
    assert estimate["M_xy"].dof == pytest.approx(6.0, rel=0.01)
    assert estimate["M_xy"].u == pytest.approx(
        estimate.statistics["position_scatter_rad"] / math.sqrt(2.0), rel=0.1
    )


def test_a_stated_alignment_that_the_scatter_contradicts_is_not_believed():
    record, _ = session(10, noisy=True, alignment=math.radians(2.0))
    estimate = solved(record, options=FerrarisSettings(alignment=math.radians(0.1)))
    assert any(f.code == "excess_scatter" and "stated alignment" in f.message for f in estimate.findings)
    unstated = solved(record)
    assert estimate["M_xy"].u == pytest.approx(unstated["M_xy"].u, rel=1e-6)
    believed = solved(record, options=FerrarisSettings(alignment=math.radians(2.0)))
    assert not any(f.code == "excess_scatter" for f in believed.findings)
    assert math.isinf(believed["M_xy"].dof) or believed["M_xy"].dof > 1000


def test_alignment_acts_on_scale_factors_in_second_order():
    """All scale factors come out too small by tilt^2 on average: the uncertainty holds that and its spread."""
    record, _ = session(11)
    tilt = math.radians(1.0)
    estimate = solved(record, options=FerrarisSettings(alignment=tilt))
    share = {item.source: item.share for item in estimate.budget}["alignment"]
    by_alignment = estimate["K1_x"].u * math.sqrt(share["K1_x"]) / estimate["K1_x"].value
    # mean 1, variance 1/2 of the mean of two exponential variates; first order through the misalignments beside it
    first = tilt * math.hypot(estimate["M_xy"].value, estimate["M_xz"].value) / math.sqrt(2.0)
    assert by_alignment == pytest.approx(math.hypot(math.sqrt(1.5) * tilt**2, first), rel=0.02)


def test_known_inputs_reach_the_coefficients_that_hang_on_them():
    record, _ = session(12, noisy=True)
    plain = solved(record)
    g = solved(record, ImuSettings(Site(9.81, (GravityInput("gravity", 0.01, "m/s^2", 1.0),))))
    for axis in "xyz":
        k1 = plain[f"K1_{axis}"]
        assert g[f"K1_{axis}"].u == pytest.approx(math.hypot(k1.u, k1.value * 0.01 / 9.81), rel=1e-6)
        assert g[f"S_{axis}"].u == pytest.approx(plain[f"S_{axis}"].u, rel=1e-6)
    turn = solved(record, options=FerrarisSettings(turn_u=0.01))
    clock = solved(record, ImuSettings(Site(9.81), time_base_u=1e-3))
    s = plain["S_y"]
    assert turn["S_y"].u == pytest.approx(math.hypot(s.u, s.value * 0.01 / FULL), rel=1e-6)
    assert clock["S_y"].u == pytest.approx(math.hypot(s.u, s.value * 1e-3), rel=1e-5)
    names = [NAMES.index("S_x"), NAMES.index("S_y")]
    assert abs(turn.correlation[np.ix_(names, names)][0, 1]) < 0.1
    assert clock.correlation[np.ix_(names, names)][0, 1] > 0.8


def test_outputs_coarser_than_their_noise_are_no_better_known_than_their_step():
    record, _ = session(13, noisy=True)
    coarse = with_values(record, **{f"gyro_{i}": lambda v: 64.0 * np.round(v / 64.0) for i in "xyz"})
    coarse = with_values(coarse, **{f"acc_{i}": lambda v: 16.0 * np.round(v / 16.0) for i in "xyz"})
    estimate = solved(coarse)
    assert estimate["D_F_x"].u > 64.0 / math.sqrt(12.0)
    assert {"gyro resolution", "accelerometer resolution"} <= {item.source for item in estimate.budget}


SEED, RUNS = 20261121, 250


@pytest.mark.parametrize("runs", [20, pytest.param(RUNS, marks=pytest.mark.campaign)])
def test_intervals_cover_the_truth_as_often_as_they_say(runs):
    """250 sessions with every source drawn, the seed fixed before the first look.

    89.2 and 99.2 % are exact binomial limits of one coefficient, at a risk of 1e-4 each. All together: four standard
    deviations below 95 %; alignment of second order and the Allan fit at the length of a hold err on the safe side,
    so that they may lie at 97 % and a standard deviation more. The test run makes the first 20: 14 hits are the exact
    limit of one at a risk of 4e-5, 0.88 of all is four and a half standard deviations at a design effect of 3.
    """
    sample = run(one_calibration, runs=runs, seed=SEED)
    assert np.all(sample["sound"] == 1.0)
    found = coverage(sample["error"], sample["u"], sample["dof"])
    each, least, most = ((0.892, 0.992), 0.936, 0.974) if runs == RUNS else ((0.7, 1.0), 0.88, 1.0)
    assert np.all((found.fraction >= each[0]) & (found.fraction <= each[1])), found.table(NAMES)
    assert least <= found.pooled <= most, found.table(NAMES)
