"""Angles from row to row, and points, as columns: the same in a file and on a stream.

    theta, u_theta [deg]              pitch, and its standard uncertainty
    rate [deg/s]                      of pitch, nose-up
    alpha, u_alpha [deg]              angle of attack
    beta, u_beta [deg]                sideslip, the wind from the right

Alpha and beta need the attitude of the model in the stream, stated in the study; without it theta is not called alpha.
A row of the recording that was left out has no numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from inercal.aoa.angles import Angles
from inercal.aoa.flow import alpha_beta, gives_alpha, theta_u
from inercal.aoa.reading.recording import Recording
from inercal.aoa.result.points import Point
from inercal.aoa.settings import AoaSettings, Attitude
from inercal.arrays import Array
from inercal.inputs import Source
from inercal.records.made import record_of
from inercal.records.record import Record
from inercal.units import parse_unit

_PITCH = (("theta", "deg"), ("u_theta", "deg"), ("rate", "deg/s"))
_FLOW = (("alpha", "deg"), ("u_alpha", "deg"), ("beta", "deg"), ("u_beta", "deg"))
_POINT = (
    ("point", "1"),
    ("trigger", "1"),
    ("last_trigger", "1"),
    ("begin", "s"),
    ("end", "s"),
    ("rows", "1"),
    *_PITCH,
    ("scatter", "deg"),
)


def columns(attitude: Attitude) -> tuple[tuple[str, str], ...]:
    """Names and units, after ``t``."""
    return _PITCH + (_FLOW if gives_alpha(attitude) else ())


def rows(
    theta: Array,
    u: Array,
    rate: Array,
    attitude: Attitude,
    roll: Array | None = None,
    u_roll: Array | None = None,
    by_roll: Array | None = None,
) -> Array:
    """The columns (n, 3 or 7), in their units, of ``theta``, ``u`` [rad] and ``rate`` [rad/s], (n,) each.

    ``u`` is that of theta for an exact stated roll; the column adds the part of the roll, unless ``roll`` is given.
    ``roll``, ``u_roll``, ``by_roll`` as in `inercal.aoa.flow.alpha_beta`.
    """
    values = [theta, theta_u(theta, u, attitude, by_roll) if roll is None else u, rate]
    if gives_alpha(attitude):
        flow = alpha_beta(theta, u, attitude, roll, u_roll, by_roll)
        values += [flow.alpha, flow.u_alpha, flow.beta, flow.u_beta]
    return np.degrees(np.column_stack(values))


def angles_record(recording: Recording, angles: Angles, settings: AoaSettings) -> Record:
    """Angles with the time stamps of the recording, row by row."""
    values = rows(
        angles.theta,
        angles.known_u,
        angles.rate,
        settings.attitude,
        angles.roll,
        angles.roll_u,
        angles.by_roll,
    )
    source = Source(f"angles of {angles.method}", "")
    return _record(columns(settings.attitude), values, recording.t, recording, source)


def points_record(points: Iterable[Point], recording: Recording, settings: AoaSettings) -> Record:
    """Points, a row each: ``t`` in the middle, number and triggers of the record, mean angle, scatter."""
    flow = gives_alpha(settings.attitude)
    # a point holds angles in rad
    lines = [
        (p.number, p.trigger, p.last_trigger, p.begin, p.end, float(p.rows))
        + tuple(np.degrees([p.theta, p.u, p.rate, p.scatter]).tolist())
        + (tuple(np.degrees([p.alpha, p.u_alpha, p.beta, p.u_beta]).tolist()) if flow else ())
        for p in points
    ]
    names = _POINT + (_FLOW if flow else ())
    values = np.array(lines, dtype=float).reshape(len(lines), len(names))
    middle = 0.5 * (values[:, 3] + values[:, 4])
    return _record(names, values, middle, recording, Source("points", ""))


def _record(
    names: tuple[tuple[str, str], ...], values: Array, t: Array, recording: Recording, source: Source
) -> Record:
    """Columns (n, k) as a record."""
    named = zip(names, values.T, strict=True)
    made = record_of(((name, parse_unit(symbol), column) for (name, symbol), column in named), t, source)
    return replace(made, findings=recording.findings, sources=(*recording.sources, source))
