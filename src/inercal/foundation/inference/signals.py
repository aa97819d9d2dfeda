"""Readings that do not look like readings, and parts of a test that scatter more than the others."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.evidence import FitEvidence
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.inference.questions import JudgedFit


def _rms(fit: JudgedFit, own: NDArray[np.int64]) -> float:
    """Rms residual of some readings."""
    return float(np.sqrt(np.mean(np.square(fit.residuals[own]))))


def _sigma(fit: JudgedFit, own: NDArray[np.int64]) -> float:
    """Standard deviation of a reading of some, their median."""
    return float(np.median(np.sqrt(np.diag(fit.covariance)[own])))


def _grid(y: Array, rms: float) -> float:
    """The step of which all differences of readings ``y`` (n,) are multiples; 0 where there is none.

    A plan of regular inputs makes multiples too, but only as exact as its scatter ``rms``.
    """
    steps = np.diff(np.unique(y))
    steps = steps[steps > 1e-9 * np.ptp(y)]
    if len(steps) < 3:
        return 0.0
    step = float(steps.min())
    left = float(np.abs(steps - step * np.round(steps / step)).max())
    return step if left < 1e-3 * min(step, rms) else 0.0


def ends(fit: JudgedFit) -> Iterator[Finding]:
    """Channels with equal readings at an end where the model differs."""
    for channel, name in enumerate(fit.channels):
        own = np.flatnonzero(fit.channel == channel)
        if not len(own):
            continue
        y, model = fit.readings[own], fit.predicted[own]
        if _grid(y, _rms(fit, own)) > 0.0 or not np.ptp(y):
            continue
        for word, end in (("upper", y.max()), ("lower", y.min())):
            tied = np.abs(y - end) <= 1e-12 * np.ptp(y)
            if tied.sum() > 1 and np.abs(model[tied] - model[tied].mean()).max() > LIMITS.tied * _sigma(
                fit, own
            ):
                yield Finding(
                    "saturation",
                    f"{int(tied.sum())} readings of {name} are equal at its {word} end, where the model differs.",
                    "",
                    EVERYTHING,
                    action="Take these readings out, or measure within the range of the sensor.",
                )


def steps(fit: JudgedFit) -> Iterator[Finding]:
    """Channels whose steps are larger than the scatter of their readings, and hence no noise."""
    for channel, name in enumerate(fit.channels):
        own = np.flatnonzero(fit.channel == channel)
        if not len(own):
            continue
        rms = _rms(fit, own)
        step = _grid(fit.readings[own], rms)
        if step <= rms:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = np.nan_to_num(np.linalg.norm(fit.gain[:, own], axis=1) * step / math.sqrt(12.0) / fit.u)
        harm = tuple(value for value, by in zip(fit.names, shift, strict=True) if by > LIMITS.harm)
        if harm:
            yield Finding(
                "coarse_output",
                f"The output {name} has steps of {step / rms:.2g} times its scatter, so that rounding is no noise.",
                "",
                harm,
                action="Record more digits, or average over samples that noise spreads over several steps.",
            )


def copies(fit: JudgedFit) -> Iterator[Finding]:
    """Rows whose readings are exactly those of another row, though the model differs."""
    seen: dict[tuple[float, ...], int] = {}
    predicted, again = fit.predicted, []
    for row in np.unique(fit.row[fit.channel >= 0]):
        own = np.flatnonzero((fit.row == row) & (fit.channel >= 0))
        first = seen.setdefault(tuple(fit.readings[own]), int(row))
        other = np.flatnonzero((fit.row == first) & (fit.channel >= 0))
        sigma = _sigma(fit, own)
        if first != row and np.abs(predicted[own] - predicted[other]).max() > LIMITS.tied * sigma:
            again.append((first, int(row)))
    if len(again) > 1:
        yield Finding(
            "row_copies",
            f"{len(again)} rows are exact copies of others at other inputs.",
            "",
            EVERYTHING,
            action="Was a block written twice? Take the copies out.",
            items=tuple(
                {"row": float(second + 1), "as row": float(first + 1)} for first, second in again[:5]
            ),
        )


def uneven(fit: JudgedFit, of_fit: FitEvidence, share: float) -> Iterator[Finding]:
    """A channel among those of its triad, or a part of the test, that scatters much more than the others."""
    left = 1.0 - np.sum(np.square(of_fit.fitted), axis=1)
    groups = [{fit.channels[k]: fit.channel == k for k in its} for its in fit.triads.values()]
    groups.append({name: fit.part == k for k, name in enumerate(fit.parts)})
    risk = share * LIMITS.part_risk / max(sum(map(len, groups)), 1)
    for parts in groups:
        whole = np.any(list(parts.values()), axis=0) if parts else np.zeros(0, dtype=bool)
        for name, own in parts.items():
            others = whole & ~own
            dof, of_others = float(left[own].sum()), float(left[others].sum())
            if min(dof, of_others) < LIMITS.fewest_degrees:
                continue
            ratio = (
                np.mean(of_fit.z[own] ** 2) * own.sum() / dof / (np.sum(of_fit.z[others] ** 2) / of_others)
            )
            if ratio > LIMITS.uneven**2 and _by_chance(dof, of_others, float(ratio)) < risk:
                yield Finding(
                    "excess_scatter",
                    f"{name} scatters {math.sqrt(ratio):.2g} times as much as the others.",
                    name,
                    EVERYTHING,
                    action="Was it taken with other axes, signs, rates or speed? Measure it again, or leave it out.",
                )


def _by_chance(dof: float, others: float, ratio: float) -> float:
    """Probability of a ratio of variances by chance."""
    from scipy.special import fdtrc

    return float(fdtrc(dof, others, ratio))
