"""Suspect results, which may be off by more than their u: the status arises here and nowhere else."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from inercal.findings import EVERYTHING, Finding, Status
from inercal.instruments.terms import resting_on
from inercal.records.places import counted_names


def judged(
    verdict: tuple[Status, str], findings: Iterable[Finding], names: tuple[str, ...]
) -> tuple[tuple[Finding, ...], tuple[Status, str]]:
    """Findings with their harm in the ``names`` of a result, and its verdict.

    Harm to everything is harm to all names, and harm to a channel is harm to what rests on it. The verdict is
    ``suspect`` where it would be ``ok`` and some finding does harm. A result without names cannot be harmed: its
    findings keep the names of channels.
    """
    if not names:
        return tuple(findings), verdict
    findings = tuple(replace(each, harm=harmed(each.harm, names)) for each in findings)
    doing_harm = [each for each in findings if each.harm]
    status, message = verdict
    if status is not Status.OK or not doing_harm:
        return findings, verdict
    codes = ", ".join(dict.fromkeys(each.code for each in doing_harm))
    doubtful = [name for name in names if any(name in each.harm for each in doing_harm)]
    what = "values" if len(doubtful) == len(names) > 1 else counted_names(doubtful, 4)
    whose = "its" if len(doubtful) == 1 else "their"
    text = f"{message}; but see {codes}: {what} may be off by more than {whose} u"
    return findings, (Status.SUSPECT, text)


def harmed(harm: tuple[str, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of ``names`` that a finding harms, in their order."""
    affected = set[str]()
    for each in harm:
        if each in names:
            affected.add(each)
        else:
            affected.update(names if (each,) == EVERYTHING else resting_on(each, names))
    return tuple(name for name in names if name in affected)
