"""From readings to a fit: which terms the positions allow, and what is stated of the rest."""

from __future__ import annotations

from collections.abc import Sequence
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
    and the ``rows`` (n, c, q) by which they enter the readings; ``earth_rate`` if rates are among them."""

    symbols: tuple[str, ...]
    values: Array
    u: Array
    rows: Array
    earth_rate: bool


@dataclass(frozen=True, eq=False)
class Fitting:
    """What a plan allows, and the fit if it allows one.

    ``known`` rank and null vectors by channel, of the terms of ``model``; ``stated`` those that are not fitted and
    matter; ``fit`` None where a term is not identified.
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
    model, what, free = choose_terms(settings, found.channels, found.angles)
    stated, findings = _stated(model, settings, found.angles), list(found.findings)
    if free:
        said = (
            f"the positions do not identify the terms of the earth rate ({free} is free): earth rate is subtracted "
            f"with stated {', '.join(stated.symbols)}"
        )
        findings.append(Finding("stated_earth_rate", said))
    if any(each.words for each in what) or len(found.y) < fewest_positions(model, settings):
        return Fitting(model, what, stated, None, tuple(findings))
    noise = [settings.instrument.noise] * len(found.channels)
    done = fit(model, found.angles, found.y, noise, samples=found.samples)
    return Fitting(model, what, stated, done, tuple(findings))


def choose_terms(
    settings: TurntableSettings, channels: Sequence[str], angles: Array
) -> tuple[TableModel, tuple[Known, ...], str]:
    """The terms to be fitted at these positions, and what these tell of them.

    The terms of the earth rate are among them as the study says; where it says nothing, if the positions identify
    them. Where they do not, the third is the combination that would be free, in words.
    """
    whole = table_model(settings, channels)
    what, rates, choice = known(whole, angles), rate_terms(whole), settings.instrument.earth_rate
    if not rates or choice == "fitted" or (choice is None and not any(each.words for each in what)):
        return whole, what, ""
    rest = table_model(settings, channels, rates)
    without = known(rest, angles)
    if choice == "stated":
        return rest, without, ""
    if not leaves_rates_unknown(what, without):
        return whole, what, ""
    free = next(words for each in what for words in each.words if set(words.split()) & set(rates))
    return rest, without, free


def leaves_rates_unknown(whole: tuple[Known, ...], without: tuple[Known, ...]) -> bool:
    """True if fewer combinations are unknown once the earth rate is: ``whole`` with its terms, ``without`` them."""
    return any(len(a.words) > len(b.words) for a, b in zip(whole, without, strict=True))


def fewest_positions(model: TableModel, settings: TurntableSettings) -> int:
    """Positions that a fit needs: one for each term, and one more where the noise is to be estimated."""
    return max(len(channel.symbols) for channel in model.channels) + (settings.instrument.noise is None)


def rate_terms(model: TableModel) -> tuple[str, ...]:
    """Terms of the model in which a rate takes part."""
    return tuple(
        symbol
        for channel in model.channels
        for symbol, each in zip(channel.symbols, channel.monomials, strict=True)
        if each.of_rate
    )


def _stated(model: TableModel, settings: TurntableSettings, angles: Array) -> Stated:
    """What the model takes as stated, in the linear form; all terms of the earth rate, others where they matter."""
    instrument = settings.instrument
    a, w = model.inputs(angles)
    symbols: list[str] = []
    values, u, rows, said = [], [], [], []
    for k, (channel, linear) in enumerate(model.stated):
        full = channel_model(instrument.kind, channel.channel)
        # a misalignment enters times the scale factor, whose own small uncertainty does not matter to it
        lead = full.gain(stated_values(settings, full))
        regressors = channel.regressors(a, w)
        for j, (symbol, each) in enumerate(zip(channel.symbols, channel.monomials, strict=True)):
            own_u = instrument.coefficients_u.get(symbol, 0.0) * (lead if symbol in full.relative else 1.0)
            if each.of_rate:
                said.append(symbol in instrument.coefficients or bool(linear[j]))
            if each.of_rate or linear[j] or own_u:
                row = np.zeros((len(angles), len(model.channels)))
                row[:, k] = regressors[:, j]
                symbols.append(symbol)
                values.append(linear[j])
                u.append(own_u)
                rows.append(row)
    if said and not any(said):
        raise StudyError(
            "instrument.coefficients",
            f"none of {', '.join(symbols)} is stated, expected one or more: they are not fitted, and the output is in "
            "no unit of rate",
        )
    made = np.stack(rows, axis=-1) if rows else np.zeros((len(angles), len(model.channels), 0))
    return Stated(tuple(symbols), np.array(values), np.array(u), made, bool(said))
