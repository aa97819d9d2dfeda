"""A calibration in use: what it cannot do is said, and a missing value spoils no more than it must."""

from types import SimpleNamespace

import numpy as np
import pytest

from inercal.convert.correct import ImuModel, imu_model
from inercal.errors import InputError
from inercal.instruments.triad import TriadModel

TRIAD = TriadModel(np.array([2.0, 3.0, 4.0]), np.eye(3) + 0.01 * np.triu(np.ones((3, 3)), 1), np.ones(3))


def estimate(units=None, **values):
    """As much of an estimate as is looked at."""
    values = {f"{name}_{axis}": 1.0 for name in ("K1", "S") for axis in "xyz"} | values
    return SimpleNamespace(
        names=tuple(values),
        values=np.array(list(values.values())),
        parameters={name: SimpleNamespace(value=value) for name, value in values.items()},
        result={"unit": {} if units is None else units},
    )


@pytest.mark.parametrize(("g_sensitivity", "lost"), [(0.0, False), (1e-3, True)])
def test_a_missing_specific_force_spoils_the_rate_only_where_it_takes_part(g_sensitivity, lost):
    model = ImuModel(TRIAD, TRIAD, np.full((3, 3), g_sensitivity), {})
    f, omega = model.correct(np.array([[np.nan, 0.0, 1.0]]), np.array([[1.0, 2.0, 3.0]]))
    assert np.isnan(f).any()
    assert np.isnan(omega).all() == lost
    _, gyro = model.indicate(np.array([[np.nan, 0.0, 1.0]]), np.array([[1.0, 2.0, 3.0]]))
    assert np.isnan(gyro).all() == lost


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (estimate(K1_y=0.0), "accelerometers cannot be inverted"),
        (estimate(S_x=0.0, S_y=0.0, S_z=0.0), "gyro cannot be inverted"),
        (estimate(K1_x=1e-320, K1_y=1e-320, K1_z=1e-320), "accelerometers cannot be inverted"),
        (estimate(S_x=1e300, T_xy=1e300), "gyro cannot be inverted"),
        (estimate(K1_x=np.nan), "expected the coefficients of an IMU"),
        (estimate(units=["count"]), "expected the coefficients of an IMU"),
        (estimate(units={"acc": "bananas"}), "bananas"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_named(bad, words):
    with pytest.raises(InputError, match=rf"^cal\.json: .*{words}"):
        imu_model(bad, "cal.json")


def test_a_calibration_of_one_axis_is_none_of_an_imu():
    bad = estimate()
    del bad.parameters["K1_y"]
    with pytest.raises(InputError, match="expected the coefficients of an IMU"):
        imu_model(bad)
