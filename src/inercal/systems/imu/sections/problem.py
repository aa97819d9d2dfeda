"""The problem of a calibration from sections: its unknowns, what is known of them, and the variances nobody states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Protocol

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.readings import Flags, Places, SectionArrays, side_by_side
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.unknowns import (
    CLOCK,
    COEFFICIENTS,
    COMMON,
    D_F,
    EARTH,
    EARTH_ALONG,
    EARTH_UP,
    GRAVITY,
    K0,
    K1,
    K2,
    LOCAL,
    MOUNTING,
    OFF,
    RATE,
    SOURCES,
    SWIVEL,
    TILT,
    G,
    M,
    S,
    T,
)

ANY_EARTH: Final = EARTH_RATE / np.sqrt(3.0)
"""Standard deviation of a component of earth rate in a direction that is not known."""


@dataclass(frozen=True, eq=False)
class Iterate:
    """A value ``x`` (p,) of the unknowns, and what tilts are counted from.

    ``up`` and ``axis`` (n, 3) are centres of the tilts: where nothing is known of a direction, its last estimate.
    ``level`` (n, 3, 3) are the axes of a section's earth rate in columns: two across the vertical, and that. ``short``
    and ``loss`` (n, 2) are the mean and the variance of the part by which tilts that the data leave open shorten what
    acts along a vertical, and along an axis.
    """

    x: Array
    up: Array
    axis: Array
    level: Array
    short: Array
    loss: Array


@dataclass(frozen=True, eq=False)
class RowBlock:
    """RowBlock of k rows of the linear problem ``residual = shared d_shared + local d_local + errors``.

    ``residual`` (c, k); ``shared`` (c, k, s) the derivatives by all shared unknowns; ``local`` (c, k, q) those by the
    unknowns of sections whose places in x are ``at`` (c, q), the same place at most once in a cell. Errors have the
    variance ``variance`` + sum of exp(2 z) ``scatter`` (c, k), by the name of each component. Rows not ``seen`` (c, k)
    do not count. ``sources`` (k,) are names in budgets of the errors of the rows of a cell.
    """

    residual: Array
    shared: Array
    local: Array
    at: Places
    variance: Array
    scatter: dict[str, Array]
    seen: Flags
    sources: tuple[str, ...]


class Extra(Protocol):
    """More rows than those of means, such as moves between rests, and the unknowns that they bring."""

    @property
    def labels(self) -> tuple[str, ...]:
        """Sources in budgets of its own shared unknowns (e,), which stand last among the shared ones."""
        ...

    @property
    def mean(self) -> Array:
        """Values of these beforehand (e,)."""
        ...

    @property
    def sd(self) -> Array:
        """Standard deviations of these values (e,)."""
        ...

    @property
    def sizes(self) -> dict[str, Size]:
        """Components of variance that it brings."""
        ...

    @property
    def runs(self) -> Places:
        """Places (n,) among its unknowns of the first of three of the earth rate of a section, along ``level`` of the
        point, instead of the section's own; -1 where it has its own."""
        ...

    @property
    def rotates(self) -> bool:
        """True where it tells scale factors of the gyro, as motions do."""
        ...

    def blocks(self, problem: Problem, point: Iterate) -> tuple[RowBlock, ...]:
        """Its rows at a point."""
        ...

    def centred(self, problem: Problem, point: Iterate) -> Iterate:
        """The point with the ``level`` axes of its runs."""
        ...


@dataclass(frozen=True, eq=False)
class Problem:
    """A least-squares problem of sections, with priors.

    Of the p unknowns the first ``shared`` belong to all or several sections. ``mean`` and ``sd`` (p,) are what is known
    beforehand, ``ruled`` (p,) the place among ``sizes`` of the component that is the sd of an unknown, -1 where it is
    stated. ``on`` says on which outputs (n, 3, 3) a component acts.
    """

    readings: SectionArrays
    priors: Priors
    mean: Array
    sd: Array
    ruled: Places
    sizes: dict[str, Size]
    on: dict[str, Flags]
    runs: Places
    extras: tuple[Extra, ...] = ()
    north: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """Priors level part of earth rate (n, 3) [rad/s]."""

    @property
    def shared(self) -> int:
        """Number of the shared unknowns."""
        return len(self.mean) - LOCAL * len(self.readings.sections)

    @property
    def sessions_at(self) -> int:
        """Place of the first bias of a session: three of the accelerometers and three of the gyro of each."""
        return COMMON + len(self.readings.rate_groups)

    @property
    def free(self) -> Flags:
        """Unknowns (p,) that are not known exactly."""
        return np.asarray(self.sd > 0.0)

    def local(self, x: Array) -> Array:
        """Unknowns (n, 8) of the sections."""
        return x[self.shared :].reshape(-1, LOCAL)

    def source(self, p: int) -> str:
        """The name in budgets of an unknown with a prior."""
        if p < len(COEFFICIENTS):
            head = COEFFICIENTS[p].rpartition("_")[0]
            return {"K2": "K2 of the accelerometers", "G": "g-sensitivity of the gyro"}.get(
                head, f"prior of {head}"
            )
        if p < COMMON:
            return SOURCES[p - len(COEFFICIENTS)]
        if p < self.sessions_at:
            return f"rate {self.readings.rate_groups[p - COMMON]}"
        if p < self.sessions_at + 6 * len(self.readings.sessions):
            return "bias of a session"
        if p < self.shared:
            labels = [label for extra in self.extras for label in extra.labels]
            return labels[p - self.shared + len(labels)]
        k = (p - self.shared) % LOCAL
        if k < RATE:
            return "placing" if k in range(*TILT.indices(LOCAL)) else "axes"
        return "angles and rates" if k == RATE else "earth rate, level part"


class _Shared(NamedTuple):
    """Means and standard deviations of the shared unknowns."""

    mean: Array
    sd: Array


def problem_of(sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...] = ()) -> Problem:
    """The problem of some sections, of which at least one has an output."""
    readings = side_by_side(sections)
    n = len(sections)
    shared = _shared(readings, priors, extras)
    runs = np.full(n, -1)
    first = len(shared.sd) - sum(len(extra.labels) for extra in extras)
    for extra in extras:
        runs = np.where(extra.runs >= 0, first + extra.runs, runs)
        first += len(extra.labels)
    if priors.gyro_scale is None and not np.any(
        shared.sd[S] > 0.0
    ):  # outputs of a gyro whose unit nothing tells
        priors = replace(priors, gyro_scatter=Size(1.0, LIMITS.flat_scatter))
    on, sizes = _scatters(readings, priors)
    local, placed = _local(readings, priors, bool(np.any(shared.sd[S] > 0.0)), runs)
    if placed.any():
        sizes["placing"] = priors.placing
    for extra in extras:
        sizes.update(extra.sizes)
    ruled = np.full(len(shared.sd) + n * LOCAL, -1)
    names = list(sizes)
    ruled[len(shared.sd) :] = np.where(placed.ravel(), names.index("placing") if placed.any() else -1, -1)
    begin = COMMON + len(readings.rate_groups)
    for k in range(len(readings.sessions)):
        for part, name in ((0, "acc session"), (3, "gyro session")):
            place = slice(begin + 6 * k + part, begin + 6 * k + part + 3)
            ruled[place] = np.where(shared.sd[place] > 0.0, names.index(name) if name in names else -1, -1)
    return Problem(
        readings,
        priors,
        np.concatenate([shared.mean, np.zeros(n * LOCAL)]),
        np.concatenate([shared.sd, local.ravel()]),
        ruled,
        sizes,
        on,
        runs,
        extras,
        _north(readings, priors),
    )


def with_classes(problem: Problem, scatter: dict[str, float]) -> Problem:
    """The problem with the priors of K2 and G by the class of the instrument, by the ``scatter`` of its means [SI]."""
    sd, priors = problem.sd.copy(), problem.priors
    if priors.k2 is None:
        fine = scatter.get("acc", np.inf) <= IMU_LIMITS.fine_scatter
        sd[K2] = np.where(sd[K2] > 0.0, IMU_LIMITS.fine_k2 if fine else IMU_LIMITS.ordinary_k2, 0.0)
    if priors.g_sensitivity is None:
        fine = scatter.get("gyro", np.inf) <= LIMITS.fine_gyro_scatter
        sd[G] = np.where(
            sd[G] > 0.0, LIMITS.fine_g_sensitivity if fine else LIMITS.ordinary_g_sensitivity, 0.0
        )
    return replace(problem, sd=sd)


def _shared(readings: SectionArrays, priors: Priors, extras: tuple[Extra, ...]) -> _Shared:
    """Means and standard deviations of the shared unknowns."""
    groups, sessions = len(readings.rate_groups), len(readings.sessions)
    mean, sd = np.zeros(COMMON + groups + 6 * sessions), np.full(COMMON + groups + 6 * sessions, np.inf)
    sd[M] = sd[T] = priors.misalignment
    sd[K2] = IMU_LIMITS.ordinary_k2 if priors.k2 is None else priors.k2
    sd[G] = LIMITS.ordinary_g_sensitivity if priors.g_sensitivity is None else priors.g_sensitivity
    moving = (readings.rate != 0.0) & readings.seen[:, 2].any(axis=1)
    rotated = bool(moving.any()) or any(extra.rotates for extra in extras)
    site = priors.site
    for column, scale in ((K1, priors.acc_scale), (S, priors.gyro_scale)):
        mean[column] = 1.0
        if scale is not None:
            mean[column], sd[column] = scale.median, abs(scale.median) * scale.spread
    if not rotated and (site.latitude is None or priors.gyro_scale is None):
        sd[S] = sd[T] = 0.0  # no rate at all: biases alone, and G where outputs have a unit
        if priors.gyro_scale is None:
            sd[G] = 0.0
    if not readings.has_force.any():
        sd[G] = 0.0
    for there, vectors, off in ((readings.channels[0], (K0, K1, K2), M), (readings.channels[1], (D_F, S), T)):
        for i in np.flatnonzero(~there):  # a channel that is not there has no coefficients
            rows = [off.start + m for m, (row, _) in enumerate(OFF) if row == i]
            sd[[vector.start + i for vector in vectors] + rows] = 0.0
    sd[G] = np.where(np.repeat(readings.channels[1], 3), sd[G], 0.0)
    # known directions define the frame; else the accelerometers; else the gyro
    if not np.any((readings.know_up & readings.has_force) | (readings.know_axis & (readings.rate != 0.0))):
        sd[(M if readings.channels[0].any() else T).start + np.array([2, 4, 5])] = 0.0
    sure = site.latitude is not None
    blind = bool(np.any((readings.rate != 0.0) & ~readings.know_axis & ~readings.tied))
    mean[GRAVITY], sd[GRAVITY] = (
        site.gravity,
        np.sqrt(sum((each.u * each.sensitivity) ** 2 for each in site.inputs)),
    )
    mean[EARTH_UP], sd[EARTH_UP] = site.vertical_rate, site.vertical_rate_u
    sd[EARTH_ALONG] = (abs(site.vertical_rate) if sure else ANY_EARTH) if blind else 0.0
    sd[CLOCK], sd[MOUNTING] = priors.clock_u, priors.mounting_u
    for k, name in enumerate(readings.rate_groups):
        parts = [abs(s.rate_u / s.rate) for s in readings.sections if s.rate_group == name and s.rate]
        sd[COMMON + k] = max(parts, default=0.0)
    there = np.tile(np.concatenate([readings.channels[0], readings.channels[1]]), sessions)
    sd[COMMON + groups :] = np.where(there, 1.0, 0.0)
    own = [(extra.mean, extra.sd) for extra in extras]
    return _Shared(
        *(
            np.concatenate([first, *more])
            for first, more in ((mean, [m for m, _ in own]), (sd, [s for _, s in own]))
        )
    )


def _local(readings: SectionArrays, priors: Priors, scaled: bool, runs: Places) -> tuple[Array, Flags]:
    """Standard deviations (n, 8) of the unknowns of sections, and which of them nobody states."""
    sd, placed = (
        np.zeros((len(readings.sections), LOCAL)),
        np.zeros((len(readings.sections), LOCAL), dtype=bool),
    )
    moving = readings.rate != 0.0
    for k, s in enumerate(readings.sections):
        if readings.forced[k]:
            sd[k, TILT] = s.up_u or 0.0
        elif readings.tied[k]:
            sd[k, TILT] = s.level_u
        elif readings.led[k]:  # within what a lever arm adds
            sd[k, TILT] = LIMITS.led_tilt + readings.rate[k] ** 2 * LIMITS.lever_arm / priors.site.gravity
        elif readings.has_force[k]:
            sd[k, TILT] = np.inf if s.up is None else 1.0 if s.up_u is None else s.up_u
            placed[k, TILT] = s.up is not None and s.up_u is None
        if moving[k] or readings.tied[k]:
            sd[k, SWIVEL] = np.inf if s.axis is None else 1.0 if s.axis_u is None else s.axis_u
            placed[k, SWIVEL] = s.axis is not None and s.axis_u is None
        if moving[k]:
            rate_u = 0.0 if s.rate_group else s.rate_u
            sd[k, RATE] = s.angle_u / s.duration if readings.turning[k] else rate_u
        if readings.seen[k, 2].any() and scaled and runs[k] < 0:
            # whole turns average what is across the axis
            free = not (readings.has_force[k] or moving[k])
            sd[k, EARTH] = (
                *([0.0, 0.0] if readings.whole[k] else _level_u(s, priors)),
                ANY_EARTH if free else 0.0,
            )
    follows = readings.leader != np.arange(len(readings.sections))
    sd[follows, :RATE], placed[follows, :RATE] = 0.0, False
    sd[readings.earth_leader != np.arange(len(readings.sections)), EARTH] = 0.0
    return sd, placed


def _level_u(section: Section, priors: Priors) -> list[float]:
    """Standard deviations (2,) of the level part of earth rate in a section."""
    latitude = priors.site.latitude
    if section.north is None or latitude is None:
        return [priors.site.horizontal_rate_u] * 2
    level = EARTH_RATE * np.cos(latitude) * section.north_u
    return [float(np.hypot(level, EARTH_RATE * np.sin(latitude) * priors.site.latitude_u))] * 2


def _north(readings: SectionArrays, priors: Priors) -> Array:
    """Level part (n, 3) of earth rate where the heading is known, else 0."""
    out = np.zeros((len(readings.sections), 3))
    if priors.site.latitude is None:
        return out
    for k, section in enumerate(readings.sections):
        if section.north is not None and not readings.whole[k]:
            level = section.north - readings.up[k] * (readings.up[k] @ section.north)
            out[k] = EARTH_RATE * np.cos(priors.site.latitude) * level / np.linalg.norm(level)
    return out


def _scatters(readings: SectionArrays, priors: Priors) -> tuple[dict[str, Flags], dict[str, Size]]:
    """Scatters that nobody states: the outputs on which each acts, and what is known of its size."""
    on: dict[str, Flags] = {}
    sizes: dict[str, Size] = {}
    for kinds, sensor, size in (((0, 1), "acc", priors.acc_scatter), ((2,), "gyro", priors.gyro_scatter)):
        label = np.array([f"{sensor} {s.scatter}".strip() for s in readings.sections])
        for kind in kinds:
            acts = readings.seen[:, kind] & ((sensor in priors.excess) | ~readings.stated[:, kind])
            for name in sorted(set(label[acts.any(axis=1)].tolist())):
                outputs = on.setdefault(name, np.zeros(readings.seen.shape, dtype=bool))
                outputs[:, kind] = acts & (label == name)[:, None]
                sizes[name] = size
    if readings.sessions:
        both = {"acc session": priors.acc_session, "gyro session": priors.gyro_session}
        there = [bool(channels.any()) for channels in readings.channels]
        sizes |= {name: both[name] for name, some in zip(both, there, strict=True) if some}
    return on, sizes
