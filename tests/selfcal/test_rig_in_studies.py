"""A study with errors of the rig, simulated and calibrated as the commands do."""

import numpy as np
import pytest
from independent.selfcal import ARCSEC, DEG_H, PPM, THREE, UG, G, study

import inercal as ic
from inercal.foundation.errors import RecordError, StudyError

RIG = f"""
[plan]
turns = [{", ".join(f'["{joint}", "{angle} deg"]' for joint, angle in THREE)}]
[truth]
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]
[disturbances]
g_sensitivity = ["0.05 deg/h/g", {", ".join(['"0 deg/h/g"'] * 8)}]
sag = ["1 arcsec/g", "-2 arcsec/g", "3 arcsec/g"]
kg0_T1 = "0.02 deg/h/K"
ka0_T1 = "20 ug/K"
ka1_T1 = ["5 ppm/K", "-10 ppm/K", "15 ppm/K"]
temperature = ["21 degC", "23 degC"]
"""


def of_study(path, states):
    path.write_text(study(more=f"[model]\nstates = {states}\n{RIG}"))
    return path


def test_simulated_values_are_found(tmp_path):
    asked = of_study(tmp_path / "s.toml", '["extended", "g_sensitivity", "sag", "temperature"]')
    record = ic.simulate(asked, np.random.default_rng(20261123))
    assert record["temperature"].values[[0, -1]] == pytest.approx([21.0, 23.0])
    found = ic.calibrate(record, asked).estimate
    true = {"kg0_x": 0.08 * DEG_H, "kg0_y": -0.06 * DEG_H, "kg0_z": 0.10 * DEG_H, "G_xx": 0.05 * DEG_H / G}
    true |= {f"sag_{i}": value * ARCSEC / G for i, value in zip("xyz", (1.0, -2.0, 3.0), strict=True)}
    true |= {f"ka1_{i}_T1": value * PPM for i, value in zip("xyz", (5.0, -10.0, 15.0), strict=True)}
    true |= {f"kg0_{i}_T1": 0.02 * DEG_H for i in "xyz"} | {f"ka0_{i}_T1": 20 * UG for i in "xyz"}
    off = (found.values - [true.get(name, 0.0) for name in found.names]) / found.u
    assert np.abs(off).max() < 4.5
    assert found.status.value == "ok"


def test_what_has_no_temperature_is_refused(tmp_path):
    asked = of_study(tmp_path / "s.toml", '["paper", "temperature"]')
    text = asked.read_text()
    asked.write_text(text.replace('temperature = ["21 degC", "23 degC"]', ""))
    record = ic.simulate(asked, np.random.default_rng(1))
    with pytest.raises(RecordError, match="found no temperature in degC or K, expected one for kg0_T1"):
        ic.calibrate(record, asked)


def test_a_stream_has_no_mean_temperature(tmp_path):
    from inercal.faces.stream.selfcal import filter_of
    from inercal.systems.selfcal.filters.problem import problem

    asked = of_study(tmp_path / "s.toml", '["paper", "temperature"]')
    with pytest.raises(StudyError, match=r"model\.states: found temperature"):
        filter_of(problem(ic.study(asked).settings))
