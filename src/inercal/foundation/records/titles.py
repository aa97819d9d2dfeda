"""Titles of columns: channel and unit that a title names, canonical as in ``acc_x [m/s^2]`` or in anyone's words."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from inercal.foundation.errors import QuantityError, RecordError
from inercal.foundation.records.channels import Channel, Origin, is_channel, misfit, needs_unit
from inercal.foundation.records.places import counted_names, shortened
from inercal.foundation.records.read.limits import TITLE
from inercal.foundation.records.recognise.words import said
from inercal.foundation.units import Unit, parse_unit, shown

EXAMPLE = '"t [s],acc_x [m/s^2],gyro_x [deg/s]"'


_TITLE = re.compile(r"(\w+)\s*(?:\[(.*)\])?")


def bare(title: str) -> str:
    """A title without the unit in brackets, square or round, behind it; a number there is no unit but an index."""
    return re.sub(r"(?<=\S)\s*[\[(](?!\d+[\])]).*", "", title).strip()


def name_and_unit(title: str) -> tuple[str, str | None]:
    """Name and unit of a title: ``acc_x`` and ``m/s^2`` of ``acc_x [m/s^2]``; the title itself if it is no such."""
    match = _TITLE.fullmatch(title.strip()) if len(title) <= TITLE else None
    return (title, None) if match is None else (match[1], match[2])


def canonical(titles: Iterable[tuple[Origin, str, str | None]], where: object) -> tuple[Channel, ...]:
    """The channels among titled columns; columns of other names are none of ours.

    ``titles`` are (origin, title, unit): where a column is found, what it is called, and the unit stated beside it, if
    any; one in brackets within the title wins. Raises, naming ``where``, `RecordError` for a channel twice, without a
    unit, or with one that it cannot have, or no channel at all, and `QuantityError` for something else than a unit.
    """
    channels: dict[str, Channel] = {}
    titles, titles_read = list(titles), []
    for origin, title, unit_beside in titles:
        titles_read.append(shortened(title))
        match = _TITLE.fullmatch(title) if len(title) <= TITLE else None
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
    if "t" not in channels:
        times = (_time(origin, *name_and_unit(title), beside) for origin, title, beside in titles)
        if (time := next((one for one in times if one is not None), None)) is not None:
            channels["t"] = time
    return tuple(channels.values())


def _time(origin: Origin, name: str, unit: str | None, beside: str | None) -> Channel | None:
    """The column of times whose name says so in other words, beside its unit, as ``time [s]``; None for any other."""
    text = unit or beside
    if text is None or said(name, text).sensor != "t" or not fits("t", text):
        return None
    return Channel("t", origin, parse_unit(text))


#: sensors of rigs -> names; those of an instrument are told by `inercal.foundation.records.recognise.words`
_OF_RIGS = {
    "wc": r"wc|(?:cmd|command|commanded)(?: (?:rate|angular rate|omega|w))?",
    "th": r"th|theta|gimbal|gimbal angle|encoder|encoder angle|enc",
}
#: channels of a model that pitches -> names
_ACCELEROMETER = r"a|f|acc|accel|accelerometer|acceleration"
_OF_A_MODEL = (
    (
        "theta_ref",
        r"(?:theta|alpha|ao ?a|pitch|angle|incidence) (?:ref|reference|true|inclinometer|encoder)"
        r"|(?:ref|reference) (?:angle|theta|alpha)|inclinometer",
    ),
    ("gyro_roll", r"roll (?:rate|gyro)|gyro roll"),
    ("gyro_yaw", r"yaw (?:rate|gyro)|gyro yaw"),
    ("gyro", r"pitch (?:rate|gyro)|gyro(?: pitch)?"),
    ("point", r"(?:test )?point(?: (?:no|nr|number|id))?"),
    ("trigger", r"trig|trigger"),
)
OF_A_MODEL = {
    "acc_x": "a1", "acc_y": "a2", "acc_z": "a3", "gyro_x": "gyro_roll", "gyro_y": "gyro", "gyro_z": "gyro_yaw",
}  # fmt: skip
"""Channels of a model that pitches about y, for those of a triad."""

#: channels on a turntable, base first -> names
_OF_A_TABLE = (
    ("phi1", r"outer|axis 1|achse 1"),
    ("phi2", r"inner|axis 2|achse 2"),
    ("position", r"pos"),
    ("y_x", r"(?:out|output|reading|signal) x"),
    ("y_y", r"(?:out|output|reading|signal) y"),
)
_LABEL = r"label|part|section|pose|side|seite|lage|face"


def titled(title: str, given: str | None = None) -> tuple[str | None, str | None]:
    """The channel and the unit that a title such as ``gyro_x_mdps`` or ``Drehrate X [mdeg/s]`` speaks of.

    A unit stands in brackets, beside the title (``given``), or behind the last ``_`` or blank. Where the name says
    nothing, or another quantity than the unit, the channel goes by the unit and by X, Y, Z or 1, 2, 3 in the name.

    Returns
    -------
    channel, unit : str or None
        The unit as it is written, known or not; plainly where a name spells it, as ``acc_x_m_s2``.
    """
    if len(title) > TITLE:
        return None, None
    match = re.fullmatch(r"(.*?)\s*(?:[\[(](?!\d+[\])])(.*)[\])])?", title.strip())
    plain, unit = (match[1], match[2] or given) if match else (title, given)
    name = plain if is_channel(plain) else _of_rig(plain)
    if name is None and unit is None:
        stem, _, suffix = plain.replace(" ", "_").rpartition("_")
        if (meant := stem if is_channel(stem) else _of_rig(stem)) and fits(meant, suffix):
            return meant, suffix
    if name is not None and (unit is None or not _known(unit) or fits(name, unit)):
        return name, unit
    words = said(plain, unit)
    sensor = words.sensor if not words.never else ""
    if sensor in ("acc", "gyro") and words.axis:
        return f"{sensor}_{words.axis}", unit or words.unit or None
    return ("t", unit or words.unit or None) if sensor == "t" else (None, unit)


def numbered(title: str) -> str | None:
    """``a2`` of titles such as ``Accel 2 [g]`` or ``acc_2``, of a model whose accelerometers have numbers."""
    if len(title) > TITLE:
        return None
    match = re.fullmatch(
        rf"(?:.* )?(?:{_ACCELEROMETER}) ?([1-9]\d*)", _words(re.sub(r"\s*[\[(].*", "", title))
    )
    return f"a{match[1]}" if match else None


def rate_of_model(title: str, unit: str | None) -> str | None:
    """The channel of a model's gyro by the letter that aerodynamicists give its rate, p, q or r, with its unit."""
    letter = _words(bare(title)) if unit is not None and fits("gyro", unit) else ""
    return {"p": "gyro_roll", "q": "gyro", "r": "gyro_yaw"}.get(letter)


def triads_by_name(names: Sequence[str]) -> list[tuple[int, int, int]]:
    """Numbers of columns whose names differ in x, y, z alone, as ``Bx (mV)``, ``By (mV)``, ``Bz (mV)``."""
    found = []
    for index, name in enumerate(names):
        for x in re.finditer("[xX]", name[:TITLE]):
            axes = "xyz" if x[0] == "x" else "XYZ"
            alike = [name[: x.start()] + axis + name[x.end() :] for axis in axes]
            if all(names.count(each) == 1 for each in alike):
                found.append((index, names.index(alike[1]), names.index(alike[2])))
                break
    return found


def of_table(title: str) -> str | None:
    """The channel of a table of two axes, or of the instrument on it, by titles such as ``Inner axis`` or ``Out X``."""
    words = _words(re.sub(r"\s*[\[(].*", "", title[:TITLE]))
    for channel, names in _OF_A_TABLE:
        if re.fullmatch(rf"(?:{names})(?: (?:axis|angle|gimbal|position|deg))*", words):
            return channel
    return None


def fits(name: str, unit: str) -> bool:
    """True if there is such a unit and the channel may have it."""
    parsed = _known(unit)
    return parsed is not None and misfit(name, parsed) is None


def is_unit(text: str) -> bool:
    """True for the unit of any quantity."""
    return _known(text) is not None


def _known(unit: str) -> Unit | None:
    """The unit, None if there is none such."""
    try:
        return parse_unit(unit) if unit else None
    except QuantityError:
        return None


def _of_rig(title: str) -> str | None:
    """The channel of a rig, or other than of a sensor, that a name stands for, if any."""
    words = _words(title)
    if angle := re.fullmatch(r"phi ?([123])", words):
        return f"phi{angle[1]}"
    for sensor, names in _OF_RIGS.items():
        if match := re.fullmatch(rf"(?:.* )?(?:{names}) ?([xyz])|([xyz])(?: (?:{names})|{sensor})", words):
            return f"{sensor}_{match[1] or match[2]}"
    if axis := re.fullmatch(r"(?:.* )?a([1-9]\d*)|a ([1-9]\d*)", words):
        return f"a{axis[1] or axis[2]}"
    for channel, names in (
        *_OF_A_MODEL,
        ("label", _LABEL),
        ("temperature", r"temp|tmp|temperature|temperatur"),
        ("position", "position"),
    ):
        if re.fullmatch(rf"(?:.* )?(?:{names})", words):
            return channel
    return None


def _words(title: str) -> str:
    """A name as words in small letters."""
    # uT is no u and t
    words = re.sub(r"(?<=[a-z])(?=[A-Z][a-z])|(?<=[A-Za-z][a-z])(?=[A-Z])", " ", title)
    words = re.sub(r"\[([012])\]", lambda index: f" {'xyz'[int(index[1])]}", words)
    return re.sub(r"[^a-z0-9]+", " ", words.lower()).strip()
