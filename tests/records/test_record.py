"""Records: labelled columns, triads, SI units, the way to xarray, and the codes of findings."""

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import CODES, Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit

SOURCE = Source("run7.csv", "0" * 64)
T = 0.01 * np.arange(5)


def column(name, unit, values=None, t=T, source=SOURCE):
    values = np.arange(len(t), dtype=float) if values is None else np.asarray(values, dtype=float)
    return Column(name, parse_unit(unit), values, t, source)


def record(*columns, **more):
    return Record({each.name: each for each in columns}, sources=(SOURCE,), **more)


def imu(unit="m/s^2", t=T):
    return record(*(column(f"acc_{axis}", unit, k + np.arange(len(t)), t) for k, axis in enumerate("xyz")))


def test_columns_by_name():
    r = imu()
    assert "acc_x" in r
    assert "gyro_x" not in r
    assert r["acc_y"].values.tolist() == [1, 2, 3, 4, 5]
    with pytest.raises(RecordError, match=r"run7\.csv: no column gyro_x, found acc_x, acc_y, acc_z"):
        r["gyro_x"]
    with pytest.raises(RecordError, match="record: no column t, found none"):
        Record({})["t"]


@pytest.mark.parametrize(
    ("unit", "si"),
    [("m/s^2", 1.0), ("g", 9.80665), ("mg", 9.80665e-3), ("deg/h", 4.84813681e-6), ("arcmin", 2.90888209e-4)],
)
def test_si(unit, si):
    np.testing.assert_allclose(column("acc_x", unit).si(), si * np.arange(5.0), rtol=1e-8)


def test_temperatures_have_another_zero():
    np.testing.assert_allclose(column("temperature", "K", [273.15, 300.0], T[:2]).si(), [0.0, 26.85])
    np.testing.assert_allclose(
        column("temperature", "degF", [32.0, 212.0], T[:2]).si(), [0.0, 100.0], atol=1e-12
    )


@pytest.mark.parametrize("unit", ["count", "V"])
def test_raw_outputs_are_no_physical_values(unit):
    with pytest.raises(RecordError, match=rf"acc_x is in {unit}, expected physical units"):
        column("acc_x", unit).si()


def test_triad():
    triad = imu("count").triad("acc")
    assert (triad.sensor, triad.unit.symbol) == ("acc", "count")
    np.testing.assert_array_equal(triad.values, np.arange(5)[:, None] + np.arange(3))
    assert triad.t is T
    assert triad.rate == pytest.approx(100.0)
    assert triad.source is SOURCE


def test_rate_is_that_of_most_samples():
    t = np.array([0.0, 0.01, 0.02, 7.0, 7.01, 7.02])
    assert imu(t=t).triad("acc").rate == pytest.approx(100.0)


def test_triads_that_are_none():
    r = imu()
    with pytest.raises(RecordError, match="no column gyro_x"):
        r.triad("gyro")
    other_clock = record(r["acc_x"], r["acc_y"], column("acc_z", "m/s^2", t=T.copy()))
    other_unit = record(r["acc_x"], column("acc_y", "mg"), r["acc_z"])
    for odd, words in (
        (other_clock, "acc_z in m/s"),
        (other_unit, "acc_y in mg has another unit or clock than acc_x"),
    ):
        with pytest.raises(RecordError, match=words):
            odd.triad("acc")


def test_frozen():
    r = imu()
    for thing, name in ((r, "columns"), (r["acc_x"], "values"), (r.triad("acc"), "t"), (SOURCE, "path")):
        with pytest.raises(FrozenInstanceError):
            setattr(thing, name, None)


# The way to xarray.


def test_to_xarray_with_one_clock():
    r = record(
        *imu("mg").columns.values(), column("temperature", "degC"), findings=(Finding("gap", "1 gap"),)
    )
    data = r.to_xarray()
    assert dict(data.sizes) == {"time": 5}
    np.testing.assert_array_equal(data["time"], T)
    assert data["time"].attrs == {"units": "s"}
    for name, each in r.columns.items():
        np.testing.assert_array_equal(data[name], each.values)
        assert data[name].attrs == {
            "units": each.unit.symbol, "sensor": each.sensor, "axis": each.axis, "frame": "b",
            "source": "run7.csv", "sha256": "0" * 64,
        }  # fmt: skip
    assert data.attrs["findings"] == "gap: 1 gap"


def test_to_xarray_and_back():
    """Everything a column holds is in the data set: names, values, times, units, labels, sources."""
    slow = 0.05 * np.arange(3)
    other = Source("gyro.csv", "f" * 64)
    r = record(*imu().columns.values(), column("gyro_x", "deg/s", t=slow, source=other))
    data = r.to_xarray()
    assert dict(data.sizes) == {"time_acc": 5, "time_gyro": 3}
    back = {}
    for name in data.data_vars:
        a = data[name]
        source = Source(a.attrs["source"], a.attrs["sha256"])
        back[name] = Column(
            name, parse_unit(a.attrs["units"]), a.values,
            data[a.dims[0]].values, source, a.attrs["frame"],
        )  # fmt: skip
    assert list(back) == list(r.columns)
    for name, each in r.columns.items():
        np.testing.assert_array_equal(back[name].values, each.values)
        np.testing.assert_array_equal(back[name].t, each.t)
        assert (data[name].attrs["sensor"], data[name].attrs["axis"]) == (each.sensor, each.axis)
        for label in ("name", "sensor", "axis", "unit", "source", "frame"):
            assert getattr(back[name], label) == getattr(each, label)


def test_to_xarray_with_several_clocks_of_one_sensor():
    """Axes in files of their own, each with its clock."""
    clocks = [0.01 * np.arange(n) for n in (5, 4, 3)]
    r = record(*(column(f"acc_{axis}", "g", t=t) for axis, t in zip("xyz", clocks, strict=True)))
    data = r.to_xarray()
    assert dict(data.sizes) == {"time_acc": 5, "time_acc_2": 4, "time_acc_3": 3}
    assert data["acc_z"].dims == ("time_acc_3",)


def test_to_xarray_of_nothing():
    assert dict(Record({}).to_xarray().sizes) == {}


# Findings.

CONTRACT = {
    "gap", "duplicate_time", "backward_time", "nan", "bad_row", "truncated", "saturation", "rate_change",
    "unit_suspect", "sign_suspect", "channel_swap", "stuck_encoder", "command_shift", "wrap_2pi", "at_prior",
    "gimbal_lock", "gyro_missing", "outlier",
}  # fmt: skip


def test_codes_of_the_contract():
    """interfaces.md, "Finding codes"; more may be added, none may go."""
    assert CODES.keys() >= CONTRACT
    assert all(len(each.meaning) > 10 for each in CODES.values())
    for code in CONTRACT:
        assert Finding(code, "").code == code


def test_a_code_outside_the_table_is_refused():
    with pytest.raises(ValueError, match="unknown finding code 'comet'"):
        Finding("comet", "a comet was seen")
