"""State of a stream of angles of attack between two rows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.run import Alarms, Slots
from inercal.foundation.arrays import Array
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.fusion.live_band import LimitedState
from inercal.systems.aoa.settings import AoaSettings, Resonance


class Leaning(NamedTuple):
    """The fusion under a change of a stated input: its state, and theta [rad] of rows not yet answered without it."""

    live: LimitedState
    theta: Array


class AoaState(NamedTuple):
    """State after a row.

    ``live`` is the state of the fusion, ``beside`` those under changes of gravity and roll, by name; ``t`` [s] the
    latest stamp, ``begun`` [s] the first one (NaN before); ``temperature`` [degC] the last known one; ``heard`` [s] the
    last row with a number of the gyro, ``beyond`` [s] the last one with an angle beyond the limits (NaN before).
    ``watch`` is that of `inercal.systems.aoa.fusion.watch`; of all ``rows`` that were answered ``unanswered`` have no
    angle. ``head`` (k, N + 6) are the first rows, time first, of which ``seen`` are filled, until all is decided and
    the zero is over; ``choice`` is that (`choice_of`), empty before, ``zeroed``: the zero was put in. ``remarked``: the
    findings on the sensors were given; ``slots`` that of the last line.
    """

    live: LimitedState
    beside: Mapping[str, Leaning]
    t: float
    begun: float
    temperature: float
    heard: float
    beyond: float
    watch: Array
    unanswered: int
    rows: int
    head: Array
    seen: int
    choice: Array
    zeroed: bool
    remarked: bool
    alarms: Alarms
    slots: Slots


def kept(state: AoaState, row: Array) -> AoaState:
    """The state with a row more in its head, whose array is used up."""
    head, seen = state.head, state.seen
    if seen == len(head):
        head = np.vstack([head, np.empty_like(head)])
    head[seen] = row
    return state._replace(head=head, seen=seen + 1)


def choice_of(settings: AoaSettings, final: bool) -> Array:
    """All that was decided, as numbers of a state: 1 where ``final``, 0 for the rate alone; rate, low pass, snap (0 for
    the usual one), delay and the priors of its rest and of the gyro's scale, flexure in both directions, rectified
    vibration, notches."""
    band, snap = settings.band, settings.estimator.snap or 0.0
    low = math.nan if band.low_pass is None else band.low_pass
    gyro = settings.timing.gyro_delay_about, settings.prior.gyro_delay, settings.prior.gyro_scale
    shaken = [
        float(each)
        for of in (settings.prior.heave, settings.prior.axial)
        for each in (of.frequency, of.damping, of.level, of.vertical)
    ]
    rectified = settings.prior.rectified
    return np.array([float(final), band.rate, low, snap, *gyro, *shaken, rectified, *band.notch])


def chosen(settings: AoaSettings, choice: Array) -> AoaSettings:
    """The study with what was decided."""
    _, rate, low, snap, about, rest, scale, *numbers = choice.tolist()
    heave, axial = (
        Resonance(frequency, damping, level, bool(vertical))
        for frequency, damping, level, vertical in (numbers[:4], numbers[4:8])
    )
    rectified, *notch = numbers[8:]
    prior = replace(
        settings.prior, gyro_delay=rest, gyro_scale=scale, rectified=rectified, heave=heave, axial=axial
    )
    return replace(
        settings,
        band=Band(None if math.isnan(low) else low, tuple(notch), rate),
        estimator=replace(settings.estimator, snap=snap or None),
        timing=replace(settings.timing, gyro_delay_about=about),
        prior=prior,
    )
