"""The instrument in the commented study of a turntable: examples for its kind, in a unit of its outputs."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from inercal.instruments.by_angle import CHANNELS
from inercal.units import Unit

#: kind -> key, value for outputs of rate or acceleration, value for others (``{u}``), comment; of the channel on
#: axis ``{x}`` (``{k}`` and ``{D}`` begin its terms), beside which lies ``{o}``; ``{need}`` of what must be stated
_EXAMPLES = {
    "gyrowheel": (
        ("terms", '["{D}_F", "{D}_X", "{k}_x"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"0.01 deg/h"', '"0.1{u}"', 'of a reading, or "0.001 deg/sqrt(h)"; from the scatter if absent'),
        ("{D}_F", '"50 deg/h"', '"50{u}"', "fixed drift, in the unit of the outputs"),
        ("{D}_X", '"60 deg/h/g"', '"60{u}/g"', "per gravity along x; g is 9.80665 m/s^2"),
        ("{D}_XX", '"2 deg/h/g^2"', '"2{u}/g^2"', "per square of gravity along x"),
        ("{k}_x", '"1.000(2)"', '"2.50(2){u}/(deg/h)"', "response to earth rate about x{need}"),
    ),
    "gyro": (
        ("terms", '["D_F_{x}", "S_{x}"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"0.1 deg/h"', '"0.1{u}"', 'of a reading, or "0.01 deg/sqrt(h)"; from the scatter if absent'),
        ("D_F_{x}", '"5 deg/h"', '"5{u}"', "bias, in the unit of the outputs"),
        ("S_{x}", '"1.0000(2)"', '"1000(1){u}/(deg/s)"', "scale factor{need}"),
        ("T_{x}{o}", '"20 arcsec"', '"20 arcsec"', "misalignment: response to rate about {o}"),
        ("G_{x}{x}", '"1 deg/h/g"', '"1{u}/g"', "drift per specific force along {x}"),
    ),
    "accelerometer": (
        ("terms", '["K0_{x}", "K1_{x}"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"20 ug"', '"0.1{u}"', 'of a reading, or "5 ug/sqrt(Hz)"; from the scatter if absent'),
        ("K0_{x}", '"100 ug"', '"10{u}"', "bias, in the unit of the outputs"),
        ("K1_{x}", '"1.0002"', '"1000{u}/g"', "scale factor"),
        ("M_{x}{o}", '"20 arcsec"', '"20 arcsec"', "misalignment: response to specific force along {o}"),
        ("K2_{x}", '"5 ug/g^2"', '"5 ug/g^2"', "of the square of specific force"),
    ),
}  # fmt: skip
_USUAL_UNIT = {"gyrowheel": "deg/h", "gyro": "deg/h", "accelerometer": "g"}
_RESPONSE = {"gyrowheel": "{k}", "gyro": "S"}


def instrument_lines(channels: Mapping[str, Unit | None]) -> str:
    """The tables ``[instrument]`` and ``[instrument.coefficients]``, each key with its comment.

    Parameters
    ----------
    channels : mapping
        Those of a record, which tell the kind, a gyrowheel where they do not; with their units, where known. Where
        there is no record, the examples are in force, so that there is something to simulate and to design for.
    """
    kind = _kind(channels)
    name = next((name for name in CHANNELS[kind] if name in channels), CHANNELS[kind][0])
    axis, unit = name[-1], channels.get(name)
    raw = unit is not None and unit.dimension not in ("rate", "acceleration")
    words = {
        "x": axis,
        "o": "yzx"["xyz".index(axis)],
        "k": {"x": "k", "y": "kY"}.get(axis, ""),
        "D": {"x": "DX", "y": "DY"}.get(axis, ""),
        "need": "; needed where it is not fitted" if raw else "",
        # a pure number is written without a unit
        "u": "" if unit is None or unit.symbol == "1" else f" {unit.symbol}",
    }
    terms, noise, *coefficients = (
        (key.format(**words), ((other if raw else "") or value).format(**words), comment.format(**words))
        for key, value, other, comment in _EXAMPLES[kind]
    )
    example = _example if channels else _line
    others = ", ".join(f'"{other}"' for other in CHANNELS if other != kind)
    lines = [
        f"{'[instrument]':35s} # what is on the table",
        _line("kind", f'"{kind}"', f"or {others}"),
        example(
            "unit", f'"{_USUAL_UNIT[kind]}"', "of its outputs in a simulation; that of the noise if absent"
        )
        if unit is None
        else _line("unit", f'"{unit.symbol}"', "of its outputs, as the record has it"),
        _example(*terms),
        example(*noise) if not raw else _example(*noise[:2], "of a reading; from the scatter if absent"),
        _example("dwell", '"60 s"', "time in each position [s]"),
        _example("bias_drift", '"linear"', "that is fitted: or exponential, random_walk; none if absent"),
        _example("sample_rate", '"10 Hz"', "of a simulated recording [Hz]; one row a position if absent"),
    ]
    if kind in _RESPONSE:
        response = _RESPONSE[kind].format(**words)
        response_words = (
            f'"stated", which needs {response} below' if raw else f'"stated": {response} of the table below'
        )
        lines.append(
            _example("earth_rate", '"fitted"', f"or {response_words}; if absent where the plan allows")
        )
    lines += [
        "",
        f"{'[instrument.coefficients]':35s} # true values to simulate; stated ones of what is not fitted",
        *(example(*each) for each in coefficients),
    ]
    return "\n".join(lines) + "\n"


def _kind(channels: Collection[str]) -> str:
    """The kind of instrument that has these channels; of a whole IMU the accelerometers, but in a rate test."""
    order = ["gyrowheel", "accelerometer", "gyro"]
    if "rate" in channels:
        order.reverse()
    return next((kind for kind in order if not set(CHANNELS[kind]).isdisjoint(channels)), "gyrowheel")


def _line(key: str, value: str, comment: str) -> str:
    """A key with its comment."""
    return f"{f'{key} = {value}':35s} # {comment}"


def _example(key: str, value: str, comment: str) -> str:
    """A key that is commented out."""
    return _line(f"# {key}", value, comment)
