"""The clocks of a record in numbers, and the turns that accelerometers and gyro both see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import clocks, counted_rows
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.recognise.physics import turns
from inercal.foundation.records.recognise.sensor_units import contradiction, turned_otherwise
from inercal.foundation.records.record import Record
from inercal.foundation.units import RAW


@dataclass(frozen=True)
class ClockRates:
    """Rates [Hz] of a ``clock`` by the ``mean`` and the ``median`` of its steps, and their standard deviation [s]."""

    clock: str
    mean: float
    median: float
    jitter: float

    @property
    def line(self) -> str:
        """The rates in words."""
        apart = abs(self.mean / self.median - 1.0) > LIMITS.mean_from_median
        even = self.jitter * self.median < 1e-9  # rounding of the stamps
        steps = "steps are even" if even else f"steps scatter by {1e3 * self.jitter:.2g} ms"
        return (
            f"{self.clock}: {self.median:.5g} Hz by the median step, {self.mean:.5g} Hz by the mean"
            f"{', which is another' if apart else ''}; {steps}"
        )


def clock_rates(record: Record) -> tuple[ClockRates, ...]:
    """The rates of each clock of a record that has stamps going forward; none of rows that are counted."""
    if counted_rows(record.columns) or record.rate_u is not None:
        return ()
    rates = []
    for name, t in clocks(record.columns, "t").axes.items():
        known = t[np.isfinite(t)]
        steps = np.diff(known)
        if len(steps) > 1 and known[-1] > known[0] and np.median(steps) > 0.0:
            mean = len(steps) / float(known[-1] - known[0])
            rates.append(ClockRates(name, mean, 1.0 / float(np.median(steps)), float(np.std(steps))))
    return tuple(rates)


@dataclass(frozen=True)
class TurnsSeen:
    """Turns that a gyro shows over those that the accelerometers see (``ratio``, NaN of a gyro in counts), its relative
    standard uncertainty ``u``, the ``axes`` as of `inercal.foundation.records.recognise.physics.SeenTurns`, and whether
    the sample rate was ``typed``."""

    ratio: float
    u: float
    axes: tuple[int, int, int]
    typed: bool

    @property
    def line(self) -> str:
        """The turns in words."""
        words = (
            "the gyro turns" if np.isnan(self.ratio) else f"the gyro shows {self.ratio:.3f} times the turns"
        )
        seen = " as the accelerometers see it" if np.isnan(self.ratio) else " that the accelerometers see"
        return f"turns: {words}{seen} (u {100 * self.u:.0f} %)"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """A unit, a rate or axes that contradict the accelerometers."""
        found = []
        off = abs(self.ratio - 1.0) > max(LIMITS.typed_rate, 3.0 * self.u)
        if self.typed and off:
            text = (
                f"gyro: shows {self.ratio:.3g} times the turns that the accelerometers see, at the rate typed"
            )
            found.append(
                Finding("unit_suspect", text, action="check the sample rate, and the unit of the gyro")
            )
        elif contradiction(self.ratio):
            text = f"gyro: shows {self.ratio:.3g} times the turns that the accelerometers see"
            found.append(
                Finding("unit_suspect", text, action="check its unit, the full-scale range and the stamps")
            )
        if words := turned_otherwise(self):
            text = f"gyro: its {words.removeprefix(', though its ')}"
            swapped = any(axis and abs(axis) != place for place, axis in enumerate(self.axes, 1))
            code = "channel_swap" if swapped else "sign_suspect"
            found.append(Finding(code, text, action="check sign and order of the axes in the map"))
        return tuple(found)


def turns_seen(record: Record) -> TurnsSeen | None:
    """The turns of a record with both triads as its accelerometers see them; None where nothing such turns."""
    names = [f"{sensor}_{axis}" for sensor in ("acc", "gyro") for axis in "xyz"]
    if not all(name in record for name in names) or counted_rows(record.columns):
        return None
    acc, gyro = record.triad("acc"), record.triad("gyro")
    rates = _on_clock(acc.t, gyro.t, gyro.values)
    fit = turns(acc.values, rates, acc.t)
    if fit is None:
        return None
    size = np.nan if gyro.unit.dimension in RAW else gyro.unit.factor
    return TurnsSeen(float(size / fit.size), fit.u, fit.axes, record.rate_u is not None)


def _on_clock(t: Array, of: Array, values: Array) -> Array:
    """Values (n, 3) of one clock at the stamps of another (m,)."""
    if t is of:
        return values
    known = np.isfinite(of)
    return np.stack([np.interp(t, of[known], column[known]) for column in values.T], axis=-1)
