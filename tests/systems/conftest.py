"""A test of each system, by a new study of its own: simulated, recorded, calibrated once."""

import functools

import numpy as np
import pytest
from new_studies import filled

import inercal as ic
from inercal.faces.python.study import read_study
from inercal.foundation.records.write import write_record

#: keys that make the test of a new study short
SHORT = {
    "turntable": ("positions.plan=24-position", 'goal={ DX_F = "1 deg/h" }', "design.positions=12"),
    "selfcal": ("design.turns=1",),
    "strapdown": ("plan.sample_rate=25 Hz",),
    "aoa": ("motion.duration=12 s", "motion.sample_rate=250 Hz"),
}


@pytest.fixture(scope="session")
def test_of(tmp_path_factory):
    """Of a kind: the folder of study and recording, the study, the record, the result; made once."""
    root = tmp_path_factory.mktemp("systems")

    @functools.cache
    def made(kind):
        folder = root / kind
        folder.mkdir()
        (folder / "study.toml").write_text(filled(kind, overrides=SHORT.get(kind, ())))
        study = read_study(kind, folder / "study.toml")
        write_record(ic.simulate(study, np.random.default_rng(1)), folder / "log.csv")
        record = ic.read(folder / "log.csv")
        return folder, study, record, ic.calibrate(record, study)

    return made
