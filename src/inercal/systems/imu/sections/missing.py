"""Sections that are missing where those there leave a coefficient open, and the one to add."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import Array
from inercal.foundation.records.places import counted_names
from inercal.systems.imu.identified import pose_words
from inercal.systems.imu.sections.arrow import Linear
from inercal.systems.imu.sections.fit import SOFTENED, softened
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import centred, rows
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.problem import Extra, Problem, problem_of
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, K0, K1, G, S


class Missing(NamedTuple):
    """Coefficients that stay open, by name, and in words the section to add: a rest in the direction of specific force
    that tells most of them, a turn, or of a gyro's bias a rest in any."""

    terms: tuple[str, ...]
    cure: str


def missing(sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...] = ()) -> Missing | None:
    """Coefficients without a prior that sections leave open, at the first guess; None if nothing."""
    shares = _shares(sections, priors, extras)
    terms = tuple(name for name, share in shares.items() if not share < 1.0)
    if not terms:
        return None
    if all(name.startswith("D_F") for name in terms):
        return Missing(terms, "a rest")
    if axes := [name[-1] for name in terms if name.startswith("S_")]:
        return Missing(terms, f"a rate, or a turn by a known angle, about {counted_names(axes)}")
    told = any(s.kind == "rest" and s.up is not None for s in sections)
    x = first_guess(problem_of(sections, priors, extras)).x
    best, pose = np.inf, np.array([0.0, 0.0, 1.0])
    for way in itertools.product((1.0, 0.0, -1.0), repeat=3):
        if any(way):
            up = np.array(way) / np.linalg.norm(way)
            output = x[K0] + np.max(x[K1]) * priors.site.gravity * up
            added = Section("rest", acc=output, acc_var=np.full(3, 1e-6), up=up if told else None, up_u=0.01)
            there = _shares([*sections, added], priors, extras)
            worst = max(there[name] for name in terms)
            if worst < (1.0 - 1e-6) * best:
                best, pose = worst, up
    return Missing(terms, f"a rest with {pose_words(pose)} up")


def _shares(sections: Sequence[Section], priors: Priors, extras: tuple[Extra, ...]) -> dict[str, float]:
    """Of each coefficient without a prior its u over that from which it is open, by name."""
    problem = problem_of(sections, priors, extras)
    problem = softened(problem, SOFTENED[-1]) or problem  # what is open does not hang on noise that small
    point = centred(problem, first_guess(problem))
    linear = Linear(problem, point.x, rows(problem, point))
    z = np.array([np.log(size.median) for size in problem.sizes.values()])
    try:
        with np.errstate(divide="ignore", invalid="ignore"):  # what nothing tells is infinite
            covariance = linear.at(z).covariance
    except LinAlgError:
        covariance = np.full((len(linear.shared),) * 2, np.inf)
    flat = [
        k for k, p in enumerate(linear.shared) if p < len(COEFFICIENTS) and not np.isfinite(problem.sd[p])
    ]
    full = [_full_scale(problem, int(linear.shared[k]), point.x) for k in flat]
    size = LIMITS.open_share * np.array(full)
    u = np.sqrt(np.abs(np.diag(covariance)[flat]))
    return {COEFFICIENTS[linear.shared[k]]: float(part) for k, part in zip(flat, u / size, strict=True)}


def _full_scale(problem: Problem, p: int, x: Array) -> float:
    """The largest output of the triad of a bias, that by g-sensitivity among them; of a scale factor the largest output
    over the largest input, or that by the unknowns ``x`` (p,); 1 for any other coefficient."""
    name, y = COEFFICIENTS[p], problem.readings.y
    if name.startswith("K0"):
        return float(np.nanmax(np.abs(y[:, :2])))
    if name.startswith("K1"):
        return max(float(np.nanmax(np.abs(y[:, :2]))) / problem.priors.site.gravity, 1e-12)
    if name.startswith("S") and np.any(problem.readings.rate != 0.0):
        moving = problem.readings.rate != 0.0
        return max(
            float(np.nanmax(np.abs(y[moving, 2]) / np.abs(problem.readings.rate[moving, None]))), 1e-12
        )
    if name.startswith("D_F"):
        drift = problem.priors.site.gravity * float(np.max(problem.sd[G]) * abs(problem.mean[S][0]))
        return max(float(np.nanmax(np.abs(y[:, 2]))), 10.0 * drift, 1e-12)
    return abs(float(x[p])) if name.startswith(("K1", "S_")) else 1.0
