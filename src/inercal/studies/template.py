"""The commented studies that ``inercal new`` writes."""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from inercal.rigs.tables import slots
from inercal.studies.commented import commented, line
from inercal.studies.load import put, reader, unfilled
from inercal.studies.schema import json_schema
from inercal.studies.starting import STARTING
from inercal.studies.template_instrument import instrument_lines
from inercal.studies.tolerances import SYMBOLS
from inercal.units import Unit

Kind = Literal["imu", "turntable", "selfcal", "aoa"]

_HEAD = """\
# Study {what}. Fill in each "?", replace what is not so; take the "# " from keys that you know.
# Quantities are texts with a unit; "9.81744(2) m/s^2" is 9.81744 with a standard uncertainty of 0.00002.
#
# Next: inercal {next}

"""

#: kind -> what it is of; the next command where there is no recording, where there is one
_NEXT = {
    "imu": ("for `inercal calibrate imu`", "calibrate imu {files}", "calibrate imu {files}"),
    "turntable": ("of a turntable", "sensitivity {study}", "calibrate turntable {files}"),
    "selfcal": ("of a self-calibration", "simulate selfcal {study} --out simulated.csv", "selfcal {files}"),
    "aoa": ("of an angle of attack", "simulate aoa {study} --out simulated.csv", "aoa {files}"),
}

_HIDDEN = r"sensors\.(a\d+|gyro_\w+)"
"""Sensors beyond those of a new study: their keys are those of the others."""


def template(
    kind: Kind,
    record_paths: Sequence[str | Path] = (),
    study_path: str | Path = "STUDY.toml",
    map_path: str | Path | None = None,
    channels: Mapping[str, Unit | None] | None = None,
    overrides: Iterable[str] = (),
) -> str:
    """A study with every key in it, each explained; it loads once each ``"?"`` is filled in.

    Parameters
    ----------
    kind : str
    record_paths : sequence of str or Path
        The recordings that the next command in the header names.
    study_path, map_path : str or Path
        The study and, if there is one, the column map that it names.
    channels : mapping
        Those of the recordings with their units, where known: they tell the method and the kind of instrument.
    overrides : iterable of str
        Keys to state, as in `inercal.studies.load.load_imu_study`.

    Raises
    ------
    StudyError
        A key that the study does not have, or a value that it cannot have.
    """
    given = channels or {}
    study = _starting(kind, given)
    for override in overrides:
        put(study, override, Path(study_path).parent)
    reader(kind)(unfilled(study, "45 deg"), study_path)
    schema = json_schema()
    definitions = schema["$defs"]
    body = commented(definitions[f"{kind.capitalize()}StudyFile"], definitions, study, _hidden())
    if kind == "turntable":
        body = _with_instrument(body, instrument_lines(given), study.get("instrument", {}))
    what, alone, recorded = _NEXT[kind]
    files = _files(record_paths or ["RECORD.csv"], study_path, map_path)
    following = (recorded if record_paths else alone).format(files=files, study=_words([study_path]))
    return _HEAD.format(what=what, next=following) + body


def _starting(kind: Kind, channels: Mapping[str, Unit | None]) -> dict[str, Any]:
    """The keys in force."""
    study = {"schema": 1, **tomllib.loads(STARTING[kind])}
    if kind == "imu":
        study["imu"]["method"] = (
            "aided" if "phi1" in channels else "ferraris" if "label" in channels else "multiposition"
        )
    if kind == "turntable" and "rate" in channels:
        study["rate_test"] = {}
    return study


def _hidden() -> str:
    """Keys that a template leaves out: more sensors, chains, and errors that a table of two axes does not have."""
    two, three = (
        {slot.name for slot in slots(kind)} for kind in ("two_axis_turntable", "three_axis_turntable")
    )
    each = "|".join(sorted(two | three))
    symbols = "|".join(symbol for symbols in SYMBOLS.values() for symbol in symbols if symbol != "DX_F")
    others = "|".join(sorted(three - two))
    of_rig = rf"(imu\.aided\.)?rig\.chain|imu\.aided\.rig\.(errors|base|limits)|rig\.errors\.({others})"
    return rf"{_HIDDEN}|cost\.({each})|goal\.({symbols})|{of_rig}"


def _with_instrument(body: str, lines: str, given: Mapping[str, Any]) -> str:
    """The study with examples for the kind of its instrument, and its given keys."""
    values = {**given, **given.get("coefficients", {})}
    values.pop("coefficients", None)
    for key, value in values.items():
        place = re.search(rf"(?m)^(?:# )?{re.escape(key)} = .*?(?: +# (.*))?$", lines)
        if place is not None:
            text = "\n".join(line(key, value, place[1] or "", True))
            lines = lines[: place.start()] + text + lines[place.end() :]
            continue
        inner = ".coefficients" if key in given.get("coefficients", {}) else ""
        heading = re.search(rf"(?m)^\[instrument{inner}\].*\n", lines)
        assert heading is not None
        text = "\n".join(line(key, value, "", True))
        lines = f"{lines[: heading.end()]}{text}\n{lines[heading.end() :]}"
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
