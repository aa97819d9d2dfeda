"""The commented studies that ``inercal new`` writes."""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from inercal.faces.studies.load import put, unfilled
from inercal.faces.studies.schema import commented, json_schema
from inercal.faces.studies.text import toml, with_keys
from inercal.foundation.instruments.by_angle import CHANNELS
from inercal.foundation.rigs.tables import slots
from inercal.foundation.units import Unit
from inercal.systems.listed import SYSTEMS
from inercal.systems.turntable.settings import SYMBOLS

#: kind -> key, value for outputs of rate or acceleration, value for others (``{u}``), comment; of the channel on
#: axis ``{x}`` (``{k}`` and ``{D}`` begin its terms), beside which lies ``{o}``; ``{need}`` of what must be stated
_EXAMPLES = {
    "gyrowheel": (
        ("terms", '["{D}_F", "{D}_X", "{k}_x"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"0.01 deg/h"', '"0.1{u}"', 'of a reading, or "0.001 deg/sqrt(h)"; from the scatter if absent'),
        ("{D}_F", '"50 deg/h"', '"50{u}"', "fixed drift, in the unit of the outputs"),
        ("{D}_X", '"60 deg/h/g"', '"60{u}/g"', "per gravity along x; g is 9.80665 m/s^2"),
        ("{D}_XX", '"2 deg/h/g^2"', '"2{u}/g^2"', "per square of gravity along x"),
        ("{k}_x", '"1.000(2)"', '"2.50(2){u}/(deg/h)"', "response to earth rate about x{need}"),
    ),
    "gyro": (
        ("terms", '["D_F_{x}", "S_{x}"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"0.1 deg/h"', '"0.1{u}"', 'of a reading, or "0.01 deg/sqrt(h)"; from the scatter if absent'),
        ("D_F_{x}", '"5 deg/h"', '"5{u}"', "bias, in the unit of the outputs"),
        ("S_{x}", '"1.0000(2)"', '"1000(1){u}/(deg/s)"', "scale factor{need}"),
        ("T_{x}{o}", '"20 arcsec"', '"20 arcsec"', "misalignment: response to rate about {o}"),
        ("G_{x}{x}", '"1 deg/h/g"', '"1{u}/g"', "drift per specific force along {x}"),
    ),
    "accelerometer": (
        ("terms", '["K0_{x}", "K1_{x}"]', "", "to estimate; those usual for the kind if absent"),
        ("noise", '"20 ug"', '"0.1{u}"', 'of a reading, or "5 ug/sqrt(Hz)"; from the scatter if absent'),
        ("K0_{x}", '"100 ug"', '"10{u}"', "bias, in the unit of the outputs"),
        ("K1_{x}", '"1.0002"', '"1000{u}/g"', "scale factor"),
        ("M_{x}{o}", '"20 arcsec"', '"20 arcsec"', "misalignment: response to specific force along {o}"),
        ("K2_{x}", '"5 ug/g^2"', '"5 ug/g^2"', "of the square of specific force"),
    ),
}  # fmt: skip
_USUAL_UNIT = {"gyrowheel": "deg/h", "gyro": "deg/h", "accelerometer": "g"}
_RESPONSE = {"gyrowheel": "{k}", "gyro": "S"}


def instrument_lines(channels: Mapping[str, Unit | None]) -> str:
    """The tables ``[instrument]`` and ``[instrument.coefficients]``, each key with its comment.

    Parameters
    ----------
    channels : mapping
        Those of a record, which tell the kind, a gyrowheel where they do not; with their units, where known. Where
        there is no record, the examples are in force, so that there is something to simulate and to design for.
    """
    kind = _kind(channels)
    name = next((name for name in CHANNELS[kind] if name in channels), CHANNELS[kind][0])
    axis, unit = name[-1], channels.get(name)
    raw = unit is not None and unit.dimension not in ("rate", "acceleration")
    words = {
        "x": axis,
        "o": "yzx"["xyz".index(axis)],
        "k": {"x": "k", "y": "kY"}.get(axis, ""),
        "D": {"x": "DX", "y": "DY"}.get(axis, ""),
        "need": "; needed where it is not fitted" if raw else "",
        # a pure number is written without a unit
        "u": "" if unit is None or unit.symbol == "1" else f" {unit.symbol}",
    }
    terms, noise, *coefficients = (
        (key.format(**words), ((other if raw else "") or value).format(**words), comment.format(**words))
        for key, value, other, comment in _EXAMPLES[kind]
    )
    example = _example if channels else _line
    others = ", ".join(f'"{other}"' for other in CHANNELS if other != kind)
    lines = [
        f"{'[instrument]':35s} # what is on the table",
        _line("kind", f'"{kind}"', f"or {others}"),
        example(
            "unit", f'"{_USUAL_UNIT[kind]}"', "of its outputs in a simulation; that of the noise if absent"
        )
        if unit is None
        else _line("unit", f'"{unit.symbol}"', "of its outputs, as the record has it"),
        _example(*terms),
        example(*noise) if not raw else _example(*noise[:2], "of a reading; from the scatter if absent"),
        _example("dwell", '"60 s"', "time in each position [s]"),
        _example("bias_drift", '"linear"', "that is fitted: or exponential, random_walk; none if absent"),
        _example("sample_rate", '"10 Hz"', "of a simulated recording [Hz]; one row a position if absent"),
    ]
    if kind in _RESPONSE:
        response = _RESPONSE[kind].format(**words)
        response_words = (
            f'"stated", which needs {response} below' if raw else f'"stated": {response} of the table below'
        )
        lines.append(
            _example("earth_rate", '"fitted"', f"or {response_words}; if absent where the plan allows")
        )
    lines += [
        "",
        f"{'[instrument.coefficients]':35s} # true values to simulate; stated ones of what is not fitted",
        *(example(*each) for each in coefficients),
    ]
    return "\n".join(lines) + "\n"


def _kind(channels: Collection[str]) -> str:
    """The kind of instrument that has these channels; of a whole IMU the accelerometers, but in a rate test."""
    order = ["gyrowheel", "accelerometer", "gyro"]
    if "rate" in channels:
        order.reverse()
    return next((kind for kind in order if not set(CHANNELS[kind]).isdisjoint(channels)), "gyrowheel")


def _line(key: str, value: str, comment: str) -> str:
    """A key with its comment."""
    return f"{f'{key} = {value}':35s} # {comment}"


def _example(key: str, value: str, comment: str) -> str:
    """A key that is commented out."""
    return _line(f"# {key}", value, comment)


_HEAD = """\
# Study {what}. Fill in each "?", replace what is not so; take the "# " from keys that you know.
# Quantities are texts with a unit; "9.81744(2) m/s^2" is 9.81744 with a standard uncertainty of 0.00002.
#
# Next: inercal {next}

"""

_HIDDEN = r"sensors\.(a\d+|gyro_\w+)"
"""Sensors beyond those of a new study: their keys are those of the others."""


def template(
    kind: str,
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
    channels: Mapping[str, Unit | None] | None = None,
    overrides: Iterable[str] = (),
) -> str:
    """A study with every key in it, each explained; it loads once each ``"?"`` is filled in.

    Parameters
    ----------
    record_paths, study_path, map_path
        Files that the next command in the header names; no map if there is none.
    channels : mapping
        Those of the recordings with their units, where known: they tell the method and the kind of instrument.
    overrides : iterable of str
        Keys to state, as in `inercal.faces.studies.load.load_imu_study`; raises `StudyError` for one that the study
        cannot have.
    """
    system, given = SYSTEMS[kind], channels or {}
    study = system.new_study(given)
    for override in overrides:
        put(study, override, Path(study_path).parent)
    system.read_study(unfilled(study, "45 deg"), study_path)
    schema = json_schema()
    definitions = schema["$defs"]
    body = commented(definitions[system.study_file().__name__], definitions, study, _hidden())
    if "[instrument]" in body:
        body = _with_instrument(body, instrument_lines(given), study.get("instrument", {}))
    files = _files(record_paths or ["RECORD.csv"], study_path, map_path)
    first = f"{system.command} {{files}}" if record_paths else system.first
    following = first.format(files=files, study=_words([study_path]))
    return _HEAD.format(what=system.of, next=following) + body


def _hidden() -> str:
    """Keys that a template leaves out: more sensors, chains, and errors that a table of two axes does not have."""
    two, three = (
        {slot.name for slot in slots(kind)} for kind in ("two_axis_turntable", "three_axis_turntable")
    )
    each = "|".join(sorted(two | three))
    symbols = "|".join(symbol for symbols in SYMBOLS.values() for symbol in symbols if symbol != "DX_F")
    others = "|".join(sorted(three - two))
    of_rig = rf"(imu\.aided\.)?rig\.chain|imu\.aided\.rig\.(errors|base|limits)|rig\.errors\.({others})"
    return rf"{_HIDDEN}|laboratory|cost\.({each})|goal\.({symbols})|{of_rig}"


def _with_instrument(body: str, lines: str, given: Mapping[str, Any]) -> str:
    """The study with examples for the kind of its instrument, and its given keys."""
    for key, value in given.items():
        inner = (
            {f"{key}.{name}": each for name, each in value.items()} if key == "coefficients" else {key: value}
        )
        lines = with_keys(lines, {f"instrument.{name}": toml(each) for name, each in inner.items()})
    start = re.search(r"(?m)^(# )?\[instrument\]", body)
    end = re.search(r"(?m)^(# )?\[design\]", body)
    assert start is not None
    assert end is not None
    return f"{body[: start.start()]}{lines}\n{body[end.start() :]}"


def _files(record_paths: Sequence[str | Path], study_path: str | Path, map_path: str | Path | None) -> str:
    """Recordings, map and study as on a command line."""
    column_map = [] if map_path is None else ["--map", map_path]
    return _words([*record_paths, *column_map, "--study", study_path])


def _words(words: Iterable[str | Path]) -> str:
    """Words of a command line, printable in a comment."""
    text = shlex.join(map(str, words)).encode("utf-8", "surrogateescape").decode("utf-8", "replace")
    return "".join(c if c.isprintable() else "?" for c in text)
