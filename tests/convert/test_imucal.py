"""imucal, the program itself as the judge: it loads what we write, and corrects as we do."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from imucal import CalibrationInfo, FerrarisCalibrationInfo
from imucal.management import load_calibration_info
from instruments_drawn import assert_same_corrections, instrument, seeds, there_and_back

from inercal.faces.convert import imucal
from inercal.faces.convert.correct import ImuModel, imu_model
from inercal.faces.convert.other_tools import from_tool
from inercal.foundation.errors import InputError
from rows import for_each


@pytest.mark.parametrize("upper", [True, False])
@given(seed=seeds)
@settings(deadline=None, max_examples=40)
def test_there_and_back(upper, seed):
    model = instrument(seed, upper)
    assert_same_corrections(model, there_and_back(model, "imucal"), seed)


@given(seed=seeds)
@settings(deadline=None, max_examples=20)
def test_imucal_loads_our_text_and_corrects_as_we_do(seed):
    model = instrument(seed, upper=bool(seed % 2))
    rng = np.random.default_rng(seed)
    outputs = model.indicate(rng.uniform(-20, 20, (9, 3)), rng.uniform(-5, 5, (9, 3)))
    info = CalibrationInfo.from_json(imucal.render(imucal.terms(model), model.units)[""])
    theirs = info.calibrate(*outputs, model.units["acc"], model.units["gyro"])
    ours = model.correct(*outputs)
    np.testing.assert_allclose(theirs[0], ours[0], atol=1e-11)
    np.testing.assert_allclose(np.radians(theirs[1]), ours[1], atol=1e-11)


def test_imucal_finds_our_file_by_itself(tmp_path):
    model = instrument(3)
    (tmp_path / "cal.json").write_text(imucal.render(imucal.terms(model), model.units)[""])
    info = load_calibration_info(tmp_path / "cal.json")
    assert type(info) is FerrarisCalibrationInfo
    assert (info.acc_unit, info.gyr_unit) == ("m/s^2", "deg/s")
    np.testing.assert_allclose(np.linalg.norm(info.R_a, axis=1), 1.0)
    assert np.count_nonzero(info.K_a - np.diag(np.diag(info.K_a))) == 0


@pytest.mark.parametrize("units", [("m/s^2", "deg/s"), ("g", "rad/s")])
def test_we_read_what_imucal_writes_and_correct_as_it_does(tmp_path, units):
    rng = np.random.default_rng(4)
    near = [np.eye(3) + rng.uniform(-0.1, 0.1, (3, 3)) for _ in range(3)]
    info = FerrarisCalibrationInfo(
        acc_unit=units[0], gyr_unit=units[1], from_acc_unit="a.u.", from_gyr_unit="a.u.",
        K_a=np.diag([208.5, 208.0, 214.8]), R_a=near[0], b_a=np.array([-6.0, -48.3, -29.0]),
        K_g=np.diag([16.7, 16.2, 16.9]), R_g=near[1], K_ga=near[2], b_g=np.array([1.0, 2.0, 3.0]),
    )  # fmt: skip
    info.to_json_file(tmp_path / "theirs.json")
    with pytest.raises(InputError, match="states no unit of the acc outputs, expected --acc-unit"):
        from_tool([tmp_path / "theirs.json"], "imucal")
    model = imu_model(from_tool([tmp_path / "theirs.json"], "imucal", {"acc": "count", "gyro": "count"}))
    raw = rng.uniform(-2000, 2000, (20, 3)), rng.uniform(-2000, 2000, (20, 3))
    theirs = info.calibrate(*raw, "a.u.", "a.u.")
    ours = model.correct(*raw)
    np.testing.assert_allclose(ours[0], theirs[0] * {"m/s^2": 1, "g": 9.80665}[units[0]], rtol=1e-11)
    np.testing.assert_allclose(ours[1], theirs[1] * {"deg/s": np.pi / 180, "rad/s": 1}[units[1]], rtol=1e-10)


def test_accelerometers_alone_have_no_place():
    alone = ImuModel(instrument(1).accelerometer, None, np.zeros((3, 3)), {"acc": "count"})
    with pytest.raises(InputError, match=r"^imucal: found a calibration of accelerometers alone"):
        imucal.terms(alone)


@for_each(
    ("change", "words"),
    [
        ({"_format_version": "1.0.0"}, "format version '1.0.0', expected a calibration written by imucal"),
        ({"cal_type": "Magic"}, "calibration type 'Magic'"),
        ({"K_a": None}, "K_a is of shape"),
        ({"K_a": [[1, 2], [3, 4]]}, "K_a is of shape"),
        ({"K_g": [[0, 0, 0]] * 3}, "not independent"),
        ({"b_g": ["x", "y", "z"]}, "x"),
        ({"acc_unit": "deg/s"}, "corrected samples in deg/s"),
        ({"gyr_unit": "bananas"}, "bananas"),
    ],
)
def test_what_is_no_file_of_imucal_is_said(tmp_path, change, words):
    model = instrument(5)
    data = json.loads(imucal.render(imucal.terms(model), model.units)[""])
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(data | change))
    with pytest.raises(InputError, match=rf"bad\.json.*{words}"):
        from_tool([path], "imucal", {"acc": "count", "gyro": "count"})


@for_each("text", ["", "[]", "{}", "[1, 2", "null", '"text"', "{" * 9])
def test_what_is_not_even_json_of_it_is_said(tmp_path, text):
    (tmp_path / "bad.json").write_text(text)
    with pytest.raises(InputError, match=r"bad\.json: .*expected a calibration written by imucal") as caught:
        from_tool([tmp_path / "bad.json"], "imucal")
    assert ("not valid JSON" in str(caught.value)) == (text in ("", "[1, 2", "{" * 9))
