"""A wind-tunnel model measured while it moves: rows in, angles and their uncertainties out, each at once.

The causal fusion of `inercal.aoa` goes on by one row at a time, to the digits that it gives on the whole file, and
answers each row with one line: the first ones, and those after the angle was lost, are held until the filter can start
(`inercal.aoa.fusion.live`). `inercal.aoa.reading.from_record` calibrates the sensors, and samples at a range are left
out. A stream does not see faults that only a whole recording shows: sensors that are flat at an extreme below their
range, or stuck, and a model that moves in the stretch of the study's zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from inercal.aoa.fusion.live import Answers, Live, LiveState
from inercal.aoa.fusion.problem import problem
from inercal.aoa.limits import LIMITS
from inercal.aoa.reading.from_record import at_range, check_axes, check_unit, indication, of_sensors
from inercal.aoa.reading.wind_off_zero import angle_at
from inercal.aoa.result.carry_over import corrected
from inercal.aoa.result.carry_over import load as load_posterior
from inercal.aoa.result.columns import columns, rows
from inercal.aoa.result.systematic import gravity_u, leaning, leans, widened
from inercal.aoa.settings import GYROS, AoaSettings
from inercal.arrays import Array
from inercal.findings import Finding
from inercal.records.column import Column
from inercal.stream.lines import Lines, Sample
from inercal.stream.run import Alarms, Output, Slots

# bits of `AoaState.alarms`; from the last on one for each sensor
_CONTRADICTION, _SILENCE, _SATURATED = range(3)


class Leaning(NamedTuple):
    """The fusion under a change of a stated input: its state, and theta [rad] of rows not yet answered without it."""

    live: LiveState
    theta: Array


class AoaState(NamedTuple):
    """State after a row.

    ``live`` is the state of the fusion, ``beside`` those under changes of gravity and roll, by name; ``t`` [s] the
    latest stamp, ``begun`` [s] the first one (NaN before); ``temperature`` [degC] the last known one; ``heard`` [s] the
    last row with a number of the gyro. ``nis`` and ``scalars``: sum and number of the squared innovations since
    ``window`` [s]. ``remarked``: the findings on
    the sensors were given; ``slots`` that of the last line.
    """

    live: LiveState
    beside: Mapping[str, Leaning]
    t: float
    begun: float
    temperature: float
    heard: float
    nis: float
    scalars: int
    window: float
    remarked: bool
    alarms: Alarms
    slots: Slots


class Aoa:
    """Measures angles row by row (`inercal.stream.run.Recursive`); columns as `inercal.aoa.result.columns` has them.

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
        posterior = None
        if (prior := settings.estimator.prior) is not None:
            posterior, settings = load_posterior(prior, settings), corrected(prior, settings)
        self._settings, self._every, self._say, self._where = settings, every, say, lines.where
        record, names = lines.record, settings.layout.names
        there = [name for name in names if name in record]
        check_axes(there, record.columns, settings.layout, lines.where)
        gyros = [name for name in GYROS if name in record]
        spatial = all(name in gyros for name in GYROS[1:])
        if not spatial:
            settings.attitude.check_pitch_shows()
        self._remarks = of_sensors(there, gyros, record, settings)
        places = list(record.columns)
        used = [*there, *(GYROS if spatial else GYROS[:1])]
        self._sensors: list[tuple[int, int, Column]] = []
        for k, name in enumerate((*names, *GYROS)):
            if name in record and name in used:
                check_unit(record[name], settings.calibration(name), lines.where)
                self._sensors.append((k, places.index(name), record[name]))
        self._temperature = places.index("temperature") if "temperature" in record else -1
        self._has_gyro = GYROS[0] in record
        self._problem = problem(settings, spatial, posterior)
        self.columns = [f"{name} [{unit}]" for name, unit in [("t", "s"), *columns(settings.attitude)]]
        self._changes = leans(settings, spatial)
        self._leaning = [leaning(self._problem, each, settings) for each in self._changes]
        self._live = Live(self._problem, where=lines.where)
        self._others: list[Live] = []
        self._after: AoaState | None = None

    @property
    def settings(self) -> Mapping[str, object]:
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
            "sensors": repr([(name, settings.calibration(name)) for name in (*of.layout.names, *GYROS)]),
            "attitude": repr(settings.attitude),
            "zero": repr(settings.zero),
            "columns": repr([(k, place, column.name) for k, place, column in self._sensors]),
            "every": self._every,
        }

    def initial(self) -> AoaState:
        """The state before the first row."""
        return AoaState(
            live=Live(self._problem).state,
            beside={
                each.name: Leaning(Live(of).state, np.empty(0))
                for each, of in zip(self._changes, self._leaning, strict=True)
            },
            t=-math.inf, begun=math.nan, temperature=math.nan,
            heard=math.nan, nis=0.0, scalars=0, window=math.nan, remarked=False, alarms=Alarms(), slots=Slots(),
        )  # fmt: skip

    def step(self, state: AoaState, sample: Sample) -> tuple[AoaState, Sequence[Output]]:
        """The state after a row, and the lines of this row and of those that were held until now."""
        if state is not self._after:
            self._live, self._others = self._from(state)
        if self._temperature >= 0 and math.isfinite(sample.values[self._temperature]):
            state = state._replace(temperature=sample.values[self._temperature])
        state, values = self._measured(self._remarked(state), sample)
        n = self._problem.count
        later = sample.t > state.t
        zero_angle = (math.nan, math.nan)
        gyro, roll, yaw = values[n:].tolist()
        if later:
            zero_angle = self._zero(state, sample.t, values[:n])
            state = self._heard(state, sample.t, gyro)
        read = (sample.t, values[:n], gyro, roll, yaw, *zero_angle)
        answers = self._live.feed(*read)
        turned = [each.feed(*read).angles.theta for each in self._others]
        if later:
            begun = sample.t if math.isnan(state.begun) else state.begun
            state = state._replace(t=sample.t, begun=begun)
        state = self._judged(state, answers)._replace(live=self._live.state)
        state, outputs = self._lines(state, answers, self._others, turned)
        self._after = state
        return state, outputs

    def finish(self, state: AoaState) -> Sequence[Output]:
        """The lines of rows that were still held."""
        live, others = self._from(state)
        return self._lines(state, live.finish(), others, [each.finish().angles.theta for each in others])[1]

    def _from(self, state: AoaState) -> tuple[Live, list[Live]]:
        """The fusion, and those under changes, as a state left them."""
        changed = zip(self._leaning, state.beside.values(), strict=True)
        return (
            Live(self._problem, state.live, self._where),
            [Live(of, each.live, self._where) for of, each in changed],
        )

    def _measured(self, state: AoaState, sample: Sample) -> tuple[AoaState, Array]:
        """Measured values of a row, (N + 3,) in SI, gyros last; NaN where missing or saturated."""
        values = np.full(self._problem.count + len(GYROS), np.nan)
        temperature = None if math.isnan(state.temperature) else state.temperature
        for k, place, column in self._sensors:
            how = self._settings.calibration(column.name)
            indicated = indication(column, np.array(sample.values[place]))
            measured = how.measured(indicated, temperature)
            if not at_range(indicated, measured, how):
                values[k] = measured
                continue
            text = f"{column.name}: at its range, such samples are left out"
            state = self._alarm(state, _SATURATED + k, "saturation", text, sample.t)
        return state, values

    def _remarked(self, state: AoaState) -> AoaState:
        """The state once the findings on the sensors are given."""
        if state.remarked:
            return state
        for finding in self._remarks:
            self._say(finding)
        return state._replace(remarked=True)

    def _zero(self, state: AoaState, t: float, acc: Array) -> tuple[float, float]:
        """The angle that is stated for a row, and its standard uncertainty [rad]; NaN where there is none."""
        zero = self._settings.zero
        if zero is None or not np.isfinite(acc).all():
            return math.nan, math.nan
        return angle_at(zero, t, state.t)

    def _heard(self, state: AoaState, t: float, gyro: float) -> AoaState:
        """The state with the last row of the gyro, or an alarm where it is silent."""
        if math.isfinite(gyro) or math.isnan(state.heard):
            return state._replace(heard=t)
        if self._has_gyro and t - state.heard > LIMITS.silent_time:
            text = f"gyro: no number for {LIMITS.silent_time:g} s; angles go on from accelerometers alone, less well"
            return self._alarm(state, _SILENCE, "gyro_missing", text, t)
        return state

    def _judged(self, state: AoaState, answers: Answers) -> AoaState:
        """The state with innovations counted, and an alarm where a window of them contradicts the model.

        Each counts as far as the gate lets it through, so that a single spike is no alarm.
        """
        gate = self._problem.constants.gate
        for t, innovations in zip(answers.t.tolist(), answers.innovations, strict=True):
            squared = np.minimum(np.square(innovations[np.isfinite(innovations)]), gate)
            if not squared.size or t - state.begun < LIMITS.settling_time:
                continue
            window = t if math.isnan(state.window) else state.window
            nis, scalars = state.nis + float(squared.sum()), state.scalars + squared.size
            state = state._replace(nis=nis, scalars=scalars, window=window)
            if t - window < LIMITS.watched_time:
                continue
            if scalars >= LIMITS.watched_innovations and nis > LIMITS.mean_nis * scalars:
                text = (
                    f"NIS is {nis / scalars:.3g} on average over {LIMITS.watched_time:g} s, expected 1 or less: "
                    "the rows contradict the model or the stated noise"
                )
                state = self._alarm(state, _CONTRADICTION, "excess_scatter", text, t)
            state = state._replace(nis=0.0, scalars=0, window=math.nan)
        return state

    def _alarm(self, state: AoaState, bit: int, code: str, text: str, t: float) -> AoaState:
        """The state with an alarm given, once."""
        return state._replace(alarms=state.alarms.give(bit, code, text, t, self._say))

    def _lines(
        self, state: AoaState, answers: Answers, others: Sequence[Live], turned: Sequence[Array]
    ) -> tuple[AoaState, list[Output]]:
        """The state with the slots of lines, and the lines that are due; ``turned`` is theta under changes."""
        outputs: list[Output] = []
        rest, beside, changed = len(answers.t), {}, []
        for (name, before), live, theta in zip(state.beside.items(), others, turned, strict=True):
            theta = np.append(before.theta, theta)
            # a filter that has lost theta, or has it anew, alone is out of step until both have it
            changed.append(np.append(theta[:rest], np.full(max(rest - len(theta), 0), np.nan)))
            beside[name] = Leaning(live.state, theta[rest:])
        angles = widened(answers.angles, self._settings, self._changes, changed)
        state = state._replace(beside=beside)
        values = rows(angles, self._settings.attitude)
        for t, row in zip(answers.t.tolist(), values.tolist(), strict=True):
            if self._every > 0.0:
                slots = state.slots.at(t, self._every) if math.isfinite(row[0]) else None
                if slots is None:
                    continue
                state = state._replace(slots=slots)
            outputs.append([t, *row])
        return state, outputs
