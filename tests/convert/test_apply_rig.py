"""A self-calibration with states of the rig in use: drift by force, sag, temperature, squares, asymmetry."""

import numpy as np
import pytest
from independent.selfcal import ARCSEC, DEG_H, PPM, TRUTH, UG, G, study
from scipy.spatial.transform import Rotation

import inercal as ic
from inercal.cli import run
from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.platform import not_applied, platform_model
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.records.record import record_of
from inercal.foundation.records.write import write_record
from inercal.foundation.results.files import save
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.platform.coefficients import NAMES, units
from inercal.systems.selfcal.platform.states import ALL

RIG = {
    **{f"kg1_{i}": value * PPM for i, value in zip("xyz", (20.0, -30.0, 40.0), strict=True)},
    **{f"K2_{i}": value * UG / G**2 for i, value in zip("xyz", (20.0, -15.0, 30.0), strict=True)},
    **{f"S_asym_{i}": value * PPM for i, value in zip("xyz", (10.0, -8.0, 6.0), strict=True)},
    **{
        f"G_{i}{j}": (k - 4) * 0.02 * DEG_H / G
        for k, (i, j) in enumerate((i, j) for i in "xyz" for j in "xyz")
    },
    **{f"sag_{i}": value * ARCSEC / G for i, value in zip("xyz", (3.0, -2.0, 4.0), strict=True)},
    **{f"kg0_{i}_T1": value * DEG_H for i, value in zip("xyz", (0.02, 0.01, -0.03), strict=True)},
    **{f"ka0_{i}_T1": value * UG for i, value in zip("xyz", (50.0, -40.0, 20.0), strict=True)},
    **{f"ka1_{i}_T1": value * PPM for i, value in zip("xyz", (20.0, 15.0, -10.0), strict=True)},
    "gamma_x": 5 * ARCSEC,
}


def estimate(more=None, temperature=20.0):
    values = {**dict(zip(NAMES, TRUTH, strict=True)), **(RIG if more is None else more)}
    names = tuple(values)
    stated = {"value": temperature, "u": 0.1, "unit": "degC"} if temperature is not None else None
    p = len(names)
    return Estimate(
        "selfcal", names, units(names), np.array(list(values.values())), 1e-20 * np.eye(p), np.full(p, 100.0),
        Status.OK, "as drawn", conditions={"temperature": stated},
    )  # fmt: skip


def record(**triads):
    n = len(next(iter(triads.values())))
    columns = []
    for name, values in triads.items():
        if name == "temperature":
            columns.append((name, parse_unit("degC"), values))
            continue
        unit = parse_unit({"acc": "g", "gyro": "deg/h", "wc": "deg/s"}[name])
        columns += [(f"{name}_{i}", unit, values[:, k] / unit.factor) for k, i in enumerate("xyz")]
    return record_of(columns, np.arange(float(n)))


def si(made, sensor):
    return made.triad(sensor).values * made.triad(sensor).unit.factor


def instrument(w, f, warm):
    """Rates of the platform and outputs of its accelerometers, written again: ``f`` (n, 3) in p, ``w`` commanded."""
    kg0, eta, ds, do, ka0, ka1 = TRUTH.reshape(6, 3)
    of = {key: np.array([RIG[f"{key}_{i}"] for i in "xyz"]) for key in ("kg1", "K2", "S_asym")}
    t1 = {key: np.array([RIG[f"{key}_{i}_T1"] for i in "xyz"]) for key in ("kg0", "ka0", "ka1")}
    M = np.array(
        [[of["kg1"][0], ds[0], -do[0]], [-do[1], of["kg1"][1], ds[1]], [ds[2], -do[2], of["kg1"][2]]]
    )
    drift = np.array([[RIG[f"G_{i}{j}"] for j in "xyz"] for i in "xyz"])
    turning = w + w @ M.T + 0.5 * of["S_asym"] * np.abs(w) + kg0 + t1["kg0"] * warm + f @ drift.T
    along = np.stack([f[:, 0], f[:, 1] - eta[1] * f[:, 0], f[:, 2] + eta[0] * f[:, 0] - eta[2] * f[:, 1]], -1)
    s = (1.0 + ka1) * along
    outputs = ka0 + t1["ka0"] * warm + s + (of["K2"] * s**2 + t1["ka1"] * warm * s) / (1.0 + ka1)
    return turning, outputs


def drawn():
    rng = np.random.default_rng(4)
    f = G * rng.standard_normal((60, 3))
    return f, np.radians(rng.uniform(-20.0, 20.0, (60, 3))), rng.uniform(-10.0, 10.0, (60, 1))


def bend(f):
    """Turns of the unbent platform's axes, by the sag."""
    return Rotation.from_rotvec(np.cross([RIG[f"sag_{i}"] for i in "xyz"], f))


def test_all_that_a_rig_does_is_taken_out():
    f, w, warm = drawn()
    turning, outputs = instrument(w, f, warm)
    given = record(acc=outputs, gyro=w, temperature=20.0 + warm[:, 0])
    made = apply_to(given, platform_model(estimate()))
    np.testing.assert_allclose(si(made, "acc"), bend(f).apply(f), rtol=0, atol=1e-12)
    np.testing.assert_allclose(si(made, "gyro"), bend(f).apply(turning), rtol=0, atol=1e-15)
    assert made.findings == given.findings
    wanted = record(acc=outputs, wc=bend(f).apply(turning), temperature=20.0 + warm[:, 0])
    command = apply_to(wanted, platform_model(estimate()))
    np.testing.assert_allclose(si(command, "wc"), w, rtol=0, atol=1e-15)
    plain = apply_to(given, platform_model(estimate({})))
    assert np.abs(si(plain, "acc") - si(made, "acc")).max() > 1e-3


def test_inverted_is_the_way_back():
    f, w, warm = drawn()
    given = record(acc=f, gyro=w, wc=-w, temperature=20.0 + warm[:, 0])
    model = platform_model(estimate())
    for first, second in ((False, True), (True, False)):
        back = apply_to(apply_to(given, model, invert=first), model, invert=second)
        for sensor in ("acc", "gyro", "wc"):
            np.testing.assert_allclose(si(back, sensor), si(given, sensor), rtol=0, atol=3e-13)


def test_what_a_record_lacks_is_left_out_and_said():
    f, w, _ = drawn()
    model = platform_model(estimate())
    made = apply_to(record(gyro=w), model)
    texts = [finding.message for finding in made.findings if finding.code == "not_held"]
    assert texts == [
        "kg0_T1, ka0_T1, ka1_T1 are not applied: the record has no temperature",
        "g_sensitivity, sag are not applied: the record has no specific force acc_x to z",
    ]
    still, _ = instrument(w, 0.0 * f, np.zeros((60, 1)))
    np.testing.assert_allclose(si(made, "gyro"), still, rtol=0, atol=1e-15)
    (said,) = not_applied(estimate())
    assert said.message == "errors of the rig are not applied: gamma_x"


def test_each_state_is_applied_or_named():
    """Of all states that a platform may have: one that is estimated changes the corrected readings, or is said."""
    f, w, warm = drawn()
    given = record(acc=f, gyro=w, temperature=20.0 + warm[:, 0])
    plain = apply_to(given, platform_model(estimate({})))
    for name in ALL[18:]:
        found = estimate({name: 1e-3})
        made, said = apply_to(given, platform_model(found)), not_applied(found)
        changed = any(not np.array_equal(si(made, sensor), si(plain, sensor)) for sensor in ("acc", "gyro"))
        assert changed == (not said), name
        assert all(name in finding.message or name.startswith("beta_") for finding in said)


def test_columns_on_other_clocks_are_refused():
    f, w, _ = drawn()
    whole = record(acc=f, gyro=w)
    columns = dict(whole.columns)
    names = ("acc_x", "acc_y", "acc_z")
    later = record_of([(name, whole[name].unit, whole[name].values) for name in names], 0.5 + np.arange(60.0))
    columns |= later.columns
    other = type(whole)(columns, (), whole.sources)
    with pytest.raises(InputError, match="different clocks"):
        apply_to(other, platform_model(estimate()))


def test_a_stream_gives_the_bytes_of_a_file(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    f, w, warm = drawn()
    save(estimate(), tmp_path / "cal.json")
    write_record(record(acc=f, gyro=w, temperature=20.0 + warm[:, 0]), tmp_path / "log.csv")
    for more in ([], ["--invert"]):
        assert run(["apply", "cal.json", "log.csv", "--out", "file.csv", "--quiet", *more]) == 0
        capsys.readouterr()
        assert run(["apply", "cal.json", "log.csv", "--stream", "--quiet", *more]) == 0
        assert capsys.readouterr().out == (tmp_path / "file.csv").read_text()


def test_a_simulated_platform_is_corrected_to_its_true_motion(tmp_path):
    """A rig of two axes without noise: specific force and rate are those of the true attitude."""
    disturbances = """
[plan]
turns = [["x", "90 deg"], ["z", "120 deg"]]
[truth]
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]
ka1 = ["500 ppm", "-300 ppm", "800 ppm"]
[disturbances]
k2 = "20 ug/g^2"
sag = ["3 arcsec/g", "-2 arcsec/g", "4 arcsec/g"]
g_sensitivity = ["0.05 deg/h/g", "0 deg/h/g", "0.02 deg/h/g", "0 deg/h/g", "0.03 deg/h/g", "0 deg/h/g",
 "0 deg/h/g", "0 deg/h/g", "-0.04 deg/h/g"]
kg0_T1 = "0.02 deg/h/K"
ka0_T1 = "20 ug/K"
temperature = ["18 degC", "23 degC"]
[conditions]
temperature = "20 degC"
"""
    path = tmp_path / "s.toml"
    text = study(more=disturbances).replace('heading = "0 deg"', 'fixed = { y = "0 deg" }')
    path.write_text(
        text.replace('"0.0005 deg/sqrt(h)"', '"1e-9 deg/sqrt(h)"').replace('"10.0 ug"', '"1e-6 ug"')
    )
    settings, made = ic.study(path).settings, ic.simulate(path, np.random.default_rng(1))
    true = dict(zip(ALL, settings.true_values, strict=True))
    found = apply_to(made, platform_model(estimate(true)))
    q = np.stack([made[f"q_ref_{k}"].values for k in (1, 2, 3, 0)], axis=-1)
    attitude = Rotation.from_quat(q)
    f = attitude.inv().apply(settings.world.up)
    sag = Rotation.from_rotvec(np.cross([true[f"sag_{i}"] for i in "xyz"], f))
    np.testing.assert_allclose(si(found, "acc")[1:], sag.apply(f)[1:], rtol=0, atol=2e-9)
    spin = Rotation.from_rotvec(0.2 * settings.world.earth)
    rate = (attitude[:-1].inv() * spin * attitude[1:]).as_rotvec() / 0.2
    # the force that a row reads is that of its begin, and the gyros' drift that of the middle of the step
    off = si(found, "gyro")[1:-1] - sag[1:-1].apply(rate[1:])
    assert np.abs(off).max() < 2e-3 * 0.05 * DEG_H + 1e-12
