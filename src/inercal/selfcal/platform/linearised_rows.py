"""Compiled linearisation of whole recordings with states of the rig, for batch estimators."""

from __future__ import annotations

from typing import NamedTuple

from inercal._jit import allocating
from inercal.arrays import Array
from inercal.estimate.kalman import empty_row
from inercal.geometry.kernels import right_jacobian
from inercal.selfcal.platform.linearised import (
    WIDEST,
    Step,
    accelerometer_row,
    dynamics_columns,
    empty_columns,
    encoder_columns,
)
from inercal.selfcal.platform.model import (
    Rates,
    drifting,
    encoders_attitude,
    force_within,
    on_the_base,
    outputs,
    platform_rate,
    sensing,
)
from inercal.selfcal.platform.recording import Steps
from inercal.selfcal.platform.rig import World
from inercal.selfcal.platform.states import Layout


class LinearisedRows(NamedTuple):
    """Model of m rows: attitude ``of_encoders`` (m, 4) with its change ``by_encoders`` (m, 3, 3 + p) [rad, about the
    axes of p], and ``expected`` (m, 3) [m/s^2] outputs with theirs ``by_acc`` (m, 3, 3 + p), per change of the error
    state."""

    of_encoders: Array
    by_encoders: Array
    expected: Array
    by_acc: Array


@allocating
def linearise_rows(
    q: Array, th: Array, steps: Steps, c: Array, layout: Layout, world: World, out: LinearisedRows
) -> None:
    """Linearise encoders which read ``th`` (m, 3) [rad], and accelerometers, at attitudes ``q`` (m, 4) after ``steps``;
    ``c`` is the full vector, linear form. ``by_encoders`` and ``by_acc`` come in as zeros."""
    row, columns, place = empty_row(WIDEST), empty_columns(), layout.place
    earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
    for k in range(len(q)):
        w, later = steps.rate[k], steps.later[k]
        read = Rates((w[0], w[1], w[2]), (later[0], later[1], later[2]))
        angles = (th[k, 0], th[k, 1], th[k, 2])
        at = encoders_attitude(angles, read, earth_e, up_e, c, layout, world.axes, world.signs)
        for i in range(4):
            out.of_encoders[k, i] = at[i]
        count = encoder_columns(angles, at, read, earth_e, up_e, c, layout, world.axes, world.signs, columns)
        for a in range(count):
            for i in range(3):
                out.by_encoders[k, i, columns.places[a]] = columns.axes[a, i]
        sensed = sensing((q[k, 0], q[k, 1], q[k, 2], q[k, 3]), read, earth_e, up_e, steps.warm[k], c)
        expected = outputs(sensed, c)
        for i in range(3):
            out.expected[k, i] = expected[i]
            size = accelerometer_row(i, sensed, c, place, up_e, row)
            for a in range(size):
                out.by_acc[k, i, row.places[a]] = row.values[a]


@allocating
def linearise_steps(
    q: Array, steps: Steps, c: Array, layout: Layout, world: World, turn: Array, slope: Array
) -> None:
    """Put rotation vectors ``turn`` (m, 3) [rad] of the platform against inertial space in each step, and the change
    ``slope`` (m, 3, p) of the attitude ``q`` (m, 4) after it, about the axes of p; ``slope`` comes in as zeros."""
    columns, place = empty_columns(), layout.place
    earth_e, up_e = on_the_base(world.earth, c), on_the_base(world.up, c)
    for k in range(len(q)):
        w, dt = (steps.rate[k, 0], steps.rate[k, 1], steps.rate[k, 2]), steps.dt[k]
        at = (q[k, 0], q[k, 1], q[k, 2], q[k, 3])
        rate, f = platform_rate(w, c), force_within(at, w, -0.5 * dt, up_e)
        if len(c) > 24:
            rate = drifting(rate, f, steps.warm[k], c)
        j = right_jacobian((rate[0] * dt, rate[1] * dt, rate[2] * dt))
        for i in range(3):
            turn[k, i] = rate[i] * dt
            for a in range(3):
                slope[k, i, a] = dt * j[i][a]
                slope[k, i, 6 + a] = dt * j[i][a] * w[(a + 1) % 3]
                slope[k, i, 9 + a] = -dt * j[i][a] * w[(a + 2) % 3]
        step = Step(w, rate, earth_e, at, dt, f, steps.warm[k])
        count = 0 if len(c) <= 18 else dynamics_columns(c, place, step, columns)
        for a in range(count):
            for i in range(3):
                slope[k, i, columns.places[a] - 3] = columns.axes[a, i]
