"""Sections from stretches of recordings: means, the noise of these, and the motion of a turn from rest to rest.

A turn whose stretch holds no rests is read as it is stated, the output at rest told by the other sections.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.cutting.holds import drifting, still_edges
from inercal.systems.imu.sections.cutting.limits import LIMITS as FINDING
from inercal.systems.imu.sections.cutting.noise_of_means import variances_of_means
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.sections.section import SENSED, Section

ENDS = (", before", ", after")
"""Ends of the names of the rests before and after a turn, behind the name of the turn."""


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
    """The sections of stretches; those of no use, by name, with the reason; and what is to be said of either."""

    sections: tuple[Section, ...]
    unused: dict[str, str]
    notes: tuple[Finding, ...] = ()


class Flaw(NamedTuple):
    """The reason why a stretch is of no use: the code of its finding, empty where another one asks, and words."""

    code: str
    why: str


@dataclass(frozen=True, eq=False)
class _Read:
    """A section without its noise, and the stretches (n, 3) of both triads whose scatter tells that."""

    section: Section
    acc: tuple[Array, ...] = ()
    gyro: tuple[Array, ...] = ()
    gyro_samples: int = 0
    notes: tuple[Finding, ...] = ()


_EDGE: Final = 5
"""Samples at an end of a turn whose mean says whether it is under way there."""


def cut(stretches: Sequence[Stretch]) -> Cut:
    """Read the sections of stretches of kind rest, rate and turn; those of other kinds are left to others.

    Notes
    -----
    The noise of means is told by all stretches of a kind together (that of one is hardly known) by their Allan
    variances, so that what does not average out counts. Coarse outputs add the square of a step over 12.
    """
    done: dict[int, _Read | Flaw] = {
        k: _steady(stretch)
        for k, stretch in enumerate(stretches)
        if stretch.row.kind in SENSED and stretch.row.kind != "turn"
    }
    done |= _moving_rests(stretches, done)
    rests = [
        one.section.gyro
        for one in done.values()
        if isinstance(one, _Read) and one.section.kind == "rest" and one.section.gyro is not None
    ]
    bias = np.median(rests, axis=0) if rests else None
    done |= {k: _turn(stretch, bias) for k, stretch in enumerate(stretches) if stretch.row.kind == "turn"}
    read: list[_Read] = []
    unused: dict[str, str] = {}
    notes: list[Finding] = []
    for k in sorted(done):
        one, row = done[k], stretches[k].row
        if isinstance(one, _Read):
            read.append(one)
            notes += one.notes
            if row.kind == "turn" and one.gyro and stretches[k].acc is None and not _rests_in(row, stretches):
                read += _ends_of(one)
            continue
        unused[row.section] = one.why
        if one.code:
            act = "Record it again, or move its ends."
            harm = EVERYTHING if one.code == "not_at_rest" else ()
            notes.append(
                Finding(one.code, f"{row.section} is not used: {one.why}.", _where(row), harm, action=act)
            )
    sections = [one.section for one in read]
    for steady in (False, True):  # a table at a rate shakes
        places = [k for k, one in enumerate(read) if (one.section.kind == "rate") == steady]
        for sensor in ("acc", "gyro"):
            told = [k for k in places if (read[k].gyro_samples if sensor == "gyro" else read[k].acc)]
            parts = [getattr(read[k], sensor) for k in told]
            if not any(parts):
                continue
            counts = [read[k].gyro_samples if sensor == "gyro" else min(map(len, read[k].acc)) for k in told]
            variances = variances_of_means([x for part in parts for x in part], counts)
            for k, variance in zip(told, variances, strict=True):
                known = variance if (variance > 0.0).all() else None
                if sensor == "acc":
                    sections[k] = dataclasses.replace(sections[k], acc_var=known)
                else:
                    sections[k] = dataclasses.replace(sections[k], gyro_var=known)
    return Cut(tuple(sections), unused, tuple(notes))


def _moving_rests(stretches: Sequence[Stretch], done: Mapping[int, _Read | Flaw]) -> dict[int, Flaw]:
    """Rests in which specific force drifts, where enough of them tell its size."""
    rests = {
        k: one.section.acc
        for k, one in done.items()
        if isinstance(one, _Read) and one.section.kind == "rest" and one.section.acc is not None
    }
    if len(rests) < FINDING.sides_to_compare:
        return {}
    gravity = 0.5 * float(np.max(np.ptp(list(rests.values()), axis=0)))
    out = {}
    for k in rests:
        acc = stretches[k].acc
        assert acc is not None
        block = max(round(FINDING.still_window / FINDING.blocks_of_window / acc.step), 2)
        if len(acc.t) >= 6 * block and (why := drifting(acc.values, gravity, block)):
            out[k] = Flaw("not_at_rest", why)
    return out


def _where(row: SectionRow) -> str:
    """The file and the times of a row, in words."""
    begin = "start" if row.begin is None else f"{row.begin:.2f} s"
    end = "end" if row.end is None else f"{row.end:.2f} s"
    return row.file if row.begin is None and row.end is None else f"{row.file}, {begin} to {end}"


def section_of(row: SectionRow) -> Section:
    """A section with what its row says, and nothing read yet; neither of a move nor of a swing."""
    assert row.kind != "move"
    assert row.kind != "swing"
    return Section(
        kind=row.kind,
        name=row.section,
        where=_where(row),
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
        north=row.north,
        north_u=FINDING.heading_u if row.north_u is None else row.north_u,
        setup=row.setup,
        session=row.session,
        scatter=row.scatter,
        temperature=row.temperature,
    )


def _steady(stretch: Stretch) -> _Read | Flaw:
    """A section that is one mean; or what is wrong with it."""
    row = stretch.row
    if row.kind == "rate" and row.rate is None:
        return Flaw("", "its rate is not stated")
    assert row.kind != "move"
    assert row.kind != "swing"
    triads = {
        sensor: one
        for sensor, one in (("acc", stretch.acc), ("gyro", stretch.gyro))
        if sensor in SENSED[row.kind] and one is not None and len(one.t)
    }
    clipped = [sensor for sensor, one in triads.items() if one.clipped.mean() > LIMITS.clipped_part]
    whole = {sensor: one for sensor, one in triads.items() if sensor not in clipped}
    if not whole:
        if clipped:
            return Flaw("saturation", f"the {clipped[0]} is at the end of its range")
        return Flaw("poor_section", "no samples lie in it")
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


def _turn(stretch: Stretch, bias: Array | None) -> _Read | Flaw:
    """A turn from rest to rest; or what is wrong with it. ``bias`` (3,) is the gyro's mean output in rests."""
    row, gyro = stretch.row, stretch.gyro
    if row.angle is None:
        return Flaw("", "its angle is not stated")
    if gyro is None:
        return Flaw("poor_section", "a turn without a gyro says nothing")
    motion = motion_between_rests(gyro.t, gyro.values)
    if isinstance(motion, str):
        if bias is None or row.begin is None or row.end is None or len(gyro.t) < 4 * _EDGE:
            return Flaw("poor_section", motion)
        first, last = 0, len(gyro.t) - 1
    else:
        first, last = motion
    part = slice(first, last + 1)
    t, values = gyro.t[part], gyro.values[part]
    if (clipped := int(np.count_nonzero(gyro.clipped[part]))) > 0:
        return Flaw("saturation", f"{clipped} samples of the gyro in the turn are at the end of its range")
    gaps = np.diff(t)
    if gaps.max() > LIMITS.motion_gap * gyro.step or gaps.min() < 0.0:
        return Flaw("poor_section", "samples are missing within the turn")
    cells = lengths_of(t)
    duration = float(cells.sum())
    before, after = gyro.values[:first], gyro.values[last + 1 :]
    notes: tuple[Finding, ...] = ()
    if len(before):
        change = after.mean(axis=0) - before.mean(axis=0)
        line = np.linspace(0.0, 1.0, len(t))[:, None] * change + before.mean(axis=0)
    else:
        line = np.broadcast_to(np.asarray(bias), values.shape)
        cut_off = _cut_off(row, values - line)
        if isinstance(cut_off, Flaw):
            return cut_off
        notes = cut_off
    run = np.cumsum(cells[:, None] * (values - line), axis=0)
    angle = row.angle.value * (run @ run[-1]) / (run[-1] @ run[-1])
    cosine_sine = float(cells @ np.cos(angle)) / duration, float(cells @ np.sin(angle)) / duration
    section = dataclasses.replace(
        section_of(row), gyro=cells @ values / duration, duration=duration, cosine_sine=cosine_sine
    )
    rests: tuple[Array, ...] = ()
    if stretch.acc is not None:
        acc = stretch.acc
        rests = acc.values[acc.t < t[0]], acc.values[acc.t > t[-1]]
        if min(map(len, rests)):
            section = dataclasses.replace(section, acc=rests[0].mean(axis=0), acc_after=rests[1].mean(axis=0))
        else:
            rests = ()
    return _Read(section, rests, (before, after) if len(before) else (), len(t), notes)


def _rests_in(row: SectionRow, stretches: Sequence[Stretch]) -> bool:
    """True where a rest of the same file is a section of its own."""
    return any(one.row.kind == "rest" and one.row.file == row.file for one in stretches)


def _ends_of(turn: _Read) -> list[_Read]:
    """The rests before and after a turn of a gyro alone, which tell its bias."""
    step = turn.section.duration / max(turn.gyro_samples - 1, 1)
    ends = []
    for values, end in zip(turn.gyro, ENDS, strict=True):
        rest = Section(
            "rest",
            name=f"{turn.section.name}{end}",
            where=turn.section.where,
            why=turn.section.why,
            gyro=values.mean(axis=0),
            duration=len(values) * step,
            session=turn.section.session,
            scatter=turn.section.scatter,
        )
        ends.append(_Read(rest, (), (values,), len(values)))
    return ends


def _cut_off(row: SectionRow, rate: Array) -> Flaw | tuple[Finding, ...]:
    """A finding about a turn that is under way at an end of its stretch, with the harm that this may do, or a flaw.

    ``rate`` (n, 3) is the output less that at rest. At a steady deceleration the square of the share of the rate at the
    end is that of the angle that is missing.
    """
    assert row.angle is not None
    largest = float(np.max(np.abs(rate)))
    if np.max(np.abs(rate.mean(axis=0))) < FINDING.faint_turn * largest or largest == 0.0:
        return Flaw("poor_section", "nothing turns in it")
    edges = [float(np.max(np.abs(part.mean(axis=0)))) for part in (rate[:_EDGE], rate[-_EDGE:])]
    share = max(edges) / largest
    if share <= LIMITS.cut_rate:
        return ()
    end = "begin" if edges[0] == max(edges) else "end"
    way = f"under way at its {end}, at {100.0 * share:.0f} % of its largest rate"
    if share > LIMITS.lost_rate:
        return Flaw("poor_section", f"it is {way}, so that its angle is not known")
    axis = "xyz"[int(np.argmax(np.abs(rate.mean(axis=0) if row.axis is None else row.axis)))]
    gains = (f"S_{axis}", *(f"T_{i}{axis}" for i in "xyz" if i != axis))
    small = share**2 * abs(row.angle.value) < row.angle.u
    text = f"{row.section} is {way}: some of its angle is cut off."
    act = f"Move its {end} to where it rests, or state the u of its angle."
    return (Finding("turn_cut", text, _where(row), () if small else gains, action=act),)


def lengths_of(t: Array) -> Array:
    """Length of time (n,) that each sample stands for [s]: half the way to its neighbours, at the ends a whole interval
    as inside, so that with even stamps an integral is the sum over the rate."""
    steps = np.diff(t)
    padded = np.concatenate([steps[:1], steps, steps[-1:]])
    return np.asarray(0.5 * (padded[:-1] + padded[1:]))


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
