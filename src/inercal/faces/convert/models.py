"""The instrument of any calibration, for use: `model_of` finds which it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from inercal.faces.convert import correct, over_temperature, platform, rate_test, table, table_result
from inercal.faces.convert.correction import (
    CalibratedInstrument,
    Correction,
    temperature_range,
    uncertain,
    watching,
)
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate

TABLE = "calibrate turntable"
"""Command whose estimates are of an instrument on a table."""


@dataclass(frozen=True)
class InUse:
    """A ``model`` that watches the temperature of a record: ``span`` is that of its calibration, if it says."""

    model: CalibratedInstrument
    span: tuple[float, float, str] | None

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of the model; raises `InputError` as that does."""
        return watching(self.model.correction(record, invert), record, self.span)


def model_of(estimate: Estimate, where: object = "calibration", uncertainty: bool = False) -> InUse:
    """The instrument of a calibration: of an IMU, on a table, of a rate test, a platform, or over temperature.

    With ``uncertainty`` its corrections also give the standard uncertainty of each corrected value. Raises
    `InputError`, naming ``where``, for an estimate that is no such calibration, or cannot be used.
    """

    def make(each: Estimate) -> CalibratedInstrument:
        return _model(each, where)

    if not uncertainty:
        model = make(estimate)
    else:
        model = uncertain(make, table_result.with_stated(estimate), where)
    return InUse(model, temperature_range(estimate))


def worth_knowing(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """Findings of whoever uses a calibration: a bad verdict, terms that are not applied."""
    verdict = f"the calibration ended {estimate.status.value}: {estimate.message}"
    bad = () if estimate.status is Status.OK else (Finding("bad_verdict", verdict, str(where)),)
    kind = {platform.COMMAND: platform, over_temperature.COMMAND: over_temperature, TABLE: table_result}.get(
        estimate.command, correct
    )
    if _is_rate_test(estimate):
        kind = rate_test
    return (*bad, *kind.not_applied(estimate, where))


def _model(estimate: Estimate, where: object) -> CalibratedInstrument:
    """The model of an estimate, by the command it is from."""
    match estimate.command:
        case platform.COMMAND:
            return platform.platform_model(estimate, where)
        case "temperature":
            return over_temperature.over_temperature(estimate, lambda each: _by_values(each, where), where)
        case "calibrate turntable" if _is_rate_test(estimate):
            return rate_test.rate_gyros(estimate, where)
        case "calibrate turntable":
            return table_result.table_instrument(estimate, where)
        case _:
            return correct.imu_model(estimate, where)


def _by_values(estimate: Estimate, where: object) -> Callable[[Mapping[str, Any]], CalibratedInstrument]:
    """A function from values of the terms to a model, by the calibration at the reference temperature."""
    model = _model(estimate, where)
    match model:
        case correct.ImuModel():
            return lambda values: correct.imu_of(values, model.units)
        case table.TableInstrument() | rate_test.RateGyros():
            return lambda values: replace(model, values={**model.values, **values})
        case _:
            raise InputError(
                where,
                f"holds a temperature model of `inercal {estimate.command}`, expected one of an instrument",
            )


def _is_rate_test(estimate: Estimate) -> bool:
    """True for a rate test, whose result has a row for each rate."""
    return estimate.command == TABLE and "rates" in estimate.result
