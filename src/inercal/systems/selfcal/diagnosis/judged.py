"""The judge of a platform: which question speaks, and what it shifts (`inercal.foundation.inference.judge`).

A cause that is named goes into the fit, and what is left is asked again; what no cause explains is said as it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.asked_pass import CODES, moved_by, row_of
from inercal.foundation.inference.limits import LIMITS as OF_JUDGE
from inercal.foundation.inference.scores import ErrorScore, PassSums
from inercal.systems.selfcal.diagnosis.catalogue import NamedCause
from inercal.systems.selfcal.diagnosis.questions import PlatformQuestion
from inercal.systems.selfcal.limits import LIMITS

_LOOK: Final = {
    "order": "Look for warm-up, a loose mount or a changed supply; where biases wander name bias_walk under [model].",
    "place": "Look for an encoder error, a cable that pulls, or a field fixed to the base.",
    "reading": "Look for the end of a range, a dead band, or a term that the model lacks.",
    "history": "Look for hysteresis, backlash, or a filter within the sensor.",
    "rig": "Name them in states under [model], or state them there.",
}


class Answer(NamedTuple):
    """A question with its score."""

    question: PlatformQuestion
    score: ErrorScore


class Spoken(NamedTuple):
    """All that was said: ``findings``, true of each that a cause ``named``, the ``sums`` with all of it as constants,
    and True where questions are ``left``."""

    findings: tuple[Finding, ...]
    named: tuple[bool, ...]
    sums: PassSums
    left: bool


def answers(sums: PassSums, questions: Sequence[PlatformQuestion]) -> tuple[list[Answer], float]:
    """Questions that a sound recording would not answer so, the likeliest first; and the chance below which that is."""
    scored = [(question, sums.ask(question.columns)) for question in questions]
    shown = [Answer(question, score) for question, score in scored if score is not None]
    limit = OF_JUDGE.filter_risk / max(len(shown), 1)
    hits = (hit for hit in shown if hit.score.chance < limit and _believed(hit))
    return sorted(hits, key=lambda hit: (hit.score.chance, -hit.score.explained)), limit


def _believed(answer: Answer) -> bool:
    """True where the sizes of an error are what they can be."""
    return bool(np.abs(answer.score.b).max() <= answer.question.most)


def spoken(sums: PassSums, questions: Sequence[PlatformQuestion], names: Sequence[str]) -> Spoken:
    """All that questions show about values of some names, one after the other; what no cause explains is the last."""
    findings, named, said = list[Finding](), list[bool](), set[str]()
    for _ in range(LIMITS.small_errors):
        asked = [question for question in questions if question.sentence not in said]
        hits, limit = answers(sums, asked)
        if not hits:
            return Spoken(tuple(findings), tuple(named), sums, False)
        answer, finding = _speaking(sums, hits, limit, names)
        findings.append(finding)
        named.append(answer.question.naming is not None)
        if answer.question.naming is None:
            rest = (
                sums.ask(hit.question.columns, answer.question.columns) for hit in hits if hit is not answer
            )
            left = any(score is not None and score.chance < limit for score in rest)
            wide = LIMITS.free_prior * (np.abs(answer.score.b) + answer.score.u)
            return Spoken(
                tuple(findings), tuple(named), sums.with_stated(answer.question.columns, wide), left
            )
        said.add(answer.question.sentence)
        sums = sums.with_stated(
            answer.question.columns, LIMITS.free_prior * (np.abs(answer.score.b) + answer.score.u)
        )
    return Spoken(tuple(findings), tuple(named), sums, True)


def _speaking(
    sums: PassSums, hits: Sequence[Answer], limit: float, names: Sequence[str]
) -> tuple[Answer, Finding]:
    """The question that speaks with its finding: of those as likely as the likeliest one beside which nothing is left,
    then one whose cause has a name (but biases that wander, as any may seem to), then that beside which least is left,
    then the one of fewest parameters."""
    alike = _as_likely(hits)

    def left(k: int) -> int:
        rest = (
            sums.ask(hit.question.columns, alike[k].question.columns) for j, hit in enumerate(alike) if j != k
        )
        least = LIMITS.second_order * alike[k].score.explained
        return sum(s is not None and s.chance < limit and s.explained > least for s in rest)

    counts = [left(k) for k in range(len(alike))]
    first = min(
        range(len(alike)),
        key=lambda k: (
            counts[k] > 0,
            alike[k].question.naming is None or alike[k].question.cell == "order",
            counts[k],
            alike[k].score.degrees,
            -alike[k].score.explained,
        ),
    )
    answer = alike[first]
    shift = answer.score.shift[: len(names)] / sums.u[: len(names)]
    moved = moved_by(shift, names, at_least=bool(counts[first]))
    question = answer.question
    cause = NamedCause(CODES[question.cell], question.sentence, _LOOK[question.cell])
    if question.naming is not None:
        cause = question.naming(answer.score.b, answer.score.u)
    others = [hit for k, hit in enumerate(alike) if k != first][:3]
    shown = row_of("shown", question.cell, question.sentence, answer.score) | {"shift in u": moved.worst}
    items = [*cause.items, shown]
    items += [row_of("as likely", *hit.question[:2], hit.score) for hit in others]
    headline = f"{cause.sentence}, {moved.words}."
    return answer, Finding(cause.code, headline, harm=moved.harm, action=cause.action, items=tuple(items))


def settled(before: PassSums, said: Spoken, z: Array) -> bool:
    """True where nothing is left beside what was said: no question, and innovations ``z`` (n - 1, 6) of the stated size
    without it, not more alike from row to row than it makes them."""
    explained, dof = before.chi2 - said.sums.chi2, before.dof
    excess = (said.sums.chi2 - dof) / math.sqrt(2.0 * dof)
    serial = (float(np.nansum(z[1:] * z[:-1])) - explained) / math.sqrt(dof)
    return not said.left and max(excess, serial) <= LIMITS.nis_sigmas


def most_explained(before: PassSums, said: Spoken) -> bool:
    """True where what was said explains most of that by which innovations are too large."""
    excess, left = (sums.chi2 - sums.dof for sums in (before, said.sums))
    return excess > 0.0 and left < LIMITS.explained_ratio * excess


def _as_likely(hits: Sequence[Answer]) -> list[Answer]:
    """Hits about as likely as the first, at most so many as are compared."""
    least = OF_JUDGE.as_likely * math.log(max(hits[0].score.chance, 1e-300))
    alike = [hit for hit in hits if math.log(max(hit.score.chance, 1e-300)) <= least]
    if hits[0].score.chance < 1e-300:  # beyond all doubt: by what they explain
        alike = [hit for hit in alike if hit.score.explained >= OF_JUDGE.as_likely * hits[0].score.explained]
    return alike[: OF_JUDGE.compared]
