"""Stretches that a trigger channel marks: a level that holds over a point, or a pulse or count at which one begins."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.aoa.settings import PointPlan


def triggered(t: Array, trigger: Array, plan: PointPlan) -> list[tuple[float, int, int]]:
    """Stretches of a trigger (n,) at times ``t`` (n,) [s]: the number, the first row and the one after the last.

    0 and no number mean no trigger. A stretch begins where another value begins, ``plan.delay`` later, and ends with
    the value, or ``plan.length`` after. Its number is the value, or counted from 1 where all values are the same.
    """
    value = np.where(np.isfinite(trigger), trigger, 0.0)
    changed = np.flatnonzero(np.diff(value, prepend=0.0) != 0.0)
    begins = changed[value[changed] != 0.0]
    alike = len(np.unique(value[begins])) == 1
    found = []
    for count, begin in enumerate(begins.tolist(), start=1):
        after = changed[changed > begin]
        start = t[begin] + plan.delay
        if plan.length is None:
            b = int(after[0]) if len(after) else len(t)
            a = begin + int(np.searchsorted(t[begin:b], start))
        else:
            a, b = (int(np.searchsorted(t, at)) for at in (start, start + plan.length))
        if b > a:
            found.append((float(count) if alike else float(value[begin]), a, b))
    return found
