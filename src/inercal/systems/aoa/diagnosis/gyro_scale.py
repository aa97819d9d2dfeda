"""The gyro's scale by a recording alone, beside what its prior allows.

What a filter has of the scale is the prior and the recording: 1 / P less the information of the prior is that of the
recording. Where this contradicts the usual prior, the gyro is no such gyro, and a wider one is taken; but not where the
judge hears something else: a turned axis or a wrong position looks like a scale, and with a wider prior nothing would
contradict it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from inercal.foundation.inference.asked_pass import answers, speaker
from inercal.systems.aoa.diagnosis.passed import pass_of
from inercal.systems.aoa.diagnosis.questions import GYRO_SCALE
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.fusion.run import FusionState
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings, Prior


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


def alone(state: FusionState, of: FusionProblem) -> GyroScale | None:
    """The scale that a recording shows by itself, of the ``state`` of the filter behind it; None where it shows
    none."""
    k = of.places.scale
    if k < 0 or not of.covariance[k, k] > 0.0:
        return None
    prior, mean = float(of.covariance[k, k]), float(of.mean[k])
    variance = float(state.P[k, k])
    if not 0.0 < variance < (1.0 - LIMITS.shown_share) * prior:
        return None
    own = 1.0 / (1.0 / variance - 1.0 / prior)
    value = own * (float(state.x[k]) / variance - mean / prior)
    return GyroScale(value, math.sqrt(own), value - mean, math.sqrt(prior + own))


def of_recording(
    stretches: Sequence[Recording], states: Sequence[FusionState], of: FusionProblem, settings: AoaSettings
) -> AoaSettings:
    """The study with a prior of `Limits.unseen_scale` where a stretch contradicts the usual one, and the study states
    none; ``states`` are those of the filter of a problem behind each stretch."""
    if settings.prior.gyro_scale != Prior().gyro_scale or settings.estimator.prior is not None:
        return settings
    for part, state in zip(stretches, states, strict=True):
        found = alone(state, of)
        if found is not None and found.sigmas > LIMITS.other_scale_sigmas:
            if elsewhere(part, settings):
                return settings
            return replace(settings, prior=replace(settings.prior, gyro_scale=LIMITS.unseen_scale))
    return settings


def elsewhere(part: Recording, settings: AoaSettings) -> bool:
    """True where a stretch shows an error that is not the gyro's scale."""
    of = problem(settings, part.spatial)
    passed = pass_of(part, of, settings, estimate(part, of))
    if passed is None:
        return False
    first = speaker(passed.sums, *answers(passed.sums, passed.questions))
    return first is not None and GYRO_SCALE not in (
        answer.question.sentence for answer in (first.answer, *first.others)
    )
