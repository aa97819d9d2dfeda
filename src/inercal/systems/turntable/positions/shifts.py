"""Shift of the values by faults of a test: findings, and their part of the budget.

An uncertain latitude to second order: the fit is made again on either side of it, and a rule says what follows.

With f(L) a value as fitted at latitude L and f1, f2, f3 its derivatives, ``bend = (f(L+u) + f(L-u) - 2 f(L)) / 2`` is
``f2 u^2 / 2``. Of a normal L the mean of f is off by it, and the variance of f larger by ``f2^2 u^4 / 2 + f1 f3 u^4``
(GUM, JCGM 100:2008, 5.1.2, note).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.results.budget import TypeB
from inercal.foundation.rigs.outputs import rate_reference
from inercal.foundation.units import Unit
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.examination import Examination, TestedFault
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


_SHOWN = 4
"""Coefficients and faults named at most in a sentence."""

_DRIFTS = frozenset({"trend", "warm-up", "scale drift", "reading"})
"""Kinds of faults that are others in each run."""

_REMEDY: Mapping[str, str] = {
    "trend": "let it settle, state bias_drift, or take the positions in an order without one",
    "warm_up": 'wait until it is warm, or state bias_drift = "exponential"',
    "heading_suspect": "check the azimuth, and state it as [rig.base] azimuth with dbase_z for its uncertainty",
    "level_suspect": "level the base, or state dbase_x and dbase_y",
    "angle_harmonic": "check the encoder, or state a larger error of this joint",
    "approach_hysteresis": "reach all positions from the same side",
    "outlier": "look for an angle that was mistyped, rows exchanged or a knock, and take this position out or again",
    "ground_field": "look for magnets and iron, or shield the instrument",
}
"""Remedy for a finding of each code."""


@dataclass(frozen=True, eq=False)
class Scale:
    """Values of a result: ``names`` (p,), ``slope`` (p, p) of them by the linear coefficients, ``u`` (p,)."""

    names: tuple[str, ...]
    slope: Array
    u: Array

    def shift(self, fit: Regression, columns: Array) -> Array:
        """Shift (p, m) of the values by each column (n, c, m), over u."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(self.slope @ fit.shift(columns) / self.u[:, None])


def findings_of(examination: Examination, fit: Regression, scale: Scale, unit: Unit) -> Iterator[Finding]:
    """Findings of significant faults."""
    shown = (unit.factor, unit.symbol)
    for each in examination.significant:
        shift = scale.shift(fit, each.fault.effect(each.values)[..., None])[:, 0]
        most = np.abs(shift) + _hidden(each, fit, scale)
        harm = tuple(name for name, by in zip(scale.names, most, strict=True) if by > LIMITS.harmful_shift)
        text = (
            f"{each.fault.what} of {each.fault.size(each.values, shown)} (by chance with a probability of "
            f"{each.chance:.1g}) shifts {_largest(scale.names, shift)}"
        )
        yield Finding(each.fault.code, text, "", harm, action=_REMEDY[each.fault.code])


def _hidden(tested: TestedFault, fit: Regression, scale: Scale) -> Array:
    """Shift (p,) of the values, over u, by the part of a fault that does not show, were it as large as the rest."""
    seen = tested.seen
    size = float(np.linalg.norm(tested.values)) / np.sqrt(max(seen.base.shape[1], 1))
    return np.asarray(size * np.linalg.norm(scale.shift(fit, seen.fault.columns) @ seen.hidden, axis=1))


def doubts(examination: Examination, fit: Regression, scale: Scale) -> list[TypeB]:
    """Sources of uncertainty: faults that do no harm, and those that may be there, with their probability.

    With the probability P that a fault is there a value is off by its shift s, known to b, or by none: its mean square
    error is larger by ``P (s^2 + b^2)``.
    """
    sources = []
    for each in examination.significant:
        shift = scale.shift(fit, each.fault.effect(each.values)[..., None])
        if (np.abs(shift[:, 0]) + _hidden(each, fit, scale)).max() <= LIMITS.harmful_shift:
            sources.append(_source(each, shift * scale.u[:, None]))
    for each in examination.doubtful:
        shift = scale.shift(fit, each.fault.effect(each.values)[..., None])
        spread = scale.shift(fit, each.fault.columns) @ each.seen.base
        reach = each.seen.reach * np.linalg.norm(spread, axis=1, keepdims=True)
        part = np.sqrt(each.probability) * LIMITS.blind_shift / np.maximum(reach, LIMITS.blind_shift)
        sources.append(_source(each, part * np.hstack([shift, spread]) * scale.u[:, None]))
    return sources


def _source(tested: TestedFault, shifts: Array) -> TypeB:
    """A fault as a source of ``shifts`` (p, q) of the values; the base and the table are the same in repeat runs."""
    return TypeB(f"{tested.fault.what}, not excluded", 1.0, "1", shifts, redrawn=tested.fault.kind in _DRIFTS)


def _largest(names: Sequence[str], shift: Array) -> str:
    """The values that are shifted most, in words."""
    order = np.argsort(-np.abs(shift))[:_SHOWN]
    texts = [f"{names[k]} by {shift[k]:+.1f} u" for k in order if abs(shift[k]) > 0.1]
    return ", ".join(texts) or "no value by more than 0.1 u"
