"""What coefficients are uncertain by: noise, prior, and what is stated of site and base.

The covariance of a filter is split as that of the bounds along its path is; what is stated (type B) acts through the
error-state filter, run again with it changed by one standard uncertainty either way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.estimate.budget import TypeA, TypeB
from inercal.geometry.site import Site
from inercal.selfcal.bounds import Bounds
from inercal.selfcal.coefficients import names, to_product
from inercal.selfcal.filtered import problem
from inercal.selfcal.filtering import estimate
from inercal.selfcal.recording import Recording
from inercal.selfcal.settings import Noise, SelfcalSettings

Array = NDArray[np.float64]

_DEG = math.radians(1.0)
_SECOND = ("arcsec", _DEG / 3600.0)


def within(covariance: Array, bounds: Bounds, noise: Noise, dof: float) -> list[TypeA | TypeB]:
    """Noise and prior, whose covariances add up to that of the filter (p, p), product form.

    Bounds and filter differ by little; ``T`` with ``T P_bounds T^T = P_filter`` takes the parts of one to the other.
    """
    prior = bounds.prior
    roots = [np.linalg.cholesky(P / np.outer(prior, prior)) for P in (covariance, bounds.covariance)]
    to_filter = prior[:, None] * np.linalg.solve(roots[1].T, roots[0].T).T / prior
    levels = {
        "angle random walk": (noise.angle_random_walk, "rad/sqrt(s)"),
        "accelerometer": (noise.accelerometer, "m/s^2"),
        "encoder": (noise.encoder, "rad"),
    }
    found: list[TypeA | TypeB] = []
    for source, part in bounds.contributions.items():
        P = to_filter @ part @ to_filter.T
        if source in levels:
            found.append(
                TypeA(f"{source} noise" if source != "angle random walk" else source, *levels[source], P, dof)
            )
        else:
            # u in units of the prior standard deviations
            values, vectors = np.linalg.eigh(P / np.outer(prior, prior))
            root = prior[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
            found.append(TypeB(source, 1.0, "1", root))
    return found


@dataclass(frozen=True)
class _Knob:
    """One thing that is stated: its ``u`` (0 where it is taken as exact), a step for the derivative, the study with it
    changed, and how errors of it are said."""

    name: str
    u: float
    step: float
    changed: Callable[[float], SelfcalSettings]
    unit: str
    size: float


def _knobs(settings: SelfcalSettings) -> list[_Knob]:
    """What is stated; heading and tilt not where beta, with its prior, takes their place."""
    site, base = settings.site, settings.base

    def with_base(**change: Any) -> SelfcalSettings:
        return replace(settings, base=replace(base, **change))

    by_gravity = (each for each in site.inputs if each.source != "latitude")
    gravity_u = math.sqrt(sum((each.u * each.sensitivity) ** 2 for each in by_gravity))
    knobs = [
        _Knob("latitude", site.latitude_u, 1e-4, lambda by: replace(settings, site=_moved(site, by)), "deg", _DEG),
        _Knob(
            "gravity", gravity_u, 1e-5 * site.gravity,
            lambda by: replace(settings, site=replace(site, gravity=site.gravity + by)), "m/s^2", 1.0,
        ),
    ]  # fmt: skip
    if settings.filter.extended:
        return knobs
    north, east = base.tilt
    return [
        *knobs,
        _Knob("heading", base.heading_u, 1e-4, lambda by: with_base(heading=base.heading + by), "deg", _DEG),
        _Knob(
            "tilt about north", base.tilt_u[0], 1e-6, lambda by: with_base(tilt=(north + by, east)), *_SECOND
        ),
        _Knob(
            "tilt about east", base.tilt_u[1], 1e-6, lambda by: with_base(tilt=(north, east + by)), *_SECOND
        ),
    ]


def _moved(site: Site, by: float) -> Site:
    """The site at another latitude, with gravity as it was computed from it, if it was."""
    slope = sum(each.sensitivity for each in site.inputs if each.source == "latitude")
    latitude = min(max((site.latitude or 0.0) + by, -0.5 * math.pi), 0.5 * math.pi)
    return replace(site, latitude=latitude, gravity=site.gravity + slope * by)


def stated(
    recording: Recording, settings: SelfcalSettings, u: Array
) -> tuple[list[TypeB], Mapping[str, str]]:
    """What is stated of site and base.

    Parameters
    ----------
    recording : Recording
    settings : SelfcalSettings
    u : (p,)
        Standard uncertainties of the coefficients by noise and prior.

    Returns
    -------
    sources : list of `TypeB`
        What is stated with an uncertainty.
    exact : mapping
        What is stated without -> the error of it, in words, that does as much as one u of a coefficient.
    """
    sources, exact = list[TypeB](), dict[str, str]()
    known = names(len(u))
    for knob in _knobs(settings):
        by = knob.u or knob.step
        ends = [
            to_product(
                estimate(recording, problem(knob.changed(each)), "error-state", history=False).coefficients
            )
            for each in (-by, by)
        ]
        slope = (ends[1] - ends[0]) / (2.0 * by)
        worst = int(np.argmax(np.abs(slope) / u))
        if knob.name == "gravity" and knob.u:
            sources += [
                TypeB(each.source, each.u, each.unit, each.sensitivity * slope)
                for each in settings.site.inputs
                if each.source != "latitude"
            ]
        elif knob.u:
            sources.append(TypeB(knob.name, knob.u, "rad", slope))
        elif slope[worst] != 0.0:
            error = u[worst] / abs(slope[worst]) / knob.size
            exact[knob.name] = f"{error:.2g} {knob.unit} of {knob.name} ({known[worst]})"
    return sources, exact
