"""The recordings that ship with the package, read as a command reads them."""

from __future__ import annotations

from pathlib import Path

from inercal.examples import EXAMPLES, FOLDER
from inercal.records.maps import read_map
from inercal.records.read import read
from inercal.records.record import Record

#: the examples that cases use
USED = ("xsens", "ferraris", "ferraris-si", "table", "lasergyro", "thermal", "selfcal", "sting")


def record_of(name: str) -> Record:
    """The recording of an example of `USED`, by its map if it has one; raises KeyError for another."""
    if name not in USED:
        raise KeyError(name)
    example = EXAMPLES[name]
    columns = read_map(FOLDER / example.map) if example.map else None
    return read([FOLDER / file for file in example.records], columns)


def study_of(name: str) -> Path:
    """The study of an example; raises KeyError where it has none."""
    study = EXAMPLES[name].study
    if study is None:
        raise KeyError(f"{name} has no study")
    return FOLDER / study
