"""The sensors of a wind-tunnel model in a study: where they sit, which way they look, and their calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, create_model, model_validator

from inercal.faces.studies.fields import (
    ELECTRIC,
    ExactText,
    QuantityText,
    Ratio,
    ScaleText,
    SlopeText,
    Temperature,
    positive,
    refusal,
)
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import InputError, QuantityError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.units import Quantity, parse_quantity, parse_unit, shown
from inercal.systems.aoa.layout import AXES, STATED, Layout
from inercal.systems.aoa.settings import GYROS, Per, SensorCalibration

MOST = 24
"""Accelerometers that a study may have."""

_LONGEST = 40
"""Characters of the name of a layout."""

FARTHEST = 5.0
"""Distance from the pivot [m] beyond which a position is taken for one in mm."""

_G = QuantityText("acceleration", "10 g", positive, "a range above zero")
_RATE = QuantityText("rate", "40 deg/s", positive, "a range above zero")
_SCALES = {
    "acceleration": ScaleText("acceleration", ("1.002", "0.5 g/V", "61 ug/count", "16384 count/g")),
    "rate": ScaleText("rate", ("1.002", "20 deg/s/V", "10 mV/(deg/s)", "131 count/(deg/s)")),
}

_WHERE = ExactText(
    "length",
    "-0.25 m",
    lambda x: abs(x) <= FARTHEST,
    f"a position within {FARTHEST:g} m of the pivot (mm given as m?)",
)
_Position = Annotated[Quantity, _WHERE]
_Angle = Annotated[Quantity, ExactText("angle", "90 deg")]
_Slope = {
    "acceleration": SlopeText("acceleration", "10 ug/K"),
    "rate": SlopeText("rate", "0.01 deg/h/K"),
}
_Relative = Annotated[Ratio, SlopeText("number", "50 ppm/K")]


def _bias_like(*examples: str) -> Any:
    """The key of a bias."""
    return Field(
        default=None,
        description="what it indicates at zero input; 0 if absent; in volts or counts too where its scale is",
        examples=list(examples),
    )


class _SensorTable(Strict):
    """Keys of accelerometers and gyros; ``scale``, ``bias``, ``bias_slope`` and ``range`` differ."""

    scale_slope: _Relative | None = Field(
        default=None, description="relative change of the scale with temperature; 0 if absent"
    )
    temperature: Temperature | None = Field(
        default=None, description="at which scale and bias hold; 20 degC if absent"
    )
    calibration: str | None = Field(
        default=None,
        min_length=1,
        description="in place of scale and bias: a file that `inercal calibrate` wrote, beside the study",
        examples=["calibration.json"],
    )
    channel: Literal["x", "y", "z", "-x", "-y", "-z"] | None = Field(
        default=None,
        description="axis of the calibration that this sensor is, with - where the record turns its sign; not needed "
        "where the calibration has one alone",
    )

    @model_validator(mode="after")
    def _one_calibration(self) -> _SensorTable:
        """Refuse scale or bias beside a calibration file, and a channel without one."""
        beside = [key for key in ("scale", "bias") if getattr(self, key, None) is not None]
        if self.calibration is not None and beside:
            raise refusal(f"found calibration and {beside[0]}, expected one of them")
        if self.calibration is None and self.channel is not None:
            raise refusal("channel: found without calibration, expected them together")
        return self


class AccelerometerTable(_SensorTable):
    """An accelerometer: the direction it looks in, its place, its calibration."""

    axis: Literal["+x", "-x", "+z", "-z"] | None = Field(
        default=None, description="where its input axis points: x forward, z up; or give angle"
    )
    angle: _Angle | None = Field(
        default=None, description="of its input axis from +x (forward) towards -z (down), in place of axis"
    )
    r: _Position = Field(description="how far ahead of the pivot it sits")
    z: _Position | None = Field(
        default=None, description="how far above the pivot; 0 if absent", examples=["20 mm"]
    )
    scale: Annotated[Ratio, _SCALES["acceleration"]] | None = Field(
        default=None,
        description="what its column is multiplied by; with a unit over V or count, or the inverse, where the column "
        "is in volts or counts; 1 if absent",
    )
    bias: str | None = _bias_like("1 mg", "2.5 V")
    range: Annotated[Quantity, _G] | None = Field(
        default=None, description="at or beyond which it is saturated; not known if absent"
    )
    bias_slope: Annotated[Ratio, _Slope["acceleration"]] | None = Field(
        default=None, description="change of the bias with temperature; 0 if absent"
    )

    @model_validator(mode="after")
    def _one_direction(self) -> AccelerometerTable:
        """Refuse two directions, and none."""
        if (self.axis is None) == (self.angle is None):
            given = "neither axis nor angle" if self.axis is None else "both axis and angle"
            raise refusal(f'found {given}, expected one of them, such as axis = "+x" or angle = "0 deg"')
        return self


class RateGyroTable(_SensorTable):
    """A gyro: its calibration."""

    scale: Annotated[Ratio, _SCALES["rate"]] | None = Field(
        default=None,
        description="what its column is multiplied by; with a unit over V or count, or the inverse, where the column "
        "is in volts or counts; 1 if absent",
    )
    bias: str | None = _bias_like("0.1 deg/s", "2.5 V")
    range: Annotated[Quantity, _RATE] | None = Field(
        default=None, description="at or beyond which it is saturated; not known if absent"
    )
    bias_slope: Annotated[Ratio, _Slope["rate"]] | None = Field(
        default=None, description="change of the bias with temperature; 0 if absent"
    )


class PlaceTable(Strict):
    """Direction and place of an accelerometer in a layout beside [sensors]; as there where absent."""

    axis: Literal["+x", "-x", "+z", "-z"] | None = Field(
        default=None, description="where its input axis points: x forward, z up; or angle"
    )
    angle: _Angle | None = Field(
        default=None, description="of its input axis from +x (forward) towards -z (down), in place of axis"
    )
    r: _Position | None = Field(default=None, description="how far ahead of the pivot it sits")
    z: _Position | None = Field(default=None, description="how far above the pivot", examples=["20 mm"])


def _accelerometers(table: type[Strict]) -> dict[str, Any]:
    """Fields of all accelerometers that a study may have, each of such a table."""
    return {
        f"a{k}": (table | None, Field(default=None, title=f"A{k}", description=f"accelerometer {k}"))
        for k in range(1, MOST + 1)
    }


def _fields() -> dict[str, Any]:
    """Fields of all sensors that a study may have."""
    of_gyros = ("nose-up positive", "rolling right wing down positive", "yawing nose left positive")
    made = _accelerometers(AccelerometerTable)
    for name, words in zip(GYROS, of_gyros, strict=True):
        title = name.replace("_", " ").capitalize()
        made[name] = (RateGyroTable | None, Field(default=None, title=title, description=words))
    return made


_Sensors: Any = create_model("Sensors", __base__=Strict, **_fields())


class SensorsTable(_Sensors):  # type: ignore[misc]
    """The sensors by the names of their columns: two or more accelerometers, numbered from 1; gyros as there are."""

    @model_validator(mode="after")
    def _enough(self) -> SensorsTable:
        """Refuse holes in the numbers, too few, and axes that are all parallel."""
        given = [k for k in range(1, MOST + 1) if getattr(self, f"a{k}") is not None]
        if len(given) < 2:
            names = ", ".join(f"a{k}" for k in given) or "no accelerometer"
            raise refusal(f"found {names}, expected two accelerometers or more: a1, a2, ..")
        if given[-1] != len(given):
            hole = next(k for k in range(1, MOST) if k not in given)
            raise refusal(f"found a{given[-1]} without a{hole}, expected them numbered from 1 without a hole")
        if not layout_of(self).spans:
            raise refusal(
                "found accelerometers whose axes are all parallel, expected two that are not: one direction does not "
                "tell the angle"
            )
        return self


def layout_of(table: SensorsTable) -> Layout:
    """Axes and places of the accelerometers."""
    names = [
        name for name in type(table).model_fields if name not in GYROS and getattr(table, name) is not None
    ]
    sensors = [getattr(table, name) for name in names]
    angles = [AXES[sensor.axis] if sensor.angle is None else sensor.angle.value for sensor in sensors]
    ahead = [sensor.r.value for sensor in sensors]
    heights = [0.0 if sensor.z is None else sensor.z.value for sensor in sensors]
    return Layout(tuple(names), np.array(angles), np.array(ahead), np.array(heights))


_Layout: Any = create_model("Layout", __base__=Strict, **_accelerometers(PlaceTable))


class LayoutTable(_Layout):  # type: ignore[misc]
    """A layout beside [sensors]: what differs, by accelerometer."""


def layouts_of(data: Mapping[str, Any], where: str | Path) -> dict[str, Layout]:
    """The layouts of a study's ``data`` beside that under [sensors], by name.

    Each is read as the sensors are, so that it is refused for the same reasons: raises `StudyError`.
    """
    geometry = ("axis", "angle", "r", "z")
    stated = {
        name: {key: sensor[key] for key in geometry if key in sensor}
        for name, sensor in data["sensors"].items()
        if name not in GYROS
    }
    layouts = {}
    for name, differing in data.get("layouts", {}).items():
        if name == STATED or not name.isprintable() or not 0 < len(name) <= _LONGEST:
            raise StudyError(
                where,
                f"layouts: found the name {shown(name)}, expected one of {_LONGEST} characters at most, other than "
                f"{STATED}, as the layout under [sensors] is called",
            )
        merged = dict(stated)
        for sensor, place in differing.items():
            replaced = {*place, *(("axis", "angle") if {"axis", "angle"} & place.keys() else ())}
            kept = {key: text for key, text in stated.get(sensor, {}).items() if key not in replaced}
            merged[sensor] = kept | place
        table = check(SensorsTable, merged, f"{where}: layouts.{name}", StudyError)
        layouts[name] = layout_of(table)
    return layouts


def calibrations_of(table: SensorsTable, where: str | Path) -> dict[str, SensorCalibration]:
    """The calibration of each sensor that the study names.

    Raises `StudyError` for a bias that is none of this sensor, a calibration that cannot be read or does not hold the
    sensor.
    """
    return {
        name: _calibration(name, one, where)
        for name in type(table).model_fields
        if (one := getattr(table, name)) is not None
    }


def _calibration(name: str, table: Any, where: str | Path) -> SensorCalibration:
    """The calibration of one sensor."""
    if table.calibration is not None:
        scale, bias, per, caution = _from_file(name, table, where)
    else:
        caution = ""
        scale, per = (1.0, "1") if table.scale is None else (table.scale.value, table.scale.per)
        bias = 0.0 if table.bias is None else _bias(name, table.bias, scale, per, where)
    usual = SensorCalibration()
    return SensorCalibration(
        scale=scale,
        bias=bias,
        range=None if table.range is None else table.range.value,
        scale_slope=0.0 if table.scale_slope is None else table.scale_slope.value,
        bias_slope=0.0 if table.bias_slope is None else table.bias_slope.value,
        temperature=usual.temperature if table.temperature is None else table.temperature.value,
        per=per,
        caution=caution,
    )


def _bias(name: str, text: str, scale: float, per: str, where: str | Path) -> float:
    """A bias [SI], stated in units of the quantity or of the column."""
    key = f"sensors.{name}.bias"
    electric = next((dimension for dimension, unit in ELECTRIC.items() if unit == per), None)
    if electric is not None:
        try:
            raw = parse_quantity(text, electric, key)
        except QuantityError:
            pass
        else:
            return _without_u(raw, key, where).value * scale
    try:
        bias = parse_quantity(text, _dimension(name), key)
    except QuantityError as error:
        also = f", or one in {per}" if electric else ""
        raise StudyError(where, f"{key}: {error.message}{also}") from error
    return _without_u(bias, key, where).value


def _without_u(quantity: Quantity, key: str, where: str | Path) -> Quantity:
    """The quantity; refused with an uncertainty."""
    if quantity.u != 0.0:
        raise StudyError(
            where,
            f"{key}: found {shown(quantity.text)} with an uncertainty, expected it without: noise holds those of "
            "biases",
        )
    return quantity


def _from_file(name: str, table: Any, where: str | Path) -> tuple[float, float, Per, str]:
    """Scale, bias, quantity of the column, and a caution, from a calibration of ours: output = K0 + K1 a,
    or D_F + S w."""
    from inercal.foundation.results.files import load

    key = f"sensors.{name}.calibration"
    slope, offset = ("S", "D_F") if name in GYROS else ("K1", "K0")
    try:
        estimate = load(Path(where).parent / table.calibration)
    except InputError as error:
        raise StudyError(where, f"{key}: {error}") from error
    coefficients, ended = estimate.parameters, estimate.status
    message = " ".join(estimate.message.split())  # one line, whoever wrote the file
    caution = "" if ended is Status.OK else f"{table.calibration} ended {ended.value}: {message}"
    axes = [axis for axis in "xyz" if {f"{slope}_{axis}", f"{offset}_{axis}"} <= coefficients.keys()]
    if not axes:
        raise StudyError(
            where,
            f"{key}: found no {slope}_x and {offset}_x, .. in {table.calibration}, expected those of this sensor",
        )
    if table.channel is None and len(axes) > 1:
        raise StudyError(
            where, f"sensors.{name}.channel: missing, expected which of {', '.join(axes)} this sensor is"
        )
    channel = table.channel or axes[0]
    axis, sign = channel[-1], -1.0 if channel.startswith("-") else 1.0
    if axis not in axes:
        raise StudyError(
            where, f"sensors.{name}.channel: found {table.channel!r}, expected one of {', '.join(axes)}"
        )
    gain, zero = coefficients[f"{slope}_{axis}"], coefficients[f"{offset}_{axis}"]
    unit = parse_unit(zero.unit, f"{where}: {key}")
    if unit.dimension not in ELECTRIC and unit.dimension != (measured := _dimension(name)):
        raise StudyError(
            where, f"{key}: found {offset}_{axis} in {unit.symbol}, expected a unit of {measured}, V or count"
        )
    per: Any = ELECTRIC.get(unit.dimension, "1")
    over = 1.0 / gain.value if gain.value else math.nan
    scale, bias = over / unit.factor, sign * zero.value * over
    if not (scale and math.isfinite(scale) and math.isfinite(bias)):
        raise StudyError(
            where,
            f"{key}: found {slope}_{axis} = {gain.value:g} and {offset}_{axis} = {zero.value:g} in "
            f"{table.calibration}, expected a scale factor and an offset",
        )
    return scale, bias, per, caution


def _dimension(name: str) -> str:
    """Quantity that a sensor measures."""
    return "rate" if name in GYROS else "acceleration"
