"""The unknowns of an IMU on a table, and the linear equations of each sensor in them.

    accelerometer i :  y = B_i (f + A r_i) + q_i l_i^2 + bias ,  l_i = B_i f / B_ii
    gyro i :           y = B_i (omega + C h) + G_i f + bias

B = S M and S T are the gains, q = K1 K2 where K2 is asked for; f, omega, C the table's force, rate and attitude, for
angles that come late by a shift; A r the acceleration of a sensor that sits r beside the crossing of the axes; h earth
rate in n; and all of them turned by the errors of the table.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.rigs.chain import Chain, Scope
from inercal.systems.imu.aided.blocks import BlockMotion, Blocks
from inercal.systems.imu.aided.table import TableMotion, error_nodes
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import AidedSettings

Indices = NDArray[np.int64]

SHIFT_U = 1.0
"""Prior standard deviation [s] of the delay of the angles, after a search in whole blocks."""

ARM_U = 0.5
"""Prior standard deviation [m] of the place of a sensor beside the crossing of the axes, along each axis."""


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns (P,) without the biases: ``places`` of each group, prior ``mean`` and ``sd``, both (P,).

    The priors of ``stated`` groups are knowledge: earth rate, and the errors of the table. In a budget, a group has the
    name in ``sources``, its own if there is none. The groups in ``redrawn`` have other values in the next test.
    """

    places: Mapping[str, Indices]
    mean: Array
    sd: Array
    units: Mapping[str, str]
    stated: frozenset[str]
    sources: Mapping[str, str]
    redrawn: frozenset[str]


def one_axis(chain: Chain) -> bool:
    """True for a table that turns about one axis alone, which leaves coefficients open however it turns."""
    return len(chain.joints) == 1


def unknowns(
    site: Site,
    options: AidedSettings,
    scales: Mapping[str, float],
    values: Mapping[str, Indices],
    g_sensitivity: bool,
    squares: bool,
    raw: frozenset[str] = frozenset(),
) -> Unknowns:
    """Lay out the unknowns.

    Parameters
    ----------
    site : Site
    options : AidedSettings
    scales : mapping
        Scale factor [output per SI unit] to begin with, of ``acc`` and, where there is a gyro, ``gyro``.
    values : mapping
        Number of the value that each error of the table has in each rest, by its name
        (`inercal.systems.imu.aided.table.values_of`).
    g_sensitivity, squares : bool
        Drift of the gyro by specific force, and K2 of the accelerometers.
    raw : set
        Sensors in counts or volts, of which no unit tells a scale factor.

    What one axis leaves open is known as of any instrument: scale factors within 5 % of their unit, misalignments
    within 50 mrad. Of more axes gains have no prior that says anything.
    """
    narrow = one_axis(options.chain)
    groups: list[tuple[str, Array, Array, str]] = [
        (f"time shift of {sensor}", np.zeros(1), np.full(1, SHIFT_U), "s") for sensor in scales
    ]
    if "acc" in scales:
        groups.append(("lever arm", np.zeros(9), np.full(9, ARM_U), "m"))
    if "gyro" in scales:
        groups.append(("earth rate", *_earth(site, options), "rad/s"))
    for error in options.chain.errors:
        if error.name not in values:
            continue
        count = int(values[error.name].max()) + 1
        groups.append((error.name, np.zeros(count), np.full(count, error.distribution.std), "rad"))
    for sensor, scale in scales.items():
        sd = np.full((3, 3), LIMITS.usual_gain_u if narrow else 1.0)
        np.fill_diagonal(sd, 1.0 if sensor in raw else sd[0, 0])
        groups.append((f"gain {sensor}", scale * np.eye(3).ravel(), scale * sd.ravel(), "1"))
    if squares:
        groups.append(("gain K2", np.zeros(3), np.full(3, scales["acc"] / site.gravity), "1"))
    if g_sensitivity and "gyro" in scales:
        groups.append(("gain G", np.zeros(9), np.full(9, 0.1 * scales["gyro"] / site.gravity), "1"))
    ends = np.cumsum([0, *(len(mean) for _, mean, _, _ in groups)])
    places = {name: np.arange(a, b) for (name, *_), a, b in zip(groups, ends[:-1], ends[1:], strict=True)}
    return Unknowns(
        places,
        np.concatenate([mean for _, mean, _, _ in groups]),
        np.concatenate([sd for _, _, sd, _ in groups]),
        {name: unit for name, _, _, unit in groups},
        frozenset(name for name in places if name == "earth rate" or name in options.chain.factors),
        {error.name: error.source for error in options.chain.errors},
        frozenset(error.name for error in options.chain.errors if error.scope is Scope.POSITION),
    )


def _earth(site: Site, options: AidedSettings) -> tuple[Array, Array]:
    """Mean and standard deviation (3,) of earth rate north, west and up [rad/s]."""
    up, up_u = site.vertical_rate, site.vertical_rate_u
    least = 1e-9 * EARTH_RATE
    if options.azimuth_u is None or site.latitude is None:
        across = max(site.horizontal_rate_u, least)
        return np.array([0.0, 0.0, up]), np.array([across, across, max(up_u, least)])
    north = EARTH_RATE * math.cos(site.latitude)
    north_u = EARTH_RATE * abs(math.sin(site.latitude)) * site.latitude_u
    west_u = min(options.azimuth_u, 1.0) * north
    return np.array([north, 0.0, up]), np.maximum([north_u, west_u, up_u], least)


@dataclass(frozen=True, eq=False)
class Side:
    """One triad on the table: its blocks, and the turns ``errors`` (n, 3, Q) that unit errors of the table make.

    They act on the mean force as ``force x errors``, on the mean rate as ``rate_errors`` (n, 3, Q).
    """

    sensor: str
    blocks: Blocks
    errors: Array
    rate_errors: Array
    error_places: Indices

    def rate_change(self, rate: Array) -> Array:
        """(n, 3, Q): change of the mean rate by the errors, ``phi' + omega x phi``."""
        return self.rate_errors + np.cross(rate[:, :, None], self.errors, axis=1)


def side_of(blocks: Blocks, motion: TableMotion, rests: Array, layout: Unknowns) -> Side:
    """Prepare a triad."""
    at = {
        k: _turns(motion, t, rests)
        for k, t in enumerate((blocks.nodes[:, 0], blocks.middle, blocks.nodes[:, -1]))
    }
    names = [error.name for error in motion.chain.errors if error.name in layout.places]
    places = np.concatenate([layout.places[name] for name in names]) if names else np.zeros(0, dtype=np.int64)
    change = (at[2] - at[0]) / blocks.length[:, None, None]
    return Side(blocks.triad.sensor, blocks, at[1], change, places)


def _turns(motion: TableMotion, t: Array, rests: Array) -> Array:
    """(n, 3, Q): turn of the instrument by unit errors at times t."""
    parts = [nodes.slopes[:, :, None] * nodes.hats[:, None, :] for nodes in error_nodes(motion, t, rests)]
    return np.concatenate(parts, axis=-1) if parts else np.zeros((len(t), 3, 0))


@dataclass(frozen=True, eq=False)
class Equation:
    """One sensor, along ``axis`` of its triad: ``residual`` (n,) of its blocks, ``columns`` (n, a) their derivatives by
    the unknowns ``index``."""

    index: Indices
    columns: Array
    residual: Array
    axis: int


def equations(side: Side, ref: BlockMotion, layout: Unknowns, x: Array, gravity: float) -> Iterator[Equation]:
    """The sensors of a triad at unknowns ``x`` (P,)."""
    places = layout.places
    B = x[places[f"gain {side.sensor}"]].reshape(3, 3)
    force = gravity * ref.C_bn[:, :, 2]
    if side.sensor == "acc":
        errors = np.cross(force[:, :, None], side.errors, axis=1)
        slope = gravity * ref.C_slope[:, :, 2]
    else:
        h = x[places["earth rate"]]
        errors = side.rate_change(ref.rate)
        slope = ref.rate_slope + ref.C_slope @ h
    turned = errors @ x[side.error_places]
    for i in side.blocks.axes:
        if side.sensor == "acc":
            own, label = ref.arm, places["lever arm"][3 * i : 3 * i + 3]
            # the gain does not act on the lever arm in the derivatives: else an arm would seem to tell of it
            true = force + turned
        else:
            own, label = ref.C_bn, places["earth rate"]
            true = ref.rate + turned + ref.C_bn @ h
        index = [
            places[f"gain {side.sensor}"][3 * i : 3 * i + 3],
            places[f"time shift of {side.sensor}"],
            label,
            side.error_places,
        ]
        columns = [
            true,
            (slope @ B[i])[:, None],
            np.einsum("j,njk->nk", B[i], own),
            np.einsum("j,njq->nq", B[i], errors),
        ]
        predicted = true @ B[i]
        if side.sensor == "acc":
            predicted = predicted + columns[2] @ x[label]
            if "gain K2" in places:
                along, q = true @ B[i] / B[i, i], float(x[places["gain K2"][i]])
                columns[0] = true + 2.0 * q * along[:, None] / B[i, i] * (
                    true - np.outer(along, np.eye(3)[i])
                )
                index.append(places["gain K2"][i : i + 1])
                columns.append(along[:, None] ** 2)
                predicted = predicted + q * along**2
        if side.sensor == "gyro" and "gain G" in places:
            G_i = places["gain G"][3 * i : 3 * i + 3]
            index.append(G_i)
            columns.append(force)
            predicted = predicted + force @ x[G_i]
        yield Equation(np.concatenate(index), np.hstack(columns), side.blocks.y[:, i] - predicted, i)
