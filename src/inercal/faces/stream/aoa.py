"""A wind-tunnel model measured while it moves: rows in, angles and their uncertainties out, each at once.

The causal fusion of `inercal.systems.aoa` goes on by one row at a time, to the digits that it gives on the whole file,
and answers each row with one line: the first ones, and those after the angle was lost, are held until the filter can
start (`inercal.systems.aoa.fusion.live`). `inercal.systems.aoa.reading.from_record` calibrates the sensors, and samples
at a range are left out. A stream does not see faults that only a whole recording shows: sensors that are flat at an
extreme below their range, or stuck.

Delay, band and snap that the study does not state are decided after `Limits.snap_time`
(`inercal.systems.aoa.diagnosis.choice`): the fusion begins anew with them, on all rows so far, and from then on the
digits are those of a study that states them; each line has the status 1 until then. Likewise the study's zero is put in
once its stretch is over, as in a file: a slight buffet in it is averaged, and one in which the model moves is said and
left out. Angles beyond the study's limits are said as
they come.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from inercal.faces.stream.aoa_state import AoaState, Leaning, Sensors, choice_of, chosen, watched_limits
from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.shell import Rows, StreamRow, SystemOnStream
from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.systems.aoa.diagnosis.choice import decided, of_vibration
from inercal.systems.aoa.fusion.band import with_rate
from inercal.systems.aoa.fusion.live import Answers
from inercal.systems.aoa.fusion.live_band import LimitedLive
from inercal.systems.aoa.fusion.loop import BESIDE
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.fusion.watch import ALL, ALL_COUNT, watched
from inercal.systems.aoa.fusion.watch import initial as unwatched
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.reading.recording import later as later_rows
from inercal.systems.aoa.reading.wind_off_zero import with_zero
from inercal.systems.aoa.result.carry_over import corrected
from inercal.systems.aoa.result.carry_over import load as load_posterior
from inercal.systems.aoa.result.columns import SUSPECT, columns, rows
from inercal.systems.aoa.result.systematic import gravity_u, leaning, leans, widened
from inercal.systems.aoa.result.verdict import nis_limit
from inercal.systems.aoa.settings import AoaSettings

_STATUS = 4
"""Place of the status in a row of `inercal.systems.aoa.result.columns`."""


class Aoa(SystemOnStream[AoaState]):
    """Measures angles row by row; columns as `inercal.systems.aoa.result.columns` has them.

    Parameters
    ----------
    lines : Lines
        With the columns of a recording: ``t`` or a rate, accelerometers, gyros.
    settings : AoaSettings
    every : float
        Interval [s] of the lines, in the time of the record: of the first row with an angle in each; 0 for a line each
        row.
    say : callable
        Called once each for sensors that are missing, at their range or silent, and for innovations that contradict
        the model.

    Raises
    ------
    RecordError
        Columns that are missing, or volts or counts without a scale; or, later, time that stays behind.
    InputError
        An earlier result that cannot be used as a prior.
    """

    kind = "aoa"

    def __init__(
        self,
        lines: Lines,
        settings: AoaSettings,
        every: float = 0.0,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        super().__init__(every, say)
        posterior = None
        if (prior := settings.estimator.prior) is not None:
            posterior, settings = load_posterior(prior, settings), corrected(prior, settings)
        self._settings, self._where = settings, lines.where
        self._sensors = Sensors(lines, settings)
        self._posterior, self._spatial = posterior, self._sensors.spatial
        named = [("t", "s"), *columns(settings)]
        self.columns = [f"{name} [{unit}]" for name, unit in named]
        self._changes = leans(settings, self._spatial)
        self._pose(settings)
        self._last: AoaState | None = None
        self.failure = ""
        """A sentence on angles that are not to be used, once the stream has ended; empty for good ones."""

    @property
    def deciding(self) -> Mapping[str, object]:
        """The problem, the calibrations, and all else that decides the digits."""
        of, settings = self._problem, self._settings
        return {
            "names": ", ".join(of.names),
            "mean": of.mean,
            "covariance": of.covariance,
            "places": of.places,
            "constants": of.constants,
            "stated": repr([(each, gravity_u(settings)) for each in self._changes]),
            "leaning": repr([each.mean.tolist() for each in self._leaning]),
            "geometry": of.geometry,
            **self._sensors.settings,
            "attitude": repr((settings.attitude, settings.alarm)),
            "zero": repr(settings.zero),
            "band": repr((settings.band, settings.estimator.snap)),
        }

    def _pose(self, settings: AoaSettings) -> None:
        """Pose the problem of a study, and those under changes."""
        self._problem = problem(settings, self._spatial, self._posterior)
        self._leaning = [leaning(self._problem, each, settings) for each in self._changes]
        self._live = LimitedLive(self._problem, where=self._where)
        self._others = [LimitedLive(of, where=self._where) for of in self._leaning]

    def begun(self) -> AoaState:
        """The state before the first row."""
        self._pose(self._settings)
        return AoaState(
            live=self._live.state,
            beside={
                each.name: Leaning(of.state, np.empty(0))
                for each, of in zip(self._changes, self._others, strict=True)
            },
            t=-math.inf, begun=math.nan, temperature=math.nan, heard=math.nan, beyond=math.nan, watch=unwatched(),
            unanswered=0, rows=0, head=Rows.of(self._problem.count + BESIDE + 1), choice=np.empty(0),
            zeroed=self._settings.zero is None,
        )  # fmt: skip

    def stepped(self, state: AoaState, sample: Sample) -> tuple[AoaState, Sequence[StreamRow]]:
        """The state after a row, and the lines of this row and of those that were held until now."""
        if state is not self._last:
            self._go_on_from(state)
        for number, finding in enumerate(self._sensors.remarks):
            self.say(finding, f"sensor {number}")
        state = state._replace(temperature=self._sensors.temperature(sample, state.temperature))
        values, saturated = self._sensors.measured(sample, state.temperature)
        for k, text in saturated:
            self.alarm("saturation", text, sample.t, f"saturation {k}")
        n = self._problem.count
        gyro, roll, yaw = values[n:].tolist()
        if sample.t > state.t:
            state = self._heard(state, sample.t, gyro)
            begun = sample.t if math.isnan(state.begun) else state.begun
            state = state._replace(t=sample.t, begun=begun)
        readings = np.array([*values[:n], gyro, math.nan, math.nan, roll, yaw])
        if self._waits(state) or not state.zeroed:
            state = state._replace(head=state.head.after(np.array([sample.t, *readings])))
        if self._needs_rate and not state.choice.size:
            state, answers, turned = self._rated(state)
        else:
            answers = self._live.feed(sample.t, readings)
            turned = [each.feed(sample.t, readings).angles.theta for each in self._others]
        state, outputs = self._lines(state._replace(live=self._live.state), answers, self._others, turned)
        decides = self._waits(state) and not self._stated and state.t - state.begun >= LIMITS.snap_time
        zero = None if state.zeroed else self._settings.zero
        if decides or (zero is not None and state.t > zero.end):
            state = self._again(state, decides)
        self._last = state
        return state, outputs

    def ended(self, state: AoaState) -> Sequence[StreamRow]:
        """The lines of rows that were still held."""
        self._go_on_from(state)
        outputs: list[StreamRow] = []
        if self._needs_rate and not state.choice.size:
            state, answers, turned = self._rated(state, last=True)
            state, outputs = self._lines(state, answers, self._others, turned)
        turned = [each.finish().angles.theta for each in self._others]
        state, rest = self._lines(state, self._live.finish(), self._others, turned)
        self.failure = self._bad(state)
        return [*outputs, *rest]

    def _bad(self, state: AoaState) -> str:
        """A sentence on a stream whose angles are not to be used, at its end; empty for good ones."""
        if 2 * state.unanswered >= state.rows:
            return f"{state.unanswered} rows of {state.rows} have no angle"
        count, limit = int(state.watch[ALL_COUNT]), nis_limit(int(state.watch[ALL_COUNT]))
        if count and state.watch[ALL] > limit * count:
            mean = state.watch[ALL] / count
            return f"the stream contradicts the model: mean NIS {mean:.4g}, expected at most {limit:.3g}"
        return ""

    @property
    def _needs_rate(self) -> bool:
        """True where the study states a band, for which the rate of rows must be known."""
        band = self._settings.band
        return band.low_pass not in (None, math.inf) or bool(band.notch)

    def _waits(self, state: AoaState) -> bool:
        """True as long as rows are kept: the rate is not known, or a choice not made."""
        if self._stated:
            return self._needs_rate and not state.choice.size
        return not (state.choice.size and state.choice[0])

    @property
    def _stated(self) -> bool:
        """True where the study states all that a stream would decide."""
        return self._settings.band.low_pass is not None and self._settings.estimator.snap is not None

    def _rated(self, state: AoaState, last: bool = False) -> tuple[AoaState, Answers, list[Array]]:
        """The state once the rate of rows is known, for the study's band, and answers for the rows until then."""
        head = state.head.filled
        stamps = head[later_rows(head[:, 0]), 0]
        if len(stamps) >= LIMITS.rate_rows or last:
            settings = with_rate(self._settings, stamps)
            self._pose(settings)
            state = state._replace(choice=choice_of(settings, final=False))
        else:
            head = head[:0]
        answers = self._live.feed_rows(head)
        return state, answers, [each.feed_rows(head).angles.theta for each in self._others]

    def _again(self, state: AoaState, decides: bool) -> AoaState:
        """The state after the fusion has gone over all rows so far once more: with delay, band and snap where it
        ``decides`` on them, and with the zero where that is over."""
        head, n = state.head.filled.copy(), self._problem.count
        recording = Recording(
            head[:, 0], head[:, 1 : n + 1], head[:, n + 1], head[:, n + 4 :], head[:, n + 2 : n + 4]
        )
        settings = chosen(self._settings, state.choice) if state.choice.size else self._settings
        if decides:
            settings = decided(recording, self._settings)
            for finding in of_vibration(self._settings, settings):
                self.tell(finding)
            state = state._replace(choice=choice_of(settings, final=True))
        if settings.zero is not None and state.t > settings.zero.end:
            head[:, n + 2 : n + 4] = self._zeroed(recording, settings)
            state = state._replace(zeroed=True)
        self._pose(settings)
        answers = self._live.feed_rows(head)
        state, _ = self._judged(state._replace(watch=unwatched()), answers)
        beside = {}
        for each, other in zip(self._changes, self._others, strict=True):
            other.feed_rows(head)
            beside[each.name] = Leaning(other.state, np.empty(0))
        state = state._replace(live=self._live.state, beside=beside)
        if self._waits(state) or not state.zeroed:
            return state
        return state._replace(head=Rows.of(head.shape[1]))

    def _zeroed(self, recording: Recording, settings: AoaSettings) -> Array:
        """Angles (k, 2) that the zero states for the rows of a recording, none where the model moves in its stretch;
        either is said."""
        try:
            zeroed = with_zero(recording, settings)
        except RecordError as error:
            self.tell(Finding("not_at_rest", f"the zero is left out: {error}", harm=EVERYTHING))
            return recording.zero_angle
        for finding in zeroed.findings:
            self.tell(finding)
        return zeroed.zero_angle

    def _go_on_from(self, state: AoaState) -> None:
        """Go on with the fusion, and those under changes, as a state left them."""
        self._pose(chosen(self._settings, state.choice) if state.choice.size else self._settings)
        self._live = LimitedLive(self._problem, state.live, self._where)
        changed = zip(self._leaning, state.beside.values(), strict=True)
        self._others = [LimitedLive(of, each.live, self._where) for of, each in changed]

    def _heard(self, state: AoaState, t: float, gyro: float) -> AoaState:
        """The state with the last row of the gyro, or an alarm where it is silent."""
        if math.isfinite(gyro) or math.isnan(state.heard):
            return state._replace(heard=t)
        if self._sensors.has_gyro and t - state.heard > LIMITS.silent_time:
            text = f"gyro: no number for {LIMITS.silent_time:g} s; angles go on from accelerometers alone, less well"
            self.alarm("gyro_missing", text, t, "silence")
        return state

    def _judged(self, state: AoaState, answers: Answers) -> tuple[AoaState, Array]:
        """The state with innovations counted, and the NIS (k,) of each row; an alarm where it contradicts the model."""
        watch = state.watch.copy()
        nis = watched(answers.t, answers.innovations, self._problem.constants.gate, watch)
        state = state._replace(watch=watch)
        told = [] if self._waits(state) else np.flatnonzero(nis > LIMITS.mean_nis)[:1].tolist()
        for k in told:
            text = (
                f"NIS is {nis[k]:.3g} on average over {LIMITS.watched_time:g} s, expected 1 or less: the rows "
                "contradict the model or the stated noise"
            )
            self.alarm("excess_scatter", text, float(answers.t[k]))
        return state, nis

    def _lines(
        self, state: AoaState, answers: Answers, others: Sequence[LimitedLive], turned: Sequence[Array]
    ) -> tuple[AoaState, list[StreamRow]]:
        """The state, and the lines; ``turned`` is theta under changes."""
        lines: list[StreamRow] = []
        rest, beside, changed = len(answers.t), {}, []
        for (name, before), live, theta in zip(state.beside.items(), others, turned, strict=True):
            theta = np.append(before.theta, theta)
            # a filter that has lost theta, or has it anew, alone is out of step until both have it
            changed.append(np.append(theta[:rest], np.full(max(rest - len(theta), 0), np.nan)))
            beside[name] = Leaning(live.state, theta[rest:])
        waits = self._waits(state)
        state, nis = self._judged(state._replace(beside=beside), answers)
        angles = widened(replace(answers.angles, nis=nis), self._settings, self._changes, changed)
        values = rows(angles, self._settings)
        for t, row in zip(answers.t.tolist(), values.tolist(), strict=True):
            if waits and row[_STATUS] == 0.0:
                row[_STATUS] = SUSPECT
            state = state._replace(beyond=watched_limits(self._settings, t, row, state.beyond, self.tell))
            # rows without an angle are of no interval
            lines.append(
                StreamRow(t if math.isfinite(row[0]) else math.nan, functools.partial(list, [t, *row]))
            )
        without = int(np.isnan(answers.angles.theta).sum())
        return state._replace(unanswered=state.unanswered + without, rows=state.rows + len(answers.t)), lines
