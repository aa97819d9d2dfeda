"""A MEMS unit between -18 and 74 degC, against the cubic that the recording's publishers fit.

Source: the thermal calibration template of TofuPilot's examples (commit fc190f7), recording and method
(numpy.polyfit of third degree over all samples, axis by axis). The literals were computed by that method.
"""

import numpy as np
import pytest

from inercal.examples import FOLDER
from inercal.faces.validate.imu import SWEEP
from inercal.foundation.records.read import read
from inercal.systems.imu.temperature.sweep import fit_recording

#: channel -> standard deviation of the residuals, R^2
PEER = {
    "gyro_x": (0.004148337554960225, 0.5701713213870008),
    "gyro_y": (0.000951595831901328, 0.9971195148102869),
    "gyro_z": (0.0013982237120201079, 0.534950185894633),
    "acc_x": (0.006404234852316937, 0.9817011175478377),
    "acc_y": (0.017311660923113995, 0.8805987809016136),
    "acc_z": (0.04429787180458893, 0.945154831783477),
}


@pytest.fixture(scope="module")
def found():
    return fit_recording(read(FOLDER / "thermal.csv.gz", FOLDER / "thermal-map.toml"), 0.0, 3)


@pytest.mark.parametrize("channel", PEER)
def test_coefficients_scatter_and_explained_variance_are_the_publishers(found, channel):
    coefficients, (scatter, explained) = SWEEP[channel], PEER[channel]
    curve = next(curve for curve in found.curves if curve.name == channel)
    span = 74.0 ** np.arange(4)  # what a coefficient does over the range
    np.testing.assert_allclose(
        curve.polynomial.coefficients * span, np.array(coefficients[::-1]) * span, rtol=0, atol=1e-9
    )
    assert curve.scatter == pytest.approx(scatter, rel=1e-9)
    assert curve.explained == pytest.approx(explained, rel=1e-9)


def test_one_cubic_cannot_follow_both_branches(found):
    """As the recording's publishers note: cooling and heating differ. Least squares that took the 8400 samples for
    independent would claim the constant of acc_z to 0.9 mm/s^2, a fiftieth of what one pass differs from the next."""
    said = {f.message.split()[0] for f in found.estimate.findings if f.code == "hysteresis"}
    assert said == {"gyro_x", "gyro_z", "acc_y", "acc_z"}
    assert found.estimate["acc_z"].u > 10 * 0.0443 / np.sqrt(8400)
