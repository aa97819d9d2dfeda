"""To and from Kalibr's IMU model scale-misalignment, a YAML file with the key ``imu0``.

    acc  = M_a C_i_b f_b + b_a
    gyro = M_g C_gyro_i C_i_b w_b + A C_gyro_i C_i_b f_b + b_g

M_a and M_g are lower-triangular with the scale factors on their diagonals, C_i_b and C_gyro_i rotations, A the
g-sensitivity in axes of the gyro. The frame i of Kalibr has x along the input axis of accelerometer x and y in the
plane of x and y; with an upper-triangular M in y = S M f + b it is z that lies along an input axis, that of z. So the
frames differ by about the misalignments: with S M = M_a C_i_b (an LQ decomposition, signs of the diagonal those of
S) the file states the turn as its ``T_i_b``, which for a lone IMU Kalibr itself leaves at one. Read back, the
frame is ours again; who ignores ``T_i_b`` has corrected samples in Kalibr's frame.

Kalibr's biases are splines in time and not in its files. They are written as further keys ``b``, which it ignores;
a file without them gives biases of zero, and that is said. Its samples are in SI units. Noise densities,
``update_rate`` and ``rostopic``, which it asks for in its own input, are no part of a calibration.
Accelerometers apart from each other (size effect) have no place here and are refused.

Source: IccScaledMisalignedImu in kalibr_imu_camera_calibration/IccSensors.py and ImuParameters in
kalibr_common/ConfigReader.py of github.com/ethz-asl/kalibr; Rehder, Nikolic, Schneider, Hinzmann, Siegwart, Extending
kalibr, ICRA 2016.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.faces.convert.convention import (
    FORCE,
    RATE,
    Convention,
    Terms,
    Units,
    one_text,
    per,
    triad_of_gain,
    units_in,
    units_line,
    with_gyro,
)
from inercal.faces.convert.correct import ImuModel
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding

_PLACES = {
    "M_a": ("accelerometers", "M"),
    "b_a": ("accelerometers", "b"),
    "M_g": ("gyroscopes", "M"),
    "A": ("gyroscopes", "A"),
    "C_gyro_i": ("gyroscopes", "C_gyro_i"),
    "b_g": ("gyroscopes", "b"),
}
_ARMS = ("rx_i", "ry_i", "rz_i")
"""Places of the accelerometers, in the model with size effect."""

_TOLERANCE = 1e-6
"""Of the orthogonality of rotations in a file."""

_LONGEST, _DEEPEST = 1 << 20, 50
"""Characters and levels of a file at most."""

_EXPECTED = "expected keys and numbers (YAML)"


def terms(model: ImuModel) -> Terms:
    """``M_a, C_i_b, b_a, M_g, C_gyro_i, A, b_g``; raises `InputError` without a gyro or with mirrored axes."""
    gyro = with_gyro(model, "kalibr")
    M_a, C_ib = _lower(model.accelerometer.gain)
    M_g, C_gi = _lower(gyro.gain @ C_ib.T)
    A = model.g_sensitivity @ C_ib.T @ C_gi.T
    b_a, b_g = model.accelerometer.bias, gyro.bias
    return {"M_a": M_a, "C_i_b": C_ib, "b_a": b_a, "M_g": M_g, "C_gyro_i": C_gi, "A": A, "b_g": b_g}


def _lower(gain: Array) -> tuple[Array, Array]:
    """Lower-triangular L, its diagonal of the signs of the gain's, and the rotation C with L C = gain."""
    Q, R = np.linalg.qr(gain.T)
    sign = np.where(np.diag(R) * np.diag(gain) < 0, -1.0, 1.0)
    L, C = np.tril(R.T * sign), (Q * sign).T
    if np.linalg.det(C) < 0:
        raise InputError(
            "kalibr", "found mirrored axes, for which it has no place, expected right-handed x, y, z"
        )
    return L, C


def model(terms: Terms, units: Units) -> ImuModel:
    """The instrument, with outputs in ``units``: the inverse of `terms`."""
    C_ib, C_gi, none = terms["C_i_b"], terms["C_gyro_i"], np.zeros(3)
    return ImuModel(
        triad_of_gain(terms["M_a"] @ C_ib, terms.get("b_a", none), "kalibr"),
        triad_of_gain(terms["M_g"] @ C_gi @ C_ib, terms.get("b_g", none), "kalibr"),
        terms["A"] @ C_gi @ C_ib,
        units,
    )


def _term_units(units: Units) -> Units:
    """Unit of each term."""
    a, g = units["acc"], units["gyro"]
    return {
        "M_a": per(a, FORCE), "C_i_b": "1", "b_a": a,
        "M_g": per(g, RATE), "C_gyro_i": "1", "A": per(g, FORCE), "b_g": g,
    }  # fmt: skip


def _notes(terms: Terms) -> tuple[Finding, ...]:
    """Notes about the frame and the biases."""
    turn = np.arccos(np.clip((np.trace(terms["C_i_b"]) - 1.0) / 2.0, -1.0, 1.0))
    return (
        Finding(
            "other_frame",
            f"Kalibr's frame, x along the input axis of accelerometer x, is turned by {turn * 1e3:.3g} mrad from that "
            "of the calibration: T_i_b holds the turn",
        ),
        Finding("not_held", "Kalibr's files hold no biases: they are written as keys b, which it ignores"),
    )


def render(terms: Terms, units: Units) -> dict[str, str]:
    """A file as `kalibr_calibrate_imu_camera` writes it."""
    import yaml

    pose = np.eye(4)
    pose[:3, :3] = terms["C_i_b"]
    imu: dict[str, Any] = {"T_i_b": (pose + 0.0).tolist(), "accelerometers": {}, "gyroscopes": {}}
    for term, (place, key) in _PLACES.items():
        imu[place][key] = (terms[term] + 0.0).tolist()  # + 0.0 takes the sign off a zero
    imu |= {"model": "scale-misalignment", "time_offset": 0.0}
    text = yaml.safe_dump({"imu0": imu}, default_flow_style=None, sort_keys=False, width=math.inf)
    return {"": f"# {units_line(units)}\n{text}"}


def parse(texts: Sequence[tuple[object, str]]) -> tuple[Terms, Units]:
    """Terms; without keys ``b`` those of the biases are left out. Outputs are in SI units unless said otherwise."""
    where, text = one_text(texts, "kalibr")
    whole = loaded(text, where)
    imus = [key for key in whole if str(key).startswith("imu")] if isinstance(whole, Mapping) else []
    if len(imus) != 1 or not isinstance(whole[imus[0]], Mapping):
        raise InputError(
            where, f"found {len(imus)} keys imu0, imu1, ..., expected one with what belongs to it"
        )
    imu = whole[imus[0]]
    matrices = {"C_i_b": _array(imu.get("T_i_b", np.eye(4).tolist()), (4, 4), "T_i_b", where)[:3, :3]}
    for term, (place, key) in _PLACES.items():
        part = imu.get(place)
        if not isinstance(part, Mapping):
            raise InputError(
                where,
                f"found no {place} in the model {imu.get('model', 'without name')!r}, expected scale-misalignment",
            )
        if key in part:
            matrices[term] = _array(part[key], (3,) if key == "b" else (3, 3), f"{place} {key}", where)
        elif key != "b":
            raise InputError(where, f"found no {key} among the {place}, expected M, A and C_gyro_i")
    arms = [
        _array(imu["accelerometers"][key], (3,), key, where) for key in _ARMS if key in imu["accelerometers"]
    ]
    if np.any(arms):
        raise InputError(
            where,
            f"found accelerometers {np.abs(arms).max() * 1e3:.3g} mm apart (size effect), for which inercal has no "
            "place, expected the model scale-misalignment",
        )
    for key in ("C_i_b", "C_gyro_i"):
        C = matrices[key]
        if np.abs(C @ C.T - np.eye(3)).max() > _TOLERANCE or np.linalg.det(C) < 0:
            raise InputError(where, f"found a {key} that is no rotation, expected one")
    return matrices, {"acc": FORCE, "gyro": RATE} | units_in(text)


def loaded(text: str, where: object) -> Any:
    """Dicts, lists, numbers and texts of a YAML file.

    Raises `InputError` naming ``where`` for other YAML, for aliases, by which a short file is a huge one, and beyond
    1 MiB or 50 levels.
    """
    import yaml

    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    if len(text) > _LONGEST:
        raise InputError(where, f"found {len(text)} characters, expected at most {_LONGEST} (YAML)")
    text = re.sub(r"\A%YAML:[^\n]*", "", text)  # the head of OpenCV, which is no directive of YAML
    try:
        depth = 0
        for event in yaml.parse(text, loader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > _DEEPEST:
                raise InputError(
                    f"{where}, line {event.start_mark.line + 1}",
                    f"found {'an alias' if depth <= _DEEPEST else f'more than {_DEEPEST} levels'}, {_EXPECTED}",
                )
        value = yaml.load(text, loader)
    except (yaml.YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None)
        at = where if mark is None else f"{where}, line {mark.line + 1}"
        found = getattr(error, "problem", None) or str(error)
        raise InputError(at, f"{found.splitlines()[0][:80]}, {_EXPECTED}") from error
    if value is None:
        raise InputError(where, f"found nothing in it, {_EXPECTED}")
    return value


def _array(value: Any, shape: tuple[int, ...], key: str, where: object) -> Array:
    """An array of that shape."""
    try:
        array = np.array(value, dtype=float)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if array.shape != shape:
        raise InputError(where, f"{key} is not of {' x '.join(map(str, shape))} numbers, expected these")
    return array


CONVENTION = Convention(
    name="kalibr",
    equation="acc = M_a C_i_b f + b_a; gyro = M_g C_gyro_i C_i_b w + A C_gyro_i C_i_b f + b_g",
    suffixes=(".yaml", ".yml"),
    si=True,
    terms=terms,
    model=model,
    term_units=_term_units,
    render=render,
    parse=parse,
    notes=_notes,
)
