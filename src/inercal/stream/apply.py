"""A calibration applied to a stream: the digits are those of `inercal.convert.correct.apply_to` on a file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from inercal.convert.correct import ImuModel, correction
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
    model : ImuModel
    invert : bool
        From true values to outputs of the instrument.

    Raises
    ------
    InputError
        As `inercal.convert.correct.correction` does.
    """

    kind = "apply"

    def __init__(self, lines: Lines, model: ImuModel, invert: bool = False) -> None:
        self._correct = correction(lines.record, model, invert)
        self._labelled = lines.labelled
        names = list(lines.record.columns)
        self._places = [[names.index(f"{sensor}_{axis}") for axis in "xyz"] for sensor in self._correct.units]
        titles = ["t [s]"]
        for column in lines.record.columns.values():
            inside = column.axis != "" and column.sensor in self._correct.units
            unit = self._correct.units[column.sensor] if inside else column.unit
            titles.append(f"{column.name} [{unit.symbol}]")
        self.columns = [*titles, *(["label"] if lines.labelled else [])]

    @property
    def settings(self) -> Mapping[str, object]:
        """The coefficients and their direction."""
        model = self._correct.model
        triads = {"acc": model.accelerometer, **({} if model.gyro is None else {"gyro": model.gyro})}
        return {**triads, "g": model.g_sensitivity, "units": model.units, "invert": self._correct.invert}

    def initial(self) -> State:
        """Nothing: a sample knows nothing of those before."""
        return {}

    def step(self, state: State, sample: Sample) -> tuple[State, Output]:
        """The corrected sample."""
        values = sample.values.copy()
        triads = [np.array([values[i] for i in places]) for places in self._places]
        acc, gyro = self._correct(triads[0], triads[1] if len(triads) > 1 else None)
        for places, new in zip(self._places, (acc, gyro), strict=False):
            if new is not None:
                for i, value in zip(places, new.tolist(), strict=True):
                    values[i] = value
        return state, [sample.t, *values, *([quoted(sample.label)] if self._labelled else [])]
