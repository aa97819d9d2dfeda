"""The band in which the fusion sees the sensors: its low pass and its notches, as a study states them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.aoa.limits import LIMITS
from inercal.arrays import Array


@dataclass(frozen=True)
class Band:
    """Filter of all sensors alike before the fusion.

    ``low_pass`` [Hz], infinite for none, None where the recording decides (`inercal.aoa.diagnosis.choice`); ``notch``
    [Hz] frequencies that are taken out; ``rate`` [Hz] of the rows it is for, 0 before there are any.
    """

    low_pass: float | None = None
    notch: tuple[float, ...] = ()
    rate: float = 0.0

    @property
    def corner(self) -> float:
        """Corner frequency [Hz] of the low pass; infinite where there is none, or the rate leaves nothing to take."""
        low = np.inf if self.low_pass is None else self.low_pass
        return low if low < LIMITS.widest_corner * self.rate else np.inf

    @property
    def sections(self) -> Array:
        """(S, 6) sections of second order, empty where nothing is filtered: b0, b1, b2, 1, a1, a2.

        A Butterworth low pass, of the filters of its order the one that is flattest over a slow motion; notches.
        """
        from scipy.signal import butter, iirnotch

        low = (
            [butter(LIMITS.low_pass_order, self.corner, output="sos", fs=self.rate)]
            if self.corner < np.inf
            else []
        )
        there = (each for each in self.notch if each < LIMITS.widest_corner * self.rate)
        notches = [np.hstack(iirnotch(each, LIMITS.notch_quality, fs=self.rate))[None] for each in there]
        return np.vstack([np.empty((0, 6)), *low, *notches])

    @property
    def every(self) -> int:
        """Rows of which the fusion takes one."""
        if not self.corner < np.inf:
            return 1
        return max(1, round(self.rate / (LIMITS.fused_rate_ratio * self.corner)))

    @property
    def words(self) -> str:
        """The band, for people and findings: ``low_pass = "35 Hz", notch = ["50 Hz"]``."""
        low = '"none"' if not self.corner < np.inf else f'"{self.corner:.3g} Hz"'
        notches = ", ".join(f'"{each:.4g} Hz"' for each in self.notch)
        return f"low_pass = {low}" + (f", notch = [{notches}]" if notches else "")


WHOLE = Band(np.inf)
"""The band of sensors that are not filtered."""
