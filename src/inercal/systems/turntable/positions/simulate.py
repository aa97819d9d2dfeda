"""A simulated test on a table: an instrument of known coefficients, table errors by scope, noise, dwells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.disturbances import displaced, disturbed, magnetic_field, true_angles
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, channels_of, stated_values, table_model
from inercal.systems.turntable.settings import Disturbances, TurntableSettings


def truth(settings: TurntableSettings) -> tuple[TableModel, Array]:
    """The model of all terms, and its linear coefficients (p,) from what the study states."""
    everything = replace(settings, instrument=replace(settings.instrument, terms=_all_terms(settings)))
    model = table_model(everything, channels_of(settings))
    parts = [channel.linear(stated_values(settings, channel)) for channel in model.channels]
    return model, np.concatenate(parts)


def simulate(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """Take the plan's positions one after the other and record the instrument.

    Parameters
    ----------
    settings : TurntableSettings
        The stated coefficients are the truth; each error of the table is drawn by its scope, and its disturbances
        are added.
    rng : Generator

    Returns
    -------
    Record
        ``position``, commanded angles [deg] and outputs: one row for each position (the mean over the dwell,
        at its middle), or all samples where the study gives a rate. An error of scope ``sample`` is redrawn at
        every sample; without a rate, a position has only one.

    Raises
    ------
    StudyError
        Too many samples.
    """
    other = settings.disturbances
    model, c = truth(replace(settings, chain=displaced(settings.chain, other)))
    instrument, plan = settings.instrument, settings.plan
    n = len(plan)
    per_dwell = instrument.samples
    if n * per_dwell > LIMITS.most_samples:
        raise StudyError(
            "instrument.sample_rate",
            f"found {n * per_dwell:.4g} samples in all, expected at most {LIMITS.most_samples:.0e}",
        )
    errors = np.repeat(model.chain.draw(rng, plan.angles)[:, None, :], per_dwell, axis=1)
    for k, error in enumerate(model.chain.errors):
        if error.scope is Scope.SAMPLE:
            errors[..., k] = error.distribution.sample(rng, (n, per_dwell))
    begin = instrument.dwell * np.arange(n)[:, None]
    t = (begin + instrument.dwell * (np.arange(per_dwell) + 0.5) / per_dwell).ravel()
    true = true_angles(plan.angles, model.chain.joints, other, rng)[:, None, :]
    y = model.outputs(true, c, errors)
    if other.magnetic:
        axes = ["xyz".index(channel.channel[-1]) for channel in model.channels]
        y = y + magnetic_field(model.chain.attitude(true, errors), other)[..., axes]
    if other != Disturbances():
        bias = [
            channel.regressors(np.zeros(3), np.zeros(3)) @ c[block]
            for channel, block in zip(model.channels, model.blocks, strict=True)
        ]
        y = disturbed(y.reshape(len(t), -1), np.array(bias), t, other, rng).reshape(y.shape)
    if instrument.noise is not None:
        y = y + rng.normal(0.0, instrument.noise * np.sqrt(per_dwell), y.shape)
    angles = np.repeat(plan.angles, per_dwell, axis=0)
    columns = [("position", parse_unit("1"), np.repeat(np.arange(1.0, n + 1.0), per_dwell))]
    columns += [
        (name, parse_unit("deg"), np.round(np.degrees(angles[:, k]), 12))
        for k, name in enumerate(model.chain.joints)
    ]
    columns += [
        (channel.channel, instrument.unit, y[..., k].ravel() / instrument.unit.factor)
        for k, channel in enumerate(model.channels)
    ]
    return record_of(columns, t)


def _all_terms(settings: TurntableSettings) -> tuple[str, ...]:
    """Every term of the instrument's channels."""
    kind = settings.instrument.kind
    return tuple(
        symbol for channel in channels_of(settings) for symbol in channel_model(kind, channel).symbols
    )
