"""Facts of a study on a page of self-calibration: site, noise and path."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from inercal.instruments.terms import shown_unit

if TYPE_CHECKING:
    from inercal.selfcal.settings import SelfcalSettings


def facts(settings: SelfcalSettings) -> list[tuple[str, str, str]]:
    """Site, noise and path, as name, unit and text."""
    noise, site = settings.noise, settings.site
    _, arcsec = shown_unit("rad")
    _, ug = shown_unit("m/s^2")
    rows = [
        ("latitude", "°", f"{np.degrees(site.latitude):.6g}") if site.latitude is not None else ("", "", ""),
        ("gravity", "m/s²", f"{site.gravity:.7g}"),
        ("angle random walk", "°/√h", f"{np.degrees(noise.angle_random_walk) * 60.0:.3g}"),
        ("noise of an accelerometer's sample", "µg", f"{noise.accelerometer / ug:.3g}"),
        ("noise of an encoder's sample", "arcsec", f"{noise.encoder / arcsec:.3g}"),
    ]
    if settings.plan is not None:
        rows.append(("path of the study", "", settings.plan.words()))
    return [row for row in rows if row[0]]
