"""Ways to write a table: lines under headings, messages, words before numbers, JSON, stamps."""

import datetime
import json

import numpy as np

from .motion import G

ACC = {"m/s^2": 1.0, "g": 1 / G, "mg": 1e3 / G, "cm/s^2": 100.0}
GYRO = {"rad/s": 1.0, "deg/s": 180 / np.pi, "mdeg/s": 180e3 / np.pi, "rpm": 30 / np.pi}
TIME = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1 / 60}
EPOCH = 1_764_230_400.0  # 2025-11-27 08:00:00 UTC
BEGIN = datetime.datetime(2025, 11, 27, 8, 0, 0)


def column(truth, key):
    """The column of a key such as ``ax g``, ``gz lsb131``, ``t unix_ms``, ``T``, ``mx``, ``qw``, ``row``, ``0``."""
    what, _, unit = key.partition(" ")
    n = len(truth.t)
    if what == "t":
        if unit.startswith("unix"):
            factor = TIME[unit.partition("_")[2] or "s"]
            return np.round((EPOCH + truth.t) * factor) if factor > 1 else EPOCH + truth.t
        values = truth.t * TIME[unit or "s"]
        return np.round(values) if unit in ("ms", "us", "ns") else values
    if what[0] in "ag" and what[1:] in ("x", "y", "z"):
        values = (truth.acc if what[0] == "a" else truth.gyro)[:, "xyz".index(what[1])]
        if unit.startswith("lsb"):
            per = float(unit[3:]) / (G if what[0] == "a" else np.pi / 180)
            return np.round(values * per)
        return values * (ACC if what[0] == "a" else GYRO)[unit]
    if what[0] == "m" and what[1:] in ("x", "y", "z"):
        return truth.mag[:, "xyz".index(what[1])]
    if what[0] == "q":
        return truth.attitude[:, "wxyz".index(what[1])]
    if what[0] == "p" and what[1:] in ("x", "y", "z"):
        return truth.position[:, "xyz".index(what[1])]
    if what == "T":
        return truth.temperature * (1.8 if unit == "F" else 1.0) + (32.0 if unit == "F" else 0.0)
    if what == "row":
        return np.arange(n) + int(unit or 0)
    if what == "P":
        return 1013.2 + 0.1 * np.sin(truth.t)
    if what == "H":
        return 41.0 + 0.5 * np.sin(0.3 * truth.t)
    return np.full(n, float(what))


def number(value, digits):
    """A number as loggers print it; whole ones without a point."""
    return f"{int(value)}" if float(value).is_integer() and digits == 0 else f"{value:.{digits}f}"


DIGITS = {
    "s": 6,
    "unix": 6,
    "rad/s": 6,
    "deg/s": 4,
    "mdeg/s": 1,
    "rpm": 5,
    "m/s^2": 5,
    "g": 6,
    "mg": 3,
    "cm/s^2": 3,
    "min": 8,
}


def digits_of(key):
    what, _, unit = key.partition(" ")
    if unit.startswith("lsb") or what == "row" or unit in ("ms", "us", "ns", "unix_ms", "unix_us", "unix_ns"):
        return 0
    return DIGITS.get(unit or "s", 5)


def cells(truth, keys):
    """The cells of all rows as text."""
    texts = []
    for key in keys.split(","):
        if key.startswith("="):
            texts.append([key[1:]] * len(truth.t))
        elif key == "t unix_ns":  # more digits than a float has
            texts.append([str(round(EPOCH) * 10**9 + round(1e9 * t)) for t in truth.t])
        elif key.startswith("@"):
            texts.append(stamps(truth, key[1:]))
        else:
            texts.append([number(value, digits_of(key)) for value in column(truth, key)])
    return list(zip(*texts, strict=True))


def stamps(truth, form):
    """Times of day and dates as text, by a form of `strftime`; %L is milliseconds."""
    out = []
    for t in truth.t:
        when = BEGIN + datetime.timedelta(microseconds=round(t * 1e6))
        out.append(when.strftime(form.replace("%L", f"{when.microsecond // 1000:03d}")))
    return out


def table(
    truth,
    keys,
    header,
    mark=",",
    decimal=".",
    above="",
    units="",
    comment="",
    end="\n",
    tail="",
    encoding="utf-8",
):
    """Rows of ``keys`` below a ``header``, a row of ``units`` and lines ``above``."""
    lines = [above] if above else []
    lines += [comment + header] if header else []
    lines += [units] if units else []
    lines += [mark.join(cell.replace(".", decimal) for cell in row) + tail for row in cells(truth, keys)]
    return (end.join(lines) + end).encode(encoding)


def messages(truth, templates, above=""):
    """For each row the lines of all templates, with {keys} in them; ``*CS`` becomes a checksum."""
    lines = [above] if above else []
    keys = {key: cells(truth, key) for template in templates for key in _keys(template)}
    for k in range(len(truth.t)):
        for template in templates:
            line = template
            for key in _keys(template):
                line = line.replace("{" + key + "}", keys[key][k][0])
            lines.append(line.replace("*CS", f"*{_xor(line.split('*')[0].lstrip('$#%')):02X}"))
    return ("\n".join(lines) + "\n").encode()


def _keys(template):
    return [part.split("}")[0] for part in template.split("{")[1:]]


def _xor(text):
    total = 0
    for character in text.encode():
        total ^= character
    return total


def json_lines(truth, shape, whole=False):
    """A JSON object for each row, by ``shape``: names and keys, nested; ``whole``: one array of all."""

    def made(node, k):
        if isinstance(node, dict):
            return {name: made(child, k) for name, child in node.items()}
        text = columns[node][k][0]
        return text if node.startswith("@") else float(text)

    def leaves(node):
        for child in node.values():
            yield from leaves(child) if isinstance(child, dict) else [child]

    columns = {key: cells(truth, key) for key in leaves(shape)}
    rows = [made(shape, k) for k in range(len(truth.t))]
    return (
        json.dumps(rows).encode() if whole else ("\n".join(json.dumps(row) for row in rows) + "\n").encode()
    )
