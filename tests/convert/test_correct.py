"""A calibration in use: what it cannot do is said, and a missing value spoils no more than it must."""

from types import SimpleNamespace

import numpy as np
import pytest

from inercal.faces.convert.correct import ImuModel, imu_model, not_applied
from inercal.faces.convert.correction import apply_to
from inercal.foundation.errors import InputError
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from rows import for_each

TRIAD = TriadModel(np.array([2.0, 3.0, 4.0]), np.eye(3) + 0.01 * np.triu(np.ones((3, 3)), 1), np.ones(3))


def estimate(units=None, command="calibrate imu", **values):
    """As much of an estimate as is looked at."""
    values = {f"{name}_{axis}": 1.0 for name in ("K1", "S") for axis in "xyz"} | values
    return SimpleNamespace(
        command=command,
        names=tuple(values),
        values=np.array(list(values.values())),
        parameters={name: SimpleNamespace(value=value) for name, value in values.items()},
        conditions={},
        result={"unit": {} if units is None else units},
    )


@pytest.mark.parametrize(("g_sensitivity", "lost"), [(0.0, False), (1e-3, True)])
def test_a_missing_specific_force_spoils_the_rate_only_where_it_takes_part(g_sensitivity, lost):
    model = ImuModel(TRIAD, TRIAD, np.full((3, 3), g_sensitivity), {})
    f, omega = model.correct(np.array([[np.nan, 0.0, 1.0]]), np.array([[1.0, 2.0, 3.0]]))
    assert np.isnan(f).any()
    assert np.isnan(omega).all() == lost
    _, gyro = model.indicate(np.array([[np.nan, 0.0, 1.0]]), np.array([[1.0, 2.0, 3.0]]))
    assert np.isnan(gyro).all() == lost


def test_a_sample_alone_has_the_digits_that_it_has_among_others():
    """So that a stream gives what a file gives; the matrix product of NumPy does not."""
    rng = np.random.default_rng(1)
    triads = [
        TriadModel(
            rng.normal(400, 20, 3), np.eye(3) + 0.01 * rng.standard_normal((3, 3)), rng.normal(3e4, 9, 3)
        )
        for _ in range(2)
    ]
    model = ImuModel(*triads, 0.3 * rng.standard_normal((3, 3)), {})
    acc, gyro = 3e4 + 500 * rng.standard_normal((2, 1000, 3))
    for work in (model.correct, model.indicate):
        together = work(acc, gyro)
        alone = [work(a, w) for a, w in zip(acc, gyro, strict=True)]
        for i in range(2):
            np.testing.assert_array_equal([pair[i] for pair in alone], together[i])


@for_each(
    ("bad", "words"),
    [
        (estimate(K1_y=0.0), "accelerometers cannot be inverted"),
        (estimate(S_x=0.0, S_y=0.0, S_z=0.0), "gyro cannot be inverted"),
        (estimate(K1_x=1e-320, K1_y=1e-320, K1_z=1e-320), "accelerometers cannot be inverted"),
        (estimate(S_x=1e300, T_xy=1e300), "gyro cannot be inverted"),
        (estimate(K1_x=np.nan), "expected the coefficients of an IMU"),
        (estimate(units=["count"]), "expected the coefficients of an IMU"),
        (estimate(units={"acc": "bananas"}), "bananas"),
    ],
)
def test_a_calibration_that_cannot_be_used_is_named(bad, words):
    with pytest.raises(InputError, match=rf"^cal\.json: .*{words}"):
        imu_model(bad, "cal.json")


def test_a_calibration_of_one_axis_is_none_of_an_imu():
    bad = estimate()
    del bad.parameters["K1_y"]
    with pytest.raises(InputError, match="expected the coefficients of an IMU"):
        imu_model(bad)


def test_a_drift_of_the_bias_is_not_applied_and_said():
    """It goes with the time of one recording alone; the bias that is applied is that at its t0."""
    drifting = estimate(D_F_x=0.5, D_R_x=1e-3)
    drifting.result["bias_time_s"] = 250.25
    (finding,) = not_applied(drifting, "cal.json")
    assert (finding.code, finding.where) == ("not_held", "cal.json")
    assert "D_F is the bias at 250.25 s of that" in finding.message
    assert not_applied(estimate(D_F_x=0.5)) == ()
    plain, moved = imu_model(estimate(D_F_x=0.5)), imu_model(drifting)
    f, omega = np.ones((2, 4, 3))
    np.testing.assert_array_equal(moved.correct(f, omega), plain.correct(f, omega))


@pytest.mark.parametrize("command", ["compare", "temperature"])
def test_what_is_no_calibration_is_not_applied(command):
    """A difference of scale factors is no scale factor."""
    with pytest.raises(InputError, match=f"a result of `inercal {command}`, expected a calibration"):
        imu_model(estimate(command=command), "c.json")


def test_a_recording_in_another_unit_of_the_same_kind_is_corrected_alike():
    """An instrument calibrated in mg and deg/s, and its outputs in m/s^2 and rad/s: the same true values."""
    model = ImuModel(TRIAD, TRIAD, np.zeros((3, 3)), {"acc": "mg", "gyro": "deg/s"})
    rng = np.random.default_rng(3)
    t, source = np.arange(5) / 100.0, Source("log.csv", "")

    def recorded(acc_unit, gyro_unit, acc, gyro):
        units = {"acc": (acc_unit, acc), "gyro": (gyro_unit, gyro)}
        return Record(
            {
                f"{sensor}_{axis}": Column(
                    f"{sensor}_{axis}", parse_unit(unit), values[:, i].copy(), t, source
                )
                for sensor, (unit, values) in units.items()
                for i, axis in enumerate("xyz")
            }
        )

    acc, gyro = rng.normal(0, 500, (5, 3)), rng.normal(0, 20, (5, 3))
    same = apply_to(recorded("mg", "deg/s", acc, gyro), model)
    other = apply_to(recorded("m/s^2", "rad/s", acc * 9.80665e-3, np.radians(gyro)), model)
    for name in same.columns:
        np.testing.assert_allclose(other[name].values, same[name].values, rtol=1e-12)
    with pytest.raises(InputError, match="acc_x is in count, expected mg"):
        apply_to(recorded("count", "deg/s", acc, gyro), model)


def test_rates_beyond_those_of_the_calibration_are_said():
    """Outputs of -4 to 4 at a bias of 1 and scales of 2, 3 and 4: rates of -2.5 to 1.5, -5/3 to 1 and -1.25 to 0.75."""
    seen = estimate(D_F_x=1.0, D_F_y=1.0, D_F_z=1.0, S_x=2.0, S_y=3.0, S_z=4.0)
    seen.conditions["ranges"] = {"gyro_output": [[-4.0] * 3, [4.0] * 3]}
    seen.result["unit"] = {"acc": "m/s^2", "gyro": "rad/s"}
    turned = estimate(S_x=-2.0)
    turned.conditions["ranges"] = {"rate_about_an_axis_rad_s": [[-2.0, -1.0, -1.0], [1.0, 2.0, 2.0]]}
    np.testing.assert_allclose(imu_model(seen).rates, [[-2.5, -5 / 3, -1.25], [1.5, 1.0, 0.75]])
    np.testing.assert_array_equal(imu_model(turned).rates, [[-2.0, -1.0, -1.0], [1.0, 2.0, 2.0]])
    assert imu_model(estimate()).rates is None
    unit = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}
    t, source = np.arange(2.0), Source("log.csv", "")

    def said(most):
        columns = {
            f"{sensor}_{axis}": Column(f"{sensor}_{axis}", unit[sensor], np.array([0.0, most]), t, source)
            for sensor in unit
            for axis in "xyz"
        }
        return [each.message.split()[0] for each in apply_to(Record(columns), imu_model(seen)).findings]

    assert said(4.0) == []
    assert said(5.0) == ["gyro_x", "gyro_y", "gyro_z"]


@pytest.mark.parametrize("bad", [{"gyro_output": 1.0}, {"gyro_output": [["a"] * 3] * 2}, 7])
def test_a_range_that_is_none_is_named(bad):
    damaged = estimate()
    damaged.conditions["ranges"] = bad
    with pytest.raises(InputError, match=r"^cal\.json: conditions\.ranges\.\w+ is not two values"):
        imu_model(damaged, "cal.json")
