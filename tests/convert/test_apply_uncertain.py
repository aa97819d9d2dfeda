"""IMUs and temperature models in use: K2, coefficients at each temperature, and u against draws of coefficients."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from instruments_drawn import estimate_of, instrument, seeds

from inercal.faces.convert.correct import ImuModel, imu_model
from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.models import model_of, worth_knowing
from inercal.foundation.errors import InputError
from inercal.foundation.inputs import Source
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import parse_unit
from inercal.systems.imu.temperature.calibrations import fit_calibrations


def outputs(model, f, omega, **more):
    """A record of the instrument's outputs in its own units."""
    acc, gyro = model.indicate(f, omega)
    units = {sensor: parse_unit(symbol) for sensor, symbol in model.units.items()}
    columns = [(f"acc_{k}", units["acc"], acc[:, i]) for i, k in enumerate("xyz")]
    columns += [(f"gyro_{k}", units["gyro"], gyro[:, i]) for i, k in enumerate("xyz")]
    columns += [(name, parse_unit("degC"), values) for name, values in more.items()]
    return record_of(columns, np.arange(len(f)) / 100.0)


def with_k2(model, rng):
    return replace(model, second_order=rng.uniform(-1e-3, 1e-3, 3))


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_k2_there_and_back(seed):
    rng = np.random.default_rng(seed)
    model = with_k2(instrument(seed), rng)
    f, omega = rng.uniform(-50, 50, (30, 3)), rng.uniform(-5, 5, (30, 3))
    acc, _ = model.indicate(f, None)
    s = f @ model.accelerometer.misalignment.T
    by_hand = model.accelerometer.bias + model.accelerometer.scale * (s + model.second_order * s**2)
    np.testing.assert_allclose(acc, by_hand, rtol=1e-12, atol=1e-15)  # sums of 0.1 may cancel
    back = apply_to(outputs(model, f, omega), model)
    np.testing.assert_allclose(back.triad("acc").values, f, rtol=0, atol=1e-9)
    np.testing.assert_allclose(back.triad("gyro").values, omega, rtol=0, atol=1e-9)


def test_u_of_a_triad_is_that_of_drawn_coefficients():
    """3000 instruments drawn by the covariance, each corrected in matrices; limits 4 sigma of a standard deviation."""
    rng = np.random.default_rng(20261123)
    model = instrument(7)
    estimate = estimate_of(model, rng, 1e-3)
    f, omega = rng.uniform(-20, 20, (3, 3)), rng.uniform(-5, 5, (3, 3))
    log = outputs(model, f, omega)
    corrected = apply_to(log, model_of(estimate, uncertainty=True))
    acc = np.stack([log[f"acc_{k}"].values for k in "xyz"], axis=-1)
    gyro = np.stack([log[f"gyro_{k}"].values for k in "xyz"], axis=-1)
    draws = []
    for values in rng.multivariate_normal(estimate.values, estimate.covariance, 3000, method="eigh"):
        at = dict(zip(estimate.names, values, strict=True))
        S = np.diag([at[f"K1_{k}"] for k in "xyz"])
        M = np.array([[1.0 if i == j else at.get(f"M_{i}{j}", 0.0) for j in "xyz"] for i in "xyz"])
        T = np.array([[1.0 if i == j else at[f"T_{i}{j}"] for j in "xyz"] for i in "xyz"])
        G = np.array([[at[f"G_{i}{j}"] for j in "xyz"] for i in "xyz"])
        force = np.linalg.solve(S @ M, (acc - [at[f"K0_{k}"] for k in "xyz"]).T)
        drift = np.array([at[f"D_F_{k}"] for k in "xyz"])[:, None] + G @ force
        rate = np.linalg.solve(np.diag([at[f"S_{k}"] for k in "xyz"]) @ T, gyro.T - drift)
        draws.append(np.vstack([force, rate]))
    u = np.array([corrected[f"u_{s}_{k}"].values for s in ("acc", "gyro") for k in "xyz"])
    assert np.abs(np.std(draws, axis=0) / u - 1.0).max() < 4.0 / np.sqrt(2 * 2999)


def test_a_calibration_without_uncertainty_gives_none():
    estimate = estimate_of(instrument(3), np.random.default_rng(1))
    bare = replace(estimate, covariance=np.full_like(estimate.covariance, np.nan))
    with pytest.raises(InputError, match="states no uncertainty of its coefficients"):
        model_of(bare, "cal.json", uncertainty=True)


def over_temperature():
    """A model of five calibrations of an instrument whose coefficients are quadratic in temperature, and the truth."""
    base = estimate_of(instrument(11), np.random.default_rng(2), 1e-7)
    slope = 1e-4 * np.abs(base.values)

    def at(T):
        return replace(base, values=base.values + slope * (T - 25.0) + 1e-3 * slope * (T - 25.0) ** 2)

    temperatures = [-20.0, 0.0, 20.0, 40.0, 60.0]
    each = [
        replace(at(T), conditions={"temperature": {"value": T, "u": 0.0, "unit": "degC"}})
        for T in temperatures
    ]
    files = [Source(f"{k}.json", str(k)) for k in range(5)]
    return fit_calibrations(each, files).estimate, at


def test_a_temperature_model_corrects_each_sample_at_its_own_temperature():
    estimate, at = over_temperature()
    T = np.array([-15.0, 10.0, 33.0, 55.0])
    rng = np.random.default_rng(4)
    f, omega = rng.uniform(-20, 20, (4, 3)), rng.uniform(-5, 5, (4, 3))
    model = model_of(estimate)
    one = [imu_model(at(t)).indicate(f[k], omega[k]) for k, t in enumerate(T)]
    units = imu_model(at(0.0)).units
    columns = [
        (f"{s}_{k}", parse_unit(units[s]), np.array([pair[j][i] for pair in one]))
        for j, s in enumerate(("acc", "gyro"))
        for i, k in enumerate("xyz")
    ]
    log = record_of([*columns, ("temperature", parse_unit("K"), T + 273.15)], np.arange(4.0))
    corrected = apply_to(log, model)
    np.testing.assert_allclose(corrected.triad("acc").values, f, rtol=0, atol=1e-6)
    np.testing.assert_allclose(corrected.triad("gyro").values, omega, rtol=0, atol=1e-6)
    back = apply_to(corrected, model, invert=True)
    np.testing.assert_allclose(back["gyro_y"].values, log["gyro_y"].values, rtol=1e-9)
    assert apply_to(log, model_of(estimate, uncertainty=True))["u_acc_x"].values.min() > 0.0
    without = Record({n: c for n, c in log.columns.items() if n != "temperature"}, (), log.sources)
    with pytest.raises(InputError, match="no column temperature"):
        apply_to(without, model)
    hot = replace(log, columns={**log.columns, "temperature": replace(log["temperature"], values=T + 400.0)})
    (said,) = apply_to(hot, model).findings
    assert said.code == "outside_range"
    assert "temperature goes from 112 to 182 degC" not in said.message  # 385 to 455 K less 273.15
    assert "the calibration holds from -20 to 60" in said.message


def test_a_sweep_takes_the_change_of_an_output_off():
    estimate, _ = over_temperature()
    estimate = replace(
        estimate,
        names=("gyro_x", "gyro_x_T1", "gyro_x_hyst"),
        units=("deg/s", "deg/s/K", "deg/s"),
        values=np.array([0.5, 0.01, 0.2]),
        covariance=np.diag([1e-4, 1e-8, 1e-4]),
        dof=np.full(3, 9.0),
        result={"reference_degC": 25.0, "curves": [{"name": "gyro_x", "terms": 2}]},
    )
    warm, gyro = np.array([25.0, 45.0]), np.array([1.0, 2.0])
    columns = [("gyro_x", parse_unit("deg/s"), gyro), ("temperature", parse_unit("degC"), warm)]
    log = record_of(columns, np.arange(2.0))
    corrected = apply_to(log, model_of(estimate, uncertainty=True))
    np.testing.assert_allclose(corrected["gyro_x"].values, [1.0, 1.8], rtol=1e-14)
    np.testing.assert_allclose(corrected["u_gyro_x"].values, [0.0, 20 * 1e-4], rtol=1e-9)
    assert "gyro_x_hyst: not applied" in worth_knowing(estimate)[0].message


def test_a_recording_far_from_the_temperature_of_the_calibration_is_said():
    model = instrument(5)
    estimate = replace(
        estimate_of(model, np.random.default_rng(1)),
        conditions={"temperature": {"value": 23.0, "u": 0.5, "unit": "degC"}},
    )
    f = np.zeros((3, 3))
    near = outputs(model, f, f, temperature=np.array([20.0, 25.0, 29.0]))
    far = outputs(model, f, f, temperature=np.array([20.0, 25.0, 31.0]))
    assert apply_to(near, model_of(estimate)).findings == ()
    assert [each.code for each in apply_to(far, model_of(estimate)).findings] == ["outside_range"]
    assert isinstance(imu_model(estimate), ImuModel)
