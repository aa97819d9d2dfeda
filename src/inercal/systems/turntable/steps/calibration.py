"""Threshold, dead zone and hysteresis of accelerometers from a test by small steps: readings, fit, evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.readings import Readings, readings
from inercal.systems.turntable.regression import FLOOR
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.steps.outcome import assemble, unobservable
from inercal.systems.turntable.steps.response import Response, Tilted, respond, senses


@short_repr
@dataclass(frozen=True, eq=False)
class StepCalibration:
    """An ``estimate``, and the evidence behind it: readings, inputs and responses of the accelerometers."""

    estimate: Estimate
    readings: Readings
    inputs: tuple[Tilted, ...] = ()
    responses: tuple[Response, ...] = ()

    @property
    def shown(self) -> Estimate:
        """The estimate in units of the field."""
        return displayed(self.estimate, self.readings.unit)


def calibrate_steps(record: Record, settings: TurntableSettings) -> StepCalibration:
    """Find threshold, dead zone and hysteresis of the accelerometers that a table tilts by small steps about level.

    Parameters
    ----------
    record : Record
        Angles of the table and ``acc_x`` .. in the order taken: a row for each step (its mean), or samples with a
        ``position`` number for each step.
    settings : TurntableSettings
        With a ``step_test``, and an instrument of kind accelerometer.

    Raises
    ------
    InputError
        The record has no angles or accelerometers, or the study does not fit it.
    """
    instrument, chain = settings.instrument, settings.chain
    check_step_test(settings)
    means = readings(record, chain.joints, instrument.kind, by_row=True)
    if instrument.noise is not None and instrument.unit.dimension != means.unit.dimension:
        raise StudyError(
            "instrument.unit",
            f"noise is stated for outputs in {instrument.unit.symbol}, and the record's are in "
            f"{means.unit.symbol}, expected the same kind of unit",
        )
    findings = [*record.findings, *means.findings]
    inputs = []
    f = -gravity_reference(settings.site.gravity) @ chain.attitude(means.angles)
    widest = float(np.ptp(f, axis=0).max())
    for channel in means.channels:
        x = f[:, "xyz".index(channel[-1])]
        if np.abs(x).max() > LIMITS.small_step or np.ptp(x) < 0.5 * widest or not widest:
            text = f"{channel} is not tilted about level by the steps and is left out"
            findings.append(Finding("weak_term", text))
            continue
        inputs.append(_tilted(channel, x, means, settings))
    fewest = LIMITS.fewest_steps
    if not inputs or len(means.y) < fewest or min(len(np.unique(each.x)) for each in inputs) < fewest:
        least = 1e6 * LIMITS.small_step / settings.site.gravity
        text = (
            f"no accelerometer of the record is tilted about level (within {least:.0f} ug)"
            if not inputs
            else f"found {len(means.y)} steps, expected at least {fewest}, at as many angles"
        )
        return StepCalibration(unobservable(record, means, settings, findings, text), means)
    responses = tuple(_response(each, means, settings) for each in inputs)
    estimate = assemble(record, means, settings, findings, tuple(inputs), responses)
    return StepCalibration(estimate, means, tuple(inputs), responses)


def check_step_test(settings: TurntableSettings) -> None:
    """Refuse a study that cannot be a test by small steps; raises StudyError."""
    if settings.instrument.kind != "accelerometer":
        raise StudyError(
            "instrument.kind",
            f'found "{settings.instrument.kind}", expected "accelerometer" for a test by small steps',
        )
    if settings.rate_test is not None:
        raise StudyError("step_test", "found beside rate_test, expected one of them")


def _tilted(channel: str, x: Array, means: Readings, settings: TurntableSettings) -> Tilted:
    """The input of an accelerometer, and what the table makes of it."""
    chain, v = settings.chain, np.eye(3)["xyz".index(channel[-1])]
    f_n = -gravity_reference(settings.site.gravity)
    shift = (f_n @ chain.slopes(means.angles) @ v) * chain.std  # (n, k)
    constant = np.array([error.scope.constant for error in chain.errors], dtype=bool)
    blur = float(np.sqrt(np.mean(np.square(shift[:, ~constant]).sum(axis=1)))) if chain.errors else 0.0
    return Tilted(channel, x, senses(x), shift.mean(axis=0) * constant, blur)


def _response(tilted: Tilted, means: Readings, settings: TurntableSettings) -> Response:
    """The response of an accelerometer; errors of the table that are redrawn add to a stated noise."""
    y = means.y[:, means.channels.index(tilted.channel)]
    noise = settings.instrument.noise
    if noise is not None:
        noise = float(np.hypot(noise, np.polyfit(tilted.x, y, 1)[0] * tilted.blur))
    floor = FLOOR * float(np.sqrt(np.mean(np.square(y))) or 1.0)
    return respond(tilted.channel[-1], tilted.x, tilted.sense, means.times, y, noise, floor)
