"""The result of a self-calibration in use: corrected commands of the platform, corrected gyros and accelerometers.

The platform turns at ``w_p = (1 + M) w + kg0`` where ``w`` is commanded
(`inercal.systems.selfcal.platform.coefficients`). For it to turn at a wanted rate the command is

    w = (1 + M)^-1 (w_p - kg0),

of which the familiar ``w_p - M w_p - kg0`` is the first order: that leaves M (M w_p + kg0), at 1 deg/s and
misalignments of 100 arcsec 0.001 deg/h, as much as a good calibration still sees, so the inverse is taken. Gyros that
took the place of the commands are corrected the other way: ``w_p`` of the rate ``w`` they measured. What else the
result has of rates, outputs and sag is corrected for too (`inercal.faces.convert.platform_rig`); what is of angles,
times and places is named.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from inercal.faces.convert.correction import Correction, Samples, factor_of, one_clock
from inercal.faces.convert.platform_rig import RigPlatform, applied, at_port, in_need
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.platform.coefficients import NAMES
from inercal.systems.selfcal.platform.states import KIND_OF

COMMAND = "selfcal"
"""Command whose estimates are of a platform."""

_WORST = 1e6
"""Condition number beyond which a gain is not inverted; a platform has one near 1."""

#: sensor -> dimension of its channels
_SENSORS = {"wc": "rate", "gyro": "rate", "acc": "acceleration"}


@dataclass(frozen=True)
class PlatformModel:
    """The platform that a self-calibration describes, in SI.

    ``platform`` takes commanded rates to those at which it turns, ``accelerometer`` specific force to outputs; ``rig``
    has what is beside these, at ``temperature`` [degC] nothing by temperature, None where that is not known.
    """

    platform: TriadModel
    accelerometer: TriadModel
    rig: RigPlatform
    temperature: float | None = None

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record, whose columns may be without samples yet; all keep their units.

        Of wanted rates ``wc`` it makes commands, of measured rates ``gyro`` those of the platform, of outputs ``acc``
        specific force; with ``invert`` the other way round.

        Raises `InputError`: none of these channels, an axis is missing, or they are not in physical units.
        """
        triads = [record.triad(sensor) for sensor in _SENSORS if f"{sensor}_x" in record]
        if not triads:
            where = ", ".join(source.path for source in record.sources) or "record"
            names = ", ".join(record.columns) or "no column"
            raise InputError(where, f"found {names}, expected wc_x to z, gyro_x to z or acc_x to z")
        for triad in triads:
            dimension = _SENSORS[triad.sensor]
            if triad.unit.dimension != dimension:
                raise InputError(
                    triad.source.path,
                    f"{triad.sensor} is in {triad.unit.symbol}, expected a unit of {dimension}",
                )
        units = {triad.sensor: triad.unit for triad in triads}
        columns = [(sensor, f"{sensor}_{axis}") for sensor in units for axis in "xyz"]
        warm, left_out = self._beside(record, units.keys())
        clock = [name for _, name in columns]
        if warm:
            one_clock(record, [*clock, "temperature"])
        elif not self.rig.linear and "acc" in units:
            one_clock(record, clock)

        def work(samples: Samples) -> Samples:
            given = {
                sensor: np.stack([samples[f"{sensor}_{axis}"] for axis in "xyz"], axis=-1) for sensor in units
            }
            above = samples["temperature"] - (self.temperature or 0.0) if warm else np.zeros(())
            results: dict[str, Array] = {}
            for sensor, corrected in self._worked(given, above[..., None], invert).items():
                in_unit = corrected / units[sensor].factor
                results |= {f"{sensor}_{axis}": in_unit[..., i] for i, axis in enumerate("xyz")}
            return results

        reads = {name: (units[sensor].factor, 0.0) for sensor, name in columns}
        return Correction(
            work,
            reads
            | ({"temperature": factor_of(record["temperature"], parse_unit("degC"), "")} if warm else {}),
            {name: (name, units[sensor]) for sensor, name in columns},
            {"platform": self.platform, "acc": self.accelerometer, "invert": invert}
            | ({} if self.rig.linear else {"rig": self.rig, "warm": warm}),
            findings=left_out,
        )

    def _beside(self, record: Record, sensors: Collection[str]) -> tuple[bool, tuple[Finding, ...]]:
        """True where the temperature of a record counts; findings on what it lacks."""
        column = record.columns.get("temperature")
        known = column is not None and column.unit.dimension == "temperature" and self.temperature is not None
        by_temperature, by_force = self.rig.by_temperature, self.rig.by_force
        texts = []
        if by_temperature and not known:
            texts.append(f"{by_temperature} are not applied: the record has no temperature")
        if by_force and "acc" not in sensors:
            texts.append(f"{by_force} are not applied: the record has no specific force acc_x to z")
        return bool(by_temperature) and known, tuple(Finding("not_held", text) for text in texts)

    def _worked(self, given: Mapping[str, Array], warm: Array, invert: bool) -> dict[str, Array]:
        """Triads (*batch, 3) corrected, in SI; ``warm`` (*batch, 1) [K] above the temperature of the coefficients."""
        rig, results = self.rig, dict[str, Array]()
        if rig.linear:
            forward, back, acc = self.platform.indicate, self.platform.correct, self.accelerometer
            works = {
                "wc": forward if invert else back,
                "gyro": back if invert else forward,
                "acc": acc.indicate if invert else acc.correct,
            }
            return {sensor: works[sensor](x) for sensor, x in given.items()}
        none = next(iter(given.values())) * 0.0
        force = none
        if "acc" in given:
            force = rig.force_within(given["acc"]) if invert else rig.force(given["acc"], warm)
            results["acc"] = rig.outputs(force, warm) if invert else rig.unbent(force, force)
        for sensor in given.keys() - {"acc"}:
            if (sensor == "wc") == invert:
                results[sensor] = rig.unbent(rig.turning(given[sensor], force, warm), force)
            else:
                results[sensor] = rig.commanded(rig.bent(given[sensor], force), force, warm)
        return results


def platform_model(estimate: Estimate, where: object = "calibration") -> PlatformModel:
    """The platform of an estimate of `inercal selfcal`.

    Raises `InputError`: another estimate, or values that are not finite or cannot be inverted; named by ``where``.
    """
    values = {name: p.value for name, p in estimate.parameters.items()}
    if not values.keys() >= set(NAMES) or not np.all(np.isfinite(estimate.values)):
        names = ", ".join(estimate.names) or "no coefficients"
        raise InputError(where, f"found {names}, expected the coefficients of a platform")

    def triple(group: str) -> tuple[float, float, float]:
        x, y, z = (values.get(f"{group}_{axis}", 0.0) for axis in "xyz")
        return x, y, z

    ds, do = triple("ds"), triple("do")
    at_rate = at_port("rate", values)
    gain = np.eye(3) + at_rate[:, :3]
    gain += [[0.0, ds[0], -do[0]], [-do[1], 0.0, ds[1]], [ds[2], -do[2], 0.0]]
    scale = np.diag(gain)
    acc_scale = 1.0 + np.array(triple("ka1"))
    pz, oy, oz = (values[f"eta_{end}"] for end in ("pz", "oy", "oz"))
    with np.errstate(all="ignore"):
        platform = TriadModel(scale, gain / scale[:, None], np.array(triple("kg0")))
        accelerometer = TriadModel(
            acc_scale,
            np.array([[1.0, 0.0, 0.0], [-oy, 1.0, 0.0], [pz, -oz, 1.0]]),
            np.array(triple("ka0")),
        )
        gains = (platform.gain, accelerometer.gain)
        sound = all(np.isfinite(gain).all() and np.linalg.cond(gain) < _WORST for gain in gains)
    if not sound:
        raise InputError(where, "the coefficients of the platform cannot be inverted, expected small errors")
    rig = RigPlatform(
        platform, accelerometer, at_rate, at_port("output", values), np.array(triple("sag")),
        in_need(values, "f"), in_need(values, "warm"),
    )  # fmt: skip
    stated = estimate.conditions.get("temperature")
    value = stated.get("value") if isinstance(stated, Mapping) else None
    return PlatformModel(
        platform, accelerometer, rig, float(value) if isinstance(value, int | float) else None
    )


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: the coefficients that `platform_model` leaves out."""
    left = [name for name in estimate.names if not applied(name) and KIND_OF.get(name) != "beta"]
    texts = []
    if any(KIND_OF.get(name) == "beta" for name in estimate.names):
        texts.append("the zero of the encoders beta is not applied: gimbal angles stay as they are")
    if left:
        texts.append(f"errors of the rig are not applied: {', '.join(left)}")
    return tuple(Finding("not_held", text, str(where)) for text in texts)
