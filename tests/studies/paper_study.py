"""The study of the paper, for tests: its defaults as settings, and what its gating costs."""

from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np

from inercal.foundation.geometry.earth import Site, gravity
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.platform.plan import path as named_path
from inercal.systems.selfcal.settings import Gating, Noise, SelfcalSettings

DEG = np.pi / 180.0
PER_HOUR = DEG / 3600.0
ARCSEC = DEG / 3600.0
MICRO_G = 9.80665e-6
PPM = 1e-6

NOISE = {
    "low": Noise(1e-4 * DEG / 60.0, 1.0 * MICRO_G, 0.5 * ARCSEC),
    "nominal": Noise(5e-4 * DEG / 60.0, 10.0 * MICRO_G, 2.0 * ARCSEC),
    "high": Noise(2e-3 * DEG / 60.0, 50.0 * MICRO_G, 5.0 * ARCSEC),
}

#: product form: kg0, eta, ds, do, ka0, ka1, kg1, beta
TRUTH = np.concatenate(
    [
        np.array([0.08, -0.06, 0.10]) * PER_HOUR,
        np.array([60.0, -90.0, 120.0]) * ARCSEC,
        np.array([60.0, -45.0, 90.0]) * ARCSEC,
        np.array([-75.0, 50.0, -100.0]) * ARCSEC,
        np.array([100.0, -150.0, 200.0]) * MICRO_G,
        np.array([500.0, -300.0, 800.0]) * PPM,
        np.zeros(6),
    ]
)

PRIOR = np.repeat(
    [
        0.3 * PER_HOUR,
        300 * ARCSEC,
        300 * ARCSEC,
        300 * ARCSEC,
        500 * MICRO_G,
        1500 * PPM,
        100 * PPM,
        60 * ARCSEC,
    ],
    3,
)


def study(path="paper", noise="nominal", **changes):
    """Settings of the paper's study with a named path and noise level; ``changes`` are fields of the settings."""
    latitude = 40.0 * DEG
    given = {
        "site": Site(float(gravity(latitude)), (), latitude),
        "noise": NOISE[noise],
        "prior": PRIOR,
        "truth": TRUTH,
        "plan": named_path(path),
    }
    return SelfcalSettings(**(given | changes))


def gating_costs(motion, problem, truth=None):
    """What near-level gating costs: (rule, what it stops) -> u over that without gating (p,), each at least 1."""
    kinds = get_type_hints(Gating)

    def u(gating):
        return bounds(motion, replace(problem, filter=replace(problem.filter, gating=gating)), truth).u

    free = u(None)
    return {
        (rule, stops): u(Gating(rule, stops)) / free
        for rule in get_args(kinds["rule"])
        if rule != "off"
        for stops in get_args(kinds["stops"])
    }
