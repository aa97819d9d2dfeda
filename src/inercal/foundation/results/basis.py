"""Basis of a result beside its numbers: command, model, conditions, files, versions, publications."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from inercal.foundation.inputs import Source
from inercal.foundation.units import Quantity

if TYPE_CHECKING:
    from inercal.foundation.geometry.site import Site


@dataclass(frozen=True)
class Basis:
    """Basis of an `inercal.foundation.results.result.Estimate`; its fields of the same names."""

    command: str
    model: str = ""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    traceability: Mapping[str, str] = field(default_factory=dict)
    inputs: tuple[Source, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    references: tuple[str, ...] = ()


class Settings(Protocol):
    """Site, temperature and texts, which studies of all systems have."""

    @property
    def site(self) -> Site:
        """Gravity and latitude."""

    @property
    def temperature(self) -> Quantity | None:
        """Temperature of the instrument, as stated."""

    @property
    def traceability(self) -> Mapping[str, str]:
        """Free texts, the date among them."""

    @property
    def given(self) -> Mapping[str, Any]:
        """Keys of the study, as they were given."""


def studied(
    command: str,
    settings: Settings,
    inputs: Iterable[Source],
    model: str,
    references: tuple[str, ...],
    conditions: Mapping[str, Any] | None = None,
) -> Basis:
    """The basis of a result that a study and recordings lead to; ``conditions`` as `conditions_of` gives them."""
    return Basis(
        command,
        model,
        conditions or {},
        settings.traceability,
        tuple(inputs),
        provenance(settings.given),
        references,
    )


def conditions_of(
    settings: Settings, recorded: Quantity | None, ranges: Mapping[str, Any], **own: Any
) -> dict[str, Any]:
    """The conditions of a result, ``own`` ones of this kind of estimate (such as its frame) first.

    The temperature is that of the study, else the ``recorded`` one
    (`inercal.foundation.records.record.recorded_temperature`); ``ranges`` has smallest and largest input by name, its
    SI unit at the end of the name.
    """
    site, of_study = settings.site, settings.temperature
    temperature = recorded if of_study is None else of_study
    return own | {
        "temperature": temperature and {"value": temperature.value, "u": temperature.u, "unit": "degC"},
        "site": {"gravity_m_s2": site.gravity, "latitude_rad": site.latitude},
        "date": settings.traceability.get("date", ""),
        "ranges": ranges,
    }


def provenance(given: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance for a repetition beside the inputs: the keys ``given``; nothing is random."""
    import platform

    import scipy

    versions = {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}
    return {"settings": given, "seed": None, "versions": versions}
