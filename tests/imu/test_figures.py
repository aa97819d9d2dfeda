"""The figures of an IMU calibration, for sound, weak and failed ones."""

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
from scipy.io import loadmat

from inercal.faces.report.html import render
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.geometry.rotations import conjugate, exp
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.figures import page, pictures
from inercal.systems.imu.multiposition.calibration import calibrate_multiposition as calibrate
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_truth, simulate

ALL = [
    "Poses",
    "Coefficients and their uncertainties",
    "Static intervals",
    "Residual of each pose",
    "Miss of each turn",
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
@pytest.mark.parametrize("g_sensitivity", [False, True])
def test_a_sound_calibration(xsens, g_sensitivity):
    """The gyro's output changes with the pose: without its g-sensitivity its values are suspect. The main picture comes
    first, below the verdict, and is a figure too."""
    calibration = calibrate(xsens, replace(SETTINGS, g_sensitivity=g_sensitivity))
    assert calibration.estimate.status is (Status.OK if g_sensitivity else Status.SUSPECT)
    drawn = pictures(calibration)
    assert [picture.title for picture in drawn] == ALL
    assert all(len(picture.svg) < 300_000 for picture in drawn)
    assert "Stars" not in drawn[1].caption
    assert drawn[0].figure.axes
    text = page(calibration) if g_sensitivity else render(calibration.estimate, drawn, "Xsens")
    assert len(text) < 1_500_000
    said = "the estimate is sound" if g_sensitivity else "suspect"
    assert text.index(said) < text.index(ALL[0]) < text.index("<h2>Findings</h2>")


def test_accelerometers_alone(xsens):
    alone = Record({name: xsens[name] for name in ("acc_x", "acc_y", "acc_z")})
    calibration = calibrate(alone, SETTINGS)
    drawn = pictures(calibration)
    assert [picture.title for picture in drawn] == [title for title in ALL if "turn" not in title]
    page = render(calibration.estimate, drawn, "Accelerometers")
    assert page == render(calibration.estimate, pictures(calibration), "Accelerometers")


def test_too_few_poses_show_the_intervals_there_are(xsens):
    calibration = calibrate(cut(xsens, 9000), SETTINGS)
    assert calibration.estimate.status is Status.TOO_FEW_INTERVALS
    (drawn,) = pictures(calibration)
    found = calibration.estimate.statistics["intervals"]
    assert f"the {found:.0f} static intervals found below the threshold of" in drawn.caption
    render(calibration.estimate, [drawn], "Too few")


def cut(record, rows):
    t = record["acc_x"].t[:rows]
    return Record({name: replace(c, values=c.values[:rows], t=t) for name, c in record.columns.items()})


def attitudes(up):
    """Attitudes q_nb in which those body directions are vertical."""
    across = np.cross([0.0, 0.0, 1.0], up)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return conjugate(exp(across * np.arccos(up[:, 2:])))


def test_the_pose_that_would_cure_an_ill_conditioned_fit_is_marked():
    rng = np.random.default_rng(2)
    up = np.array(
        [(0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0),
         (1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1)], dtype=float,
    )  # fmt: skip
    up += rng.normal(0.0, 1e-4, up.shape)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    record, _ = simulate(draw_truth(rng), attitudes(up), 9.81, 0.7, rng)
    calibration = calibrate(record, ImuSettings(Site(9.81)))
    assert calibration.estimate.status in (Status.ILL_CONDITIONED, Status.UNOBSERVABLE)
    caption = next(picture.caption for picture in pictures(calibration) if picture.title == "Poses")
    words = calibration.estimate.message.partition("force along ")[2].partition(" and its opposite")[0]
    assert f"Stars: the pose {words} and its opposite" in caption


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
