"""The triad: indication and correction undo each other, and agree with the conventions of imu_tk."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.instruments.triad import TriadModel, triad_from_terms


@st.composite
def triads(draw, largest=0.1):
    """Any triad whose axes are roughly at right angles; either sign and any size of scale."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    M = np.eye(3) + np.where(np.eye(3, dtype=bool), 0.0, rng.uniform(-largest, largest, (3, 3)))
    scale = rng.choice([-1.0, 1.0], 3) * 10.0 ** rng.uniform(-4, 4, 3)
    return TriadModel(scale, M, scale * rng.uniform(-1.0, 1.0, 3))


inputs = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).uniform(-20, 20, (2, 4, 3)))


@settings(deadline=None)
@given(triads(), inputs)
def test_correction_undoes_indication(triad, x):
    np.testing.assert_allclose(triad.correct(triad.indicate(x)), x, atol=1e-10)


@settings(deadline=None)
@given(triads(), inputs)
def test_indication_undoes_correction(triad, x):
    y = triad.indicate(x)
    np.testing.assert_allclose(triad.indicate(triad.correct(y)), y, rtol=1e-9, atol=1e-9 * np.abs(y).max())


@settings(deadline=None)
@given(triads(), inputs)
def test_one_axis_after_the_other(triad, x):
    """y_i = S_i sum_j M_ij x_j + b_i, written out."""
    y = triad.indicate(x)
    for i in range(3):
        along = sum(triad.misalignment[i, j] * x[..., j] for j in range(3))
        np.testing.assert_allclose(y[..., i], triad.scale[i] * along + triad.bias[i], rtol=1e-12, atol=1e-9)


@settings(deadline=None)
@given(triads(), inputs)
def test_a_batch_is_its_samples(triad, x):
    single = [[triad.indicate(v) for v in row] for row in x]
    np.testing.assert_allclose(triad.indicate(x), single, rtol=1e-12, atol=1e-12)


def test_a_perfect_triad_shows_what_there_is():
    perfect = TriadModel(np.ones(3), np.eye(3), np.zeros(3))
    np.testing.assert_array_equal(perfect.indicate(np.array([1.0, 2.0, 3.0])), [1.0, 2.0, 3.0])


def test_a_misalignment_is_the_response_to_another_axis():
    """M_xy = 1 mrad: specific force along y shows up in x, and in no other axis."""
    triad = triad_from_terms({"K1_x": 2.0, "K1_y": 3.0, "K1_z": 4.0, "M_xy": 1e-3}, "K1", "M", "K0")
    np.testing.assert_allclose(triad.indicate(np.array([0.0, 10.0, 0.0])), [0.02, 30.0, 0.0])
    np.testing.assert_allclose(triad.indicate(np.array([10.0, 0.0, 0.0])), [20.0, 0.0, 0.0])


def test_terms_find_their_places():
    values = {
        f"{name}_{axis}": 10.0 * k + i
        for k, name in enumerate(("S", "D_F"), 1)
        for i, axis in enumerate("xyz")
    }
    values |= {f"T_{'xyz'[i]}{'xyz'[j]}": (3 * i + j) / 100 for i in range(3) for j in range(3) if i != j}
    triad = triad_from_terms(values, "S", "T", "D_F")
    np.testing.assert_array_equal(triad.scale, [10, 11, 12])
    np.testing.assert_array_equal(triad.bias, [20, 21, 22])
    np.testing.assert_array_equal(triad.misalignment, [[1, 0.01, 0.02], [0.03, 1, 0.05], [0.06, 0.07, 1]])
    np.testing.assert_array_equal(triad.gain, np.diag([10, 11, 12]) @ triad.misalignment)


def test_absent_terms_are_zero_but_a_scale_factor_there_must_be():
    triad = triad_from_terms({"K1_x": 1.0, "K1_y": 1.0, "K1_z": 1.0}, "K1", "M", "K0")
    np.testing.assert_array_equal(triad.gain, np.eye(3))
    np.testing.assert_array_equal(triad.bias, np.zeros(3))
    with pytest.raises(KeyError, match="K1_y"):
        triad_from_terms({"K1_x": 1.0}, "K1", "M", "K0")


@settings(deadline=None)
@given(st.lists(st.floats(-0.02, 0.02), min_size=3, max_size=3), inputs)
def test_the_correction_of_imu_tk(misalignments, x):
    """imu_tk: a = T K (raw - b), T = [1 -a_yz a_zy; 0 1 -a_zx; 0 0 1] (Tedaldi 2014, eq. (2) to (6)).

    With M upper-triangular, T is its inverse: alpha_yz = M_xy, alpha_zx = M_yz, alpha_zy = -M_xz to first order.
    """
    M_xy, M_xz, M_yz = misalignments
    scale, bias = {"K1_x": 210.0, "K1_y": 205.0, "K1_z": -198.0}, {"K0_x": 3.0, "K0_y": -8.0, "K0_z": 11.0}
    triad = triad_from_terms(scale | bias | {"M_xy": M_xy, "M_xz": M_xz, "M_yz": M_yz}, "K1", "M", "K0")
    T = np.array([[1.0, -M_xy, -M_xz], [0.0, 1.0, -M_yz], [0.0, 0.0, 1.0]])
    K = np.diag(1.0 / triad.scale)
    raw = triad.indicate(x)
    second_order = 4 * max(map(abs, misalignments)) ** 2 * np.abs(x).max()
    np.testing.assert_allclose((raw - triad.bias) @ (T @ K).T, triad.correct(raw), atol=second_order + 1e-10)
    exact = np.linalg.inv(triad.misalignment)
    assert -exact[0, 1] == pytest.approx(M_xy, abs=1e-15)  # alpha_yz, exactly
    assert -exact[1, 2] == pytest.approx(M_yz, abs=1e-15)  # alpha_zx
    assert exact[0, 2] == pytest.approx(-M_xz + M_xy * M_yz, abs=1e-15)  # alpha_zy
