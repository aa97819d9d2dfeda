"""To and from PSINS (Gongmin Yan): the struct ``clbt`` of its function imuclbt, as a MATLAB script to run.

    gyro_1 = sf_g gyro            acc_1 = sf_a acc
    w = Kg gyro_1 - eb - gSens acc_1
    f = f_1 - fL - tGA w x f_1            f_1 = Ka acc_1 - db - Ka2 (Ka acc_1)^2

for rates, fL being what turning does at the places rx, ry, rz of the accelerometers; imuclbt works on increments,
outputs times the sampling time. sf scales the outputs (gyro first) to rad/s and m/s^2, Kg and Ka are close to one.
With our y = S M x + b and the gyro's + G f: sf = 1/S, Ka = M^-1, Kg = T^-1, db = Ka sf_a b; g-sensitivity acts there on
the accelerometers' output before Ka and db, so gSens = (S T)^-1 G Ka and eb = Kg sf_g b - (S T)^-1 G db. Nothing of
these is lost either way, and the frames are the same (Ka is full or upper-triangular where PSINS' own sysclbt, with x
along accelerometer x, makes it lower-triangular). Ka2 = K2, rx and ry are r_x and r_y, tGA = tau_a, to first order:
PSINS has no more. Scale factors that differ by the sign of the rate have no place there.

The script sets ``clbt.sf``, ``clbt.Kg`` ... in SI units, as imuclbt takes them. The text that PSINS' clbtfile writes
has bare names instead and states eb in deg/h, db in ug, Ka2 in ug/g^2, places in cm and tGA in ms; clbtfile reads these
numbers back without their units, so it is a form to read here but not one to write. Its binary form has other lengths
in other versions and no gSens. An asymmetry Kap of the accelerometers has no place here: a file in which it is not zero
is refused. Places are told from rz on, the origin of inercal's.

Source: base/imu/imuclbt.m, imuadderr.m, clbtfile.m and base/kf/sysclbt.m of the PSINS toolbox (Gongmin Yan,
Northwestern Polytechnical University), as kept in github.com/WangShanpeng/PSINS.
"""

from __future__ import annotations

import re
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
from inercal.foundation.units import parse_unit

_G0 = 9.7803267715
"""The g of PSINS' units ug and deg/h/g [m/s^2] (glvf.m)."""

_DPH = parse_unit("deg/h").factor
_MOTION = ("Ka2", "rx", "ry", "rz", "tGA")
"""Terms that are written where they are not zero."""

_SIZES = {"sf": 6, "Kg": 9, "eb": 3, "Ka": 9, "db": 3, "gSens": 9} | {
    name: 1 if name == "tGA" else 3 for name in _MOTION
}
_IN_CLBTFILE = {
    "eb": _DPH, "db": 1e-6 * _G0, "gSens": _DPH / _G0, "Ka2": 1e-6 / _G0,
    "rx": 0.01, "ry": 0.01, "rz": 0.01, "tGA": 1e-3,
}  # fmt: skip


def terms(model: ImuModel) -> Terms:
    """``sf_g, Kg, eb, gSens, sf_a, Ka, db`` in SI units; raises `InputError` without a gyro."""
    acc, gyro = model.accelerometer, with_gyro(model, "psins")
    Ka, Kg = np.linalg.inv(acc.misalignment), np.linalg.inv(gyro.misalignment)
    sf_a, sf_g = 1.0 / acc.scale, 1.0 / gyro.scale
    db = Ka @ (sf_a * acc.bias)
    drift = (Kg * sf_g) @ model.g_sensitivity
    return {
        "sf_g": sf_g, "Kg": Kg, "eb": Kg @ (sf_g * gyro.bias) - drift @ db, "gSens": drift @ Ka,
        "sf_a": sf_a, "Ka": Ka, "db": db, "Ka2": model.second_order,
        **{f"r{axis}": row for axis, row in zip("xyz", model.levers, strict=True)}, "tGA": np.array(model.delay),
    }  # fmt: skip


def model(terms: Terms, units: Units) -> ImuModel:
    """The instrument, with outputs in ``units``: the inverse of `terms`."""
    gain_a = inverse(terms["Ka"] * terms["sf_a"], "psins")
    gain_g = inverse(terms["Kg"] * terms["sf_g"], "psins")
    drift = terms["gSens"] @ inverse(terms["Ka"], "psins")
    return ImuModel(
        triad_of_gain(gain_a, gain_a @ terms["db"], "psins"),
        triad_of_gain(gain_g, gain_g @ (terms["eb"] + drift @ terms["db"]), "psins"),
        gain_g @ drift,
        units,
        terms["Ka2"],
        levers=np.stack([terms["rx"], terms["ry"], terms["rz"]]) - terms["rz"],
        delay=float(terms["tGA"]),
    )


def _term_units(units: Units) -> Units:
    """Unit of each term."""
    return {
        "sf_g": per(RATE, units["gyro"]), "Kg": "1", "eb": RATE, "gSens": per(RATE, FORCE),
        "sf_a": per(FORCE, units["acc"]), "Ka": "1", "db": FORCE, "Ka2": per("1", FORCE),
        "rx": "m", "ry": "m", "rz": "m", "tGA": "s",
    }  # fmt: skip


def render(terms: Terms, units: Units) -> dict[str, str]:
    """A MATLAB script that makes ``clbt``."""
    sf = np.concatenate([terms["sf_g"], terms["sf_a"]])
    lines = [
        f"% {units_line(units)}; run this, then imu = imuclbt(imu, clbt), with imu the outputs times the",
        "% sampling time, gyro first. SI units: eb in rad/s, db in m/s^2, gSens in (rad/s)/(m/s^2).",
        f"clbt.sf = [{'; '.join(digits(sf))}];",
    ]
    for name in ("Kg", "eb", "Ka", "db", "gSens"):
        rows = [" ".join(digits(row)) for row in np.atleast_2d(terms[name])]
        if name in ("eb", "db"):
            rows = digits(terms[name])
        elif name == "gSens" and not terms[name].any():
            continue
        lines.append(f"clbt.{name} = [{'; '.join(rows)}];")
    lines += [
        f"clbt.{name} = [{'; '.join(digits(np.atleast_1d(terms[name])))}];"
        for name in _MOTION
        if terms[name].any()
    ]
    return {"": "\n".join(lines) + "\n"}


def parse(texts: Sequence[tuple[object, str]]) -> tuple[Terms, Units]:
    """Terms of a script that sets ``clbt``, or of a text that clbtfile wrote, and the units of the outputs.

    Without sf the outputs are in SI units.
    """
    where, text = one_text(texts, "psins")
    bare = re.sub(r"%.*|\.\.\.", "", text)
    matrices: dict[str, Array] = {}
    for struct, name, body in re.findall(r"(clbt\.)?\b(\w+)\s*=\s*(\[[^\]]*\]|[^;\n]*)", bare):
        try:
            numbers = np.array(
                [float(word) for word in re.split(r"[\s,;]+", body.strip("[] \t\r\n")) if word]
            )
        except ValueError as error:
            raise InputError(where, f"{name}: {error}, expected numbers in brackets") from error
        matrices[name] = numbers if struct else numbers * _IN_CLBTFILE.get(name, 1.0)
    has_units = all(re.search(rf"%\s*{unit}\s*$", text, re.MULTILINE) for unit in ("deg/h", "ug"))
    if "eb" in matrices and "clbt.eb" not in bare and not has_units:
        raise InputError(
            where,
            "states no unit of eb and db, expected % deg/h and % ug beside them, or clbt.eb and clbt.db in SI",
        )
    if not matrices.keys() >= {"Kg", "eb", "Ka", "db"}:
        raise InputError(
            where,
            f"found {', '.join(matrices) or 'no variables'}, expected Kg, eb, Ka, db of a clbt of PSINS",
        )
    for name, size in _SIZES.items():
        if name in matrices and matrices[name].size != size:
            raise InputError(where, f"{name} has {matrices[name].size} numbers, expected {size}")
    if "Kap" in matrices and matrices["Kap"].any():
        raise InputError(where, "found Kap, for which inercal has no place, expected zeros there")
    units = units_in(text)
    if "sf" not in matrices:
        units = {"acc": FORCE, "gyro": RATE} | units
    sf = matrices.get("sf", np.ones(6))
    square = {name: matrices[name].reshape(3, 3) for name in ("Kg", "Ka")}
    gSens = matrices.get("gSens", np.zeros(9)).reshape(3, 3)
    return {
        **square,
        "sf_g": sf[:3],
        "sf_a": sf[3:],
        "eb": matrices["eb"],
        "db": matrices["db"],
        "gSens": gSens,
        **{name: matrices.get(name, np.zeros(3)) for name in ("Ka2", "rx", "ry", "rz")},
        "tGA": np.array(matrices.get("tGA", np.zeros(1))[0]),
    }, units


CONVENTION = Convention(
    name="psins",
    equation="w = Kg sf_g gyro - eb - gSens sf_a acc [rad/s]; f_1 = Ka sf_a acc - db - Ka2 (Ka sf_a acc)^2, "
    "f = f_1 - fL(rx, ry, rz) - tGA w x f_1 [m/s^2]",
    suffixes=(".m",),
    si=True,
    terms=terms,
    model=model,
    term_units=_term_units,
    render=render,
    parse=parse,
)
