"""Six sides and three turns of simulated sessions: the truth comes back, and the stated uncertainties hold."""

import math
import sys
from dataclasses import replace
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
from inercal.foundation.units import parse_unit
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.ferraris.names import NAMES, TERMS_OF_FERRARIS
from inercal.systems.imu.ferraris.simulate import true_values
from inercal.systems.imu.settings import FerrarisSettings, ImuSettings

FULL = 2.0 * math.pi
OPTIONS = FerrarisSettings()


def solved(record, settings=SETTINGS, options=OPTIONS):
    return calibrate_ferraris(record, settings, options).estimate


def size_of(name):
    """What a coefficient is compared with: misalignments with 1, the others with a typical value."""
    return {"K0": 3e4, "K1": 415.0, "D_F": 3e4, "S": 4775.0, "G": 478.0}.get(name.rpartition("_")[0], 1.0)


@pytest.mark.parametrize(("seed", "turn"), [(1, FULL), (2, -FULL), (1, 0.5 * math.pi), (2, 4.0 * math.pi)])
def test_the_truth_comes_back_without_noise(seed, turn):
    """estimate(simulate(theta)) == theta, earth rate apart, to what priors pull where there is no noise; imucal's
    closed form to rounding."""
    record, truth = session(seed, turn=turn)
    estimate = solved(record, replace(SETTINGS, k2_u=0.0), FerrarisSettings(turn=turn))
    assert estimate.status is Status.OK
    true, sizes = true_values(truth), np.array([size_of(name) for name in TERMS_OF_FERRARIS])
    found = np.array([estimate[name].value for name in TERMS_OF_FERRARIS])
    assert np.max(np.abs(found - true) / sizes) < 1e-5
    closed = np.array([estimate.result["imucal"][name] for name in TERMS_OF_FERRARIS])
    assert np.max(np.abs(closed - true) / sizes) < 1e-8


def test_the_result_holds_the_nine_sections_and_their_terms():
    estimate = solved(session(3, noisy=True)[0])
    assert set(TERMS_OF_FERRARIS) <= set(estimate.names)
    assert set(estimate.names) - set(TERMS_OF_FERRARIS) == {"K2_x", "K2_y", "K2_z"}
    assert [row["section"] for row in estimate.result["sections"]] == list(NAMES)
    assert estimate.result["found_by"] == "labels"
    assert set(estimate.result["imucal"]) == set(TERMS_OF_FERRARIS)


def test_the_result_corrects_the_recording():
    """In every position the corrected outputs are gravity along the axis named, and no rate."""
    record, _ = session(4)
    model = imu_model(solved(record, replace(SETTINGS, k2_u=0.0)))
    f, omega = model.correct(record.triad("acc").values, record.triad("gyro").values)
    for name, up in (("x_p", [1, 0, 0]), ("y_a", [0, -1, 0]), ("z_p", [0, 0, 1])):
        rows = np.array(record.labels) == name
        assert np.allclose(f[rows], 9.81 * np.array(up), atol=1e-4)
        assert np.allclose(omega[rows], 0.0, atol=1e-5)
    turn = np.array(record.labels) == "y_rot"
    assert np.sum(omega[turn], axis=0) / 50.0 == pytest.approx([0.0, FULL, 0.0], abs=1e-4)


def test_outputs_in_another_unit_are_the_same_instrument():
    """In m/s^2 and deg/s the priors of scale factors come in, which nine sections overrule."""
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
    for name in TERMS_OF_FERRARIS:
        factor = {"K": 400.0, "D": 80.0, "S": 80.0, "G": 80.0}.get(name[0], 1.0)
        u = counts[name].u
        assert other[name].value * factor == pytest.approx(counts[name].value, abs=0.02 * u)
        assert other[name].u * factor == pytest.approx(u, rel=0.02)


def test_a_known_latitude_takes_the_vertical_earth_rate_off_the_g_sensitivity():
    """Earth rate about an axis that points up looks like drift by gravity, S T times its vertical part over g."""
    latitude = 0.8
    record, truth = session(7, latitude=latitude)
    known = solved(record, ImuSettings(Site(9.81, latitude=latitude)))
    unknown = solved(record)
    true = dict(zip(TERMS_OF_FERRARIS, true_values(truth), strict=True))
    by_earth = true["S_z"] * EARTH_RATE * math.sin(latitude) / 9.81
    # the horizontal part, of unknown heading, still acts through the misalignments of some 0.02
    for name in ("G_xx", "G_yy", "G_zz"):
        assert known[name].value == pytest.approx(true[name], abs=0.1 * by_earth)
        assert abs(unknown[name].value - true[name]) < 2.0 * unknown[name].u
        assert unknown[name].u > 0.5 * by_earth
    # the scale factors are against the Earth either way
    for axis in "xyz":
        assert known[f"S_{axis}"].value == pytest.approx(true[f"S_{axis}"], rel=6e-5)
    assert unknown["G_zz"].u > 3.0 * known["G_zz"].u


def test_known_inputs_reach_the_coefficients_that_hang_on_them():
    record, _ = session(12, noisy=True)
    plain = solved(record)
    g = solved(record, ImuSettings(Site(9.81, (GravityInput("gravity", 0.01, "m/s^2", 1.0),))))
    for axis in "xyz":
        k1 = plain[f"K1_{axis}"]
        assert g[f"K1_{axis}"].u == pytest.approx(math.hypot(k1.u, k1.value * 0.01 / 9.81), rel=0.01)
        assert g[f"S_{axis}"].u == pytest.approx(plain[f"S_{axis}"].u, rel=0.01)
    turn = solved(record, options=FerrarisSettings(turn_u=0.01))
    clock = solved(record, ImuSettings(Site(9.81), time_base_u=1e-3))
    s = plain["S_y"]
    assert turn["S_y"].u == pytest.approx(math.hypot(s.u, s.value * 0.01 / FULL), rel=0.02)
    assert clock["S_y"].u == pytest.approx(math.hypot(s.u, s.value * 1e-3), rel=0.02)
    at = [turn.names.index("S_x"), turn.names.index("S_y")]
    assert abs(turn.correlation[np.ix_(at, at)][0, 1]) < 0.1
    assert clock.correlation[np.ix_(at, at)][0, 1] > 0.8


def test_outputs_coarser_than_their_noise_are_no_better_known_than_their_step():
    record, _ = session(13, noisy=True)
    fine = solved(record)
    coarse = with_values(record, **{f"gyro_{i}": lambda v: 64.0 * np.round(v / 64.0) for i in "xyz"})
    estimate = solved(coarse)
    assert estimate["D_F_x"].u > 0.4 * 64.0 / math.sqrt(12.0) > 2.0 * fine["D_F_x"].u  # of six sides together


SEED, RUNS = 20261121, 250


@pytest.mark.slow
@pytest.mark.parametrize("runs", [20, pytest.param(RUNS, marks=pytest.mark.campaign)])
def test_intervals_cover_the_truth_as_often_as_they_say(runs):
    """250 sessions with every source drawn, the seed fixed before the first look.

    89.2 and 99.2 % are exact binomial limits of one coefficient, at a risk of 1e-4 each. All together: four standard
    deviations below 95 %; what errs on the safe side may lie above. The test run makes the first 20: 14 hits are the
    exact limit of one at a risk of 4e-5, 0.88 of all is four and a half standard deviations at a design effect of 3.
    K0, whose u holds the K2 of an ordinary instrument that none of these has, is covered more often.
    """
    sample = run(one_calibration, runs=runs, seed=SEED)
    assert np.mean(sample["sound"]) >= 0.98
    found = coverage(sample["error"], sample["u"], sample["dof"])
    each, least = (0.892, 0.936) if runs == RUNS else (0.7, 0.88)
    assert np.all(found.fraction >= each), found.table(TERMS_OF_FERRARIS)
    assert least <= found.pooled, found.table(TERMS_OF_FERRARIS)
