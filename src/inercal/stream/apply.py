"""A calibration applied to a stream: the digits are those of `inercal.convert.correction.apply_to` on a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from inercal.convert.correction import Model
from inercal.findings import Finding
from inercal.records.write import quoted
from inercal.stream.lines import Lines, Sample
from inercal.stream.run import Output

State = Mapping[str, float]


class Apply:
    """Corrects each sample by itself, so that its state is empty (`inercal.stream.run.Recursive`).

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
        model: Model,
        invert: bool = False,
        say: Callable[[Finding], None] = lambda _: None,
    ) -> None:
        self._correct = model.correction(lines.record, invert)
        self._say, self._ranges = say, dict(self._correct.ranges)
        for finding in self._correct.findings:
            say(finding)
        self._labelled = lines.labelled
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
        """Nothing: a sample knows nothing of those before."""
        return {}

    def step(self, state: State, sample: Sample) -> tuple[State, Sequence[Output]]:
        """The corrected sample."""
        values = sample.values.copy()
        results = self._correct({name: np.asarray(values[i]) for name, i in self._reads.items()})
        beyond = [name for name, (low, high, _) in self._ranges.items() if not low <= results[name] <= high]
        for name in beyond:
            if results[name] == results[name]:
                span = {name: self._ranges.pop(name)}
                self._say(*replace(self._correct, ranges=span).outside(results))
        for i, name in self._writes:
            values[i] = float(results[name])
        values += [float(results[name]) for name in self._correct.appends]
        return state, [[sample.t, *values, *([quoted(sample.label)] if self._labelled else [])]]

    def finish(self, state: State) -> Sequence[Output]:
        """Nothing."""
        return ()
