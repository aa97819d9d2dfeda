"""Cases of strapdown units: the record of another program against its truth, two estimators, closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np

from inercal.faces.studies.load import load_strapdown_study
from inercal.faces.validate.case import Case, record_of, study_of
from inercal.foundation.arrays import Array
from inercal.systems.strapdown.fit.error_state import filtered
from inercal.systems.strapdown.model.coefficients import (
    KA,
    KG,
    SIZE,
    TAU,
    A,
    D,
    R,
    array_of,
    names,
    slope,
    stated,
)
from inercal.systems.strapdown.model.delay import delayed
from inercal.systems.strapdown.model.samples import Samples, freed
from inercal.systems.strapdown.settings import StrapdownSettings
from inercal.systems.strapdown.task import StrapdownCalibration, calibrate

_G = 9.7803267715
"""The g of PSINS' units ug and ug/g^2 [m/s^2]."""

_SECOND, _DPH = np.pi / 648000.0, np.pi / 648000.0


def _injected() -> dict[str, float]:
    """The coefficients by symbol [SI] that the record holds: the inverse of the corrections that were injected."""
    misaligned = {"T_xy": 10, "T_xz": 20, "T_yx": 30, "T_yz": 40, "T_zx": 50, "T_zy": 60}
    axes = {"M_yx": 10, "M_zx": 20, "M_zy": 30}
    values = {"tau_a": -1e-3}
    for i, axis in enumerate("xyz", start=1):
        values |= {f"S_{axis}": 1.0 - 1e-5 * i, f"K1_{axis}": 1.0 - 1e-5 * i, f"D_F_{axis}": -0.1 * i * _DPH}
        values |= {f"K0_{axis}": -1e-5 * i * _G, f"K2_{axis}": -1e-5 * i / _G}
        values |= {f"r_x{axis}": -0.01 * i, f"r_y{axis}": -0.01 * (i + 3)}
    for name, angle in (misaligned | axes).items():
        scale = values[f"{'S' if name[0] == 'T' else 'K1'}_{name[2]}"]
        values[name] = angle * _SECOND / scale
    return values


@cache
def _study() -> StrapdownSettings:
    """The study of the record that ships."""
    return load_strapdown_study(study_of("strapdown"))


@cache
def _found() -> StrapdownCalibration:
    """The calibration of that record."""
    return calibrate(record_of("strapdown"), _study())


def errors_over_u() -> Array:
    """Errors of the 31 coefficients over their standard uncertainties."""
    estimate, truth = _found().estimate, _injected()
    return np.array([(estimate[name].value - truth[name]) / estimate[name].u for name in estimate.names])


def _by_filter() -> Array:
    """Coefficients by the error-state filter less those of the batch, over their standard uncertainties."""
    calibration = _found()
    batch = calibration.fit
    if batch is None:
        raise ValueError("the batch found nothing")
    of_filter = filtered(calibration.samples, batch.nodes, _study())
    if of_filter is None:
        raise ValueError("the filter ran off")
    return np.asarray((of_filter.c - batch.c)[batch.free] / np.sqrt(np.diag(batch.covariance)))


def _drawn() -> Array:
    """Coefficients (51,) of a poor unit."""
    rng, c = np.random.default_rng(21), np.zeros(SIZE)
    c[D], c[KG], c[A] = (
        1e-2 * rng.standard_normal(3),
        1e-2 * rng.standard_normal(9),
        1e-3 * rng.standard_normal(3),
    )
    c[KA] = 1e-2 * np.triu(rng.standard_normal((3, 3))).ravel()
    c[R.start : R.start + 6], c[TAU] = 0.05 * rng.standard_normal(6), 3e-3
    return c


def _frames() -> list[float]:
    """Squared length of a step of the coefficients over their covariance, in the other frame over that in this."""
    settings, c = _study(), _drawn()
    prior = np.where(settings.deviations() > 0.0, settings.deviations(), 0.0)
    free, terms = np.flatnonzero(prior[:49]), settings.terms
    free = free[np.isin(free, [*range(37)])]

    def length(frame: str) -> float:
        def of(values: Array) -> Array:
            whole = c.copy()
            whole[free] = values
            return stated(whole, terms, "upper" if frame == "upper" else "lower")

        J, step = slope(of, c[free]), 1e-4 * prior[free]
        moved = of(c[free] + step) - of(c[free] - step)
        return float(moved @ np.linalg.solve(J @ np.diag(prior[free] ** 2) @ J.T, moved))

    return [length("lower") / length("upper")]


def _there_and_back() -> Array:
    """Coefficients in the frame ``lower`` and back, less themselves."""
    c, terms = _drawn(), ("k2", "size", "delay", "asymmetry", "g_sensitivity")
    of = dict(zip(names(terms, "lower"), stated(c, terms, "lower").tolist(), strict=True))
    return np.asarray((array_of(of, "lower") - c)[:49])


def _lever() -> Array:
    """Force [m/s^2] of an accelerometer x 2 cm off on the x axis, turning at 1.5 rad/s about z, without its place."""
    c, rate = np.zeros(SIZE), 1.5
    c[R.start] = 0.02
    turning = Samples(
        np.tile([0.0, 0.0, rate], (50, 1)), np.tile([-(rate**2) * 0.02, 0.0, 9.8], (50, 1)), 0.01
    )
    return np.asarray(freed(turning, c).f[25])


def _late() -> Array:
    """Means of t^3 over samples of 10 ms, 13.7 ms later than those given."""
    edges = 0.01 * np.arange(41.0)
    means = (edges[1:] ** 4 - edges[:-1] ** 4) / 0.04
    then = edges - 0.0137
    true = (then[1:] ** 4 - then[:-1] ** 4) / 0.04
    return np.asarray((delayed(np.tile(means[:, None], (1, 3)), 1.37)[:, 0] - true)[10:-10])


CASES = (
    Case(
        "rests-psins-truth",
        "The 31 coefficients of a simulated record are those that were injected, over u",
        "PSINS",
        np.zeros(31),
        0.3,
        errors_over_u,
    ),
    Case(
        "rests-filter-batch",
        "The error-state filter ends where the batch does, over u",
        "closed form",
        np.zeros(32),
        0.01,
        _by_filter,
    ),
    Case("rests-frames", "A step has one length in u, in both frames", "closed form", [1.0], 1e-5, _frames),
    Case(
        "rests-frames-back",
        "Coefficients in the frame lower and back are the same",
        "closed form",
        np.zeros(49),
        1e-13,
        _there_and_back,
    ),
    Case(
        "rests-lever-arm",
        "At r_xx accelerometer x reads -w^2 r_xx, which comes off",
        "closed form",
        [0.0, 0.0, 9.8],
        1e-12,
        _lever,
        "m/s^2",
    ),
    Case(
        "rests-delay",
        "A cubic through four running sums shifts means of a cube to rounding",
        "closed form",
        np.zeros(20),
        1e-9,
        _late,
    ),
)
