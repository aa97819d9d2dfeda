"""Faults that nothing in a recording would show, with what they would cost: told, for u has them only as the prior has.

Under one sine a gyro's scale that is wrong looks as a motion that is larger by as much, with heights and positions that
fit it: the innovations stay small, and the angle is off. Whether that is so depends on the motion, so it is tried, on a
stretch of the recording.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.aoa.diagnosis.fit_quality import stretch
from inercal.aoa.fusion.filter_result import estimate
from inercal.aoa.fusion.problem import FilterProblem
from inercal.aoa.limits import LIMITS
from inercal.aoa.reading.recording import Recording
from inercal.findings import Finding
from inercal.geometry.rotations import principal


def unseen_scale(recording: Recording, problem: FilterProblem) -> list[Finding]:
    """``weak_test``: a gyro's scale off by `Limits.unseen_scale` would shift the angle by over twice u, unnoticed."""
    part = stretch(recording)
    if not np.isfinite(part.gyro).any():
        return []
    plain = estimate(part, problem)
    off = estimate(replace(part, gyro=(1.0 + LIMITS.unseen_scale) * part.gyro), problem)
    known = np.isfinite(plain.u) & np.isfinite(off.theta) & (part.t - part.t[:1] >= LIMITS.settling_time)
    if not known.any() or off.nis_mean > LIMITS.mean_nis:
        return []
    shift = float(np.sqrt(np.mean(np.square(principal(off.theta - plain.theta)[known]))))
    ratio = shift / float(np.median(plain.u[known]))
    if not ratio > LIMITS.unseen_sigmas:
        return []
    text = (
        f"nothing in this motion would show a gyro whose scale is off by {100.0 * LIMITS.unseen_scale:g} %, which "
        f"shifts the angle by {math.degrees(shift):.2g} deg, {ratio:.2g} times u: verify it, or state a wider "
        "gyro_scale under [prior]"
    )
    return [Finding("weak_test", text)]
