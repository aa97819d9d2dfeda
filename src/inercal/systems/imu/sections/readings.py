"""Sections side by side in arrays: what was read, and what is said of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.systems.imu.sections.section import Section

Flags = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SectionArrays:
    """n sections side by side. Of the three kinds of outputs the first is of the accelerometers, the second of these
    after a turn, the third of the gyro."""

    sections: tuple[Section, ...]
    y: Array
    """Outputs (n, 3 kinds, 3 axes), NaN where there is none."""
    seen: Flags
    """Outputs (n, 3, 3) that count."""
    stated: Flags
    """Outputs (n, 3, 3) whose noise is stated."""
    variance: Array
    """That noise (n, 3, 3), 0 where it is not stated."""
    turning: Flags
    """Turns (n,)."""
    whole: Flags
    """Steady rates (n,), which are means over whole turns."""
    duration: Array
    angle: Array
    rate: Array
    """Durations [s], angles of turns [rad] and mean rates [rad/s] (n,)."""
    swung: Array
    """Mean cosine and sine (n, 2) of the angle over a section."""
    rate_groups: tuple[str, ...]
    rate_group: Places
    """Groups whose rates share one error, and that of each section (n,), -1 for none."""
    sessions: tuple[str, ...]
    session: Places
    """Sessions, where there are several, and that of each section (n,)."""
    leader: Places
    """The first section (n,) of the same setup, whose placing is that of all of it."""
    earth_leader: Places
    """The first rest (n,) of the same setup where a gyro rests alone: earth rate is the same in all of them."""
    forced: Flags
    """Sections (n,) whose specific force was measured by another instrument."""
    force: Array
    """Its size (n,) [m/s^2], 0 for all others."""
    tied: Flags
    """Sections (n,) whose axis is vertical within a stated angle."""
    know_up: Flags
    know_axis: Flags
    """Sections (n,) whose vertical, or axis, is known within a placing error."""
    led: Flags
    """Sections (n,) at a rate whose vertical the accelerometers tell, but for their lever arm."""
    has_force: Flags
    """Sections (n,) whose vertical is known, or measured, or an unknown."""
    up: Array
    axis: Array
    """Directions (n, 3) of specific force and axes as they are said to be; z where nothing is said."""
    channels: Flags
    """Channels (2, 3) that are there, of accelerometers and gyro."""


def side_by_side(sections: Sequence[Section]) -> SectionArrays:
    """The sections in arrays."""
    y = np.stack([_rows(sections, name, np.nan) for name in ("acc", "acc_after", "gyro")], axis=1)
    noise = np.stack([_rows(sections, name, np.nan) for name in ("acc_var", "acc_var", "gyro_var")], axis=1)
    turning, whole = (np.array([s.kind == kind for s in sections]) for kind in ("turn", "rate"))
    seen = np.isfinite(y)
    felt = seen[:, 0].any(axis=1)
    seen[whole, :2] = False  # a lever arm adds to the accelerometers of a unit that turns
    duration, angle = (np.array([getattr(s, name) for s in sections]) for name in ("duration", "angle"))
    rate = np.where(turning, angle / duration, [s.rate for s in sections])
    tied = np.array([s.level_u is not None for s in sections])
    forced = np.array([s.force is not None for s in sections])
    know_axis = np.array([s.axis is not None for s in sections])
    know_up = np.array([s.up is not None for s in sections]) | forced | (tied & know_axis)
    axis, up = (_rows(sections, name, np.array([0.0, 0.0, 1.0])) for name in ("axis", "up"))
    force = np.zeros(len(sections))
    for k, section in enumerate(sections):
        if section.force is not None:
            up[k], force[k] = section.force, np.linalg.norm(section.force)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-300)
    same = np.sign(np.sum(axis * up, axis=1))
    up = np.where(tied[:, None] & ~forced[:, None], axis * np.where(same == 0.0, 1.0, same)[:, None], up)
    rate_groups, rate_group = _groups([s.rate_group for s in sections])
    sessions, session = _groups([s.session for s in sections])
    if len(sessions) + bool((session < 0).any()) < 2:
        sessions, session = (), np.full(len(sections), -1)
    first: dict[str, int] = {}
    leader = [first.setdefault(s.setup, k) if s.setup else k for k, s in enumerate(sections)]
    has_force = know_up | felt
    lone: dict[str, int] = {}
    earth_leader = [
        lone.setdefault(s.setup, k) if s.setup and s.kind == "rest" and not has_force[k] else k
        for k, s in enumerate(sections)
    ]
    return SectionArrays(
        sections=tuple(sections),
        y=y,
        seen=seen,
        stated=np.isfinite(noise),
        variance=np.where(np.isfinite(noise), noise, 0.0),
        turning=turning,
        whole=whole,
        duration=duration,
        angle=angle,
        rate=rate,
        swung=np.array([_swung(s) for s in sections]),
        rate_groups=rate_groups,
        rate_group=rate_group,
        sessions=sessions,
        session=session,
        leader=np.array(leader),
        earth_leader=np.array(earth_leader),
        forced=forced,
        force=force,
        tied=tied,
        know_up=know_up,
        know_axis=know_axis,
        led=whole & felt & ~know_up,
        has_force=has_force,
        up=up,
        axis=axis,
        channels=np.array([[seen[:, kind, i].any() for i in range(3)] for kind in (0, 2)]),
    )


def _rows(sections: Sequence[Section], name: str, none: float | Array) -> Array:
    """A field of all sections (n, 3)."""
    rows = [none if (row := getattr(s, name)) is None else row for s in sections]
    return np.array([np.broadcast_to(row, 3) for row in rows], dtype=float).reshape(-1, 3)


def _groups(names: list[str]) -> tuple[tuple[str, ...], Places]:
    """Names that occur, sorted, and the place of each of the names among them, -1 for an empty one."""
    groups = tuple(sorted({name for name in names if name}))
    return groups, np.array([groups.index(name) if name else -1 for name in names], dtype=int)


def _swung(section: Section) -> tuple[float, float]:
    """Mean cosine and sine of the angle: of a turn as told, or at a steady rate."""
    if section.kind == "rate":
        return 0.0, 0.0
    if section.kind != "turn" or section.angle == 0.0:
        return 1.0, 0.0
    a = section.angle
    return section.cosine_sine or (np.sin(a) / a, (1.0 - np.cos(a)) / a)
