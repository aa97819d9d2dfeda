"""Compiled linearisation of whole recordings, for batch estimators."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.foundation._jit import allocating
from inercal.foundation.arrays import Array
from inercal.systems.selfcal.platform.layout import Layout
from inercal.systems.selfcal.platform.linearised import times, transition
from inercal.systems.selfcal.platform.model import (
    Rates,
    accelerometers,
    base_of,
    encoders,
    force_within,
    propagate,
    room,
    turning,
)
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.platform.rig import World


class LinearisedRows(NamedTuple):
    """Model of m rows: attitude ``of_encoders`` (m, 4), outputs of the accelerometers ``expected`` (m, 3) [m/s^2], and
    the changes ``by`` (m, 6, 3 + p) of outputs and attitude [rad, about the axes of p] per change of the error state.
    """

    of_encoders: Array
    expected: Array
    by: Array


@allocating
def linearise_rows(
    q: Array, th: Array, steps: Steps, c: Array, layout: Layout, world: World, out: LinearisedRows
) -> None:
    """Linearise encoders which read ``th`` (m, 3) [rad], and accelerometers, at attitudes ``q`` (m, 4) after ``steps``;
    ``c`` is the full vector, linear form. ``by`` comes in as zeros."""
    own, base, columns = room(), base_of(c, layout.based, world), layout.columns
    for k in range(len(q)):
        w, later = steps.rate[k], steps.later[k]
        read = Rates((w[0], w[1], w[2]), (later[0], later[1], later[2]))
        angles = (th[k, 0], th[k, 1], th[k, 2])
        at = encoders(angles, read, base, c, layout, world, own)
        for i in range(4):
            out.of_encoders[k, i] = at[i]
        for a in range(len(columns)):
            for i in range(3):
                out.by[k, 3 + i, columns[a]] = own.axes[a, i]
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        expected, _ = accelerometers(at, read, steps.warm[k], base, c, layout, own)
        for i in range(3):
            out.expected[k, i] = expected[i]
            for a in range(layout.sizes[i]):
                out.by[k, i, layout.rows[i, a]] = own.entries[i, a]


@allocating
def linearise_steps(
    q: Array, steps: Steps, c: Array, layout: Layout, world: World, turn: Array, slope: Array
) -> None:
    """Put rotation vectors ``turn`` (m, 3) [rad] of the platform against inertial space in each step from attitude
    ``q`` (m, 4), and the change ``slope`` (m, 3, p) of the attitude after it, about the axes of p."""
    own, base, p = room(), base_of(c, layout.based, world), slope.shape[2]
    each, work = np.zeros((3 + p, p)), np.empty((3, p))  # an error of each state alone
    for a in range(p):
        each[3 + a, a] = 1.0
    for k in range(len(q)):
        w, dt = (steps.rate[k, 0], steps.rate[k, 1], steps.rate[k, 2]), steps.dt[k]
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        f = force_within(at, w, 0.5 * dt, base.up, layout.by_force)
        rate = turning(w, f, steps.warm[k], c, layout, own)
        for i in range(3):
            turn[k, i] = rate[i] * dt
        at = propagate(at, rate, base.earth, dt)
        F = transition(w, rate, dt, at, base.earth, c, layout.based)
        times(F, each, layout, own, slope[k], work)
