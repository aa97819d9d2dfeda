"""A platform in a vehicle, by a simulator that shares no code: what vibrates is noise, and stated as such."""

import numpy as np
import pytest
from independent.selfcal import ARCSEC, NOMINAL, PPM, PRIOR, THREE, UG, Drive, Faults, study
from independent.selfcal_driven import Place, driven
from scipy.stats import chi2

import inercal as ic
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import EXTENDED, to_linear
from inercal.systems.selfcal.reading import recording_of

IN_A_VEHICLE = Place(vibration=1000 * UG)
STATED = 'vibration = "1000 ug"\nencoder'


def record(rng, folder, truth, faults, drive=Drive(THREE), place=IN_A_VEHICLE):  # noqa: B008  (frozen)
    file = folder / "record.csv"
    driven(rng, drive, truth, NOMINAL, faults, place).write(file, ("temperature",))
    return ic.read(file)


def nees(folder, text, runs, seed, **of_record):
    """Sum of NEES of 21 coefficients over some draws of coefficients and rig."""
    path = folder / "s.toml"
    path.write_text(text)
    settings, rng, total = ic.study(path).settings, np.random.default_rng(seed), 0.0
    of = problem(settings)
    for _ in range(runs):
        truth = PRIOR * rng.standard_normal(18)
        faults = Faults(
            base=60 * ARCSEC * rng.standard_normal(3), gyro_scale=100 * PPM * rng.standard_normal(3),
            gamma=20 * ARCSEC * rng.standard_normal(3), non_orthogonality=20 * ARCSEC * rng.standard_normal(2),
        )  # fmt: skip
        made = record(rng, folder, truth, faults, **of_record)
        found = estimate(recording_of(made, settings), of, history=False)
        true = to_linear(np.concatenate([truth, faults.gyro_scale, faults.base]))
        error = (found.coefficients[:24] - true)[:21]
        assert of.names[:24] == EXTENDED
        total += error @ np.linalg.solve(found.covariance[:21, :21], error)
    return total


def test_uncertainties_hold_in_a_vehicle(tmp_path):
    """NEES of the coefficients over 8 draws, within limits that 1 in 10000 leaves."""
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 8 * 21)
    assert low < nees(tmp_path, study().replace("encoder", STATED), 8, 20261127) < high


def test_uncertainties_hold_on_a_base_that_sways(tmp_path):
    """The same of 20 short runs with 2 arcsec of sway, which the gyros measure and encoders read otherwise."""
    stated = study().replace("encoder", 'base_sway = "2 arcsec"\nencoder')
    drive, place = Drive(THREE, rate=np.radians(4.0)), Place(sway=2 * ARCSEC)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 20 * 21)
    assert low < nees(tmp_path, stated, 20, 20261124, drive=drive, place=place) < high


@pytest.fixture
def shaken(tmp_path):
    """A record in a vehicle."""
    rng = np.random.default_rng(20261128)
    return record(rng, tmp_path, 0.3 * PRIOR * rng.standard_normal(18), Faults())


def test_vibration_that_is_stated_is_sound(shaken, tmp_path):
    """Sines of 20 frequencies are no white noise, which is no contradiction where vibration is stated."""
    path = tmp_path / "s.toml"
    path.write_text(study().replace("encoder", STATED))
    assert ic.calibrate(shaken, path).estimate.status.value == "ok"


@pytest.mark.campaign
def test_vibration_that_nobody_states_is_a_contradiction(shaken, tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(study())
    assert ic.calibrate(shaken, path).estimate.status.value == "inconsistent"


def test_simulated_vibration_is_noise_of_the_accelerometers(tmp_path):
    path = tmp_path / "s.toml"
    plan = '[plan]\nturns = [["rest", "200 s"]]\n[truth]\nkg0 = ["0 deg/h", "0 deg/h", "0 deg/h"]\n'
    path.write_text(study(more=plan + '[disturbances]\nvibration = "1 mg"\n'))
    made = ic.simulate(path, np.random.default_rng(1))
    spread = np.nanstd(made["acc_x"].si())
    # 1000 samples: four standard errors
    assert abs(spread / (1000 * UG) - 1.0) < 4.0 / np.sqrt(2000.0)
