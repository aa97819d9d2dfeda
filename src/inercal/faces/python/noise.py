"""The noise of an instrument at rest in Python."""

from __future__ import annotations

from typing import TYPE_CHECKING

from inercal.faces.python.result import Result, View
from inercal.foundation.noise.outcome import NoiseResult, noise_of
from inercal.foundation.records.record import Record

if TYPE_CHECKING:
    from inercal.faces.report.html import Picture


def allan(record: Record) -> Result:
    """Tell the noise of an instrument from a recording at rest.

    Parameters
    ----------
    record : Record
        At rest; ``record.between(...)`` takes a part of it.

    Returns
    -------
    Result
        N, B, K, R and Q of every channel that measures motion, with uncertainties; ``evidence.channels`` have the
        Allan deviations.

    Raises
    ------
    RecordError
        No such channel, hardly any samples, or time stamps that do not increase.

    Examples
    --------
    >>> import inercal as ic
    >>> import numpy as np
    >>> white = np.random.default_rng(1).standard_normal(6000) * 1e-3
    >>> noise = ic.allan(ic.record(gyro_z=white, rate=100.0))
    >>> round(noise["N_gyro_z"].value, 6), noise["N_gyro_z"].unit
    (0.0001, 'rad/sqrt(s)')
    """
    return of_noise(noise_of(record))


def of_noise(noise: NoiseResult) -> Result:
    """The noise of the channels of a record as a result."""

    def tables() -> list[str]:
        from inercal.faces.report.allan import table

        return [table(noise)]

    def page() -> str:
        from inercal.faces.report.allan import page as of_page

        return of_page(noise)

    def picture() -> Picture:
        from inercal.faces.report.allan import pictures

        return pictures(noise)[0]

    estimate = noise.estimate
    first = noise.channels[0]
    seen = f"N_{first.name}"
    words = f"{len(noise.channels)} channels"
    if seen in estimate.names:
        words += f", of the first {seen} = {estimate[seen].value:.3g} {estimate[seen].unit}"
    return Result(estimate, View(estimate, words, tables, page, picture), noise)
