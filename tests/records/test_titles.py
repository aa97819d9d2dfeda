"""A title says which channel a column is and in which unit, in the spellings that loggers use."""

from inercal.foundation.records.titles import canonical, fits, titled
from rows import for_each


@for_each(
    ("title", "channel", "unit"),
    [
        ("acc_x [m/s^2]", "acc_x", "m/s^2"),
        ("AccX(g)", "acc_x", "g"),
        ("imu.gyro.z", "gyro_z", None),
        ("gyro_x_mdps", "gyro_x", "mdps"),
        ("ax_g", "acc_x", "g"),
        ("wx rad/s", "gyro_x", "rad/s"),
        ("accel_x_m_s2", "acc_x", "m/s^2"),
        ("gyro_y_rad_s", "gyro_y", "rad/s"),
        ("xgyro", "gyro_x", None),
        ("t_ms", "t", "ms"),
        ("temp_C", "temperature", "C"),
        ("Temperatur [°C]", "temperature", "°C"),
        ("thx", "th_x", None),
        ("GimbalY (deg)", "th_y", "deg"),
        ("encoder_z [arcsec]", "th_z", "arcsec"),
        ("wcx", "wc_x", None),
        ("cmd_rate_y [deg/h]", "wc_y", "deg/h"),
        # where the name means another quantity, or none, the unit decides
        ("gX [mg]", "acc_x", "mg"),
        ("AsX(°/s)", "gyro_x", "°/s"),
        ("Drehrate x-Achse [°/s]", "gyro_x", "°/s"),
        ("Kanal 2 [m/s²]", "acc_y", "m/s²"),
        ("temps (ms)", "t", "ms"),
        # what is none of ours
        ("mag_x_uT", None, None),
        ("mag_x [uT]", None, "uT"),
        ("alpha_x [rad/s^2]", None, "rad/s^2"),
        ("speed [m/s]", None, "m/s"),
        ("total [m/s^2]", None, "m/s^2"),
        ("", None, None),
        # a unit nobody knows leaves the name
        ("ax [foo]", "acc_x", "foo"),
    ],
)
def test_names_and_units_of_many_loggers(title, channel, unit):
    assert titled(title) == (channel, unit)


def test_a_unit_beside_the_title_is_as_good():
    assert titled("Kanal 2", "mdps") == ("gyro_y", "mdps")
    assert fits("gyro_y", "mdps")
    assert not fits("gyro_y", "mg")
    assert not fits("gyro_y", "")


def test_times_in_other_words_stand_beside_canonical_names():
    """`time [s]` beside `gyro_z [deg/s]` is t; a column of t itself, or a time without a unit, is not overruled."""
    known = canonical([(0, "time [s]", None), (1, "gyro_z [deg/s]", None)], "log.csv")
    assert {channel.name: (channel.origin, channel.unit.symbol) for channel in known} == {
        "gyro_z": (1, "deg/s"),
        "t": (0, "s"),
    }
    both = canonical([(0, "Timestamp [us]", None), (1, "t [s]", None), (2, "acc_x [m/s^2]", None)], "log.csv")
    assert next(channel.origin for channel in both if channel.name == "t") == 1
    assert [
        channel.name for channel in canonical([(0, "time", None), (1, "acc_x [m/s^2]", None)], "log.csv")
    ] == ["acc_x"]
