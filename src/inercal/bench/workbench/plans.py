"""The plan of a test in lines of text, one for each position, turn or sensor, and in the study."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from inercal.faces.python.study import Study
from inercal.faces.studies.text import parsed, toml, with_keys
from inercal.foundation.errors import InputError
from inercal.systems.contract import OfferedPlan


def lines_of(study: Study) -> str:
    """The plan of a study, a line for each of its parts; empty without one."""
    plan = study.system.plan
    return "" if plan is None else "\n".join(", ".join(row) for row in plan.rows(study.settings))


def named(plan: OfferedPlan) -> Mapping[str, Mapping[str, str]]:
    """Plans by their name, each as keys with their TOML; empty ones are taken out."""
    return {name: {key: _toml(value) for key, value in keys.items()} for name, keys in plan.named().items()}


def with_lines(plan: OfferedPlan, text: str, lines: str) -> str:
    """The text of a study with the plan of these lines; raises `InputError` for lines that are none."""
    rows = [[word.strip() for word in line.split(",")] for line in lines.splitlines() if line.strip()]
    if not rows:
        raise InputError("plan", f"found no line, expected some like: {plan.says}")
    if plan.key:
        stated = [[_with_unit(word) for word in row] for row in rows]
        keys: Mapping[str, Any] = {**dict.fromkeys(plan.others), plan.key: stated}
    else:
        keys = plan.keys(rows, parsed(text))
    return with_keys(text, {key: _toml(value) for key, value in keys.items()})


def with_found(plan: OfferedPlan, text: str, found: str) -> str:
    """The text of a study with the plan that its command wrote: TOML, or CSV with a line of joints."""
    if plan.ending == ".csv":
        return with_lines(plan, text, "\n".join(found.splitlines()[1:]))
    keys = {f"plan.{key}": value for key, value in tomllib.loads(found)["plan"].items()}
    return with_keys(text, {key: _toml(value) for key, value in (dict.fromkeys(plan.others) | keys).items()})


def _toml(value: object) -> str:
    """A value as TOML, rows a line each; empty for None."""
    match value:
        case None:
            return ""
        case [[*_], *_]:
            rows: Sequence[object] = value
            return "[\n" + "".join(f"    {toml(row)},\n" for row in rows) + "]"
    return toml(value)


def _with_unit(word: str) -> str:
    """A number as an angle in degrees; anything else as it is."""
    try:
        return f"{float(word):.10g} deg"
    except ValueError:
        return word
