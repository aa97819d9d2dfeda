"""The band in which the fusion sees the sensors: its low pass and its notches, as a study states them.

The filters are those of `scipy.signal.butter` and `iirnotch` in closed form: loading SciPy's took a third of a command.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.keys import FREQUENCY, quantities, quantity
from inercal.systems.aoa.limits import LIMITS


@dataclass(frozen=True)
class Band:
    """The filter of all sensors before the fusion: causal, its delay known to the model; zero phase if smoothed.

    ``low_pass`` [Hz] is None where the recording decides (`inercal.systems.aoa.diagnosis.choice`); ``rate`` [Hz] of the
    rows it is for, 0 before there are any.
    """

    low_pass: float | None = quantity(
        "corner of the low pass; none; auto: none where the sensors fit each other, or the widest of 100 to 35 Hz "
        "above twice the motion under which they do, and notches at lines of the spectrum", "frequency", "auto",
        example="35 Hz", bounds=FREQUENCY, words={"auto": None, "none": math.inf},
    )  # fmt: skip
    notch: tuple[float, ...] = quantities(
        "frequencies that are taken out", "frequency", example=["50 Hz"], bounds=FREQUENCY, at_least=0
    )
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
        low = [_butterworth(self.corner / self.rate)] if self.corner < np.inf else []
        there = (each for each in self.notch if each < 0.5 * self.rate)
        return np.vstack([np.empty((0, 6)), *low, *(_notch(each / self.rate) for each in there)])

    @property
    def every(self) -> int:
        """Rows of which the fusion takes one."""
        if not self.corner < np.inf:
            return 1
        return max(1, round(self.rate / (LIMITS.fused_rate_ratio * self.corner)))

    @property
    def left_out(self) -> tuple[float, ...]:
        """Frequencies [Hz] of a low pass and of notches that the rate of rows has no room for."""
        low, widest = self.low_pass, LIMITS.widest_corner * self.rate
        corners = () if low is None or low == np.inf or low < widest else (low,)
        return (*corners, *(each for each in self.notch if not each < 0.5 * self.rate))

    @property
    def words(self) -> str:
        """The band, for people and findings: ``low_pass = "35 Hz", notch = ["50 Hz"]``."""
        low = '"none"' if not self.corner < np.inf else f'"{self.corner:.3g} Hz"'
        notches = ", ".join(f'"{each:.4g} Hz"' for each in self.notch)
        return f"low_pass = {low}" + (f", notch = [{notches}]" if notches else "")


WHOLE = Band(np.inf)
"""The band of sensors that are not filtered."""


def _butterworth(corner: float) -> Array:
    """Sections (S, 6) of a low pass of an even order by the bilinear transform; its ``corner`` is over the rate.

    Oppenheim and Schafer, Discrete-Time Signal Processing, 7.1.2: poles of the analogue filter on a circle of radius
    tan(pi corner).
    """
    order = LIMITS.low_pass_order
    w = math.tan(math.pi * corner)
    damping = 2.0 * w * np.sin(np.pi * (2.0 * np.arange(order // 2) + 1.0) / (2.0 * order))
    first, one = 1.0 + damping + w * w, np.ones(order // 2)
    numerator = w * w / first * np.array([one, 2.0 * one, one])
    denominator = np.array([first, 2.0 * (w * w - 1.0) * one, 1.0 - damping + w * w]) / first
    return np.vstack([numerator, denominator]).T


def _notch(frequency: float) -> Array:
    """A section (1, 6) that takes out a ``frequency``, over the rate; half of the power passes a quality's part of it
    apart. Orfanidis, Introduction to Signal Processing, 11.3."""
    w = 2.0 * math.pi * frequency
    gain = 1.0 / (1.0 + math.tan(0.5 * w / LIMITS.notch_quality))
    middle = -2.0 * math.cos(w)
    return np.array([[gain, gain * middle, gain, 1.0, gain * middle, 2.0 * gain - 1.0]])
