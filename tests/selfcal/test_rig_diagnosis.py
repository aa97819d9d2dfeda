"""Errors of the rig that are no states are named, on records of a simulator that shares no code."""

import numpy as np
import pytest
from independent import selfcal as platform
from independent.selfcal import ARCSEC, DEG_H, PPM, THREE, UG, Drive, Faults, G

import inercal as ic
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.records.read import read
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.reading import recording_of

DRIVE = Drive(THREE, ramp=0.4)


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "study.toml"
    path.write_text(platform.study(more='[model]\nstates = "paper"\n'))
    return load_selfcal_study(path)


def recorded(settings, folder, faults, seed=3):
    platform.simulated(np.random.default_rng([20261123, seed]), DRIVE, faults=faults).write(
        folder / "record.csv"
    )
    return recording_of(read([folder / "record.csv"]), settings)


NAMED = {
    "gamma": (Faults(gamma=np.array([3.0, -3.0, 3.0]) * ARCSEC), "turned on the platform"),
    "non-orthogonality": (Faults(non_orthogonality=np.array([5.0, -5.0]) * ARCSEC), "not orthogonal"),
    "zero_y": (Faults(zero=np.array([0.0, 5.0, 0.0]) * ARCSEC), "does not read zero"),
    "base": (Faults(base=np.array([5.0, 0.0, 5.0]) * ARCSEC), "base or the zero"),
    "k2": (Faults(k2=np.array([5e-6, -5e-6, 5e-6]) / G), "second-order"),
    "levers": (
        Faults(levers=0.05 * np.array([[1, -1, 1], [1, 1, -1], [-1, 1, 1.0]])),
        "centre of the gimbals",
    ),
    "asymmetry": (
        Faults(asymmetry=np.array([20.0, -20.0, 20.0]) * PPM),
        "accelerometers is not the same both ways",
    ),
    "g-sensitivity": (
        Faults(g_sensitivity=0.05 * DEG_H),
        "check latitude and heading",
    ),
    "sag": (Faults(sag=2 * ARCSEC), "gravity turns"),
    "kg1": (Faults(gyro_scale=np.array([10.0, -10.0, 10.0]) * PPM), "scale errors"),
    "delay_encoder": (Faults(delay_encoder=1e-3), "encoders are 1 ms late"),
    "delay_accelerometer": (Faults(delay_accelerometer=5e-3), "accelerometers are 4.98 ms late"),
    "delay_gyro": (Faults(delay_gyro=1e-3), "later than its commands"),
    "warm": (Faults(warming=1.0, bias_by_k=np.array([10.0, -10.0, 10.0]) * UG), "temperature"),
    "flicker": (Faults(flicker=2 * UG), "wander"),
    "sway": (Faults(sway=2 * ARCSEC), "swing with 0.3 Hz, by some 2.2 arcsec: where the base sways"),
}


QUICK = ("gamma", "flicker", "sway")
"""Of the standard tests; all of them are a campaign."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault", [each if each in QUICK else pytest.param(each, marks=pytest.mark.campaign) for each in NAMED]
)
def test_each_is_named(fault, settings, tmp_path):
    faults, words = NAMED[fault]
    made, of = recorded(settings, tmp_path, faults), problem(settings)
    found = diagnose(made, of, estimate(made, of, history=False))
    assert [words in each.message for each in found] == [True], [each.message for each in found]


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_sway_that_is_stated_is_noise(size, tmp_path):
    """With 2 arcsec at 0.3 Hz beside the same of encoder noise the verdict is ok, and no value is beyond 4 u."""
    platform.simulated(np.random.default_rng([20261123, 5]), DRIVE, faults=Faults(sway=size * ARCSEC)).write(
        tmp_path / "record.csv"
    )
    study = platform.study().replace("[noise]", f'[noise]\nbase_sway = "{size} arcsec"')
    (tmp_path / "study.toml").write_text(study)
    found = ic.calibrate(read([tmp_path / "record.csv"]), tmp_path / "study.toml").estimate
    assert found.status.value == "ok"
    assert np.abs((found.values[:18] - platform.TRUTH) / found.u[:18]).max() < 4.0


def test_biases_that_wander_show_through_states_that_take_most_of_it(tmp_path):
    """1/f noise of 1 ug, K2 and levers among the states: of 50 such records the lags told 39 alone."""
    path = tmp_path / "study.toml"
    path.write_text(platform.study(more='[model]\nstates = ["rig", "k2", "levers"]\n'))
    of = load_selfcal_study(path)
    record = recorded(of, tmp_path, Faults(flicker=UG), 4)
    asked = problem(of)
    (finding,) = diagnose(record, asked, estimate(record, asked, history=False))
    assert finding.code in ("unmodelled", "by_order")
    assert finding.harm
    assert "bias_walk" in finding.message
