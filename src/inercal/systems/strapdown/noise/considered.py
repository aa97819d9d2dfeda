"""Drifts by specific force of a unit whose study does not fit them: how large they may be, and what they do to u.

Nine small drifts shift some coefficient by several u before chi-square tells of them. Of a common size s, each of
standard deviation s, the last linear problem of a fit gives their likelihood, and given s their mean and covariance.
The size is not chosen but averaged over, with the Cauchy distribution beyond 0 about the usual size as what is known
before: where a recording shows that the drifts are smaller, they hardly count.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.effects import second_moment
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.budget import TypeB
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.noise.left_out import Tested
from inercal.systems.strapdown.settings import StrapdownSettings

_TERM = "g_sensitivity"


class Considered(NamedTuple):
    """Drifts that are not fitted: their ``usual`` size and that ``left`` by the recording [(rad/s)/(m/s^2)], what they
    add to the covariance of results, and the finding that tells of them, None where that is little."""

    usual: float
    left: float
    source: TypeB
    finding: Finding | None


def _usual_size(settings: StrapdownSettings) -> float:
    """Usual size of drifts by specific force [(rad/s)/(m/s^2)]: that of the study's prior, where it states one, else a
    part of the gyros' biases for each g."""
    if _TERM in settings.given.get("prior", {}):
        return float(settings.prior.g_sensitivity)
    return float(LIMITS.usual_drift * settings.prior.gyro_bias / STANDARD_GRAVITY)


def considered(
    tested: list[Tested], settings: StrapdownSettings, slope: Array, found: tuple[str, ...], u: Array
) -> Considered | None:
    """Drifts by specific force among the effects outside the model; None where the study fits them.

    ``slope`` (q, p) is of the results ``found`` by the coefficients of the fit, ``u`` (q,) theirs without the drifts.
    """
    each = next((each for each in tested if each.candidate.name == _TERM), None)
    if each is None:
        return None
    size, usual = float(each.candidate.prior[0]), _usual_size(settings)
    moment = second_moment(each.score, each.information - np.eye(len(each.score)), usual / size)
    left = math.sqrt(np.trace(moment) / len(moment))
    eigenvalues, axes = np.linalg.eigh(moment)
    parts = slope @ each.moved @ axes * np.sqrt(np.maximum(eigenvalues, 0.0))
    source = TypeB("drifts by specific force", left * size, "rad/s/(m/s^2)", parts / (left * size))
    raised = np.linalg.norm(parts, axis=1) > LIMITS.considered_part * u
    names = [name for name, by in zip(found, raised.tolist(), strict=True) if by]
    return Considered(
        usual, left * size, source, _told(settings, left * size, usual, names) if names else None
    )


def _told(settings: StrapdownSettings, left: float, usual: float, names: list[str]) -> Finding:
    """The finding that tells what drifts that are not fitted do to u."""
    per_g = 3600.0 * math.degrees(STANDARD_GRAVITY)
    whence = (
        "as prior.g_sensitivity states"
        if _TERM in settings.given.get("prior", {})
        else f"usual, {LIMITS.usual_drift:.2g} of prior.gyro_bias for each g"
    )
    return Finding(
        "considered",
        f"Drifts of the gyros by specific force, {per_g * left:.2g} deg/h/g, are not fitted and count in u of "
        f"{counted_names(names, 2)}.",
        action=f'State prior.g_sensitivity if they are smaller, or add "{_TERM}" to terms.',
        items=(
            {
                "drift by specific force": whence,
                "left by this recording": per_g * left,
                "before": per_g * usual,
                "unit": "deg/h/g",
            },
        ),
    )
