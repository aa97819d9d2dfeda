"""A calibration applied to a stream: the digits are those of `inercal.faces.convert.correction.apply_to` on a file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.faces.convert.correction import CalibratedInstrument, Samples
from inercal.faces.convert.motion import HEAD, interval
from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.run import Output
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.write import quoted


class Held(NamedTuple):
    """Rows that are held, one after the other: stamps ``t`` (n,), ``values`` (n, columns), ``labels`` a line each, the
    interval ``step`` of all rows, NaN before it is known, and the number of those that were ``given``."""

    t: Array
    values: Array
    labels: str = ""
    step: float = math.nan
    given: int = 0


State = Mapping[str, float] | Held


class Apply:
    """Corrects each sample by itself, with nothing held; or, where the correction needs the rows beside a row, as soon
    as these are there, with them held (`inercal.faces.stream.run.Recursive`).

    Parameters
    ----------
    lines : Lines
        The columns to correct.
    model : Model
    invert : bool
        From true values to outputs of the instrument.
    say : callable
        Told what is not corrected, and once of each column of the first sample beyond the range of the calibration.

    Raises
    ------
    InputError
        As the ``correction`` of the model does.
    """

    kind = "apply"

    def __init__(
        self,
        lines: Lines,
        model: CalibratedInstrument,
        invert: bool = False,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        self._correct = model.correction(lines.record, invert)
        self._say, self._ranges = say, dict(self._correct.ranges)
        for finding in self._correct.findings:
            say(finding)
        self._labelled, self._width, self._uneven_said = lines.labelled, len(lines.record.columns), False
        names = list(lines.record.columns)
        self._reads = {name: names.index(name) for name in self._correct.reads}
        written = {name: (name, lines.record[name].unit) for name in names} | dict(self._correct.writes)
        self._writes = [(names.index(old), written[old][0]) for old in self._correct.writes]
        titles = [*written.values(), *self._correct.appends.items()]
        self.columns = ["t [s]", *(f"{name} [{unit.symbol}]" for name, unit in titles)]
        self.columns += ["label"] if lines.labelled else []

    @property
    def settings(self) -> Mapping[str, object]:
        """The coefficients and their direction."""
        return self._correct.settings

    def initial(self) -> State:
        """Nothing: a sample by itself knows nothing of those before."""
        return {} if self._correct.reach is None else Held(np.empty(0), np.empty((0, self._width)))

    def step(self, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
        """The corrected sample, or those before it whose neighbours are there now."""
        if not isinstance(state, Held):
            values = sample.values.copy()
            results = self._correct({name: np.asarray(values[i]) for name, i in self._reads.items()})
            return state, [self._line(sample.t, values, results, sample.label)]
        t, values_held = np.append(state.t, sample.t), np.vstack([state.values, sample.values])
        labels = state.labels + sample.label.replace("\n", " ") + "\n"
        step = interval(t) if math.isnan(state.step) and len(t) >= HEAD else state.step
        return self._given(Held(t, values_held, labels, step, state.given), ended=False)

    def _given(self, held: Held, ended: bool) -> tuple[Held, Sequence[Output]]:
        """The rows whose neighbours are there, or all where the stream has ``ended``; those of no more use are left."""
        t, step = held.t, held.step
        if math.isnan(step):
            if not ended and len(t) < HEAD:
                return held, ()
            step = interval(t)
        reach = self._correct.rows(step)
        end = len(t) if ended else len(t) - reach
        if end <= held.given:
            return held, ()
        samples = {name: held.values[:, i] for name, i in self._reads.items()}
        results = self._correct({**samples, "t": t, "step": np.array(step)})
        lines, labels = [], held.labels.split("\n")
        for k in range(held.given, end):
            of_row = {name: np.asarray(x)[k] for name, x in results.items() if name != "step"}
            lines.append(self._line(float(t[k]), held.values[k].tolist(), of_row, labels[k]))
        drop = max(end - reach, 0)
        left = "\n".join(labels[drop:])
        return Held(t[drop:], held.values[drop:], left, held.step, end - drop), lines

    def _line(self, t: float, values: list[float], results: Samples, label: str) -> Output:
        """An output line."""
        if self._correct.reach is not None and not self._uneven_said and not results["applied"]:
            self._uneven_said = True
            self._say(*replace(self._correct, ranges={}).outside({"applied": np.zeros(1)}))
        beyond = [name for name, (low, high, _) in self._ranges.items() if not low <= results[name] <= high]
        for name in beyond:
            if results[name] == results[name]:
                span = {name: self._ranges.pop(name)}
                self._say(*replace(self._correct, ranges=span).outside(results))
        for i, name in self._writes:
            values[i] = float(results[name])
        values += [float(results[name]) for name in self._correct.appends]
        return [t, *values, *([quoted(label)] if self._labelled else [])]

    def finish(self, state: State) -> Sequence[Output]:
        """The rows that are held."""
        return self._given(state, ended=True)[1] if isinstance(state, Held) else ()
