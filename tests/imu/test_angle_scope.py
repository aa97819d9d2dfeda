"""Errors of an encoder that come back at each commanded angle, in a calibration on a table with known angles."""

import numpy as np
import pytest

import inercal as ic
from inercal.examples import FOLDER

ARCSEC = np.pi / 648000.0
SIZE = 20.0 * ARCSEC


@pytest.mark.slow
def test_an_error_of_each_angle_lies_between_one_of_each_position_and_one_of_the_run():
    """The shipped table comes to some angles of its inner axis more than once: what is alike there averages out less.

    One and the same error in all positions turns the instrument about z: M_xy takes it whole.
    """
    record, variance = ic.read(FOLDER / "table.npz"), {}
    for scope in ("position", "angle", "run"):
        errors = {"dphi_z2": {"normal": "20 arcsec", "scope": scope}}
        study = ic.study(FOLDER / "table.toml", imu={"aided": {"rig": {"errors": errors}}})
        found = ic.calibrate(record, study).raise_for_status().estimate
        (item,) = [each for each in found.budget if each.source == "dphi_z2"]
        variance[scope] = item.share["M_xy"] * found["M_xy"].u ** 2
    assert 1.2 * variance["position"] < variance["angle"] < 0.8 * variance["run"]
    assert np.sqrt(variance["run"]) == pytest.approx(SIZE, rel=0.1)
