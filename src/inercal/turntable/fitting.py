"""From readings to a fit: which terms the positions allow, and what is stated of the rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.errors import StudyError
from inercal.instruments.by_angle import channel_model
from inercal.records.findings import Finding
from inercal.turntable.model import TableModel, stated_values, table_model
from inercal.turntable.readings import Readings
from inercal.turntable.regression import Known, Regression, fit, known
from inercal.turntable.settings import TurntableSettings

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stated:
    """Terms that are taken from the study: ``symbols`` (q,), ``values`` (q,) and ``u`` (q,), in the linear form,
    and the ``rows`` (n, c, q) by which they enter the readings."""

    symbols: tuple[str, ...]
    values: Array
    u: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Fitting:
    """What a plan allows, and the fit if it allows one.

    ``known`` rank and null vectors by channel, of the terms of ``model``; ``stated`` the terms of the earth rate
    where they are not fitted; ``fit`` None where a term is not identified.
    """

    model: TableModel
    known: tuple[Known, ...]
    stated: Stated
    fit: Regression | None
    findings: tuple[Finding, ...] = ()


def fit_readings(found: Readings, settings: TurntableSettings) -> Fitting:
    """Fit the terms that the study asks for, those of the earth rate only where the positions allow it.

    Raises
    ------
    StudyError
        Fewer readings than terms, or no value stated for terms of the earth rate that cannot be fitted.
    """
    whole = table_model(settings, found.channels)
    of_rate = rate_terms(whole)
    choice = settings.instrument.earth_rate
    model, what, findings = whole, known(whole, found.angles), list(found.findings)
    none = Stated((), np.zeros(0), np.zeros(0), np.zeros((*found.y.shape, 0)))
    stated = none
    lacking = any(each.words for each in what)
    if of_rate and (choice == "stated" or (choice is None and lacking)):
        stated = _stated(whole, of_rate, settings, found.angles)
        model = without_terms(whole, of_rate)
        if choice is None:
            said = (
                f"the positions do not identify the terms of the earth rate ({what[0].words[0]} is free): earth rate "
                f"is subtracted with stated {', '.join(stated.symbols)}"
            )
            findings.append(Finding("stated_earth_rate", said))
        what = known(model, found.angles)
    fewest = max(len(channel.symbols) for channel in model.channels)
    if any(each.words for each in what) or len(found.y) < fewest:
        return Fitting(model, what, stated, None, tuple(findings))
    y = found.y - stated.rows @ stated.values
    return Fitting(model, what, stated, fit(model, found.angles, y, _noise(found, settings)), tuple(findings))


def rate_terms(model: TableModel) -> tuple[str, ...]:
    """Terms of the model in which a rate takes part."""
    return tuple(
        symbol
        for channel in model.channels
        for symbol, each in zip(channel.symbols, channel.monomials, strict=True)
        if each.of_rate
    )


def without_terms(model: TableModel, symbols: tuple[str, ...]) -> TableModel:
    """The model without these terms."""
    channels = tuple(channel.without(symbols) for channel in model.channels)
    return TableModel(model.chain, model.a_n, model.w_n, channels)


def _stated(
    model: TableModel, symbols: tuple[str, ...], settings: TurntableSettings, angles: Array
) -> Stated:
    """The terms of the earth rate as stated, in the linear form."""
    instrument = settings.instrument
    values, u = [], []
    for channel in model.channels:
        full = channel_model(instrument.kind, channel.channel)
        linear = full.linear(stated_values(settings, full))
        own_u = np.array([instrument.coefficients_u.get(symbol, 0.0) for symbol in full.symbols])
        # a misalignment enters times the scale factor, whose own small uncertainty does not matter to it
        of = np.where([symbol in full.relative for symbol in full.symbols], full.gain(linear), 1.0)
        for symbol in channel.symbols:
            if symbol in symbols:
                values.append(linear[full.symbols.index(symbol)])
                u.append((own_u * of)[full.symbols.index(symbol)])
    if not any(values):
        raise StudyError(
            "instrument.coefficients",
            f"none of {', '.join(symbols)} is stated, expected one or more: the positions do not identify them, and "
            "the output is in no unit of rate",
        )
    kept = [model.symbols.index(symbol) for symbol in symbols]
    return Stated(symbols, np.array(values), np.array(u), model.rows(angles)[..., kept])


def _noise(found: Readings, settings: TurntableSettings) -> list[float | None]:
    """Noise of a reading as stated."""
    return [settings.instrument.noise] * len(found.channels)
