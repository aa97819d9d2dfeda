"""`inercal calibrate imu` by sections on one log: moves between the rests that are found, or a swing where none is."""

import json

import numpy as np
import pytest
from moved_units import turned_by_hand
from swung_units import hand

import inercal as ic
from inercal.cli import run

STUDY = """schema = 1
[site]
latitude = "48 deg"
gravity = "9.81 m/s^2"
[imu]
method = "sections"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "imu.toml").write_text(STUDY)
    return tmp_path


def calibrated(folder, t, acc, gyro=None):
    """Result of a log [m/s^2, rad/s] and the exit code."""
    heads = ["t [s]", *(f"acc_{axis} [m/s^2]" for axis in "xyz")]
    columns = [t[:, None], acc]
    if gyro is not None:
        heads += [f"gyro_{axis} [rad/s]" for axis in "xyz"]
        columns.append(gyro)
    np.savetxt(folder / "log.csv", np.hstack(columns), "%.6f", ",", header=",".join(heads), comments="")
    code = run(["calibrate", "imu", "log.csv", "--study", "imu.toml", "--quiet", "--out", "out.json"])
    return code, json.loads((folder / "out.json").read_text(encoding="utf-8"))


def off(found, truth):
    """Errors over u, by name."""
    return {
        p["name"]: (p["value"] - truth[p["name"]]) / p["u"] for p in found["parameters"] if p["name"] in truth
    }


@pytest.mark.slow
def test_a_log_gets_the_moves_between_its_rests(folder):
    """Scale factors and misalignments of the gyro, which rests alone do not tell, within some u of the truth."""
    record = turned_by_hand(np.random.default_rng(4501), rests=16)
    clipped = record.gyro.copy()
    a, b = record.rests[3][1] + 40, record.rests[3][1] + 60
    clipped[a:b, 0] = 1.2 * np.abs(record.gyro).max()
    code, found = calibrated(folder, record.t, record.acc, clipped)
    assert code == 0, found["status"]
    errors = off(found, record.truth)
    assert {"S_x", "T_xy", "K1_z"} <= errors.keys()
    assert np.sqrt(np.mean(np.square(list(errors.values())))) < 2.0
    assert max(map(abs, errors.values())) < 4.5
    u = {p["name"]: p["u"] for p in found["parameters"]}
    assert u["S_x"] < 0.01
    assert sum(row["kind"] == "move" for row in found["result"]["sections"]) == 15
    (left_out,) = [one for one in found["findings"] if one["code"] == "poor_section"]
    assert "1 of 15 moves is not used" in left_out["headline"]


@pytest.mark.slow
def test_a_log_in_which_nothing_rests_is_a_swing(folder):
    acc, gyro, x = hand(np.random.default_rng(4502), seconds=60.0)
    names = [*(f"K0_{i}" for i in "xyz"), *(f"K1_{i}" for i in "xyz"), "M_xy", "M_xz", "M_yz"]
    t = 0.01 * np.arange(len(acc))
    code, found = calibrated(folder, t, acc, gyro)
    assert code == 0, found["status"]
    errors = off(found, dict(zip(names, x, strict=True)))
    assert len(errors) == 9
    assert max(map(abs, errors.values())) < 4.0
    (said,) = [one for one in found["findings"] if one["code"] == "not_at_rest"]
    assert "calibrated as a swing" in said["headline"]
    assert [row["kind"] for row in found["result"]["sections"]] == ["swing"]


@pytest.mark.slow
def test_the_search_ends_where_a_vertical_crosses_a_choice_of_level_axes():
    """A gyro that feels earth rate: axes of its level part that jumped by a step of a vertical, however small, left the
    search no step that lowers the sum of squares."""
    study = ic.study(
        "imu",
        site={"gravity": "9.8100(5) m/s^2", "latitude": "50 deg"},
        simulation={
            "poses": 24,
            "hold": "3 s",
            "accelerometer_noise": "80 ug/sqrt(Hz)",
            "gyro_noise": "0.3 deg/sqrt(h)",
            "coefficients": {"K1_x": "4100 count/g"},
        },
    )
    found = ic.calibrate(ic.simulate(study, np.random.default_rng(1)), study)
    assert found.status.value == "ok", found.message
