"""Channels of a model in a wind tunnel: headers, guessed maps, and what is looked at in them."""

import numpy as np
from nptdms import ChannelObject, TdmsWriter

from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map
from inercal.foundation.records.titles import numbered, titled
from rows import for_each

RNG = np.random.default_rng(5)
T = np.arange(400) / 1000.0
THETA = 10.0 + 5.0 * np.sin(2.0 * np.pi * T)
A = np.column_stack([-np.cos(np.radians(THETA)), np.sin(np.radians(THETA)), np.cos(np.radians(THETA))])
A += 1e-4 * RNG.standard_normal(A.shape)
RATE = 10.0 * np.pi * np.cos(2.0 * np.pi * T) + 0.2 * RNG.standard_normal(len(T))


@for_each(
    ("title", "channel", "unit"),
    [
        ("A1 [g]", "a1", "g"),
        ("cDAQ1/A2", "a2", None),
        ("Pitch rate [deg/s]", "gyro", "deg/s"),
        ("roll_rate", "gyro_roll", None),
        ("YawRate [rad/s]", "gyro_yaw", "rad/s"),
        ("AoA_ref [deg]", "theta_ref", "deg"),
        ("Point No", "point", None),
        ("Trigger", "trigger", None),
        ("acc_x [g]", "acc_x", "g"),
        ("gyro_x [deg/s]", "gyro_x", "deg/s"),
    ],
)
def test_titles(title, channel, unit):
    assert titled(title) == (channel, unit)


def test_numbers_of_accelerometers_are_asked_for():
    assert numbered("Accel 2 [g]") == "a2"
    assert numbered("acc_3") == "a3"
    assert numbered("acc_x") is None
    assert titled("acc1 [m/s^2]")[0] == "acc_x"


def test_a_guessed_map_reads_the_file(tmp_path):
    path = tmp_path / "run.csv"
    header = "Time [s];Accel 1;Accel 2;Accel 3;Pitch rate [deg/s];AoA_ref [deg];Point No;Lift"
    table = np.column_stack([T, A, RATE, THETA, np.ones(400), RNG.standard_normal(400)])
    np.savetxt(path, table, fmt="%.9g", delimiter=";", header=header, comments="")
    text = guess_map(path, of_model=True)
    assert 'not used: "Lift"' in text
    (tmp_path / "map.toml").write_text(text)
    record = read(path, tmp_path / "map.toml")
    assert list(record.columns) == ["a1", "a2", "a3", "gyro", "theta_ref", "point"]
    assert {record[name].unit.symbol for name in ("a1", "a2", "a3")} == {"g"}
    np.testing.assert_allclose(record["a2"].values, A[:, 1], rtol=1e-8)
    np.testing.assert_allclose(record["theta_ref"].si(), np.radians(THETA), rtol=1e-8)
    assert record.findings == ()


def test_numbers_of_points_may_be_empty(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t [s],a1 [g],point [1],trigger [1]\n0.0,1.0,,\n0.1,0.9,4,17\n0.2,,5,\n")
    assert [(f.code, f.message) for f in read(path).findings] == [("nan", "a1: 1 missing value")]
    column = {"t [s]": [0.0, 0.1, 0.2], "a1 [g]": [1.0, 0.9, np.nan], "point [1]": [np.nan, 4.0, 5.0]}
    np.savez(tmp_path / "run.npz", **column)
    assert [(f.code, f.message) for f in read(tmp_path / "run.npz").findings] == [
        ("nan", "a1: 1 missing value")
    ]


def test_units_by_gravity(tmp_path):
    path = tmp_path / "run.csv"
    for factor, unit in ((9.80665, "m/s^2"), (1e3, "mg"), (12345.0, "count")):
        np.savetxt(
            path,
            np.column_stack([T, factor * A]),
            fmt="%.9g",
            delimiter=",",
            header="t,a1,a2,a3",
            comments="",
        )
        assert guess_map(path, of_model=True).count(f'unit = "{unit}"') == 3


def test_a_guess_of_a_tdms_file(tmp_path):
    path = tmp_path / "run.tdms"
    about = {"wf_increment": 1e-3, "wf_start_offset": 0.0}
    with TdmsWriter(path) as file:
        channels = [
            ChannelObject("Model", f"A{k + 1}", A[:, k], {"unit_string": "g", **about}) for k in range(3)
        ]
        rate = ChannelObject("Model", "PitchRate", RATE, {"unit_string": "deg/s", **about})
        file.write_segment([*channels, rate])
    (tmp_path / "map.toml").write_text(guess_map(path, of_model=True))
    record = read(path, tmp_path / "map.toml")
    assert list(record.columns) == ["a1", "a2", "a3", "gyro"]
    np.testing.assert_array_equal(record["a3"].values, A[:, 2])
    np.testing.assert_allclose(record["gyro"].t, T, atol=1e-12)
