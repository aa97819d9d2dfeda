"""The IMU that a calibration describes: three accelerometers and three gyros, outputs to truth and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from inercal.faces.convert.correction import Correction, Samples, factor_of, range_of, widened
from inercal.faces.convert.motion import Placed, where_even
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import ACCELEROMETER_TRIAD, GYRO_G_SENSITIVITY, GYRO_TRIAD
from inercal.foundation.instruments.triad import TriadModel, apart, triad_from_terms
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit

TERMS_IN_USE = (
    *ACCELEROMETER_TRIAD,
    *("M_yx", "M_zx", "M_zy"),
    *(f"K2_{axis}" for axis in "xyz"),
    *GYRO_TRIAD,
    *GYRO_G_SENSITIVITY,
    *(f"S_asym_{axis}" for axis in "xyz"),
    *(f"r_{i}{j}" for i in "xy" for j in "xyz"),
    "tau_a",
)
"""Terms of an IMU that are applied."""


@dataclass(frozen=True)
class ImuModel:
    """The instrument that a calibration describes, forward: truth to indication.

    ``units`` are those of the outputs it was calibrated for, by sensor; ``gyro`` is None where only the
    accelerometers were calibrated; ``g_sensitivity`` (3, 3) [gyro output/(m/s^2)]; ``second_order`` (3,) [1/(m/s^2)]
    is K2 of the accelerometers, whose output is K0 + K1 (s + K2 s^2) at the specific force s along the input axis.
    ``asymmetry`` (3,) is S_asym of the gyros, whose output is that of the triad and S S_asym |w| / 2. ``levers`` (3, 3)
    [m] are the places of accelerometers x, y, z in b, ``delay`` [s] is by how much they are late against the stamps.
    ``rates`` (2, 3) [rad/s] are the least and the largest of the calibration, None where it does not say.
    """

    accelerometer: TriadModel
    gyro: TriadModel | None
    g_sensitivity: Array
    units: dict[str, str]
    second_order: Array = field(default_factory=lambda: np.zeros(3))
    rates: Array | None = None
    asymmetry: Array = field(default_factory=lambda: np.zeros(3))
    levers: Array = field(default_factory=lambda: np.zeros((3, 3)))
    delay: float = 0.0

    @property
    def placed(self) -> Placed | None:
        """Places and delay of the accelerometers, where a calibration states them."""
        return Placed(self.levers, self.delay) if self.levers.any() or self.delay else None

    def correct(self, acc: Array, gyro: Array | None) -> tuple[Array, Array | None]:
        """Specific force (*batch, 3) [m/s^2] and rate (*batch, 3) [rad/s] from outputs."""
        f = self.accelerometer.correct(self._straight(acc))
        if gyro is None or self.gyro is None:
            return f, None
        return f, self._rate(self.gyro, gyro, f)

    def indicate(self, f: Array, omega: Array | None) -> tuple[Array, Array | None]:
        """Outputs from specific force [m/s^2] and rate [rad/s]: the inverse of `correct`."""
        acc = self._bent(self.accelerometer.indicate(f))
        if omega is None or self.gyro is None:
            return acc, None
        uneven = 0.5 * self.asymmetry * self.gyro.scale * np.abs(omega) if self.asymmetry.any() else 0.0
        return acc, self.gyro.indicate(omega) + self._drift(f) + uneven

    def _rate(self, triad: TriadModel, gyro: Array, f: Array) -> Array:
        """Rate of the gyros' outputs, by fixed-point steps where their scale factors are not even."""
        straight = gyro - self._drift(f)
        omega = triad.correct(straight)
        if self.asymmetry.any():
            for _ in range(4):
                omega = triad.correct(straight - 0.5 * self.asymmetry * triad.scale * np.abs(omega))
        return omega

    def _moving(
        self, t: Array, step: float, acc: Array, gyro: Array, invert: bool
    ) -> tuple[Array, Array, Array]:
        """`correct`, or with ``invert`` `indicate`, of samples (n, 3) one after the other at ``t`` (n,) [s], with the
        places and the delay of the accelerometers; and where (n,) these are applied."""
        placed, triad = self.placed, self.gyro
        assert placed is not None
        assert triad is not None

        def forward() -> tuple[Array, Array]:
            felt, _ = self.indicate(acc + placed.of_turning(gyro, step), None)
            _, rate = self.indicate(acc, gyro)
            return placed.at_stamp(felt, step, True), gyro if rate is None else rate

        def back() -> tuple[Array, Array]:
            felt = self.accelerometer.correct(self._straight(placed.at_stamp(acc, step, False)))
            f = felt
            for _ in range(2 if self.g_sensitivity.any() else 1):
                f = felt - placed.of_turning(self._rate(triad, gyro, f), step)
            return f, self._rate(triad, gyro, f)

        def still() -> tuple[Array, Array]:
            f, w = self.indicate(acc, gyro) if invert else self.correct(acc, gyro)
            return f, w if w is not None else gyro

        return where_even(t, step, placed.reach(step), forward if invert else back, still)

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record, whose columns may be without samples yet; with ``invert`` it holds true values.

        Raises `InputError`: units of another kind than those of the calibration, missing or uncalibrated channels, two
        clocks. A gyro that the calibration does not cover is an error, not passed on as if it were corrected.
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
        reads, writes = {}, {}
        for triad in (acc, gyro):
            if triad is None:
                continue
            wanted = (truth if invert else output).get(triad.sensor, triad.unit)
            written = (output if invert else truth).get(triad.sensor, triad.unit)
            of = "as true values" if invert else "as the instrument was calibrated"
            for axis in "xyz":
                name = f"{triad.sensor}_{axis}"
                reads[name] = factor_of(record[name], wanted, of)
                writes[name] = (name, written)
        both = self.indicate if invert else self.correct
        placed = self.placed
        moving = placed is not None and gyro is not None

        def work(samples: Samples) -> Samples:
            given = {
                sensor: np.stack([samples[f"{sensor}_{axis}"] for axis in "xyz"], axis=-1)
                for sensor in ("acc", "gyro")
                if f"{sensor}_x" in writes
            }
            applied: dict[str, Array] = {}
            if moving:
                step = float(samples["step"])
                f, w, sound = self._moving(samples["t"], step, given["acc"], given["gyro"], invert)
                applied = {"applied": sound}
                pair: tuple[Array, Array | None] = f, w
            else:
                pair = both(given["acc"], given.get("gyro"))
            results = zip(("acc", "gyro"), pair, strict=True)
            return applied | {
                f"{sensor}_{axis}": values[..., i]
                for sensor, values in results
                if values is not None
                for i, axis in enumerate("xyz")
            }

        triads = {"acc": self.accelerometer, **({} if self.gyro is None else {"gyro": self.gyro})}
        settings = {**triads, "g": self.g_sensitivity, "units": self.units, "invert": invert}
        if self.second_order.any():
            settings["k2"] = self.second_order
        findings: tuple[Finding, ...] = ()
        if placed is not None:
            settings |= {"levers": self.levers, "delay": self.delay}
            if gyro is None:
                text = "no gyro tells the turning: places and delay of the accelerometers are not applied"
                findings = (Finding("not_held", text),)
        if self.asymmetry.any():
            settings["asymmetry"] = self.asymmetry
        ranges = {}
        if gyro is not None and self.rates is not None and not invert:
            ends = zip("xyz", *self.rates.tolist(), strict=True)
            ranges = {f"gyro_{axis}": widened(low, high, "rad/s") for axis, low, high in ends}
        reach = placed.reach if moving and placed is not None else None
        return Correction(work, reads, writes, settings, findings=findings, ranges=ranges, reach=reach)

    def _straight(self, acc: Array) -> Array:
        """Outputs of the accelerometers as they would be without K2: the root of s + K2 s^2 that is small with it."""
        if not self.second_order.any():
            return acc
        bent = (acc - self.accelerometer.bias) / self.accelerometer.scale
        with np.errstate(invalid="ignore"):  # beyond the extreme of the parabola there is no input
            straight = 2.0 * bent / (1.0 + np.sqrt(1.0 + 4.0 * self.second_order * bent))
        return np.asarray(self.accelerometer.bias + self.accelerometer.scale * straight)

    def _bent(self, acc: Array) -> Array:
        """The inverse of `_straight`."""
        if not self.second_order.any():
            return acc
        straight = (acc - self.accelerometer.bias) / self.accelerometer.scale
        bent = straight + self.second_order * straight * straight
        return np.asarray(self.accelerometer.bias + self.accelerometer.scale * bent)

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
    model = imu_of(values, {str(sensor): str(unit) for sensor, unit in units.items()})
    for name, triad in (("accelerometers", model.accelerometer), ("gyro", model.gyro)):
        if triad is not None and not _invertible(triad):
            raise InputError(
                where, f"the scale factors of the {name} cannot be inverted, expected three independent axes"
            )
    for unit in units.values():
        parse_unit(str(unit), where)
    return replace(model, rates=_rates(estimate, model.gyro, where))


def imu_of(values: Mapping[str, float] | Mapping[str, Array], units: dict[str, str]) -> ImuModel:
    """The instrument of these terms (*batch,) by symbol, absent ones 0, with outputs in ``units`` by sensor."""
    rows = [
        np.stack(np.broadcast_arrays(*(values.get(f"G_{i}{j}", 0.0) for j in "xyz")), axis=-1) for i in "xyz"
    ]
    return ImuModel(
        triad_from_terms(values, "K1", "M", "K0"),
        triad_from_terms(values, "S", "T", "D_F") if "S_x" in values else None,
        np.stack(np.broadcast_arrays(*rows), axis=-2),
        units,
        np.stack(np.broadcast_arrays(*(values.get(f"K2_{axis}", 0.0) for axis in "xyz")), axis=-1),
        asymmetry=np.stack(
            np.broadcast_arrays(*(values.get(f"S_asym_{axis}", 0.0) for axis in "xyz")), axis=-1
        ),
        levers=np.array([[_fixed(values.get(f"r_{i}{j}", 0.0)) for j in "xyz"] for i in "xyz"]),
        delay=0.0 if "tau_g" in values else _fixed(values.get("tau_a", 0.0)),
    )


def _fixed(value: float | Array) -> float:
    """A term of the motion, which no temperature changes from sample to sample: the mean of it."""
    return float(np.mean(value))


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: the terms of a calibration that `imu_model` leaves out, for they do not go with any recording."""
    findings = []
    if any(name.startswith("D_R_") for name in estimate.names):
        t0 = estimate.result.get("bias_time_s")
        time = f"{t0:.6g} s" if isinstance(t0, int | float) else "the time bias_time_s"
        text = (
            "the drift D_R of the gyro bias belongs to the recording of the calibration and is not applied: "
            f"D_F is the bias at {time} of that"
        )
        findings.append(Finding("not_held", text, str(where)))
    in_use = {*TERMS_IN_USE} - ({"tau_a"} if "tau_g" in estimate.names else set())
    other = [name for name in estimate.names if name not in in_use and not name.startswith("D_R_")]
    if other:
        text = f"{', '.join(other)}: not applied, for a sample by itself does not tell the motion they act on"
        findings.append(Finding("not_held", text, str(where)))
    return tuple(findings)


def _rates(estimate: Estimate, gyro: TriadModel | None, where: object) -> Array | None:
    """The least and the largest rates (2, 3) [rad/s] about the axes that a calibration has seen."""
    if gyro is None:
        return None
    rates = range_of(estimate, "rate_about_an_axis_rad_s", where, (3,))
    if rates is None and (outputs := range_of(estimate, "gyro_output", where, (3,))) is not None:
        rates = np.sort((outputs - gyro.bias) / gyro.scale, axis=0)
    return rates


@np.errstate(all="ignore")
def _invertible(triad: TriadModel) -> bool:
    """True if outputs can be taken back to finite inputs."""
    gain = triad.gain
    return bool(
        np.isfinite(gain).all()
        and np.linalg.matrix_rank(gain) == 3
        and np.isfinite(np.linalg.inv(gain)).all()
    )
