"""The 19-position record that ships: simulated by another program (PSINS), whose true coefficients are known."""

import numpy as np
import pytest

import inercal as ic
from inercal.examples import FOLDER
from inercal.foundation.findings import Status
from inercal.foundation.units import parse_unit

DEG_PER_H, SECOND = np.radians(1.0) / 3600.0, np.radians(1.0) / 3600.0
UG = 1e-6 * 9.7803267715
"""The record's ug [m/s^2]: its authors' own g."""

#: largest error of each kind that is allowed, in SI
BANDS = {
    "D_F": 0.0003 * DEG_PER_H, "S": 0.2e-6, "T": 0.3e-6, "K0": 0.3 * UG, "K1": 0.3e-6, "M": 0.3e-6,
    "K2": 0.3e-6 / 9.80665, "r": 0.3e-3, "tau": 1e-6,
}  # fmt: skip


def injected():
    """The true coefficients.

    The simulation applies corrections to perfect data, w = Kg w_m - eb, f = Ka f_m - db - Ka2 f^2 - fL - tGA (w x f):
    the data hold their inverse, so that biases, K2, places and the delay have the other sign.
    """
    values = {}
    Kg = np.eye(3) + np.array(
        [
            [-10e-6, 10 * SECOND, 20 * SECOND],
            [30 * SECOND, -20e-6, 40 * SECOND],
            [50 * SECOND, 60 * SECOND, -30e-6],
        ]
    )
    Ka = np.eye(3) + np.array([[-10e-6, 0, 0], [10 * SECOND, -20e-6, 0], [20 * SECOND, 30 * SECOND, -30e-6]])
    for i, axis in enumerate("xyz"):
        values |= {f"S_{axis}": Kg[i, i], f"K1_{axis}": Ka[i, i]}
        values |= {f"D_F_{axis}": -0.1 * (i + 1) * DEG_PER_H, f"K0_{axis}": -10 * (i + 1) * UG}
        values |= {f"K2_{axis}": -10e-6 * (i + 1) / 9.7803267715}
        values |= {f"r_x{axis}": -0.01 * (i + 1), f"r_y{axis}": -0.01 * (i + 4)}
        for j, other in enumerate("xyz"):
            if j != i:
                values[f"T_{axis}{other}"] = Kg[i, j] / Kg[i, i]
            if j < i:
                values[f"M_{axis}{other}"] = Ka[i, j] / Ka[i, i]
    return values | {"tau_a": -1e-3}


@pytest.fixture(scope="module")
def record():
    return ic.read(FOLDER / "strapdown.bin.gz", map=FOLDER / "strapdown-map.toml")


@pytest.fixture(scope="module")
def result(record):
    return ic.calibrate(record, FOLDER / "strapdown.toml")


def test_every_coefficient_is_the_injected_one(result):
    assert result.status is Status.OK
    truth = injected()
    assert truth.keys() == set(result.names)
    for name in result.names:
        found = result.estimate[name]
        error = found.value - truth[name]
        assert abs(error) < 0.3 * found.u, name
        assert abs(error) < BANDS[name.rpartition("_")[0]], name


def test_noise_that_is_not_there_is_said(result):
    assert [each.code for each in result.estimate.findings if each.code == "low_scatter"] == ["low_scatter"]
    assert result.estimate.statistics["residual_rms"] < 0.3


def test_all_turns_are_quarters(result):
    turns = result.estimate.result["turns"]
    assert len(turns) == 18
    assert len(result.estimate.result["rests"]) == 19
    assert np.degrees([each["angle"] for each in turns]) == pytest.approx(np.full(18, 90.0), abs=0.05)


def test_the_other_frame_is_a_rotation_of_this(record, result):
    """The gains' Gram matrices know no frame."""
    other = ic.calibrate(record, ic.study(FOLDER / "strapdown.toml", strapdown={"frame": "upper"}))

    def grams(of, pairs):
        values = of.values
        K = np.diag([values[f"K1_{i}"] for i in "xyz"])
        for pair in pairs:
            i, j = ("xyz".index(letter) for letter in pair)
            K[i, j] = K[i, i] * values[f"M_{pair}"]
        T = np.array([[values.get(f"T_{i}{j}", 1.0) * values[f"S_{i}"] for j in "xyz"] for i in "xyz"])
        return K @ K.T, T @ K.T, T @ T.T

    for one, two in zip(grams(result, ("yx", "zx", "zy")), grams(other, ("xy", "xz", "yz")), strict=True):
        np.testing.assert_allclose(one, two, atol=1e-12)


def test_units_of_the_record_only_rename_the_values(record, result, tmp_path):
    """Rates and forces in deg/s and g instead of increments."""
    columns, g = {}, parse_unit("g").factor
    for axis in "xyz":
        columns[f"gyro_{axis}"] = np.degrees(record[f"gyro_{axis}"].si())
        columns[f"acc_{axis}"] = record[f"acc_{axis}"].si() / g
    again = ic.calibrate(
        ic.record(columns, rate=100.0, units={"gyro": "deg/s", "acc": "g"}), FOLDER / "strapdown.toml"
    )
    assert again.estimate.result["unit"] == {"acc": "g", "gyro": "deg/s"}
    for name in result.names:
        factor = {"K0": 1.0 / g, "K1": 1.0 / g, "D_F": 180.0 / np.pi, "S": 180.0 / np.pi}.get(
            name.rpartition("_")[0], 1.0
        )
        assert again.estimate[name].value == pytest.approx(result.estimate[name].value * factor, rel=1e-7)
        assert again.estimate[name].u == pytest.approx(result.estimate[name].u * factor, rel=1e-4)
