"""Whether the sensors of a recording, and what the study says of them, fit together, before any angle is believed.

Wrong signs, units and positions, and exchanged sensors, are told from the errors that the fusion allows for by the size
of the contradiction: the liveliest stretch is filtered with all nuisances, and again with each fault taken out
(`inercal.aoa.diagnosis.gross`). A fault that alone makes the recording fit is named; where several do, because the
motion is too slow to tell, all of them are. Faults that no sensor contradicts cannot be seen: at rest the gyro's sign
and unit, positions, and the sign of an accelerometer along the model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.aoa.diagnosis.fit_quality import Judged, judge, of_rows, stretch
from inercal.aoa.diagnosis.gross import Fault, faults
from inercal.aoa.diagnosis.noise_check import misstated
from inercal.aoa.reading.clock import later
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import AoaSettings
from inercal.findings import Finding

SOUND = 3.0
"""Misfit (`inercal.aoa.diagnosis.fit_quality.Judged.misfit`) up to which a recording fits: 0.6 to 2.3 on sound ones, 9
and more with a gross fault."""

_BY = 0.5
"""Part of a misfit that a fault must take away at least."""

_ALIKE = 0.1
"""Difference of misfits of two faults of which neither is likelier."""

_TRIED = 3
"""Faults that are looked at together with a second one."""

_TWICE = 20.0
"""Misfit from which two faults at once are looked for."""

_ON_ITS_BACK = -0.1
"""Cosine of theta below which the model lies on its back."""


@dataclass(frozen=True, eq=False)
class _Tried:
    """Faults taken out together, the misfit that is left, and the cosine of theta where the model is most upright."""

    faults: tuple[Fault, ...]
    misfit: float
    upright: float


def implausible(recording: Recording, settings: AoaSettings) -> list[Finding]:
    """What does not fit together, with what to write instead; empty for a sound recording.

    Codes are ``sign_suspect``, ``channel_swap``, ``unit_suspect`` and ``command_shift``; ``not_stated`` of a model on
    its back, which may be as it is. What is left to say of smaller errors is said
    after the filtering (`inercal.aoa.diagnosis.causes`).

    Raises
    ------
    RecordError
        A clock that was set back.
    """
    part = stretch(recording)
    now = judge(part, settings)
    if now.misfit <= SOUND:
        return _on_its_back(recording, settings) if _upright(now) <= _ON_ITS_BACK else []
    return [_either(each) for each in _explaining([()], part, settings, now)]


def _explaining(
    given: Sequence[tuple[Fault, ...]], part: Recording, settings: AoaSettings, now: Judged
) -> list[list[Finding]]:
    """Faults that make a recording fit: for each, all that do as well; first alone, then two together."""
    tried: list[_Tried] = []
    for before in given:
        seen, known = _without(before, part, settings)
        for each in faults(seen, known):
            if not each.last or not before:
                judged = judge(*each.change(seen, known))
                tried.append(_Tried((*before, each), judged.misfit, _upright(judged)))
    found = [one for one in tried if one.misfit <= min(SOUND, (1.0 - _BY) * now.misfit)]
    if any(not one.faults[-1].last for one in found) or (found and _loud(part, settings)):
        found = [one for one in found if not one.faults[-1].last]
    if found:
        least = min(found, key=lambda one: one.misfit)
        alike = [one for one in found if one.misfit <= least.misfit + _ALIKE]
        # a model in a tunnel lies on its back only by intention
        alike = [one for one in alike if one.upright > _ON_ITS_BACK] or alike
        alike.sort(key=lambda one: one.misfit)
        first = alike[0].faults
        last = [one.faults[-1].finding for one in alike if one.faults[:-1] == first[:-1]]
        return [*([each.finding] for each in first[:-1]), last]
    if any(given) or now.misfit < _TWICE:
        return []
    tried.sort(key=lambda one: one.misfit)
    better = [
        one.faults
        for one in tried[:_TRIED]
        if one.misfit < (1.0 - _BY) * now.misfit and not one.faults[-1].last
    ]
    seconds = _without_gyro(part, settings) or better
    return _explaining(seconds, part, settings, now) if seconds else []


def _without_gyro(part: Recording, settings: AoaSettings) -> list[tuple[Fault, ...]]:
    """Faults without which the accelerometers fit each other: what is left then is the gyro's."""
    blind = replace(part, gyro=np.full_like(part.gyro, np.nan))
    tried = [(judge(*each.change(blind, settings)).misfit, each) for each in faults(blind, settings)]
    fitting = sorted((one for one in tried if one[0] <= SOUND), key=lambda one: one[0])
    return [(each,) for _, each in fitting[:_TRIED]]


def _loud(part: Recording, settings: AoaSettings) -> bool:
    """True where noise above what is stated explains all."""
    return judge(part, misstated(part, settings)[1]).misfit <= SOUND


def _without(
    given: tuple[Fault, ...], part: Recording, settings: AoaSettings
) -> tuple[Recording, AoaSettings]:
    """A recording and its study without some faults."""
    for each in given:
        part, settings = each.change(part, settings)
    return part, settings


def _either(alike: list[Finding]) -> Finding:
    """One finding of faults of which neither is likelier."""
    first, *others = alike
    if not others:
        return first
    named = list(dict.fromkeys(each.message.split(":")[0] for each in others))
    return replace(first, message=f"{first.message}; as well possible: {'; '.join(named[:3])}")


def _upright(judged: Judged) -> float:
    """Cosine of theta in all but one in a hundred rows or less; the largest is the most upright."""
    cosine = np.cos(judged.theta[np.isfinite(judged.theta)])
    return float(np.quantile(cosine, 0.99)) if cosine.size else 1.0


def _on_its_back(recording: Recording, settings: AoaSettings) -> list[Finding]:
    """``not_stated``: a model that seems to fly on its back all the time, which no sensor contradicts."""
    now = judge(of_rows(recording, later(recording.t)), settings, 8)
    if _upright(now) > _ON_ITS_BACK:
        return []
    middle = math.degrees(float(np.nanmedian(np.remainder(now.theta, 2.0 * math.pi))))
    text = (
        f"theta is about {middle:.0f} deg, the model on its back: exchange or reverse the accelerometers across it, or "
        'state roll = "180 deg" under [model] if it was mounted so'
    )
    return [Finding("not_stated", text, harm=("theta",))]
