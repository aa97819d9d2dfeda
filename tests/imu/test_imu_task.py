"""The way to a method: whichever the settings ask for, and what all share."""

from dataclasses import replace

from recordings import shipped

from inercal.geometry.site import Site
from inercal.imu.aided.calibration import AidedCalibration
from inercal.imu.ferraris.calibration import FerrarisCalibration
from inercal.imu.multiposition.calibration import MultipositionCalibration
from inercal.imu.task import calibrate


def test_the_settings_choose_the_method():
    for name, kind in (
        ("mpu6050", MultipositionCalibration),
        ("ferraris", FerrarisCalibration),
        ("table", AidedCalibration),
    ):
        assert isinstance(calibrate(*shipped(name)), kind)


def test_gravity_without_an_uncertainty_is_said_to_be_taken_as_exact():
    record, settings = shipped("ferraris")
    sure = replace(settings, site=Site(9.81, (), settings.site.latitude))
    codes = [finding.code for finding in calibrate(record, sure).estimate.findings]
    assert codes.count("stated_exact") == 1
    assert "stated_exact" not in {finding.code for finding in calibrate(record, settings).estimate.findings}
