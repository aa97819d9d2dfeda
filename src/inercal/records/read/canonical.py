"""Columns that say themselves what they hold: ``acc_x [m/s^2]``, or a name with a unit beside it."""

from __future__ import annotations

import re
from collections.abc import Iterable

from inercal.errors import RecordError
from inercal.records.channels import Channel, Origin, is_channel, misfit, needs_unit
from inercal.records.places import counted_names
from inercal.units import parse_unit, shown

EXAMPLE = '"t [s],acc_x [m/s^2],gyro_x [deg/s]"'


_TITLE = re.compile(r"(\w+)\s*(?:\[(.*)\])?")


def bare(title: str) -> str:
    """A title without the unit in brackets, square or round, behind it."""
    return re.sub(r"(?<=\S)\s*[\[(].*", "", title).strip()


def titled(title: str) -> tuple[str, str | None]:
    """Name and unit of a title: ``acc_x`` and ``m/s^2`` of ``acc_x [m/s^2]``; the title itself if it is no such."""
    match = _TITLE.fullmatch(title.strip())
    return (title, None) if match is None else (match[1], match[2])


def canonical(titles: Iterable[tuple[Origin, str, str | None]], where: object) -> tuple[Channel, ...]:
    """The channels among titled columns; columns of other names are none of ours.

    Parameters
    ----------
    titles : iterable of (origin, title, unit)
        Where a column is found, what it is called, and the unit stated beside it, if any; one in brackets
        within the title wins.
    where : object
        Named in the errors.

    Raises
    ------
    RecordError
        A channel twice, without a unit, or with one that it cannot have; or no channel at all.
    QuantityError
        Something else than a unit.
    """
    channels: dict[str, Channel] = {}
    titles_read = []
    for origin, title, unit_beside in titles:
        titles_read.append(title)
        match = _TITLE.fullmatch(title)
        if match is None or not is_channel(name := match[1]):
            continue
        unit_text = unit_beside if match[2] is None else match[2]
        if name in channels:
            raise RecordError(where, f"found {name} twice, expected each column once")
        if unit_text is None and needs_unit(name):
            raise RecordError(
                where,
                f"found {shown(title)} without a unit, expected it in brackets or a map, as in {EXAMPLE}",
            )
        unit = parse_unit(unit_text or "1", f"{where}: {name}")
        if problem := misfit(name, unit):
            raise RecordError(where, f"{name}: {problem}")
        channels[name] = Channel(name, origin, unit)
    if not channels.keys() - {"label"}:
        raise RecordError(
            where,
            f"found the columns {counted_names(titles_read, 8)}, expected known ones as in {EXAMPLE}, or a map "
            "(`inercal new` imu, turntable, selfcal or aoa writes one)",
        )
    return tuple(channels.values())
