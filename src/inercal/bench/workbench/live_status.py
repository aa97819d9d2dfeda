"""State of a measurement as plain objects: for the page and for programs."""

from __future__ import annotations

import math
from typing import Any

from inercal.bench.workbench.measurements import WishedMeasurement
from inercal.bench.workbench.rest_detector import RestState
from inercal.systems.imu.limits import LIMITS


def status(live: WishedMeasurement) -> dict[str, Any]:
    """The measurement at this moment, as plain objects."""
    of = live.measurement
    counts = of.counts
    return {
        "state": of.state,
        "words": _words(live),
        "rest_words": _rest_words(live.rest),
        "gone": live.gone,
        "failure": of.failure,
        "verdict": of.verdict,
        "rest": live.rest.at,
        "still_s": _finite(live.rest.long),
        "latest": {name: _quantity(each) for name, each in of.latest.items()},
        "channels": {name: _quantity(each) for name, each in of.channels.items()},
        "counts": {
            name: _finite(value) if isinstance(value, float) else value
            for name, value in vars(counts).items()
            if name != "sinks"
        },
        "sinks": {
            name: {
                key: _finite(value) if isinstance(value, float) else value
                for key, value in vars(each).items()
            }
            for name, each in counts.sinks.items()
        },
        "said": str(counts),
        "alarms": [vars(each) for each in of.alarms],
        "command": live.command,
        "recording": None if live.recording is None else live.recording.name,
    }


_STATES = {
    "new": "The measurement begins.",
    "preparing": "The measurement begins: the estimator is made ready.",
    "waiting": "The measurement waits for rows.",
    "running": "The measurement is running.",
    "ended": "The measurement has ended.",
}


def _words(live: WishedMeasurement) -> str:
    """The state for people."""
    of = live.measurement
    if of.state == "ended" and of.failure:
        return "The measurement has ended with an error."
    if live.gone:
        return "The source is gone, and is tried again."
    return _STATES[of.state]


def _rest_words(rest: RestState) -> str:
    """Rest for people."""
    if rest.at is None:
        return f"Rest: not known, for nothing was quiet for {LIMITS.initial_rest:g} s yet."
    return f"At rest for {rest.long:.0f} s." if rest.at else "In motion."


def rows(live: WishedMeasurement, after: int) -> dict[str, Any]:
    """Rows of the last two minutes that came after a number, with the number to ask with next."""
    number, found = live.measurement.rows(max(after, 0))
    kept = [[_finite(each) if isinstance(each, float) else each for each in row] for row in found]
    return {"next": number, "columns": list(live.measurement.columns), "rows": kept}


def _quantity(quantity: Any) -> dict[str, Any]:
    """A quantity as plain objects."""
    return {"value": quantity.value, "u": quantity.u, "unit": quantity.unit}


def _finite(value: float) -> float | None:
    """A finite number, else None."""
    return value if math.isfinite(value) else None
