"""Rectification: the offset that vibration makes of an accelerometer, by its second-order coefficient K2."""

from __future__ import annotations

import math
from dataclasses import replace

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.diagnosis.spectrum import powers
from inercal.systems.aoa.diagnosis.stretches import liveliest
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


def of_rectification(recording: Recording, settings: AoaSettings, u: float) -> list[Finding]:
    """``rectification``: vibration that by a common K2 makes an offset of the angle near its ``u`` [rad], without being
    in it."""
    stated, power = settings.noise.rectification, _vibration(recording)
    k2 = stated or LIMITS.common_k2
    off = k2 * power / STANDARD_GRAVITY
    if settings.prior.rectified or not off > LIMITS.told_offset * u:
        return []
    advice = (
        "band and snap are stated, so u has none of it"
        if stated
        else "write rectification under [noise], so that u has it"
    )
    text = (
        f"sensors feel {math.sqrt(power) / STANDARD_GRAVITY:.2g} g rms above {LIMITS.lowest_line:g} Hz: a K2 of "
        f"{1e6 * k2 * STANDARD_GRAVITY:.3g} ug/g^2 shifts the angle by {math.degrees(off):.2g} deg"
    )
    return [Finding("rectification", text, harm=EVERYTHING if off > u else (), action=advice)]


def with_offsets(recording: Recording, settings: AoaSettings) -> AoaSettings:
    """The study with what vibration may make of the stated K2, which lies anywhere up to it."""
    k2 = settings.noise.rectification
    if not k2:
        return settings
    offset = k2 * _vibration(recording) / math.sqrt(3.0)
    return replace(settings, prior=replace(settings.prior, rectified=offset))


def _vibration(recording: Recording) -> float:
    """Mean square [m^2/s^4] above `Limits.lowest_line` in the liveliest stretch, of the accelerometer that feels most;
    0 of a short recording."""
    rows = next(iter(liveliest(recording)), None)
    if rows is None:
        return 0.0
    frequency, density = powers(recording.t[rows], recording.acc[rows])
    return float(density[frequency > LIMITS.lowest_line].sum(axis=0).max() * frequency[1])
