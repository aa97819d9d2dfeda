"""Cases of self-calibration: bounds in closed form, the recording that ships against its truth, estimators alike."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from inercal.faces.studies.load import load_selfcal_study
from inercal.faces.validate.case import Case, record_of, study_of
from inercal.foundation.arrays import Array
from inercal.foundation.inference.consistency import nis
from inercal.systems.selfcal.before.bounds import PathBounds, bounds
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import KA0, KG0, NAMES, to_linear
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, motion, path
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.settings import Noise, SelfcalSettings

_MICRO_G = 9.80665e-6
_ARCSEC = np.pi / 648000.0


@cache
def _study() -> SelfcalSettings:
    """The study of the recording that ships."""
    return load_selfcal_study(study_of("selfcal"))


def _at_rest(noise: Noise, prior: Array) -> PathBounds:
    """Bounds of a platform that rests for 100 s, rows every 0.5 s, on an earth that does not turn."""
    asked = replace(_study(), plan=PlatformPlan((Rest(100.0),), step=0.5), noise=noise, prior=prior)
    posed = problem(asked)
    posed = replace(posed, world=posed.world._replace(earth=np.zeros(3)))
    return bounds(motion(PlatformPlan((Rest(100.0),), step=0.5), posed.world), posed)


def _known_but(chosen: slice, prior: float) -> Array:
    """A prior (18,) of coefficients that are known, but for some."""
    deviations = np.full(len(_study().prior), 1e-20)
    deviations[chosen] = prior
    return deviations


def _accelerometer_bias() -> Array:
    """u of the biases [ug], 200 readings of 100 ug and a prior of 30 ug."""
    bounded = _at_rest(Noise(1e-15, 100.0 * _MICRO_G, 1e-15), _known_but(KA0, 30.0 * _MICRO_G))
    return np.asarray(bounded.u[KA0] / _MICRO_G)


def _slope() -> Array:
    """u of the gyro biases [rad/s] by encoders of 2 arcsec, without random walk."""
    return np.asarray(_at_rest(Noise(1e-18, 1.0, 2.0 * _ARCSEC), _known_but(KG0, 1.0)).u[KG0])


def _random_walk() -> Array:
    """u of the gyro biases [rad/s] by perfect angles, random walk 1e-7 rad/sqrt(s)."""
    return np.asarray(_at_rest(Noise(1e-7, 1.0, 1e-14), _known_but(KG0, 1.0)).u[KG0])


def _level_axis() -> list[float]:
    """Uncertainty of the scale error of z after two turns that leave z horizontal, over its prior."""
    asked = replace(_study(), plan=path("paper two turns"))
    posed = problem(asked)
    bounded = bounds(motion(path("paper two turns"), posed.world), posed)
    k = NAMES.index("ka1_z")
    return [float(bounded.u[k] / bounded.prior[k])]


@cache
def _found(kind: FilterKind) -> FilterResult:
    """Result of an estimator on the recording that ships."""
    settings = _study()
    return estimate(recording_of(record_of("selfcal"), settings), problem(settings), kind, history=False)


def _probability() -> list[float]:
    """Probability of a smaller sum of squared errors of the 18 coefficients than that found."""
    from scipy.special import gammainc

    filtered, true = _found("error-state"), _study().truth
    if true is None:
        raise ValueError("the study states no truth")
    error = filtered.coefficients - to_linear(true)[:18]
    return [float(gammainc(9.0, 0.5 * float(error @ np.linalg.solve(filtered.covariance, error))))]


def _surprise() -> list[float]:
    """Distance of the mean NIS from its expected value, in standard errors."""
    filtered = _found("error-state")
    return [nis(filtered.nis, filtered.dims).excess]


def _apart() -> Array:
    """Coefficients by least squares less those of the filter, over their standard uncertainties."""
    first, other = _found("error-state"), _found("map")
    return np.asarray((other.coefficients - first.coefficients) / np.sqrt(np.diag(first.covariance)))


def _over_bounds() -> Array:
    """Standard uncertainties of the filter over the bounds before the test, along the true path."""
    settings = _study()
    if settings.plan is None:
        raise ValueError("the study states no plan")
    posed = problem(settings)
    before = bounds(motion(settings.plan, posed.world), posed, truth=settings.truth, history=True).history[-1]
    return np.asarray(np.sqrt(np.diag(_found("error-state").covariance)) / before)


_COUNT = 200.0

CASES = (
    Case(
        "rest-bias",
        "The bound of a bias at rest is that of a mean: 1/u^2 = 1/prior^2 + n/sigma^2",
        "closed form",
        [(30.0**-2 + _COUNT * 100.0**-2) ** -0.5] * 3,
        1e-6,
        _accelerometer_bias,
        "ug",
    ),
    Case(
        "rest-gyro-bias",
        "The bound of a gyro bias by encoders alone is that of the slope of a line through n + 1 angles; "
        "the floor against gimbal lock adds up to 0.0013 of it",
        "closed form",
        [2.0 * _ARCSEC * (12.0 / (0.25 * _COUNT * (_COUNT + 1.0) * (_COUNT + 2.0))) ** 0.5] * 3,
        0.00126 * 2.0 * _ARCSEC * (12.0 / (0.25 * _COUNT * (_COUNT + 1.0) * (_COUNT + 2.0))) ** 0.5,
        _slope,
        "rad/s",
    ),
    Case(
        "rest-random-walk",
        "The bound of a gyro bias by perfect angles is random walk over the root of time",
        "closed form",
        [1e-8] * 3,
        1e-12,
        _random_walk,
        "rad/s",
    ),
    Case(
        "axis-never-raised",
        "Of an accelerometer that stays horizontal nothing is learned: u of its scale error over the prior is 1",
        "closed form",
        [1.0],
        1e-6,
        _level_axis,
    ),
    Case(
        "platform-truth",
        "Recording of a platform: probability of smaller errors of the coefficients than found, two-sided 0.1 %",
        "truth",
        [0.5],
        0.4995,
        _probability,
    ),
    Case(
        "platform-innovations",
        "Recording of a platform: mean normalised innovation squared is off by less than 4.5 standard errors",
        "truth",
        [0.0],
        4.5,
        _surprise,
        "u",
    ),
    Case(
        "platform-bounds",
        "Recording of a platform: u of the filter over the Cramer-Rao bounds along the true path",
        "closed form",
        np.ones(18),
        0.01,
        _over_bounds,
    ),
    Case(
        "platform-batch",
        "Recording of a platform: coefficients by least squares over all rows are those of the filter within 0.02 u",
        "closed form",
        np.zeros(18),
        0.02,
        _apart,
        "u",
    ),
)
