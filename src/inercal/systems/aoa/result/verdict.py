"""The verdict on angles: the status of an estimate, its sentence, and findings beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import CODES, Finding, Status, causes
from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.inference.sigma_point import NEGATIVE
from inercal.foundation.records.places import counted, counted_names
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


def of_fusion(
    recording: Recording, filtered: FusionResult, angles: Angles, findings: Sequence[Finding]
) -> tuple[Status, str]:
    """Status and sentence of a result of the fusion, by all its findings.

    ``inconsistent`` where the mean NIS is beyond its limit, and also below it where a gross fault of sign, unit or
    order is named: resonators and gates absorb much of the contradiction, and the angle is wrong all the same.
    """
    state, answered, mean = filtered.state, np.isfinite(filtered.theta), filtered.nis_mean
    if 2 * answered.sum() <= len(answered):
        return Status.NOT_CONVERGED, _because(_missing(answered), findings)
    if not (np.isfinite(state.x).all() and is_covariance(state.P)):
        return Status.NOT_CONVERGED, _because("the filter has lost its numbers", findings)
    limit = nis_limit(filtered.nis_count)
    if mean > limit:
        text = f"the recording contradicts the model: mean NIS {mean:.4g}, expected at most {limit:.3g}"
        return Status.INCONSISTENT, _because(text, findings)
    gross = [each for each in findings if CODES[each.code].gross and each not in recording.findings]
    if gross:
        return Status.INCONSISTENT, _because("the sensors contradict each other or the study", gross)
    lost = _lost(recording, filtered)
    if lost is not None:
        return Status.NOT_CONVERGED, _because(lost, findings)
    judged = f"mean NIS {mean:.3g}" if math.isfinite(mean) else "too few readings for a NIS"
    return Status.OK, f"{_words(angles)}, {judged}"


def nis_limit(count: int) -> float:
    """Limit of the mean of ``count`` squared innovations: `Limits.mean_nis`, and more where they are few.

    A sound filter's squares are chi-square with one degree of freedom each (Bar-Shalom et al., Estimation with
    Applications to Tracking and Navigation, 2001, section 5.4).
    """
    from scipy.special import chdtri

    return max(LIMITS.mean_nis, float(chdtri(count, LIMITS.nis_chance)) / count) if count else LIMITS.mean_nis


def of_method(angles: Angles, findings: Sequence[Finding]) -> tuple[Status, str]:
    """Status and sentence of a result of angles without coefficients."""
    answered = np.isfinite(angles.theta)
    if 2 * answered.sum() <= len(answered):
        return Status.NOT_CONVERGED, _because(_missing(answered), findings)
    return Status.OK, f"{angles.method}: {_words(angles)}"


def is_covariance(P: Array) -> bool:
    """True where no combination of states has a negative variance, but for rounding."""
    if not (np.isfinite(P).all() and (np.diag(P) >= 0.0).all()):
        return False
    u = np.sqrt(np.diag(P))
    u[u == 0.0] = 1.0
    with np.errstate(over="ignore"):
        correlation = P / u / u[:, None]
    return bool(np.isfinite(correlation).all() and np.linalg.eigvalsh(correlation)[0] >= NEGATIVE)


def _lost(recording: Recording, filtered: FusionResult) -> str | None:
    """A sentence on a filter that lost the angle too often; None otherwise."""
    if len(filtered.starts) <= LIMITS.losses:
        return None
    seen = recording.t[np.isfinite(recording.acc).sum(axis=1) >= 2]
    starts = recording.t[list(filtered.starts[1:])]
    losses = starts[np.searchsorted(seen, starts - LIMITS.blind_time) < np.searchsorted(seen, starts)]
    if len(losses) < LIMITS.losses:
        return None
    often = counted(len(losses), "time")
    return f"the filter lost the angle {often} though there were accelerometers, first at {losses[0]:.6g} s"


def _missing(answered: NDArray[np.bool_]) -> str:
    """A sentence on rows without an angle."""
    return f"{counted(int((~answered).sum()), 'row')} of {len(answered)} have no angle"


def left_at_prior(names: Sequence[str], ratio: Array, settings: AoaSettings) -> Finding | None:
    """``at_prior``: coefficients that the recording does not show, by the ``ratio`` (p,) of their u to the prior's.

    A delay that the spectra have shown is known, however little the filter adds.
    """
    known = {"tau_g"} if settings.timing.gyro_delay_about != 0.0 else set()
    left = [name for name, each in zip(names, ratio, strict=True) if each > UNSEEN and name not in known]
    if not left:
        return None
    text = f"{counted_names(left, 8)}: no better known than before, as is common"
    action = "a sweep of pitch shows biases, oscillation shows lever arms, heights and the gyro's scale"
    return Finding("at_prior", text, action=action)


def _because(text: str, findings: Sequence[Finding]) -> str:
    """The sentence of a bad verdict with the finding that explains it best."""
    ranked = causes(findings)
    cause = ranked[0].message if ranked else "check signs, units, positions, noise and gravity"
    return f"{text}; {cause}"


def _words(angles: Angles) -> str:
    """Number, range and median uncertainty of the angles, in words."""
    answered = np.isfinite(angles.theta)
    low, high = np.degrees([angles.theta[answered].min(), angles.theta[answered].max()])
    u = angles.u[np.isfinite(angles.u)]
    spread = f", u {math.degrees(float(np.median(u))):.2g} deg (median)" if len(u) else ""
    return f"{counted(int(answered.sum()), 'angle')} from {low:.4g} to {high:.4g} deg{spread}"
