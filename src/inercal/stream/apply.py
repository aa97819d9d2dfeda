"""A calibration applied to a stream: the digits are those of `inercal.convert.correct.apply_to` on a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inercal.convert.correct import Model
from inercal.records.write.text import quoted
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

    Raises
    ------
    InputError
        As the ``correction`` of the model does.
    """

    kind = "apply"

    def __init__(self, lines: Lines, model: Model, invert: bool = False) -> None:
        self._correct = model.correction(lines.record, invert)
        self._labelled = lines.labelled
        names = list(lines.record.columns)
        self._places = {
            sensor: [names.index(f"{sensor}_{axis}") for axis in "xyz"] for sensor in self._correct.units
        }
        titles = ["t [s]"]
        for column in lines.record.columns.values():
            inside = column.axis != "" and column.sensor in self._correct.units
            unit = self._correct.units[column.sensor] if inside else column.unit
            titles.append(f"{column.name} [{unit.symbol}]")
        self.columns = [*titles, *(["label"] if lines.labelled else [])]

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
        triads = {sensor: np.array([values[i] for i in places]) for sensor, places in self._places.items()}
        for sensor, triad in self._correct(triads).items():
            for i, value in zip(self._places[sensor], triad.tolist(), strict=True):
                values[i] = value
        return state, [[sample.t, *values, *([quoted(sample.label)] if self._labelled else [])]]

    def finish(self, state: State) -> Sequence[Output]:
        """Nothing."""
        return ()
