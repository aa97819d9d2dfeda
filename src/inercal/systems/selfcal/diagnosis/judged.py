"""The judge of a platform: which question speaks, and what it shifts (`inercal.foundation.inference.asked_pass`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference import asked_pass
from inercal.foundation.inference.asked_pass import PassAnswer, as_likely
from inercal.foundation.inference.scores import PassSums
from inercal.systems.selfcal.limits import LIMITS

_LOOK: Final = {
    "order": "Look for warm-up, a loose mount, or a supply that changed.",
    "place": "Look for an encoder error, a cable that pulls, or a field fixed to the base.",
    "reading": "Look for the end of a range, a dead band, or a term that the model lacks.",
    "history": "Look for hysteresis, backlash, or a filter within the sensor.",
    "rig": "Name them in states under [model], or state them there.",
}


def speaking(
    sums: PassSums, hits: Sequence[PassAnswer], limit: float, names: Sequence[str]
) -> Finding | None:
    """The finding of the question that speaks, of values of some names."""
    count = len(names)

    def shifts(answer: PassAnswer) -> Array:
        return np.asarray(answer.score.shift[:count] / sums.u[:count])

    return asked_pass.speaking(sums, hits, limit, names, shifts, _LOOK)


def explaining(
    sums: PassSums, z: Array, hits: Sequence[PassAnswer], limit: float, names: Sequence[str]
) -> Finding | None:
    """The finding of a question that speaks and explains all: nothing else is still there beside it, innovations ``z``
    (n - 1, 6) are of the stated size without it, and not more alike from row to row than it makes them; None of any
    other, and where a question is as likely that a hypothesis answers with a value."""
    alike = as_likely(hits)
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
