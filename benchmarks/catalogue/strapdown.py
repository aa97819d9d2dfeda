"""Faults of a unit turned by hand that records increments: those of `strapdown_faults.py`."""

from __future__ import annotations

from functools import cache, partial

import strapdown_faults

from .fault import Fault, Outcome, compared

BLIND = {"clock off by 50 ppm": "time is what the record says"}


def errors(seed, case) -> tuple:
    """An estimate, and its errors by name."""
    estimate, over_u = strapdown_faults.estimated(seed, *case)
    return estimate, {name: each * estimate[name].u for name, each in over_u.items()}


@cache
def without(seed: int):
    """The errors without a fault."""
    return errors(seed, strapdown_faults.CASES["none"])


def one(name: str, draw: int) -> Outcome:
    """A draw with the fault beside the same without."""
    estimate, off = errors(draw, strapdown_faults.CASES[name])
    sound, before = without(draw)
    return compared(estimate, sound, off, before)


def faults() -> dict[str, Fault]:
    """All, by name."""
    return {
        name: Fault(partial(one, name), "sample rate|time stamps|clock", BLIND.get(name, ""))
        for name in strapdown_faults.CASES
        if name != "none"
    }


def sound(draw: int) -> Outcome:
    """A recording without a fault."""
    estimate, off = errors(1000 + draw, strapdown_faults.CASES["none"])
    return compared(estimate, estimate, off, off)
