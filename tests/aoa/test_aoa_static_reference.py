"""Sensors fitted to reference angles at rests alone: scale, bias and axis, with the error of the reference in u."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, G, study

from inercal.foundation.errors import RecordError
from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.reference.static_fit import at_rests_alone, static_fit
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure

ANGLES = np.arange(-20.0, 45.0, 7.0) * DEG
ROWS = 50
TRUE = {"S": (1.0005, 0.9992, 1.0), "b": (1e-3, -2e-3, 5e-4), "dlambda": (2e-4, 1e-3, -3e-4)}


def rests(rng, error, noise=1e-4 * G, alone=True):
    """A recording of rests at known angles, between which nothing is known of the reference."""
    of = study()
    acc, reference = [], []
    for theta in ANGLES:
        turned = of.layout.angle + TRUE["dlambda"]
        force = G * np.sin(theta - turned)
        read = np.array(TRUE["S"]) * (force + TRUE["b"])
        acc.append(read + noise * rng.standard_normal((ROWS, 3)))
        angle = theta + error * rng.standard_normal()
        row = np.full(ROWS, np.nan)
        row[ROWS // 2 if alone else slice(5, ROWS - 5)] = angle
        reference.append(row)
    n = len(ANGLES) * ROWS
    made = plain(np.arange(n) / 50.0, np.concatenate(acc), 1e-4 * rng.standard_normal(n))
    return of, replace(made, reference=np.concatenate(reference))


POINTS = [(k * ROWS, (k + 1) * ROWS) for k in range(len(ANGLES))]


@pytest.mark.parametrize("alone", [True, False])
def test_errors_of_the_sensors_come_back(alone):
    of, made = rests(np.random.default_rng(1), 0.0, 1e-7, alone)
    found = static_fit(made, of, POINTS)
    for kind, values in TRUE.items():
        for k, value in enumerate(values, start=1):
            assert found[f"{kind}_{k}"].value == pytest.approx(value, abs=2e-5)
    assert {"dr_1", "zo_2", "k_g", "tau"} <= set(found.unseen)
    assert not {"S_1", "b_2", "dlambda_3"} & set(found.unseen)
    assert found.reference_noise < 1e-5 * DEG


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.0, 0.005 * DEG])
def test_uncertainties_are_those_of_many_draws(error):
    """Readings of the reference off by 0.005 deg, one in each rest, or by nothing: mean of error^2/u^2 of nine
    coefficients over 40 draws; with some twelve degrees of freedom behind u its mean is 12/10, and coefficients of one
    draw go together, so that it scatters by sqrt(2 / 40 / 3) = 0.13."""
    squares = []
    for seed in range(40):
        of, made = rests(np.random.default_rng([7, seed]), error)
        found = static_fit(made, of, POINTS)
        squares.append(
            [
                (found[f"{kind}_{k}"].value - values[k - 1]) ** 2 / found[f"{kind}_{k}"].u ** 2
                for kind, values in TRUE.items()
                for k in (1, 2, 3)
            ]
        )
    assert 0.6 < np.mean(squares) < 1.2 + 4.0 * 0.13


@pytest.mark.slow
def test_the_error_of_the_reference_is_found():
    found = [
        static_fit(*reversed(rests(np.random.default_rng([9, seed]), 0.02 * DEG)), POINTS).reference_noise
        for seed in range(20)
    ]
    assert math.sqrt(np.mean(np.square(found))) == pytest.approx(0.02 * DEG, rel=0.25)


def test_a_reference_that_moves_is_none_of_rests():
    of, made = rests(np.random.default_rng(2), 0.0)
    assert len(at_rests_alone(made)) == len(ANGLES)
    moving = np.where(np.isfinite(made.reference), made.reference, 0.001 * made.t)
    assert at_rests_alone(replace(made, reference=moving)) == []
    assert at_rests_alone(plain(made.t, made.acc, made.gyro)) == []
    few = replace(made, reference=np.where(made.t < 3.0, made.reference, np.nan))
    with pytest.raises(RecordError, match="found 3 rests with a reference angle, expected 4 or more"):
        static_fit(few, of, POINTS)


@pytest.mark.slow
def test_a_measurement_with_an_inclinometer_at_its_points():
    """One reading in each point: the axis that is off by 0.06 deg is found and put into the result for the next run."""
    plan = MotionPlan(
        "pitch-pause", sample_rate=200.0, first=-20 * DEG, last=40 * DEG, step=10 * DEG, pause=3.0, move=1.5
    )
    of = study(motion=plan)
    true = replace(of, disturbances=Disturbances(axis_errors=(0.0, 0.06 * DEG, 0.0)))
    told = simulate(true, np.random.default_rng(3))
    reference = np.full(len(told.theta), np.nan)
    for number in range(1, 8):
        row = int(np.median(np.flatnonzero(told.recording.point == number)))
        reference[row] = told.theta[row]
    measured = measure(to_record(replace(told.recording, reference=reference), of), of)
    axis = measured.verified["dlambda_2"]
    assert axis.value == pytest.approx(0.06 * DEG, abs=3.0 * axis.u)
    assert axis.u < 0.01 * DEG
    assert "verified" in measured.estimate.result
