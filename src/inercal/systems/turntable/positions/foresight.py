"""Positions of a turntable before they are taken: uncertainties with better or worse errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight, Lever
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.budget import combine
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, channels_of
from inercal.systems.turntable.positions.fit import choose_terms, stated_noise
from inercal.systems.turntable.positions.judged import planned_blindness
from inercal.systems.turntable.positions.outcome import sources, terms_of, unit_of_term
from inercal.systems.turntable.positions.planning import expected_coefficients, samples_of
from inercal.systems.turntable.positions.tolerance_design import trial
from inercal.systems.turntable.regression import fit
from inercal.systems.turntable.settings import DRIFT, TurntableSettings


def foresight(settings: TurntableSettings) -> Foresight:
    """Uncertainties at the positions of a study, and the rms of the predicted output (``drift``); the levers are the
    noise of a reading and the errors of the table.

    Raises `StudyError` for positions that do not identify the terms, without noise, and for a grid to be analysed.
    """
    noise = stated_noise(settings)
    angles = _angles(settings)
    used, seen, _ = choose_terms(settings, channels_of(settings), angles)
    lost = [words for each in seen for words in each.words]
    if lost:
        raise StudyError(
            "positions", f"the positions do not identify {'; '.join(lost)}, expected more of them"
        )
    names = (*used.symbols, DRIFT)
    test = trial(settings.plan, settings, used, dict.fromkeys(names, 1.0))
    assert test is not None

    def u(factors: Array) -> Array:
        found = replace(test, noise=test.noise * factors[0]).ratios(factors[1:])
        return np.sqrt(found.at(factors[1:]))

    unit = settings.instrument.unit
    shown = [shown_unit(unit_of_term(symbol, unit.si), unit) for symbol in used.symbols]
    units = (*(text for text, _ in shown), unit.symbol)
    sizes = np.array([*(size for _, size in shown), unit.factor])
    levers = [Lever("instrument.noise", noise / unit.factor, unit.symbol, "of a reading")]
    for error in settings.chain.errors:
        text, size = shown_unit("m" if error.is_offset else "rad")
        std = error.distribution.std / size
        levers.append(Lever(f"rig.errors.{error.name}", std, text, error.what, '{ normal = "{}" }'))
    return Foresight(names, units, sizes, tuple(levers), u, _blind(settings, used))


def _blind(settings: TurntableSettings, used: TableModel) -> dict[str, float]:
    """Share of faults that the positions hide, in their order, by `planned_blindness`."""
    angles, c = _angles(settings), expected_coefficients(settings, used)
    noise, samples = [settings.instrument.noise] * len(used.channels), samples_of(settings, angles)
    found = fit(used, angles, used.outputs(angles, c), noise, start=c, samples=samples)
    terms = terms_of(found)
    u = combine(used.symbols, sources(found, terms, settings.instrument.unit.si)).u
    return planned_blindness(found, terms.slope, u, terms.values)


def verticals(settings: TurntableSettings) -> Array:
    """Directions (r, 3) of the vertical on the instrument in each position. Raises `StudyError` for a grid to be
    analysed."""
    return settings.chain.attitude(_angles(settings))[:, 2]


def stated_positions(settings: TurntableSettings) -> list[list[str]]:
    """Angles of the positions of a study [deg], as it states them."""
    return [[f"{math.degrees(angle):.10g}" for angle in row] for row in settings.plan.angles.tolist()]


def _angles(settings: TurntableSettings) -> Array:
    """Angles of the positions of a study; raises `StudyError` for too many."""
    if settings.rate_test is not None or settings.step_test is not None:
        raise StudyError("rate_test", "found a test of rates or steps, expected one of positions")
    if len(settings.plan) > (most := LIMITS.foreseen_positions):
        raise StudyError(
            "positions",
            f"found the {settings.plan.name} with {len(settings.plan)} positions, expected those of a test, {most} at "
            'most, such as plan = "24-position"',
        )
    return settings.plan.angles
