"""A simulated test by small steps: up from level, down through it, and back, as often as the study says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.plans import Plan
from inercal.systems.turntable.positions.simulate import simulate
from inercal.systems.turntable.settings import StepTest, TurntableSettings
from inercal.systems.turntable.steps.calibration import check_step_test


def simulate_step_test(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """Tilt the table by the steps of the study and record the accelerometers.

    Parameters
    ----------
    settings : TurntableSettings
        The dead zone and hysteresis are those of its disturbances.
    rng : Generator

    Returns
    -------
    Record
        As `inercal.systems.turntable.positions.simulate.simulate` gives it.

    Raises
    ------
    StudyError
        An instrument that is no accelerometer, or too many samples.
    """
    check_step_test(settings)
    test, joints = settings.step_test, settings.chain.joints
    assert test is not None
    tilts = sequence(test)
    angles = np.tile(test.at.of(joints), (len(tilts), 1))
    angles[:, joints.index(test.joint)] += tilts
    return simulate(replace(settings, plan=Plan("steps", angles)), rng)


def sequence(test: StepTest) -> Array:
    """Tilts (n,) [rad] from level, in the order taken."""
    count = max(1, round(test.largest / test.step))
    up, down = np.arange(count + 1), np.arange(count - 1, -count - 1, -1)
    once = np.concatenate([up, down, np.arange(-count + 1, 1)])
    return np.asarray(test.step * np.concatenate([once, *[once[1:]] * (test.cycles - 1)]), dtype=float)
