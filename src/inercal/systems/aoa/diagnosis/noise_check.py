"""Noise of the sensors, separated from motion by differences of high order."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


@dataclass(frozen=True)
class SensorNoise:
    """Noise of a sensor: standard deviation ``size`` [SI] from row to row, ``certain`` where it is surely noise and no
    motion; ``sparse`` the same over every fourth row."""

    size: float
    certain: bool
    sparse: float


def scatter(t: Array, values: Array) -> SensorNoise | None:
    """Noise of ``values`` (n,) at ``t`` (n,) [s]; None where hardly any come at even intervals.

    White noise has the same size in all orders; the square of motion below a quarter of the sample rate at least halves
    from one order to the next. So at least s6^2 - (s5^2 - s6^2) is noise.
    """
    sizes = _by_order(t, values)
    if sizes is None:
        return None
    least = 2.0 * sizes[-1] ** 2 - sizes[-2] ** 2
    certain = least > LIMITS.noise_share * sizes[-1] ** 2
    sparse = _by_order(t[:: LIMITS.sparse_rows], values[:: LIMITS.sparse_rows]) or sizes
    return SensorNoise(math.sqrt(least) if certain else min(sizes), certain, min(sparse))


def _by_order(t: Array, values: Array) -> list[float] | None:
    """Noise by the median difference of each order, from the first; equal in all orders for white noise.

    Only even intervals count: there alone smooth motion leaves no differences of the last order.
    """
    there = np.isfinite(values)
    differences, step = values[there], np.diff(t[there])
    usual = float(np.median(step)) if len(step) else 0.0
    even = runs = np.abs(step - usual) < LIMITS.even_share * usual
    sizes = []
    for order in range(1, LIMITS.noise_order + 1):
        differences = np.diff(differences)
        runs = even if order == 1 else runs[:-1] & even[order - 1 :]
        if runs.sum() < LIMITS.noise_differences:
            return None
        middle = float(np.median(np.abs(differences[runs])))
        sizes.append(middle / 0.6745 / math.sqrt(math.comb(2 * order, order)))
    return sizes


def misstated(
    recording: Recording, settings: AoaSettings, every: int = 1
) -> tuple[list[Finding], AoaSettings]:
    """``excess_scatter`` and ``low_scatter``: noise unlike the study's; and the study with noise not too small.

    A row of the recording stands for ``every`` rows of the sensors, for which the findings state noise.
    """
    noise, names = settings.noise, settings.layout.names
    columns = {name: recording.acc[:, k] for k, name in enumerate(names)}
    groups = (("accelerometer", columns, noise.accelerometer), ("gyro", {"gyro": recording.gyro}, noise.gyro))
    findings = []
    for key, sensors, nominal in groups:
        scatters = {name: scatter(recording.t, values) for name, values in sensors.items() if nominal > 0.0}
        seen = {name: each for name, each in scatters.items() if each is not None}
        over = {name: each.size / nominal for name, each in seen.items() if each.certain}
        noisy = {name: each for name, each in seen.items() if each.size > 0.0}
        least = max((max(each.size, each.sparse) / nominal for each in noisy.values()), default=0.0)
        if loud := [name for name, ratio in over.items() if ratio > LIMITS.loud_noise_ratio]:
            most = max(over.values())
            findings.append(_finding("excess_scatter", key, loud, most, nominal * math.sqrt(every)))
            settings = replace(settings, noise=replace(settings.noise, **{key: most * nominal}))
        elif LIMITS.no_noise_ratio < least < LIMITS.low_noise_ratio:
            findings.append(_finding("low_scatter", key, list(noisy), least, nominal * math.sqrt(every)))
    return findings, settings


def _finding(code: str, key: str, names: list[str], ratio: float, nominal: float) -> Finding:
    """Finding on the noise of sensors, in words."""
    unit, size = ("g", STANDARD_GRAVITY) if key == "accelerometer" else ("deg/s", math.pi / 180.0)
    now, then = f"{nominal / size:.3g} {unit}", f"{ratio * nominal / size:.2g} {unit}"
    harm = EVERYTHING if code == "excess_scatter" else ()
    text = f"{', '.join(names)}: noise is {ratio:.2g} times the {now} that the study states"
    action = f'write {key} = "{then}" under [noise], unless its unit is wrong'
    return Finding(code, text, harm=harm, action=action)
