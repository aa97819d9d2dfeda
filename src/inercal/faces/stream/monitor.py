"""A live monitor: rest of an instrument, its duration, and the noise since the last motion.

Rest is told from motion as in a recording (`inercal.systems.imu.recording`): by the variance in a window of about a
second against that of a quiet start; but the window ends at the present sample. The quiet start is the first five
seconds in which no window varies by more than the same multiple of the calmest one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output
from inercal.faces.stream.shell import StreamRow, SystemOnStream
from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.noise.running import Octaves, Window, cascade, empty_octaves, empty_window, slide
from inercal.foundation.records.column import Column, usable_interval
from inercal.foundation.records.dwells import window_samples
from inercal.systems.imu.limits import LIMITS

_MEASURED = re.compile(r"acc_[xyz]|a\d+|gyro\w*|y_[xy]")
_FIRST_STAMPS = 33
_FEWEST = 8


class MonitorState(NamedTuple):
    """State of the monitor.

    ``stamps`` (k,) are the first time stamps [s], until the ``interval`` [s] is known (0 before). ``quiet``
    (groups,) is the variance of the quiet start; before that is known (0), ``start`` (3, channels) holds its
    number of samples, means and sums of squared deviations, ``begun`` [s] its begin (NaN if it has not), and
    ``extremes`` (2, groups) the least and the largest variance of a window in it. ``still`` [s] is the begin
    of the static interval, NaN where there is none; ``t`` [s] the last stamp.
    """

    stamps: Array
    interval: float
    window: Window
    octaves: Octaves
    started: bool
    quiet: Array
    start: Array
    begun: float
    extremes: Array
    still: float
    t: float


class Monitor(SystemOnStream[MonitorState]):
    """Tells rest from motion and measures the noise at rest.

    A line holds the time; whether the instrument is at rest (1 or 0), and for how long; the variance in the
    window over that of the quiet start, of the sensor where that is largest; the longest averaging time tau of
    which there are at least eight differences since the last motion; and for each channel mean and standard
    deviation in the window, random walk N with its standard uncertainty, and the Allan deviation at tau. N is
    read at the octave nearest to 1 s. Unknown values are empty.

    Time stamps and values that are missing, stamps that run backward, and gaps of half a window end a rest. A row
    whose stamp is wrong is left out.

    Parameters
    ----------
    lines : Lines
        Their accelerometers, gyros and drift outputs are watched.
    every : float
        Interval [s] of the lines, in the time of the record; 0 for a line each sample.

    Raises
    ------
    RecordError
        There is no such channel; or, later, the first time stamps do not increase.
    """

    kind = "monitor"

    def __init__(self, lines: Lines, every: float = 0.0) -> None:
        super().__init__(every, lambda finding: None)
        self._where = lines.where
        columns = list(lines.record.columns.values())
        self._places = [i for i, column in enumerate(columns) if _MEASURED.fullmatch(column.name)]
        watched = [columns[i] for i in self._places]
        if not watched:
            names = ", ".join(column.name for column in columns)
            raise RecordError(lines.where, f"found {names}, expected accelerometers, gyros or drift outputs")
        sensors = [column.sensor for column in watched]
        self._groups = [
            [i for i, sensor in enumerate(sensors) if sensor == name] for name in dict.fromkeys(sensors)
        ]
        self.columns = ["t [s]", "rest", "still [s]", "restlessness", "tau [s]"]
        self.columns += [title for column in watched for title in _titles(column)]

    @property
    def deciding(self) -> Mapping[str, object]:
        """The limits."""
        limits = [LIMITS.moving_variance, LIMITS.initial_rest, _FIRST_STAMPS, _FEWEST]
        return {"limits": np.array(limits)}

    def begun(self) -> MonitorState:
        """Nothing known."""
        channels, groups = len(self._places), len(self._groups)
        return MonitorState(
            stamps=np.empty(0), interval=0.0, window=empty_window(0, channels), octaves=empty_octaves(channels),
            started=False, quiet=np.zeros(groups), start=np.zeros((3, channels)), begun=math.nan,
            extremes=_no_extremes(groups), still=math.nan, t=math.nan,
        )  # fmt: skip

    def stepped(self, state: MonitorState, sample: Sample) -> tuple[MonitorState, Sequence[StreamRow]]:
        """The state after a sample, and its line."""
        t = math.nan if sample.wrong else sample.t
        if not sample.wrong:
            state = self._watched(state, sample) if state.interval > 0.0 else self._timed(state, t)
        return state, [StreamRow(t, lambda: self._line(state, t))]

    def _timed(self, state: MonitorState, t: float) -> MonitorState:
        """Find the sample interval from the first stamps; the window then has its length."""
        stamps = np.append(state.stamps, t) if math.isfinite(t) else state.stamps
        if len(stamps) < _FIRST_STAMPS:
            return state._replace(stamps=stamps)
        interval = float(np.median(np.diff(stamps)))
        if interval <= 0.0:
            raise RecordError(
                self._where, f"found {len(stamps)} time stamps that do not increase, expected a recording"
            )
        usable_interval(interval, self._where)
        window = empty_window(window_samples(1.0 / interval), len(self._places))
        return state._replace(stamps=np.empty(0), interval=interval, window=window, t=t)

    def _watched(self, state: MonitorState, sample: Sample) -> MonitorState:
        """Take a sample into the window, and tell rest from motion."""
        window, t = state.window, sample.t
        values = [sample.values[i] for i in self._places]
        complete = all(map(math.isfinite, values))
        if not (complete and 0.0 <= t - state.t <= 0.5 * len(window.samples) * state.interval):
            window.clear()
            state = _ended(state)
        if not complete:
            return state._replace(t=t)
        x = np.array(values)
        slide(x, *window)
        variance = window.variance.tolist()
        sizes = [math.hypot(*(variance[i] for i in group)) for group in self._groups]
        if not state.started:
            state = self._started(state, x, t, sizes)
        elif _restlessness(state, sizes) <= LIMITS.moving_variance:
            if math.isnan(state.still):
                state = state._replace(still=t - (len(window.samples) - 1) * state.interval)
            cascade(x, *state.octaves)
        elif not math.isnan(state.still):
            state = _ended(state)
        return state._replace(t=t)

    def _started(self, state: MonitorState, x: Array, t: float, sizes: list[float]) -> MonitorState:
        """Take a sample into the quiet start, which is over after its time, and begins anew after a motion."""
        full = not math.isnan(sizes[0])
        if full:
            state.extremes[:] = np.minimum(state.extremes[0], sizes), np.maximum(state.extremes[1], sizes)
            least, largest = state.extremes
            if np.any((least > 0.0) & (largest > LIMITS.moving_variance * least)):
                state.window.clear()
                return _ended(state)
        start, begun = state.start, t if math.isnan(state.begun) else state.begun
        start[0] += 1.0
        step = x - start[1]
        start[1] += step / start[0]
        start[2] += step * (x - start[1])
        cascade(x, *state.octaves)
        if not full or t - begun < LIMITS.initial_rest:
            return state._replace(begun=begun)
        variance = start[2] / (start[0] - 1.0)
        quiet = np.array([np.linalg.norm(variance[group]) for group in self._groups])
        return state._replace(started=True, quiet=quiet, still=begun)

    def _line(self, state: MonitorState, t: float) -> Output:
        """The output line."""
        window, octaves, interval = state.window, state.octaves, state.interval
        variance = window.variance.tolist()
        sizes = [math.hypot(*(variance[i] for i in group)) for group in self._groups]
        restlessness = _restlessness(state, sizes)
        rest = math.nan if math.isnan(restlessness) else int(not math.isnan(state.still))
        still = t - state.still if rest == 1 else 0.0 if rest == 0 else math.nan
        unknown = [math.nan] * len(self._places)
        walk, u, adev, tau = unknown, unknown, unknown, math.nan
        near = max(0, round(-math.log2(interval))) if interval > 0.0 else 0
        if octaves.clusters[near] > 1:
            spread, dof = octaves.variance(near)
            walk = np.sqrt(spread * interval * 2.0**near).tolist()
            u = [value / math.sqrt(2.0 * dof) for value in walk]
        if (longest := octaves.longest(_FEWEST)) >= 0:
            adev, tau = np.sqrt(octaves.variance(longest)[0]).tolist(), interval * 2.0**longest
        deviation = np.sqrt(window.variance).tolist()
        channels = zip(window.mean.tolist(), deviation, walk, u, adev, strict=True)
        return [t, rest, still, restlessness, tau, *(value for channel in channels for value in channel)]


def _ended(state: MonitorState) -> MonitorState:
    """No static interval, and no quiet start that goes on."""
    state.octaves.clear()
    state.start[:] = 0.0
    state.extremes[:] = _no_extremes(state.extremes.shape[1])
    return state._replace(still=math.nan, begun=math.nan)


def _no_extremes(groups: int) -> Array:
    """Least and largest (2, groups) of no variance yet."""
    return np.stack([np.full(groups, np.inf), np.zeros(groups)])


def _restlessness(state: MonitorState, sizes: list[float]) -> float:
    """Variance over that of the quiet start, of the group where that is largest; NaN before it is known."""
    if not state.started:
        return math.nan
    quiet: list[float] = state.quiet.tolist()
    return max(size / max(least, 1e-300) for size, least in zip(sizes, quiet, strict=True))


def _titles(column: Column) -> list[str]:
    """Titles of the columns of a channel."""
    name, unit = column.name, column.unit.symbol
    walk = f"{unit}/sqrt(Hz)"
    return [
        f"mean_{name} [{unit}]", f"sd_{name} [{unit}]", f"N_{name} [{walk}]", f"u_N_{name} [{walk}]",
        f"adev_{name} [{unit}]",
    ]  # fmt: skip
