"""The study of a strapdown unit: one file for its simulation and its calibration."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from inercal.faces.studies.common import StudyFile, site_on_earth
from inercal.faces.studies.instrument import check_symbol, coefficient_of
from inercal.faces.studies.tables import settings_of, table_of
from inercal.foundation._toml import check
from inercal.foundation.errors import StudyError
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.strapdown.model.coefficients import OPTIONS, names
from inercal.systems.strapdown.settings import ESTIMABLE, Noise, StrapdownSettings

FEWEST_ROWS, MOST_ROWS = 100, 20_000_000
"""Samples of a simulated recording."""


class StrapdownStudyFile(table_of(StrapdownSettings, tables=True), StudyFile):  # type: ignore[misc]
    """A study of a strapdown unit, for `inercal design strapdown`, `simulate strapdown` and `calibrate strapdown`."""

    strapdown: table_of(StrapdownSettings, tables=False) = Field(  # type: ignore[valid-type]
        title="Strapdown", description="what to calibrate; this table tells the kind of study"
    )
    noise: table_of(Noise) = Field(  # type: ignore[valid-type]
        title="Noise", description="noise of the sensors, and of turns"
    )


def strapdown_study(data: Mapping[str, Any], path: str | Path) -> StrapdownSettings:
    """A study in SI, of its parsed TOML ``data``.

    Raises `StudyError` for the first thing wrong, naming file and key.
    """
    file: Any = check(StrapdownStudyFile, data, path, StudyError)
    site = site_on_earth(file.site, path, "unit")
    known, truth = names(OPTIONS, file.strapdown.frame), {}
    for symbol, text in file.truth.items():
        key = f"truth.{symbol}"
        check_symbol(symbol, known, key, path)
        kind = "accelerometer" if symbol.startswith("K") else "gyro"
        unit = parse_unit("m/s^2" if kind == "accelerometer" else "rad/s")
        truth[symbol], _ = coefficient_of(text, symbol, kind, unit, site.gravity, key, path)
    stated = {name for name in ESTIMABLE if isinstance(getattr(file.noise, name), Quantity)}
    estimate = tuple(name for name in ESTIMABLE if name not in stated)
    if (plan := file.plan) and not FEWEST_ROWS <= (rows := plan.duration * plan.sample_rate) <= MOST_ROWS:
        raise StudyError(path, f"plan: found {rows:.4g} samples, expected {FEWEST_ROWS} to {MOST_ROWS:.0e}")
    return settings_of(
        StrapdownSettings,
        file,
        file.strapdown,
        site=site,
        noise=settings_of(Noise, file.noise, estimate=estimate),
        terms=tuple(dict.fromkeys(file.strapdown.terms)),
        truth=truth,
        **file.shared(data),
    )
