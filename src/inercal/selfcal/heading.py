"""A base of unknown heading: earth rate tells it, as in gyrocompassing."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.selfcal.coefficients import BETA
from inercal.selfcal.filtered import Filtered, problem
from inercal.selfcal.filtering import estimate
from inercal.selfcal.recording import Recording
from inercal.selfcal.settings import SelfcalSettings

WIDTH = math.radians(60.0)
"""Standard deviation [rad] of a first guess; the filter finds a heading from as far away."""

LAST = 30.0
"""Prior of the heading at last, in standard uncertainties of what was found: a thousandth of what the recording tells.

From a prior as wide as `WIDTH` the first rows turn beta by many degrees while all else is known poorly too, and what a
linearised filter loses there it does not get back: errors of several u of other coefficients.
"""


def with_heading(recording: Recording, settings: SelfcalSettings) -> SelfcalSettings:
    """The study with the heading that its recording tells, and beta, with a prior of `LAST` u, to correct it.

    The error-state filter of the extended model is run from four headings, a quarter turn apart; the one whose
    innovations fit best is near the true one, and is run again from what it found, until that no longer changes.
    Earth rate has no north at the poles, and no heading is found there.
    """
    up = int(np.argmax(np.abs(settings.world.up)))
    prior = settings.prior.copy()
    prior[BETA.start + up] = WIDTH
    wide = replace(settings, prior=prior, filter=replace(settings.filter, extended=True))
    guesses = [replace(wide, base=replace(wide.base, heading=0.5 * math.pi * k)) for k in range(4)]
    best = min(guesses, key=lambda guess: _misfit(_run(recording, guess)))
    for _ in range(5):
        change = _turn(_run(recording, best), best, up)
        best = replace(best, base=replace(best.base, heading=_wrapped(best.base.heading + change)))
        if abs(change) < 1e-6:
            break
    prior = prior.copy()
    prior[BETA.start + up] = min(
        WIDTH, LAST * math.sqrt(_run(recording, best).covariance[BETA, BETA][up, up])
    )
    return replace(best, prior=prior)


def _run(recording: Recording, settings: SelfcalSettings) -> Filtered:
    """The extended error-state filter."""
    return estimate(recording, problem(settings), "error-state", history=False)


def _misfit(found: Filtered) -> float:
    """Mean normalised innovation squared; infinite where the filter diverged."""
    return found.nis_mean if math.isfinite(found.nis_mean) else math.inf


def _turn(found: Filtered, settings: SelfcalSettings, up: int) -> float:
    """Change of the heading [rad]: beta about the upward axis turns components from north to east."""
    return float(found.coefficients[BETA][up]) * float(np.sign(settings.world.up[up]))


def _wrapped(angle: float) -> float:
    """An angle in (-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)
