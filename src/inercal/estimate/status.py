"""The verdict on an estimate: a code that programs test, a meaning and advice that people read."""

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

    @property
    def advice(self) -> str:
        """One sentence: what to do about it."""
        return _ADVICE[self]


_MEANING = {
    Status.OK: "the estimate is sound",
    Status.ILL_CONDITIONED: "the data fix some combination of the parameters only weakly",
    Status.NOT_CONVERGED: "the iteration ended before it reached a minimum",
    Status.INCONSISTENT: "the data contradict the model or the stated noise",
    Status.UNOBSERVABLE: "the data say nothing about some combination of the parameters",
    Status.TOO_FEW_INTERVALS: "too few static intervals were found to fit the model",
}

_ADVICE = {
    Status.OK: "use the values with their uncertainties",
    Status.ILL_CONDITIONED: "add the poses or motions named in the message, or use only the other parameters",
    Status.NOT_CONVERGED: "check units, signs and the order of the channels with `inercal inspect`",
    Status.INCONSISTENT: "check units, signs, channels and noise settings; look at the residuals",
    Status.UNOBSERVABLE: "change the plan so that the named combination is excited, or leave the term out",
    Status.TOO_FEW_INTERVALS: "hold the instrument still for longer, in more poses, and record again",
}
