"""The rest detector of a measurement: the monitor of streams looks at each sample beside the estimator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from inercal.foundation.errors import InercalError

if TYPE_CHECKING:
    from inercal.faces.stream.estimators import Make
    from inercal.faces.stream.lines import Lines, Sample
    from inercal.faces.stream.monitor import Monitor
    from inercal.faces.stream.run import Output, Recursive

_LOOK = 0.2
"""Time [s] between two rows of the monitor."""


class RestState:
    """Rest of the instrument as the monitor tells it, whatever is measured: ``at`` rest (None where it is not known),
    and for how ``long`` [s]."""

    def __init__(self) -> None:
        self.at: bool | None = None
        self.long = math.nan

    def beside(self, make: Make) -> Make:
        """The estimator, each sample of which the monitor looks at first; its rows are its own."""

        def both(lines: Lines) -> Recursive[Any]:
            from inercal.faces.stream.monitor import Monitor
            from inercal.foundation.noise.running import load_kernels

            inner = make(lines)
            try:
                monitor = Monitor(lines, _LOOK)
            except InercalError:  # no sensor that it could look at
                return inner
            load_kernels()
            return _WithMonitor(inner, monitor, self)

        return both

    def take(self, columns: Sequence[str], row: Output) -> None:
        """Take a row of the monitor."""
        at, long = (row[columns.index(name)] for name in ("rest", "still [s]"))
        told = not isinstance(at, str) and math.isfinite(at)
        self.at = bool(at) if told else None
        self.long = math.nan if isinstance(long, str) else long


class _WithMonitor:
    """An estimator with a monitor beside it (`inercal.faces.stream.run.Recursive`)."""

    def __init__(self, inner: Recursive[Any], monitor: Monitor, rest: RestState) -> None:
        self.inner, self.kind, self.columns = inner, inner.kind, inner.columns
        self._monitor: Monitor | None = monitor
        self._state, self._rest = monitor.initial(), rest

    @property
    def settings(self) -> object:
        """The settings of the estimator within."""
        return self.inner.settings

    @property
    def failure(self) -> str:
        """The failure of the estimator within, in words; empty without one."""
        return str(getattr(self.inner, "failure", ""))

    def initial(self) -> Any:
        """The state before the first sample."""
        return self.inner.initial()

    def step(self, state: Any, sample: Sample) -> tuple[Any, Sequence[Output]]:
        """The state after a sample, and its lines."""
        if self._monitor is not None:
            try:
                self._state, rows = self._monitor.step(self._state, sample)
            except InercalError:  # stamps that tell no time
                self._monitor, rows = None, ()
            for row in rows:
                self._rest.take(self._monitor.columns if self._monitor else (), row)
        return self.inner.step(state, sample)

    def finish(self, state: Any) -> Sequence[Output]:
        """The lines of rows that were held."""
        return self.inner.finish(state)
