"""An uncertain latitude to second order: the fit is made again on either side of it, and a rule says what follows.

With f(L) a value as fitted at latitude L, ``bend = (f(L + u) + f(L - u) - 2 f(L)) / 2``: of a normal L the mean of f is
off by it, and its variance larger by twice its square (GUM, JCGM 100:2008, 5.1.2, note).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.estimate.budget import TypeB
from inercal.findings import Finding
from inercal.geometry.site import Site
from inercal.rigs.outputs import rate_reference
from inercal.turntable.limits import LIMITS
from inercal.turntable.regression import Regression, solve

NEAREST = float(np.radians(1.0))
"""Distance from a pole [rad] within which no fit is made."""


def second_order(
    fit: Regression, site: Site, names: Sequence[str], slope: Array, u: Array
) -> tuple[list[TypeB], list[Finding]]:
    """A source of uncertainty where second order counts, and a finding where it does not do.

    Parameters
    ----------
    fit : Regression
    site : Site
        With its latitude.
    names, slope, u : (p,), (p, p), (p,)
        Of the values; slope by the linear coefficients; u to first order.
    """
    if not site.latitude_u or site.latitude is None:
        return [], []
    ends = [
        float(np.clip(site.latitude + sign * site.latitude_u, NEAREST - np.pi / 2, np.pi / 2 - NEAREST))
        for sign in (1.0, -1.0)
    ]
    bend = slope @ (0.5 * sum(_refitted(fit, end) for end in ends) - _refitted(fit, site.latitude))
    part = np.abs(bend) / np.where(u > 0.0, u, np.inf)
    harm = tuple(name for name, each in zip(names, part, strict=True) if each > LIMITS.bent_part)
    if harm:
        text = (
            f"the latitude is so uncertain ({np.degrees(site.latitude_u):.2g} deg) that u of {', '.join(harm)} "
            "cannot be had from it: state it better"
        )
        return [], [Finding("uncertain_site", text, "", harm)]
    if part.max() < LIMITS.straight_part:
        return [], []
    return [TypeB("latitude, second order", 1.0, "1", np.sqrt(3.0) * bend)], []


def _refitted(fit: Regression, latitude: float) -> Array:
    """Linear coefficients (p,) with the earth rate of another latitude, by the same weights."""
    model = replace(fit.model, w_n=rate_reference(latitude))
    rows = np.concatenate([model.rows(fit.angles), fit.effects.free], axis=-1)
    y = fit.y - model.outputs(fit.angles, np.zeros(len(fit.c)))
    return solve(rows, y, fit.weights(fit.noise)).c[: len(fit.c)]
