"""To and from imu_tk: ``x = T K (raw - b)``, one text file a sensor.

T has a unit diagonal and is upper-triangular for accelerometers that define the frame; K is diagonal [SI unit per
output]. With our y = S M x + b: T K = (S M)^-1, so K is the diagonal of that inverse and T its columns over K,
and b is ours. Where M is upper-triangular T = M^-1 and the frames are the same; T_xy, the negative of what the
source calls mis_yz, is -M_xy to first order. Any other M is held exactly by a full T. There is no place for
g-sensitivity.

The file holds T, K and b in 21 numbers, rows first; imu_tk reads no further, so that the unit of the outputs can
follow in words.

Source: CalibratedTriad_ in include/imu_tk/calibration.h of github.com/Kyle-ak/imu_tk; Tedaldi, Pretto, Menegatti,
ICRA 2014, eq. (7) to (9).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from inercal.faces.convert.convention import (
    FORCE,
    RATE,
    Convention,
    Terms,
    Units,
    digits,
    inverse,
    per,
    triad_of_gain,
    units_in,
    units_line,
)
from inercal.faces.convert.correct import ImuModel
from inercal.foundation.errors import InputError


def terms(model: ImuModel) -> Terms:
    """``T_a, K_a, b_a`` and, where there is a gyro, ``T_g, K_g, b_g``; it has no place for g-sensitivity."""
    by_name: Terms = {}
    for letter, triad in (("a", model.accelerometer), ("g", model.gyro)):
        if triad is not None:
            A = np.linalg.inv(triad.gain)
            K = np.diag(A)
            if not K.all():
                raise InputError(
                    "imu_tk", "found exchanged axes, for which it has no place, expected x, y, z"
                )
            by_name |= {f"T_{letter}": A / K, f"K_{letter}": np.diag(K), f"b_{letter}": triad.bias}
    return by_name


def model(terms: Terms, units: Units) -> ImuModel:
    """The instrument, with outputs in ``units``: the inverse of `terms`."""
    triads = [
        triad_of_gain(inverse(terms[f"T_{s}"] @ terms[f"K_{s}"], "imu_tk"), terms[f"b_{s}"], "imu_tk")
        for s in ("a", "g")
        if f"T_{s}" in terms
    ]
    return ImuModel(triads[0], triads[1] if len(triads) == 2 else None, np.zeros((3, 3)), units)


def _term_units(units: Units) -> Units:
    """Unit of each term."""
    a, g = units.get("acc", "count"), units.get("gyro", "count")
    return {"T_a": "rad", "K_a": per(FORCE, a), "b_a": a, "T_g": "rad", "K_g": per(RATE, g), "b_g": g}


def render(terms: Terms, units: Units) -> dict[str, str]:
    """The text of each sensor's file, by ``_acc`` and ``_gyro``."""
    return {
        f"_{sensor}": _text(terms, letter, units_line({sensor: units[sensor]}))
        for sensor, letter in (("acc", "a"), ("gyro", "g"))
        if f"T_{letter}" in terms
    }


def _text(terms: Terms, letter: str, words: str) -> str:
    """T, K and b with an empty line between, then words that imu_tk does not read."""
    rows = [[" ".join(digits(row)) for row in terms[f"{name}_{letter}"]] for name in "TK"]
    blocks = [*map("\n".join, rows), "\n".join(digits(terms[f"b_{letter}"]))]
    return "\n\n".join([*blocks, f"{words}; T, K, b of x = T K (raw - b)"]) + "\n"


def parse(texts: Sequence[tuple[object, str]]) -> tuple[Terms, Units]:
    """Terms, and the units that are stated, of the accelerometers' file and perhaps the gyro's."""
    by_name: Terms = {}
    units: Units = {}
    if len(texts) > 2:
        raise InputError("imu_tk", f"found {len(texts)} files, expected the accelerometers' and the gyro's")
    for (where, text), letter, sensor in zip(texts, "ag", ("acc", "gyro"), strict=False):
        expected = "expected the 21 numbers of T, K and b"
        words = text.split()[:21]
        try:
            numbers = np.array([float(word) for word in words])
        except ValueError as error:
            raise InputError(where, f"{error}, {expected}") from error
        if len(numbers) < 21:
            raise InputError(where, f"found {len(numbers)} numbers, {expected}")
        in_file = units_in(text)
        if in_file and sensor not in in_file:
            raise InputError(
                where, f"found the file of the {next(iter(in_file))}, expected that of the {sensor}"
            )
        units |= in_file
        T, K, b = numbers[:9].reshape(3, 3), numbers[9:18].reshape(3, 3), numbers[18:]
        by_name |= {f"T_{letter}": T, f"K_{letter}": K, f"b_{letter}": b}
    return by_name, units


CONVENTION = Convention(
    name="imu_tk",
    equation="x = T K (raw - b): T_a, K_a, b_a to specific force [m/s^2]; T_g, K_g, b_g to rate [rad/s]",
    suffixes=(".calib", ".txt"),
    si=False,
    terms=terms,
    model=model,
    term_units=_term_units,
    render=render,
    parse=parse,
)
