"""Self-calibrations with the states of a rig, by the simulator of tests/selfcal/test_rig_states.py."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "selfcal"))
sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "studies"))

import numpy as np
from test_rig_states import BASE, drawn, recorded

from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.settings import PlatformStates

SEED = 20261123


@cache
def posed(kinds):
    """Settings and problem of a model with these kinds of states."""
    settings = replace(BASE, model=PlatformStates(kinds))
    return settings, problem(settings)


@dataclass(frozen=True)
class Calibration:
    """Calibrations by their numbers, with errors drawn from the priors of these ``kinds`` of states."""

    kinds: tuple[str, ...]

    def __call__(self, number):
        """Errors of the states, their covariance, and the mean NIS."""
        settings, of = posed(self.kinds)
        rng = np.random.default_rng([SEED, number])
        c = drawn(settings, rng, self.kinds)
        found = estimate(recorded(settings, c, rng), of, "error-state", history=False)
        error = found.coefficients - c[of.states.index]
        return [error.tolist(), found.covariance.tolist(), float(np.nanmean(found.nis))]
