"""The base found from the record before the calibration, where a study states it too roughly.

Filters linearise at their present estimate. About a base that is a degree off the first rows turn beta by far more than
the record supports in the end, and make information up. The batch estimator linearises all rows again where it stands.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import exp, from_matrix, log, multiply
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.before.observability import not_positive
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import BETA
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import Base
from inercal.systems.selfcal.settings import SelfcalSettings


def is_rough(settings: SelfcalSettings) -> bool:
    """True for a base to be found before the calibration: heading unknown, or a wide prior of beta."""
    wide = settings.extended and bool((settings.prior[BETA] > LIMITS.base_sigma).any())
    return settings.heading_unknown or wide


def stated_well(settings: SelfcalSettings, use: str) -> None:
    """Refuse a rough base where it cannot be found first, for a ``use`` in words; raises `StudyError`."""
    if settings.heading_unknown:
        raise StudyError("rig.heading", f"found it unknown, expected a known one for {use}")
    if is_rough(settings):
        widest = math.degrees(float(settings.prior[BETA].max())) * 60.0
        limit = math.degrees(LIMITS.base_sigma) * 60.0
        raise StudyError(
            "prior.beta",
            f"found {widest:.3g} arcmin, with the uncertainty of heading and tilt, expected {limit:.0f} arcmin or less "
            f"for {use}: find the base from a record first",
        )


def with_base(recording: Recording, settings: SelfcalSettings) -> SelfcalSettings:
    """The study with the base found from its recording, and beta, relative to that, to correct it.

    The batch estimator finds the most probable base with the prior of the study; of an unknown heading from four, a
    quarter turn apart, of which the most probable is taken. The prior of beta about the base found is
    `LIMITS.base_prior_ratio` times its bound, the study's where that is narrower; about level axes too, as a tilt of a
    minute of arc by a wide heading is enough to make up information. Larger residuals than the stated noise widen it.
    Where rounding leaves no bound it stays, and the verdict of the calibration says why. The prior of the study enters
    twice: that is nothing where the recording tells a hundred times more, a tenth too little in u where as much.

    Raises StudyError for an unknown heading of which the recording tells less than `LIMITS.heading_u`: at the poles
    earth rate has no north.
    """
    prior, base = settings.prior.copy(), settings.base
    guesses = [base]
    # 1 for the axis of b about which the heading turns, vertical where the base is level
    vertical = np.abs(Base(base.frame).from_geographic()[:, 2])
    if settings.heading_unknown:
        prior[BETA] = np.hypot(prior[BETA], LIMITS.heading_sigma * vertical)
        guesses = [replace(base, heading=0.5 * math.pi * k) for k in range(4)]
    wide = replace(settings.with_extended(), prior=prior)
    tried = [(guess, estimate(recording, problem(replace(wide, base=guess)), "map")) for guess in guesses]
    base, batch = min(tried, key=lambda each: _misfit(each[1]))
    if not math.isfinite(_misfit(batch)):
        return wide  # a recording that contradicts the model: the diagnosis says how
    near = replace(wide, base=base.turned(batch.coefficients[BETA]))
    bound = _bound(recording, near, batch)
    if not_positive(prior[BETA], bound) is not None:
        return near
    u = np.sqrt(np.diag(bound))
    if settings.heading_unknown:
        _refuse_weak(float(vertical @ u), settings)
    scatter = math.sqrt(max(1.0, np.nansum(batch.nis) / max(batch.dims.sum(), 1)))
    last = prior.copy()
    last[BETA] = np.minimum(prior[BETA], LIMITS.base_prior_ratio * scatter * u)
    return replace(near, prior=last)


def heading(base: Base, beta: Array, covariance: Array) -> tuple[float, float]:
    """Heading [rad] of a base that beta (3,) with its covariance (3, 3) corrects, and its standard uncertainty."""
    step = 1e-6
    ends = [base.turned(beta + by).heading for by in step * np.vstack([np.eye(3), -np.eye(3)])]
    slope = np.array([math.remainder(ends[k] - ends[k + 3], 2.0 * math.pi) for k in range(3)]) / (2.0 * step)
    return base.turned(beta).heading, math.sqrt(slope @ covariance @ slope)


def relative(beta: Array, old: Base, new: Base) -> Array:
    """Beta (3,) [rad] against a ``new`` base, from that against an ``old`` one."""
    between = old.from_geographic() @ new.from_geographic().T
    return log(multiply(exp(beta), from_matrix(between)))


def _misfit(batch: FilterResult) -> float:
    """Sum of squares that the batch estimator made smallest; infinite where it did not end."""
    return float(np.nansum(batch.nis)) if batch.converged else math.inf


def _bound(recording: Recording, settings: SelfcalSettings, batch: FilterResult) -> Array:
    """(3, 3) covariance of beta about the base of ``settings`` [rad^2], along the path found."""
    assert batch.history is not None
    coefficients = batch.coefficients.copy()
    coefficients[BETA] = 0.0
    along = batch.history.attitude, coefficients
    bounds = recorded_bounds(recording, problem(settings), *along, restarts=batch.restarts)
    return bounds.covariance[BETA, BETA]


def _refuse_weak(u: float, settings: SelfcalSettings) -> None:
    """Refuse a heading that stays unknown."""
    if u > LIMITS.heading_u:
        at = math.degrees(settings.site.latitude or 0.0)
        raise StudyError(
            "rig.heading",
            f"found unknown, but at latitude {at:.6g} deg this recording tells it to {math.degrees(u):.2g} deg only, "
            "expected a heading that is stated with its uncertainty (or a recording from which u is below "
            f"{math.degrees(LIMITS.heading_u):.2g} deg)",
        )
