"""Sentences that results of several systems have: what is at its prior, missed, taken as exact, ruled by the site.

Each rule and each sentence is here once. A system adds what only it can know: the hint to a coefficient, its words.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TypedDict

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.inference.identifiability import Learned
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.budget import BudgetItem


class ReachedGoal(TypedDict):
    """A goal of a study, as results have it: ``wanted`` and reached ``u`` [SI], and whether it is ``met``."""

    wanted: float
    u: float
    met: bool


def at_prior(left: Mapping[str, float], hints: Mapping[str, str] | None = None) -> list[Finding]:
    """A finding for each coefficient, by the part of its prior that is ``left``, with the hint to it, if any."""
    texts = {name: f"{name}: {100.0 * part:.0f} % of its prior is left" for name, part in left.items()}
    return _hinted("at_prior", texts, hints)


def at_prior_together(names: Sequence[str], more: str = "") -> list[Finding]:
    """One finding for all coefficients of which more than half of the prior is left, if any, with ``more`` words."""
    if not names:
        return []
    return [Finding("at_prior", f"{counted_names(names, 6)}: more than half of the prior is left{more}")]


def reached(names: Sequence[str], u: Array, wanted: Mapping[str, float]) -> dict[str, ReachedGoal]:
    """The goals ``wanted`` [SI] of coefficients that there are, by their ``u`` (p,)."""
    return {
        name: {"wanted": wanted[name], "u": size, "met": size <= wanted[name]}
        for name, size in zip(names, u.tolist(), strict=True)
        if name in wanted
    }


def missed(
    goals: Mapping[str, ReachedGoal], units: Mapping[str, str], hints: Mapping[str, str] | None = None
) -> list[Finding]:
    """A finding for each goal that was not met; ``units`` SI unit by name."""
    texts = {}
    for name, goal in goals.items():
        if not goal["met"]:
            unit, size = shown_unit(units[name])
            texts[name] = (
                f"{name}: u = {goal['u'] / size:.2g} {unit}, wanted {goal['wanted'] / size:.2g} {unit}"
            )
    return _hinted("goal_missed", texts, hints)


def _hinted(code: str, texts: Mapping[str, str], hints: Mapping[str, str] | None) -> list[Finding]:
    """A finding for each coefficient, with the hint to it, if any; it harms nothing."""
    known = hints or {}
    return [
        Finding(code, f"{text}; {known[k]}" if k in known else text, harm=()) for k, text in texts.items()
    ]


def exact_gravity(site: Site, effect: str) -> list[Finding]:
    """A finding where gravity has no uncertainty; ``effect`` says what becomes of an error of it."""
    if site.inputs:
        return []
    action = 'State it with its uncertainty, such as gravity = "9.81(1) m/s^2", or state latitude and height.'
    headline = f"gravity is taken as exactly {site.gravity:.7g} m/s^2, and {effect}"
    return [Finding("stated_exact", headline, action=action)]


def exact_inputs(
    harmful: Mapping[str, str],
    what: str = "are taken as exact",
    cure: str = "State them with uncertainties.",
) -> list[Finding]:
    """A finding where inputs have no uncertainty: of each the error that is as large as one u of a coefficient."""
    if not harmful:
        return []
    items = [{"input": name, "error as large as one u": error} for name, error in harmful.items()]
    headline = f"{counted_names(list(harmful), 6)} {what}, and the errors listed shift a coefficient by its u"
    return [Finding("stated_exact", headline, action=cure, items=tuple(items))]


def ruled_by_site(
    names: Sequence[str], budget: Sequence[BudgetItem], sources: Collection[str], ratio: float
) -> list[Finding]:
    """A finding where u of some coefficients is more than ``ratio`` times what it were without the ``sources`` of the
    site."""
    site = [item for item in budget if item.source in sources]
    most = 1.0 - 1.0 / ratio**2  # of a variance
    ruled = [name for name in names if sum(item.share.get(name, 0.0) for item in site) > most]
    if not ruled:
        return []
    acting = [item.source for item in site if any(item.share.get(name) for name in ruled)]
    text = (
        f"u of {', '.join(ruled)} is mostly of what [site] states ({', '.join(acting)}): with an exact site it would "
        f"be less than {100.0 / ratio:.0f} % of that"
    )
    return [Finding("uncertain_site", text, "", ())]


def singular(judged: Learned, cure: str) -> tuple[Status, str] | None:
    """Status and sentence of a covariance that is singular but for rounding; None for a sound one."""
    left = judged.left
    if left[-1] ** 2 >= len(left) * np.finfo(float).eps * left[0] ** 2:
        return None
    return Status.ILL_CONDITIONED, (
        f"the covariance is numerically singular: {judged.weakest()[0]} is known too weakly beside the rest; {cure}"
    )
