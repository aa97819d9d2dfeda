"""Faults that nothing in a recording would show, with what they would cost: told, for u has them only as the prior has.

Under one sine a gyro's scale that is wrong looks as a motion that is larger by as much, with heights and positions that
fit it: the innovations stay small, and the angle is off. Whether that is so depends on the motion, so it is tried, on a
stretch of the recording.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.aoa.diagnosis.effect import effect
from inercal.aoa.diagnosis.fit_quality import stretch
from inercal.aoa.fusion.filter_result import estimate
from inercal.aoa.fusion.problem import FilterProblem
from inercal.aoa.limits import LIMITS
from inercal.aoa.reading.recording import Recording
from inercal.findings import Finding


def unseen_scale(recording: Recording, problem: FilterProblem) -> list[Finding]:
    """``weak_test``: a gyro's scale off by `Limits.unseen_scale` would shift the angle by over twice u, unnoticed."""
    part = stretch(recording)
    if not np.isfinite(part.gyro).any():
        return []
    plain = estimate(part, problem)
    off = estimate(replace(part, gyro=(1.0 + LIMITS.unseen_scale) * part.gyro), problem)
    found = effect(plain, off, part.t)
    if found is None or found.nis > LIMITS.mean_nis or not found.ratio > LIMITS.unseen_sigmas:
        return []
    text = (
        f"nothing in this motion would show a gyro whose scale is off by {100.0 * LIMITS.unseen_scale:g} %, which "
        f"shifts the angle by {math.degrees(found.shift):.2g} deg, {found.ratio:.2g} times u: verify it, or state a "
        "wider gyro_scale under [prior]"
    )
    return [Finding("weak_test", text)]
