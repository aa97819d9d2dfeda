"""The angle by the gyro alone, from the paper's angle at the first row that has one: a trial."""

from __future__ import annotations

import numpy as np

from inercal.aoa.angles import Angles
from inercal.aoa.paper.methods import measure
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import AoaSettings
from inercal.geometry.rotations import principal


def integrated(recording: Recording, settings: AoaSettings) -> Angles:
    """The angles of a recording; u grows with the gyro's noise and bias."""
    start = measure(recording, settings, settings.methods)
    known = np.flatnonzero(np.isfinite(start.theta))
    t, rate = recording.t, np.nan_to_num(recording.gyro) / settings.attitude.level
    step = np.diff(t, prepend=t[:1])
    first = known[0] if len(known) else 0
    turned = np.cumsum(rate * step)
    lasting = t - t[first]
    noise = settings.noise
    u = np.sqrt(
        start.u[first] ** 2
        + (noise.gyro_bias * lasting) ** 2
        + noise.gyro**2 * np.abs(lasting) * np.median(step)
    )
    theta = principal(start.theta[first] + turned - turned[first])
    return Angles("integrated", theta, u, rate, np.full(len(t), np.hypot(noise.gyro, noise.gyro_bias)))
