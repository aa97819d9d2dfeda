"""What our result says that imucal finds, against its own run on the shipped sessions and its published result files.

Its model is w_cal = R_g^-1 K_g^-1 (w - K_ga a_cal - b_g), a_cal = R_a^-1 K_a^-1 (a - b_a) in m/s^2 and deg/s, so that
K_a R_a is our K1 M and K_g R_g our S T pi/180. It takes turns as clockwise (-360 deg) unless told otherwise, and its
g-sensitivity still holds the earth rate, as ours without a latitude does.
"""

import json
import math
import sys
from pathlib import Path

import imucal
import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "imu"))
from ferraris_sessions import SETTINGS, options_of, record_of

from inercal.examples import FOLDER
from inercal.faces.convert.other_tools import to_tool
from inercal.faces.validate.imu import IMUCAL
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris

ROUNDING = 1e-12


def ours(name, turn="-360 deg"):
    """Gains, biases and g-sensitivity in imucal's units, from what our result says that imucal finds."""
    found = calibrate_ferraris(record_of(name), SETTINGS, options_of(name, turn=turn)).estimate.result[
        "imucal"
    ]

    def triad(scale, cross, bias):
        size = np.array([found[f"{scale}_{i}"] for i in "xyz"])
        shape = [[1.0 if i == j else found[f"{cross}_{i}{j}"] for j in "xyz"] for i in "xyz"]
        return size[:, None] * np.array(shape), np.array([found[f"{bias}_{i}"] for i in "xyz"])

    (K, b), (S, d) = triad("K1", "M", "K0"), triad("S", "T", "D_F")
    G = np.array([[found[f"G_{i}{j}"] for j in "xyz"] for i in "xyz"])
    return {"K_a R_a": K, "b_a": b, "K_g R_g": S * math.pi / 180.0, "b_g": d, "K_ga": G}


def products(found):
    """The same of imucal's matrices (``K`` as diagonals)."""
    return {
        "K_a R_a": np.diag(found["K_a"]) @ found["R_a"],
        "b_a": np.array(found["b_a"]),
        "K_g R_g": np.diag(found["K_g"]) @ found["R_g"],
        "b_g": np.array(found["b_g"]),
        "K_ga": np.array(found["K_ga"]),
    }


def run_imucal(name, angle):
    """imucal on the same file, read by pandas."""
    data = pd.read_csv(FOLDER / f"{name}.csv.gz")
    if name == "ferraris":
        regions, rate = imucal.ferraris_regions_from_df(data.set_index("part")), 204.8
    else:
        spans = options_of(name).sections
        table = pd.DataFrame({key: {"start": a, "end": b} for key, (a, b) in spans.items()}).T
        regions, rate = imucal.ferraris_regions_from_section_list(data, table), 102.4
    found = imucal.FerrarisCalibration(grav=9.81, expected_angle=angle).compute(
        regions, rate, from_acc_unit="a.u.", from_gyr_unit="a.u."
    )
    known = {
        key: np.asarray(getattr(found, key)) for key in ("K_a", "R_a", "b_a", "K_g", "R_g", "K_ga", "b_g")
    }
    return known | {key: np.diag(known[key]) for key in ("K_a", "K_g")}


def equal(ours, theirs):
    for key, values in theirs.items():
        scale = np.max(np.abs(values))
        assert np.max(np.abs(ours[key] - values)) < ROUNDING * scale, key


@pytest.mark.parametrize("name", ["ferraris", "ferraris-si"])
@pytest.mark.parametrize("angle", [-360.0, 360.0, -720.0])
def test_equal_to_imucal_run_on_the_same_session(name, angle):
    equal(ours(name, f"{angle:g} deg"), products(run_imucal(name, angle)))


@pytest.mark.parametrize("name", ["ferraris", "ferraris-si"])
def test_equal_to_its_published_results(name):
    equal(ours(name), products(IMUCAL[name]))


@pytest.mark.parametrize("name", ["ferraris", "ferraris-si"])
def test_a_converted_calibration_corrects_as_its_own_does(name, tmp_path):
    """``convert --to imucal`` of a session after Ferraris gives the numbers that imucal itself finds."""
    record = record_of(name)
    estimate = calibrate_ferraris(record, SETTINGS, options_of(name, turn="-360 deg")).estimate
    (tmp_path / "cal.json").write_text(to_tool(estimate, "imucal").texts[""])
    info_of_ours = imucal.FerrarisCalibrationInfo.from_json_file(tmp_path / "cal.json")
    found = IMUCAL[name]
    info = imucal.FerrarisCalibrationInfo.from_json(
        json.dumps(
            {
                **{key: np.diag(found[key]).tolist() for key in ("K_a", "K_g")},
                **{key: found[key] for key in ("R_a", "b_a", "R_g", "K_ga", "b_g")},
                "acc_unit": "m/s^2",
                "gyr_unit": "deg/s",
                "from_acc_unit": "a.u.",
                "from_gyr_unit": "a.u.",
                "comment": None,
                "cal_type": "Ferraris",
                "_format_version": "2.0.0",
            }
        )
    )
    theirs = info.calibrate(
        record.triad("acc").values, record.triad("gyro").values, acc_unit="a.u.", gyr_unit="a.u."
    )
    made = info_of_ours.calibrate(
        record.triad("acc").values, record.triad("gyro").values, acc_unit=info_of_ours.from_acc_unit,
        gyr_unit=info_of_ours.from_gyr_unit,
    )  # fmt: skip
    for own, other in zip(made, theirs, strict=True):
        assert np.allclose(own, other, rtol=0.0, atol=1e-10 * np.max(np.abs(other)))
