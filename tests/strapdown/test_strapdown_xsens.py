"""A real unit turned by hand (the Xsens recording that ships), beside the method of many poses on the same record."""

import numpy as np
import pytest

import inercal as ic
from inercal.examples import FOLDER

MAP = FOLDER / "xsens-map.toml"
NOISE = {"angle_random_walk": "1.85 deg/sqrt(h)", "velocity_random_walk": "75 ug/sqrt(Hz)"}
"""White noise of the first rest, of the differences of neighbouring samples."""

PRIOR = {"gyro_bias": "3 deg/s", "scale": "5 %", "misalignment": "5 deg", "bias": "0.2 g", "k1": "5 %", "axes": "5 deg",
         "g_sensitivity": "2000 deg/h/g"}  # fmt: skip


@pytest.fixture(scope="module")
def record():
    """The recording in SI by nominal scales: a calibration in physical units is about 1."""
    raw = ic.read([FOLDER / "xsens_acc.mat", FOLDER / "xsens_gyro.mat"], map=MAP)
    columns = {
        f"{sensor}_{axis}": (raw[f"{sensor}_{axis}"].values - 32768.0) / scale
        for sensor, scale in (("acc", 414.5), ("gyro", 4778.0))
        for axis in "xyz"
    }
    return ic.record(columns, rate=100.0, units={"gyro": "rad/s", "acc": "m/s^2"})


def calibrated(record, *terms):
    return ic.calibrate(
        record,
        ic.study(
            "strapdown", latitude="45.4 deg", gravity="9.81744(2) m/s^2", strapdown={"terms": list(terms)}, noise=NOISE,
            rests={"velocity": "1 mm/s", "attitude": "0.03 deg"}, prior=PRIOR,
        ),
    )  # fmt: skip


def test_biases_that_turn_the_unit_around_in_a_rest_are_begun_with(record):
    """Of 4 deg/s: without them the first rest of 52 s would be two turns by 100 deg."""
    without = calibrated(record, "k2", "size", "delay")
    assert len(without.estimate.result["rests"]) == 38
    assert without.status.value == "inconsistent"
    (finding,) = (each for each in without.estimate.findings if each.code == "unmodelled")
    assert 'add "g_sensitivity" to terms' in finding.message


def test_drifts_by_force_are_those_of_many_poses(record):
    """And chi-square falls as it was foretold by their score; the rest of it is of biases that wander."""
    found = calibrated(record, "k2", "size", "delay", "g_sensitivity").estimate
    poses = ic.calibrate(
        ic.read([FOLDER / "xsens_acc.mat", FOLDER / "xsens_gyro.mat"], map=MAP), FOLDER / "xsens.toml"
    )
    assert found.statistics["chi2"] < 3600.0
    for name in ("G_yx", "G_yz", "G_zx", "G_zy"):
        # outputs in counts over their scale factor are rates
        scale = poses.values[f"S_{name[2]}"]
        value, u = poses.values[name] / scale, poses.estimate[name].u / scale
        assert abs(found[name].value - value) < 3.0 * np.hypot(found[name].u, u), name
    assert found["tau_a"].value == pytest.approx(1.2e-3, abs=3.0 * 1.5e-4)
    for name, place in (("r_xx", -0.6), ("r_xz", -0.7), ("r_yx", -0.8), ("r_yz", -0.3)):
        assert found[name].value == pytest.approx(0.01 * place, abs=2e-3), name
