"""Angles and points as columns of files."""

import math
from dataclasses import replace

import h5py
import numpy as np
import pyarrow.parquet
import pytest
from scipy.io import netcdf_file
from sting_study import DEG, study

from inercal.foundation.records.write import SUFFIXES, write_record
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.alarm import AlarmLimits
from inercal.systems.aoa.angles import Angles, stated_roll
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.result.columns import angles_record, beyond_limits, columns, points_record, rows
from inercal.systems.aoa.result.points import points
from inercal.systems.aoa.result.systematic import by_fusion, by_methods
from inercal.systems.aoa.settings import Attitude, Methods
from inercal.systems.aoa.simulate import simulate

PAUSES = MotionPlan(
    "pitch-pause", sample_rate=200.0, first=0.0, last=20.0 * DEG, step=10.0 * DEG, move=1.0, pause=2.0
)


def degrees(value, u=0.0):
    return Quantity(value * DEG, u * DEG, parse_unit("deg"), "")


@pytest.fixture(scope="module")
def measured():
    settings = study(motion=PAUSES)
    made = simulate(settings, np.random.default_rng(4)).recording
    t = made.t.copy()
    t[100] = t[98]  # a stamp that goes back: the row is left out
    made = replace(made, t=t)
    of = problem(settings)
    return settings, made, by_fusion(made, settings, of, estimate(made, of))


def test_columns_are_those_of_the_contract(measured, tmp_path):
    settings, made, angles = measured
    path = tmp_path / "angles.csv"
    write_record(angles_record(made, angles, settings), path)
    lines = path.read_text().splitlines()
    assert lines[0] == "t [s],theta [deg],u_theta [deg],rate [deg/s],nis [1],status [1]"
    assert len(lines) == 1 + len(made.t)
    # a row that was left out has its stamp and its status, and no numbers
    assert lines[1 + 100] == f"{float(made.t[98])!r},,,,,2.0"
    assert [line.rsplit(",", 1)[1] for line in lines[1:100]] == ["0.0"] * 99


def columns_of(path):
    """Columns of a file by the name it gives them, read by what is not inercal's."""
    match path.suffix:
        case ".csv":
            heads = path.read_text().splitlines()[0].split(",")
            return dict(zip(heads, np.genfromtxt(path, delimiter=",", skip_header=1).T, strict=True))
        case ".npz":
            return dict(np.load(path))
        case ".parquet":
            table = pyarrow.parquet.read_table(path)
            return {name: np.array(table[name].to_pylist(), dtype=float) for name in table.column_names}
        case ".nc":
            with netcdf_file(path, mmap=False) as file:
                return {f"{name} [{each.units.decode()}]": each[:] for name, each in file.variables.items()}
        case _:
            with h5py.File(path) as file:
                return {f"{name} [{each.attrs['units']}]": each[:] for name, each in file.items()}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_holds_the_angles(measured, tmp_path, suffix):
    settings, made, angles = measured
    write_record(angles_record(made, angles, settings), path := tmp_path / f"angles{suffix}")
    found = columns_of(path)
    assert set(found) == {
        "t [s]", "theta [deg]", "u_theta [deg]", "rate [deg/s]", "nis [1]", "status [1]",
    }  # fmt: skip
    np.testing.assert_array_equal(found["t [s]"], made.t)
    for name, si in (
        ("theta [deg]", angles.theta),
        ("u_theta [deg]", angles.u),
        ("rate [deg/s]", angles.rate),
    ):
        np.testing.assert_allclose(found[name] * DEG, si, rtol=1e-14)


def test_alpha_and_beta_are_there_only_where_the_study_states_the_flow(measured):
    settings, made, angles = measured
    rolled = replace(settings, attitude=Attitude(roll=degrees(20.0, 0.1)))
    record = angles_record(made, angles, rolled)
    assert list(record.columns) == [
        "theta", "u_theta", "rate", "nis", "status", "alpha", "u_alpha", "beta", "u_beta",
    ]  # fmt: skip
    theta, phi = angles.theta, 20.0 * DEG
    np.testing.assert_allclose(record["alpha"].si(), np.arctan2(np.sin(theta) * math.cos(phi), np.cos(theta)))
    np.testing.assert_allclose(record["beta"].si(), np.arcsin(np.sin(theta) * math.sin(phi)))
    assert not any(name in angles_record(made, angles, settings) for name in ("alpha", "beta"))


def test_the_uncertainty_of_a_stated_roll_is_in_the_columns_once(measured):
    """Theta found under a roll of 20 deg that may be off by 1 deg, with and without the roll's part put in before."""
    settings, made, angles = measured
    attitude = Attitude(roll=degrees(20.0, 1.0))
    rolled = replace(settings, attitude=attitude)
    whole = stated_roll(angles, attitude)
    record = angles_record(made, whole, rolled)
    np.testing.assert_allclose(record["u_theta"].si(), whole.u, rtol=1e-12)
    known = np.isfinite(angles.theta)
    # at 20 deg pitch the roll leaves 0.11 deg per degree; at 0 nothing
    level, s, c = math.cos(20.0 * DEG), np.sin(angles.theta), np.cos(angles.theta)
    by = level * math.sin(20.0 * DEG) * s * c / (c**2 + (level * s) ** 2)
    np.testing.assert_allclose(whole.u[known], np.hypot(angles.u, by * DEG)[known], rtol=1e-12)
    for name in record.columns:
        np.testing.assert_array_equal(record[name].values, angles_record(made, angles, rolled)[name].values)
    exact = Attitude(roll=degrees(20.0))
    assert stated_roll(angles, exact) is angles
    tracked = replace(angles, roll=np.zeros(len(made.t)), roll_u=np.zeros(len(made.t)))
    assert stated_roll(tracked, attitude) is tracked


def test_a_stream_tells_the_rows_of_a_file(measured):
    settings, _, angles = measured
    whole = rows(angles, settings)
    columns_of = (angles.theta, angles.u, angles.rate, angles.rate_u)
    one = [
        rows(Angles("", *(each[k : k + 1] for each in columns_of), nis=angles.nis[k : k + 1]), settings)[0]
        for k in (50, 100, 300)
    ]
    np.testing.assert_array_equal(whole[[50, 100, 300]], one)
    assert whole.shape[1] == len(columns(settings)) == 5


def test_rows_beyond_the_limits_have_an_alarm(measured):
    """Of pitch, or of alpha where the study states how the model lies: 10 deg of pitch are 15 deg of it."""
    settings, made, angles = measured
    limits = AlarmLimits(lowest=-1.0 * DEG, highest=14.0 * DEG)
    watched = replace(settings, alarm=limits)
    steep = replace(watched, attitude=Attitude(upwash=degrees(5.0)))
    for chosen, name in ((watched, "theta"), (steep, "alpha")):
        record = angles_record(made, angles, chosen)
        known = np.isfinite(angles.theta)
        np.testing.assert_array_equal(
            record["alarm"].values[known], 1.0 * (record[name].values[known] > 14.0)
        )
        assert np.isnan(record["alarm"].values[~known]).all()
        (said,) = beyond_limits(angles, made.t, chosen)
        assert f"{name} is 14" in said.message
        assert f"so are {int((record['alarm'].values == 1.0).sum())} rows of {len(made.t)}" in said.message
    assert beyond_limits(angles, made.t, replace(settings, alarm=AlarmLimits(highest=1.0))) == []
    assert (
        "below the study's 19 deg"
        in beyond_limits(angles, made.t, replace(settings, alarm=AlarmLimits(lowest=19.0 * DEG)))[0].message
    )


def test_the_paper_has_no_nis_and_no_status(measured):
    settings, made, _ = measured
    record = angles_record(made, by_methods(made, settings, Methods()), settings)
    assert np.isnan(record["nis"].values).all()
    assert np.isnan(record["status"].values).all()


def test_points_keep_their_numbers(measured, tmp_path):
    settings, made, angles = measured
    found = points(made, angles, settings)
    record = points_record(found, made, settings)
    np.testing.assert_array_equal(record["point"].values, [each.number for each in found])
    np.testing.assert_allclose(record["theta"].values, [0.0, 10.0, 20.0], atol=0.05)
    path = tmp_path / "points.csv"
    write_record(record, path)
    head = path.read_text().splitlines()[0]
    assert head.startswith(
        "t [s],point [1],trigger [1],last_trigger [1],begin [s],end [s],rows [1],theta [deg],u_theta"
    )
    for suffix in SUFFIXES:
        write_record(record, tmp_path / f"points{suffix}")


def test_no_points_are_an_empty_record(measured):
    settings, made, _ = measured
    assert len(points_record((), made, settings)["theta"].values) == 0
