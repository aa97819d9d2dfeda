"""From readings to a fit: the terms that the positions identify, with stated values of the others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import TERMS
from inercal.systems.turntable.model import TableModel, table_model
from inercal.systems.turntable.positions.drift import Drift, fit_drift
from inercal.systems.turntable.readings import Readings
from inercal.systems.turntable.regression import (
    Effects,
    Identified,
    Regression,
    fit,
    fit_to_order,
    identify_channels,
    second_order_matters,
)
from inercal.systems.turntable.settings import BiasDrift, TurntableSettings


@dataclass(frozen=True, eq=False)
class Fitting:
    """The terms that a plan identifies, and the fit if it identifies all.

    ``identified`` rank and null vectors by channel, of the terms of ``model``; ``fit`` None where a term is not
    identified, and where the weights of the readings do not settle; with a ``drift`` where the study asks for one.
    """

    model: TableModel
    identified: tuple[Identified, ...]
    fit: Regression | None
    findings: tuple[Finding, ...] = ()
    drift: Drift | None = None


def fit_readings(means: Readings, settings: TurntableSettings) -> Fitting:
    """Fit the terms that the study asks for, those of the earth rate only where the positions allow it.

    Raises
    ------
    StudyError
        No value stated for terms of the earth rate that cannot be fitted.
    """
    model, what, free = choose_terms(settings, means.channels, means.angles)
    fixed_rates, findings = _stated_rates(model, settings), list(means.findings)
    if free:
        text = (
            f"the positions do not identify the terms of the earth rate ({free} is free): earth rate is subtracted "
            f"with {', '.join(fixed_rates)}"
        )
        findings.append(Finding("stated_earth_rate", text))
    if any(each.words for each in what) or len(means.y) < fewest_positions(model, settings):
        return Fitting(model, what, None, tuple(findings))
    noise = [settings.instrument.noise] * len(means.channels)
    try:
        with np.errstate(
            over="ignore", divide="ignore", invalid="ignore"
        ):  # what is lost is not finite, and no fit
            if settings.instrument.bias_drift != "none":
                drift = _with_drift(model, means, noise, settings.instrument.bias_drift)
                return Fitting(model, what, drift.fit, (*findings, *drift.findings), drift)
            done = fit(model, means.angles, means.y, noise, samples=means.samples)
    except np.linalg.LinAlgError:
        return Fitting(model, what, None, tuple(findings))
    return Fitting(model, what, done, tuple(findings))


def _with_drift(model: TableModel, means: Readings, noise: Sequence[float | None], kind: BiasDrift) -> Drift:
    """The fit with a drift of that ``kind``; all fits by which it is found are of one order of the table's errors."""

    def to_order(second: bool) -> Drift:
        def fitted(y: Array, effects: Effects) -> Regression:
            return fit_to_order(model, means.angles, y, noise, None, means.samples, effects, second)

        return fit_drift(means, kind, fitted, means.unit.si)

    straight = to_order(False)
    return to_order(True) if second_order_matters(straight.fit) else straight


def choose_terms(
    settings: TurntableSettings, channels: Sequence[str], angles: Array
) -> tuple[TableModel, tuple[Identified, ...], str]:
    """The terms to be fitted at these positions, and their identifiability.

    The terms of the earth rate are among them as the study says; where it says nothing, if the positions identify
    them. Where they do not, the third is the combination that would be free, in words.
    """
    whole = table_model(settings, channels)
    what, rates, choice = identify_channels(whole, angles), rate_terms(whole), settings.instrument.earth_rate
    if not rates or choice == "fitted" or (choice is None and not any(each.words for each in what)):
        return whole, what, ""
    rest = table_model(settings, channels, rates)
    without = identify_channels(rest, angles)
    if choice == "stated":
        return rest, without, ""
    if not _leaves_rates_unknown(what, without):
        return whole, what, ""
    free = [words for each in what for words in each.words]
    free.sort(
        key=lambda words: not set(words.split()) & set(rates)
    )  # one that names a term of a rate, if any does
    return rest, without, free[0]


def earth_rate_of(model: TableModel) -> str:
    """``stated`` if terms of the earth rate are taken as known, else ``fitted``."""
    fixed = any(each.of_rate for part in model.stated for each in part.channel.monomials)
    return "stated" if fixed else "fitted"


def _leaves_rates_unknown(whole: tuple[Identified, ...], without: tuple[Identified, ...]) -> bool:
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


def _stated_rates(model: TableModel, settings: TurntableSettings) -> tuple[str, ...]:
    """The terms of the earth rate that are not fitted, each with its value as ``k_x = 1``, or ``k_x = 20 mA/(rad/s)``.

    Raises
    ------
    StudyError
        None of them is stated, and the output is in no unit of rate.
    """
    rates, has_value, unit = [], False, settings.instrument.unit
    for part in model.stated:
        for symbol, each, value in zip(
            part.channel.symbols, part.channel.monomials, part.values, strict=True
        ):
            if each.of_rate:
                of = "" if unit.dimension == "rate" else f" {TERMS[symbol].unit_for(unit.symbol)}"
                rates.append(f"{symbol} = {value / (unit.factor if of else 1.0):.6g}{of}")
                has_value = has_value or symbol in settings.instrument.coefficients or bool(value)
    if rates and not has_value:
        names = ", ".join(text.partition(" ")[0] for text in rates)
        raise StudyError(
            "instrument.coefficients",
            f"none of {names} is stated, expected one or more: they are not fitted, and the output is in no unit of "
            "rate",
        )
    return tuple(rates)
