"""The one table of terms: symbol, long name, unit, order. `term` finds the row of any name in a result.

API names, JSON, plots and reports all use these symbols ("IEEE-style" names). Units are those of the value
in a result; ``output`` stands for the unit of the instrument's output (m/s^2, deg/s, count, ...).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from inercal.foundation.errors import QuantityError
from inercal.foundation.instruments.platform_terms import PLATFORM
from inercal.foundation.units import STANDARD_GRAVITY, Unit, parse_unit


@dataclass(frozen=True)
class Term:
    """One coefficient of an instrument; in its ``unit`` ``output`` stands for that of the instrument's output."""

    symbol: str
    name: str
    unit: str

    def unit_for(self, output: str) -> str:
        """The unit with the output unit put in, for example ``count/(m/s^2)``."""
        if self.unit.startswith("output"):
            rest = self.unit.removeprefix("output")
            return f"({output}){rest}" if rest and "/" in output else f"{output}{rest}"
        return self.unit


_AXES = "xyz"
_ACCELEROMETER = (
    *(Term(f"K0_{i}", f"accelerometer {i} bias: output at zero specific force", "output") for i in _AXES),
    *(Term(f"K1_{i}", f"accelerometer {i} scale factor", "output/(m/s^2)") for i in _AXES),
    *(
        Term(f"M_{i}{j}", f"misalignment: response of accelerometer {i} to specific force along {j}", "rad")
        for i, j in ("xy", "xz", "yz")
    ),
)
_ON_A_TABLE = (
    *(
        Term(f"r_{i}{j}", f"lever arm: place of accelerometer {i} along {j} from the origin of b", "m")
        for i in _AXES
        for j in _AXES
    ),
    Term("tau_a", "delay of the accelerometers", "s"),
    Term("tau_g", "delay of the gyro", "s"),
)
_GYRO = (
    *(Term(f"D_F_{i}", f"gyro {i} bias: output at zero rate", "output") for i in _AXES),
    *(Term(f"S_{i}", f"gyro {i} scale factor", "output/(rad/s)") for i in _AXES),
    *(
        Term(f"T_{i}{j}", f"misalignment: response of gyro {i} to rate about {j}", "rad")
        for i in _AXES
        for j in _AXES
        if i != j
    ),
    *(
        Term(f"G_{i}{j}", f"g-sensitive drift: gyro {i} output per force along {j}", "output/(m/s^2)")
        for i in _AXES
        for j in _AXES
    ),
    *(
        Term(f"D_R_{i}", f"gyro {i} bias drift: change of its bias per time (ramp)", "output/s")
        for i in _AXES
    ),
)

_RATE_TEST = tuple(
    Term(f"{symbol}_{i}", f"gyro {i} {name}", unit)
    for i in _AXES
    for symbol, name, unit in (
        ("S_asym", "scale-factor asymmetry: difference for positive and negative rates over S", "1"),
        ("S2", "second-order coefficient, of the square of the rate", "1/(rad/s)"),
        ("S3", "third-order coefficient, of the cube of the rate", "1/(rad/s)^2"),
        ("S_nl", "non-linearity: largest residual from the best straight line, over full scale", "1"),
        ("S_hyst", "hysteresis: largest difference at a rate reached both ways, over full scale", "1"),
    )
)

_GYRO_BY_ANGLE = tuple(
    Term(f"G_{i}{j}{k}", f"drift of gyro {i} per {of} of force along {j}{along}", "output/(m/s^2)^2")
    for i in _AXES
    for j, k in ("xx", "yy", "zz", "xy", "xz", "yz")
    for of, along in [("square", "") if j == k else ("product", f" and {k}")]
)

_ACCELEROMETER_BY_ANGLE = (
    *(
        Term(f"M_{i}{j}", f"misalignment: response of accelerometer {i} to specific force along {j}", "rad")
        for i, j in ("yx", "zx", "zy")
    ),
    *(
        Term(f"{symbol}_{i}", f"accelerometer {i} {name}", unit)
        for i in _AXES
        for symbol, name, unit in (
            ("K2", "second-order coefficient, of the square of the input", "1/(m/s^2)"),
            ("K3", "third-order coefficient, of the cube of the input", "1/(m/s^2)^2"),
            ("Koq", "odd quadratic coefficient, of the input times its magnitude", "1/(m/s^2)"),
            ("Kip", "cross-coupling of input and pendulous axis", "1/(m/s^2)"),
            ("Kio", "cross-coupling of input and output axis", "1/(m/s^2)"),
            ("Kpo", "cross-coupling of pendulous and output axis", "1/(m/s^2)"),
            ("Kpp", "cross-axis coefficient, of the square along the pendulous axis", "1/(m/s^2)"),
            ("Koo", "cross-axis coefficient, of the square along the output axis", "1/(m/s^2)"),
            ("K_dz", "dead zone: width of the inputs about level to which there is no response", "m/s^2"),
            ("K_th", "threshold: input from the middle of the dead zone with half of its response", "m/s^2"),
            ("K_hyst", "hysteresis: output after the input was raised less after lowered, over K1", "m/s^2"),
        )
    ),
)

# a is the gravity reference in units of the site's gravity, a = [0 0 -1] C_nb: an accelerometer reads -a
_DRIFT = tuple(
    Term(symbol, name, unit)
    for axis, k in (("X", "k"), ("Y", "kY"))
    for symbol, name, unit in (
        *((f"{k}_{i}", f"axis {axis}: output per rate about {i}", "output/(rad/s)") for i in _AXES),
        (f"D{axis}_F", f"axis {axis}: fixed drift", "output"),
        *((f"D{axis}_{i}", f"axis {axis}: drift per gravity along {i}", "output") for i in "XYZ"),
        *(
            (f"D{axis}_{i}{i}", f"axis {axis}: drift per square of gravity along {i}", "output")
            for i in "XYZ"
        ),
        *(
            (f"D{axis}_{i}{j}", f"axis {axis}: drift per product of gravity along {i} and {j}", "output")
            for i, j in ("XY", "XZ", "YZ")
        ),
    )
)

#: every term, in the order results list them
TERMS: dict[str, Term] = {
    term.symbol: term
    for term in (
        *_ACCELEROMETER,
        *_GYRO,
        *_GYRO_BY_ANGLE,
        *_RATE_TEST,
        *_ACCELEROMETER_BY_ANGLE,
        *_DRIFT,
        *(Term(*each) for each in PLATFORM),
        *_ON_A_TABLE,
    )
}

ACCELEROMETER_TRIAD = tuple(term.symbol for term in _ACCELEROMETER)
"""K0, K1 and the upper-triangular M of an accelerometer triad that defines the frame."""

ACCELEROMETERS_IN_A_FRAME = (*ACCELEROMETER_TRIAD, "M_yx", "M_zx", "M_zy")
"""K0, K1 and all of M, where positions or a table define the frame."""

GYRO_TRIAD = tuple(term.symbol for term in _GYRO if not term.symbol.startswith(("G_", "D_R_")))
"""D_F, S and the six T of a gyro triad."""

GYRO_G_SENSITIVITY = tuple(term.symbol for term in _GYRO if term.symbol.startswith("G_"))
"""The nine g-sensitive drift coefficients of a gyro triad, row i the gyro axis."""

NOISE_TERMS: dict[str, Term] = {
    term.symbol: term
    for term in (
        Term("N", "angle or velocity random walk: white noise", "output*sqrt(s)"),
        Term("B", "bias instability: flicker noise, with a floor of 0.664 B", "output"),
        Term("K", "rate or acceleration random walk", "output/sqrt(s)"),
        Term("R", "ramp: a steady change", "output/s"),
        Term("Q", "quantisation noise", "output*s"),
    )
}
"""Noise of one channel, in the order results list it; names of parameters end in the channel: ``N_gyro_x``."""

#: SI unit of a channel -> {symbol: (SI unit of the coefficient, the unit people use)}
_NOISE_UNITS = {
    "rad/s": {
        "N": ("rad/sqrt(s)", "deg/sqrt(h)"),
        "B": ("rad/s", "deg/h"),
        "K": ("rad/s/sqrt(s)", "deg/h/sqrt(h)"),
        "R": ("rad/s^2", "deg/h/h"),
        "Q": ("rad", "arcsec"),
    },
    "m/s^2": {
        "N": ("m/s/sqrt(s)", "ug/sqrt(Hz)"),
        "B": ("m/s^2", "ug"),
        "K": ("m/s^2/sqrt(s)", "ug/sqrt(h)"),
        "R": ("m/s^3", "ug/h"),
        "Q": ("m/s", "ug*s"),
    },
}


def noise_term(symbol: str, channel_unit: str) -> str:
    """Unit of N, B, K, R or Q of a channel in ``channel_unit``, such as ``rad/sqrt(s)`` for N of ``rad/s``."""
    if channel_unit in _NOISE_UNITS:
        return _NOISE_UNITS[channel_unit][symbol][0]
    return NOISE_TERMS[symbol].unit_for(channel_unit)


def noise_shown(symbol: str, channel_unit: str) -> str:
    """The unit in which people quote that coefficient, such as ``deg/sqrt(h)``; `noise_term` where none is known."""
    if channel_unit in _NOISE_UNITS:
        return _NOISE_UNITS[channel_unit][symbol][1]
    return noise_term(symbol, channel_unit)


#: sensors of a model that pitches: those of which there is one
MODEL_TERMS = {
    term.symbol: term
    for term in (
        Term("b_g", "bias of the gyro", "rad/s"),
        Term("b_roll", "bias of the roll gyro", "rad/s"),
        Term("b_yaw", "bias of the yaw gyro", "rad/s"),
        Term("k_g", "scale of the gyro", "1"),
        Term("tau", "delay of all sensors against the reference", "s"),
    )
}

#: and those that are numbered: how the name begins
NUMBERED_TERMS = {
    term.symbol: term
    for term in (
        Term("b", "bias of accelerometer {}", "m/s^2"),
        Term("dr", "position of accelerometer {}, forward", "m"),
        Term("zo", "position of accelerometer {}, up", "m"),
        Term("S", "scale of accelerometer {}, less 1", "1"),
        Term("dlambda", "axis of accelerometer {}, towards down", "rad"),
    )
}

#: ending of a coefficient of a temperature model -> what it is of its term, and its unit over that of the term
_OVER_TEMPERATURE = {
    "T1": (", per kelvin", "/K"),
    "T2": (", per kelvin squared", "/K^2"),
    "T3": (", per kelvin cubed", "/K^3"),
    "T4": (", by the fourth power of kelvins", "/K^4"),
    "T5": (", by the fifth power of kelvins", "/K^5"),
    "hyst": (", rising less falling temperature", ""),
}

_CHANNEL = r"(?:acc|gyro|y)_[xyz]|a\d+|gyro(?:_roll|_yaw)?"


def term(name: str) -> Term | None:
    """The row of the table for a name in a result; None if there is none.

    Beside those of `TERMS` names may carry a sensor's number (``b_2``), a channel after the symbol of its noise
    (``N_gyro_x``), or a power of the temperature after a term or channel (``K0_x_T1``, ``gyro_x_hyst``).

    Examples
    --------
    >>> term("b_2").name
    'bias of accelerometer 2'
    >>> term("D_F_x_T1").unit_for("count")
    'count/K'
    """
    if name in TERMS or name in MODEL_TERMS:
        return TERMS.get(name) or MODEL_TERMS[name]
    begun, _, end = name.rpartition("_")
    if end in _OVER_TEMPERATURE and (of := term(begun) or _output(begun)) is not None:
        words, unit = _OVER_TEMPERATURE[end]
        return Term(name, of.name + words, of.unit + unit)
    if begun in NUMBERED_TERMS and end.isdigit():
        return replace(NUMBERED_TERMS[begun], symbol=name, name=NUMBERED_TERMS[begun].name.format(end))
    symbol, _, channel = name.partition("_")
    if symbol in NOISE_TERMS and re.fullmatch(_CHANNEL, channel):
        return replace(NOISE_TERMS[symbol], symbol=name, name=f"{channel}: {NOISE_TERMS[symbol].name}")
    return _output(name)


def _output(channel: str) -> Term | None:
    """The output of a channel at rest, as of a temperature model; None if there is no such channel."""
    return Term(channel, f"{channel}: output at rest", "output") if re.fullmatch(_CHANNEL, channel) else None


#: SI unit -> that of the field, in which data sheets and studies have it
_OF_FIELD = {
    "rad/s": "deg/h",
    "rad": "arcsec",
    "m/s^2": "ug",
    "m": "mm",
    "s": "ms",
    "rad/sqrt(s)": "deg/sqrt(h)",
    "(rad/s)/(m/s^2)": "deg/h/g",
    "rad/(m/s^2)": "arcsec/g",
    "rad/s/K": "deg/h/K",
    "m/s^2/K": "ug/K",
    "1/K": "ppm/K",
}

#: unit of the field -> that of larger things, and from how many of the latter on it is taken
_LARGE = {"deg/h": ("deg/s", 0.01), "ug": ("mg", 1.0), "arcsec": ("deg", 1.0 / 60.0)}


def shown_unit(si: str, output: Unit | None = None) -> tuple[str, float]:
    """A unit for people, and how many of the SI unit it is: deg/h, arcsec, ug, mm, ms, ppm; others stay.

    Where the ``output`` of the instrument is in another unit, rates and accelerations are in that one, but ``ug`` where
    it is g or m/s^2.
    """
    if si == "1" and output is None:
        return "ppm", 1e-6
    if si.startswith("1/(m/s^2)"):
        power = 2 if si.endswith("^2") and si != "1/(m/s^2)" else 1
        return f"ug/g^{power + 1}", 1e-6 / STANDARD_GRAVITY**power
    if (
        output is not None
        and (si != "m/s^2" or output.symbol not in ("g", "m/s^2"))
        and si not in ("rad", "m")
    ):
        if output.factor == 1.0 or not si.startswith(output.si):
            return si, 1.0
        return output.symbol + si.removeprefix(output.si), output.factor
    if si not in _OF_FIELD:
        return si, 1.0
    unit = parse_unit(_OF_FIELD[si])
    return unit.symbol, unit.factor


def sized(u: float, si: str) -> tuple[float, str]:
    """An uncertainty for people: a large rate in deg/s, acceleration in mg, angle in deg; a whole as it is."""
    if si == "1" and u == 1.0:
        return u, si
    text, size = shown_unit(si)
    larger, least = _LARGE.get(text, (text, 0.0))
    if larger != text and u / parse_unit(larger).factor >= least:
        return u / parse_unit(larger).factor, larger
    return u / size, text


def sized_ratio(unit: str) -> tuple[str, float]:
    """A unit for people, and how many of the old it is: a sensitivity per unit of its own output, g/g for g/(m/s^2)."""
    match = re.fullmatch(r"\(?(.+?)\)?/\((m/s\^2|rad/s)\)(.*)", unit)
    if match is None or match[1] == match[2] or match[1] in ("1", "count", "V"):
        return unit, 1.0
    try:
        output = parse_unit(match[1])
    except QuantityError:
        return unit, 1.0
    if output.si != match[2]:
        return unit, 1.0
    per = f"({match[1]})" if "/" in match[1] else match[1]
    return f"{per}/{per}{match[3]}", 1.0 / output.factor


def resting_on(channel: str, names: Sequence[str]) -> tuple[str, ...]:
    """Those of ``names`` that the output of a channel leads to; all where the table does not tell, as for angles.

    None where all belong to other channels, as accelerometers where a gyro is dead.

    Examples
    --------
    >>> resting_on("gyro_x", ("K0_x", "D_F_x", "S_y"))
    ('D_F_x', 'S_y')
    >>> resting_on("gyro_x", ("K0_x", "K1_x"))
    ()
    """
    by_name = [n for n in names if n == channel or n.startswith(f"{channel}_") or n.endswith(f"_{channel}")]
    if by_name or channel == "t":
        return tuple(by_name or names)
    if channel == "temperature":
        return tuple(names) if any(n.rpartition("_")[2] in _OVER_TEMPERATURE for n in names) else ()
    sensor = channel if channel.startswith("y_") else channel.partition("_")[0]
    others = set[str]().union(*_SYMBOLS_OF.values()) if sensor in _SYMBOLS_OF else ()
    rest = [n for n in names if n not in others and not re.search(rf"(?:^|_)(?:{_CHANNEL})(?:_|$)", n)]
    return tuple([n for n in names if n in _SYMBOLS_OF.get(sensor, ())] or rest)


#: sensor -> symbols of what is found from its output
_SYMBOLS_OF = {
    "acc": {term.symbol for term in (*_ACCELEROMETER, *_ACCELEROMETER_BY_ANGLE)},
    "gyro": {term.symbol for term in (*_GYRO, *_GYRO_BY_ANGLE, *_RATE_TEST)},
    "y_x": {term.symbol for term in _DRIFT if term.symbol.startswith(("DX_", "k_"))},
    "y_y": {term.symbol for term in _DRIFT if term.symbol.startswith(("DY_", "kY_"))},
}
