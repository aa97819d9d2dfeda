"""Encoders off their centre on the shipped table: named, and in u or the end of the verdict, at any size."""

from dataclasses import replace

import numpy as np
import pytest
from recordings import shipped

from inercal.foundation.findings import Status
from inercal.foundation.records.record import Record
from inercal.systems.imu.aided.calibration import calibrate_aided
from rows import for_each

JOINTS = ("phi1", "phi2")


@pytest.fixture(scope="module")
def table():
    record, settings = shipped("table")
    return record, settings, calibrate_aided(record, settings, settings.method).estimate


def spoiled(record: Record, joint: str, degrees: float, order: int) -> Record:
    """The record with an angle in error by so much, ``order`` times in a turn."""
    column = record.columns[joint]
    angle = column.values * column.unit.factor
    wrong = column.values + np.radians(degrees) / column.unit.factor * np.sin(order * angle + 0.3)
    return replace(record, columns={**record.columns, joint: replace(column, values=wrong)})


def judged(table, joint, degrees, order):
    """Named with its joint; where it is ok, no value is off by more than 2 u (rms) and none by more than 5."""
    record, settings, sound = table
    estimate = calibrate_aided(spoiled(record, joint, degrees, order), settings, settings.method).estimate
    times = "once" if order == 1 else "twice"
    said = [
        f for f in estimate.findings if f"the angles {joint} are wrong" in f.message and times in f.message
    ]
    assert said, (joint, degrees, order)
    if estimate.status is Status.OK:
        assert [finding.code for finding in said] == ["unmodelled"]
        shifts = (estimate.values - sound.values) / estimate.u
        assert np.sqrt(np.mean(shifts**2)) < 2.0
        assert np.max(np.abs(shifts)) < 5.0
    else:
        assert estimate.status is Status.INCONSISTENT
        assert [finding.code for finding in said] == ["contradiction"]


def test_the_encoder_that_once_ended_in_a_traceback_is_named(table):
    judged(table, "phi1", 0.05, 1)


@pytest.mark.slow
def test_an_encoder_hardly_off_its_centre_is_named(table):
    for joint in JOINTS:
        judged(table, joint, 0.02, 1)


@pytest.mark.slow
def test_an_encoder_whose_error_comes_twice_in_a_turn_is_named(table):
    for joint in JOINTS:
        judged(table, joint, 5.0, 2)


@pytest.mark.campaign
@for_each("degrees", [0.02, 0.05, 0.2, 1.0, 5.0])
def test_an_encoder_in_error_is_named_at_every_size(table, degrees):
    for joint in JOINTS:
        judged(table, joint, degrees, 1)
        if degrees > 0.02:
            judged(table, joint, degrees, 2)
