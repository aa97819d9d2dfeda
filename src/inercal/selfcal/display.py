"""A self-calibration for people: coefficients in units of the field, and filters side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.estimate.result import Estimate, in_degrees
from inercal.selfcal.platform.coefficients import units
from inercal.units import STANDARD_GRAVITY

#: key of the statistics -> in words
_STATISTICS = {
    "residual_rms": "root-mean-square normalised innovation, expected 1",
    "chi2": "normalised innovations squared, summed",
    "nis_mean": "normalised innovation squared of a row (NIS), mean",
    "nis_expected": "NIS, expected",
    "nis_limit": "NIS, largest mean of a recording that fits the model",
    "steps": "steps from row to row",
}

#: SI unit -> that of the field, and how many of the old it is
_OF_FIELD = {
    "rad/s": ("deg/h", np.radians(1.0 / 3600.0)),
    "rad": ("arcsec", np.radians(1.0 / 3600.0)),
    "m/s^2": ("ug", 1e-6 * STANDARD_GRAVITY),
    "1": ("ppm", 1e-6),
    "rad/sqrt(s)": ("deg/sqrt(h)", np.radians(1.0 / 60.0)),
}


def shown_unit(si: str) -> tuple[str, float]:
    """A unit for people, and how many of the old it is: deg/h, arcsec, ug, ppm, deg/sqrt(h); others stay."""
    return _OF_FIELD.get(si, (si, 1.0))


def of_field(p: int) -> tuple[tuple[str, ...], Array]:
    """Units of the first ``p`` coefficients for people, and how many SI units (p,) each is."""
    shown = [shown_unit(unit) for unit in units(p)]
    return tuple(unit for unit, _ in shown), np.array([size for _, size in shown])


def displayed(estimate: Estimate) -> Estimate:
    """The estimate with coefficients and budget in units of the field, angles of the conditions in degrees, and keys
    of the statistics in words.

    What has unit 1 in the budget, and all of ``result``, stays as it is.
    """
    return replace(
        estimate.in_units([shown_unit(unit) for unit in estimate.units]),
        conditions=in_degrees(estimate.conditions),
        statistics=_in_words(estimate),
        budget=tuple(
            replace(item, u=item.u / size, unit=unit)
            for item in estimate.budget
            for unit, size in [(item.unit, 1.0) if item.unit == "1" else shown_unit(item.unit)]
        ),
    )


def _in_words(estimate: Estimate) -> dict[str, float]:
    """Statistics under keys for people, and what a row cost."""
    told = {_STATISTICS.get(key, key): value for key, value in estimate.statistics.items()}
    if "step_us" in estimate.result:
        told["time of a row_us"] = estimate.result["step_us"]
        told["time of a row, of the sample interval_percent"] = 100.0 * estimate.result["sample_share"]
    return told
