"""An instrument that was calibrated on a table, in use: gyrowheels, gyros and accelerometers of one to three axes.

Of gyros the drift that gravity makes is compensated, and the rate left is freed of scale factors and cross terms::

    B w = y - drift(a),    one row of B for each axis that was calibrated

The gravity reference a comes from the specific force f on the instrument's axes (``acc_x acc_y acc_z``, +g up at rest)
or from the angles of the table: ``a = -f / g`` of a gyrowheel, g the gravity of the site of the calibration, and f
itself of the others. Of accelerometers f is the solution of ``y = K0 + K1 (f_i + M_ip f_p + ... + K2 f_i^2 + ...)``,
found by Newton's method. An axis that was not calibrated takes the value of its own column where the record has it
(``gyro_z`` beside a gyrowheel), of accelerometers that of the attitude, and else is 0, which a finding says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from inercal.faces.convert.correction import Correction, Samples, factor_of, one_clock, widened
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.by_angle import ChannelModel, Monomial, channel_model
from inercal.foundation.records.record import Record
from inercal.foundation.units import Unit, parse_unit

_ROUNDS = 30
"""Newton steps at most; four are usual."""

Vector = list[Any]
"""Three arrays (*batch,), along x, y, z."""


@dataclass(frozen=True)
class TableInstrument:
    """An instrument as a calibration on a table describes it.

    ``kind`` and the ``channels`` that were calibrated are as in `inercal.foundation.instruments.by_angle.CHANNELS`;
    ``values`` are terms (*batch,) by symbol, stated ones among them, absent ones 0. ``output`` is the unit of its
    outputs, ``gravity`` [m/s^2] that of the site of the calibration. ``attitude`` holds the elements of the table from
    its base to the instrument: a ``joint`` with its ``axis``, or a ``rotation`` (3, 3). ``readings`` has the lowest and
    highest reading of the calibration by channel.
    """

    kind: str
    channels: tuple[str, ...]
    values: Mapping[str, Any]
    output: Unit
    gravity: float
    attitude: Sequence[Mapping[str, Any]]
    readings: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record: outputs to ``rate_*`` [rad/s] or ``acc_*`` [m/s^2], or the other way round.

        Raises `InputError`: no such channel, a unit of another kind, different clocks, or neither attitude nor specific
        force where the drift depends on it.
        """
        true = {
            channel: channel if self.kind == "accelerometer" else f"rate_{channel[-1]}"
            for channel in self.channels
        }
        si = parse_unit("m/s^2" if self.kind == "accelerometer" else "rad/s")
        read = {channel: true[channel] if invert else channel for channel in self.channels}
        present = [channel for channel in self.channels if read[channel] in record]
        where = ", ".join(source.path for source in record.sources) or "record"
        if not present:
            names = ", ".join(record.columns) or "no column"
            raise InputError(where, f"found {names}, expected {' or '.join(read.values())}")
        of = "as true values" if invert else "as the instrument was calibrated"
        reads = {read[c]: factor_of(record[read[c]], si if invert else self.output, of) for c in present}
        writes = {read[c]: (c, self.output) if invert else (true[c], si) for c in present}
        axes = ["xyz".index(channel[-1]) for channel in present]
        beside, findings = self._beside(record, present, reads)
        gravity = self._gravity(record, present, where)
        reads |= gravity
        for joint in (name for name in gravity if name.startswith("phi")):
            reads[joint] = factor_of(record[joint], parse_unit("rad"), "of the table")
        one_clock(record, list(reads))

        def work(samples: Samples) -> Samples:
            a = self._reference(samples, bool(gravity))
            given: Vector = [0.0, 0.0, 0.0]
            for axis, column in beside.items():
                given[axis] = samples[column]
            if self.kind == "accelerometer" and gravity:
                given = [a[k] if k not in beside else given[k] for k in range(3)]
            results = {}
            if invert:
                for axis, channel in zip(axes, present, strict=True):
                    given[axis] = samples[read[channel]]
                for channel in present:
                    results[channel] = self._indicated(channel, *self._inputs(a, given))
                return results
            y = {channel: samples[channel] for channel in present}
            solve = self._forces if self.kind == "accelerometer" else self._rates
            solution = solve(y, a, given)
            for axis, channel in zip(axes, present, strict=True):
                results[true[channel]] = np.asarray(solution[axis])
            return results

        settings = {
            "kind": self.kind, "channels": ", ".join(present), "values": str(dict(self.values)), "invert": invert,
            "output": self.output.symbol, "g": self.gravity, "attitude": str(list(self.attitude)),
        }  # fmt: skip
        ranges = {c: widened(*self.readings[c], self.output.symbol) for c in present if c in self.readings}
        if self.kind != "accelerometer":  # on a table no axis feels more than gravity
            force = [name for name in gravity if name.startswith("acc")]
            ranges |= {name: widened(-self.gravity, self.gravity, "m/s^2") for name in force}
        return Correction(work, reads, writes, settings, findings=findings, ranges=ranges)

    def _terms(self, channel: str) -> ChannelModel:
        """The channel with its nonzero terms, and the leading term."""
        whole = channel_model(self.kind, channel)
        return whole.without(
            s for s in whole.symbols if s != whole.leading and not np.any(self.values.get(s, 0.0))
        )

    def _linear(self, model: ChannelModel, symbol: str) -> Any:
        """Linear coefficient (*batch,) of a term."""
        value = self.values.get(symbol, 0.0)
        return value * self.values[model.leading] if symbol in model.relative else value

    def _beside(
        self, record: Record, present: Sequence[str], reads: dict[str, tuple[float, float]]
    ) -> tuple[dict[int, str], tuple[Finding, ...]]:
        """Columns of the axes that were not calibrated, entered into ``reads``, and what is said of absent ones."""
        sensor, unit = ("acc", "m/s^2") if self.kind == "accelerometer" else ("gyro", "rad/s")
        calibrated, columns, lost = {c[-1] for c in present}, {}, []
        of_table = all(joint in record for joint in self._joints)
        for k, axis in enumerate("xyz"):
            name = f"{sensor}_{axis}"
            felt = [s for c in present for s in self._across(c, k) if axis not in calibrated]
            column = record.columns.get(name)
            if not felt:
                continue
            if column is not None and column.unit.dimension == parse_unit(unit).dimension:
                reads[name], columns[k] = factor_of(column, parse_unit(unit), ""), name
            elif not (self.kind == "accelerometer" and of_table):
                lost.append((axis, felt))
        words = "rate about" if sensor == "gyro" else "specific force along"
        return columns, tuple(
            Finding(
                "not_held",
                f"the record does not hold the {words} {axis}, which is taken as 0: {', '.join(felt)} are not applied "
                f"(a column {sensor}_{axis} would be)",
            )
            for axis, felt in lost
        )

    def _across(self, channel: str, axis: int) -> list[str]:
        """Terms of a channel on which the unknown input along an axis acts."""
        model = self._terms(channel)
        at = axis if self.kind == "accelerometer" else axis + 3
        return [s for s, m in zip(model.symbols, model.monomials, strict=True) if m.powers[at]]

    @property
    def _joints(self) -> tuple[str, ...]:
        return tuple(str(each["joint"]) for each in self.attitude if "joint" in each)

    def _gravity(self, record: Record, present: Sequence[str], where: str) -> dict[str, tuple[float, float]]:
        """Columns that tell the gravity reference: the specific force, else the angles; none where it is not needed."""
        angles = dict.fromkeys(self._joints, (1.0, 0.0))
        of_table = bool(angles) and all(joint in record for joint in angles)
        if self.kind == "accelerometer":
            return angles if of_table else {}
        needed = [
            symbol
            for channel in present
            for model in [self._terms(channel)]
            for symbol, each in zip(model.symbols, model.monomials, strict=True)
            if each.order
        ]
        if not needed:
            return {}
        force = [f"acc_{axis}" for axis in "xyz"]
        if all(name in record and record[name].unit.dimension == "acceleration" for name in force):
            return {name: factor_of(record[name], parse_unit("m/s^2"), "") for name in force}
        if of_table:
            return angles
        raise InputError(
            where,
            f"found neither acc_x, acc_y, acc_z in a unit of acceleration nor {', '.join(angles)}, expected one of "
            f"them: {', '.join(needed[:4])}{', ...' if len(needed) > 4 else ''} depend on gravity",
        )

    def _reference(self, samples: Samples, there: bool) -> Vector:
        """The vector a of the monomials: the gravity reference of a gyrowheel, specific force of the others."""
        if not there:
            return [0.0, 0.0, 0.0]
        if "phi1" not in samples:
            f = [samples[f"acc_{axis}"] for axis in "xyz"]
            return [each / -self.gravity for each in f] if self.kind == "gyrowheel" else f
        down: Vector = [0.0, 0.0, -1.0]
        for element in self.attitude:
            if "joint" in element:
                down = _turned(down, str(element["axis"]), samples[str(element["joint"])])
            else:
                M = element["rotation"]
                down = [sum(down[i] * M[i][j] for i in range(3)) for j in range(3)]
        return down if self.kind == "gyrowheel" else [-self.gravity * each for each in down]

    def _inputs(self, a: Vector, given: Vector) -> tuple[Vector, Vector]:
        """a and w of the monomials."""
        return (given, [0.0] * 3) if self.kind == "accelerometer" else (a, given)

    def _indicated(self, channel: str, a: Vector, w: Vector) -> Array:
        """Output (*batch,) for these inputs."""
        model, inputs = self._terms(channel), [*a, *w]
        y: Any = 0.0
        for symbol, each in zip(model.symbols, model.monomials, strict=True):
            y = y + self._linear(model, symbol) * _product(inputs, each)
        return np.asarray(y)

    def _rates(self, y: Samples, a: Vector, given: Vector) -> Vector:
        """Rates about x, y, z; those of axes that were not calibrated as ``given``."""
        rows: list[Vector] = [[float(i == j) for j in range(3)] for i in range(3)]
        right = list(given)
        for channel, output in y.items():
            model, k = self._terms(channel), "xyz".index(channel[-1])
            rows[k] = [0.0, 0.0, 0.0]
            right[k] = output - self._indicated(channel, a, [0.0] * 3)
            for symbol, each in zip(model.symbols, model.monomials, strict=True):
                if each.of_rate:
                    axis = each.powers.index(1) - 3
                    rows[k][axis] = rows[k][axis] + self._linear(model, symbol)
        return _solved(rows, right)

    def _forces(self, y: Samples, _: Vector, given: Vector) -> Vector:
        """Specific force along x, y, z; that of axes that were not calibrated as ``given``.

        A sample settles by itself; one that does not, beyond the extreme of its polynomial, is no number.
        """
        axes = ["xyz".index(channel[-1]) for channel in y]
        shape = np.broadcast_shapes(*(np.shape(each) for each in (*y.values(), *given)))
        f: Vector = [np.zeros(shape) if k in axes else given[k] + np.zeros(shape) for k in range(3)]
        moving = np.ones(shape, bool)
        for _round in range(_ROUNDS):
            rows: list[Vector] = [[float(i == j) for j in range(3)] for i in range(3)]
            right: Vector = [0.0, 0.0, 0.0]
            for channel, output in y.items():
                model, k = self._terms(channel), "xyz".index(channel[-1])
                right[k] = output - self._indicated(channel, f, [0.0] * 3)
                rows[k] = [self._slope(model, f, axis) for axis in range(3)]
            with np.errstate(all="ignore"):
                step = _solved(rows, right)
                size = sum(np.abs(each) for each in f)
                moves = sum(np.abs(each) for each in step) > 1e-14 * (size + 1e-3)
                f = [np.where(moving, f[k] + step[k], f[k]) for k in range(3)]
            moving = moving & moves
            if not moving.any():
                break
        return [np.where(moving, np.nan, each) for each in f]

    def _slope(self, model: ChannelModel, f: Vector, axis: int) -> Any:
        """Derivative (*batch,) of an accelerometer's output with respect to the specific force along an axis."""
        slope: Any = 0.0
        for symbol, each in zip(model.symbols, model.monomials, strict=True):
            power = each.powers[axis] + (each.odd == axis)
            if power:  # d(f^n |f|) = (n + 1) f^n sign(f)
                lower: Any = np.sign(f[axis]) if each.odd == axis else 1.0
                for k in range(3):
                    for _ in range(each.powers[k] + (each.odd == k) - (k == axis)):
                        lower = lower * f[k]
                slope = slope + power * self._linear(model, symbol) * lower
        return slope


def _turned(row: Vector, axis: str, angle: Any) -> Vector:
    """A row vector times the elementary rotation about an axis."""
    c, s = np.cos(angle), np.sin(angle)
    k = "xyz".index(axis)
    i, j = (k + 1) % 3, (k + 2) % 3
    turned = list(row)
    turned[i] = row[i] * c + row[j] * s
    turned[j] = row[j] * c - row[i] * s
    return turned


def _product(inputs: Sequence[Any], each: Monomial) -> Any:
    """Value (*batch,) of a monomial."""
    value: Any = 1.0
    for i, power in enumerate(each.powers):
        for _ in range(power):
            value = value * inputs[i]
    return value if each.odd is None else value * np.abs(inputs[each.odd])


def _solved(rows: Sequence[Vector], right: Vector) -> Vector:
    """Solution of three equations by Cramer's rule, to the same digits in any batch."""
    a, b, c = ([row[k] for row in rows] for k in range(3))

    def triple(u: Vector, v: Vector, w: Vector) -> Any:
        return (
            u[0] * (v[1] * w[2] - v[2] * w[1])
            + u[1] * (v[2] * w[0] - v[0] * w[2])
            + u[2] * (v[0] * w[1] - v[1] * w[0])
        )

    whole = triple(a, b, c)
    return [triple(right, b, c) / whole, triple(a, right, c) / whole, triple(a, b, right) / whole]
