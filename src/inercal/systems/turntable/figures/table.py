"""A table and its errors: as facts of a page, and drawn with its axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.rig import DrawnTriad, DrawnTurn
from inercal.faces.report.rig import rig as drawn
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint

if TYPE_CHECKING:
    from inercal.systems.turntable.settings import TurntableSettings


def rig(chain: Chain) -> Picture:
    """A table at zero angles: its axes, which way each turns plus, and the axes of the instrument."""
    attitude, joints = np.eye(3), []
    for element in chain.elements:
        match element:
            case Fixed():
                attitude = attitude @ element.rotation
            case Joint():
                joints.append(DrawnTurn(element.name, attitude[:, "xyz".index(element.axis)]))
    order = ", ".join(each.name for each in joints)
    return drawn(
        "Axes and signs of the table",
        f"The table at zero angles as the study states it: its axes from the outer to the inner one, {order}, each "
        "plus along its arrow, and the axes x, y, z of the instrument. Compare with the table: an instrument mounted "
        "another way or an angle that counts the other way shows here first.",
        joints,
        DrawnTriad(("x", "y", "z"), attitude),
    )


def rig_facts(settings: TurntableSettings) -> list[tuple[str, str, str]]:
    """Rig and site, as name, unit and text."""
    site = settings.site
    facts = [("rig", "", settings.rig.replace("_", " ")), ("gravity", "m/s²", f"{site.gravity:.7g}")]
    if site.latitude is not None:
        u = f" (u {np.degrees(site.latitude_u):.2g}°)" if site.latitude_u else ""
        facts.append(("latitude", "", f"{np.degrees(site.latitude):.6g}°{u}"))
    return facts


def factor_rows(errors: Sequence[Error]) -> list[tuple[str, str, str, str, str]]:
    """Name, words, distribution, size and scope of the errors of a table."""
    return [
        (
            error.name,
            error.what,
            error.distribution.kind.replace("_", "-"),
            _size(error),
            error.scope.value,
        )
        for error in errors
    ]


def _size(error: Error) -> str:
    """Size of an error in a unit of its magnitude: half width with ±, else one standard deviation."""
    size = error.distribution.size
    sign = "± " if error.distribution.kind in ("uniform", "triangular", "two_point") else "σ = "
    if error.is_offset:
        return f"{sign}{1e3 * size:.3g} mm"
    arcmin = float(np.degrees(size)) * 60.0
    if arcmin >= 60.0:
        return f"{sign}{arcmin / 60.0:.3g}°"
    return f"{sign}{arcmin:.3g} arcmin" if arcmin >= 0.9995 else f"{sign}{60.0 * arcmin:.3g} arcsec"
