"""The way to a method: whichever the settings ask for, and what all share."""

from dataclasses import replace

from recordings import shipped

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.aided.calibration import AidedCalibration
from inercal.systems.imu.sections.outcome import CalibrationFromSections
from inercal.systems.imu.task import calibrate


def test_the_settings_choose_the_method():
    for name, kind in (
        ("mpu6050", CalibrationFromSections),
        ("ferraris", CalibrationFromSections),
        ("table", AidedCalibration),
    ):
        assert isinstance(calibrate(*shipped(name)), kind)


def test_gravity_without_an_uncertainty_is_said_to_be_taken_as_exact():
    record, settings = shipped("ferraris")
    sure = replace(settings, site=Site(9.81, (), settings.site.latitude))
    codes = [finding.code for finding in calibrate(record, sure).estimate.findings]
    assert codes.count("stated_exact") == 1
    assert "stated_exact" not in {finding.code for finding in calibrate(record, settings).estimate.findings}


def with_clock(record, rate_u):
    return replace(record, rate_u=rate_u)


def test_the_uncertainty_of_a_typed_rate_is_that_of_the_clock():
    """0.3 Hz of 100 Hz is 0.3 % of the scale factors, as by imu.time_base; that of a study stands first."""
    record, settings = shipped("xsens")
    typed = calibrate(with_clock(record, 3e-3), settings).estimate
    stated = calibrate(record, replace(settings, time_base_u=3e-3)).estimate
    assert typed["S_x"].u == stated["S_x"].u > 2.9e-3 * typed["S_x"].value
    both = calibrate(with_clock(record, 3e-3), replace(settings, time_base_u=1e-6)).estimate
    assert both["S_x"].u < 0.3 * typed["S_x"].u


def test_a_rate_typed_without_an_uncertainty_says_what_an_ordinary_clock_does():
    record, settings = shipped("table")
    (finding,) = (
        f
        for f in calibrate(with_clock(record, 0.0), settings).estimate.findings
        if f.code == "rate_without_u"
    )
    assert "50 ppm" in finding.message
    estimate = calibrate(record, settings).estimate
    harmed = {f"S_{i}" for i in "xyz" if estimate[f"S_{i}"].u < 50e-6 * estimate[f"S_{i}"].value}
    assert set(finding.harm) == harmed
    assert "rate_without_u" not in {f.code for f in estimate.findings}


def test_increments_are_rates_half_a_sample_earlier():
    """What was gained since the row before, said to be increments: the delay found is half a sample smaller."""
    record, settings = shipped("table")
    plain = calibrate(record, settings).estimate.result["time_shift_s"]
    columns = {
        name: replace(column, increment=name.startswith(("acc", "gyro")))
        for name, column in record.columns.items()
    }
    gained = calibrate(replace(record, columns=columns), settings).estimate.result["time_shift_s"]
    for sensor in ("acc", "gyro"):
        step = gained[sensor]["value"][0] - plain[sensor]["value"][0]
        assert abs(abs(step) - 0.005) < 3.0 * plain[sensor]["u"][0] + 1e-4
