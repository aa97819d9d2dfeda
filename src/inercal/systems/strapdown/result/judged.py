"""A fit of a strapdown unit as its judge sees it: coefficients that change by order, reading and history, and terms
that the study leaves out.

Columns of what is asked are those of coefficients in each interval between nodes, times a shape over the intervals.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.evidence import FitEvidence, of_normal_equations
from inercal.foundation.inference.judge import answers, asked_of, blind
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.inference.questions import Question, lagging, over_time
from inercal.systems.strapdown.fit.batch import Fit
from inercal.systems.strapdown.fit.unmodelled import eliminated
from inercal.systems.strapdown.model.coefficients import (
    ALWAYS,
    GRAVITY,
    GROUPS,
    K0,
    KA,
    KG,
    LATITUDE,
    OPTIONS,
    D,
)
from inercal.systems.strapdown.model.samples import Samples, freed
from inercal.systems.strapdown.settings import StrapdownSettings

_FAMILIES = {
    "gyro_bias": ("the biases of the gyros", True),
    "scale": ("the scale factors of the gyros", True),
    "misalignment": ("the misalignments of the gyros", True),
    "bias": ("the biases of the accelerometers", True),
    "k1": ("the scale factors of the accelerometers", True),
    "axes": ("the misalignments of the accelerometers", True),
}
"""Groups of coefficients that are always fitted, in words."""

_DIAGONAL = (0, 4, 8)

_DRIFTS = "bias_drift"
"""Code of biases that drift."""

_WALKING = ("drift", "bend", "sway")
"""Verbs of biases that walk."""


class _Term(NamedTuple):
    """A group of coefficients that a study may leave out: cell, subject, verb and rest of its question."""

    cell: str
    what: str
    verb: str
    rest: str


_TERMS = {
    "k2": _Term("reading", "the accelerometers", "curve", "with the square of specific force"),
    "size": _Term("place", "the accelerometers", "stand", "apart"),
    "delay": _Term("history", "the accelerometers", "lag", "behind the gyros"),
    "asymmetry": _Term("reading", "the gyros", "differ", "between positive and negative rates"),
    "g_sensitivity": _Term("place", "the gyros", "drift", "by specific force"),
}


def judged_unit(
    fit: Fit,
    samples: Samples,
    settings: StrapdownSettings,
    found: tuple[str, ...],
    slope: Array,
    u: Array,
) -> Iterator[Finding]:
    """Findings about all that rests and turns show beside the coefficients.

    ``slope`` (v, p) is of the values ``found`` by the coefficients of the fit, ``u`` (v,) are theirs.
    """
    try:
        of_fit, table = evidence_of_unit(fit, samples, settings, slope)
    except np.linalg.LinAlgError:
        return
    pairs = asked_of(of_fit, table)
    yield from answers(found, u, of_fit, pairs)
    yield from blind(found, u, of_fit, pairs)


def drifting(
    still: Fit,
    samples: Samples,
    settings: StrapdownSettings,
    found: tuple[str, ...],
    slope: Array,
    u: Array,
) -> Iterator[Finding]:
    """Findings about biases that drift, of the fit ``still`` in which they do not walk: a drift in proportion to time
    looks like a walk, and is said where it harms a value. Arguments as of `judged_unit`."""
    steady = replace(settings, noise=replace(settings.noise, gyro_walk=0.0, accelerometer_walk=0.0))
    try:
        of_fit, table = evidence_of_unit(still, samples, steady, slope, _DRIFTS)
    except np.linalg.LinAlgError:
        return
    yield from (finding for finding in answers(found, u, of_fit, asked_of(of_fit, table)) if finding.harm)


def evidence_of_unit(
    fit: Fit, samples: Samples, settings: StrapdownSettings, slope: Array, code: str = ""
) -> tuple[FitEvidence, list[Question]]:
    """The evidence of a fit and all that is asked of it, or what has a ``code``; noise counts as known, or as too low.

    Raises LinAlgError where rounding leaves nothing of the information.
    """
    table = [question for question in _questions(fit, samples, settings) if not code or question.code == code]
    columns = np.concatenate([question.columns for question in table], axis=2)
    H, g = eliminated(fit, columns, np.zeros(columns.shape[2]))
    of_fit, made = of_normal_equations(H, g, slope, fit.chi2, fit.dof, _noise_dof(fit))
    ends = np.cumsum([question.columns.shape[2] for question in table])
    parts = np.split(made, ends[:-1], axis=1)
    return of_fit, [
        Question(q.cell, q.what, q.plural, q.verb, q.rest, part, q.code, q.action)
        for q, part in zip(table, parts, strict=True)
    ]


def _noise_dof(fit: Fit) -> float:
    """0 where residuals tell the size of the noise; inf where they are below what is stated: one noise of several is
    stated too large then, and the others are what they are."""
    return math.inf if fit.chi2 < fit.dof else 0.0


def _questions(fit: Fit, samples: Samples, settings: StrapdownSettings) -> Iterator[Question]:
    """All questions, their columns (k, 6, m) by interval."""
    G, motion = fit.sensitivities, freed(samples, fit.c)
    rate, force = (_means(x, fit.nodes.sample) for x in (motion.w, motion.f))
    yield from _terms(fit, settings)
    yield from _by_order(fit, settings)
    yield from _by_reading(G, rate, force)
    yield from _by_history(G, rate, force)


def _means(x: Array, sample: NDArray[np.int64]) -> Array:
    """Means (k, 3) of samples (n, 3) from node to node."""
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(x, axis=0)])[sample]
    return np.asarray(np.diff(sums, axis=0) / np.diff(sample)[:, None])


def _shaped(columns: Array, shape: Array) -> Array:
    """Columns (k, 6, q) times each shape (k, m): (k, 6, q m)."""
    return np.asarray((columns[:, :, :, None] * shape[:, None, None, :]).reshape(*columns.shape[:2], -1))


def _terms(fit: Fit, settings: StrapdownSettings) -> Iterator[Question]:
    """Groups of coefficients that the study leaves out, and an earth rate of another latitude."""
    for group in (group for group in OPTIONS if group not in settings.terms):
        term = _TERMS[group]
        yield Question(
            term.cell, term.what, True, term.verb, term.rest, fit.sensitivities[:, :, list(GROUPS[group])],
            "unmodelled", f'Add "{group}" to terms.',
        )  # fmt: skip
    if LATITUDE not in fit.free:
        action = "Check site.latitude, or state it with its uncertainty."
        columns = fit.sensitivities[:, :, [LATITUDE]]
        yield Question(
            "place",
            "earth rate",
            False,
            "differ",
            "from that of the latitude",
            columns,
            "site_suspect",
            action,
        )
    if GRAVITY not in fit.free:
        action = "Check site.gravity, or state it with its uncertainty."
        columns = fit.sensitivities[:, :, [GRAVITY]]
        yield Question(
            "place", "gravity", False, "differ", "from what is stated", columns, "site_suspect", action
        )


def _by_order(fit: Fit, settings: StrapdownSettings) -> Iterator[Question]:
    """Coefficients that change over the record. Biases that may walk are not asked whether they do."""
    middle = 0.5 * (fit.nodes.sample[1:] + fit.nodes.sample[:-1])
    walking = {"gyro_bias": settings.noise.gyro_walk > 0.0, "bias": settings.noise.accelerometer_walk > 0.0}
    G = fit.sensitivities
    subjects: list[tuple[str, str, bool, Array]] = [
        (group, *_FAMILIES[group], G[:, :, list(GROUPS[group])]) for group in ALWAYS if group in _FAMILIES
    ]
    T = [KG.start + k for k in range(9)]
    turned = np.stack([G[:, :, T[i]] - G[:, :, T[j]] for i, j in ((5, 7), (6, 2), (1, 3))], axis=2)
    subjects.append(("frame", "the frame of the gyros", False, turned))
    if not any(walking.values()):
        both = np.concatenate([G[:, :, list(GROUPS[group])] for group in walking], axis=2)
        together = _shaped(both, over_time(middle.astype(float))[0][2])
        yield Question(
            "order", "the biases of gyros and of accelerometers", True, "drift", "over the record", together,
            _DRIFTS, "Let the unit warm up, or state noise.gyro_walk and noise.accelerometer_walk.",
        )  # fmt: skip
    for group, what, plural, columns in subjects:
        drift = walking.get(group) is False
        walk = "gyro_walk" if group == "gyro_bias" else "accelerometer_walk"
        for verb, rest, shape in over_time(middle.astype(float)):
            if (verb == "sway" and group not in walking) or (walking.get(group) and verb in _WALKING):
                continue
            named = drift and verb == "drift"
            yield Question(
                "order", what, plural, verb, rest, _shaped(columns, shape),
                _DRIFTS if named else "", f"Let the unit warm up, or state noise.{walk}." if named else "",
            )  # fmt: skip


def _by_reading(G: Array, rate: Array, force: Array) -> Iterator[Question]:
    """Outputs that are distorted by their own size: of gyros by the mean rate (k, 3), of accelerometers by the mean
    force."""
    for what, x, scales, biases in (
        ("the gyros", rate, [KG.start + k for k in _DIAGONAL], list(range(D.start, D.stop))),
        ("the accelerometers", force, [KA.start + k for k in _DIAGONAL], list(range(K0.start, K0.stop))),
    ):
        top = max(float(np.abs(x).max()), 1e-300)
        size, own, bias = np.abs(x) / top, G[:, :, scales], G[:, :, biases]
        high, cubic = (size > 0.5).astype(float), size**2
        sign = np.sign(x) * (size > LIMITS.near_zero)
        for verb, rest, columns in (
            ("differ", "above half their range", own * high[:, None]),
            (
                "curve",
                "over their range",
                np.concatenate([own * size[:, None], own * cubic[:, None]], axis=2),
            ),
            ("step", "where they change their sign", bias * sign[:, None]),
        ):
            yield Question("reading", what, True, verb, rest, columns)
            alike = columns.sum(axis=2, keepdims=True)
            yield Question("reading", what, True, verb, f"{rest}, all alike", alike)


def _by_history(G: Array, rate: Array, force: Array) -> Iterator[Question]:
    """Outputs that remember the turn before, or its load."""
    top = max(float(np.abs(rate).max()), 1e-300)
    turning = np.abs(rate) > LIMITS.near_zero * top
    sense = _last(np.sign(rate) * turning)
    for what, biases in (("the biases of the gyros", D), ("the biases of the accelerometers", K0)):
        columns = G[:, :, biases]
        yield Question(
            "history", what, True, "depend", "on the sense of the turn before", columns * sense[:, None]
        )
        load = lagging(np.linalg.norm(rate, axis=1) / top)[:, None]
        yield Question("history", what, True, "follow", "turns with a lag", _shaped(columns, load))
        kept = np.concatenate([np.zeros((1, 3)), force[:-1] - force[1:]]) / max(
            float(np.abs(force).max()), 1e-300
        )
        yield Question("history", what, True, "keep", "a part of the force before", columns * kept[:, None])


def _last(x: Array) -> Array:
    """The last value (k, 3) before each that is not 0."""
    out, here = np.zeros_like(x), np.zeros(x.shape[1])
    for k, row in enumerate(x):
        out[k] = here
        here = np.where(row != 0.0, row, here)
    return out
