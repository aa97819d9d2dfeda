"""Words of headers: the sensor, the axis and the unit that the name of a column speaks of."""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass

from inercal.foundation.records.read.limits import TITLE

#: unit -> its spellings, reduced as by `unit_of`
_UNITS = {
    "m/s^2": "m/s2 ms-2 m/s/s mps2 ms2 m/sec2 m/sqs m_s2 m/s**2 meters/s2",
    "g": "g gs gee gees g's",
    "mg": "mg millig milli-g mgee",
    "cm/s^2": "cm/s2 gal cms-2",
    "rad/s": "rad/s rads-1 radps radpers rad/second radians/s rad_s r/s",
    "deg/s": "deg/s dps degs-1 degpers deg/second degrees/s degps deg_s grad/s grados/s gradi/s degre/s degres/s",
    "mdeg/s": "mdeg/s mdps mdeg_s mdegs-1 mgrad/s",
    "deg/h": "deg/h deg/hr dph deg/hour",
    "s": "s sec secs second seconds sek",
    "ms": "ms msec millis millisecond milliseconds msecs",
    "us": "us usec micros microsecond microseconds usecs",
    "ns": "ns nsec nanos nanosecond nanoseconds nsecs",
    "degC": "degc c celsius",
    "uT": "ut mt nt gauss mgauss tesla",
    "count": "lsb count counts cnt adc raw digit",
}
_SPELLED = {spelling: unit for unit, spellings in _UNITS.items() for spelling in spellings.split()}

MEASURED = {
    **dict.fromkeys(("m/s^2", "g", "mg", "cm/s^2"), "acc"),
    **dict.fromkeys(("rad/s", "deg/s", "mdeg/s", "deg/h"), "gyro"),
    **dict.fromkeys(("s", "ms", "us", "ns"), "t"),
    "degC": "temperature",
    "uT": "mag",
}
"""Sensor, or other quantity, that a unit measures."""

#: what speaks of a sensor; of several words the one nearest to the axis counts
_SENSORS = {
    "mag": r"mag\w*|field|b|m|磁\w*|compass|h",
    "other": r"roll|pitch|yaw|euler|angle|heading|ori\w*|quat\w*|q|attitude|rpy|pos\w*|vel\w*|velocity|temp\w*|grav\w*",
    "gyro": r"gyr\w*|giro\w*|angular\w*|ang|omega|w|rot\w*|rate|drehrate|winkelgeschw\w*|角速度\w*|陀螺\w*|gy",
    "acc": r"ac|acc|accel\w*|accl\w*|acceler\w*|aceler\w*|beschl?\w*|加速度\w*|specific|force|f|lin|linear",
}
_TIME = (
    r"t|times?|time\w*|timestamp|stamps?|ts|secs?|elapsed|millis\w*|micros\w*|nsecs?|zeit\w*|laufzeit|temps|tiempo|"
    r"tempo|hora|heure|时间|epoch|clock|tow|seconds?|milliseconds|uhrzeit|datum|date|datetime"
)
_NEVER = (
    r"bias\w*|drift|cov\w*|std|sd|sigma|var|variance|err\w*|status|clip\w*|setpoint|cmd|command\w*|demand\w*|desired|"
    r"motor|debug|true|ideal|jerk"
)
_SELDOM = r"user|free|gravity|offset|relative|ref|nominal|gt|truth|groundtruth|sim|clean"
_HOW = (  # how the output of one device was treated
    r"raw|filt\w*|lp|smooth\w*|cal\w*|uncal\w*|corr\w*|comp\w*|meas\w*|noisy|data|sensor\w*|out\w*|val\w*|vec\w*|field|adc|"
    + _SELDOM
)
_PLACES = r"left|right|upper|lower|front|rear|back|top|bottom|inner|outer|master|slave|primary|secondary|main|backup"


@dataclass(frozen=True)
class Said:
    """Meaning of the name of a column: ``sensor`` (acc, gyro, mag, t, other or empty), ``axis``, ``unit``, and the
    ``stem`` that the three names of a triad share; ``never`` marks a word that no sensor's output bears (bias,
    covariance), ``seldom`` one that gives way to a plain triad (user, free)."""

    sensor: str = ""
    axis: str = ""
    unit: str = ""
    stem: str = ""
    never: bool = False
    seldom: bool = False


def unit_of(text: str) -> str:
    """The unit that a text spells, empty if it is none known here; brackets, powers and degree signs do not matter."""
    plain = text.strip().lower()
    for sign, spelled in (("²", "2"), ("°", "deg"), ("º", "deg"), ("µ", "u"), ("μ", "u"), ("·", ".")):
        plain = plain.replace(sign, spelled)
    plain = re.sub(r"[\s^()*\\]|\.(?=s-)", "", plain)
    return _SPELLED.get(plain) or _SPELLED.get(plain.replace("sec", "s"), "")


def words_of(name: str) -> list[str]:
    """The words of a name in small letters; axes apart: ``GyrX``, ``gFx``, ``XACCL`` and ``gyro_rad[0]`` hold one."""
    name = name.translate(str.maketrans("éèóí", "eeoi"))
    name = re.sub(r"\[([012])\]", lambda index: f" {'xyz'[int(index[1])]} ", name)
    name = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})|(?<=[一-鿿])(?=[A-Za-z])", " ", name)
    parted = []
    words = re.findall(r"[a-z一-鿿]+|\d+", name.lower())
    for word, after in zip(words, [*words, ""][1:], strict=True):
        if word in ("velocity", "gravity") or (word == "gy" and after in ("x", "y", "z")):
            parted.append(word)  # the last letter is no axis
        elif match := re.fullmatch(r"([xyz])(gyro\w*|acc\w*|mag\w*)", word):
            parted += [match[2], match[1]]
        elif match := re.fullmatch(r"([xyz])(?:axis|achse)", word):
            parted.append(match[1])
        elif (match := re.fullmatch(r"(.{1,16})([xyz])", word)) and (_sensor(match[1]) or match[1] in "ag"):
            parted += [match[1], match[2]]
        else:
            parted.append(word)
    return parted


@functools.lru_cache(1 << 14)
def said(name: str, beside: str | None = None) -> Said:
    """Meaning of the ``name`` of a column, and of the unit stated ``beside`` it; none of one too long for a title."""
    if len(name) > TITLE or len(beside or "") > TITLE:
        return Said()
    brackets = re.findall(r"[\[(]((?![012]\])[^\[\]()]*(?:\([^()]*\))?)[\])]", name)
    unit = next((unit for text in (beside or "", *reversed(brackets)) if (unit := unit_of(text))), "")
    words = words_of(re.sub(r"[\[(](?![012]\])[^\])]*[\])]", " ", name))
    if not unit and len(words) == 1 and len(words[0]) > 1 and MEASURED.get(unit_of(words[0])) == "t":
        return Said("t", "", unit_of(words[0]), f"{words[0]} |")  # as the columns ms and micros
    if not unit:
        unit, words = _unit_at_end(words)
    if not unit and len(words) > 2 and words[-1] in "xyz":
        # or before the axis, as gyro_rad[0] and accelerometer_m_s2[0]
        for count in (3, 2, 1):
            stated = "rad/s" if words[-2] == "rad" else unit_of("".join(words[-1 - count : -1]))
            if len(words) > count + 1 and MEASURED.get(stated) in ("acc", "gyro") and stated != "g":
                unit, words = stated, [*words[: -1 - count], words[-1]]
                break
    axes = [place for place, word in enumerate(words) if word in ("x", "y", "z")]
    if not axes:
        # axes by number, behind the word of a sensor
        axes = [
            place for place, word in enumerate(words)
            if word in ("1", "2", "3") and place and place == len(words) - 1
            and (_sensor(words[place - 1]) or MEASURED.get(unit) in ("acc", "gyro"))
        ]  # fmt: skip
    axis = words[axes[-1]].translate(str.maketrans("123", "xyz")) if axes else ""
    before = words[: axes[-1]] if axes else words
    after = words[axes[-1] + 1 :] if axes else []
    sensor = next((sensor for word in (*reversed(before), *after) if (sensor := _sensor(word))), "")
    if not sensor and before and before[-1] in ("a", "g"):
        sensor = {"a": "acc", "g": "gyro"}[before[-1]]
    if {"velocity", "vel"} & set(words) and {"ang", "angular"} & set(words):
        sensor = "gyro"
    if not axes and any(re.fullmatch(_TIME, word) for word in words):
        sensor = "t"
    measures = MEASURED.get(unit, "")
    if measures == "t" and len(words) == 1 and axes:
        return Said("t", "", unit, f"{axis} |")  # an abscissa
    if measures in ("acc", "gyro", "mag") and axis and sensor != "other":
        sensor = measures
    elif measures in ("t", "temperature") and not axes:
        sensor = "t" if measures == "t" and sensor in ("", "t") else sensor or "other"
    ends = " ".join(words[-3:-1])
    if axis and not unit and "." in name and ends in ("angular velocity", "linear acceleration"):
        unit = "rad/s" if sensor == "gyro" else "m/s^2"  # fields of a ROS message, which is defined so
    never = any(re.fullmatch(_NEVER, word) for word in words)
    seldom = any(re.fullmatch(_SELDOM, word) for word in words)
    return Said(sensor, axis, unit, " ".join([*before, "|", *after]), never, seldom)


def sensors_named(text: str) -> list[str]:
    """The sensors that a file's name, or a line above the numbers, speaks of by a word of at least three letters."""
    found = [_sensor(word) for word in words_of(text) if len(word) > 2]
    return [sensor for sensor in ("acc", "gyro", "mag") if sensor in found]


def device_of(name: str) -> tuple[str, ...]:
    """The words of a column's name other than on sensor, axis, unit and treatment, as ``("imu", "2")``."""
    stem = said(name).stem.split()
    return tuple(word for word in stem if word != "|" and not _sensor(word) and not re.fullmatch(_HOW, word))


def is_size(name: str) -> bool:
    """True for the name of a norm or total, which is no output of a sensor."""
    return any(
        re.fullmatch(r"abs|norm|mag|magnitude|total|resultant|rms|sum|mean|max|peak", word)
        for word in words_of(name)
    )


def is_one_of_several(device: tuple[str, ...]) -> bool:
    """True for words that tell devices alike apart: a number at the end, or a place."""
    return bool(device) and (device[-1].isdigit() or any(re.fullmatch(_PLACES, word) for word in device))


def _sensor(word: str) -> str:
    """The sensor that a word stands for, empty if for none."""
    return next((sensor for sensor, pattern in _SENSORS.items() if re.fullmatch(pattern, word)), "")


def _unit_at_end(words: list[str]) -> tuple[str, list[str]]:
    """A unit as the last one to three words, as in ``acc_x_m_s2``, and the words before it."""
    for count in (3, 2, 1):
        tail = words[-count:]
        if len(words) <= count:
            continue
        for text in ("".join(tail), "/".join(tail), "_".join(tail)):
            unit = unit_of(text)
            if unit and not (unit == "g" and count > 1) and text not in ("c", "adc", "raw"):
                return unit, words[:-count]
    return "", words
