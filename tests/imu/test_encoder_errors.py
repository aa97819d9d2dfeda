"""Encoders off their centre on the shipped table: named without a list, with what they shift, at any size."""

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
    """Named with its joint and harmonic, never ok, and where values can be used their largest shift is that said."""
    record, settings, sound = table
    estimate = calibrate_aided(spoiled(record, joint, degrees, order), settings, settings.method).estimate
    times = "once" if order == 1 else "twice"
    (finding,) = (one for one in estimate.findings if one.code == "by_place")
    assert finding.headline.startswith(f"The input {joint} errs {times} a turn"), finding.headline
    assert finding.harm
    assert estimate.status in (Status.SUSPECT, Status.INCONSISTENT)
    if estimate.status is Status.SUSPECT and not any(one.code == "unmodelled" for one in estimate.findings):
        shift = np.max(np.abs(estimate.values - sound.values) / estimate.u)
        said = abs(float(finding.items[0]["shift in u"]))
        assert 0.5 * shift < said < 2.0 * shift


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
