"""Checks of sections before any fit: a side taken twice, a rest or a turn that is not what its name says."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.records.places import counted_names
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.section import Section


def before_the_fit(sections: Sequence[Section]) -> tuple[Finding, ...]:
    """Gross faults of sections, each of which makes another result. A side that was taken twice is named alone, since
    without its opposite all others look wrong."""
    twice = tuple(_taken_twice(sections))
    return twice or (*_misplaced(_sides(sections), "acc"), *_misplaced(_rotations(sections), "gyro"))


def _name(section: Section) -> str:
    """A section as findings call it, its file with it."""
    return f"{section.name} ({section.where})" if section.where else section.name


def side(v: Array) -> str:
    """The side that a direction is near, such as ``+x``; empty if there is none."""
    k = int(np.argmax(np.abs(v)))
    near = abs(v[k]) > np.cos(LIMITS.side) * np.linalg.norm(v)
    return f"{'+' if v[k] > 0.0 else '-'}{'xyz'[k]}" if near else ""


def _sides(sections: Sequence[Section]) -> list[tuple[Section, Array, Array]]:
    """Rests on known sides: section, direction and mean output."""
    return [
        (s, s.up, s.acc)
        for s in sections
        if s.kind == "rest"
        and s.acc is not None
        and np.isfinite(s.acc).all()
        and s.up is not None
        and side(s.up)
    ]


def _rotations(sections: Sequence[Section]) -> list[tuple[Section, Array, Array]]:
    """Turns and rates about known axes: section, sense of rotation and mean output, the bias at rest taken off."""
    means = [
        s.gyro for s in sections if s.kind == "rest" and s.gyro is not None and np.isfinite(s.gyro).all()
    ]
    bias = np.median(means, axis=0) if means else np.zeros(3)
    out = []
    for s in sections:
        rate = s.angle / s.duration if s.kind == "turn" else s.rate
        if s.axis is not None and s.gyro is not None and np.isfinite(s.gyro).all() and rate and side(s.axis):
            out.append((s, s.axis * np.sign(rate), s.gyro - bias))
    return out


def _taken_twice(sections: Sequence[Section]) -> Iterator[Finding]:
    """Rests of opposite names whose outputs are nearly the same."""
    sides = _sides(sections)
    if len(sides) < 2:
        return
    size = 0.5 * float(np.max(np.ptp([y for _, _, y in sides], axis=0)))
    for k, (first, up, y) in enumerate(sides):
        for other, down, z in sides[k + 1 :]:
            opposed = up @ down < -np.cos(LIMITS.side)
            if opposed and np.linalg.norm(y - z) < 2.0 * np.sin(0.5 * LIMITS.side) * size:
                yield Finding(
                    "poor_section",
                    f"{_name(first)} and {_name(other)} have opposite names but nearly the same outputs",
                    harm=EVERYTHING,
                    action="Measure the side that was taken twice again, or correct its name.",
                )


def _misplaced(told: list[tuple[Section, Array, Array]], sensor: str) -> Iterator[Finding]:
    """Sections whose outputs do not lie where their names say: all of an axis, or single ones."""
    if len({side(v) for _, v, _ in told}) < 2:
        return
    outputs, names = np.array([y for _, _, y in told]), np.array([v for _, v, _ in told])
    centre = 0.5 * (outputs.min(axis=0) + outputs.max(axis=0)) if sensor == "acc" else np.zeros(3)
    ways = (outputs - centre) / np.maximum(np.linalg.norm(outputs - centre, axis=1, keepdims=True), 1e-300)
    off = np.sum(ways * names, axis=1) < np.cos(LIMITS.misplaced)
    if not off.any():
        return
    opposed = np.sum(ways * names, axis=1) < -np.cos(LIMITS.misplaced)
    if opposed.all() and len(told) > 2:
        if sensor == "acc":
            text = "All sides read opposite to their names, as if the accelerometers showed gravity, down."
            act = "Give the accelerometers the other sign in the map, or exchange the names of the sides."
        else:
            text = "All turns and rates run against what is said of them."
            act = "Give the gyro the other sign in the map, or the turns and rates theirs."
        yield Finding("sign_suspect", text, harm=EVERYTHING, action=act)
        return
    left = off.copy()
    axes = np.argmax(np.abs(names), axis=1)
    shows = np.argmax(np.abs(ways), axis=1)
    for i, axis in enumerate("xyz"):
        here = axes == i
        if here.any() and opposed[here].all():
            left &= ~here
            yield Finding(
                "sign_suspect",
                f"{sensor}_{axis} looks reversed in {_listed(told, here)}.",
                harm=EVERYTHING,
                action=f"Check the sign of {sensor}_{axis} in the map, and the names of these sections.",
            )
    for j, k in ((0, 1), (0, 2), (1, 2)):
        first, second = axes == j, axes == k
        if first.any() and second.any() and (shows[first] == k).all() and (shows[second] == j).all():
            left &= ~(first | second)
            yield Finding(
                "channel_swap",
                f"{sensor}_{'xyz'[j]} and {sensor}_{'xyz'[k]} look exchanged in {_listed(told, first | second)}.",
                harm=EVERYTHING,
                action="Check the order of the channels in the map, and the names of these sections.",
            )
    for k in np.flatnonzero(left).tolist():
        where = f"{'+' if ways[k, shows[k]] > 0.0 else '-'}{'xyz'[shows[k]]}"
        what = "lies" if sensor == "acc" else "turns about"
        yield Finding(
            "poor_section",
            f"{_name(told[k][0])} {what} {where} by its outputs, {side(told[k][1])} by its name.",
            told[k][0].where,
            EVERYTHING,
            action="Correct its name, or leave the section out.",
        )


def _listed(told: list[tuple[Section, Array, Array]], which: Array) -> str:
    """Names of some of the sections."""
    return counted_names([_name(told[k][0]) for k in np.flatnonzero(which)])
