"""Errors of the rig that are no states, before the test: how far those of usual size shift coefficients."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.systems.selfcal.before.bounds import nominal_attitudes
from inercal.systems.selfcal.before.considered import sensitivities
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.plan import CommandedMotion
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, WAVE
from inercal.systems.selfcal.settings import SelfcalSettings


class LeftOut(NamedTuple):
    """Names (m,) of errors that are no states, and their standard deviations ``sizes`` (m,) [SI]."""

    names: tuple[str, ...]
    sizes: Array


def left_out(settings: SelfcalSettings) -> LeftOut:
    """The errors of ``design.robust``, as large as stated, else as usual; raises `StudyError` for one that is a
    state."""
    states, sizes = settings.states, settings.priors
    for kind in settings.search.robust:
        if kind in settings.kinds:
            text = f"found {kind}, which is among the states, expected errors that are left out of them"
            raise StudyError("design.robust", text)
    named = ALL[18 : WAVE + 2 * len(states.harmonics)]
    hidden = {*states.names, *settings.model.left_out}
    names = tuple(name for name in named if KIND_OF[name] in settings.search.robust and name not in hidden)
    return LeftOut(names, np.array([sizes[ALL.index(name)] for name in names]))


def shifts(motion: CommandedMotion, problem: FilterProblem, of: LeftOut, warm: Array | None = None) -> Array:
    """Shifts (p, m) of the coefficients, product form, by one standard deviation of each error along a nominal path.

    ``warm`` (n,) [K] as of `inercal.systems.selfcal.before.bounds.bounds`.
    """
    if not of.names:
        return np.zeros((len(problem.prior), 0))
    n, c = len(motion.t), problem.mean
    q = nominal_attitudes(motion, problem, c, warm)
    recording = Recording(motion.t, motion.rate, motion.angles, np.zeros((n, 3)), warm=warm)
    return np.asarray(product_slope(c) @ sensitivities(recording, problem, q, c, of.names) * of.sizes)
