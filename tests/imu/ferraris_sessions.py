"""Ferraris sessions for tests: the shipped recordings with their studies, and simulated ones."""

import math
import tomllib
from dataclasses import replace

import numpy as np
from campaigns.sessions import SessionCourse, quiet, simulate_session

from inercal.examples import FOLDER
from inercal.faces.studies.ferraris import FerrarisTable, ferraris_settings
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_full_truth

SETTINGS = ImuSettings(Site(9.81))
UNSURE = ImuSettings(Site(9.81, (GravityInput("gravity", 2e-3, "m/s^2", 1.0),)))
SHIPPED = ("ferraris", "ferraris-si")


def record_of(name: str) -> Record:
    """A shipped recording."""
    return read([FOLDER / f"{name}.csv.gz"], read_map(FOLDER / f"{name}-map.toml"))


def options_of(name: str, **changes: object):
    """The options in the study of a shipped recording, some of them changed; None takes one out."""
    table = tomllib.loads((FOLDER / f"{name}.toml").read_text())["imu"]["ferraris"] | changes
    given = {key: value for key, value in table.items() if value is not None}
    return ferraris_settings(FerrarisTable.model_validate(given))


def unlabelled(record: Record) -> Record:
    """The same recording, its labels lost."""
    return Record(record.columns, record.findings, record.sources)


def session(seed: int, noisy: bool = False, g_sensitivity: float = 2e-4, **given: object):
    """A simulated session and its truth."""
    rng = np.random.default_rng(seed)
    truth = draw_full_truth(rng, g_sensitivity)
    if not noisy:
        truth = quiet(truth)
    return simulate_session(truth, replace(SessionCourse(), **given), rng)


def in_degrees(record: Record, scale: float = 1.0) -> tuple[Record, float]:
    """The same recording of a gyro in deg/s whose scale factors are ``scale`` times those of the counts over 4775 per
    rad/s, and what takes the scale factors of the counts to it."""
    factor = scale * math.degrees(1.0) / 4775.0
    columns = {
        name: replace(column, values=column.values * factor, unit=parse_unit("deg/s"))
        if name.startswith("gyro")
        else column
        for name, column in record.columns.items()
    }
    return replace(record, columns=columns), factor


def with_values(record: Record, **changes) -> Record:
    """A recording with some columns changed by functions of their values."""
    columns = {
        name: replace(column, values=changes[name](column.values)) if name in changes else column
        for name, column in record.columns.items()
    }
    return replace(record, columns=columns)


def renamed(record: Record, **names: str) -> Record:
    """A recording with the values of columns exchanged: ``gyro_x="gyro_y"`` puts those of gyro_y into gyro_x."""
    columns = {
        name: replace(column, values=record[names.get(name, name)].values)
        for name, column in record.columns.items()
    }
    return replace(record, columns=columns)
