"""A recording of a platform, as estimators take it: in SI, one clock, continuous angles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.units import Quantity


class Steps(NamedTuple):
    """Rates and measurements of m steps, as kernels take them: ``dt`` (m,) [s]; ``rate`` (m, 3) [rad/s], held over each
    step; ``acc`` (m, 3) [m/s^2] and ``th`` (m, 3) [rad] measured at its end, NaN where not; ``later`` (m, 3)
    [rad/s] the rate of the step after it, NaN where nobody knows it; ``warm`` (m,) [K] at its end, above the
    temperature of the coefficients."""

    dt: Array
    rate: Array
    acc: Array
    th: Array
    later: Array
    warm: Array

    def part(self, steps: slice) -> Steps:
        """Some of the steps."""
        return Steps(*(each[steps] for each in self))


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording of a platform; NaN where a number is missing.

    ``t`` (n,) [s], increasing; ``rate`` (n - 1, 3) [rad/s] of the platform against inertial space, in p, held from each
    row to the next: commanded, or ``measured`` by gyros, whose noise gathers over the time ``walked`` (n - 1,) [s] in
    each step, the step itself if None. ``th`` (n, 3) [rad] gimbal angles, continuous through full
    turns, the first row complete; ``acc`` (n, 3) [m/s^2], the first row not used. ``held``: steps whose rate was not
    recorded (`inercal.systems.selfcal.filters.gaps`). ``temperature``: mean and standard deviation of the recorded one.
    ``reference`` (n, 4) q_bp by another instrument, or the truth of a simulation. ``warm`` (n,) [K] above the
    temperature of the coefficients; None where it was not recorded. ``fixed`` joints 0, 1, 2 have no encoder, and one
    angle.
    """

    t: Array
    rate: Array
    th: Array
    acc: Array
    measured: bool = False
    findings: tuple[Finding, ...] = ()
    sources: tuple[Source, ...] = ()
    held: tuple[int, ...] = ()
    temperature: Quantity | None = None
    walked: Array | None = None
    reference: Array | None = None
    warm: Array | None = None
    fixed: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        # For arrays that lie otherwise in memory, all kernels would be compiled once more.
        for name in ("rate", "th", "acc"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=float))

    @property
    def dt(self) -> Array:
        """(n - 1,) s, from each row to the next."""
        return np.diff(self.t)

    @property
    def steps(self) -> Steps:
        """The n - 1 steps from row to row."""
        rate = self.rate
        warm = np.zeros(len(rate)) if self.warm is None else self.warm[1:]
        later = np.vstack([rate[1:], np.full_like(rate[-1:], np.nan)])
        return Steps(self.dt, rate, self.acc[1:], self.th[1:], later, warm)

    @property
    def walking(self) -> Array:
        """(n - 1,) s, over which angle random walk gathers in each step."""
        return self.dt if self.walked is None else self.walked

    @property
    def scalars(self) -> int:
        """Number of scalar measurements used: all but the first row's; a fixed joint's angle is one."""
        return int(np.isfinite(self.th[1:]).sum() + np.isfinite(self.acc[1:]).sum())
