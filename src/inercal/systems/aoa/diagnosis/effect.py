"""Effects of errors of a study on the angle, tried on a stretch: their size decides whether they harm.

The stretch is filtered as the study has it, and again without the error. What u lacks is the shift of the angle, and
what u would be more,

    lack^2 = shift^2 + max(0, u'^2 - u^2)

and an effect that lacks more than u itself harms: the error is then more than 1.4 u, root mean square.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.geometry.rotations import principal
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.diagnosis.fit_quality import stretch
from inercal.systems.aoa.fusion.filter_result import FusionResult, estimate
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


@dataclass(frozen=True)
class AngleEffect:
    """Rms ``shift`` of the angle [rad], its median ``u`` [rad] and the rms of ``lack`` over u, after the settling time;
    ``nis`` the mean squared innovation with the change."""

    shift: float
    u: float
    lack: float
    nis: float

    @property
    def ratio(self) -> float:
        """Shift over u."""
        return self.shift / self.u

    @property
    def harm(self) -> tuple[str, ...]:
        """Names of all that may be shifted by more than its u: everything, or nothing."""
        return EVERYTHING if self.lack > 1.0 else ()


def effect(plain: FusionResult, off: FusionResult, t: np.ndarray) -> AngleEffect | None:
    """The effect of a change on rows at ``t`` (n,) [s]; None where either has no angle."""
    known = np.isfinite(plain.u) & np.isfinite(off.theta) & (t - t[:1] >= LIMITS.settling_time)
    if not known.any():
        return None
    shift = np.square(principal(off.theta - plain.theta)[known])
    before, after = np.square(plain.u[known]), np.square(off.u[known])
    lack = (shift + np.maximum(after - before, 0.0)) / before
    root = float(np.sqrt(shift.mean()))
    return AngleEffect(root, float(np.median(plain.u[known])), float(np.sqrt(lack.mean())), off.nis_mean)


def of_flexure(
    recording: Recording, problem: FusionProblem, filtered: FusionResult, settings: AoaSettings
) -> list[Finding]:
    """``flexure``: a sting that shakes the model by more than half of what the prior allows, with what the angle would
    be if that were twice as large as what is found; nothing where the recording asked for a wide one."""
    rms, noise = _flexure(problem, filtered), settings.noise.accelerometer
    times = 2.0 * rms / max(settings.prior.heave.level, settings.prior.axial.level)
    wide = settings.prior.heave.damping == LIMITS.shaking_damping
    if wide or not (rms > LIMITS.flexure_ratio * noise and times > 1.0):
        return []
    part = stretch(recording)
    found = effect(estimate(part, problem), estimate(part, _more_flexible(problem, times)), part.t)
    if found is None:
        return []
    advice = "state [prior.heave] and [prior.axial] as the report shows them" if found.harm else ""
    text = (
        f"the sting shakes the sensors by {rms / STANDARD_GRAVITY:.2g} g rms, and twice as much moves the angle "
        f"by {found.ratio:.2g} u"
    )
    larger = math.sqrt(1.0 + max(found.lack**2 - found.ratio**2, 0.0))
    allowed: dict[str, str | float] = {
        "allowing for": "twice the flexure",
        "moves the angle by [deg]": math.degrees(found.shift),
        "makes u larger by": larger,
    }
    return [Finding("flexure", text, harm=found.harm, action=advice, items=(allowed,))]


def of_noise(
    part: Recording, plain: FusionProblem, fair: FusionProblem, noise: list[Finding]
) -> list[Finding]:
    """Findings on noise, those on too much of it with what it does to the angle of a stretch."""
    if not any(each.harm for each in noise):
        return noise
    found = effect(estimate(part, plain), estimate(part, fair), part.t)
    if found is None or found.harm:
        return noise
    cost = f"so far it costs {math.degrees(found.u * found.lack):.2g} deg, {found.lack:.2g} times u"
    return [
        replace(each, headline=f"{each.headline} ({cost})", harm=()) if each.harm else each for each in noise
    ]


def _flexure(problem: FusionProblem, filtered: FusionResult) -> float:
    """Rms [m/s^2] of the flexure that a filter found, in the direction that has more; 0 where it is not estimated."""
    at = [k for k, name in enumerate(problem.names) if name.startswith("flexure_")]
    if not at or not len(filtered.kept_t):
        return 0.0
    rows = filtered.states[filtered.kept_t - filtered.kept_t[0] >= LIMITS.settling_time][:, at]
    rows = rows[np.isfinite(rows).all(axis=1)]
    return float(np.sqrt(np.mean(np.square(rows), axis=0)).max()) if len(rows) else 0.0


def _more_flexible(problem: FusionProblem, times: float) -> FusionProblem:
    """The problem with so many times the flexure."""
    constants, covariance = problem.constants, problem.covariance.copy()
    res = problem.places.resonators
    covariance[res : res + 4, res : res + 4] *= times**2
    levels = {name: times * getattr(constants, name) for name in ("heave_level", "axial_level")}
    return replace(problem, covariance=covariance, constants=constants._replace(**levels))
