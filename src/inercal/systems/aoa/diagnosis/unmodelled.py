"""Faults that nothing in a recording would show, with what they would cost: told, for u has them only as the prior has.

Under one sine a gyro's scale that is wrong looks as a motion that is larger by as much, with heights and positions that
fit it; a bias that drifts looks as an angle that does. The innovations stay small, and the angle is off. Whether that
is so depends on the motion, so it is tried, on a stretch of the recording.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.findings import Finding
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.diagnosis.effect import AngleEffect, effect
from inercal.systems.aoa.diagnosis.fit_quality import fit_quality, judged, stretch
from inercal.systems.aoa.diagnosis.gyro_scale import GyroScale, alone, of_prior
from inercal.systems.aoa.diagnosis.small import with_axis
from inercal.systems.aoa.fusion.filter_result import FusionResult, estimate
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.problem import problem as posed
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


def unmodelled(
    recording: Recording, problem: FusionProblem, settings: AoaSettings, named: bool = False
) -> list[Finding]:
    """``prior_suspect`` where the gyro's scale contradicts its prior, or what explains that better, unless other errors
    than noise are ``named`` already; else ``weak_test``: what would shift the angle by over twice u, unnoticed.

    That is a gyro's scale that is off by `Limits.unseen_scale`, or as far as the recording does not contradict it, a
    bias that drifts by `Limits.unseen_drift` where no random walk is stated, an axis turned by `Limits.unseen_axis`.
    """
    part = stretch(recording)
    own = alone(part, problem)
    if not named and (wrong := of_prior(part, problem, settings, own)):
        return wrong
    plain = estimate(part, problem)
    found = [*_scale(part, problem, plain, own), *_drift(part, problem, plain)]
    return found if named else [*found, *_axis(recording, settings)]


def _told(part: Recording, off: Recording, problem: FusionProblem, plain: FusionResult) -> AngleEffect | None:
    """The effect of a fault in a stretch; None where it is small, or noticed."""
    found = effect(plain, estimate(off, problem), part.t)
    if found is None or found.nis > LIMITS.mean_nis or not found.ratio > LIMITS.unseen_sigmas:
        return None
    return found


def _scale(
    part: Recording, problem: FusionProblem, plain: FusionResult, own: GyroScale | None
) -> list[Finding]:
    """The gyro's scale."""
    if not np.isfinite(part.gyro).any():
        return []
    hidden = math.inf if own is None else LIMITS.prior_sigmas * own.apart
    size = min(LIMITS.unseen_scale, hidden)
    off = replace(part, gyro=(1.0 + size) * part.gyro)
    if (found := _told(part, off, problem, plain)) is None:
        return []
    what = f"a gyro whose scale is off by {100.0 * size:.2g} %"
    return [_weak(what, found.shift, found, "Verify it, or state a wider gyro_scale under [prior].")]


def _drift(part: Recording, problem: FusionProblem, plain: FusionResult) -> list[Finding]:
    """The bias of the accelerometer whose drift shifts the angle most."""
    if problem.constants.accelerometer_walk > 0.0 or len(part.t) < 2:
        return []
    course = LIMITS.unseen_drift * (part.t - part.t[0]) / (part.t[-1] - part.t[0])
    worst: tuple[float, str, AngleEffect] | None = None
    for k, name in enumerate(problem.layout.names):
        acc = part.acc.copy()
        acc[:, k] += course
        found = _told(part, replace(part, acc=acc), problem, plain)
        if found is not None and (worst is None or found.shift > worst[0]):
            worst = found.shift, name, found
    if worst is None:
        return []
    shift, name, found = worst
    drift = 1e3 * LIMITS.unseen_drift / STANDARD_GRAVITY
    what = f"a bias of {name} that drifts by {drift:g} mg"
    return [_weak(what, shift, found, "State accelerometer_walk under [noise] where biases may drift.")]


def _axis(recording: Recording, settings: AoaSettings) -> list[Finding]:
    """The accelerometer whose axis shifts the angle most where it is turned and the recording fits, or no worse."""
    part, settings = judged(recording, settings)
    as_stated = fit_quality(part, settings).misfit
    plain = estimate(part, posed(settings, part.spatial))
    worst: tuple[float, str, AngleEffect] | None = None
    for k, name in enumerate(settings.layout.names):
        turned = with_axis(settings, k, LIMITS.unseen_axis)
        found = effect(plain, estimate(part, posed(turned, part.spatial)), part.t)
        if found is None or not found.ratio > max(LIMITS.unseen_sigmas, worst[2].ratio if worst else 0.0):
            continue
        for size in (LIMITS.unseen_axis, -LIMITS.unseen_axis):  # it may be off already, and back is no error
            then = fit_quality(part, with_axis(settings, k, size))  # back it shifts by as much
            if then.fits or then.misfit <= as_stated:
                worst = found.shift, name, found
                break
    if worst is None:
        return []
    shift, name, found = worst
    what = f"an axis of {name} turned by {math.degrees(LIMITS.unseen_axis):g} deg"
    return [_weak(what, shift, found, "Fit the axes to a reference angle, or move through more angles.")]


def _weak(fault: str, shift: float, found: AngleEffect, action: str) -> Finding:
    """``weak_test``: a fault that shifts the angle by ``shift`` [rad], unnoticed."""
    size = f"{math.degrees(shift):.2g} deg ({found.ratio:.2g} u)"
    return Finding(
        "weak_test", f"This motion hides {fault}, which shifts the angle by {size}.", action=action
    )
