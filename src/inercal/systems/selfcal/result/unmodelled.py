"""Errors of the rig that are neither states nor stated: what this recording leaves of them, in u.

A K2, a harmonic or a bias that wanders may shift coefficients by several u before any test finds it. Each is as large
as usual, or smaller where the innovations say so (`inercal.foundation.inference.effects`): score and information follow
from the columns that the errors would have as states. Only where the states are those of a rig: a model of the
literature is taken at its word, and a finding says what that leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.effects import joint_second_moment
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.budget import TypeB
from inercal.systems.selfcal.before.considered import both
from inercal.systems.selfcal.diagnosis.fit_quality import Case, filtered, regular
from inercal.systems.selfcal.filters.averaged import averaged
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import (
    ALL,
    BIAS_WALK,
    KIND_OF,
    RIG,
    STATES,
    TEMPERATURE,
    UNIT_OF,
    WALK,
    WAVE,
)
from inercal.systems.selfcal.settings import SelfcalSettings

SOURCE = "errors of the rig that are not fitted"

_WANDERS = {"gyro_walk": "kg0_T1", "accelerometer_walk": "ka0_T1"}
"""Kind of a walk -> that of which the columns, with a course of time in the place of temperature, are its own."""


class Unmodelled(NamedTuple):
    """Kinds of errors that are not fitted but ``counted`` in u, as states and studies call them, what they add to the
    budget, and the finding that tells of them, None where that is little."""

    counted: tuple[str, ...]
    source: TypeB
    finding: Finding | None


class _Effects(NamedTuple):
    """Errors: ``kinds`` (q,) and ``names`` (q,) of the states that they would be, ``usual`` (q,) sizes [SI]; per usual
    size the change of the m normalised ``innovations`` (m, q) that count and of the coefficients, ``shift`` (p, q)."""

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    usual: Array
    innovations: Array
    shift: Array


class Evidence(NamedTuple):
    """Evidence of errors in recordings: ``kinds`` (q,) and ``names`` (q,) of the states that they would be, ``usual``
    (q,) sizes [SI]; of each per usual size its ``score`` (q,), ``information`` (q, q) and the change of the
    coefficients, linear form, ``shift`` (p, q)."""

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    usual: Array
    score: Array
    information: Array
    shift: Array


def unmodelled(
    recording: Recording, settings: SelfcalSettings, result: FilterResult, u: Array
) -> Unmodelled | None:
    """Errors that are not fitted by the ``result`` of a filter, whose coefficients have ``u`` (p,) without them; None
    where the states are not those of a rig, or where no error is left."""
    found = evidence(recording, settings, result)
    if found is None:
        return None
    return counted(found, product_slope(result.coefficients), result.names, u)


def evidence(recording: Recording, settings: SelfcalSettings, result: FilterResult) -> Evidence | None:
    """Evidence that a recording has of errors which the ``result`` of a filter leaves out; None as in `unmodelled`."""
    if not {*RIG} <= {*settings.kinds}:
        return None
    case = averaged(recording, problem(settings), result)
    now = filtered(case)
    if not now.converged:
        return None
    parts = [
        each for each in (_constant(case, now, settings), *_wandering(case, now, settings)) if each.names
    ]
    if not parts:
        return None
    z, columns = regular(case[0], now), np.concatenate([each.innovations for each in parts], axis=1)
    return Evidence(
        tuple(kind for each in parts for kind in each.kinds),
        tuple(name for each in parts for name in each.names),
        np.concatenate([each.usual for each in parts]),
        columns.T @ z[np.isfinite(z)],
        columns.T @ columns,
        np.concatenate([each.shift for each in parts], axis=1),
    )


def of_all(each: Sequence[Evidence]) -> Evidence:
    """The evidence of several recordings, of which each has its part of the ``shift`` of the coefficients: what does
    not change with time is the same in all of them, what wanders is another in each. The information is less than what
    their fit has, for which the coefficients too are the same."""
    places = dict[tuple[int, int, str], int]()
    where = []
    for number, one in enumerate(each):
        own = [
            (number, k, name) if kind in BIAS_WALK else (-1, -1, name)
            for k, (kind, name) in enumerate(zip(one.kinds, one.names, strict=True))
        ]
        where.append(np.array([places.setdefault(key, len(places)) for key in own]))
    q = len(places)
    kinds, names, usual = [""] * q, [""] * q, np.zeros(q)
    score, information, shift = np.zeros(q), np.zeros((q, q)), np.zeros((len(each[0].shift), q))
    for one, at in zip(each, where, strict=True):
        for place, kind, name in zip(at.tolist(), one.kinds, one.names, strict=True):
            kinds[place], names[place] = kind, name
        usual[at] = one.usual
        score[at] += one.score
        information[np.ix_(at, at)] += one.information
        shift[:, at] += one.shift
    return Evidence(tuple(kinds), tuple(names), usual, score, information, shift)


def counted(found: Evidence, slope: Array, names: Sequence[str], u: Array) -> Unmodelled:
    """Uncertainty that the errors add to coefficients of these ``names`` (p,), with their ``slope`` (p, p) by the
    linear form and ``u`` (p,) without."""
    kinds = tuple(dict.fromkeys(found.kinds))
    moment = joint_second_moment(
        found.score, found.information, np.array([kinds.index(kind) for kind in found.kinds])
    )
    eigenvalues, axes = np.linalg.eigh(moment)
    shift = slope @ found.shift
    source = TypeB(SOURCE, 1.0, "1", shift @ axes * np.sqrt(np.maximum(eigenvalues, 0.0)))
    left = np.sqrt(np.diag(moment))
    raised, told = np.zeros(len(u), dtype=bool), list[dict[str, str | float]]()
    for kind in kinds:
        own = np.array([each == kind for each in found.kinds])
        more = np.sqrt(
            np.maximum(np.einsum("ia,ab,ib->i", shift[:, own], moment[np.ix_(own, own)], shift[:, own]), 0.0)
        )
        if (more > LIMITS.considered_part * u).any():
            raised |= more > LIMITS.considered_part * u
            told.append(_item(kind, found, own, left))
    these = [name for name, by in zip(names, raised.tolist(), strict=True) if by]
    walks = ("bias_walk",) if {*BIAS_WALK} & {*kinds} else ()
    return Unmodelled((*kinds, *walks), source, _told(told, these) if these else None)


def _constant(case: Case, now: FilterResult, settings: SelfcalSettings) -> _Effects:
    """Errors that do not change with time."""
    recording, of = case
    known = {*of.names, *settings.model.left_out, *settings.model.stated}
    warm = recording.warm is not None and np.ptp(recording.warm) > 0.0
    named = ALL[18 : WAVE + 2 * len(of.states.harmonics)]
    names = [name for name in named if name not in known and (warm or KIND_OF[name] not in TEMPERATURE)]
    usual = settings.priors[[ALL.index(name) for name in names]]
    return _of_names(case, now, names, [KIND_OF[name] for name in names], usual)


def _wandering(case: Case, now: FilterResult, settings: SelfcalSettings) -> list[_Effects]:
    """Biases that wander about their means: of the walks that are stated, exponentially correlated (A. Gelb, Applied
    Optimal Estimation, 1974, section 3.8), the mean over this recording and cosines of time. None where these are
    states, or where temperature is, by which biases change then."""
    recording, of = case
    walks = [kind for kind in BIAS_WALK if f"{_WANDERS[kind][:3]}_walk_x" not in of.names]
    if not walks or any(ALL.index(name) < WALK and KIND_OF[name] in TEMPERATURE for name in of.names):
        return []
    names = [name for kind in walks for name in STATES[_WANDERS[kind]].parameters]
    kinds = [kind for kind in walks for _ in range(3)]
    sigma = settings.priors[[ALL.index(name) for kind in walks for name in STATES[kind].parameters]]
    lasts = float(recording.t[-1] - recording.t[0])
    through, held = (recording.t - recording.t[0]) / lasts, lasts / LIMITS.walk_time
    waves = []
    for j in range(LIMITS.wandering + 1):
        course = replace(recording, warm=np.cos(j * math.pi * through)), of
        # spectrum of the process at half periods over the recording; that of a mean is half of it
        part = math.sqrt(min((4.0 if j else 2.0) / (held + (j * math.pi) ** 2 / held), 1.0))
        waves.append(_of_names(course, now, names, kinds, part * sigma))
    return waves


def _of_names(
    case: Case, now: FilterResult, names: Sequence[str], kinds: Sequence[str], usual: Array
) -> _Effects:
    """Errors of some names, of usual sizes."""
    recording, of = case
    assert now.history is not None
    innovations, shift = both(recording, of, now.history.attitude, now.coefficients, names, now.restarts)
    there = np.isfinite(regular(recording, now))
    return _Effects(tuple(kinds), tuple(names), usual, innovations[there] * usual, shift * usual)


def _item(kind: str, found: Evidence, own: Array, left: Array) -> dict[str, str | float]:
    """The largest error that is left of a kind, as a row of a table."""
    worst = int(np.flatnonzero(own)[np.argmax(left[own])])
    name = found.names[worst]
    if kind in BIAS_WALK:
        return {"error": kind, "left": left[worst], "usual": 1.0, "unit": "of what is stated"}
    unit, size = shown_unit(UNIT_OF[name])
    usual = float(found.usual[worst]) / size
    return {"error": name, "left": float(left[worst]) * usual, "usual": usual, "unit": unit}


def _told(items: Sequence[Mapping[str, str | float]], names: Sequence[str]) -> Finding:
    """The finding that tells what errors which are not fitted do to u."""
    return Finding(
        "considered",
        f"Errors of the rig that are no states count in u of {counted_names(names, 2)}.",
        action="Name them in states under [model], or state them there.",
        items=tuple(items),
    )
