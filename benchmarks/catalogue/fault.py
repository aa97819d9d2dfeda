"""What a fault is, and what became of one recording that has it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Fault:
    """A fault of one size.

    Attributes
    ----------
    make : callable
        Two estimates or angles from the number of a draw: with the fault, and without.
    told : str
        Words (a regular expression) by which a finding that does no harm says what such a fault would do.
    blind : str
        Why no data can show it; empty where data can.
    """

    make: Callable[[int], Outcome]
    told: str = ""
    blind: str = ""


@dataclass(frozen=True)
class Outcome:
    """Of one recording: ``status``; ``shift`` of the value that moved most, over U/2 as stated, and its name in ``of``;
    ``named`` the codes of what does harm; ``messages`` of all else that is said."""

    status: str
    shift: float
    of: str
    named: tuple[str, ...]
    messages: tuple[str, ...] = ()

    def row(self, system: str, name: str, draw: int, fault: Fault) -> dict:
        """The one row format of the campaign."""
        told = bool(fault.told) and any(re.search(fault.told, each) for each in self.messages)
        return {
            "system": system, "fault": name, "draw": draw, "status": self.status, "shift": round(self.shift, 3),
            "of": self.of, "named": list(self.named), "told": told, "blind": bool(fault.blind),
        }  # fmt: skip


REFUSED = Outcome("refused", 0.0, "", ())


def said(findings: Iterable) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Codes of what does harm, and all texts of the rest."""
    findings = list(findings)
    return (
        tuple(sorted({each.code for each in findings if each.harm})),
        tuple(str(each.to_json()) for each in findings if not each.harm),
    )


def compared(estimate, sound, errors: dict[str, float] | None = None, before: dict[str, float] | None = None):
    """The outcome of an estimate beside that of the same recording without the fault.

    ``errors`` and ``before`` replace the values where the fault changes the truth; all by name, in the values' units.
    """
    after = errors or {name: estimate[name].value for name in estimate.names}
    before = before or {name: sound[name].value for name in sound.names}
    half = {name: 0.5 * estimate[name].U for name in after}  # u, but for few degrees of freedom
    shifts = {name: abs(after[name] - before[name]) / half[name] for name in after if name in before}
    of = max(shifts, key=shifts.__getitem__, default="")
    return Outcome(estimate.status.value, float(shifts.get(of, 0.0)), of, *said(estimate.findings))


def late(angle, u, true, sound, true_sound):
    """Root mean square of the shift of an angle over its u, where both are known."""
    off = ((angle - true) - (sound - true_sound)) / u
    return float(np.sqrt(np.nanmean(np.square(off))))
