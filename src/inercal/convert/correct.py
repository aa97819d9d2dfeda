"""A calibration applied to a recording: outputs to truth, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from inercal.arrays import Array
from inercal.errors import InputError
from inercal.estimate.result import Estimate
from inercal.findings import Finding
from inercal.instruments.triad import TriadModel, apart, triad_from_terms
from inercal.records.column import Column
from inercal.records.record import Record
from inercal.units import Unit, parse_unit

Samples = Mapping[str, Array]


@dataclass(frozen=True)
class Correction:
    """Correction of the samples of a record, or its inverse.

    ``work`` takes samples by sensor, times ``factors``, to results in ``units``; ``settings`` hold all that decides
    them.
    """

    work: Callable[[Samples], Samples]
    units: Mapping[str, Unit]
    factors: Mapping[str, float]
    settings: Mapping[str, object]

    def __call__(self, samples: Samples) -> Samples:
        """Results (*batch, 3) for samples (*batch, 3) of all its sensors, in the units of the record."""
        return self.work({sensor: samples[sensor] * factor for sensor, factor in self.factors.items()})


class Model(Protocol):
    """An instrument that a calibration describes."""

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record, whose columns may be without samples yet; raises `InputError`."""


@dataclass(frozen=True)
class ImuModel:
    """The instrument that a calibration describes, forward: truth to indication.

    ``units`` are those of the outputs it was calibrated for, by sensor; ``gyro`` is None where only the
    accelerometers were calibrated; ``g_sensitivity`` (3, 3) [gyro output/(m/s^2)].
    """

    accelerometer: TriadModel
    gyro: TriadModel | None
    g_sensitivity: Array
    units: dict[str, str]

    def correct(self, acc: Array, gyro: Array | None) -> tuple[Array, Array | None]:
        """Specific force (*batch, 3) [m/s^2] and rate (*batch, 3) [rad/s] from outputs."""
        f = self.accelerometer.correct(acc)
        if gyro is None or self.gyro is None:
            return f, None
        return f, self.gyro.correct(gyro - self._drift(f))

    def indicate(self, f: Array, omega: Array | None) -> tuple[Array, Array | None]:
        """Outputs from specific force [m/s^2] and rate [rad/s]: the inverse of `correct`."""
        acc = self.accelerometer.indicate(f)
        if omega is None or self.gyro is None:
            return acc, None
        return acc, self.gyro.indicate(omega) + self._drift(f)

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record, whose columns may be without samples yet; with ``invert`` it holds true values.

        Raises
        ------
        InputError
            Units of another kind than those of the calibration, missing or uncalibrated channels, two clocks. A gyro
            that the calibration does not cover is an error, not passed on as if it were corrected.
        """
        acc = record.triad("acc")
        gyro = record.triad("gyro") if "gyro_x" in record else None
        if gyro is not None:
            if self.gyro is None:
                raise InputError(
                    gyro.source.path, "has a gyro, but the calibration is of accelerometers alone"
                )
            if gyro.t is not acc.t and not np.array_equal(gyro.t, acc.t):
                raise InputError(
                    gyro.source.path, "gyro and accelerometers have different clocks, expected one"
                )
        truth = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}
        output = {sensor: parse_unit(symbol) for sensor, symbol in self.units.items()}
        units, factors = {}, {}
        for triad in (acc, gyro):
            if triad is None:
                continue
            wanted = (truth if invert else output).get(triad.sensor, triad.unit)
            if triad.unit.dimension != wanted.dimension:
                raise InputError(
                    triad.source.path,
                    f"{triad.sensor} is in {triad.unit.symbol}, expected {wanted.symbol} as "
                    f"{'true values' if invert else 'the instrument was calibrated'}",
                )
            units[triad.sensor] = (output if invert else truth).get(triad.sensor, triad.unit)
            factors[triad.sensor] = triad.unit.factor / wanted.factor  # exactly 1 for one and the same unit
        both = self.indicate if invert else self.correct

        def work(samples: Samples) -> Samples:
            results = zip(("acc", "gyro"), both(samples["acc"], samples.get("gyro")), strict=True)
            return {sensor: corrected for sensor, corrected in results if corrected is not None}

        triads = {"acc": self.accelerometer, **({} if self.gyro is None else {"gyro": self.gyro})}
        settings = {**triads, "g": self.g_sensitivity, "units": self.units, "invert": invert}
        return Correction(work, units, factors, settings)

    def _drift(self, f: Array) -> Array | float:
        """g-sensitive drift [gyro output]; where there is none, a missing specific force takes no part."""
        return apart(self.g_sensitivity, f) if self.g_sensitivity.any() else 0.0


def imu_model(estimate: Estimate, where: object = "calibration") -> ImuModel:
    """The instrument of an estimate of `calibrate imu`; raises `InputError`, naming ``where``, for any other."""
    if estimate.command in ("compare", "temperature"):
        raise InputError(where, f"found a result of `inercal {estimate.command}`, expected a calibration")
    values = {name: p.value for name, p in estimate.parameters.items()}
    units = estimate.result.get("unit", {})
    axes = [f"{scale}_{axis}" for scale in ("K1", "S") if f"{scale}_x" in values for axis in "xyz"]
    complete = "K1_x" in values and values.keys() >= set(axes) and isinstance(units, Mapping)
    if not complete or not np.all(np.isfinite(estimate.values)):
        names = ", ".join(estimate.names) or "no coefficients"
        raise InputError(where, f"found {names}, expected the coefficients of an IMU")
    accelerometer = triad_from_terms(values, "K1", "M", "K0")
    gyro = triad_from_terms(values, "S", "T", "D_F") if "S_x" in values else None
    for name, triad in (("accelerometers", accelerometer), ("gyro", gyro)):
        if triad is not None and not _invertible(triad):
            raise InputError(
                where, f"the scale factors of the {name} cannot be inverted, expected three independent axes"
            )
    for unit in units.values():
        parse_unit(str(unit), where)
    g = [[values.get(f"G_{i}{j}", 0.0) for j in "xyz"] for i in "xyz"]
    symbols = {str(sensor): str(unit) for sensor, unit in units.items()}
    return ImuModel(accelerometer, gyro, np.array(g), symbols)


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: the terms of a calibration that `imu_model` leaves out, for they do not go with any recording."""
    if not any(name.startswith("D_R_") for name in estimate.names):
        return ()
    t0 = estimate.result.get("bias_time_s")
    time = f"{t0:.6g} s" if isinstance(t0, int | float) else "the time bias_time_s"
    return (
        Finding(
            "not_held",
            "the drift D_R of the gyro bias belongs to the recording of the calibration and is not applied: "
            f"D_F is the bias at {time} of that",
            str(where),
        ),
    )


@np.errstate(all="ignore")
def _invertible(triad: TriadModel) -> bool:
    """True if outputs can be taken back to finite inputs."""
    gain = triad.gain
    return bool(
        np.isfinite(gain).all()
        and np.linalg.matrix_rank(gain) == 3
        and np.isfinite(np.linalg.inv(gain)).all()
    )


def apply_to(record: Record, model: Model, invert: bool = False) -> Record:
    """Correct the sensors of a record that a model covers, all other columns unchanged; raises as `correction` does.

    With ``invert`` the record holds true values and the outputs of the instrument are made of them.
    """
    correct = model.correction(record, invert)
    triads = [record.triad(sensor) for sensor in correct.units]
    corrected = correct({triad.sensor: triad.values for triad in triads})
    columns = dict(record.columns)
    for triad in triads:
        for i, axis in enumerate("xyz"):
            name, values = f"{triad.sensor}_{axis}", np.ascontiguousarray(corrected[triad.sensor][:, i])
            columns[name] = Column(name, correct.units[triad.sensor], values, triad.t, triad.source)
    return Record(columns, record.findings, record.sources, record.labels)
