"""The paper's own recording against the two programs that were run on it, and what else the page claims.

imu_tk (C++) and the authors' MATLAB (in Octave), both with g = 9.81744 m/s^2. They write the correction
T K (raw - b); in our terms K1 = 1/K, M = T^-1. Pass band: their own differences, or 1.5 standard uncertainties: they
use the poses alone.
"""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "imu"))
from recordings import shipped

from inercal.faces.convert.other_tools import to_tool
from inercal.faces.validate.imu import TK_BIAS, TK_GYRO, TK_SCALE, TK_T
from inercal.foundation.findings import Status
from inercal.systems.imu.task import calibrate

IMU_TK = {"scale": TK_SCALE, "T": TK_T, "bias": TK_BIAS, "gyro": TK_GYRO}
# a = T K (raw - offset) - b, so that the output at zero is offset + (T K)^-1 b
_OFFSET, _B = (
    [33123.0, 33276.0, 32360.0],
    [0.0020248099270609257, -0.0025551442308292213, 0.010940996039930493],
)
_T = np.array([[1, -0.0033507088267299184, -0.00900869750234246], [0, 1, -0.02136509927856986], [0, 0, 1]])
_K = np.diag([0.0024130788978031672, 0.002426935312919503, 0.0024119043336737777])

MATLAB = {
    "bias": np.array(_OFFSET) + np.linalg.solve(_T @ _K, _B),
    "scale": [414.4083315760565, 412.04229658558194, 414.6101427152438],
    "T": [-0.0033507088267299184, -0.00900869750234246, -0.02136509927856986],
    "gyro": [4778.654075477091, 4764.254374291513, 4773.98869178265],
}

NEGLECT = 1.5e-3
"""Shift of the scale factors of the gyro by leaving its g-sensitivity out, as both programs do."""


@pytest.fixture(scope="module")
def xsens():
    return calibrate(*shipped("xsens")).estimate


def correction(estimate):
    """T of the correction T K (raw - b): the inverse of M; its upper part with standard uncertainties."""
    xy, xz, yz = (estimate[f"M_{ij}"].value for ij in ("xy", "xz", "yz"))
    T = np.linalg.inv(np.array([[1, xy, xz], [0, 1, yz], [0, 0, 1]]))
    rows = [estimate.names.index(f"M_{ij}") for ij in ("xy", "xz", "yz")]
    by_m = np.array([[-1, 0, 0], [yz, -1, xy], [0, 0, -1]])  # dT01, dT02, dT12 by M_xy, M_xz, M_yz
    covariance = by_m @ estimate.covariance[np.ix_(rows, rows)] @ by_m.T
    return T[[0, 0, 1], [1, 2, 2]], np.sqrt(np.diag(covariance))


def test_it_is_sound(xsens):
    assert xsens.status is Status.OK
    assert xsens.statistics["intervals"] == 38
    assert xsens.statistics["turns"] == 37


@pytest.mark.parametrize("peer", [IMU_TK, MATLAB])
def test_accelerometer_scales_and_misalignments_agree_with_both_programs(xsens, peer):
    for axis, theirs in zip("xyz", peer["scale"], strict=True):
        ours = xsens[f"K1_{axis}"]
        assert abs(ours.value - theirs) <= max(1.5e-4 * theirs, ours.u)
    for ours, u, theirs in zip(*correction(xsens), peer["T"], strict=True):
        assert abs(ours - theirs) <= max(1.1e-4, 1.5 * u)


@pytest.mark.parametrize("peer", [IMU_TK, MATLAB])
def test_converted_to_imu_tk_its_own_numbers_agree_with_both_programs(xsens, peer):
    """T, 1/K and b of the file that imu_tk reads; u of T as derived by hand in `correction`."""
    theirs = to_tool(xsens, "imu_tk").estimate
    T, u = correction(xsens)
    for ij, by_hand, u_by_hand, value in zip(("xy", "xz", "yz"), T, u, peer["T"], strict=True):
        found = theirs[f"T_a_{ij}"]
        assert found.value == pytest.approx(by_hand, rel=1e-12)
        assert found.u == pytest.approx(u_by_hand, rel=1e-6)
        assert abs(found.value - value) <= max(1.1e-4, 1.5 * found.u)
    for i, axis in enumerate("xyz"):
        K, b, K_g = (theirs[name] for name in (f"K_a_{axis}{axis}", f"b_a_{axis}", f"K_g_{axis}{axis}"))
        assert abs(K.value * peer["scale"][i] - 1.0) <= max(1.5e-4, K.u / K.value)
        assert abs(b.value - peer["bias"][i]) <= max(0.002 * peer["scale"][i], b.u)
        assert abs(K_g.value * peer["gyro"][i] - 1.0) <= NEGLECT


@pytest.mark.parametrize("peer", [IMU_TK, MATLAB])
def test_accelerometer_biases_agree_with_both_programs(xsens, peer):
    for axis, theirs in zip("xyz", peer["bias"], strict=True):
        ours = xsens[f"K0_{axis}"]
        assert abs(ours.value - theirs) <= max(0.002 * xsens[f"K1_{axis}"].value, ours.u)


@pytest.mark.parametrize("peer", [IMU_TK, MATLAB])
def test_gyro_scales_agree_with_both_programs(xsens, peer):
    for axis, theirs in zip("xyz", peer["gyro"], strict=True):
        assert abs(xsens[f"S_{axis}"].value / theirs - 1.0) <= NEGLECT


def test_the_data_fix_one_misalignment_worse_than_the_others(xsens):
    """Three times as badly as M_xy; by the poses alone four times, the turns tell of it as well."""
    assert xsens["M_xz"].u == pytest.approx(3.4e-4, rel=0.1)
    assert xsens["M_xz"].u > 2.5 * xsens["M_xy"].u


def test_the_poses_scatter_more_than_their_noise(xsens):
    assert any(finding.code == "excess_scatter" for finding in xsens.findings)


def test_the_gyro_is_g_sensitive(xsens):
    size = max(np.hypot.reduce([xsens[f"G_{i}{j}"].value for j in "xyz"]) for i in "xyz") * 9.81744
    assert 14 < size < 17
    # significant: the sum of squares over the covariance is far beyond the chi-square of nine
    rows = [xsens.names.index(f"G_{i}{j}") for i in "xyz" for j in "xyz"]
    g = xsens.values[rows]
    assert g @ np.linalg.solve(xsens.covariance[np.ix_(rows, rows)], g) > 200


def test_against_the_factory(xsens):
    for axis, sheet in zip("xyz", (415, 413, 415), strict=True):
        assert 0.0008 < 1 - xsens[f"K1_{axis}"].value / sheet < 0.0024
