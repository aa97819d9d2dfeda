"""PSINS: the struct clbt, by the steps of its imuclbt and imuadderr."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from instruments_drawn import assert_same_corrections, instrument, seeds, there_and_back

from inercal.faces.convert import psins
from inercal.faces.convert.convention import in_si_outputs
from inercal.faces.convert.correct import ImuModel
from inercal.faces.convert.other_tools import from_tool
from inercal.foundation.errors import InputError
from inercal.foundation.units import parse_unit
from rows import for_each


@pytest.mark.parametrize("upper", [True, False])
@given(seed=seeds)
@settings(deadline=None, max_examples=40)
def test_there_and_back(upper, seed):
    model = instrument(seed, upper)
    assert_same_corrections(model, there_and_back(model, "psins"), seed)


def as_matlab_runs(text):
    """The assignments of a script, as MATLAB would make them."""
    found = {}
    for name, body in re.findall(r"^clbt\.(\w+) = \[(.*)\];$", text, re.MULTILINE):
        found[name] = np.array([[float(word) for word in row.split()] for row in body.split(";")])
    return found


@given(seed=seeds)
@settings(deadline=None, max_examples=20)
def test_its_own_steps_on_its_own_struct_give_the_truth(seed):
    """imuclbt: increments times sf, drift of gSens from the scaled accelerometers, Kg and Ka, then less eb and db."""
    model = in_si_outputs(instrument(seed, sensitive=bool(seed % 2)))
    clbt = as_matlab_runs(psins.render(psins.terms(model), model.units)[""])
    assert ("gSens" in clbt) == bool(seed % 2)
    rng = np.random.default_rng(seed)
    f, omega, ts = rng.uniform(-20, 20, (9, 3)), rng.uniform(-5, 5, (9, 3)), 0.01
    acc, gyro = model.indicate(f, omega)
    imu = np.hstack([gyro, acc]) * ts
    imu = imu * clbt["sf"].ravel()
    drift = -imu[:, 3:] @ clbt.get("gSens", np.zeros((3, 3))).T
    w = imu[:, :3] @ clbt["Kg"].T + drift - ts * clbt["eb"].ravel()
    v = imu[:, 3:] @ clbt["Ka"].T - ts * clbt["db"].ravel()
    np.testing.assert_allclose(v / ts, f, atol=1e-10)
    np.testing.assert_allclose(w / ts, omega, atol=1e-10)


def test_Kg_and_Ka_are_near_one_and_the_shapes_are_columns():
    text = psins.render(psins.terms(instrument(3)), {"acc": "count", "gyro": "count"})[""]
    clbt = as_matlab_runs(text)
    assert {name: value.shape for name, value in clbt.items()} == {
        "sf": (6, 1), "Kg": (3, 3), "eb": (3, 1), "Ka": (3, 3), "db": (3, 1), "gSens": (3, 3),
    }  # fmt: skip
    assert np.abs(np.diag(clbt["Ka"]) - 1).max() < 1e-15
    assert np.abs(clbt["Kg"] - np.eye(3)).max() < 0.4


# As its clbtfile writes, with the values of the example in imuclbt.
ITS_OWN = (
    "Kg = [\r\n\t9.99990000e-01 \t4.84813681e-05 \t9.69627362e-05\r\n\t1.45444104e-04 \t9.99980000e-01 "
    "\t1.93925472e-04\r\n\t2.42406841e-04 \t2.90888209e-04 \t9.99970000e-01\r\n\t];\r\n"
    "eb = [\r\n\t1.00000000e-01 \t2.00000000e-01 \t3.00000000e-01\r\n\t]; \t% deg/h\r\n"
    "Ka = [\r\n\t9.99990000e-01 \t0.00000000e+00 \t0.00000000e+00\r\n\t4.84813681e-05 \t9.99980000e-01 "
    "\t0.00000000e+00\r\n\t9.69627362e-05 \t1.45444104e-04 \t9.99970000e-01\r\n\t];\r\n"
    "db = [\r\n\t1.00000000e+02 \t2.00000000e+02 \t3.00000000e+02\r\n\t]; \t% ug\r\n"
    "Ka2 = [\r\n\t0.00000000e+00 \t0.00000000e+00 \t0.00000000e+00\r\n\t]; \t% ug/g^2\r\n"
    "tGA = [\r\n\t0.00000000e+00\r\n\t]; \t% ms\r\n"
)


def test_a_text_of_its_clbtfile_is_read_in_its_units(tmp_path):
    (tmp_path / "clbt.m").write_bytes(ITS_OWN.encode())
    estimate = from_tool([tmp_path / "clbt.m"], "psins")
    assert estimate.result["unit"] == {"acc": "m/s^2", "gyro": "rad/s"}
    # a sensor at zero input reads Kg^-1 eb, and in this M is lower-triangular
    assert estimate["D_F_x"].value / parse_unit("deg/h").factor == pytest.approx(0.1, rel=1e-3)
    assert estimate["K0_x"].value == pytest.approx(100e-6 * 9.7803267715 / 0.99999, rel=1e-12)
    assert estimate["M_yx"].value == pytest.approx(-4.84813681e-05, rel=1e-3)
    assert estimate["M_xy"].value == 0.0
    assert estimate["K1_x"].value == pytest.approx(1 / 0.99999)


def test_accelerometers_alone_have_no_place():
    with pytest.raises(InputError, match="accelerometers alone"):
        psins.terms(ImuModel(instrument(1).accelerometer, None, np.zeros((3, 3)), {"acc": "count"}))


@for_each(
    ("old", "new", "words"),
    [
        ("% ug\r", "\r", "states no unit of eb and db, expected"),
        ("tGA = [", "Kap = [\r\n\t5 0 0\r\n\t];\r\ntGA = [", "found Kap, for which inercal has no place"),
        ("Ka = [", "Kx = [", "found Kg, eb, Kx, db.* expected Kg, eb, Ka, db"),
        ("3.00000000e+02", "", "db has 2 numbers, expected 3"),
        ("3.00000000e+02", "3*glv.ug", "db: .*expected numbers in brackets"),
        ("9.99990000e-01 \t0", "0 \t0", "without inverse"),
        (ITS_OWN, "", "found no variables"),
    ],
)
def test_what_is_no_clbt_is_said(tmp_path, old, new, words):
    assert old in ITS_OWN
    path = tmp_path / "bad.m"
    path.write_bytes(ITS_OWN.replace(old, new, 1).encode())
    with pytest.raises(InputError, match=rf"bad\.m: .*{words}"):
        from_tool([path], "psins")
