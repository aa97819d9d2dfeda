"""Reference types of digital calibration certificates for inertial instruments: one for each kind of coefficient.

No official ones exist. A type is ``inertial_`` and the symbol of `inercal.foundation.instruments.terms` without axes,
numbers of sensors and channels, which the label of each value has.
"""

from __future__ import annotations

import re
from functools import cache

from inercal.foundation.instruments.terms import (
    MODEL_TERMS,
    NOISE_TERMS,
    NUMBERED_TERMS,
    TERMS,
    Term,
    term,
)

PREFIX = "inertial_"

OTHERS = {
    "inertial_coefficients": "coefficients of an instrument, a quantity each; its label is the name in inercal",
    "inertial_files": "files that belong to a result",
    "inertial_covariance": "covariance of the coefficients of a result, as a rectangular region of D-SI",
    "inertial_model": "equation of the model whose coefficients these are",
    "inertial_result": "a result as inercal wrote it, in JSON; the certificate states the same numbers",
    "inertial_report": "report of a result, as a page",
    "inertial_gravity": "gravity at the place of the calibration",
    "inertial_latitude": "latitude of the place of the calibration",
}
"""Types of parts of a certificate that are no coefficients."""

_POWER = re.compile(r"_(T[123]|hyst)$")
_AXES = re.compile(r"_(?:[xyz]{1,3}|[po][xyz])$")

#: symbols whose terms are worded differently from axis to axis
_WORDS = {
    "G": "g-sensitive drift: gyro i output per force along j",
    "r": "lever arm: place of accelerometer i along j from the origin of b",
    "G2": "drift of gyro i per square or product of force along j and k",
    "eta": "misalignment of accelerometers of a platform: response to specific force across the axis",
    "ds": "misalignment of gyro i of a platform: rate about i per rate about the next axis",
    "do": "misalignment of gyro i of a platform: rate about i per rate about the axis after the next, reversed",
}


def reference_type(name: str) -> str | None:
    """The reference type of a coefficient by its name in a result; None of one that the terms do not know.

    Examples
    --------
    >>> reference_type("M_xy"), reference_type("N_gyro_x"), reference_type("b_2"), reference_type("K0_x_T1")
    ('inertial_M', 'inertial_N', 'inertial_b', 'inertial_K0_T1')
    """
    if term(name) is None:
        return None
    begun = _POWER.sub("", name)
    power = name.removeprefix(begun) if begun not in TERMS or name not in TERMS else ""
    return PREFIX + _symbol(begun if power else name) + power


def _symbol(name: str) -> str:
    """The symbol without axes, number or channel."""
    if name in TERMS:
        if name.startswith("harmonic_"):
            return re.sub(r"_\d+_", "_", name)
        short = _AXES.sub("", name)
        return "G2" if short == "G" and len(name) == 5 else short
    if name in MODEL_TERMS:
        return name
    begun, _, rest = name.partition("_")
    if begun in NUMBERED_TERMS and rest.isdigit():
        return "S_number" if begun == "S" else begun
    return begun if begun in NOISE_TERMS else "output"


@cache
def reference_types() -> dict[str, tuple[str, str]]:
    """Every reference type of a coefficient at one temperature -> its meaning, and its unit as in the terms.

    A further ending ``_T1``, ``_T2`` or ``_T3`` is of a coefficient's change per power of the temperature, ``_hyst`` of
    its difference between rising and falling temperature.
    """
    found: dict[str, tuple[str, str]] = {}
    numbered = {f"{symbol}_1": each for symbol, each in NUMBERED_TERMS.items()}
    noise = {f"{symbol}_gyro_x": each for symbol, each in NOISE_TERMS.items()}
    for name, each in {**TERMS, **MODEL_TERMS, **numbered, **noise}.items():
        kind = reference_type(name)
        assert kind is not None
        found.setdefault(kind, (_meaning(kind, each), each.unit))
    return found | {f"{PREFIX}output": ("output of a channel at rest", "output")}


def _meaning(kind: str, each: Term) -> str:
    """The name of a term with i, j and k in the place of its axes."""
    words = _WORDS.get(kind.removeprefix(PREFIX))
    if words is not None:
        return words
    letters: dict[str, str] = {}

    def letter(axis: re.Match[str]) -> str:
        return letters.setdefault(axis[0], "ijk"[min(len(letters), 2)])

    plain = re.sub(r"item \d+", "item i", each.name.replace("{}", "i"))
    return plain if kind.endswith(("enc", "_sin", "_cos")) else re.sub(r"\b[xyz]\b", letter, plain)
