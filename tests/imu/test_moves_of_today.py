"""Moves beside the turns of `multiposition`, on the recording that ships, with the same holds."""

from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest
from scipy.io import loadmat

from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.multiposition.calibration import calibrate_multiposition
from inercal.systems.imu.sections.carried import Move
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.with_moves import calibrate_with_moves
from inercal.systems.imu.settings import ImuSettings

SETTINGS = ImuSettings(
    Site(9.81744, (GravityInput("gravity", 2e-5, "m/s^2", 1.0),)), 50.0, g_sensitivity=True, time_base_u=2e-5
)


def xsens():
    """The recording in counts."""
    columns, t = {}, None
    for sensor, name, array in (
        ("acc", "xsens_acc.mat", "IMU0x2Dalpha"),
        ("gyro", "xsens_gyro.mat", "IMU0x2Domega"),
    ):
        data = loadmat(str(files("inercal") / "examples" / name))[array]
        t = np.ascontiguousarray(data[:, 0]) if t is None else t
        for i, axis in enumerate("xyz", 1):
            channel = f"{sensor}_{axis}"
            columns[channel] = Column(
                channel, parse_unit("count"), data[:, i].astype(float), t, Source(name, "")
            )
    return Record(columns)


@pytest.fixture(scope="module")
def both():
    """The calibration of today, and that from its holds and the moves between them."""
    today = calibrate_multiposition(xsens(), SETTINGS)
    holds, acc, gyro = today.poses.dwells, today.recording.accelerometer, today.recording.gyro
    sections = [
        Section("rest", acc=hold.of(acc.values).mean(axis=0), gyro=hold.of(gyro.values).mean(axis=0),
                duration=float(acc.t[hold.stop - 1] - acc.t[hold.start]))
        for hold in holds
    ]  # fmt: skip
    spans = [slice(a.stop - 1, b.start + 1) for a, b in pairwise(holds)]
    moves = [Move(k, k + 1, acc.t[span], gyro.values[span], acc.values[span]) for k, span in enumerate(spans)]
    priors = Priors(SETTINGS.site, acc_scale=None, gyro_scale=None, clock_u=2e-5)
    return today.estimate, calibrate_with_moves(sections, moves, priors)


@pytest.mark.slow
def test_the_gyro_is_that_of_today(both):
    """S and T within 0.4 u, G and D_F too, and u within 15 %."""
    today, found = both
    assert found.calibration.converged
    assert not found.left_out
    assert not found.spoiled
    for name, value, u in zip(today.names, today.values, np.sqrt(np.diag(today.covariance)), strict=True):
        if name.rpartition("_")[0] in ("S", "T", "G", "D_F"):
            x, own, _ = found.calibration.value(name)
            assert abs(x - value) < 0.4 * u, name
            assert 0.85 < own / u < 1.15, name


@pytest.mark.slow
def test_the_accelerometers_are_those_of_their_rests(both):
    """Moves neither shift them by more than the square root of what they tell, three times, nor raise their u."""
    _, found = both
    for name in found.alone.names:
        value, u, _ = found.alone.value(name)
        x, own, _ = found.calibration.value(name)
        assert own < 1.05 * u, name
        assert abs(x - value) < 3 * np.sqrt(abs(u**2 - own**2)) + 0.3 * u, name
