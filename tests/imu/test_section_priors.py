"""Priors that a study states of sections: what the data do not tell keeps them, and what they tell does not."""

import numpy as np
import pytest
from turned_units import SIDES, Bench, Unit

from inercal.cli import run
from inercal.faces.python.verbs import calibrate
from inercal.faces.studies.load import load_study
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import record_of
from inercal.foundation.units import parse_unit
from inercal.systems.listed import SYSTEMS

HEAD = (
    '[site]\nlatitude = "48 deg"\ngravity = "9.81 m/s^2"\n[imu]\nmethod = "sections"\nplacing = "0.3 deg"\n'
)
ROWS = "".join(f'[[imu.section]]\nsection = "{side}"\nup = "{side}"\n' for side in SIDES)


def of(path, keys=""):
    path.write_text(HEAD + keys + ROWS)
    return load_study(SYSTEMS["imu"], path, ())


@pytest.fixture(scope="module")
def means():
    """Rows of means of six sides, both sensors, in physical units."""
    unit = Unit(np.random.default_rng(7), g_sensitivity=0.0)
    rests = [Bench(unit).rest(up) for up in SIDES.values()]
    columns = [
        (f"{sensor}_{axis}", parse_unit(symbol), np.array([getattr(rest, sensor)[i] for rest in rests]))
        for sensor, symbol in (("acc", "m/s^2"), ("gyro", "rad/s"))
        for i, axis in enumerate("xyz")
    ]
    return record_of(columns, np.arange(len(rests), dtype=float))


def u_of(means, path, keys, name):
    path.write_text(HEAD + keys + ROWS)
    found = calibrate(means, path)
    return found[name].u if name in found.estimate.names else 0.0


@pytest.mark.parametrize(
    ("key", "name", "tight", "wide"),
    [
        ("g_sensitivity", "G_xx", '"0(0.0001) deg/s/g"', '"0(0.2) deg/s/g"'),
        ("k2", "K2_x", '"0(10) ug/g^2"', '"0(300) ug/g^2"'),
        ("misalignment", "M_xy", '"0(0.1) mrad"', '"0(50) mrad"'),
        ("mounting", "M_xy", '"0(0.01) deg"', '"0(1) deg"'),
    ],
)
def test_a_tighter_prior_makes_a_term_surer_that_rests_on_it(means, tmp_path, key, name, tight, wide):
    path = tmp_path / "imu.toml"
    assert u_of(means, path, f"{key} = {tight}\n", name) < 0.7 * u_of(means, path, f"{key} = {wide}\n", name)


def test_true_is_the_usual_prior_and_false_takes_a_term_out(means, tmp_path):
    path = tmp_path / "imu.toml"
    for key, name, usual in (("g_sensitivity", "G_xx", "0(0.1) deg/s/g"), ("k2", "K2_x", "0(150) ug/g^2")):
        asked = u_of(means, path, f"{key} = true\n", name)
        assert asked == u_of(means, path, "", name)
        assert asked == pytest.approx(u_of(means, path, f'{key} = "{usual}"\n', name), rel=1e-9)
        assert u_of(means, path, f"{key} = false\n", name) == 0.0


def test_a_clock_is_that_of_time_base(tmp_path):
    path = tmp_path / "imu.toml"
    assert of(path, 'clock = "0(20) ppm"\n').time_base_u == of(path, 'time_base = "20 ppm"\n').time_base_u
    with pytest.raises(StudyError, match="clock: found beside time_base"):
        of(path, 'clock = "0(20) ppm"\ntime_base = "20 ppm"\n')


@pytest.mark.parametrize(
    ("key", "words"),
    [
        (
            'g_sensitivity = "0.1 deg/s/g"',
            "imu.g_sensitivity: found '0.1 deg/s/g', expected true, false or 0",
        ),
        (
            'misalignment = "5 mrad"',
            "imu.misalignment: found '5 mrad', that is 0.005 rad, expected 0 with its standard uncertainty",
        ),
        ('mounting = "1(1) deg"', "imu.mounting: found"),
    ],
)
def test_a_prior_about_another_value_is_refused(tmp_path, monkeypatch, capsys, key, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "imu.toml").write_text(HEAD + key + "\n" + ROWS)
    (tmp_path / "means.csv").write_text("acc_x [g],acc_y [g],acc_z [g]\n" + "0,0,1\n" * 6)
    assert run(["calibrate", "imu", "means.csv", "--study", "imu.toml"]) == 2
    assert words in capsys.readouterr().err
