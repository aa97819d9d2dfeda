"""What a study of a strapdown unit may hold, and the sentence for what it may not."""

import tomllib

import numpy as np
import pytest
from new_studies import filled, load_turntable_study

from inercal.faces.studies.load import load_imu_study, load_strapdown_study
from inercal.faces.studies.strapdown import strapdown_study
from inercal.foundation.errors import StudyError
from inercal.systems.strapdown.settings import ESTIMABLE
from rows import for_each

LEAST = """
[site]
latitude = "34 deg"
[strapdown]
[noise]
angle_random_walk = "0.05 deg/sqrt(h)"
velocity_random_walk = "50 ug/sqrt(Hz)"
"""


def read(text):
    return strapdown_study(tomllib.loads(text), "unit.toml")


def test_the_least_study_and_its_defaults():
    settings = read(LEAST)
    assert settings.noise.angle_random_walk == pytest.approx(np.radians(0.05) / 60.0)
    assert settings.noise.velocity_random_walk == pytest.approx(50e-6 * 9.80665)
    assert settings.noise.estimate == ESTIMABLE
    assert settings.rests.velocity == pytest.approx(1e-4)
    assert (settings.frame, settings.terms) == ("upper", ("k2", "size", "delay"))
    assert settings.rests.attitude is None
    assert settings.start.heading is None
    assert settings.plan is None


def test_every_key_arrives_in_si():
    settings = read(
        LEAST
        + """
gyro_walk = "3.6 deg/h/sqrt(s)"
[rests]
attitude = "36 arcsec"
list = [["0 s", "10 s"], ["12 s", "20 s"]]
[start]
heading = "30(5) deg"
[prior]
size = "5 cm"
g_sensitivity = "9 deg/h/g"
[plan]
turns = [["-y", "90 deg"], ["z", "-180 deg"]]
[truth]
r_xy = "3 mm"
tau_a = "2 ms"
K2_z = "10 ug/g^2"
S_asym_x = "20 ppm"
G_xy = "0.1 deg/h/g"
D_F_y = "1 deg/h"
"""
    )
    assert settings.noise.gyro_walk == pytest.approx(np.radians(1e-3))
    assert "gyro_walk" not in settings.noise.estimate
    assert settings.rests.attitude == pytest.approx(np.radians(0.01))
    assert settings.rests.list == ((0.0, 10.0), (12.0, 20.0))
    assert settings.start.angle == pytest.approx(np.radians(30.0))
    assert settings.start.u == pytest.approx(np.radians(5.0))
    assert settings.plan.turns == ((1, pytest.approx(-np.pi / 2)), (2, pytest.approx(-np.pi)))
    assert settings.truth == pytest.approx(
        {
            "r_xy": 3e-3, "tau_a": 2e-3, "K2_z": 10e-6 / 9.80665, "S_asym_x": 20e-6,
            "G_xy": np.radians(0.1) / 3600.0 / 9.80665, "D_F_y": np.radians(1.0) / 3600.0,
        }
    )  # fmt: skip
    deviations = settings.deviations()
    assert deviations[27] == pytest.approx(0.05)
    assert deviations[40] == pytest.approx(np.radians(9.0) / 3600.0 / 9.80665)


@for_each(
    ("more", "words"),
    [
        ('[rests]\nvelocity = "0 mm/s"', "rests.velocity: found '0 mm/s'"),
        ('[rests]\nvelocity = "1 mm"', "rests.velocity: found '1 mm'"),
        ('[rests]\nattitude = "on"', "rests.attitude"),
        (
            '[rests]\nlist = [["5 s", "3 s"]]',
            "found a rest from 5 s to 3 s, expected its end after its begin",
        ),
        ('[rests]\nnode = "1 ms"', "a time from 0.1 s to 100 s"),
        ('[start]\nheading = "north"', "start.heading"),
        ('[prior]\nscale = "-5 ppm"', "a standard deviation above zero"),
        ('[prior]\nsizes = "5 cm"', "prior.sizes: unknown key, did you mean size?"),
        ("[plan]\nturns = []", "plan.turns"),
        ('[plan]\nturns = [["w", "90 deg"]]', 'expected a turn such as ["y", "90 deg"]'),
        ('[plan]\nturns = [["y", "0 deg"]]', "an angle within 360 deg, not 0"),
        (
            '[plan]\nturns = [["y", "90 deg"]]\nsample_rate = "0.1 Hz"',
            "plan: found 8.9 samples, expected 100 to",
        ),
        ('[truth]\nr_zx = "1 cm"', "truth.r_zx: unknown term"),
        ('[truth]\nr_xx = "1 kg"', "truth.r_xx: found '1 kg', expected a quantity such as \"2 cm\""),
        ('[truth]\ntau_a = "1 m"', 'expected a quantity such as "1 ms"'),
        ('[truth]\nM_yx = "1 deg"', "truth.M_yx: unknown term"),
    ],
)
def test_what_is_wrong_is_one_sentence(more, words):
    with pytest.raises(StudyError) as error:
        read(LEAST + more)
    assert words in str(error.value)
    assert str(error.value).startswith("unit.toml")
    assert "\n" not in str(error.value)


@for_each(
    ("old", "new", "words"),
    [
        ("[strapdown]", '[strapdown]\nframe = "left"', "strapdown.frame"),
        ("[strapdown]", '[strapdown]\nterms = ["k3"]', "strapdown.terms"),
        ('latitude = "34 deg"', 'gravity = "9.8 m/s^2"', "site.latitude"),
        ('angle_random_walk = "0.05 deg/sqrt(h)"', "", "noise.angle_random_walk"),
        ("0.05 deg/sqrt(h)", "0.05 deg/h", "noise.angle_random_walk"),
    ],
)
def test_what_must_be_there_is_said(old, new, words):
    with pytest.raises(StudyError) as error:
        read(LEAST.replace(old, new))
    assert words in str(error.value)


def test_studies_of_other_kinds_are_told_apart(tmp_path):
    path = tmp_path / "unit.toml"
    path.write_text(LEAST)
    assert load_strapdown_study(path).frame == "upper"
    for load in (load_imu_study, load_turntable_study):
        with pytest.raises(StudyError, match="found a study for `inercal calibrate strapdown`"):
            load(path)
    path.write_text(filled("imu"))
    with pytest.raises(StudyError, match="found a study for `inercal calibrate imu`"):
        load_strapdown_study(path)
    path.write_text(filled("selfcal"))
    with pytest.raises(StudyError, match="expected one of a strapdown unit"):
        load_strapdown_study(path)
    path.write_text(LEAST + "[imu]\n")
    with pytest.raises(StudyError, match=r"found the tables \[imu\] and \[strapdown\]"):
        load_strapdown_study(path)
