"""The gyro's scale by a recording alone, beside what its prior allows.

Under a prior that is ten times as wide the fusion tells what the recording itself says: 1 / P less the information of
that prior. Where this contradicts the usual prior, the gyro is no such gyro, and a wider one is taken; but not where a
constant error of something else explains the recording better: a turned axis or a wrong position looks like a scale,
and with a wider prior nothing would contradict it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.hypotheses import CLEAR, Fitted
from inercal.systems.aoa.diagnosis.effect import effect
from inercal.systems.aoa.diagnosis.fit_quality import Case, judged
from inercal.systems.aoa.diagnosis.small import beside_a_scale
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings, Prior

_WIDER = 10.0
"""Times the prior's standard deviation under which a recording speaks for itself."""


class GyroScale(NamedTuple):
    """Error of the gyro's scale [1] by a recording alone, with its standard uncertainty; what it is off by from the
    prior, and the standard deviation of that."""

    value: float
    u: float
    off: float
    apart: float

    @property
    def sigmas(self) -> float:
        """Distance from the prior in standard deviations."""
        return abs(self.off) / self.apart


def alone(part: Recording, of: FusionProblem) -> GyroScale | None:
    """The scale that a stretch shows by itself; None where it shows none."""
    k = of.places.scale
    if k < 0 or not of.covariance[k, k] > 0.0 or not np.isfinite(part.gyro).any():
        return None
    prior, mean = float(of.covariance[k, k]), float(of.mean[k])
    state = estimate(part, _wider(of)).state
    variance, wide = float(state.P[k, k]), _WIDER**2 * prior
    if not 0.0 < variance < wide:
        return None
    own = 1.0 / (1.0 / variance - 1.0 / wide)
    value = own * (float(state.x[k]) / variance - mean / wide)
    return GyroScale(value, math.sqrt(own), value - mean, math.sqrt(prior + own))


def _wider(of: FusionProblem) -> FusionProblem:
    """The problem with a wider prior of the scale."""
    k, covariance = of.places.scale, of.covariance.copy()
    variance = _WIDER**2 * covariance[k, k]
    covariance[k], covariance[:, k] = 0.0, 0.0
    covariance[k, k] = variance
    return replace(of, covariance=covariance)


def of_recording(stretches: Sequence[Recording], settings: AoaSettings) -> AoaSettings:
    """The study with a prior of `Limits.unseen_scale` where a stretch contradicts the usual one, and the study states
    none."""
    if settings.prior.gyro_scale != Prior().gyro_scale or settings.estimator.prior is not None:
        return settings
    for part in stretches:
        found = alone(part, problem(settings, part.spatial))
        if found is not None and found.sigmas > LIMITS.other_scale_sigmas:
            return settings if elsewhere(part, settings) else _with_scale(settings, LIMITS.unseen_scale)
    return settings


def _with_scale(settings: AoaSettings, size: float) -> AoaSettings:
    """The study with another prior of the gyro's scale."""
    return replace(settings, prior=replace(settings.prior, gyro_scale=size))


def elsewhere(recording: Recording, settings: AoaSettings) -> Fitted[Case] | None:
    """The constant error of something else that explains a stretch better than another scale of the gyro does, and
    without which the scale no longer contradicts its prior; None where none does."""
    part, settings = judged(recording, settings)
    wider = _with_scale(settings, _WIDER * settings.prior.gyro_scale)
    better = beside_a_scale((part, settings), (part, wider))
    if better is None:
        return None
    left = alone(better.case[0], problem(better.case[1], part.spatial))
    return better if left is None or left.sigmas <= LIMITS.other_scale_sigmas else None


def _harms(error: Fitted[Case], part: Recording, settings: AoaSettings) -> bool:
    """True where a constant error is sure, and the angle would be another one without it."""
    plain, without = (
        estimate(rows, problem(study, rows.spatial)) for rows, study in (judged(part, settings), error.case)
    )
    cost = effect(plain, without, error.case[0].t)
    return bool((np.abs(error.values) > CLEAR * error.u).all()) and cost is not None and bool(cost.harm)


def of_prior(
    part: Recording, of: FusionProblem, settings: AoaSettings, found: GyroScale | None
) -> list[Finding]:
    """``prior_suspect``: the scale that a stretch shows contradicts the prior, and the angle would be another one; or
    what explains it better."""
    if found is None or not found.sigmas > LIMITS.other_scale_sigmas:
        return []
    if (better := elsewhere(part, settings)) is not None and _harms(better, part, settings):
        return [better.finding]
    cost = effect(estimate(part, of), estimate(part, _wider(of)), part.t)
    if found.sigmas <= LIMITS.prior_sigmas or cost is None or not cost.harm:
        return []
    k = of.places.scale
    text = (
        f"the gyro's scale looks off by {100.0 * found.value:.2g} % ({100.0 * math.sqrt(of.covariance[k, k]):.2g} % "
        f"allowed for), which costs {math.degrees(cost.shift):.2g} deg ({cost.ratio:.2g} u)"
    )
    action = "state gyro_scale under [prior], or correct the scale under [sensors.gyro]"
    return [Finding("prior_suspect", text, harm=EVERYTHING, action=action)]
