"""Angles beyond the limits of the study, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.places import counted
from inercal.systems.aoa.angles import Angles, gives_alpha
from inercal.systems.aoa.result.columns import columns, rows
from inercal.systems.aoa.settings import AoaSettings


def beyond_limits(angles: Angles, t: Array, settings: AoaSettings) -> list[Finding]:
    """``beyond_limits`` of a whole recording with stamps ``t`` (n,) [s]; none where all angles are within."""
    if not settings.alarm.stated:
        return []
    table = rows(angles, settings)
    out = np.flatnonzero(np.isin(table[:, -1], (-1.0, 1.0)))
    if not len(out):
        return []
    first = beyond(settings, table[out[0]].tolist(), float(t[out[0]]))
    text = f"{first.headline}, and so are {counted(len(out), 'row')} of {len(t)}"
    return [Finding("beyond_limits", text, first.where)]


def beyond(settings: AoaSettings, row: Sequence[float], t: float) -> Finding:
    """``beyond_limits`` of one row of `inercal.systems.aoa.result.columns` at ``t`` [s]."""
    names = [name for name, _ in columns(settings)]
    name = "alpha" if gives_alpha(settings.attitude) else "theta"
    side, limit = ("above", settings.alarm.highest) if row[-1] > 0.0 else ("below", settings.alarm.lowest)
    limit_deg = math.degrees(math.nan if limit is None else limit)
    text = f"{name} is {row[names.index(name)]:.4g} deg, {side} the study's {limit_deg:.6g} deg"
    return Finding("beyond_limits", text, f"t = {t:.10g} s")
