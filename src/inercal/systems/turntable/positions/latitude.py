"""An uncertain latitude to second order: the fit is made again on either side of it, and a rule says what follows.

With f(L) a value as fitted at latitude L and f1, f2, f3 its derivatives, ``bend = (f(L+u) + f(L-u) - 2 f(L)) / 2`` is
``f2 u^2 / 2``. Of a normal L the mean of f is off by it, and the variance of f larger by ``f2^2 u^4 / 2 + f1 f3 u^4``
(GUM, JCGM 100:2008, 5.1.2, note).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.results.budget import TypeB
from inercal.foundation.rigs.outputs import rate_reference
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.shifts import Scale
from inercal.systems.turntable.regression import Regression, solve

_NEAREST = float(np.radians(1.0))
"""Distance from a pole [rad] within which no fit is made."""

_SMALL = 0.01
"""Step for the derivative, in u."""


def of_latitude(
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
    at = site.latitude

    def fitted(steps: float) -> Array:
        """The values at a latitude that is so many u away."""
        latitude = np.clip(at + steps * site.latitude_u, _NEAREST - np.pi / 2, np.pi / 2 - _NEAREST)
        return np.asarray(slope @ _refitted(fit, float(latitude)))

    low, high, middle = fitted(-1.0), fitted(1.0), fitted(0.0)
    bend = 0.5 * (low + high) - middle
    first = 0.5 * (fitted(_SMALL) - fitted(-_SMALL)) / _SMALL
    third = 0.5 * (high - low) - first  # f3 u^3 / 6
    part = np.abs(bend) / np.where(u > 0.0, u, np.inf)
    harm = tuple(name for name, each in zip(names, part, strict=True) if each > LIMITS.bent_part)
    if harm:
        text = (
            f"the latitude is so uncertain ({np.degrees(site.latitude_u):.2g} deg) that u of {', '.join(harm)} "
            "cannot be had from it"
        )
        return [], [Finding("uncertain_site", text, "", harm, action="state it better")]
    if part.max() < LIMITS.straight_part:
        return [], []
    more = np.sign(first) * np.sqrt(np.maximum(6.0 * first * third, 0.0))
    shifts = np.stack([np.sqrt(3.0) * bend, more], axis=-1)
    return [TypeB("latitude, second order", 1.0, "1", shifts)], []


def stated_exact(fit: Regression, site: Site, scale: Scale) -> list[Finding]:
    """A finding where latitude or gravity has no uncertainty, and an ordinary error of it would shift a value by 2 u:
    no residual shows either."""
    still, latitude = np.zeros(3), site.latitude or 0.0
    north = EARTH_RATE * np.array([-np.sin(latitude), 0.0, np.cos(latitude)])
    asked = [] if site.latitude_u else [("latitude", LIMITS.latitude_off, "deg", 180.0 / np.pi, still, north)]
    if not site.inputs and np.linalg.norm(fit.model.a_n) > 2.0:  # not in units of the site's gravity
        asked.append(("gravity", LIMITS.gravity_off, "m/s^2", 1.0, fit.model.a_n / site.gravity, still))
    texts = []
    for what, ordinary, unit, factor, a_n, w_n in asked:
        column = fit.model.by_references(fit.angles, fit.c, a_n, w_n)
        shift = np.abs(scale.shift(fit, column[..., None])[:, 0])
        worst = int(np.argmax(shift))
        if ordinary * shift[worst] > 2.0:
            size = 2.0 / shift[worst] * factor
            texts.append(
                f"{what} has no uncertainty, and {size:.1g} {unit} would shift {scale.names[worst]} by 2 u"
            )
    return [Finding("stated_exact", "; ".join(texts))] if texts else []


def _refitted(fit: Regression, latitude: float) -> Array:
    """Linear coefficients (p,) with the earth rate of another latitude, by the same weights."""
    model = replace(fit.model, w_n=rate_reference(latitude))
    rows = np.concatenate([model.rows(fit.angles), fit.effects.free], axis=-1)
    y = fit.y - model.outputs(fit.angles, np.zeros(len(fit.c)))
    y = y if fit.second is None else y - fit.second.mean
    return solve(rows, y, fit.weights(fit.noise)).c[: len(fit.c)]
