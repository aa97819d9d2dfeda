"""Cases of inertial angle of attack: what Tan et al. 2021 state, and a recording against its truth."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from inercal.faces.studies.load import load_aoa_study
from inercal.faces.validate.case import Case, record_of, study_of
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.units import parse_quantity
from inercal.systems.aoa.angles import alpha_beta
from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.estimators import STATICS, Static
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.paper import lever, residuals, static
from inercal.systems.aoa.paper.methods import measure as measure_by
from inercal.systems.aoa.settings import AoaSettings, Attitude, Methods, Noise
from inercal.systems.aoa.simulate import simulate
from inercal.systems.aoa.task import Measurement, measure

_G = 9.80665
_DEG = math.pi / 180.0
_ERROR, _RATE_ERROR = 1e-4 * _G, 0.2 * _DEG
"""Errors of an accelerometer [m/s^2] and of the gyro [rad/s] that the paper states."""

_ARM = 0.5
_R2 = 0.20
_LAYOUT = Layout(
    ("a1", "a2", "a3"),
    np.array([0.5, 0.0, -0.5]) * math.pi,
    np.array([-0.25, _R2, 0.25]),
    np.zeros(3),
)
_ALL_AROUND = np.arange(-180.0, 180.0, 0.5) * _DEG
_RATES = (80.1, 26.8)
"""Peak rates [deg/s] at which mechanical compensation leaves 1 and 3 % of what the low pass leaves."""


def _off(way: Static, error: float) -> float:
    """Largest error [deg] of the angle all around where all axes err by ``error`` [m/s^2]."""
    read = _G * np.sin(_ALL_AROUND[:, None] - _LAYOUT.angle) + error
    apart = static.angle(way, read, _LAYOUT, _G).theta - _ALL_AROUND
    return float(np.abs(np.angle(np.exp(1j * apart))).max()) / _DEG


def _moving(theta: Array, w: Array, al: Array) -> Array:
    """Readings (n, 3) of a rigid model: A1 = -g cos - r1 al, A2 = g sin - r2 w^2, A3 = g cos + r3 al."""
    r1, r2, r3 = _LAYOUT.r
    up = _G * np.cos(theta)
    return np.stack([-up - r1 * al, _G * np.sin(theta) - r2 * w**2, up + r3 * al], axis=-1)


def _freed() -> Array:
    """Readings of a moving model freed of both terms, less those at rest [m/s^2], at random motions."""
    rng = np.random.default_rng(20230520)
    theta, w, al = (size * rng.uniform(-1.0, 1.0, 50) for size in (math.pi, 2.0, 20.0))
    read, _ = lever.centrifugal("mechanical", np.arange(50.0), _moving(theta, w, al), w, _LAYOUT, 1.0, 1e-3)
    _, matrix = lever.dual(_LAYOUT, 1.0)
    return read @ matrix.T - _moving(theta, np.zeros(50), np.zeros(50))


def _left() -> list[float]:
    """Error left by mechanical compensation with a gyro that errs by 0.2 deg/s, over that of a low pass [%]."""
    shares = []
    for rate in _RATES:
        t = np.arange(0.0, 4.0, 1e-3)
        om = rate / 10.0
        theta, w = 10.0 * _DEG * np.sin(om * t), rate * _DEG * np.cos(om * t)
        al = -rate * _DEG * om * np.sin(om * t)
        made, _ = lever.centrifugal(
            "mechanical", t, _moving(theta, w, al), w + _RATE_ERROR, _LAYOUT, 1.0, _RATE_ERROR
        )
        most = np.abs(made[:, 1] - _G * np.sin(theta)).max()
        shares.append(100.0 * float(most) / residuals.low_pass(_R2, rate * _DEG))
    return shares


def _late() -> list[float]:
    """Largest error [deg] of the paper's method where all sensors are 1.5 ms late at 80 deg/s."""
    motion = MotionPlan(
        "sine", duration=10.0, mean=30.0 * _DEG, amplitude=10.0 * _DEG, frequency=80.0 / (20.0 * math.pi)
    )
    none = Noise(1e-12, 1e-12, 1e-12, 1e-12)
    of = AoaSettings(Site(_G), _LAYOUT, none, motion=motion, disturbances=Disturbances(common_delay=1.5e-3))
    simulated = simulate(of, np.random.default_rng(1), {"b_1": 0.0, "b_2": 0.0, "b_3": 0.0, "b_g": 0.0})
    off = measure_by(simulated.recording, of, Methods()).theta - simulated.theta
    return [float(np.abs(off[100:-100]).max()) / _DEG]


def _flow() -> Array:
    """alpha and beta at theta of -20, 10, 35 deg and rolls of 0, 90, -30 deg, in degrees."""
    theta, none = np.array([-20.0, 10.0, 35.0]) * _DEG, np.zeros(1)
    flows = [
        alpha_beta(one[None], none, Attitude(roll=parse_quantity(roll, "angle", "roll")))
        for one, roll in zip(theta, ("0 deg", "90 deg", "-30 deg"), strict=True)
    ]
    return np.array([[flow.alpha[0], flow.beta[0]] for flow in flows]) / _DEG


_30 = 30.0 * _DEG
_35 = 35.0 * _DEG


@cache
def _sting(smooth: bool) -> tuple[Measurement, Array]:
    """The recording that ships by the fusion, and the true angle [rad] at its rows."""
    settings = load_aoa_study(study_of("sting"), ("estimator.smooth=true",) if smooth else ())
    simulated = simulate(settings, np.random.default_rng(1))
    return measure(record_of("sting"), settings), simulated.theta


def _errors(smooth: bool) -> Array:
    """Errors of the angle over its standard uncertainty, at every tenth row from 5 s on."""
    measured, true = _sting(smooth)
    return np.asarray((measured.angles.theta - true) / measured.angles.u)[1250::10]


def _last() -> list[float]:
    """Angle [deg] at the last row, smoothed less causal, and its u."""
    causal, smoothed = (_sting(smooth)[0].angles for smooth in (False, True))
    ends = (smoothed.theta[-1] - causal.theta[-1], smoothed.u[-1] - causal.u[-1])
    return [float(each) / _DEG for each in ends]


CASES = (
    Case(
        "static-all-around",
        "Three ways to the angle at rest, without errors: none all around",
        "closed form",
        np.zeros(len(STATICS)),
        1e-9,
        lambda: [_off(way, 0.0) for way in STATICS],
        "deg",
    ),
    Case(
        "tan-at-rest",
        "All axes off by 1e-4 g: improved errs by dA/g (the paper: 0.006 deg)",
        "Tan 2021",
        [1e-4 / _DEG],
        2e-6,
        lambda: [_off("improved", _ERROR)],
        "deg",
    ),
    Case(
        "tan-at-rest-2-axes",
        "All axes off by 1e-4 g: segmented and complementary err by root two of dA/g",
        "Tan 2021",
        [1e-4 * 2.0**0.5 / _DEG] * 2,
        3e-6,
        lambda: [_off(way, _ERROR) for way in ("segmented", "complementary")],
        "deg",
    ),
    Case(
        "lever-arms",
        "Readings in motion freed of centrifugal and tangential terms are those at rest",
        "closed form",
        np.zeros(150),
        1e-12,
        _freed,
        "m/s^2",
    ),
    Case(
        "tan-decision",
        "Low pass and compensation by the gyro are equally good at a peak rate of (2 + root 6) dw",
        "Tan 2021",
        [(2.0 + 6.0**0.5) * 0.2],
        1e-6,
        lambda: [residuals.peak_rate_at(1.0, _RATE_ERROR) / _DEG],
        "deg/s",
    ),
    Case(
        "tan-oscillation",
        "Compensation leaves 1 to 3 % of the low pass, at 80.1 and 26.8 deg/s",
        "Tan 2021",
        [1.0, 3.0],
        [0.002, 0.01],
        _left,
        "%",
    ),
    Case(
        "tan-dual",
        "The dual accelerometer leaves 0.1 % of a tangential term at 2.77 rad/s^2, of 3.92 where errors are equal",
        "Tan 2021",
        [2.77, 3.92],
        5e-3,
        lambda: [1000.0 * residuals.dual(_ERROR, _ARM, alike) for alike in (False, True)],
        "rad/s^2",
    ),
    Case(
        "tan-in-motion",
        "All sensors 1.5 ms late at 80 deg/s cost 0.12 deg",
        "Tan 2021",
        [0.12],
        5e-4,
        _late,
        "deg",
    ),
    Case(
        "alpha-beta",
        "Roll turns pitch into sideslip: atan2(sin theta cos phi, cos theta), asin(sin theta sin phi)",
        "closed form",
        [
            *(-20.0, 0.0),
            *(0.0, 10.0),
            math.atan2(math.sin(_35) * math.cos(_30), math.cos(_35)) / _DEG,
            -math.asin(math.sin(_35) * math.sin(_30)) / _DEG,
        ],
        1e-10,
        _flow,
        "deg",
    ),
    Case(
        "sting-causal",
        "Recording of a model that pitches by steps, causal: errors of the angle are within 5 standard uncertainties",
        "truth",
        np.zeros(938),
        5.0,
        lambda: _errors(False),
        "u",
    ),
    Case(
        "sting-smoothed",
        "Recording of a model that pitches by steps, smoothed: errors of the angle are within 5 standard uncertainties",
        "truth",
        np.zeros(938),
        5.0,
        lambda: _errors(True),
        "u",
    ),
    Case(
        "sting-last-row",
        "At the last row of a recording smoothed and causal have the same angle and the same uncertainty",
        "closed form",
        [0.0, 0.0],
        1e-9,
        _last,
        "deg",
    ),
)
