"""The ring-laser IMU of PSINS, 30.8 minutes at rest: Earth rate and gravity as its published sums give them.

PSINS (Yan Gongmin, BSD 2-clause), data/lasergyro.imu, 184718 rows of increments at 100 Hz: the mean of each
column, times 0.1 arcsec or 125 ug s, over 10 ms. The g of PSINS is that of the equator, 9.780327 m/s^2, as
the head of the file says; the unit g of a map is 9.80665 m/s^2, so that the scale is stated in m/s.
"""

from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from inercal.foundation.records.read import read

EXAMPLES = Path(str(files("inercal"))) / "examples"
GYRO_DEG_H = (-12.27146244545836, 0.43769421496551497, 8.356900789311554)
GYRO_NORM_DEG_H = 14.853220444688255
ACC = (-0.06121705423029233, 0.1584515374158888, 9.794010578560876)
ACC_NORM = 9.795483532240787


def test_means_and_norms():
    record = read(EXAMPLES / "lasergyro.txt.gz", EXAMPLES / "lasergyro-map.toml")
    gyro, acc = (record.triad(sensor).values for sensor in ("gyro", "acc"))
    assert len(gyro) == 184718
    deg_h = np.degrees(gyro.mean(axis=0)) * 3600
    assert deg_h == pytest.approx(GYRO_DEG_H, rel=1e-9)
    assert np.linalg.norm(deg_h) == pytest.approx(GYRO_NORM_DEG_H, rel=1e-9)
    assert acc.mean(axis=0) == pytest.approx(ACC, rel=1e-9)
    assert np.linalg.norm(acc.mean(axis=0)) == pytest.approx(ACC_NORM, rel=1e-9)
