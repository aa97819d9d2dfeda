"""Rows of sections found in one log that nobody labelled: rests, steady rates, turns from rest to rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.dwells import Dwell
from inercal.foundation.records.places import counted
from inercal.systems.imu.sections.cutting.checks import direction
from inercal.systems.imu.sections.cutting.cut import TriadSamples
from inercal.systems.imu.sections.cutting.holds import Holds, UnusedHold, holds_of, steady_rates
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.table import SectionRow


def rows_of_log(
    file: str, acc: TriadSamples | None, gyro: TriadSamples | None, gyro_scale: float | None
) -> tuple[list[SectionRow], list[Finding]]:
    """Rows found in a log, and what is asked or said of them.

    ``gyro_scale`` is that of a sound gyro [output per rad/s]; None: in counts.
    """
    clock = acc or gyro
    assert clock is not None
    t = clock.t
    rate = None if gyro is None else on_clock(gyro, t)
    found = holds_of(t, None if acc is None else acc.values, rate)
    holds = found.rests if acc is not None else found.gyro
    turning: tuple[Dwell, ...] = ()
    if rate is not None and gyro_scale is not None:
        # a file that never stops turning looks as still as one at rest
        limit = LIMITS.largest_bias * gyro_scale
        turning = tuple(hold for hold in holds if np.linalg.norm(hold.of(rate).mean(axis=0)) > limit)
        holds = tuple(hold for hold in holds if hold not in turning)
    rests = [
        SectionRow(f"rest {k}", file, float(t[hold.start]), float(t[hold.stop - 1]), why="detected")
        for k, hold in enumerate(holds, 1)
    ]
    if acc is not None:
        rests = with_sides(rests, np.array([hold.of(acc.values).mean(axis=0) for hold in holds]))
    line = of_holds(file, t, found.unused, rests, {})
    findings = [] if line is None else [line]
    rows = rests
    if rate is not None:
        # without a rest the output at rate 0 is not known
        steady = [hold for hold in steady_rates(t, rate) if holds and not _overlaps(hold, holds)]
        steady += [hold for hold in turning if not _overlaps(hold, steady)]
        still = [] if turning else [hold.of(rate).mean(axis=0) for hold in found.gyro]
        middle = np.median(still, axis=0) if still else np.zeros(3)
        plateaus, asked = _plateaus(file, t, rate - middle, steady, gyro_scale)
        sided = any(rest.up is not None for rest in rests)
        turns, told = _turns(file, t, rate, holds, acc, steady, gyro_scale, sided)
        rows, findings = [*rests, *plateaus, *turns], [*findings, *asked, *told]
    if not rows:
        findings.append(never_held(file, t, found))
    return sorted(rows, key=lambda row: (row.begin or 0.0, row.kind)), findings


def on_clock(samples: TriadSamples, t: Array) -> Array:
    """Outputs (n, 3) at times (n,) of another clock; NaN outside."""
    if samples.t is t or np.array_equal(samples.t, t):
        return samples.values
    return np.stack([np.interp(t, samples.t, x, left=np.nan, right=np.nan) for x in samples.values.T], axis=1)


def with_sides(rests: Sequence[SectionRow], means: Array) -> list[SectionRow]:
    """Rests with the side that each stands on, where *all* of their means (n, 3) are near sides; else in words alone.

    Bias and size of outputs are those that fit sides best: by the median over the rests, for most have an axis level,
    or by the middle of the range, where both sides of each axis are there.
    """
    if len(rests) < LIMITS.sides_to_compare:
        return list(rests)
    ways, worst, sided = None, -1.0, False
    for middle in (0.5 * (means.min(axis=0) + means.max(axis=0)), np.median(means, axis=0)):
        off = means - middle
        sizes = np.linalg.norm(off, axis=1)
        if np.min(sizes) < 0.5 * np.median(sizes):
            continue
        nearest = float(np.min(np.max(np.abs(off), axis=1) / sizes))
        if nearest > worst:
            ways, worst, sided = off / sizes[:, None], nearest, nearest > np.cos(LIMITS.side)
    if ways is None:
        return list(rests)
    told = []
    for rest, way in zip(rests, ways, strict=True):
        k = int(np.argmax(np.abs(way)))
        angle = np.degrees(np.arccos(min(float(abs(way[k])), 1.0)))
        why = f"detected, {angle:.0f} deg off {direction(way)}"
        told.append(replace(rest, up=np.eye(3)[k] * np.sign(way[k]) if sided else None, why=why))
    return _not_touched(told, ways) if sided else told


def _not_touched(rests: Sequence[SectionRow], ways: Array) -> list[SectionRow]:
    """Rests on sides, those in a row with the same vertical (n, 3) under one setup: turned in place, not set down."""
    near = np.linalg.norm(np.diff(ways, axis=0), axis=1) < LIMITS.turned_in_place
    number = np.concatenate([[0], np.cumsum(~near)])
    several = {k for k in number.tolist() if np.count_nonzero(number == k) > 1}
    return [
        replace(rest, setup=f"{rest.file} {k + 1}" if k in several else "")
        for rest, k in zip(rests, number.tolist(), strict=True)
    ]


def of_holds(
    file: str,
    t: Array,
    unused: Sequence[UnusedHold],
    rests: Sequence[SectionRow],
    unread: Mapping[str, str],
) -> Finding | None:
    """The line about holds that are of no use: those that are none, and ``rests`` that were not read, by name with the
    reason; None where all are used."""
    rows = [(float(t[one.start]), float(t[one.stop - 1]), one.why) for one in unused]
    rows += [
        (row.begin or 0.0, row.end or 0.0, unread[row.section]) for row in rests if row.section in unread
    ]
    if not rows:
        return None
    return Finding(
        "poor_section",
        f"{counted(len(unused) + len(rests), 'hold')} found in {file}, {len(rows)} unused.",
        file,
        (),
        action="Hold the instrument still for a second or more where these poses matter.",
        items=tuple({"begin [s]": a, "end [s]": b, "why": why} for a, b, why in sorted(rows)),
    )


def never_held(file: str, t: Array, found: Holds) -> Finding:
    """The finding about a log in which nothing is held still."""
    return Finding(
        "not_at_rest",
        f"{file} is never held still for {LIMITS.shortest_hold:g} s, calmest at {t[found.calmest]:.1f} s.",
        file,
        action="Hold the instrument still in each pose for a second or more.",
        harm=EVERYTHING,
    )


def _overlaps(hold: Dwell, others: Sequence[Dwell]) -> bool:
    """True where a hold shares more than half of its samples with others."""
    shared = sum(max(min(hold.stop, one.stop) - max(hold.start, one.start), 0) for one in others)
    return 2 * shared > hold.samples


def _plateaus(
    file: str, t: Array, rate: Array, steady: Sequence[Dwell], gyro_scale: float | None
) -> tuple[list[SectionRow], list[Finding]]:
    """Rows of stretches at a steady rate (n, 3), grouped by its size, and a question for each group."""
    means = [hold.of(rate).mean(axis=0) for hold in steady]
    sizes = np.array([np.linalg.norm(mean) for mean in means])
    order = np.argsort(sizes)
    breaks = np.flatnonzero(np.diff(sizes[order]) > LIMITS.one_rate * sizes[order][:-1]) + 1
    rows: dict[int, SectionRow] = {}
    findings = []
    for number, group in enumerate(np.split(order, breaks) if len(order) else [], 1):
        size = float(np.mean(sizes[group]))
        about = (
            f"about {np.degrees(size / gyro_scale):.3g} deg/s"
            if gyro_scale
            else f"a gyro output of {size:.4g}"
        )
        for k in group.tolist():
            way = means[k] / sizes[k]
            axis = int(np.argmax(np.abs(way)))
            near = abs(way[axis]) > np.cos(LIMITS.side)
            rows[k] = SectionRow(
                "", file, float(t[steady[k].start]), float(t[steady[k].stop - 1]), "rate",
                axis=np.eye(3)[axis] * np.sign(way[axis]) if near else None,
                rate_group=f"{file} {number}",
                why=f"plateau, {about}{f' about {direction(way)}' if near else ''}: which rate?",
            )  # fmt: skip
        findings.append(
            Finding(
                "not_stated",
                f"{counted(len(group), 'stretch') if len(group) == 1 else f'{len(group)} stretches'} of {file} turn at "
                f"{about}.",
                file,
                action="Write their rate into the column `rate` of sections.csv.",
                harm=EVERYTHING,
            )
        )
    return [replace(rows[k], section=f"rate {n}") for n, k in enumerate(sorted(rows), 1)], findings


def _turns(
    file: str,
    t: Array,
    rate: Array,
    holds: Sequence[Dwell],
    acc: TriadSamples | None,
    steady: Sequence[Dwell],
    gyro_scale: float | None,
    sided: bool,
) -> tuple[list[SectionRow], list[Finding]]:
    """Rows of turns about an axis from one hold to the next that leave the vertical where it was.

    Those that are not whole turns are taken for turns only where the holds are ``sided``, all of them on sides.
    """
    found = list(_rotations(t, rate, holds, acc, steady))
    largest = max((float(np.linalg.norm(rotation)) for _, _, rotation in found), default=0.0)
    rows: list[SectionRow] = []
    for before, after, rotation in found:
        size = float(np.linalg.norm(rotation))
        axis = int(np.argmax(np.abs(rotation)))
        if size < LIMITS.least_turn * largest or abs(rotation[axis]) < LIMITS.turn_about_axis * size:
            continue
        row = SectionRow(
            f"turn {len(rows) + 1}", file, float(t[before.start]), float(t[after.stop - 1]), "turn",
            axis=np.eye(3)[axis],
        )  # fmt: skip
        way = direction(rotation)
        turns = 0.0 if gyro_scale is None else rotation[axis] / gyro_scale / (2.0 * np.pi)
        whole = bool(round(turns)) and abs(turns / round(turns) - 1.0) < LIMITS.whole_turn
        if whole or sided:
            about = f"{360.0 * turns:.0f} deg by the gyro" if gyro_scale else "a turn"
            rows.append(replace(row, why=f"detected, {about} about {way}: which angle?"))
    if not rows:
        return [], []
    # where there are accelerometers its rests and what the gyro carries between them count as a move
    harm = EVERYTHING if acc is None else ()
    headline = f"The angle of {counted(len(rows), 'turn')} of {file} is not known."
    action = "Write it with its sign into the column `angle` of sections.csv: 360 deg, or 360(2) deg by hand."
    return rows, [Finding("not_stated", headline, file, harm, action=action)]


def _rotations(
    t: Array, rate: Array, holds: Sequence[Dwell], acc: TriadSamples | None, steady: Sequence[Dwell]
) -> Iterator[tuple[Dwell, Dwell, Array]]:
    """Two holds in a row with the same vertical, and the integral (3,) of the gyro's output, less its bias, between."""
    means = None if acc is None else np.array([hold.of(acc.values).mean(axis=0) for hold in holds])
    gravity = 0.0 if means is None or not len(means) else 0.5 * float(np.max(np.ptp(means, axis=0)))
    for k in range(len(holds) - 1):
        before, after = holds[k], holds[k + 1]
        if any(before.stop <= one.start < after.start for one in steady):
            continue
        if means is not None and np.linalg.norm(means[k + 1] - means[k]) > max(
            LIMITS.turned_vertical * gravity, 1e-30
        ):
            continue
        part = slice(before.stop, after.start)
        bias = 0.5 * (before.of(rate).mean(axis=0) + after.of(rate).mean(axis=0))
        rotation = np.trapezoid(rate[part] - bias, t[part], axis=0)
        if np.isfinite(rotation).all() and after.start - before.stop > 2:
            yield before, after, rotation
