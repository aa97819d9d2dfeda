"""States without which a recording contradicts the model: what explains the innovations that no constant error does.

With delays and levers among the states rows count less in which the rate changes; with biases that walk they follow the
sensors. Each addition is tried by the error-state filter. The first that leaves innovations white is named, else that
which leaves them whitest; 1/f noise, which is no walk to the letter, by the walk that takes most of them away.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.consistency import whiteness
from inercal.foundation.units import parse_quantity
from inercal.systems.selfcal.diagnosis.fit_quality import Case, filtered, once, regular, short, sound
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, BIAS_WALK, KIND_OF, RIG, STATES
from inercal.systems.selfcal.settings import Noise

_TOGETHER: Final = "several errors of the rig together"

#: kinds of states that are tried, and how they are named
_TRIED: Final[tuple[tuple[tuple[str, ...], str, str], ...]] = (
    (("delay",), "sensors that are late", "delay"),
    (("levers",), "accelerometers away from the centre of the gimbals", "levers"),
    (("accelerometer_walk",), "accelerometer biases that wander", "bias_walk"),
    (("gyro_walk",), "gyro biases that wander", "bias_walk"),
    (BIAS_WALK, "biases that wander", "bias_walk"),
    ((*RIG, "k2", "levers"), _TOGETHER, '"rig", "k2", "levers"'),
    ((*RIG, "k2", "levers", *BIAS_WALK), _TOGETHER, '"rig", "k2", "levers", "bias_walk"'),
)

_FACTORS: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Of the walks that are stated."""


class Explained(NamedTuple):
    """An explanation of innovations: the ``finding``, and how ``white`` it leaves them, the probability by chance of
    their correlations."""

    finding: Finding
    white: float


@once
def needed_states(case: Case) -> Explained | None:
    """The addition to the states that leaves innovations white, or most nearly so, if any does."""
    recording, problem = short(case)
    first = filtered((recording, problem))
    best, most, much = None, None, LIMITS.left_over * _off(recording, first) * _throughout(recording, first)
    for kinds, words, named in _TRIED:
        walks, before = {*kinds} <= {*BIAS_WALK}, math.inf
        for factor in _FACTORS if {*BIAS_WALK} & {*kinds} else (1.0,):
            wider = _with_states(problem, kinds, factor)
            known = len(wider.names) == len(problem.names)
            if known and (kinds != BIAS_WALK or factor == 1.0):
                continue
            now = filtered((recording, wider))
            white = whiteness(regular(recording, now)) if sound(now) else 0.0
            larger = f"{factor:g} times accelerometer_walk and gyro_walk under [noise]"
            advice = f"state {larger}" if known else f"name {named} in states under [model]"
            if factor > 1.0 and not known:
                advice += f", with {larger}"
            if white > max(LIMITS.nearly_white, best.white if best else 0.0):
                text = f"{words} explain the innovations"
                best = Explained(Finding("unmodelled", text, harm=EVERYTHING, action=advice), white)
            if white > LIMITS.risk:
                return best
            left = _off(recording, now)
            if walks and left < much:
                text = f"most of the innovations look like {words}, as with 1/f noise"
                found = Finding("unmodelled", text, harm=EVERYTHING, action=advice)
                most, much = Explained(found, white), 0.5 * left
            if left > before:
                break
            before = left
    return best or most


def _off(recording: Recording, now: FilterResult) -> float:
    """Distance of innovations from white ones of the stated size: the largest, over both sensors, of what their mean
    square is off and of their correlation from row to row."""
    z, off = regular(recording, now), 0.0
    for columns in (z[:, :3], z[:, 3:]):
        products, squares = columns[1:] * columns[:-1], np.square(columns)
        if np.isfinite(products).any():
            mean = float(np.nanmean(squares))
            alike = abs(float(np.nanmean(products))) / mean if mean > 0.0 else 0.0
            off = max(off, abs(mean - 1.0), alike)
    return off


def _throughout(recording: Recording, now: FilterResult) -> bool:
    """True where innovations are too large in most of the recording, as noise makes them, not in a part of it."""
    squares = np.square(regular(recording, now))
    if not np.isfinite(squares).any():
        return False
    parts = [part[np.isfinite(part)] for part in np.array_split(squares, LIMITS.even_parts)]
    usual = float(np.median([part.mean() for part in parts if len(part)]))
    return usual - 1.0 > 0.5 * (float(np.nanmean(squares)) - 1.0)


def _with_states(problem: FilterProblem, kinds: tuple[str, ...], factor: float) -> FilterProblem:
    """The problem with more kinds of states, with their usual priors, and walks larger by a factor."""
    prior = dict(zip(problem.names, problem.prior, strict=True))
    usual = {kind: parse_quantity(STATES[kind].prior, STATES[kind].dimension, kind).value for kind in kinds}
    noise: Noise = replace(
        problem.noise,
        gyro_walk=factor * problem.noise.gyro_walk,
        accelerometer_walk=factor * problem.noise.accelerometer_walk,
    )
    usual |= {"gyro_walk": noise.gyro_walk_sigma, "accelerometer_walk": noise.accelerometer_walk_sigma}
    names = tuple(name for name in ALL if name in prior or KIND_OF[name] in kinds)
    own = {name: size for name, size in prior.items() if KIND_OF[name] not in {*BIAS_WALK} & {*kinds}}
    sizes = np.array([own.get(name, usual.get(KIND_OF[name], 0.0)) for name in names])
    vector = replace(problem.states, names=names)
    return replace(problem, noise=noise, prior=sizes, vector=vector)
