"""Cases of turntables: exact sensitivities, designs of positions, calibrations with and without errors of the table."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from inercal.faces.validate.case import Case
from inercal.faces.validate.table import TABLE, TABLE_CASES, one_turntable_calibration, settings_of
from inercal.foundation.arrays import Array
from inercal.foundation.designs.criteria import basis, in_basis
from inercal.foundation.rigs.outputs import gravity_reference, table_outputs
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import averages, exact
from inercal.foundation.sensitivities.indices import Indices
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.simulate import simulate_positions
from inercal.systems.turntable.task import calibrate

_ARCMIN = np.radians(1.0 / 60.0)
_CHAIN = turntable(TABLE, uniform(2.0 * _ARCMIN))
_OUTPUTS = table_outputs(("ax", "ay", "az"), 9.8, None)

_OUTER = ("dphi_y1", "deps_y")
_INNER = ("dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y")
_OTHERS = ("dalpha_x1", "dalpha_z1", "deps_x", "dphi_z2", "dtheta_z")
_P = 1.0 / (np.pi * 3.0**0.5)


def _columns(names: tuple[str, ...]) -> list[int]:
    """Places of factors."""
    return [_CHAIN.factors.index(name) for name in names]


@cache
def _full_circle() -> Indices:
    """The paper's case: eleven errors, uniform on 2 arcmin, over 36 by 36 positions."""
    return exact.analyse(_CHAIN, _OUTPUTS, grid((36, 36)).angles)


def _at(angles: ArrayLike) -> Indices:
    """Indices at some positions [rad]."""
    return exact.analyse(_CHAIN, _OUTPUTS, angles)


def _together() -> Array:
    """Shares of outer, inner and other factors in the three accelerations together."""
    return averages.aggregate(_full_circle()).total[_columns(_OUTER + _INNER + _OTHERS)]


def _key_factors() -> list[int]:
    """Number of the paper's six key factors that are among the first six by the mean over the accelerations."""
    mean = averages.mean(_full_circle()).first.mean(axis=0)
    return [len(set(np.argsort(-mean)[:6].tolist()) & set(_columns(_OUTER + _INNER)))]


def _ratios() -> Array:
    """dalpha_y2 over the factors that the paper sets beside it, on ax, weighted by variance."""
    ax = averages.weighted(_full_circle()).first[0]
    beside = ("dalpha_z1", "dphi_z2", "dtheta_z", "dphi_y1", "deps_y", "dalpha_x1", "deps_x")
    return np.asarray(ax[_columns(("dalpha_y2",))] / ax[_columns(beside)])


def _vertical() -> Array:
    """Indices of az, first order and interactions, where the inner axis is vertical."""
    indices, rows = _at([[0.0, 0.0]]), _columns((*_OUTER, *_INNER, "dalpha_x1", "deps_x"))
    return np.concatenate([indices.first[2, 0, rows], indices.total_minus_first[2, 0, rows]])


def _icosahedron() -> list[float]:
    """Condition number and D-efficiency of nine drift terms with gravity towards the corners of an icosahedron."""
    tilt = np.arctan(2.0)
    turns = 2.0 * np.pi * np.arange(5) / 5.0
    rings = [(tilt, turn) for turn in turns] + [(np.pi - tilt, turn + np.pi / 5.0) for turn in turns]
    angles = np.array([(0.0, 0.0), *rings, (np.pi, 0.0)])
    towards = gravity_reference() @ turntable(TABLE, None).attitude(angles)
    return list(in_basis(basis(towards)))


_DEG_PER_H = parse_unit("deg/h").factor
_WHEEL = {
    "k_x": 1.01, "k_y": -0.02, "k_z": 0.01, "kY_x": 0.015, "kY_y": 0.99, "kY_z": -0.01,
    **{f"DX_{name}": value * _DEG_PER_H for name, value in {
        "F": 50.0, "X": 60.0, "Y": 40.0, "Z": 8.0, "XX": 2.0, "YY": 1.5, "XY": 1.0, "XZ": 3.0, "YZ": 2.5}.items()},
    **{f"DY_{name}": value * _DEG_PER_H for name, value in {
        "F": -20.0, "X": 35.0, "Y": -55.0, "Z": 5.0, "XX": -1.0, "YY": 2.5, "XY": 2.0, "XZ": -1.5, "YZ": 3.5}.items()},
}  # fmt: skip


def _without_errors() -> list[float]:
    """Coefficients of a gyrowheel on a perfect table without noise, less the true ones, over the sizes of their kinds:
    1 and 50 deg/h."""
    latitude = np.radians(39.1)
    perfect = replace(settings_of(_WHEEL, None, latitude), chain=turntable(TABLE, None))
    settings = settings_of({}, 1e-6, latitude)
    estimate = calibrate(simulate_positions(perfect, np.random.default_rng(1)), settings).estimate
    size = {"k": 1.0, "D": 50.0 * _DEG_PER_H}
    return [(estimate[name].value - true) / size[name[0]] for name, true in _WHEEL.items()]


_RUNS = 20
_SEED = 20230519


def _nees() -> list[float]:
    """Normalised squared error of 24 coefficients, mean over simulated calibrations, over 24."""
    total = 0.0
    for run in range(_RUNS):
        one = one_turntable_calibration(np.random.default_rng([_SEED, run]))
        total += float(one["error"] @ np.linalg.solve(one["covariance"], one["error"])) / len(one["error"])
    return [total / _RUNS]


CASES = (
    Case(
        "zhao-shares",
        "Shares of the eleven table errors in the three accelerations are 2/15, 1/10 and 1/15",
        "Zhao 2023",
        [2 / 15] * 2 + [1 / 10] * 4 + [1 / 15] * 5,
        2e-6,
        _together,
    ),
    Case(
        "zhao-key-factors",
        "The six key factors of the paper lead in the mean over the accelerations",
        "Zhao 2023",
        [6],
        0.0,
        _key_factors,
    ),
    Case(
        "zhao-full-circle",
        "Means of the first order of ax over the full circle of both angles",
        "Zhao 2023",
        [5 / 18 - _P, _P - 1 / 9, 1 / 9, _P - 1 / 9, 5 / 18 - _P, 1 / 9, 0, 1 / 6, 0, 1 / 6, 1 / 9],
        1.5e-4,
        lambda: averages.mean(_full_circle()).first[0],
    ),
    Case(
        "zhao-ratio",
        "dalpha_y2 matters twice as much for ax as the others, weighted by variance",
        "Zhao 2023",
        [2.0] * 7,
        2e-5,
        _ratios,
    ),
    Case(
        "zhao-vertical",
        "Where the inner axis is vertical az has only squares and products: first order 0.8/54.4, interactions 12/54.4",
        "closed form",
        [0.8 / 54.4] * 8 + [12 / 54.4] * 8,
        3e-6,
        _vertical,
    ),
    Case(
        "zhao-knife-edge",
        "dphi_y1 on az by first order: 1/68 where the inner axis is vertical, 1/8 at one tolerance from there",
        "closed form",
        [1 / 68, 0.125],
        [2e-7, 1e-4],
        lambda: _at(np.array([[0.0, 0.0], [2.0, 0.0]]) * _ARCMIN).first[
            2, :, _CHAIN.factors.index("dphi_y1")
        ],
    ),
    Case(
        "design-icosahedron",
        "Gravity towards the corners of an icosahedron, a spherical 5-design: condition and D-efficiency are 1",
        "closed form",
        [1.0, 1.0],
        1e-9,
        _icosahedron,
    ),
    Case(
        "gyrowheel-noiseless",
        "24 coefficients of a gyrowheel on a perfect table without noise are the true ones, relative to their size",
        "truth",
        np.zeros(24),
        1e-9,
        _without_errors,
    ),
    Case(
        "gyrowheel-errors",
        f"Normalised squared errors of {_RUNS} calibrations of drawn gyrowheels on drawn tables have the mean 1, "
        "within 4.5 standard errors of chi-square",
        "truth",
        [1.0],
        4.5 * (2.0 / (24.0 * _RUNS)) ** 0.5,
        _nees,
    ),
    *TABLE_CASES,
)
