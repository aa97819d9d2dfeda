"""Compare what the program says of a protocol with its truth, in a word and why.

right: every value within 1.5 U of the truth, or the right refusal. doubted: the same, but the verdict is not ok.
asked: a question whose answer the protocol does not need. refused: no values, or not all. said: a value outside, and a
bad verdict. wrong: a value outside, or what had to be refused, without a word.
"""

from __future__ import annotations

import math
import re
from fnmatch import fnmatch

from .physics import DEG, G

OUTCOMES = ("right", "doubted", "asked", "refused", "said", "wrong")
ALLOWED = 1.5
"""Expanded uncertainties by which a value may be off."""
SIZES = {
    "1": 1.0,
    "m/s^2": 1.0,
    "g": G,
    "mg": 1e-3 * G,
    "ug": 1e-6 * G,
    "rad/s": 1.0,
    "deg/s": DEG,
    "deg/h": DEG / 3600,
    "rad": 1.0,
    "deg": DEG,
    "s": 1.0,
    "h": 3600.0,
    "count": 1.0,
    "V": 1.0,
    "mV": 1e-3,
    "A": 1.0,
    "mA": 1e-3,
    "m": 1.0,
    "Hz": 1.0,
}


def size(unit):
    """The size of a unit in SI, and what stays of it: counts, volts, amperes."""
    text = unit.strip()
    if text in SIZES:
        return SIZES[text], text if text in ("count", "V", "A") else {"mV": "V", "mA": "A"}.get(text, "")
    if root := re.fullmatch(r"sqrt\((.*)\)", text):
        value, kind = size(root[1])
        return math.sqrt(value), kind
    if power := re.fullmatch(r"(.*)\^2", text):
        value, kind = size(unwrapped(power[1]))
        return value**2, kind
    depth = 0
    for k in range(len(text) - 1, -1, -1):
        depth += (text[k] == ")") - (text[k] == "(")
        if depth == 0 and text[k] in "/*":
            one, kind = size(unwrapped(text[:k]))
            other, below = size(unwrapped(text[k + 1 :]))
            return (one / other, kind or below) if text[k] == "/" else (one * other, kind or below)
    if unwrapped(text) != text:
        return size(unwrapped(text))
    raise KeyError(unit)


def unwrapped(text):
    """A unit without the parentheses about the whole of it."""
    text = text.strip()
    if text.startswith("(") and text.endswith(")"):
        depth = 0
        for k, letter in enumerate(text):
            depth += (letter == "(") - (letter == ")")
            if depth == 0:
                return text[1:-1] if k == len(text) - 1 else text
    return text


def truth_of(case, names):
    """True values by name, in the frame in which the values stand."""
    values = {}
    if case.unit is not None:
        by_accelerometers = any(name.startswith("K1_") for name in names)
        known = "M_yx" in names or ("T_yx" in names and not by_accelerometers)
        whole = {"M_xy", "K1_x"} <= names or {"T_xy", "S_x"} <= names
        frame = "case" if known or not whole else "accelerometers" if by_accelerometers else "gyro"
        values = case.unit.truth(frame)
    for pattern, value in case.more.items():
        values |= {name: value for name in names if fnmatch(name, pattern)}
    return values


def outside(case, parameters):
    """Rows (name, value, U, truth, ratio) of values farther than allowed from the truth, and the number compared."""
    found = {row["name"]: row for row in parameters if row["value"] is not None and row["U"] is not None}
    values, rows, count = truth_of(case, set(found)), [], 0
    for name, row in found.items():
        if name not in values:
            continue
        true, unit = values[name]
        one, kind = size(row["unit"])
        other, true_kind = size(unit)
        count += 1
        ratio = abs(row["value"] * one - true * other) / (row["U"] * one) if row["U"] else math.inf
        if kind != true_kind or ratio > ALLOWED:
            rows.append((name, row["value"], row["U"], true * other / one, ratio))
    return rows, count


def judged(case, code, result, said):
    """The outcome in a word, and why: of the last command's exit code, result (None for none) and all that was said."""
    words = said.casefold()
    status = result["status"]["code"] if result else ""
    bad = code == 2 or not result or status not in ("ok", "suspect")
    named = [word for word in case.refusal if word.casefold() in words]
    if case.refusal and not case.either:
        if status == "ok":
            return "wrong", "ok, and had to be refused"
        return ("right", "") if named else ("refused", f"does not name {' or '.join(case.refusal)}")
    rows, count = outside(case, result["parameters"]) if result else ([], 0)
    if (bad or status == "suspect" or rows) and case.either and named and status != "ok":
        return "right", f"says: {named[0]}"
    if code == 2 or not result:
        question = "--answer" in said or "?" in said.rsplit("error:", 1)[-1]
        return ("asked" if question else "refused"), ""
    have = [row["name"] for row in result["parameters"] if row["U"] is not None]
    lost = [stem for stem in case.must if not any(name.startswith(stem) for name in have)]
    if rows:
        worst = max(rows, key=lambda row: row[-1])
        why = f"{len(rows)} of {count} outside, {worst[0]} = {worst[1]:.6g}, U {worst[2]:.2g}, true {worst[3]:.6g}"
        return ("wrong" if status == "ok" else "said"), why
    if lost or not count:
        return "refused", f"no {', '.join(lost) or 'value'}; {status}"
    return ("right", f"{count} values") if status == "ok" else ("doubted", status)
