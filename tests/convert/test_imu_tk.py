"""imu_tk: x = T K (raw - b), in text files of 21 numbers."""

import numpy as np
import pytest
from hypothesis import given, settings
from instruments_drawn import assert_same_corrections, instrument, seeds, there_and_back

from inercal.faces.convert import imu_tk
from inercal.faces.convert.correct import ImuModel
from inercal.faces.convert.other_tools import from_tool
from inercal.foundation.errors import InputError
from inercal.foundation.instruments.triad import TriadModel
from rows import for_each

MODEL = instrument(1, sensitive=False)


def as_imu_tk_loads(text):
    """The first 21 words: T and K by rows, then b."""
    numbers = np.array([float(word) for word in text.split()[:21]])
    return numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]


@pytest.mark.parametrize("upper", [True, False])
@given(seed=seeds)
@settings(deadline=None, max_examples=40)
def test_there_and_back(upper, seed):
    model = instrument(seed, upper, sensitive=False)
    assert_same_corrections(model, there_and_back(model, "imu_tk"), seed)


def test_its_own_formula_on_its_own_file_gives_the_truth():
    rng = np.random.default_rng(2)
    f, omega = rng.uniform(-20, 20, (9, 3)), rng.uniform(-3, 3, (9, 3))
    texts = imu_tk.render(imu_tk.terms(MODEL), MODEL.units)
    for raw, true, text in zip(MODEL.indicate(f, omega), (f, omega), texts.values(), strict=True):
        T, K, b = as_imu_tk_loads(text)
        np.testing.assert_allclose((raw - b) @ (T @ K).T, true, atol=1e-10)
        assert np.diag(T).tolist() == [1.0, 1.0, 1.0]
        assert np.count_nonzero(K - np.diag(np.diag(K))) == 0


def test_T_of_accelerometers_that_define_the_frame_is_upper_triangular_and_minus_M_to_first_order():
    T = imu_tk.terms(MODEL)["T_a"]
    assert not np.tril(T, -1).any()
    small = TriadModel(np.ones(3), np.eye(3) + 1e-5 * np.triu(np.ones((3, 3)), 1), np.zeros(3))
    T = imu_tk.terms(ImuModel(small, None, np.zeros((3, 3)), {"acc": "count"}))["T_a"]
    np.testing.assert_allclose(T - np.eye(3), np.eye(3) - small.misalignment, atol=1.1e-10)


def test_accelerometers_alone_are_one_file(tmp_path):
    model = ImuModel(MODEL.accelerometer, None, np.zeros((3, 3)), {"acc": "count"})
    texts = imu_tk.render(imu_tk.terms(model), model.units)
    assert list(texts) == ["_acc"]
    (tmp_path / "acc.calib").write_text(texts["_acc"])
    estimate = from_tool([tmp_path / "acc.calib"], "imu_tk")
    assert not any(name.startswith("S_") for name in estimate.names)


# As imu_tk writes it: columns of Eigen, no words after the numbers.
ITS_OWN = """           1  -0.003359299  -0.008906395
           0            1   -0.02133412
          -0            0             1

0.002412785           0           0
          0 0.002427123           0
          0           0  0.00241168

33124.1825645617
33275.1794341807
32364.4156494431

"""


def test_a_file_of_its_own_needs_the_unit_that_it_does_not_state(tmp_path):
    path = tmp_path / "test_imu_acc.calib"
    path.write_text(ITS_OWN)
    with pytest.raises(
        InputError, match=r"test_imu_acc.calib: states no unit of the acc outputs, .*--acc-unit"
    ):
        from_tool([path], "imu_tk")
    estimate = from_tool([path], "imu_tk", {"acc": "count"})
    assert estimate["K1_x"].value == pytest.approx(1 / 0.002412785, rel=1e-12)
    assert estimate["M_xy"].value == pytest.approx(0.003359299, rel=1e-12)
    assert estimate["K0_z"].value == 32364.4156494431
    assert estimate["K1_x"].unit == "count/(m/s^2)"


@for_each(
    ("texts", "words"),
    [
        (["1 2 3"], "found 3 numbers, expected the 21 numbers"),
        (["1 2 three"], "three.* expected the 21 numbers"),
        ([" ".join(["0"] * 21)], "without inverse"),
        ([" ".join(["nan"] * 21)], "without inverse"),
        ([ITS_OWN, ITS_OWN, ITS_OWN], "found 3 files"),
        ([ITS_OWN + "outputs: gyro [count]"], "file of the gyro"),
        ([ITS_OWN + "outputs: acc [deg/s]"], "found deg/s as the unit of acc outputs"),
    ],
)
def test_what_is_no_file_of_imu_tk_is_said(tmp_path, texts, words):
    paths = [tmp_path / f"{i}.calib" for i in range(len(texts))]
    for path, text in zip(paths, texts, strict=True):
        path.write_text(text)
    with pytest.raises(InputError, match=words):
        from_tool(paths, "imu_tk", {"gyro": "count"} | ({} if "outputs" in texts[0] else {"acc": "count"}))
