"""Units of three grades, as the studies of the tests have them, and runs of known truth."""

from dataclasses import replace

import numpy as np

from inercal.foundation.geometry.earth import Site, gravity
from inercal.foundation.units import parse_quantity
from inercal.systems.strapdown.fit.batch import fit
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.model.coefficients import SIZE, free_places
from inercal.systems.strapdown.settings import TURN_NOISE, Noise, Prior, Rests, StrapdownSettings, TurnPlan
from inercal.systems.strapdown.simulate import simulated


def si(text, dimension):
    """A quantity in SI."""
    return parse_quantity(text, dimension, "test").value


POSITIONS_19 = "y y y -y -y -y z x x x -x -x -x z z -z -z -z"


def plan(text=POSITIONS_19, **times):
    """A plan of turns by 90 deg, with the start attitude of the path of 19 positions."""
    turns = tuple(
        ("xyz".index(turn[-1]), np.radians(-90.0 if turn[0] == "-" else 90.0)) for turn in text.split()
    )
    return TurnPlan(turns, tuple(np.radians([0.0, -90.0, 0.0])), **times)


_LATITUDE = np.radians(34.0)

NAV = StrapdownSettings(
    site=Site(float(gravity(_LATITUDE)), (), _LATITUDE),
    noise=Noise(
        si("5e-4 deg/sqrt(h)", "angle random walk"),
        si("5 ug/sqrt(Hz)", "velocity random walk"),
        estimate=TURN_NOISE,
    ),
    prior=Prior(
        gyro_bias=si("1 deg/h", "rate"),
        scale=300e-6,
        misalignment=300e-6,
        bias=si("500 ug", "acceleration"),
        k1=300e-6,
        axes=300e-6,
        k2=si("50 ug/g^2", "quadratic"),
        size=0.05,
        delay=2e-3,
    ),
    plan=plan(first_dwell=70.0),
)

TACTICAL = replace(
    NAV,
    noise=Noise(
        si("0.05 deg/sqrt(h)", "angle random walk"),
        si("50 ug/sqrt(Hz)", "velocity random walk"),
        estimate=TURN_NOISE,
    ),
    rests=Rests(velocity=2e-4, attitude=si("5 arcsec", "angle")),
    prior=Prior(
        gyro_bias=si("30 deg/h", "rate"),
        scale=1e-3,
        misalignment=1e-3,
        bias=si("5 mg", "acceleration"),
        k1=1e-3,
        axes=1e-3,
        k2=si("100 ug/g^2", "quadratic"),
        size=0.05,
        delay=5e-3,
    ),
    plan=plan(turn_time=4.0, first_dwell=70.0),
)

MEMS = replace(
    NAV,
    noise=Noise(
        si("0.3 deg/sqrt(h)", "angle random walk"),
        si("150 ug/sqrt(Hz)", "velocity random walk"),
        si("0.4 deg/h/sqrt(s)", "rate random walk"),
        si("2 ug/sqrt(s)", "acceleration random walk"),
    ),
    rests=Rests(velocity=1e-3, attitude=si("0.01 deg", "angle")),
    prior=Prior(
        gyro_bias=si("1 deg/s", "rate"),
        scale=1e-2,
        misalignment=1e-2,
        bias=si("50 mg", "acceleration"),
        k1=1e-2,
        axes=1e-2,
        k2=si("300 ug/g^2", "quadratic"),
        size=0.05,
        delay=0.01,
    ),
    plan=plan(turn_time=1.5, dwell=15.0, first_dwell=30.0),
)

GRADES = {"nav": NAV, "tactical": TACTICAL, "mems": MEMS}


def drawn(settings, rng):
    """Coefficients (51,) drawn from the prior."""
    c, places = np.zeros(SIZE), free_places(settings.terms, False, False)
    c[places] = settings.deviations()[places] * rng.standard_normal(len(places))
    return c


def fitted(settings, c, rng, noise=True):
    """The fit of a simulated run of a unit with the coefficients ``c`` (51,)."""
    samples = simulated(settings, c, rng, noise)
    return fit(
        samples, nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node), settings
    )


def u_by_kind(fit):
    """Largest u of each kind of coefficient, in deg/h, ppm, urad, ug, ppm, urad, ug/g^2, cm, ms."""
    u = np.zeros(SIZE)
    u[fit.free] = np.sqrt(np.diag(fit.covariance))
    g = 9.80665
    return {
        "gyro_bias": np.degrees(u[:3].max()) * 3600.0,
        "scale": 1e6 * u[[3, 7, 11]].max(),
        "misalignment": 1e6 * u[[4, 5, 6, 8, 9, 10]].max(),
        "bias": 1e6 * u[12:15].max() / g,
        "k1": 1e6 * u[[15, 19, 23]].max(),
        "axes": 1e6 * u[[16, 17, 20]].max(),
        "k2": 1e6 * u[24:27].max() * g,
        "size": 1e2 * u[27:33].max(),
        "delay": 1e3 * u[36],
    }
