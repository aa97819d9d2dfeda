"""To and from imucal: ``a = R_a^-1 K_a^-1 (acc - b_a)``, ``w = R_g^-1 K_g^-1 (gyr - K_ga a - b_g)``, a JSON file.

K is diagonal, the rows of R have length one (R holds misalignment and rotation together). With our y = S M x + b
and the gyro's + G f: K_a R_a = S M, K_g R_g = S T per deg/s (its rates are in deg/s), K_ga = G, and both b are
ours. Nothing is lost either way, and the frames are the same. There is no form for accelerometers alone.

Source: FerrarisCalibrationInfo and CalibrationInfo.to_json of imucal 2.6 (format version 2.0.0),
github.com/mad-lab-fau/imucal; F. Ferraris, U. Grimaldi, M. Parvis, Sensors and Materials 7 (1995) 311.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from inercal.faces.convert.convention import (
    FORCE,
    Convention,
    Terms,
    Units,
    one_text,
    output_unit,
    per,
    triad_of_gain,
    with_gyro,
)
from inercal.faces.convert.correct import ImuModel
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.units import parse_unit

DEG = "deg/s"
_DEG = parse_unit(DEG).factor
_SHAPES = {
    "K_a": (3, 3),
    "R_a": (3, 3),
    "b_a": (3,),
    "K_g": (3, 3),
    "R_g": (3, 3),
    "K_ga": (3, 3),
    "b_g": (3,),
}


def terms(model: ImuModel) -> Terms:
    """``K_a, R_a, b_a, K_g, R_g, K_ga, b_g`` for outputs m/s^2 and deg/s; raises `InputError` without a gyro."""
    gyro = with_gyro(model, "imucal")
    K_a, R_a = _split(model.accelerometer.gain)
    K_g, R_g = _split(gyro.gain * _DEG)
    return {
        "K_a": K_a, "R_a": R_a, "b_a": model.accelerometer.bias,
        "K_g": K_g, "R_g": R_g, "K_ga": model.g_sensitivity, "b_g": gyro.bias,
    }  # fmt: skip


def _split(gain: Array) -> tuple[Array, Array]:
    """Lengths of the rows, on a diagonal, and the rows of length one."""
    length = np.linalg.norm(gain, axis=1)
    return np.diag(length), gain / length[:, None]


def model(terms: Terms, units: Units) -> ImuModel:
    """The instrument, with outputs in ``units``: the inverse of `terms`."""
    return ImuModel(
        triad_of_gain(terms["K_a"] @ terms["R_a"], terms["b_a"], "imucal"),
        triad_of_gain(terms["K_g"] @ terms["R_g"] / _DEG, terms["b_g"], "imucal"),
        terms["K_ga"],
        units,
    )


def _term_units(units: Units) -> Units:
    """Unit of each term."""
    a, g = units["acc"], units["gyro"]
    return {
        "K_a": per(a, FORCE), "R_a": "1", "b_a": a,
        "K_g": per(g, DEG), "R_g": "1", "K_ga": per(g, FORCE), "b_g": g,
    }  # fmt: skip


def render(terms: Terms, units: Units) -> dict[str, str]:
    """The text that imucal's ``CalibrationInfo.from_json_file`` reads."""
    data = {
        "acc_unit": FORCE,
        "gyr_unit": DEG,
        "from_acc_unit": units["acc"],
        "from_gyr_unit": units["gyro"],
        "comment": "converted from a calibration by inercal",
        **{name: (array + 0.0).tolist() for name, array in terms.items()},
        "cal_type": "Ferraris",
        "_format_version": "2.0.0",
    }
    return {"": json.dumps(data, indent=4) + "\n"}


def parse(texts: Sequence[tuple[object, str]]) -> tuple[Terms, Units]:
    """Terms for m/s^2 and deg/s, and the units of the outputs where they are ones ("a.u." is none)."""
    where, text = one_text(texts, "imucal")
    expected = "expected a calibration written by imucal (format version 2.0.0)"
    try:
        data: Any = json.loads(text)
        version = data["_format_version"] if isinstance(data, Mapping) else None
        if version != "2.0.0":
            raise ValueError(f"found the format version {version!r}")
        if data["cal_type"] not in ("Ferraris", "Turntable"):
            raise ValueError(f"found the calibration type {data['cal_type']!r}")
        matrices = {name: np.array(data[name], dtype=float) for name in _SHAPES}
        for name, shape in _SHAPES.items():
            if matrices[name].shape != shape:
                raise ValueError(f"{name} is of shape {matrices[name].shape}")
        to_force, to_rate = str(data["acc_unit"]), str(data["gyr_unit"])
    except KeyError as error:
        raise InputError(where, f"the key {error} is missing, {expected}") from error
    except json.JSONDecodeError as error:
        raise InputError(where, f"not valid JSON: {error}, {expected}") from error
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(where, f"{error}, {expected}") from error
    force, rate = parse_unit(to_force, where), parse_unit(to_rate, where)
    if force.dimension != "acceleration" or rate.dimension != "rate":
        raise InputError(
            where, f"found corrected samples in {to_force} and {to_rate}, expected {FORCE} and {DEG}"
        )
    matrices["K_a"] /= force.factor
    matrices["K_ga"] /= force.factor
    matrices["K_g"] /= rate.factor / _DEG
    units: Units = {}
    for sensor, key in (("acc", "from_acc_unit"), ("gyro", "from_gyr_unit")):
        with suppress(InputError):
            units[sensor] = output_unit(sensor, str(data.get(key)), where)
    return matrices, units


CONVENTION = Convention(
    name="imucal",
    equation="a = R_a^-1 K_a^-1 (acc - b_a) [m/s^2]; w = R_g^-1 K_g^-1 (gyr - K_ga a - b_g) [deg/s]",
    suffixes=(".json",),
    si=False,
    terms=terms,
    model=model,
    term_units=_term_units,
    render=render,
    parse=parse,
)
