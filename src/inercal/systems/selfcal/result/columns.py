"""Estimates from row to row as columns, the same in a file and on a stream.

    th_x, th_y, th_z [rad]            gimbal angles of the estimated attitude, continuous
    q_0 to q_3                        that attitude, q_bp, scalar first
    u_attitude_x, _y, _z [rad]        its standard uncertainties about the axes of p; of the gimbal-ukf, of the angles
    kg0_x [rad/s], u_kg0_x [rad/s]    each coefficient, product form, and its standard uncertainty
    nis, nis_mean                     normalised innovation squared of the row, and its mean up to there

u of eta is that at the present scale error of its accelerometer; the uncertainty of this, which adds a thousandth of u,
is left out here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inputs import Source
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.platform.coefficients import divisor, units
from inercal.systems.selfcal.platform.kinematics import all_angles
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS, World


def columns(names: Sequence[str]) -> list[tuple[str, str]]:
    """Names and units, after ``t``, for coefficients."""
    of_coefficients = [
        (f"{way}{name}", unit) for name, unit in zip(names, units(names), strict=True) for way in ("", "u_")
    ]
    return [
        *((joint, "rad") for joint in JOINTS),
        *((f"q_{k}", "1") for k in range(4)),
        *((f"u_attitude_{axis}", "rad") for axis in "xyz"),
        *of_coefficients,
        ("nis", "1"),
        ("nis_mean", "1"),
    ]


def rows(
    attitude: Array, attitude_u: Array, coefficients: Array, u: Array, near: Array, world: World
) -> Array:
    """All columns but the last two, (n, 10 + 2 p), of a `RowHistory` or `Estimates` of n rows.

    ``near`` (3,) [rad] are gimbal angles shortly before the first row.
    """
    n, p = u.shape
    values = np.empty((n, 10 + 2 * p))
    angles = np.empty((n, 3))
    all_angles(attitude, near, world.axes, world.signs, angles)
    values[:, :3], values[:, 3:7], values[:, 7:10] = angles, attitude, attitude_u
    by = divisor(coefficients)
    values[:, 10::2], values[:, 11::2] = coefficients / by, u / by
    return values


def history_record(filtered: FilterResult, recording: Recording, world: World) -> Record:
    """The columns as a record with the time stamps of the recording; raises ValueError where no history was kept."""
    history = filtered.history
    if history is None:
        raise ValueError("found no history, expected an estimate with one")
    first = rows(
        history.attitude, history.attitude_u, history.coefficients, history.u, recording.th[0], world
    )
    measured = np.isfinite(filtered.nis)
    total = np.cumsum(np.where(measured, filtered.nis, 0.0))
    count = np.cumsum(measured)
    with np.errstate(invalid="ignore"):
        mean = np.where(count > 0, total / count, np.nan)
    last = np.vstack([np.full(2, np.nan), np.column_stack([filtered.nis, mean])])
    source = Source(f"history of {filtered.kind}", "")
    named = zip(columns(filtered.names), np.hstack([first, last]).T, strict=True)
    made = record_of(
        ((name, parse_unit(symbol), values) for (name, symbol), values in named), recording.t, source
    )
    return replace(made, findings=recording.findings, sources=(*recording.sources, source))
