"""The reading of names of sections: that of a file, its folders, a label, a variable of a MAT file or a sheet.

A name is a hypothesis that data confirm (`inercal.systems.imu.sections.cutting.checks`). So one that may be read in
two ways says nothing: a date, the number of a recording, ``y_axis``, ``tilt-around-x``, ``360ccw``, ``x_up_gyro``.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Literal

from inercal.foundation.units import parse_unit
from inercal.systems.imu.sections.section import Kind

_FOREIGN = {
    "轴": " axis ", "向上": " up ", "朝上": " up ", "向下": " down ", "朝下": " down ", "静止": " static ",
    "旋转": " rot ", "°": "deg",
}  # fmt: skip
_PLUS = {"pos", "plus", "positive", "p", "positiv"}
_MINUS = {"neg", "minus", "negative", "n", "a", "negativ"}
_UP = {"up", "upward", "upwards", "oben", "arriba", "haut"}
_DOWN = {"down", "dn", "downward", "downwards", "unten", "abajo", "bas"}
_STILL = {"static", "stationary", "rest", "still", "standstill"}
_TURN = {"rot", "rotate", "rotation", "rotating", "turn", "turns", "turning", "drehung"}
_RATE = {"rate", "rates", "vel", "velocity", "angvel", "speed"}
_GYRO = {"gyro", "gyr", "gyros", "gyroscope"}
_ACC = {"acc", "accel", "accelerometer", "acceleration"}
_BESIDE = _ACC | _GYRO | {"imu", "axis", "achse", "axe", "eje", "g"}
"""Words that may stand between an axis and its sign."""

_SENSES = {"cw": -1, "clockwise": -1, "ccw": 1, "acw": 1, "counterclockwise": 1, "anticlockwise": 1}
_RATE_UNITS = {"dps": "deg/s", "rpm": "rpm", "radps": "rad/s"}
_TURN_UNITS = {"turn": 1, "turns": 1, "rev": 1, "revs": 1, "rotations": 1}

#: a whole date, or the time of a day, in a name
_DATE = re.compile(
    r"(?<!\d)(?:(?:19|20)\d\d([-_.]?)\d\d\1\d\d|\d\d([-_.])\d\d\2(?:19|20)\d\d)"
    r"(?:[-_ tT]+\d\d[-_:h]?\d\d[-_:]?\d\d)?(?!\d)"
)
_TOKEN = re.compile(
    r"(?P<number>\d+(?:\.\d+)?)(?P<unit>[a-z]*)|(?P<word>[^\W\d_]+)|(?P<sign>[+-])|(?P<gap>[^\w+-]+|_+)"
)


@dataclass(frozen=True)
class Claim:
    """Words of a name, understood: ``up`` and ``axis`` as ``+x``, empty where it says nothing; SI."""

    kind: Kind | Literal[""] = ""
    up: str = ""
    axis: str = ""
    rate: float | None = None
    """Rate about ``axis`` [rad/s]; None: not said."""
    angle: float | None = None
    """Angle about ``axis`` [rad]; None: not said."""


@dataclass(frozen=True)
class _Facts:
    """Content of a name: axis, its sign and which end of it is up, numbers as (value, unit), other words."""

    axes: frozenset[str] = frozenset()
    sign: int = 0
    side: int = 0
    numbers: tuple[tuple[float, str], ...] = ()
    words: frozenset[str] = field(default_factory=frozenset)

    def number(self, units: Collection[str]) -> tuple[float, str] | None:
        """The first number with one of these units."""
        return next((number for number in self.numbers if number[1] in units), None)


def claim(name: str) -> Claim:
    """The claim of a name; of a path what the file's own name leaves open is told by its two nearest folders."""
    *folders, own = name.replace("\\", "/").strip("/ ").rsplit("/", 2)
    facts = _facts(re.sub(r"(\.[A-Za-z][A-Za-z0-9]{1,6})+$", "", own))
    for folder in reversed(folders):
        outer = _facts(folder)
        facts = replace(
            facts,
            axes=facts.axes or outer.axes,
            sign=facts.sign if facts.axes else facts.sign or outer.sign,
            side=facts.side if facts.axes else facts.side or outer.side,
            numbers=(*facts.numbers, *(number for number in outer.numbers if number[1] in _RATE_UNITS)),
            words=facts.words | outer.words,
        )
    return _concluded(facts)


def _concluded(facts: _Facts) -> Claim:
    """The claim that follows from what stands in a name."""
    still = bool(facts.words & _STILL)
    if len(facts.axes) != 1:
        return Claim("rest") if still and not facts.axes and not facts.words & (_TURN | _RATE) else Claim()
    (letter,) = facts.axes
    up = f"{'+-'[facts.side < 0]}{letter}" if facts.side else ""
    axis = f"{'+-'[(facts.side or facts.sign) < 0]}{letter}"
    sense = next((_SENSES[word] for word in facts.words if word in _SENSES), 1)
    bare = facts.number({""})
    rate = facts.number(_RATE_UNITS) or (bare if facts.words & _RATE else None)
    if rate is not None:
        value = sense * rate[0] * parse_unit(_RATE_UNITS[rate[1] or "dps"]).factor
        return Claim("rate", up, axis, rate=value) if value else Claim("rest", up)
    if facts.words & {"tilt", "tilted", "roll", "pitch", "yaw"}:
        return Claim()
    turning = bool(facts.words & _TURN)
    angle = facts.number({"deg"}) or (bare if turning or not facts.side else None)
    whole = facts.number(_TURN_UNITS)
    degrees = 360.0 * whole[0] if whole else angle[0] if angle else 0.0
    if degrees and degrees % 90.0 == 0.0:
        return Claim("turn", up, axis, angle=sense * degrees * parse_unit("deg").factor)
    if turning:
        return Claim("turn", up, axis)
    if facts.number({"deg"}) or (facts.words & _GYRO and not facts.words & _ACC):
        return Claim()
    force = facts.number({"g"})
    if force is not None and abs(force[0]) == 1.0:
        return Claim("rest", f"{'+-'[force[0] * (facts.sign or 1) < 0]}{letter}")
    if facts.side or facts.sign:
        return Claim("rest", up or axis)
    return Claim("rest") if still else Claim()


def _facts(text: str) -> _Facts:
    """Content of one name."""
    tokens = _tokens(text)
    axes, words, numbers = set(), set(), []
    sign = side = 0
    for place, (kind, word, unit) in enumerate(tokens):
        if kind == "number":
            less = place > 0 and tokens[place - 1][1] in _MINUS - {"a"} | {"-"}
            numbers.append((-float(word) if less else float(word), unit))
        elif kind == "word" and word in "xyz":
            axes.add(word)
            sign = sign or _sign(tokens, place)
        elif kind == "word" and word in _UP | _DOWN:
            side = 1 if word in _UP else -1
        elif kind == "word":
            words.add(word)
    return _Facts(frozenset(axes), sign, side, tuple(numbers), frozenset(words))


def _sign(tokens: list[tuple[str, str, str]], place: int) -> int:
    """The sign of the axis at this place: directly before or behind it, but for words such as ``axis``.

    Of one before a number it is the number's.
    """
    for step in (-1, 1):
        k = place + step
        while 0 <= k < len(tokens) and tokens[k][1] in _BESIDE:
            k += step
        if not 0 <= k < len(tokens) or (
            step > 0
            and k + 1 < len(tokens)
            and tokens[k + 1][0] == "number"
            and (tokens[k + 1][2] or tokens[k][1] in "+-")
        ):
            continue
        if tokens[k][1] in _PLUS | {"+"}:
            return 1
        if tokens[k][1] in _MINUS | {"-"}:
            return -1
    return 0


def _tokens(text: str) -> list[tuple[str, str, str]]:
    """Numbers with their units, words, single axes and signs of a name, each as (kind, text, unit)."""
    for foreign, word in _FOREIGN.items():
        text = text.replace(foreign, word)
    text = _DATE.sub(" ", unicodedata.normalize("NFKC", text))
    text = re.sub(r"(?<=\d)deg ?[CF](?![a-zA-Z])", "celsius", text)
    text = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", " ", text).lower()
    text = re.sub(
        r"deg(?:ree)?s?[ _]*(?:/|per|p|[ _])[ _]*s(?:ec(?:ond)?)?(?![a-z])|degs(?![a-z])", "dps", text
    )
    text = re.sub(r"rads?[ _]*(?:/|per|p|[ _])[ _]*s(?:ec(?:ond)?)?(?![a-z])", "radps", text)
    tokens: list[tuple[str, str, str]] = []
    separated = True  # whether a hyphen here can be a sign: at the start, behind a gap, or behind an axis
    for match in _TOKEN.finditer(text):
        if match["number"]:
            unit = "" if match["unit"] in _SENSES else match["unit"]
            tokens.append(("number", match["number"], "deg" if unit in ("degree", "degrees") else unit))
            tokens += [("word", match["unit"], "")] if unit != match["unit"] else []
        elif match["word"]:
            tokens += [("word", word, "") for word in _parted(match["word"])]
        elif match["sign"] and (match["sign"] == "+" or separated):
            behind = text[match.end() : match.end() + 1]
            if not (tokens and tokens[-1][1] in "xyz" and behind.isalpha() and behind not in "xyz"):
                tokens.append(("sign", match["sign"], ""))
        separated = bool(match["gap"]) or (bool(match["word"]) and tokens[-1][1] in "xyz")
    return _with_units(tokens)


def _with_units(tokens: list[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """The tokens, a unit that stands apart joined to the number before it."""
    joined: list[tuple[str, str, str]] = []
    for kind, word, unit in tokens:
        if (
            joined
            and joined[-1][0] == "number"
            and not joined[-1][2]
            and word in (*_RATE_UNITS, "deg", "g", "turns")
        ):
            joined[-1] = ("number", joined[-1][1], word)
        else:
            joined.append((kind, word, unit))
    return joined


def _parted(word: str) -> tuple[str, ...]:
    """``xminus``, ``zup`` and ``accx`` as two words; any other as it is."""
    known = (_PLUS | _MINUS | _UP | _DOWN | _BESIDE) - {"a", "g"}
    if word[:1] in "xyz" and word[1:] in known:
        return word[0], word[1:]
    if word[-1:] in "xyz" and word[:-1] in known:
        return word[:-1], word[-1]
    return (word,)
