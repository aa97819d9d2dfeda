"""Sections from stretches of recordings: means, the noise of these, and the motion of a turn from rest to rest."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.noise.dwell_means import equivalent_dof, overlapping_variance, running_sums
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import coarse_steps
from inercal.systems.imu.sections.cutting.holds import still_edges
from inercal.systems.imu.sections.cutting.limits import LIMITS as FINDING
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.sections.section import Section


@dataclass(frozen=True, eq=False)
class TriadSamples:
    """TriadSamples of a triad: times (n,) [s], outputs (n, 3), and those (n,) with an axis at the end of its range."""

    t: Array
    values: Array
    clipped: NDArray[np.bool_]

    def between(self, begin: float | None, end: float | None) -> TriadSamples:
        """Those that are whole, from ``begin`` to ``end`` [s]; None: from the first, to the last."""
        low, high = -np.inf if begin is None else begin, np.inf if end is None else end
        near = slice(None)
        if self._ordered:
            near = slice(np.searchsorted(self.t, low), np.searchsorted(self.t, high, side="right"))
        t, values, clipped = self.t[near], self.values[near], self.clipped[near]
        kept = np.isfinite(t) & np.isfinite(values).all(axis=1) & (t >= low) & (t <= high)
        return TriadSamples(t[kept], values[kept], clipped[kept])

    @cached_property
    def _ordered(self) -> bool:
        """True where all times are known and none runs backward."""
        return bool((np.diff(self.t) >= 0.0).all())

    @property
    def step(self) -> float:
        """Median interval [s]; 1 for a single sample or rows without times."""
        steps = np.diff(self.t)
        return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch of a recording and the row that says what is known of it; None: the triad is not there.

    ``force`` is specific force [m/s^2] as another instrument measured it.
    """

    row: SectionRow
    acc: TriadSamples | None
    gyro: TriadSamples | None
    force: TriadSamples | None = None


@dataclass(frozen=True)
class Cut:
    """The sections of stretches; and those of no use, by name, with the reason."""

    sections: tuple[Section, ...]
    unused: dict[str, str]


@dataclass(frozen=True, eq=False)
class _Read:
    """A section without its noise, and the stretches (n, 3) of both triads whose scatter tells that."""

    section: Section
    acc: tuple[Array, ...] = ()
    gyro: tuple[Array, ...] = ()
    gyro_samples: int = 0


def cut(stretches: Sequence[Stretch]) -> Cut:
    """Read the sections of stretches of kind rest, rate and turn; those of other kinds are left to others.

    Notes
    -----
    The noise of means is told by all stretches of a kind together (that of one is hardly known) by their Allan
    variances, so that what does not average out counts. Coarse outputs add the square of a step over 12.
    """
    read: list[_Read] = []
    unused: dict[str, str] = {}
    for stretch in stretches:
        if stretch.row.kind in ("rest", "rate", "turn"):
            one = _turn(stretch) if stretch.row.kind == "turn" else _steady(stretch)
            if isinstance(one, str):
                unused[stretch.row.section] = one
            else:
                read.append(one)
                if (
                    stretch.row.kind == "turn"
                    and stretch.acc is None
                    and not _rests_in(stretch.row, stretches)
                ):
                    read += _ends_of(one)
    sections = [one.section for one in read]
    for kinds in (("rest", "turn"), ("rate",)):
        places = [k for k, one in enumerate(read) if one.section.kind in kinds]
        for sensor in ("acc", "gyro"):
            told = [k for k in places if getattr(read[k], sensor)]
            if not told:
                continue
            parts = [getattr(read[k], sensor) for k in told]
            counts = [read[k].gyro_samples if sensor == "gyro" else min(map(len, read[k].acc)) for k in told]
            variances = variances_of_means([x for part in parts for x in part], counts)
            for k, variance in zip(told, variances, strict=True):
                known = variance if (variance > 0.0).all() else None
                if sensor == "acc":
                    sections[k] = dataclasses.replace(sections[k], acc_var=known)
                else:
                    sections[k] = dataclasses.replace(sections[k], gyro_var=known)
    return Cut(tuple(sections), unused)


def variances_of_means(stretches: Sequence[Array], counts: Sequence[int]) -> list[Array]:
    """Variances (3,) of means over so many samples, by the scatter in ``stretches`` (n, 3) at rest, pooled.

    Means over m samples scatter by the Allan variance v(m); m v(m) is constant where noise is white over m samples and
    more. It is averaged from the shortest m on from which no longer one contradicts it: of noise that is white from
    the first sample on all lengths count, of noise that is correlated, or wanders, the long ones alone.
    """
    if not any(len(x) > 2 for x in stretches):
        return [np.full(3, np.nan) for _ in counts]
    dof = sum(len(x) - 1 for x in stretches)
    deviation = np.sqrt(sum(((x - x.mean(axis=0)) ** 2).sum(axis=0) for x in stretches) / dof)
    steps = np.max([coarse_steps(x, deviation) for x in stretches if len(x) > 2], axis=0)
    densities, weights = _densities(stretches)
    first = next(k for k in range(len(weights)) if _constant(densities[k:], weights[k:]))
    first += 0 < first < len(weights) - 1  # the first that is not contradicted still is somewhat low
    density = np.average(densities[first:], axis=0, weights=weights[first:])
    return [np.asarray(density / count + steps**2 / 12.0) for count in counts]


def _densities(stretches: Sequence[Array]) -> tuple[Array, Array]:
    """m v(m) (k, 3) at octaves of m up to half the median length, and their degrees of freedom (k,)."""
    longest = max(int(np.median([len(x) for x in stretches])) // 2, 1)
    sums = [running_sums(x) for x in stretches]
    densities, weights = [], []
    for m in sorted({max(longest // 2**k, 1) for k in range(longest.bit_length())}):
        told = [x for x in sums if len(x) > 2 * m]
        pairs = [len(x) - 2 * m for x in told]
        densities.append(m * np.average([overlapping_variance(x, m) for x in told], axis=0, weights=pairs))
        weights.append(sum(equivalent_dof(len(x) - 1, m) for x in told))
    kept = np.maximum.accumulate(np.array(weights)[::-1])[::-1] >= FINDING.noise_dof
    kept[0] = True
    return np.array(densities)[kept], np.array(weights)[kept]


def _constant(densities: Array, weights: Array) -> bool:
    """True where no later density (k, 3) contradicts the first, by their degrees of freedom (k,)."""
    from scipy.special import digamma, polygamma

    live = (densities > 0.0).all(axis=0)
    if len(densities) == 1 or not live.any():
        return True
    bias, scatter = digamma(0.5 * weights) - np.log(0.5 * weights), polygamma(1, 0.5 * weights)
    logs = np.log(densities[:, live]).mean(axis=1) - bias
    chance = np.sqrt((scatter[1:] + scatter[0]) / np.count_nonzero(live))
    return bool(np.all(np.abs(logs[1:] - logs[0]) < FINDING.noise_change * chance))


def section_of(row: SectionRow) -> Section:
    """A section with what its row says, and nothing read yet; of a kind rest, rate or turn."""
    begin = "start" if row.begin is None else f"{row.begin:.2f} s"
    end = "end" if row.end is None else f"{row.end:.2f} s"
    times = "" if row.begin is None and row.end is None else f", {begin} to {end}"
    assert row.kind in ("rest", "rate", "turn")
    return Section(
        kind=row.kind,
        name=row.section,
        where=f"{row.file}{times}",
        why=row.why,
        up=row.up,
        up_u=row.placing,
        force=row.force if isinstance(row.force, np.ndarray) else None,
        axis=row.axis,
        axis_u=row.placing,
        level_u=row.level,
        rate=0.0 if row.rate is None else row.rate.value,
        rate_u=0.0 if row.rate is None else row.rate.u,
        rate_group=row.rate_group,
        angle=0.0 if row.angle is None else row.angle.value,
        angle_u=0.0 if row.angle is None else row.angle.u,
        setup=row.setup,
        session=row.session,
        scatter=row.scatter,
        temperature=row.temperature,
    )


def calm_part(gyro: TriadSamples) -> TriadSamples:
    """The samples of a gyro in a rest that are as calm as in its middle: a motion that begins or ends slowly does no
    harm to the mean of accelerometers, but to that of a gyro."""
    n, block = len(gyro.t), max(round(FINDING.still_window / FINDING.blocks_of_window / gyro.step), 2)
    if n < 4 * FINDING.blocks_of_window * block // 2:
        return gyro
    begin, end = still_edges(gyro.values, n // 4, n - n // 4, block, 0.0)
    part = slice(begin, end)
    return TriadSamples(gyro.t[part], gyro.values[part], gyro.clipped[part])


def _steady(stretch: Stretch) -> _Read | str:
    """A rest or a steady rate; what is wrong with it, in words. Of a rate the accelerometers are left out."""
    row = stretch.row
    if row.kind == "rate" and row.rate is None:
        return "its rate is not stated"
    acc, gyro = stretch.acc if row.kind == "rest" else None, stretch.gyro
    if row.kind == "rest" and gyro is not None:
        gyro = calm_part(gyro)
    triads = {sensor: one for sensor, one in (("acc", acc), ("gyro", gyro)) if one is not None and len(one.t)}
    clipped = [sensor for sensor, one in triads.items() if one.clipped.mean() > LIMITS.clipped_part]
    whole = {sensor: one for sensor, one in triads.items() if sensor not in clipped}
    if not whole:
        return f"the {clipped[0]} is at the end of its range" if clipped else "no samples lie in it"
    longest = max(whole.values(), key=lambda one: len(one.t))
    means = {sensor: one.values.mean(axis=0) for sensor, one in whole.items()}
    if stretch.force is not None and len(stretch.force.t):
        means["force"] = stretch.force.values.mean(axis=0)
    section = dataclasses.replace(
        section_of(row), duration=float(longest.t[-1] - longest.t[0]) + longest.step, **means
    )
    return _Read(
        section,
        (whole["acc"].values,) if "acc" in whole else (),
        (whole["gyro"].values,) if "gyro" in whole else (),
        len(whole["gyro"].t) if "gyro" in whole else 0,
    )


def _turn(stretch: Stretch) -> _Read | str:
    """A turn from rest to rest; what is wrong with it, in words."""
    row, gyro = stretch.row, stretch.gyro
    if row.angle is None:
        return "its angle is not stated"
    if gyro is None:
        return "a turn without a gyro says nothing"
    motion = motion_between_rests(gyro.t, gyro.values)
    if isinstance(motion, str):
        return motion
    first, last = motion
    part = slice(first, last + 1)
    t, values = gyro.t[part], gyro.values[part]
    if (clipped := int(np.count_nonzero(gyro.clipped[part]))) > 0:
        return f"{clipped} samples of the gyro in the turn are at the end of its range"
    gaps = np.diff(t)
    if gaps.max() > LIMITS.motion_gap * gyro.step or gaps.min() < 0.0:
        return "samples are missing within the turn"
    duration = float(t[-1] - t[0])
    before, after = gyro.values[:first], gyro.values[last + 1 :]
    line = np.linspace(0.0, 1.0, len(t))[:, None] * (after.mean(axis=0) - before.mean(axis=0)) + before.mean(
        axis=0
    )
    run = _integrals(t, values - line)
    angle = row.angle.value * (run @ run[-1]) / (run[-1] @ run[-1])
    cosine_sine = tuple(float(np.trapezoid(f(angle), t)) / duration for f in (np.cos, np.sin))
    section = dataclasses.replace(
        section_of(row),
        gyro=np.asarray(np.trapezoid(values, t, axis=0) / duration),
        duration=duration,
        cosine_sine=(cosine_sine[0], cosine_sine[1]),
    )
    rests: tuple[Array, ...] = ()
    if stretch.acc is not None:
        acc = stretch.acc
        rests = acc.values[acc.t < t[0]], acc.values[acc.t > t[-1]]
        if min(map(len, rests)):
            section = dataclasses.replace(section, acc=rests[0].mean(axis=0), acc_after=rests[1].mean(axis=0))
        else:
            rests = ()
    return _Read(section, rests, (before, after), len(t))


def _rests_in(row: SectionRow, stretches: Sequence[Stretch]) -> bool:
    """True where a rest of the same file is a section of its own."""
    return any(one.row.kind == "rest" and one.row.file == row.file for one in stretches)


def _ends_of(turn: _Read) -> list[_Read]:
    """The rests before and after a turn of a gyro alone, which tell its bias."""
    step = turn.section.duration / max(turn.gyro_samples - 1, 1)
    ends = []
    for values, end in zip(turn.gyro, ("before", "after"), strict=True):
        rest = Section(
            "rest",
            name=f"{turn.section.name}, {end}",
            where=turn.section.where,
            why=turn.section.why,
            gyro=values.mean(axis=0),
            duration=len(values) * step,
            session=turn.section.session,
            scatter=turn.section.scatter,
        )
        ends.append(_Read(rest, (), (values,), len(values)))
    return ends


def _integrals(t: Array, values: Array) -> Array:
    """Running integrals (n, 3) of values (n, 3)."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t)[:, None]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def motion_between_rests(t: Array, gyro: Array) -> tuple[int, int] | str:
    """First and last sample of the one motion between rests at both ends; what is wrong, in words, where it is not so.

    ``gyro`` (n, 3) are outputs at times ``t`` (n,) [s]. The rests reach to where the output leaves their own noise, and
    the motion begins a margin before, for what slow tails are cut off is missing in the angle.
    """
    wanted = f"expected a turn with at least {FINDING.shortest_hold:g} s of rest before and after"
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    block = max(round(FINDING.still_window / 4.0 / step), 2)
    rest = max(round(FINDING.shortest_hold / step), 5 * block)
    if len(t) < 3 * rest:
        return f"lasts {t[-1] - t[0] if len(t) else 0.0:.1f} s, {wanted}"
    ends = np.array([gyro[:rest].mean(axis=0), gyro[-rest:].mean(axis=0)])
    line = ends[0] + np.linspace(0.0, 1.0, len(t))[:, None] * (ends[1] - ends[0])
    sums = np.cumsum(np.concatenate([np.zeros((1, 3)), gyro - line]), axis=0)
    speed = np.linalg.norm(sums[block:] - sums[:-block], axis=1) / block
    largest = float(speed.max())
    noise = float(np.sqrt(np.mean(np.square([speed[: rest - block], speed[block - rest :]]))))
    if LIMITS.turn_noise * noise > LIMITS.cut_rate * largest:
        return f"is not at rest at its ends, {wanted}"
    first, after = rest, rest
    for _ in range(2):  # the second time by the noise of the whole rest
        first = still_edges(gyro, 0, first, block, 0.0)[1]
        after = still_edges(gyro[::-1], 0, after, block, 0.0)[1]
        if first + after >= len(t):
            return f"nothing turns in it, {wanted}"
    margin = max(round(LIMITS.turn_margin / step), 1)
    return max(first - margin, 1), min(len(t) - after + margin, len(t) - 2)
