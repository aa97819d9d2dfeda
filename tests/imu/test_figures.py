"""The figures of an IMU calibration, for sound, weak and failed ones."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.io import loadmat

from inercal.faces.report.html import render
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.figures import page, pictures
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.task import calibrate

ALL = [
    "Directions",
    "Residuals of the sections",
    "Coefficients and their uncertainties",
    "Holds",
    "Correlation of the coefficients",
    "Where the uncertainty comes from",
]


@pytest.fixture(scope="module")
def xsens():
    columns = {}
    for sensor, name, array in (
        ("acc", "xsens_acc.mat", "IMU0x2Dalpha"),
        ("gyro", "xsens_gyro.mat", "IMU0x2Domega"),
    ):
        data = loadmat(str(files("inercal") / "examples" / name))[array]
        t = columns["acc_x"].t if columns else np.ascontiguousarray(data[:, 0])
        for i, axis in enumerate("xyz", 1):
            channel = f"{sensor}_{axis}"
            columns[channel] = Column(
                channel, parse_unit("count"), data[:, i].astype(float), t, Source(name, "")
            )
    return Record(columns)


SETTINGS = ImuSettings(Site(9.81744, (GravityInput("gravity", 2e-5, "m/s^2", 1.0),)), 50.0, time_base_u=2e-5)


@pytest.mark.slow
def test_a_sound_calibration(xsens):
    calibration = calibrate(xsens, SETTINGS)
    assert calibration.estimate.status is Status.OK
    drawn = pictures(calibration)
    assert [picture.title for picture in drawn] == ALL
    assert all(len(picture.svg) < 300_000 for picture in drawn)
    holds = next(picture for picture in drawn if picture.title == "Holds")
    assert "the 38 holds that are used, and in red the 2 that are not" in holds.caption
    assert len(render(calibration.estimate, drawn, "Xsens")) < 1_500_000


@pytest.mark.slow
def test_the_main_picture_comes_first_and_is_a_figure_too(xsens):
    calibration = calibrate(xsens, replace(SETTINGS, g_sensitivity=True))
    shown = pictures(calibration)[0]
    assert shown.figure.axes
    text = page(calibration)
    assert text.index("the estimate is sound") < text.index(shown.title) < text.index("<h2>Findings</h2>")


def test_accelerometers_alone(xsens):
    alone = Record({name: xsens[name] for name in ("acc_x", "acc_y", "acc_z")})
    calibration = calibrate(alone, SETTINGS)
    drawn = pictures(calibration)
    assert [picture.title for picture in drawn] == ALL
    page = render(calibration.estimate, drawn, "Accelerometers")
    assert page == render(calibration.estimate, pictures(calibration), "Accelerometers")


@pytest.mark.slow
def test_a_million_rows_stay_small():
    rng = np.random.default_rng(5)
    t = np.arange(1_000_000) / 1000.0
    count = parse_unit("count")
    record = Record(
        {
            name: Column(name, count, rng.normal(0.0, 10.0, len(t)) + offset, t, Source("long", ""))
            for name, offset in (("acc_x", 0.0), ("acc_y", 0.0), ("acc_z", 4000.0))
        }
    )
    calibration = calibrate(record, ImuSettings(Site(9.81)))
    drawn = pictures(calibration)
    assert all(len(picture.svg) < 300_000 for picture in drawn)
    assert len(render(calibration.estimate, drawn, "Long")) < 1_000_000
