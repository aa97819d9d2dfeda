"""One judge of a least-squares fit that knows no fault by name.

Questions share one risk (Bonferroni). Of those that a sound fit would not answer so, those about as likely as the
likeliest compete; that beside which least is left speaks, and at most three others are named. It does harm where it
shifts a value by more than 2 u.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.evidence import AskedError, FitEvidence, evidence
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.inference.questions import JudgedFit, Question, questions
from inercal.foundation.inference.signals import copies, ends, steps, uneven

_CODES = {"order": "by_order", "place": "by_place", "reading": "by_reading", "history": "by_history"}

_LOOK = {
    "order": "Look for warm-up, a loose mount, or a changed set-up.",
    "place": "Look for an encoder error, a mounting off its axis, or a field fixed to the ground.",
    "reading": "Look for the end of the range, a switched range, or a term that the model lacks.",
    "history": "Look for hysteresis, too short a wait, or rows that were joined late by one.",
}


def evidence_of(fit: JudgedFit) -> FitEvidence:
    """The evidence of a fit; raises LinAlgError where its covariance is not positive definite."""
    columns = np.hstack([fit.by_value, fit.beside])
    return evidence(fit.residuals, fit.covariance, columns, fit.gain, fit.noise_dof)


def judge(fit: JudgedFit, share: float = 1.0, more: Sequence[Question] = ()) -> tuple[Finding, ...]:
    """Findings about a fit: order of the rows, ends and steps of the outputs, and what the questions show, those of its
    own physics (``more``) among them; ``share`` of the risk, where a result has several fits."""
    if len(fit.residuals) > LIMITS.most_readings:
        return ()
    try:
        of_fit = evidence_of(fit)
    except np.linalg.LinAlgError:
        return ()
    left, size = np.linalg.norm(fit.residuals), np.linalg.norm(fit.readings)
    if of_fit.dof < LIMITS.fewest_degrees or left <= LIMITS.rounding * size:
        return ()
    order = tuple(_order(fit, of_fit, share * LIMITS.order_risk))
    if order:  # rows at other inputs: all questions would answer
        return order
    pairs = asked_of(of_fit, [*more, *questions(fit)])
    spoken = answers(fit.names, fit.u, of_fit, pairs, share)
    return (*ends(fit), *steps(fit), *copies(fit), *uneven(fit, of_fit, share), *spoken)


Asked = Sequence[tuple[Question, AskedError]]


def answers(
    names: Sequence[str], u: Array, of_fit: FitEvidence, pairs: Asked, share: float = 1.0
) -> Iterator[Finding]:
    """The finding of the question that speaks, if any does.

    Parameters
    ----------
    names, u : (p,)
        Values and their standard uncertainties.
    of_fit, pairs : FitEvidence, list
        What was asked, by `asked_of`.
    share : float
        Of the risk, where a result has several fits.
    """
    risk = share * LIMITS.question_risk
    if not pairs:
        return
    chances = np.array([of_fit.chance(asked) for _, asked in pairs])
    hits = np.flatnonzero(chances < risk / len(pairs))
    if not len(hits):
        return
    ranks = chances
    if chances[hits].min() < 1e-12:  # beyond doubt: by the residuals
        ranks = np.array([of_fit.chance(asked, by_residuals=True) for _, asked in pairs])
    logs = np.log(np.maximum(ranks, 1e-300))
    hits = hits[np.argsort(logs[hits], kind="stable")]
    alike = [int(k) for k in hits if logs[k] <= LIMITS.as_likely * logs[hits[0]]]

    def left(k: int) -> tuple[int, bool, int, float]:
        beside = of_fit.without(pairs[k][1])
        rest = [beside.ask(pairs[j][0].columns) for j in alike[: LIMITS.compared] if j != k]
        still = sum(beside.chance(asked) < risk / len(pairs) for asked in rest if _enough(beside, asked))
        return still, not pairs[k][0].code, pairs[k][1].count, float(logs[k])

    first = min(alike[: LIMITS.compared], key=left)
    yield _finding(
        names, u, of_fit, pairs, chances, first, [k for k in alike if k != first][:3], left(first)[0] > 0
    )


def _enough(of_fit: FitEvidence, asked: AskedError) -> bool:
    """True if a question shows, and leaves as many degrees of freedom as it takes."""
    return 0 < asked.count <= max(1, (of_fit.dof - 2) // 2)


def asked_of(of_fit: FitEvidence, table: Sequence[Question]) -> list[tuple[Question, AskedError]]:
    """Questions that show, those of one span once."""
    made, seen = [], set()
    probe = np.sin(1.0 + np.arange(len(of_fit.z)))
    every = of_fit.ask_all([question.columns for question in table])
    for question, asked in zip(table, every, strict=True):
        if not _enough(of_fit, asked):
            continue
        span = (asked.count, round(float(np.sum(np.square(asked.basis.T @ probe))), 9))
        if span not in seen:
            seen.add(span)
            made.append((question, asked))
    return made


def _finding(
    names: Sequence[str],
    u: Array,
    of_fit: FitEvidence,
    pairs: Asked,
    chances: Array,
    first: int,
    others: Sequence[int],
    more: bool,
) -> Finding:
    """The finding of the question that speaks; ``more`` where something is left beside it."""
    question, asked = pairs[first]
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.nan_to_num(of_fit.shift(asked) / u)
    worst = int(np.argmax(np.abs(shift)))
    least = "at least " if more else ""
    moves = (
        f"which shifts {names[worst]} by {least}{abs(shift[worst]):.2g} u"
        if abs(shift[worst]) > 0.1
        else "which shifts no value by more than 0.1 u"
    )
    harm = tuple(name for name, by in zip(names, np.abs(shift), strict=True) if by > LIMITS.harm)
    items = [_item("shown", question, chances[first]) | {"shift in u": float(shift[worst])}]
    items += [_item("as likely", pairs[k][0], chances[k]) for k in others]
    headline = f"{question.sentence}, {moves}."
    code, action = question.code or _CODES[question.cell], question.action or _LOOK[question.cell]
    return Finding(code, headline, "", harm, action=action, items=tuple(items))


def unseen(u: Array, of_fit: FitEvidence, pairs: Asked) -> Array:
    """Shifts (q, p) of the values, over u, by each question at the size at which it is significant: what a test cannot
    exclude. Parameters as in `answers`."""
    from scipy.special import chdtri, fdtri

    made = np.zeros((len(pairs), len(u)))
    stated = math.isinf(of_fit.noise_dof)
    with np.errstate(divide="ignore", invalid="ignore"):
        for row, (_, asked) in zip(made, pairs, strict=True):
            m, risk = asked.count, LIMITS.question_risk / len(pairs)
            free = max(of_fit.dof - m, 1.0) + (0.0 if stated else of_fit.noise_dof)
            size = chdtri(m, risk) if stated else m * fdtri(m, free, 1.0 - risk)
            row[:] = np.nan_to_num(np.linalg.norm(asked.reach, axis=1) / u) * math.sqrt(float(size))
    return made


def blind_shares(fit: JudgedFit) -> dict[str, float]:
    """Share of the questions by order, place, reading and history that would shift a value by more than 2 u before they
    are answered; empty where none can be asked."""
    try:
        of_fit = evidence_of(fit)
    except np.linalg.LinAlgError:
        return {}
    pairs = asked_of(of_fit, questions(fit)) if of_fit.dof > 0 else []
    hides = unseen(fit.u, of_fit, pairs).max(axis=1, initial=0.0) > LIMITS.harm
    cells = np.array([question.cell for question, _ in pairs])
    return {cell: float(hides[cells == cell].mean()) for cell in _CODES if (cells == cell).any()}


def blind(names: Sequence[str], u: Array, of_fit: FitEvidence, pairs: Asked) -> Iterator[Finding]:
    """The finding about questions that would shift a value by more than 2 u before they are answered; parameters as in
    `answers`."""
    shifts = unseen(u, of_fit, pairs)
    most = shifts.max(axis=1, initial=0.0)
    worst = [int(k) for k in np.argsort(-most) if most[k] > LIMITS.harm]
    if not worst:
        return
    items: list[dict[str, str | float]] = [
        {
            "unseen": pairs[k][0].sentence,
            "shifts": names[int(np.argmax(shifts[k]))],
            "by up to, in u": float(most[k]),
        }
        for k in worst[:5]
    ]
    counts = {cell: sum(pairs[k][0].cell == cell for k in worst) for cell in _CODES}
    items += [{"unseen": f"by {cell}", "faults": float(count)} for cell, count in counts.items() if count]
    yield Finding(
        "blind",
        f"This plan cannot exclude {len(worst)} of {len(pairs)} faults that would shift a value by 2 u.",
        action="Repeat a part at the end, in another order, and at other rates and angles.",
        items=tuple(items),
    )


def _item(kind: str, question: Question, chance: float) -> dict[str, str | float]:
    """A row of the finding's table."""
    return {"kind": kind, "by": question.cell, "what": question.sentence, "by chance": float(chance)}


def _order(fit: JudgedFit, of_fit: FitEvidence, risk: float) -> Iterator[Finding]:
    """Rows late or early by one: all, one channel's, or all from a row on.

    Two models without parameters, compared without the row that has no reading in the other order: their likelihood
    ratio exceeds 1/r by chance with a probability of r at most (Markov).
    """
    rows = int(fit.row.max()) + 1
    if fit.channel.min() < 0:
        return
    if len(np.unique(fit.row * len(fit.channels) + fit.channel)) < rows * len(fit.channels) or rows < 4:
        return
    at = np.zeros((rows, len(fit.channels)), dtype=np.int64)
    at[fit.row, fit.channel] = np.arange(len(fit.row))
    starts: list[int] = []
    if rows > 5:
        starts = sorted({int(k) for k in np.linspace(2, rows - 3, LIMITS.most_steps)})
    tries: list[tuple[str, Array, NDArray[np.int64]]] = []
    for word, by in (("late", 1), ("early", -1)):
        tries.append(_moved(fit, at, f"All rows are {word} by one", 0, by, None))
        tries += [
            _moved(fit, at, f"All rows from {k + 1} on are {word} by one", int(k), by, None) for k in starts
        ]
        if len(fit.channels) > 1:
            tries += [
                _moved(fit, at, f"The rows of {name} are {word} by one", 0, by, k)
                for k, name in enumerate(fit.channels)
            ]
    whitening = of_fit.beside(np.eye(len(fit.row)))
    precision = whitening.T @ whitening
    before = whitening.T @ of_fit.z
    best, words, times = 0.0, "", 1.0
    for text, change, lost in tries:
        z = of_fit.z + whitening @ change
        sums = [
            total
            - float(score[lost] @ np.linalg.lstsq(precision[np.ix_(lost, lost)], score[lost], rcond=None)[0])
            for total, score in ((of_fit.squares, before), (float(z @ z), whitening.T @ z))
        ]
        dof = of_fit.dof - len(lost)
        if dof < 1 or sums[0] <= 0.0:
            continue
        ratio = sums[0] / max(sums[1], 1e-12 * sums[0])
        gain = 0.5 * dof * math.log(ratio)
        if math.isinf(of_fit.noise_dof):
            gain = min(gain, 0.5 * (sums[0] - sums[1]))
        if gain > best:
            best, words, times = gain, text, math.sqrt(ratio)
    if math.log(len(tries)) - best < math.log(risk):
        yield Finding(
            "row_order",
            f"{words}: in the other order the residuals are {times:.3g} times smaller.",
            "",
            EVERYTHING,
            action="Check how rows and inputs were joined, and move the readings by one row.",
        )


def _moved(
    fit: JudgedFit, at: NDArray[np.int64], words: str, start: int, by: int, only: int | None
) -> tuple[str, Array, NDArray[np.int64]]:
    """Another order in words, the change (n,) of the readings, and the readings that have none in it."""
    rows = len(at)
    index = np.arange(rows)
    moved = np.where(index >= start, index + by, index)
    lost = rows - 1 if by > 0 else start
    moved[lost] = lost
    taken = [only] if only is not None else list(range(at.shape[1]))
    change = np.zeros(len(fit.row))
    for channel in taken:
        change[at[:, channel]] = fit.readings[at[moved, channel]] - fit.readings[at[:, channel]]
    return words, change, at[lost, taken]


def gross(fit: JudgedFit) -> float:
    """Residuals over what stated noise and errors explain, where they make the fit useless; 0 where they do not."""
    if not math.isinf(fit.noise_dof) or len(fit.residuals) > LIMITS.most_readings:
        return 0.0
    try:
        of_fit = evidence_of(fit)
    except np.linalg.LinAlgError:
        return 0.0
    times = math.sqrt(of_fit.squares / of_fit.dof) if of_fit.dof > 0 else 0.0
    return times if times > LIMITS.gross else 0.0
