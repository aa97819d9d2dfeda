"""The table of errors that the fusion must reach, and the draws by which its uncertainties are judged."""

from dataclasses import replace

import numpy as np
from sting_study import DEG, clipped, scenario, study

from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.paper.methods import low_passed, measure
from inercal.systems.aoa.settings import Methods
from inercal.systems.aoa.simulate import simulate

FILTERS = ("causal 8", "smoothed 8", "causal 19", "smoothed 19")
PAPER, LOW_PASSED = "paper's method", "paper's method, low-passed offline"

#: scenario -> paper's method and `FILTERS`, largest error / rms in degrees after 5 s
FIGURES = {
    "base": ((0.040, 0.009), (0.0019, 0.0005), (0.0011, 0.0003), (0.018, 0.007), (0.014, 0.0065)),
    "large": ((0.130, 0.023), (0.0022, 0.0005), (0.0015, 0.0002), (0.019, 0.007), (0.015, 0.007)),
    "chirp": ((0.079, 0.012), (0.0024, 0.0008), (0.0011, 0.0005), (0.017, 0.007), (0.012, 0.005)),
    "buffet": ((0.028, 0.006), (0.0062, 0.0036), (0.0033, 0.0025), (0.027, 0.007), (0.030, 0.009)),
    "pitch-pause": ((0.027, 0.007), (0.0025, 0.0005), (0.0009, 0.0002), (0.013, 0.004), (0.005, 0.001)),
    "flexure": ((3.5, 0.90), (1.8, 0.70), (1.7, 0.65), (0.020, 0.008), (0.015, 0.0075)),
    "pivot": ((0.10, 0.045), (0.71, 0.63), (0.67, 0.64), (0.018, 0.007), (0.014, 0.007)),
    "heights": ((0.14, 0.075), (0.27, 0.17), (0.24, 0.16), (0.019, 0.008), (0.014, 0.007)),
    "clipping": ((1.78, 0.87), (0.0023, 0.0006), (0.0010, 0.0003), (0.034, 0.008), (0.015, 0.008)),
}

MEDIAN, UPPER = 1.3, 2.0
"""Bands: times the figure, of the median and of the 90th percentile of many seeds."""


def judged(name, method):
    """Whether the table bounds a cell: the filters', but for small ones under flexure, who are wrong there."""
    return method in FILTERS and not (name == "flexure" and method.endswith(" 8"))


def size(error):
    """Largest and rms [deg] of errors [rad]."""
    return float(np.max(np.abs(error))) / DEG, float(np.sqrt(np.mean(error**2))) / DEG


def errors_of(name, seed, methods=(PAPER, *FILTERS)):
    """Largest and rms error [deg] after 5 s of each method on one simulated minute of a scenario."""
    found = {}
    told = simulate(scenario(name), np.random.default_rng(seed))
    late = told.recording.t >= 5.0
    if PAPER in methods:
        settings = scenario(name)
        angles = measure(told.recording, settings, Methods())
        found[PAPER] = size((angles.theta - told.theta)[late])
        if LOW_PASSED in methods:
            smooth = low_passed(angles, told.recording.t)
            found[LOW_PASSED] = size((smooth.theta - told.theta)[late])
    for method in FILTERS:
        if method in methods:
            kind, states = method.split()
            settings = scenario(name, states=int(states))
            recording = clipped(told.recording, settings)
            got = estimate(recording, problem(settings), kind == "smoothed")
            found[method] = size((got.theta - told.theta)[late])
    return found


MOTIONS = {
    "sine": MotionPlan("sine", mean=30.0 * DEG, amplitude=10.0 * DEG, frequency=1.0),
    "two-tone": MotionPlan(
        "two-tone",
        mean=20.0 * DEG,
        amplitude=5.0 * DEG,
        frequency=0.7,
        second_amplitude=1.0 * DEG,
        second_frequency=4.0,
    ),
    # two moves in 12 s
    "pitch-pause": MotionPlan(
        "pitch-pause",
        first=0.0,
        last=20.0 * DEG,
        step=10.0 * DEG,
        pause=3.0,
        rms=0.05 * DEG,
        low=3.0,
        high=15.0,
    ),
    "buffet": MotionPlan("buffet", mean=45.0 * DEG, rms=0.2 * DEG, low=2.0, high=15.0),
}


def over_its_uncertainty(motion, states, seed):
    """Mean over t > 2 s of (error of theta / u)^2, causal and smoothed, of one record of 12 s.

    All that the filter takes as constant is drawn from its prior; there is no flexure.
    """
    settings = study(states, replace(MOTIONS[motion], duration=12.0))
    of = problem(settings)
    rng = np.random.default_rng(seed)
    places = list(of.nuisances.values())
    drawn = rng.multivariate_normal(of.mean[places], of.covariance[np.ix_(places, places)], method="eigh")
    told = simulate(settings, rng, dict(zip(of.nuisances, drawn.tolist(), strict=True)))
    late = told.recording.t > 2.0
    found = []
    for smoothed in (False, True):
        got = estimate(told.recording, of, smoothed)
        found.append(float(np.mean(((got.theta - told.theta) / got.u)[late] ** 2)))
    return tuple(found)
