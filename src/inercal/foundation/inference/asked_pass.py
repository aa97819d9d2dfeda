"""The judge of a filter: which question about a pass speaks, what it shifts, and what the plan cannot exclude.

What `inercal.foundation.inference.judge` is for a direct fit, by the sums of a pass
(`inercal.foundation.inference.scores`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.inference.scores import ErrorColumns, ErrorScore, PassSums

CODES: Final = {
    "order": "by_order",
    "place": "by_place",
    "reading": "by_reading",
    "history": "by_history",
    "rig": "unmodelled",
}
"""Cell of a question -> code of its finding."""

Sized = Callable[[float], tuple[str, str, str]]
"""Code, sentence, without a full stop, and action of an error of one size."""


class PassQuestion(NamedTuple):
    """A question: the ``cell`` order, place, reading or history, or ``rig``; its ``sentence`` without a full stop; and
    the ``columns`` of the pass; ``sized``: the words that are better once its size is known."""

    cell: str
    sentence: str
    columns: ErrorColumns
    sized: Sized | None = None


class PassAnswer(NamedTuple):
    """A question with its score."""

    question: PassQuestion
    score: ErrorScore


Shifts = Callable[[PassAnswer], Array]
"""Shift (v,) of each value by the error of an answer, in u."""


def asked(sums: PassSums, questions: Sequence[PassQuestion]) -> list[PassAnswer]:
    """Questions that show."""
    scored = [(question, sums.ask(question.columns)) for question in questions]
    return [PassAnswer(question, score) for question, score in scored if score is not None]


def answers(sums: PassSums, questions: Sequence[PassQuestion]) -> tuple[list[PassAnswer], float]:
    """Questions that a sound recording would not answer so, the likeliest first; and the chance below which that is."""
    shown = asked(sums, questions)
    limit = LIMITS.filter_risk / max(len(shown), 1)
    return sorted((a for a in shown if a.score.chance < limit), key=lambda a: a.score.chance), limit


def as_likely(hits: Sequence[PassAnswer]) -> list[PassAnswer]:
    """Hits about as likely as the first, at most so many as are compared."""
    if not hits:
        return []
    least = LIMITS.as_likely * math.log(max(hits[0].score.chance, 1e-300))
    return [hit for hit in hits if math.log(max(hit.score.chance, 1e-300)) <= least][: LIMITS.compared]


class Speaker(NamedTuple):
    """The answer that speaks, ``others`` that are as likely, and how many of these are ``left`` beside it."""

    answer: PassAnswer
    others: list[PassAnswer]
    left: int


def speaker(sums: PassSums, hits: Sequence[PassAnswer], limit: float) -> Speaker | None:
    """Of hits as likely as the likeliest that one beside which least is still there, then one that has a size and a
    remedy, then the one of fewest parameters; None without hits."""
    alike = as_likely(hits)
    if not alike:
        return None

    def left(k: int) -> int:
        rest = (
            sums.ask(hit.question.columns, alike[k].question.columns) for j, hit in enumerate(alike) if j != k
        )
        return sum(score is not None and score.chance < limit for score in rest)

    counts = [left(k) for k in range(len(alike))]

    def place(k: int) -> tuple[int, bool, int, float]:
        question, score = alike[k]
        return counts[k], question.sized is None, score.degrees, score.chance

    first = min(range(len(alike)), key=place)
    others = [hit for k, hit in enumerate(alike) if k != first]
    others.sort(key=lambda hit: hit.question.sized is None)
    return Speaker(alike[first], others, counts[first])


def speaking(
    sums: PassSums,
    hits: Sequence[PassAnswer],
    limit: float,
    names: Sequence[str],
    shifts: Shifts,
    look: Mapping[str, str],
) -> Finding | None:
    """The finding of the question that speaks, of values of some names; ``look`` says by cell where to look."""
    first = speaker(sums, hits, limit)
    if first is None:
        return None
    question, score = first.answer
    moved = moved_by(shifts(first.answer), names, at_least=bool(first.left))
    items = [row_of("shown", question.cell, question.sentence, score) | {"shift in u": moved.worst}]
    items += [row_of("as likely", *other.question[:2], other.score) for other in first.others[:3]]
    code, sentence, action = CODES[question.cell], question.sentence, look[question.cell]
    if question.sized is not None and len(score.b) == 1:
        code, sentence, action = question.sized(float(score.b[0]))
    return Finding(code, f"{sentence}, {moved.words}.", harm=moved.harm, action=action, items=tuple(items))


class MovedValues(NamedTuple):
    """Shift of values by an error: the largest in ``words``, itself, ``worst`` [u], and the values that it harms."""

    words: str
    worst: float
    harm: tuple[str, ...]


def moved_by(shift: Array, names: Sequence[str], at_least: bool) -> MovedValues:
    """Shifts (v,) [u] of values by name; ``at_least`` where more is left than the error explains."""
    k = int(np.argmax(np.abs(shift)))
    size = abs(float(shift[k]))
    words = f"which shifts {names[k]} by {'at least ' if at_least else ''}{size:.2g} u"
    if size < 0.1:
        words = "which shifts no value by more than 0.1 u"
    harm = tuple(name for name, by in zip(names, np.abs(shift), strict=True) if by > LIMITS.harm)
    return MovedValues(words, float(shift[k]), harm)


def blind_of(
    shown: Sequence[PassAnswer], names: Sequence[str], reach: Callable[[ErrorColumns], Array]
) -> Iterator[Finding]:
    """The finding about questions that would shift a value by more than 2 u before they are answered; ``reach`` gives
    the shift (v, k), in u, by one unit of each column."""
    from scipy.special import chdtri

    unseen: list[tuple[float, str, PassQuestion]] = []
    for question, score in shown:
        size = math.sqrt(float(chdtri(score.degrees, LIMITS.filter_risk / len(shown))))
        shifts = np.linalg.norm(reach(question.columns) @ score.ways, axis=1) * size
        k = int(np.argmax(shifts))
        if shifts[k] > LIMITS.harm:
            unseen.append((float(shifts[k]), names[k], question))
    if not unseen:
        return
    unseen.sort(key=lambda one: -one[0])
    items: list[dict[str, str | float]] = [
        {"unseen": question.sentence, "shifts": name, "by up to, in u": shift}
        for shift, name, question in unseen[:5]
    ]
    for cell in CODES:
        asked_of = sum(question.cell == cell for question, _ in shown)
        if count := sum(question.cell == cell for *_, question in unseen):
            items.append({"unseen": f"by {cell}", "faults": float(count), "of": float(asked_of)})
    yield Finding(
        "blind",
        f"This plan cannot exclude {len(unseen)} of {len(shown)} faults that would shift a value by 2 u.",
        action="Repeat parts at the end and in another order, and move through other angles and at other rates.",
        items=tuple(items),
    )


def row_of(kind: str, cell: str, sentence: str, score: ErrorScore) -> dict[str, str | float]:
    """A row of a finding's table: a question, and the chance that a sound record answers it so."""
    return {"kind": kind, "by": cell, "what": sentence, "by chance": score.chance}
