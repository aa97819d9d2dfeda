"""The verdict on an estimate: a code that programs test, and a meaning that people read.

What to do about a bad one is in the message of the estimate, which knows the case.
"""

from __future__ import annotations

import enum


class Status(enum.Enum):
    """How an estimate ended. The value is the code of the JSON result; codes are a contract."""

    OK = "ok"
    ILL_CONDITIONED = "ill_conditioned"
    NOT_CONVERGED = "not_converged"
    INCONSISTENT = "inconsistent"
    UNOBSERVABLE = "unobservable"
    TOO_FEW_INTERVALS = "too_few_intervals"

    @property
    def meaning(self) -> str:
        """One sentence: what this verdict says."""
        return _MEANING[self]


_MEANING = {
    Status.OK: "the estimate is sound",
    Status.ILL_CONDITIONED: "the data fix some combination of the parameters only weakly",
    Status.NOT_CONVERGED: "the iteration ended before it reached a minimum",
    Status.INCONSISTENT: "the data contradict the model or the stated noise",
    Status.UNOBSERVABLE: "the data say nothing about some combination of the parameters",
    Status.TOO_FEW_INTERVALS: "too few static intervals were found to fit the model",
}
