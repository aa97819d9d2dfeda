"""The plan of a test in lines of text, one for each position, turn or sensor, and in the study."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from inercal.errors import InputError
from inercal.face.study import Study
from inercal.studies.text import parsed, toml, with_keys


@dataclass(frozen=True)
class Kind:
    """The plan of a kind of study: words of its ``command``, the ending of the plan that it writes, empty where it
    finds none, what a line ``says``, and plans by their name, each as keys with their TOML; empty ones are taken
    out."""

    command: tuple[str, ...]
    ending: str
    says: str
    named: Mapping[str, Mapping[str, str]]


def lines_of(study: Study) -> str:
    """The plan of a study, a line for each of its parts; empty without one."""
    return "\n".join(", ".join(each) for each in _PARTS[study.kind](study))


def with_lines(kind: str, text: str, lines: str) -> str:
    """The text of a study with the plan of these lines; raises `InputError` for lines that are none."""
    rows = [[word.strip() for word in line.split(",")] for line in lines.splitlines() if line.strip()]
    if not rows:
        raise InputError("plan", f"found no line, expected some like: {KINDS[kind].says}")
    if kind == "aoa":
        return _with_sensors(text, rows)
    table = [[_with_unit(word) for word in row] for row in rows]
    key, others = _WHERE[kind]
    return with_keys(text, {**dict.fromkeys(others, ""), key: _lines(table)})


def with_found(kind: str, text: str, found: str) -> str:
    """The text of a study with the plan that its command wrote: TOML, or CSV with a line of joints."""
    if KINDS[kind].ending == ".csv":
        return with_lines(kind, text, "\n".join(found.splitlines()[1:]))
    tables = tomllib.loads(found)
    others = dict.fromkeys(_WHERE[kind][1], "")
    keys = {
        f"plan.{key}": _lines(value) if key == "turns" else toml(value)
        for key, value in tables["plan"].items()
    }
    return with_keys(text, others | keys)


def _lines(rows: list[list[str]]) -> str:
    """Rows as TOML, a line each."""
    return "[\n" + "".join(f"    {toml(row)},\n" for row in rows) + "]"


def _with_unit(word: str) -> str:
    """A number as an angle in degrees; anything else as it is."""
    try:
        return f"{float(word):.10g} deg"
    except ValueError:
        return word


def _with_sensors(text: str, rows: list[list[str]]) -> str:
    """The text of a study with these accelerometers."""
    wrong = [", ".join(row) for row in rows if len(row) != 3]
    if wrong:
        raise InputError(
            "sensors", f"found {wrong[0]!r}, expected name, axis, place such as {KINDS['aoa'].says}"
        )
    given = parsed(text).get("sensors", {})
    gone = [name for name in given if "axis" in given[name] and name not in [row[0] for row in rows]]
    text = with_keys(text, {f"sensors.{name}": "" for name in gone})
    of_each = {f"sensors.{name}": {"axis": axis, "r": place} for name, axis, place in rows}
    return with_keys(
        text, {f"{at}.{key}": toml(word) for at, keys in of_each.items() for key, word in keys.items()}
    )


def _positions(study: Study) -> Iterable[list[str]]:
    """Positions of a table."""
    return ([f"{angle:.10g}" for angle in row] for row in _degrees(study.settings.plan.angles))


def _moves(study: Study) -> Iterable[list[str]]:
    """Moves of a platform."""
    from inercal.selfcal.before.path_design import stated_moves

    return stated_moves(study.settings.plan.moves) if study.settings.plan is not None else ()


def _turns(study: Study) -> Iterable[list[str]]:
    """Turns of a strapdown unit."""
    from inercal.strapdown.design import stated_turns

    return stated_turns(study.settings.plan) if study.settings.plan is not None else ()


def _sensors(study: Study) -> Iterable[list[str]]:
    """Accelerometers of a model."""
    given = study.keys.get("sensors", {})
    return (
        [name, str(each["axis"]), str(each.get("r", "0 m"))] for name, each in given.items() if "axis" in each
    )


def _degrees(angles: Any) -> list[list[float]]:
    """Angles (n, joints) [rad] in degrees."""
    return [[math.degrees(angle) for angle in row] for row in angles.tolist()]


def _named() -> Mapping[str, Mapping[str, Mapping[str, str]]]:
    """Plans by their name, of each kind of study."""
    from inercal.rigs.plans import NAMED
    from inercal.strapdown.design import NINETEEN

    quarters = [["xyz"[axis], f"{math.degrees(angle):.10g} deg"] for axis, angle in NINETEEN]
    others = dict.fromkeys(("positions.grid", "positions.list", "positions.file"), "")
    return {
        "turntable": {name: others | {"positions.plan": toml(name)} for name in NAMED},
        "selfcal": {
            name: {"plan.turns": "", "plan.path": toml(name)}
            for name in ("paper", "paper two turns", "best", "plain")
        },
        "strapdown": {
            "19 positions": {"plan.start": '["0 deg", "-90 deg", "0 deg"]', "plan.turns": _lines(quarters)}
        },
        "aoa": {},
    }


_PARTS: Mapping[str, Callable[[Study], Iterable[list[str]]]] = {
    "turntable": _positions,
    "selfcal": _moves,
    "strapdown": _turns,
    "aoa": _sensors,
}

_WHERE = {
    "turntable": ("positions.list", ("positions.plan", "positions.grid", "positions.file")),
    "selfcal": ("plan.turns", ("plan.path",)),
    "strapdown": ("plan.turns", ()),
}
"""Key of the plan of each kind, and those that would say it otherwise."""

KINDS: Mapping[str, Kind] = {
    "turntable": Kind(
        ("design", "positions"),
        ".csv",
        "90, 45 (angles of the axes in deg, outer first)",
        _named()["turntable"],
    ),
    "selfcal": Kind(
        ("design", "selfcal"),
        ".toml",
        "z, 180 deg (joint, angle, and a rate of its own) or rest, 60 s",
        _named()["selfcal"],
    ),
    "strapdown": Kind(
        ("design", "strapdown"), ".toml", "y, 90 deg (axis of the unit, angle)", _named()["strapdown"]
    ),
    "aoa": Kind(
        ("design", "aoa"), "", "a1, -z, -0.25 m (name, axis, place ahead of the pivot)", _named()["aoa"]
    ),
}
"""Kinds of study that plan a test."""
