"""A record with its truth, and what the calibration of it was worth."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

import inercal as ic

Array = NDArray[Any]

DEG = np.pi / 180
ARCSEC = DEG / 3600
DEG_H = DEG / 3600
G0 = 9.80665
EARTH_RATE = 7.292115e-5


@dataclass(frozen=True)
class Case:
    """One record (or several), its study, and the true values in SI.

    ``residual`` (n,) are the readings less the model at the true values, over their noise, and ``columns`` (n, p) what
    a unit of each value does to them, or a function that finds it; None where readings depend on what nobody knows.
    ``values`` takes from a result names, values, u and U where these are not its parameters.
    """

    records: Any
    study: Any
    truth: Mapping[str, float]
    residual: Array | None = None
    columns: Array | Callable[[], Array] | None = None
    values: Callable[[Any], tuple[list[str], Array, Array, Array]] | None = None


Act = Callable[[Any, float], None]
"""A fault: it changes the world of a simulator before or while readings are made, by a size."""


class Scene(Protocol):
    """A rig, an instrument and a plan with all random numbers drawn: only a fault and its size are left open."""

    def case(self, act: Act | None = None, size: float = 0.0) -> Case:
        """The record that is made with this fault."""
        ...


@dataclass(frozen=True)
class Outcome:
    """What inercal said of a case, and how far its values are off."""

    status: str
    message: str
    findings: list[dict[str, Any]]
    names: list[str]
    value: Array
    u: Array
    U: Array
    error: Array


def _without_folder(text: str) -> str:
    """A text without the folder of a passing file, so that the same run gives the same lines."""
    return re.sub(r"[^\s(\"']*rows\.csv", "rows.csv", text)


def outcome(case: Case) -> Outcome:
    """Calibrate the record of a case; a record that is refused has the status ``refused`` and no values."""
    none = np.zeros(0)
    try:
        result = ic.calibrate(case.records, case.study)
    except ic.InputError as error:
        return Outcome("refused", str(error), [], [], none, none, none, none)
    if case.values is None:
        of = result.estimate
        kept = [k for k, name in enumerate(of.names) if name in case.truth]
        names = [of.names[k] for k in kept]
        value, u = (np.asarray(column, float)[kept] for column in (of.values, of.u))
        U = np.array([of[name].U for name in names])
    else:
        names, value, u, U = case.values(result)
    truth = np.array([case.truth[name] for name in names])
    findings = [
        {
            "code": finding.code,
            "headline": _without_folder(finding.headline),
            "action": _without_folder(finding.action),
            "harm": list(finding.harm),
            "items": [dict(item) for item in finding.items][:12],
        }
        for finding in result.findings
    ]
    return Outcome(result.status.value, result.message, findings, names, value, u, U, value - truth)


def pattern(case: Case, sound: Case) -> float | None:
    """Size of what a fault does to the whitened readings, after the columns of the values are projected out."""
    if case.residual is None or sound.residual is None or sound.columns is None:
        return None
    if case.residual.shape != sound.residual.shape:
        return None
    step = case.residual - sound.residual
    columns = sound.columns() if callable(sound.columns) else sound.columns
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left = step - columns @ np.linalg.lstsq(columns, step, rcond=None)[0]
    return float(np.sqrt(left @ left))


def columns_of(model: Callable[[Mapping[str, float]], Array], truth: Mapping[str, float]) -> Array:
    """Differences (n, p) of a model by each of its values."""
    found = []
    for name, value in truth.items():
        step = 1e-4 * abs(value) if value else 1e-6
        up, down = (model({**truth, name: value + sign * step}) for sign in (1, -1))
        found.append((up - down) / (2 * step))
    return np.stack(found, axis=-1)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A draw between ``low`` and ``high``, evenly over orders of magnitude."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def turn(axis: str, angle: Array | float) -> Array:
    """Rotation matrices (..., 3, 3) about x, y or z; their columns are the new axes in the old frame."""
    c, s = np.cos(angle), np.sin(angle)
    found = np.zeros((*np.shape(angle), 3, 3))
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    found[..., i, i] = 1.0
    found[..., j, j] = found[..., k, k] = c
    found[..., j, k], found[..., k, j] = -s, s
    return found


def turned_by(vector: Array) -> Array:
    """Rotation matrices (..., 3, 3) by rotation vectors (..., 3)."""
    from scipy.spatial.transform import Rotation

    flat = np.reshape(vector, (-1, 3))
    return Rotation.from_rotvec(flat).as_matrix().reshape(*np.shape(vector)[:-1], 3, 3)
