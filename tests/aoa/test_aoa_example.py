"""The record of a model on a sting that ships: what its study simulates, to the digits it is written with."""

import numpy as np
import pytest

from inercal.examples import EXAMPLES, FOLDER
from inercal.faces.studies.load import load_aoa_study
from inercal.foundation.records.read import read
from inercal.systems.aoa.simulate import simulate, to_record

EXAMPLE = EXAMPLES["sting"]
LAST = {"a1": 1e-5, "a2": 1e-5, "a3": 1e-5, "gyro": 1e-2, "point": 1.0}


@pytest.fixture(scope="module")
def record():
    return read(FOLDER / EXAMPLE.records[0])


def test_it_is_what_the_study_simulates(record):
    study = load_aoa_study(FOLDER / EXAMPLE.study)
    made = to_record(simulate(study, np.random.default_rng(1)).recording, study)
    assert list(record.columns) == list(LAST)  # no theta_ref: a tunnel has none
    for name, digit in LAST.items():
        assert record[name].unit == made[name].unit
        np.testing.assert_allclose(record[name].values, made[name].values, rtol=0.0, atol=0.501 * digit)
    np.testing.assert_allclose(record["a1"].t, made["a1"].t, rtol=0.0, atol=1e-9)


def test_rounding_is_below_the_noise(record):
    """A quantum q adds q^2 / 12 to a variance: less than a hundredth of that of the noise."""
    noise = load_aoa_study(FOLDER / EXAMPLE.study).noise
    for name, stated in (("a1", noise.accelerometer), ("gyro", noise.gyro)):
        quantum = LAST[name] * record[name].unit.factor
        assert quantum**2 / 12.0 < 0.01 * stated**2


def test_it_is_small():
    assert (FOLDER / EXAMPLE.records[0]).stat().st_size < 400_000
