"""Under what a result holds: temperature, site, date and ranges, told alike by all estimates."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from inercal.geometry.site import Site
from inercal.units import Quantity


class Settings(Protocol):
    """What studies of all systems state of where and when."""

    @property
    def site(self) -> Site:
        """Gravity and latitude."""

    @property
    def temperature(self) -> Quantity | None:
        """That stated of the instrument."""

    @property
    def traceability(self) -> Mapping[str, str]:
        """Free texts, the date among them."""


def conditions(
    settings: Settings, recorded: str | None, ranges: Mapping[str, Any], **own: Any
) -> dict[str, Any]:
    """The conditions of a result, as `inercal.estimate.result.Estimate` has them.

    Parameters
    ----------
    settings : Settings
        The study.
    recorded : str or None
        The temperature that was recorded (`inercal.records.temperature.recorded_temperature`), which that of the study
        goes before.
    ranges : mapping
        Smallest and largest input by name, its SI unit at the end of the name.
    **own
        What only this kind of estimate has, such as its frame; comes first.
    """
    site, stated = settings.site, settings.temperature
    return own | {
        "temperature": recorded if stated is None else stated.text,
        "site": {"gravity_m_s2": site.gravity, "latitude_rad": site.latitude},
        "date": settings.traceability.get("date", ""),
        "ranges": ranges,
    }
