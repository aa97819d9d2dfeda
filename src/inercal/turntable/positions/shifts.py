"""Shift of the values by faults of a test: findings, and their part of the budget."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.arrays import Array
from inercal.estimate.budget import TypeB
from inercal.findings import Finding
from inercal.turntable.limits import LIMITS
from inercal.turntable.positions.examination import Examination, Seen, Tested
from inercal.turntable.regression import Regression
from inercal.units import Unit

SHOWN = 4
"""Coefficients and faults named at most in a sentence."""

REMEDY: Mapping[str, str] = {
    "trend": "let it settle, state bias_drift, or take the positions in an order without one",
    "warm_up": 'wait until it is warm, or state bias_drift = "exponential"',
    "heading_suspect": "check the azimuth, and state it as [rig.base] azimuth with dbase_z for its uncertainty",
    "level_suspect": "level the base, or state dbase_x and dbase_y",
    "angle_harmonic": "check the encoder, or state a larger error of this joint",
    "approach_hysteresis": "reach all positions from the same side",
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
    """Findings of significant faults, and of those that the test would not show."""
    shown = (unit.factor, unit.symbol)
    for each in examination.significant:
        shift = scale.shift(fit, each.fault.effect(each.values)[..., None])[:, 0]
        harm = tuple(
            name for name, by in zip(scale.names, shift, strict=True) if abs(by) > LIMITS.harmful_shift
        )
        text = (
            f"{each.fault.what} of {each.fault.size(each.values, shown)} (by chance with a probability of "
            f"{each.chance:.1g}): it shifts {_largest(scale.names, shift)}; {REMEDY[each.fault.code]}"
        )
        yield Finding(each.fault.code, text, "", harm)
    worst: dict[str, tuple[float, str]] = {}
    for seen in examination.asked:
        blind, text = _blind(seen, fit, scale, shown)
        if blind > max(LIMITS.blind_shift, worst.get(seen.fault.kind, (0.0, ""))[0]):
            worst[seen.fault.kind] = (blind, text)
    if worst:
        texts = "; ".join(text for _, text in worst.values())
        yield Finding("weak_test", f"the residuals might not show what shifts a value by 2 u: {texts}")


def _blind(seen: Seen, fit: Regression, scale: Scale, shown: tuple[float, str]) -> tuple[float, str]:
    """The largest shift of a value, over u, by a fault of one standard uncertainty, and in words the size of the fault
    that would make it 2 u."""
    shift = scale.shift(fit, seen.fault.columns) @ seen.spread
    worst = int(np.argmax(np.linalg.norm(shift, axis=1)))
    most = float(np.linalg.norm(shift[worst]))
    if not most:
        return 0.0, ""
    values = seen.spread @ (shift[worst] / most) * (2.0 / most)
    return most, f"{seen.fault.what} of {seen.fault.size(values, shown)} ({scale.names[worst]})"


def doubts(examination: Examination, fit: Regression, scale: Scale, unit: Unit) -> list[TypeB]:
    """Sources of uncertainty: faults that are not significant, or harmless, and beyond what chance does to most."""
    tested: Sequence[Tested] = (*examination.significant, *examination.doubtful)
    sources = []
    for each in tested:
        shift = scale.shift(fit, each.fault.effect(each.values)[..., None])[:, 0]
        if each in examination.significant and np.abs(shift).max() > LIMITS.harmful_shift:
            continue
        size = each.fault.size(each.values, (unit.factor, unit.symbol))
        source = f"{each.fault.what} of {size}, not excluded"
        sources.append(TypeB(source, 1.0, "1", shift * scale.u, redrawn=True))
    return sources


def _largest(names: Sequence[str], shift: Array) -> str:
    """The values that are shifted most, in words."""
    order = np.argsort(-np.abs(shift))[:SHOWN]
    texts = [f"{names[k]} by {shift[k]:+.1f} u" for k in order if abs(shift[k]) > 0.1]
    return ", ".join(texts) or "no value by more than 0.1 u"
