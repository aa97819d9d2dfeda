"""The advice of a finding as a change of the study, where it is one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from inercal.bench.workbench.form import problem
from inercal.faces.studies.text import changed, parsed
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding

_SET = re.compile(r"\b[Ss]et ([a-z_]\w*(?:\.\w+)+) = (true|false|\"[^\"]*\"|[-+.\de]+\d)")
_UNDER = re.compile(
    r"\b(?:[Ww]rite|[Ss]tate|[Tt]ake) (\w+) = (\"[^\"]*\"|true|false|[-+.\de]*\d)[^;\[]{0,60}? under \[([\w.]+)\]"
)
_STATES = re.compile(r"\b[Nn]ame (?!them\b)([\w, ]+?) in states under \[model\]")
"""The words in which findings say what to write: a key and its value, or kinds of states of a platform."""


@dataclass(frozen=True)
class Advice:
    """A change of the study: the key at ``path``, its ``value`` in TOML, and in words."""

    path: str
    value: str

    @property
    def words(self) -> str:
        """The change as a line of the study."""
        return f"{self.path} = {self.value}"


def advice_of(finding: Finding, study: str, kind: str) -> tuple[Advice, ...]:
    """Changes of the text of a study of that kind that a finding advises, without those that it has already, and
    without those that would make a good study one that cannot be used."""
    found = [Advice(match[1], match[2]) for match in _SET.finditer(finding.message)]
    found += [Advice(f"{match[3]}.{match[1]}", match[2]) for match in _UNDER.finditer(finding.message)]
    for match in _STATES.finditer(finding.message):
        kinds = [kind for kind in re.split(r", | or | and ", match[1]) if re.fullmatch(r"\w+", kind)]
        found += [each for each in [_with_states(kinds[:1], study)] if each is not None]
    return tuple(dict.fromkeys(each for each in found if _changes(each, study, kind)))


def _with_states(kinds: list[str], study: str) -> Advice | None:
    """Kinds of states beside those that a study names; None where it has them."""
    try:
        model = parsed(study).get("model", {})
    except InputError:
        return None
    given: Any = model.get("states", "rig")
    listed = [given] if isinstance(given, str) else list(given)
    added = [kind for kind in kinds if kind not in listed]
    return Advice("model.states", str([*listed, *added]).replace("'", '"')) if added else None


def _changes(advice: Advice, study: str, kind: str) -> bool:
    """True for a change that can be made, and is one."""
    try:
        made = changed(study, advice.path, advice.value)
        differs = parsed(made) != parsed(study)
    except InputError:
        return False
    return differs and (not problem(kind, made) or bool(problem(kind, study)))
