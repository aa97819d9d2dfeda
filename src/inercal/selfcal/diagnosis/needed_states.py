"""States without which a recording contradicts the model: what explains the innovations that no constant error does.

With delays and levers among the states rows count less in which the rate changes; with biases that walk they follow the
sensors. Each addition is tried by the error-state filter, and named if it leaves innovations that are nearly white.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from inercal.estimate.consistency import whiteness
from inercal.findings import EVERYTHING, Finding
from inercal.selfcal.diagnosis.fit_quality import Case, filtered, once, regular, short, sound
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.states import ALL, BIAS_WALK, KIND_OF, RIG, STATES
from inercal.selfcal.settings import Noise
from inercal.units import parse_quantity

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

_FACTORS: Final = (1.0, 2.0, 4.0, 8.0)
"""Of the walks that are stated."""


@once
def needed_states(case: Case) -> Finding | None:
    """The first addition to the states that leaves innovations nearly white, if any."""
    recording, problem = short(case)
    for kinds, words, named in _TRIED:
        walking = bool({*BIAS_WALK} & {*kinds})
        for factor in _FACTORS if walking else (1.0,):
            wider = _with_states(problem, kinds, factor)
            if len(wider.names) > len(problem.names) and _nearly_white((recording, wider)):
                text = f"{words} explain the innovations: name {named} in states under [model]"
                if factor > 1.0:
                    text += f", with {factor:g} times accelerometer_walk and gyro_walk under [noise]"
                return Finding("unmodelled", text, harm=EVERYTHING)
    return None


def _nearly_white(case: Case) -> bool:
    """True where innovations are of the stated size, and hardly correlated: 1/f noise is no walk to the letter."""
    now = filtered(case)
    return sound(now) and whiteness(regular(case[0], now)) > LIMITS.nearly_white


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
    sizes = np.array([prior.get(name, usual.get(KIND_OF[name], 0.0)) for name in names])
    vector = replace(problem.states, names=names)
    return replace(problem, noise=noise, prior=sizes, vector=vector)
