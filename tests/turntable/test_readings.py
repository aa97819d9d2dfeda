"""Readings of a record: dwells averaged, positions found by number or by angle, numbers that are missing."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turntable_studies import DEG_H, TUMBLE, WHEEL_X, study, table

from inercal.foundation.errors import RecordError
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.readings import readings
from inercal.systems.turntable.simulate import simulate_positions

JOINTS = ("phi1", "phi2")
SOURCE = Source("test.csv", "")


def record_of(angles_deg, y, position=None, unit="deg/h", channels=("y_x",)):
    """A record of angles (n, 2) [deg] and outputs (n, c)."""
    t = np.arange(len(angles_deg)) * 0.1
    columns = {
        name: Column(name, parse_unit("deg"), np.asarray(angles_deg)[:, k], t, SOURCE)
        for k, name in enumerate(JOINTS)
    }
    for k, name in enumerate(channels):
        values = np.asarray(y, dtype=float).reshape(len(t), -1)[:, k]
        columns[name] = Column(name, parse_unit(unit), values, t, SOURCE)
    if position is not None:
        columns["position"] = Column("position", parse_unit("1"), position, t, SOURCE)
    return Record(columns, sources=(SOURCE,))


def test_sampled_dwells_give_the_same_readings_as_one_row_each():
    """Without noise and errors the mean of a dwell is the reading."""
    rows = readings(simulate_positions(study(TUMBLE), np.random.default_rng(1)), JOINTS, "gyrowheel")
    sampled = simulate_positions(study(TUMBLE, dwell=4.0, sample_rate=10.0), np.random.default_rng(1))
    found = readings(sampled, JOINTS, "gyrowheel")
    assert_allclose(found.y, rows.y, rtol=1e-12)
    assert_allclose(found.angles, rows.angles, atol=1e-12)
    assert set(found.samples) == {40}
    assert set(rows.samples) == {1}
    assert found.channels == ("y_x", "y_y")
    assert np.isnan(rows.u_mean).all()


def test_the_scatter_within_the_dwells_tells_the_noise_of_a_mean():
    """White noise: standard deviation over the root of the number of samples (relative error 1/sqrt(2 dof))."""
    settings = study(TUMBLE, dwell=20.0, sample_rate=10.0, noise=0.05 * DEG_H)
    found = readings(simulate_positions(settings, np.random.default_rng(2)), JOINTS, "gyrowheel")
    assert_allclose(found.u_mean, 0.05 * DEG_H, rtol=4.5 / np.sqrt(2 * 24 * 199))


def without_numbers(record):
    return replace(record, columns={k: v for k, v in record.columns.items() if k != "position"})


def test_positions_are_found_by_angle_where_they_are_not_numbered():
    """Neighbours in the 24-position tumble differ by 45 deg or more, but for repeated attitudes."""
    sampled = simulate_positions(study(TUMBLE, dwell=4.0, sample_rate=10.0), np.random.default_rng(1))
    by_number = readings(sampled, JOINTS, "gyrowheel")
    by_angle = readings(without_numbers(sampled), JOINTS, "gyrowheel")
    assert_allclose(by_angle.y, by_number.y)
    one_row = simulate_positions(study(TUMBLE), np.random.default_rng(1))
    assert len(readings(without_numbers(one_row), JOINTS, "gyrowheel").y) == 24


@pytest.mark.parametrize("speed", [0.01, 0.2, 5.0])
def test_the_way_between_positions_is_left_out(speed):
    """Also where the table turns so slowly that neighbouring samples hardly differ ([deg] per sample)."""
    stays = [np.full(8000, angle) for angle in (0.0, 10.0, 30.0, 60.0)]
    ways = [np.arange(a + speed, b, speed) for a, b in ((0.0, 10.0), (10.0, 30.0), (30.0, 60.0))]
    phi1 = np.concatenate([stays[0], ways[0], stays[1], ways[1], stays[2], ways[2], stays[3]])
    angles = np.stack([phi1, np.zeros_like(phi1)], axis=-1)
    found = readings(record_of(angles, phi1), JOINTS, "gyrowheel")
    assert_allclose(np.degrees(found.angles[:, 0]), [0.0, 10.0, 30.0, 60.0], atol=2e-3)
    assert_allclose(found.y[:, 0] / DEG_H, [0.0, 10.0, 30.0, 60.0], atol=2e-3)


def turn(start, stop, rows, how):
    """Angles [deg] of a turn, at one rate or at a rate that grows and falls as a cosine, without its ends."""
    part = np.arange(1, rows) / rows
    return start + (stop - start) * (part if how == "linear" else 0.5 - 0.5 * np.cos(np.pi * part))


@pytest.mark.parametrize("how", ["linear", "cosine"])
@pytest.mark.parametrize("rows", [4, 40, 200])
def test_a_stay_that_is_left_out_as_too_short_is_named(how, rows):
    """The table waits a third of the usual time at 20 deg: that is said, and nothing of its turns; encoders of 2
    arcsec."""
    ways = turn(0.0, 20.0, rows, how), turn(20.0, 60.0, rows, how)
    parts = [np.full(300, 0.0), ways[0], np.full(100, 20.0), ways[1], np.full(300, 60.0)]
    phi1 = np.concatenate(parts) + np.random.default_rng(20261122).normal(
        0.0, 2.0 / 3600.0, sum(map(len, parts))
    )
    angles = np.stack([phi1, np.zeros_like(phi1)], axis=-1)
    found = readings(record_of(angles, phi1), JOINTS, "gyrowheel")
    assert_allclose(np.degrees(found.angles[:, 0]), [0.0, 60.0], atol=2e-3)
    (said,) = found.findings
    assert said.code == "poor_section"
    assert said.message.startswith("1 stay of less than half the usual length")
    assert abs(int(said.where.removeprefix("row ")) - (300 + rows)) < 5
    numbers = np.concatenate(
        [np.full(len(part), k if k % 2 == 0 else np.nan) for k, part in enumerate(parts)]
    )
    numbered = readings(record_of(angles, phi1, numbers), JOINTS, "gyrowheel")
    assert_allclose(np.degrees(numbered.angles[:, 0]), [0.0, 20.0, 60.0], atol=2e-3)
    assert "poor_section" not in {each.code for each in numbered.findings}


@pytest.mark.parametrize("numbered", [True, False])
def test_the_noise_of_the_encoders_is_averaged_and_breaks_no_position(numbered):
    """10 arcsec on each of 1000 samples: the mean is good to 0.32 arcsec."""
    rng, arcsec = np.random.default_rng(3), 1.0 / 3600.0
    true = np.repeat(np.degrees(TUMBLE.angles), 1000, axis=0)
    position = np.repeat(np.arange(24.0), 1000) if numbered else None
    record = record_of(true + rng.normal(0.0, 10.0 * arcsec, true.shape), np.zeros(len(true)), position)
    found = readings(record, JOINTS, "gyrowheel")
    assert found.angles.shape == (24, 2)
    off = np.degrees(found.angles - TUMBLE.angles) / arcsec
    assert np.abs(off).max() < 4.5 * 10.0 / np.sqrt(1000)


@pytest.mark.parametrize("numbered", [True, False])
def test_angles_may_wrap_within_a_position(numbered):
    """Readings of 359.999 and 0.001 deg are one attitude, whose mean is 0 and not 180."""
    angles = np.array([[359.999, 10.0], [0.001, 10.0], [0.0, 370.0], [-0.001, 10.001], [90.0, 10.0]])
    position = np.array([1.0, 1, 1, 1, 2]) if numbered else None
    found = readings(record_of(angles, [1.0, 2, 3, 4, 9], position), JOINTS, "gyrowheel")
    if numbered:
        assert_allclose(found.y[:, 0] / DEG_H, [2.5, 9.0])
    else:
        assert_allclose(found.y[:, 0] / DEG_H, [2.5])
    first = np.remainder(np.degrees(found.angles[0]) + 180.0, 360.0) - 180.0
    assert_allclose(first, [-0.00025, 10.00025], atol=1e-9)


def test_a_position_that_is_taken_twice_is_two_readings():
    angles = np.repeat([[0.0, 0.0], [90.0, 0.0], [0.0, 0.0]], 5, axis=0)
    for position in (None, np.repeat([1.0, 2.0, 1.0], 5)):
        found = readings(record_of(angles, np.arange(15.0), position), JOINTS, "gyrowheel")
        assert_allclose(found.y[:, 0] / DEG_H, [2.0, 7.0, 12.0])


def test_missing_numbers_do_not_count_and_are_told():
    y = np.array([1.0, np.nan, 3.0, 10.0, 11.0, 12.0])
    found = readings(
        record_of(np.repeat([[0, 0], [90, 0]], 3, axis=0), y, np.repeat([1.0, 2.0], 3)), JOINTS, "gyrowheel"
    )
    assert_allclose(found.y[:, 0] / DEG_H, [2.0, 11.0])
    assert [finding.code for finding in found.findings] == ["nan"]
    assert "1 value" in found.findings[0].message


def test_rows_without_an_angle_or_a_number_belong_to_no_position():
    angles = np.repeat([[0.0, 0.0], [90.0, 0.0]], 4, axis=0)
    angles[1, 0] = np.nan
    position = np.repeat([1.0, 2.0], 4)
    position[6] = np.nan
    found = readings(record_of(angles, np.arange(8.0), position), JOINTS, "gyrowheel")
    assert_allclose(found.y[:, 0] / DEG_H, [5.0 / 3.0, 16.0 / 3.0])
    assert list(found.samples) == [3, 3]


def test_counts_stay_counts():
    found = readings(record_of([[0.0, 0.0]], [[7.0]], unit="count"), JOINTS, "gyrowheel")
    assert found.y[0, 0] == 7.0
    assert found.unit.dimension == "count"


def mixed():
    record = record_of([[0.0, 0.0]], [[7.0, 8.0]], channels=("y_x", "y_y"))
    column = replace(record["y_y"], unit=parse_unit("rad/s"))
    return replace(record, columns={**record.columns, "y_y": column})


@pytest.mark.parametrize(
    ("record", "says"),
    [
        (record_of([[0.0, 0.0]], [[1.0]], channels=("acc_x",)), "expected one of y_x, y_y of the gyrowheel"),
        (mixed(), "another unit"),
        (record_of([[0.0, 0.0], [1.0, 0.0]], [1.0, 2.0], np.ones(2)), "the angles change within position 1"),
        (record_of([[np.nan, 0.0]], [1.0]), "found no rows with angles"),
        (record_of([[0.0, 0.0], [90.0, 0.0]], [1.0, np.nan]), "y_x has no number at position 2 of 2"),
    ],
)
def test_a_record_that_cannot_be_read_is_refused(record, says):
    with pytest.raises(RecordError, match=says):
        readings(record, JOINTS, "gyrowheel")


def test_a_missing_joint_is_named():
    record = simulate_positions(study(TUMBLE, table(0.0), coefficients=WHEEL_X), np.random.default_rng(1))
    with pytest.raises(RecordError, match="phi3"):
        readings(record, ("phi1", "phi2", "phi3"), "gyrowheel")


def test_an_axis_that_the_table_does_not_have_is_refused():
    """Three angles read for a table of two would be another attitude."""
    record = simulate_positions(study(TUMBLE), np.random.default_rng(1))
    third = {"phi3": replace(record["phi2"], name="phi3")}
    with pytest.raises(RecordError, match="found phi3, expected phi1, phi2 alone"):
        readings(replace(record, columns=record.columns | third), JOINTS, "gyrowheel")


def test_a_rate_test_is_not_taken_for_positions():
    """A turning table has no attitude to average over."""
    record = simulate_positions(study(TUMBLE), np.random.default_rng(1))
    rate = {"rate": replace(record["phi2"], name="rate", unit=parse_unit("deg/s"))}
    with pytest.raises(RecordError, match="found the channel rate, that of a rate test"):
        readings(replace(record, columns=record.columns | rate), JOINTS, "gyrowheel")


def test_readings_without_an_angle_are_left_out_and_said():
    record = simulate_positions(study(TUMBLE), np.random.default_rng(1))
    angle = record["phi2"].values.copy()
    angle[[2, 16]] = np.nan
    changed = {"phi2": replace(record["phi2"], values=angle)}
    found = readings(replace(record, columns=record.columns | changed), JOINTS, "gyrowheel")
    assert len(found.y) == 22
    assert [(finding.code, finding.where) for finding in found.findings] == [("nan", "rows 3, 17")]
