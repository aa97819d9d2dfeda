"""A two-axis table simulated by pyins, whose truth is known, against pyins' own calibration of it.

pyins 8377ede, sim.Turntable and examples/imu_calibration.ipynb with seed 0: its estimates are off by up to 0.044 %
(gyro) and 0.0086 % (accelerometers) of the elements of the matrices T = S M. Asked of ours: 0.03 % and 0.008 %, and
every error within three standard uncertainties.

The noise of the recording lets the gyro's elements be known to 0.015 to 0.024 % (one standard uncertainty), so the
largest of nine errors is above 0.03 % in six of ten recordings, also with the best of estimators. In this one it is
0.024 % where the heading of the table is stated, and 0.032 % where it is not.
"""

import numpy as np
import pytest
from new_studies import table_read

from inercal.examples import FOLDER
from inercal.faces.studies.imu import aided_settings
from inercal.faces.validate.imu import TABLE_ACC, TABLE_ACC_BIAS, TABLE_GYRO
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.read import read
from inercal.systems.imu.aided.calibration import calibrate_aided
from inercal.systems.imu.settings import AidedRig, ImuSettings

ACC, GYRO, ACC_BIAS = map(np.array, (TABLE_ACC, TABLE_GYRO, TABLE_ACC_BIAS))  # the bias: mean over the test
GYRO_BIAS = np.array([0.0007962550847312129, 0.0002793371758986746, 0.0028202067690031776])  # at the start
GYRO_WALK = 1.6160456036984532e-06  # rad/s/sqrt(s)
PEER = {"gyro": 4.4216e-4, "acc": 8.6109e-5}  # largest errors of pyins' own calibration

TABLE = {
    "mounting": ["+y", "+x", "-z"],
    "rig": {
        "kind": "two_axis_turntable",
        "base": {"azimuth": "133.0(1) deg"},
        "errors": {
            "deps_x": {"normal": "3 arcsec"},
            "deps_y": {"normal": "3 arcsec"},
            "dbase_x": {"normal": "2 arcsec"},
            "dbase_y": {"normal": "2 arcsec"},
        },
    },
}
UNKNOWN_HEADING = {**TABLE, "rig": {**TABLE["rig"], "base": {}}}


def calibrated(table):
    options = aided_settings(table_read(AidedRig, table), "study")
    site = Site(9.81507294711262, (), np.radians(55.0))
    return calibrate_aided(read(FOLDER / "table.npz"), ImuSettings(site), options).estimate


@pytest.fixture(scope="module")
def stated():
    return calibrated(TABLE)


@pytest.fixture(scope="module")
def unknown():
    return calibrated(UNKNOWN_HEADING)


def matrix(estimate, scale, cross):
    S = [estimate[f"{scale}_{i}"].value for i in "xyz"]
    M = [[1.0 if i == j else estimate[f"{cross}_{i}{j}"].value for j in "xyz"] for i in "xyz"]
    return np.array(S)[:, None] * np.array(M)


def largest_errors(estimate):
    return {
        "gyro": np.max(np.abs(matrix(estimate, "S", "T") - GYRO)),
        "acc": np.max(np.abs(matrix(estimate, "K1", "M") - ACC)),
    }


def test_the_largest_errors_are_below_the_bounds_and_below_those_of_the_peer(stated):
    found = largest_errors(stated)
    assert found["gyro"] <= 3.0e-4 < PEER["gyro"]
    assert found["acc"] <= 8.0e-5 < PEER["acc"]


def test_without_its_heading_the_table_still_does_better_than_the_peer(unknown):
    found = largest_errors(unknown)
    assert found["gyro"] <= 0.75 * PEER["gyro"]
    assert found["acc"] <= 8.0e-5


@pytest.mark.parametrize("case", ["stated", "unknown"])
def test_every_error_is_within_three_standard_uncertainties(case, request):
    estimate = request.getfixturevalue(case)
    assert estimate.status is Status.OK
    for truth, bias, scale, cross in (
        (ACC, ACC_BIAS, "K1", "M"),
        (GYRO, GYRO_BIAS, "S", "T"),
    ):
        for a, i in enumerate("xyz"):
            for b, j in enumerate("xyz"):
                name, true = (
                    (f"{scale}_{i}", truth[a, a])
                    if a == b
                    else (f"{cross}_{i}{j}", truth[a, b] / truth[a, a])
                )
                assert abs(estimate[name].value - true) <= 3.0 * estimate[name].u, name
        name = "K0" if scale == "K1" else "D_F"
        for a, i in enumerate("xyz"):
            # the truth of the gyro is at the start: the mean of a random walk over T is off by K sqrt(T/3)
            extra = 0.0 if name == "K0" else GYRO_WALK * np.sqrt(265.3 / 3.0)
            u = np.hypot(estimate[f"{name}_{i}"].u, extra)
            assert abs(estimate[f"{name}_{i}"].value - bias[a]) <= 3.0 * u, name


@pytest.mark.parametrize("case", ["stated", "unknown"])
def test_the_bound_is_below_the_usual_size_of_the_largest_error(case, request):
    """The largest of nine errors by the stated covariance: 0.033 % in the median, below 0.03 % in four of ten."""
    estimate = request.getfixturevalue(case)
    names, S = list(estimate.names), {i: estimate[f"S_{i}"].value for i in "xyz"}
    J = np.zeros((9, len(names)))  # of the elements S_i T_ij
    for row, (i, j) in enumerate((i, j) for i in "xyz" for j in "xyz"):
        J[row, names.index(f"S_{i}")] = 1.0 if i == j else estimate[f"T_{i}{j}"].value
        if i != j:
            J[row, names.index(f"T_{i}{j}")] = S[i]
    V = J @ estimate.covariance @ J.T
    u = np.sqrt(np.diag(V))
    assert 1.4e-4 < u.min() < u.max() < 2.5e-4
    largest = np.abs(np.random.default_rng(1).multivariate_normal(np.zeros(9), V, 20_000)).max(axis=1)
    assert np.median(largest) == pytest.approx(3.3e-4, abs=0.1e-4)
    assert np.mean(largest < 3.0e-4) == pytest.approx(0.39, abs=0.03)
    # a column by one turn less the mean of 30 s of rest before it, as pyins takes it
    T = 19.0
    of_peer = 2.9089e-4 * np.sqrt(T + T**2 / 30.0) / (2.0 * np.pi)
    assert of_peer == pytest.approx(2.6e-4, abs=0.1e-4)
    assert u.max() < of_peer


def test_the_uncertainties_are_those_the_noise_allows(stated):
    """The best a turn of 360 deg in 19 s can do is N / sqrt(integral of the squared rate): 1.98e-4."""
    floor = 2.9089e-4 / np.sqrt(np.radians(20.0) ** 2 * (17.0 + 2.0 / 3.0))
    for axis in "xyz":
        # y and z turn half a circle and more beside their whole turn
        assert 0.6 * floor < stated[f"S_{axis}"].u < 1.3 * floor
    assert all(item.u > 0.0 for item in stated.budget)
