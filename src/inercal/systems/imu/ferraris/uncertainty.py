"""One covariance for all coefficients: every error of the readings and inputs, carried through the method.

The derivatives of the closed form take each error to the coefficients. Alignment also acts in second order: a position
tilted by d shows g cos d along its own axis, a turn about a tilted axis its angle times cos d. The method does not
correct for that, so that the mean of it and its spread are uncertainties (GUM F.2.4.5), of scale factors above all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.results.budget import TypeA, TypeB
from inercal.systems.imu.ferraris.method import Matrices, derivatives
from inercal.systems.imu.ferraris.names import UP
from inercal.systems.imu.ferraris.readings import SectionReadings
from inercal.systems.imu.ferraris.scatter import Scatter
from inercal.systems.imu.second_order import SOURCE
from inercal.systems.imu.settings import FerrarisSettings

_AXIS = np.repeat(np.arange(3), 2)


@dataclass(frozen=True, eq=False)
class Propagation:
    """Readings and matrices with the derivatives ``by`` (33, *shape) of the coefficients, by input."""

    readings: SectionReadings
    solution: Matrices
    scatter: Scatter
    by: dict[str, Array]


def propagation(readings: SectionReadings, solution: Matrices, scatter: Scatter) -> Propagation:
    """Take the derivatives."""
    return Propagation(readings, solution, scatter, derivatives(readings.inputs, readings.weights))


def type_a(p: Propagation, acc_unit: str, gyro_unit: str) -> list[TypeA]:
    """Uncertainties by noise of the sensors and, where no alignment is stated, by scatter of the positions."""
    readings, scatter = p.readings, p.scatter
    rest = scatter.means["gyro"]
    noise = readings.noise["gyro"]
    # a bias that wandered from position to position did so from turn to turn
    wander = np.mean(np.maximum(rest - noise.variance(readings.lengths), 0.0), axis=0)
    turned = noise.variance(readings.inputs.durations) + wander
    sources = [
        _noise("accelerometer noise", p.by["force"], scatter.means["acc"], scatter.dof["acc"], acc_unit),
        _noise("gyro output at rest", p.by["rate"], rest, scatter.dof["gyro"], gyro_unit),
        _noise("gyro noise in the turns", p.by["turned_rate"], turned, scatter.dof["gyro"], gyro_unit),
    ]
    if math.isfinite(scatter.tilt_dof):
        seen = TypeB("position scatter", scatter.tilt, "rad", alignment(p, scatter.tilt))
        sources.append(TypeA(seen.source, seen.u, seen.unit, seen.covariance, scatter.tilt_dof))
    return sources


def _noise(source: str, by: Array, variance: Array, dof: float, unit: str) -> TypeA:
    """Independent errors of mean outputs (n, 3)."""
    flat = by.reshape(len(by), -1)
    typical = float(np.sqrt(np.mean(variance[variance > 0.0]))) if np.any(variance > 0.0) else 0.0
    return TypeA(source, typical, unit, (flat * variance.ravel()) @ flat.T, dof)


def noise_covariance(p: Propagation) -> Array:
    """(33, 33): covariance by the noise of the sensors alone, as their Allan fits have it."""
    readings, x = p.readings, p.readings.inputs
    rows = (
        ("force", "acc", readings.lengths),
        ("rate", "gyro", readings.lengths),
        ("turned_rate", "gyro", x.durations),
    )
    parts = [
        _noise("", p.by[name], readings.noise[sensor].variance(times), 1.0, "")
        for name, sensor, times in rows
    ]
    return np.asarray(np.sum([part.covariance for part in parts], axis=0))


def alignment(p: Propagation, tilt: float) -> Array:
    """(33, q): changes of the coefficients by a unit tilt of each position and turn, in either direction.

    The last ten columns are of second order, and so hold a factor ``tilt``: the mean of (d1^2 + d2^2)/2 over all, which
    is tilt^2, and its standard deviation of each, which is the same.
    """
    x, solution = p.readings.inputs, p.solution
    first, second = [], []
    for k, j in enumerate(_AXIS):
        to_force, to_rate = (
            p.by["force"][:, k] @ solution.force_gain,
            p.by["rate"][:, k] @ solution.apparent_g,
        )
        both = float(x.gravity) * (to_force + to_rate)
        first += [both[:, d] for d in range(3) if d != j]
        second.append(-both @ UP[k])
    for k in range(3):
        turned = p.by["turned_rate"][:, k] @ solution.rate_gain * float(x.angles[k] / x.durations[k])
        first += [turned[:, d] for d in range(3) if d != k]
        second.append(-turned[:, k])
    return np.column_stack([*first, tilt * np.sum(second, axis=0), *(tilt * each for each in second)])


def type_b(
    p: Propagation, site: Site, time_base_u: float, options: FerrarisSettings, acc_unit: str, gyro_unit: str
) -> list[TypeB]:
    """Uncertainties by gravity, the angle of the turns, alignment, the clock, earth rate and coarse outputs."""
    by, scatter = p.by, p.scatter
    sources = [TypeB(i.source, i.u, i.unit, by["gravity"] * i.sensitivity) for i in site.inputs]
    if options.turn_u > 0.0:
        sources.append(TypeB("turn angle", options.turn_u, "rad", by["angles"], redrawn=True))
    if scatter.tilt > 0.0 and math.isinf(scatter.tilt_dof):
        sources.append(TypeB("alignment", scatter.tilt, "rad", alignment(p, scatter.tilt), redrawn=True))
    if time_base_u > 0.0:
        scaled = by["durations"] @ p.readings.inputs.durations
        sources.append(TypeB("time base", time_base_u, "1", scaled))
    if site.vertical_rate_u > 0.0:
        sources.append(TypeB("vertical earth rate", site.vertical_rate_u, "rad/s", by["vertical_rate"]))
    if site.horizontal_rate_u > 0.0:
        sources.append(
            TypeB(
                "horizontal earth rate",
                site.horizontal_rate_u,
                "rad/s",
                _horizontal_earth_rate(p),
                redrawn=True,
            )
        )
    return [*sources, *_coarse(p, acc_unit, gyro_unit), *_unequal_holds(p)]


def doubtful_turns(p: Propagation, doubt: Array) -> list[TypeB]:
    """Uncertainty by turns that may have been up to ``doubt`` (3,) [rad] larger or smaller (GUM F.2.3.3)."""
    u = doubt / math.sqrt(3.0)
    size = float(np.max(u))
    return (
        [TypeB("choice of the turns", size, "rad", p.by["angles"] * (u / size), redrawn=True)] if size else []
    )


def second_order(p: Propagation, size: float) -> list[TypeB]:
    """Uncertainty by K2 of the accelerometers, 0 with a standard deviation ``size`` [1/(m/s^2)]: it is all in K0."""
    along = np.diag(p.solution.force_gain) * (float(p.readings.inputs.gravity) * UP) ** 2
    by_axis = np.einsum("pki,ki->pi", p.by["force"], along)
    return [TypeB(SOURCE, size, "1/(m/s^2)", by_axis)] if size > 0.0 else []


def mean_noise(p: Propagation) -> float:
    """Standard deviation [m/s^2] of the mean specific force in a position by the noise of the accelerometers."""
    variance = p.readings.noise["acc"].variance(p.readings.lengths)
    return float(np.sqrt(np.mean(variance / np.diag(p.solution.force_gain) ** 2)))


def _horizontal_earth_rate(p: Propagation) -> Array:
    """(33, 18): by either horizontal component in each position and turn, the heading of each unknown."""
    columns = []
    for k, j in enumerate(_AXIS):
        at_rest = p.by["rate"][:, k] @ p.solution.rate_gain
        columns += [at_rest[:, d] for d in range(3) if d != j]
    for k, (cosine, sine) in enumerate(p.readings.swing):
        turned = p.by["turned_rate"][:, k] @ p.solution.rate_gain
        a, b = turned[:, (k + 1) % 3], turned[:, (k + 2) % 3]
        columns += [cosine * a - sine * b, sine * a + cosine * b]
    return np.column_stack(columns)


def _coarse(p: Propagation, acc_unit: str, gyro_unit: str) -> list[TypeB]:
    """Outputs too coarse for their noise: in each position of the accelerometers another rounding error, of the gyro
    the same in all, u = step/sqrt(12) (GUM F.2.2.1)."""
    sources = []
    for sensor, name, unit in (("acc", "accelerometer", acc_unit), ("gyro", "gyro", gyro_unit)):
        steps = p.readings.resolution[sensor]
        largest = float(np.max(steps))
        if largest > 0.0:
            by = p.by["force"].reshape(-1, 18) if sensor == "acc" else p.by["rate"].sum(axis=1)
            shares = np.tile(steps / largest, by.shape[1] // 3)
            sources.append(TypeB(f"{name} resolution", largest / math.sqrt(12.0), unit, by * shares))
    return sources


def _unequal_holds(p: Propagation) -> list[TypeB]:
    """Uncertainty by the g-sensitivity that stays in the gyro's bias where the positions are not equally long.

    The bias is the mean of all samples, as in the method; the mean specific force over them is known, but nothing is
    taken off for it.
    """
    mean = float(p.readings.inputs.gravity) * p.readings.weights @ UP
    size = float(np.linalg.norm(mean))
    if size == 0.0:
        return []
    shift = p.by["rate"].sum(axis=1) @ p.solution.apparent_g @ mean / size
    return [TypeB("unequal holds", size, "m/s^2", shift, redrawn=True)]
