"""A rate test as a record has it, and the rate that a gyro on the turning table senses.

The table turns about one joint at a constant rate W while its other axes stand. On the instrument's axes the
rate is ``W e + w``: e the turning axis, w earth rate. As the table turns, w is ``w0 + w1 cos(phi) + w2 sin(phi)``:
the part along the turning axis stays, the part across it averages out over whole turns, and over an arc from
phi by s its mean takes ``sin(s/2)/(s/2)`` of the value at mid-arc. Only a gyro whose axis is not the turning axis
sees the part across.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.instruments.by_angle import CHANNELS
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.chain import Chain, Joint
from inercal.foundation.rigs.outputs import rate_reference
from inercal.foundation.units import Unit
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.rate.ends import ends, known_change, settled
from inercal.systems.turntable.settings import TurntableSettings


@dataclass(frozen=True, eq=False)
class RateDwells:
    """Readings of a rate test, one for each stay at a rate.

    Attributes
    ----------
    rate : (n,) rad/s, commanded or measured, in the order taken
    angles : (n, joints) rad; those of the turning joint do not matter
    turn : (n, 3) means over each stay of 1, cos(phi), sin(phi), phi the angle of the turning joint
    channels : (c,) names of gyros
    unit : Unit
        Of the record.
    y : (n, c) mean outputs, in the SI unit of ``unit``
    joint : (n,) index of the turning joint
    assumed : bool
        The record does not hold the angle of the turning joint: whole turns are taken for granted.
    """

    rate: Array
    angles: Array
    turn: Array
    channels: tuple[str, ...]
    unit: Unit
    y: Array
    joint: NDArray[np.int64]
    assumed: bool = False

    def some(self, stays: NDArray[np.int64]) -> RateDwells:
        """Those of the stays alone."""
        return replace(
            self,
            rate=self.rate[stays],
            angles=self.angles[stays],
            turn=self.turn[stays],
            y=self.y[stays],
            joint=self.joint[stays],
        )


def rate_dwells(record: Record, joints: tuple[str, ...], joint: str, duration: float) -> RateDwells:
    """Readings of a rate test from its record.

    Without a column ``position`` each row is the mean over one stay of ``duration`` [s], and the angle of the
    turning joint is that at its start. With one, rows of one number are samples of one stay, each with its own
    angle, if there are several of them.

    Parameters
    ----------
    record : Record
        ``rate``, angles of the joints (that of the turning one may be absent), and gyro channels.
    joints : tuple of str
        Of the table, base first.
    joint : str
        The one that turns; a column ``joint`` of the record, with 1 for the first, goes first.
    duration : float
        Of a stay [s].

    Raises
    ------
    RecordError
        No such channels, channels in different units or lengths, an axis that should stand but moves within a
        stay, or a stay without a number.
    """
    where = record.sources[0].path if record.sources else "record"
    channels = tuple(name for name in CHANNELS["gyro"] if name in record)
    if not channels:
        raise RecordError(
            where, f"found {', '.join(record.columns)}, expected one of {', '.join(CHANNELS['gyro'])}"
        )
    unit = record[channels[0]].unit
    if "rate" not in record:
        raise RecordError(where, f"found {', '.join(record.columns)}, expected a column rate for a rate test")
    rate = record["rate"].si()
    has_angle = joint in record or "joint" in record
    still = np.zeros(len(rate))
    angles = [record[name].si() if has_angle or name != joint else still for name in joints]
    for name in channels:
        if record[name].unit != unit or len(record[name].values) != len(rate):
            raise RecordError(where, f"{name} has another unit or length than rate or {channels[0]}")
    if any(len(each) != len(rate) for each in angles):
        raise RecordError(where, "the angles have another length than rate, expected one table")
    y = np.stack([record[name].values for name in channels], axis=-1) * unit.factor
    table = np.stack(angles, axis=-1)
    number = record["position"].values if "position" in record else still
    whole = np.isfinite(np.column_stack([rate, table, y, number])).all(axis=1)
    if not whole.all():
        row = int(np.argmin(whole)) + 1
        raise RecordError(
            where, f"row {row} has no number for a rate, an angle, an output or its stay, expected one"
        )
    groups = _groups(record, len(rate))
    turning = _turning(record, joints, joint, where)
    for rows in groups:
        standing = [k for k in range(len(joints)) if k != turning[rows[0]]]
        moved = np.abs(np.sin(0.5 * (table[rows][:, standing] - table[rows[0], standing])))
        if np.any(moved > 0.5 * LIMITS.position_angle):
            raise RecordError(
                where,
                f"an axis moves within a stay (row {rows[0] + 1}), expected only "
                f"{joints[turning[rows[0]]]} to turn",
            )
    means = np.array([rate[rows].mean() for rows in groups])
    turn = np.zeros((len(groups), 3))
    turn[:, 0] = 1.0
    if has_angle:
        for k, rows in enumerate(groups):
            phi = table[rows, turning[rows[0]]]
            span = means[k] * duration
            turn[k] = arc(phi[0], span) if len(rows) == 1 else arc(phi, np.zeros(len(rows))).mean(axis=0)
    return RateDwells(
        means,
        np.array([table[rows[0]] for rows in groups]),
        turn,
        channels,
        unit,
        np.array([y[rows].mean(axis=0) for rows in groups]),
        turning[[rows[0] for rows in groups]],
        not has_angle,
    )


def _turning(record: Record, joints: tuple[str, ...], joint: str, where: object) -> NDArray[np.int64]:
    """Index of the joint that turns (rows,)."""
    if "joint" not in record:
        return np.full(len(record["rate"].values), joints.index(joint))
    number = record["joint"].values
    wrong = ~np.isin(number, np.arange(1, len(joints) + 1))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise RecordError(
            where, f"row {row + 1}: joint is {number[row]:g}, expected 1 to {len(joints)}, 1 for {joints[0]}"
        )
    return np.asarray(number - 1.0, dtype=np.int64)


def _groups(record: Record, rows: int) -> list[NDArray[np.int64]]:
    """Rows of each stay: stretches of one position number, else single rows."""
    every = np.arange(rows)
    breaks = np.diff(record["position"].values) != 0.0 if "position" in record else np.ones(rows - 1, bool)
    if "joint" in record:
        breaks = breaks | (np.diff(record["joint"].values) != 0.0)
    return np.split(every, np.flatnonzero(breaks) + 1)


def arc(start: Array | float, span: Array | float) -> Array:
    """Means (*batch, 3) of 1, cos(phi), sin(phi) for phi from ``start`` by ``span`` [rad]."""
    start, half = np.asarray(start, dtype=float), 0.5 * np.asarray(span, dtype=float)
    middle, shrunk = start + half, np.sinc(half / np.pi)
    return np.stack(np.broadcast_arrays(1.0, shrunk * np.cos(middle), shrunk * np.sin(middle)), axis=-1)


def over_turn(of_angles: Callable[[Array], Array], angles: Array, joint: int, turn: Array) -> Array:
    """Mean over an arc of anything that is linear in cosine and sine of one joint's angle.

    Parameters
    ----------
    of_angles : callable
        From angles (n, joints) to values (n, ...).
    angles : (n, joints) rad
    joint : int
        Index of the turning joint.
    turn : (n, 3)
        As in `RateDwells`.
    """

    def at(phi: float) -> Array:
        turned = angles.copy()
        turned[:, joint] = phi
        return of_angles(turned)

    ahead, behind, beside = at(0.0), at(np.pi), at(0.5 * np.pi)
    steady = 0.5 * (ahead + behind)
    one, cos, sin = np.moveaxis(turn, -1, 0).reshape(3, -1, *(1,) * (steady.ndim - 1))
    return np.asarray(one * steady + cos * 0.5 * (ahead - behind) + sin * (beside - steady))


def beyond(chain: Chain, joint: str) -> tuple[Chain, Array]:
    """The chain after a joint, and the turning axis (3,) in the frame it starts from."""
    k = next(i for i, each in enumerate(chain.elements) if isinstance(each, Joint) and each.name == joint)
    turning = chain.elements[k]
    assert isinstance(turning, Joint)
    return Chain(chain.elements[k + 1 :]), np.eye(3)["xyz".index(turning.axis)]


def turning_axis(chain: Chain, joint: str, angles: Array, errors: Array | None = None) -> Array:
    """Turning axis (n, 3) on the instrument's axes at ``angles`` (n, joints), errors (n, k) if any."""
    after, e = beyond(chain, joint)
    own = angles[..., len(chain.joints) - len(after.joints) :]
    own_errors = None if errors is None else errors[..., len(chain.errors) - len(after.errors) :]
    return np.asarray(e @ after.attitude(own, own_errors))


def sensed(
    chain: Chain, joint: str, w_n: Array, rate: Array, angles: Array, turn: Array, errors: Array | None = None
) -> Array:
    """Mean rate (n, 3) [rad/s] on the instrument's axes: table and earth.

    Parameters
    ----------
    chain : Chain
    joint : str
        The one that turns.
    w_n : (3,) rad/s
        Earth rate in n.
    rate, angles, turn
        As in `RateDwells`.
    errors : (n, k) rad, optional
        Of the table; the ideal one if absent.
    """
    of_earth = over_turn(lambda at: w_n @ chain.attitude(at, errors), angles, chain.joints.index(joint), turn)
    return rate[:, None] * turning_axis(chain, joint, angles, errors) + of_earth


@dataclass(frozen=True, eq=False)
class Effect:
    """A source of uncertainty of the sensed rate.

    ``shift`` (n, q) [rad/s]: change of each reading's input for one standard deviation of q independent
    components; ``redrawn`` if these take new values at each stay. ``u`` [``unit``] of the source itself.
    """

    source: str
    u: float
    unit: str
    shift: Array
    redrawn: bool = False


def shifts_of(effects: Sequence[Effect], n: int) -> tuple[Array, Array]:
    """Shifts (n, q) of effects on n stays: of those that are redrawn at each stay, and of those that are not."""
    redrawn, common = (
        np.hstack([np.zeros((n, 0)), *(effect.shift for effect in effects if effect.redrawn is way)])
        for way in (True, False)
    )
    return redrawn, common


@dataclass(frozen=True, eq=False)
class Input:
    """Rate about a gyro's axis: ``x`` (n,) [rad/s] its mean, earth and misalignment included; ``gain`` the cosine
    (n,) of axis and turning axis; ``effects`` what x is uncertain by."""

    x: Array
    gain: Array
    effects: tuple[Effect, ...]


def gyro_input(stays: RateDwells, settings: TurntableSettings, axis: int) -> Input:
    """Rate about axis 0, 1 or 2 of the instrument in each stay, and what it is uncertain by.

    A gyro that is meant to lie along the turning axis loses ``1 - cos`` of any misalignment: an error of second
    order, whose mean is not zero. It is corrected, and its spread is an effect of its own (GUM F.2.4.4). Errors of
    the table before the turning joint move the axis against the Earth only.
    """
    test, whole = settings.rate_test, settings.chain
    latitude, latitude_u = settings.site.latitude, settings.site.latitude_u
    assert test is not None
    assert latitude is not None
    w_n, v = rate_reference(latitude), np.eye(3)[axis]
    chain = settled(whole, test.joint, stays.angles)
    turning = chain.joints.index(test.joint)

    def mean(of_angles: Callable[[Array], Array]) -> Array:
        return over_turn(of_angles, stays.angles, turning, stays.turn)

    slopes = mean(lambda at: w_n @ chain.slopes(at) @ v)  # (n, k)
    after, e = beyond(chain, test.joint)
    gain, first, second = _gain(after, stays.angles[:, turning + 1 :], e, v)
    slopes[:, len(chain.errors) - len(after.errors) :] += stays.rate[:, None] * first
    effects = [
        Effect(
            error.source,
            error.distribution.std,
            "m" if error.is_offset else "rad",
            slopes[:, [k]] * error.distribution.std,
            not error.scope.constant,
        )
        for k, error in enumerate(chain.errors)
        if error.distribution.std > 0.0
    ]
    arcs = (test.joint, stays.angles, stays.rate * settings.instrument.dwell, settings.instrument.dwell, v)
    change = np.zeros(len(stays.rate)) if stays.assumed else known_change(whole, *arcs)
    for each in () if stays.assumed else ends(whole, *arcs):
        std = each.error.distribution.std
        effects.append(Effect(f"{each.error.source}, at the ends", std, "rad", each.change * std))
    loss = -0.5 * np.einsum("njj,j->n", second, np.square(after.std))
    effects += _cosines(after, second, stays.rate)
    if test.rate_u > 0.0:
        effects.append(
            Effect("rate of the table", test.rate_u, "1", (stays.rate * gain * test.rate_u)[:, None])
        )
    if latitude_u > 0.0:
        by_latitude = EARTH_RATE * np.array([-np.sin(latitude), 0.0, np.cos(latitude)])
        moved = mean(lambda at: by_latitude @ chain.attitude(at) @ v)
        effects.append(Effect("latitude", latitude_u, "rad", (moved * latitude_u)[:, None]))
    ideal = sensed(chain, test.joint, w_n, stays.rate, stays.angles, stays.turn) @ v
    return Input(ideal + change - stays.rate * loss, gain, tuple(effects))


def _gain(after: Chain, angles: Array, e: Array, v: Array) -> tuple[Array, Array, Array]:
    """Cosine (n,) of turning axis and gyro axis, its first (n, m) and second (n, m, m) derivatives by the errors.

    It is linear in cosine and sine of each error, so that differences over ±90 deg are exact.
    """
    m, right, sizes = len(after.errors), 0.5 * np.pi, after.sizes(angles)
    after = after.with_errors(*(replace(error, pattern=None) for error in after.errors))

    def value(*turned: tuple[int, float]) -> Array:
        errors = np.zeros(m)
        for k, by in turned:
            errors[k] = by
        return np.asarray(e @ after.attitude(angles, errors) @ v)

    still = value()
    first, second = np.zeros((len(angles), m)), np.zeros((len(angles), m, m))
    for j in range(m):
        plus, minus = value((j, right)), value((j, -right))
        first[:, j], second[:, j, j] = 0.5 * (plus - minus), 0.5 * (plus + minus) - still
        for k in range(j):
            corners = [a * b * value((j, a * right), (k, b * right)) for a in (1, -1) for b in (1, -1)]
            second[:, j, k] = second[:, k, j] = 0.25 * np.sum(corners, axis=0)
    return still, first * sizes, second * sizes[:, :, None] * sizes[:, None, :]


def _cosines(after: Chain, second: Array, rate: Array) -> list[Effect]:
    """The spread of second order: squares and products of the errors, about their means."""
    std = after.std
    fourth = [error.distribution.weights @ error.distribution.nodes**4 for error in after.errors]
    parts: dict[bool, list[Array]] = {False: [], True: []}
    for j, error in enumerate(after.errors):
        for k in range(j + 1):
            # d_j d_k are uncorrelated with each other and, for symmetric errors, with the errors themselves
            spread = 0.5 * np.sqrt(max(fourth[j] - std[j] ** 4, 0.0)) if j == k else std[j] * std[k]
            redrawn = not (error.scope.constant and after.errors[k].scope.constant)
            parts[redrawn].append(second[:, j, k] * spread)
    names = {False: "cosine of the misalignment, constant", True: "cosine of the misalignment, at each rate"}
    return [
        Effect(
            names[redrawn],
            float(np.sqrt(np.mean(np.square(columns).sum(axis=0)))),
            "1",
            rate[:, None] * np.stack(columns, axis=-1),
            redrawn,
        )
        for redrawn, columns in parts.items()
        if np.any(columns)
    ]
