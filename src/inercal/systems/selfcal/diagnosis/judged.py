"""The judge of a platform: which question speaks, and what it shifts (`inercal.foundation.inference.judge`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.limits import LIMITS as OF_JUDGE
from inercal.foundation.inference.scores import ErrorScore, PassSums
from inercal.systems.selfcal.diagnosis.questions import PlatformQuestion
from inercal.systems.selfcal.limits import LIMITS

_CODES: Final = {
    "order": "by_order",
    "place": "by_place",
    "reading": "by_reading",
    "history": "by_history",
    "rig": "unmodelled",
}

_LOOK: Final = {
    "order": "Look for warm-up, a loose mount, or a supply that changed.",
    "place": "Look for an encoder error, a cable that pulls, or a field fixed to the base.",
    "reading": "Look for the end of a range, a dead band, or a term that the model lacks.",
    "history": "Look for hysteresis, backlash, or a filter within the sensor.",
    "rig": "Name them in states under [model], or state them there.",
}


class Answer(NamedTuple):
    """A question with its score."""

    question: PlatformQuestion
    score: ErrorScore


def answers(sums: PassSums, questions: Sequence[PlatformQuestion]) -> tuple[list[Answer], float]:
    """Questions that a sound recording would not answer so, the likeliest first; and the chance below which that is."""
    scored = [(question, sums.ask(question.columns)) for question in questions]
    shown = [Answer(question, score) for question, score in scored if score is not None]
    limit = LIMITS.question_risk / max(len(shown), 1)
    return sorted((a for a in shown if a.score.chance < limit), key=lambda a: a.score.chance), limit


def speaking(sums: PassSums, hits: Sequence[Answer], limit: float, names: Sequence[str]) -> Finding | None:
    """The finding of the question that speaks, of values of some names: of those as likely as the likeliest that one
    beside which least is still there, then the one of fewest parameters."""
    alike = _as_likely(hits)
    if not alike:
        return None

    def left(k: int) -> int:
        rest = (
            sums.ask(hit.question.columns, alike[k].question.columns) for j, hit in enumerate(alike) if j != k
        )
        return sum(score is not None and score.chance < limit for score in rest)

    counts = [left(k) for k in range(len(alike))]
    first = min(range(len(alike)), key=lambda k: (counts[k], alike[k].score.degrees, alike[k].score.chance))
    shift = alike[first].score.shift[: len(names)] / sums.u[: len(names)]
    worst = int(np.argmax(np.abs(shift)))
    size = abs(float(shift[worst]))
    least_words = "at least " if counts[first] else ""
    moves = f"which shifts {names[worst]} by {least_words}{size:.2g} u"
    if size < 0.1:
        moves = "which shifts no value by more than 0.1 u"
    others = [hit for k, hit in enumerate(alike) if k != first][:3]
    items = [_item("shown", alike[first]) | {"shift in u": float(shift[worst])}]
    items += [_item("as likely", hit) for hit in others]
    question = alike[first].question
    harm = tuple(name for name, by in zip(names, np.abs(shift), strict=True) if by > OF_JUDGE.harm)
    return Finding(
        _CODES[question.cell],
        f"{question.sentence}, {moves}.",
        harm=harm,
        action=_LOOK[question.cell],
        items=tuple(items),
    )


def explaining(
    sums: PassSums, z: Array, hits: Sequence[Answer], limit: float, names: Sequence[str]
) -> Finding | None:
    """The finding of a question that speaks and explains all: nothing else is still there beside it, innovations ``z``
    (n - 1, 6) are of the stated size without it, and not more alike from row to row than it makes them; None of any
    other, and where a question is as likely that a hypothesis answers with a value."""
    alike = _as_likely(hits)
    if not alike or any(hit.question.named for hit in alike):
        return None
    excess, spread = sums.chi2 - sums.dof, LIMITS.nis_sigmas * math.sqrt(2.0 * sums.dof)
    serial, scatter = float(np.nansum(z[1:] * z[:-1])), LIMITS.nis_sigmas * math.sqrt(sums.dof)
    for hit in alike:
        if max((excess - hit.score.explained) / spread, (serial - hit.score.explained) / scatter) > 1.0:
            continue
        rest = (sums.ask(other.question.columns, hit.question.columns) for other in hits if other is not hit)
        if all(score is None or score.chance >= limit for score in rest):
            return speaking(sums, hits, limit, names)
    return None


def _as_likely(hits: Sequence[Answer]) -> list[Answer]:
    """Hits about as likely as the first, at most so many as are compared."""
    if not hits:
        return []
    least = OF_JUDGE.as_likely * math.log(max(hits[0].score.chance, 1e-300))
    return [hit for hit in hits if math.log(max(hit.score.chance, 1e-300)) <= least][: OF_JUDGE.compared]


def _item(kind: str, answer: Answer) -> dict[str, str | float]:
    """A row of the finding's table."""
    question, score = answer
    return {"kind": kind, "by": question.cell, "what": question.sentence, "by chance": score.chance}
