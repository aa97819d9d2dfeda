"""The result of a self-calibration in use: corrected commands of the platform, corrected gyros and accelerometers.

The platform turns at ``w_p = (1 + M) w + kg0`` where ``w`` is commanded
(`inercal.systems.selfcal.platform.coefficients`). For it to turn at a wanted rate the command is

    w = (1 + M)^-1 (w_p - kg0),

of which the familiar ``w_p - M w_p - kg0`` is the first order: that leaves M (M w_p + kg0), at 1 deg/s and
misalignments of 100 arcsec 0.001 deg/h, as much as a good calibration still sees, so the inverse is taken. Gyros that
took the place of the commands are corrected the other way: ``w_p`` of the rate ``w`` they measured. What else the
result has of rates, outputs and sag is corrected for too; what is of angles, times and places is named.

With f the specific force in p, w the rate commanded or measured, T kelvins above the temperature of the coefficients
(`inercal.systems.selfcal.platform.model`):

    w_p = (1 + M) w + kg0 + sum c v(w, f, T),   a = ka0 + s + sum c v(s, T),   s the linear part of the output,

v the quantities of `inercal.systems.selfcal.platform.layout`. Vectors are given in the axes of the unbent platform:
``v = exp(sag x f) v_p``. What needs f or T of a record that has none is left out, and named.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.faces.convert.correction import Correction, Samples, factor_of, one_clock
from inercal.foundation._jit import plain
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.rotations import conjugate, exp, rotate
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.platform.coefficients import NAMES
from inercal.systems.selfcal.platform.layout import QUANTITIES
from inercal.systems.selfcal.platform.states import BIAS_WALK, ENTRY_OF, KIND_OF

_ROUNDS = 6
"""Rounds of an inverse: each is nearer by a factor below 1e-2."""

_LINEAR = 3
"""Quantities of the rate, the first, that are in the gain of the platform."""


def applied(name: str) -> bool:
    """True for a parameter by which readings are corrected: of rates, outputs or sag; no bias that walks, which is that
    of the last row."""
    port = ENTRY_OF[name].port if name in ENTRY_OF else ""
    return port in ("core", "rate", "output", "bend") and KIND_OF[name] not in BIAS_WALK


def at_port(port: str, values: Mapping[str, float]) -> Array:
    """Coefficients (3, quantities) at a linear port, by axis and quantity; ``values`` by parameter."""
    coefficients = np.zeros((3, len(QUANTITIES[port])))
    for name in filter(applied, values):
        if (entry := ENTRY_OF[name]).port == port:
            coefficients[entry.axis, entry.quantity] += values[name]
    return coefficients


def in_need(values: Mapping[str, float], quantity: str) -> str:
    """Kinds of parameters, in words, that are not 0 and need a quantity of a record: specific force, ``f``, or
    temperature, ``warm``."""
    kinds = dict[str, None]()
    for name in filter(applied, values):
        port, _, at, _ = ENTRY_OF[name]
        needed = QUANTITIES[port][at] if port in QUANTITIES else "f" if port == "bend" else ""
        if values[name] != 0.0 and needed.startswith(quantity):
            kinds[KIND_OF[name]] = None
    return ", ".join(kinds)


@dataclass(frozen=True)
class RigPlatform:
    """The linear ``platform`` and ``accelerometer``; beside them in SI coefficients ``rate`` (3, quantities) and
    ``output`` (3, quantities) of `at_port`, those of the gain apart, and ``sag`` (3,); in words the kinds that need
    specific force, ``by_force``, or temperature, ``by_temperature``."""

    platform: TriadModel
    accelerometer: TriadModel
    rate: Array
    output: Array
    sag: Array
    by_force: str = ""
    by_temperature: str = ""

    @property
    def linear(self) -> bool:
        """True where there is nothing beside the triads."""
        return not (self.rate[:, _LINEAR:].any() or self.output.any() or self.sag.any())

    def force(self, outputs: Array, warm: Array) -> Array:
        """Specific force (*batch, 3) [m/s^2] in p of accelerometer outputs; ``warm`` (*batch, 1) [K]."""
        d = outputs - self.accelerometer.bias
        s = d
        for _ in range(_ROUNDS):
            s = d - self._beside_output(s, warm)
        return self.accelerometer.correct(s + self.accelerometer.bias)

    def outputs(self, force: Array, warm: Array) -> Array:
        """Accelerometer outputs (*batch, 3) [m/s^2] at specific force in p: the inverse of `force`."""
        s = self.accelerometer.indicate(force) - self.accelerometer.bias
        return s + self._beside_output(s, warm) + self.accelerometer.bias

    def turning(self, rate: Array, force: Array, warm: Array) -> Array:
        """Rate (*batch, 3) [rad/s] in p at which the platform turns, at one commanded or measured."""
        return self.platform.indicate(rate) + self._beside_rate(rate, force, warm)

    def commanded(self, turning: Array, force: Array, warm: Array) -> Array:
        """Rate commanded, or measured, for the platform to turn at one: the inverse of `turning`."""
        rate = self.platform.correct(turning)
        for _ in range(_ROUNDS):
            rate = self.platform.correct(turning - self._beside_rate(rate, force, warm))
        return rate

    def _beside_rate(self, rate: Array, force: Array, warm: Array) -> Array:
        """The part of the rate beside that of the triad, by the quantities in the order of the table."""
        from inercal.systems.selfcal.platform.model import (
            rate_quantities,
        )  # loads kernels, which most corrections do without

        quantities = plain(rate_quantities)(_axes(rate), _axes(force), warm)
        return _total(self.rate[:, _LINEAR:], quantities[_LINEAR:])

    def _beside_output(self, s: Array, warm: Array) -> Array:
        """The part of the outputs beside ``s``, those of the triad without bias."""
        from inercal.systems.selfcal.platform.model import output_quantities

        by = s / self.accelerometer.scale
        return _total(self.output, plain(output_quantities)(_axes(s), _axes(by), warm))

    def unbent(self, v: Array, force: Array) -> Array:
        """A vector (*batch, 3) of p in the axes of the unbent platform; ``force`` (*batch, 3) [m/s^2] in p."""
        return rotate(exp(np.cross(self.sag, force)), v)

    def bent(self, v: Array, force: Array) -> Array:
        """The inverse of `unbent`."""
        return rotate(conjugate(exp(np.cross(self.sag, force))), v)

    def force_within(self, unbent: Array) -> Array:
        """Specific force in p of one in the axes of the unbent platform."""
        force = unbent
        for _ in range(_ROUNDS):
            force = self.bent(unbent, force)
        return force


def _axes(v: Array) -> list[Array]:
    """Components (*batch, 1) of vectors."""
    return [v[..., i, None] for i in range(3)]


def _total(coefficients: Array, quantities: Sequence[Array]) -> Array:
    """Sum (*batch, 3) of coefficients (3, n) times n quantities (*batch, 1), to the same digits in any batch."""
    total = np.zeros(3)
    for column, quantity in zip(coefficients.T, quantities, strict=True):
        if column.any():
            total = total + quantity * column
    return total


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
