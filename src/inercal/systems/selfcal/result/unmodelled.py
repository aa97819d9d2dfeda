"""Errors of the rig that are neither states nor stated: what this recording leaves of them, in u.

A K2, a harmonic or a bias that wanders may shift coefficients by several u before any test finds it. Each is as large
as usual, or smaller where the innovations say so (`inercal.foundation.inference.effects`): score and information follow
from the columns that the errors would have as states. Only where the states are those of a rig: a model of the
literature is taken at its word, and a finding says what that leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.effects import joint_second_moment
from inercal.foundation.inference.scores import ErrorColumns
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.budget import TypeB
from inercal.systems.selfcal.diagnosis.passed import PlatformPass
from inercal.systems.selfcal.filters.whitened import BLOCKS
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.states import (
    ALL,
    BIAS_WALK,
    KIND_OF,
    RIG,
    STATES,
    TEMPERATURE,
    UNIT_OF,
    WALK,
)
from inercal.systems.selfcal.settings import SelfcalSettings

SOURCE = "errors of the rig that are not fitted"

_BIAS = {"gyro_walk": "kg0", "accelerometer_walk": "ka0"}
"""Kind of a walk -> the biases that walk."""


class Unmodelled(NamedTuple):
    """Kinds of errors that are not fitted but ``counted`` in u, as states and studies call them, what they add to the
    budget, and the finding that tells of them, None where that is little."""

    counted: tuple[str, ...]
    source: TypeB
    finding: Finding | None


class _Effects(NamedTuple):
    """Errors: ``kinds`` (q,) and ``names`` (q,) of the states that they would be, ``usual`` (q,) sizes [SI], and their
    ``columns`` in a pass."""

    kinds: tuple[str, ...]
    names: tuple[str, ...]
    usual: Array
    columns: ErrorColumns


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


def unmodelled(passed: PlatformPass, settings: SelfcalSettings, u: Array) -> Unmodelled | None:
    """Errors that a calibration does not fit, whose coefficients have ``u`` (p,) without them; None where the states
    are not those of a rig, or where no error is left."""
    found, result = evidence(passed, settings), passed.result
    if found is None:
        return None
    return counted(found, product_slope(result.coefficients), result.names, u)


def evidence(passed: PlatformPass, settings: SelfcalSettings) -> Evidence | None:
    """Evidence that a recording has of errors which a calibration leaves out; None as in `unmodelled`."""
    if not {*RIG} <= {*settings.kinds}:
        return None
    parts = [part for part in (_constant(passed, settings), _wandering(passed, settings)) if part.names]
    if not parts:
        return None
    sums, usual = passed.sums, np.concatenate([part.usual for part in parts])
    information = np.block([[sums.information(a.columns, b.columns) for b in parts] for a in parts])
    return Evidence(
        tuple(kind for part in parts for kind in part.kinds),
        tuple(name for part in parts for name in part.names),
        usual,
        np.concatenate([sums.score(part.columns) for part in parts]) * usual,
        information * np.outer(usual, usual),
        np.hstack([passed.reach(part.columns) for part in parts]) * usual,
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


def _constant(passed: PlatformPass, settings: SelfcalSettings) -> _Effects:
    """Errors that do not change with time."""
    known = {*settings.model.left_out, *settings.model.stated}
    names = tuple(name for name in passed.errors if name not in known)
    usual = settings.priors[[ALL.index(name) for name in names]]
    return _Effects(tuple(KIND_OF[name] for name in names), names, usual, passed.of_names(names))


def _wandering(passed: PlatformPass, settings: SelfcalSettings) -> _Effects:
    """Biases that wander about their means: of the walks that are stated, exponentially correlated (A. Gelb, Applied
    Optimal Estimation, 1974, section 3.8), the mean over this recording and cosines of time. None where these are
    states, or where temperature is, by which biases change then."""
    of, recording = passed.problem, passed.recording
    walks = [kind for kind in BIAS_WALK if f"{_BIAS[kind]}_walk_x" not in of.names]
    if any(ALL.index(name) < WALK and KIND_OF[name] in TEMPERATURE for name in of.names):
        walks = []
    names = [name for kind in walks for name in STATES[_BIAS[kind]].parameters]
    kinds = [kind for kind in walks for _ in range(3)]
    sigma = settings.priors[[ALL.index(name) for kind in walks for name in STATES[kind].parameters]]
    held = float(recording.t[-1] - recording.t[0]) / LIMITS.walk_time
    waves = np.arange(LIMITS.wandering + 1)
    # spectrum of the process at half periods over the recording; that of a mean is half of it
    parts = np.where(waves > 0, 4.0, 2.0) / (held + (waves * math.pi) ** 2 / held)
    through = (np.arange(BLOCKS) + 0.5) / BLOCKS
    at = np.array([of.names.index(name) for name in names], dtype=np.int64)
    columns = ErrorColumns(at, np.cos(math.pi * np.multiply.outer(through, waves)))
    usual = np.multiply.outer(np.sqrt(np.minimum(parts, 1.0)), sigma).ravel()
    return _Effects(tuple(kinds) * len(waves), tuple(names) * len(waves), usual, columns)


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
