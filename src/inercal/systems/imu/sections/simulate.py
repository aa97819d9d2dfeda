"""A simulated recording of sections by an instrument of known truth: one labelled log, or a row of means for each.

The forward model is apart from that of the fit: finite rotations sampled in time, earth rate and gravity carried into
the body at every sample, what a lever arm adds wherever it turns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import earth_rate
from inercal.foundation.geometry.rotations import conjugate, rotate
from inercal.foundation.records.record import Record
from inercal.systems.imu.sections.course import Pace, course, sampled
from inercal.systems.imu.sections.cutting.table import SectionRow, stated_rows
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.settings import ImuSettings, SectionsSettings
from inercal.systems.imu.simulate import (
    ImuTruth,
    as_stated,
    draw_full_truth,
    draw_truth,
    indicated,
    record_of_counts,
    wandering_noise,
)


def simulate_sections(
    settings: ImuSettings, options: SectionsSettings, latitude: float, rng: np.random.Generator
) -> tuple[Record, ImuTruth]:
    """Simulate the sections of a study, one after the other, at a ``latitude`` [rad].

    What the study states with an uncertainty (directions, angles, rates, gravity, the clock) is off by as much.

    Returns
    -------
    record : Record
        In counts; labelled by the names of the sections, or of means.
    truth : ImuTruth
        With the biases of this recording, means over its sections of what wandered.

    Raises
    ------
    StudyError
        A section that cannot be simulated, or means of one that is no rest.
    """
    of, rows, usual = settings.simulation, stated_rows(options), Priors(settings.site)
    for row in rows:
        if of.means and row.kind != "rest":
            raise StudyError(f"section {row.section}", f"found the kind {row.kind}, expected rests for means")
    known = any(row.up is not None or row.force is not None or row.axis is not None for row in rows)
    truth = as_stated(draw_full_truth(rng) if known else draw_truth(rng, 2e-4), of)
    placing = usual.placing.median if options.placing is None else options.placing
    pieces = course(rows, Pace(of.hold, of.turning, placing, options.level), rng)
    gravity = settings.site.gravity + sum(
        each.sensitivity * rng.normal(0.0, each.u) for each in settings.site.inputs
    )
    north, up = earth_rate(latitude)
    arm = rng.normal(0.0, settings.disturbances.lever_arm, 3)
    shifts = {name: _shift(usual, rng) for name in dict.fromkeys(row.session for row in rows)}
    if len(shifts) < 2:
        shifts = {name: np.zeros(6) for name in shifts}
    felt, turning, added, labels = [], [], [], list[str]()
    for piece, q, w, change in sampled(pieces, of.sample_rate):
        to_body = conjugate(q)
        force = rotate(to_body, np.array([0.0, 0.0, gravity])) if piece.force is None else piece.force
        felt.append(force + np.cross(w, np.cross(w, arm)) + np.cross(change, arm))
        turning.append(w + rotate(to_body, np.array([float(north), 0.0, float(up)])))
        added.append(np.broadcast_to(shifts.get(piece.session, np.zeros(6)), (len(q), 6)))
        labels += [piece.name] * len(q)
    f, omega, shift, n = np.concatenate(felt), np.concatenate(turning), np.concatenate(added), len(labels)
    (f_error, f_wander), (w_error, w_wander) = (
        wandering_noise(noise, n, of.sample_rate, rng)
        for noise in (truth.accelerometer_noise, truth.gyro_noise)
    )
    errors = f_error + shift[:, :3], w_error + shift[:, 3:]
    ends = np.flatnonzero(np.array(labels)[1:] != np.array(labels)[:-1]) + 1
    turned = [
        slice(a, b) for a, b in zip([0, *ends], [*ends, n], strict=True) if np.ptp(omega[a:b], axis=0).any()
    ]
    acc, gyro = indicated(truth, f, omega, errors, turned, of.sample_rate, settings.disturbances, rng)
    clock = (1.0 + settings.disturbances.clock) * (1.0 + rng.normal(0.0, settings.time_base_u))
    t = np.arange(n, dtype=np.float64) * (clock / of.sample_rate)
    inside = np.isin(labels, [row.section for row in rows])
    truth = replace(
        truth,
        accelerometer=replace(
            truth.accelerometer,
            bias=truth.accelerometer.bias + truth.accelerometer.gain @ f_wander[inside].mean(axis=0),
        ),
        gyro=replace(truth.gyro, bias=truth.gyro.bias + truth.gyro.gain @ w_wander[inside].mean(axis=0)),
    )
    if of.means:
        return _means(rows, labels, acc, gyro), truth
    return replace(record_of_counts(t, acc, gyro), labels=tuple(labels)), truth


def _shift(usual: Priors, rng: np.random.Generator) -> Array:
    """Changes (6,) of the biases [SI] of accelerometers and gyro in one session."""
    sizes = usual.acc_session.median, usual.gyro_session.median
    return np.concatenate([rng.normal(0.0, size, 3) for size in sizes])


def _means(rows: Sequence[SectionRow], labels: Sequence[str], acc: Array, gyro: Array) -> Record:
    """A row of mean outputs for each section."""
    of = [np.array(labels) == row.section for row in rows]
    means = [np.array([values[one].mean(axis=0) for one in of]) for values in (acc, gyro)]
    return record_of_counts(np.arange(len(rows), dtype=np.float64), *means)
