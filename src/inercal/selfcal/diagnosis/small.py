"""Constant errors that the model leaves out, found in the innovations of the error-state filter.

Each is a hypothesis with some parameters, tested by the score test (`inercal.estimate.hypotheses`): the filter with
them as further states, without a prior, would find the same. Systematic inputs are fitted along with all, each with its
stated uncertainty for a prior.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.estimate.hypotheses import Fits, Fitted, Hypothesis, refitted, search, sigmas, tried
from inercal.findings import EVERYTHING
from inercal.geometry.earth import EARTH_RATE
from inercal.geometry.rotations import boxminus
from inercal.records.places import counted
from inercal.selfcal.diagnosis.fit_quality import JUDGE, Case, filtered, regular
from inercal.selfcal.diagnosis.rig_errors import rig_errors
from inercal.selfcal.filters.filter_result import FilterResult
from inercal.selfcal.filters.problem import FilterProblem
from inercal.selfcal.filters.residuals import gimbals
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.recording import Recording
from inercal.selfcal.platform.rig import JOINTS, World

_CHUNK = 1 << 16
"""Rows whose joints are held at once."""

Stated = Hypothesis[Case] | None
"""Errors of the systematic inputs of a study, None where all are exact."""


def likely(recording: Recording, problem: FilterProblem, systematic: Stated) -> FilterProblem:
    """The problem with its systematic inputs moved, within their uncertainties, to where the recording fits best.

    Where one would have to move further than chance takes it, the recording contradicts the study, and none is moved.
    """
    if systematic is None:
        return problem
    case = recording, problem
    (fit,) = refitted(case, [tried(systematic, case)], JUDGE)
    limit = sigmas(LIMITS.risk, len(fit.values))
    if not np.abs(fit.values).max() <= limit * systematic.prior:
        return problem
    return fit.case[1]


def small_errors(case: Case, systematic: Stated = None) -> tuple[Fits[Case], Case]:
    """Constant errors beside those of the systematic inputs, and the case without any of them."""
    return search(
        case, constant_errors, JUDGE, LIMITS.risk, LIMITS.small_errors, systematic, _with_those_alike
    )


def _with_those_alike(case: Case, fits: Iterator[Fits[Case]]) -> Fits[Case] | None:
    """Of the likeliest fits that explain as much the one with the fewest parameters, and the others beside it."""
    some = list(itertools.islice(fits, LIMITS.alike_fits))
    if len(some) < 2:
        return some[0] if some else None
    misfits = [JUDGE.misfit(fit[-1].case) for fit in some]
    equal = [
        fit for fit, misfit in zip(some, misfits, strict=True) if misfit <= min(misfits) + LIMITS.alike_misfit
    ]
    first, *others = sorted(equal, key=lambda fit: len(fit[-1].values))
    return [*first[:-1], replace(first[-1], alike=tuple(fit[-1] for fit in others))]


def constant_errors(case: Case) -> Iterator[Hypothesis[Case]]:
    """Errors of the site, the base, the gyros, the encoders and the clock of the commands."""
    now = filtered(case)
    if not now.converged:
        return
    step = 1e-3 * EARTH_RATE
    yield Hypothesis(
        "latitude", "site_suspect", _latitude, _other_earth, ("north", "up"), step, harm=EVERYTHING
    )
    if not case[1].states.has("delay"):
        yield Hypothesis("delay", "command_shift", _delay, _delayed, ("delay",), 0.01, harm=EVERYTHING)
    yield from rig_errors(case, now)
    yield from _harmonics(case, now)


def _delay(fit: Fitted[Case]) -> str:
    """The finding of late commands."""
    rows, dt = float(fit.values[0]), float(np.median(fit.case[0].dt))
    how = "later" if rows > 0.0 else "earlier"
    return f"the platform acts {1e3 * abs(rows) * dt:.3g} ms {how} than its commands are logged"


def _latitude(fit: Fitted[Case]) -> str:
    """The finding of earth rate that is not that of the stated latitude."""
    world = fit.case[1].world
    north, up = directions(world)
    seen = math.atan2(float(world.earth @ up), float(world.earth @ north))
    stated_earth = world.earth - fit.values[0] * north - fit.values[1] * up
    stated_latitude = math.atan2(float(stated_earth @ up), float(stated_earth @ north))
    u = float(np.hypot(fit.u[0] * math.sin(seen), fit.u[1] * math.cos(seen))) / EARTH_RATE
    return (
        f"the earth rate seen is that of latitude {math.degrees(seen):.2f} +- {math.degrees(u):.1g} deg, stated is "
        f"{math.degrees(stated_latitude):.2f} deg: check latitude and heading"
    )


def _other_earth(case: Case, values: Array) -> Case:
    """Earth rate with other north and upward parts [rad/s]."""
    recording, problem = case
    north, up = directions(problem.world)
    earth = problem.world.earth + values[0] * north + values[1] * up
    return recording, replace(problem, world=problem.world._replace(earth=earth))


def directions(world: World) -> tuple[Array, Array]:
    """Unit vectors north and up in b; any level one for north at a pole."""
    up = world.up / np.linalg.norm(world.up)
    level = world.earth - (world.earth @ up) * up
    if np.linalg.norm(level) < 1e-9 * EARTH_RATE:
        level = np.eye(3)[int(np.argmin(np.abs(up)))]
        level = level - (level @ up) * up
    return level / np.linalg.norm(level), up


def _delayed(case: Case, values: Array) -> Case:
    """Commands that act later by a part of a row."""
    recording, problem = case
    part = float(values[0])
    before = np.vstack([recording.rate[:1], recording.rate[:-1]])
    after = np.vstack([recording.rate[1:], recording.rate[-1:]])
    other = before if part > 0.0 else after
    return replace(recording, rate=recording.rate + abs(part) * (other - recording.rate)), problem


def _harmonics(case: Case, now: FilterResult) -> Iterator[Hypothesis[Case]]:
    """Errors periodic in the angle of a joint: for each joint the order that its innovations show most."""
    orders_tried, states = np.arange(1, LIMITS.harmonic_orders + 1), case[1].states
    estimated = [wave for k, wave in enumerate(states.harmonics) if f"harmonic_{k + 1}_sin" in states.names]
    angles, by_joint = _found_angles(case, now)
    th = angles[1:]
    for joint in range(3):
        used = np.isfinite(by_joint[:, joint] + th[:, joint])
        angle, missed = th[used, joint], by_joint[used, joint]
        # half a period is the least from which an order is told from a constant
        orders = orders_tried[orders_tried * np.ptp(angle) > math.pi] if used.any() else orders_tried[:0]
        orders = np.setdiff1d(orders, [order for of, order in estimated if of == joint])
        if len(orders):
            powers = np.array([np.abs(np.exp(1j * order * angle) @ missed) for order in orders])
            yield _harmonic(joint, int(orders[np.argmax(powers)]), angles[:, joint])


def _found_angles(case: Case, now: FilterResult) -> tuple[Array, Array]:
    """Gimbal angles (n, 3) [rad] that the filter found, and innovations (n - 1, 3) of the encoders about the joints. At
    rest angles as read change with their noise alone, and would explain it."""
    recording, problem = case
    assert now.history is not None
    angles, missed = recording.th.copy(), regular(recording, now)[:, 3:]
    for first in range(0, len(angles), _CHUNK):
        some = slice(first, first + _CHUNK)
        read, joints = gimbals(np.nan_to_num(recording.th[some]), problem.world)
        inverse = np.linalg.pinv(joints, rcond=1e-3)
        angles[some] -= np.einsum("kij,kj->ki", inverse, boxminus(read, now.history.attitude[some]))
        later = slice(1 if first == 0 else 0, None)  # innovations begin with the second row
        size = np.sqrt(np.square(joints[later]).sum(axis=2))
        rows = slice(max(first - 1, 0), first + _CHUNK - 1)
        missed[rows] = np.einsum("kij,kj->ki", inverse[later], missed[rows] * size)
    return angles, missed


def _harmonic(joint: int, order: int, angle: Array) -> Hypothesis[Case]:
    """An error ``a sin(k th) + b cos(k th)`` of an encoder at angles th (n,)."""
    waves = np.stack([np.sin(order * angle), np.cos(order * angle)])

    def without(case: Case, values: Array) -> Case:
        th = case[0].th.copy()
        th[:, joint] -= values @ waves
        return replace(case[0], th=th), case[1]

    def says(fit: Fitted[Case]) -> str:
        amplitude, periods = math.degrees(float(np.hypot(*fit.values))) * 3600.0, counted(order, "period")
        return f"{JOINTS[joint]} errs periodically with its angle: {amplitude:.2g} arcsec, {periods} a turn"

    name, many = f"harmonic {order} of {JOINTS[joint]}", LIMITS.harmonic_orders
    return Hypothesis(
        name, "unmodelled", says, without, ("sin", "cos"), 1e-6, alternatives=many, harm=EVERYTHING
    )
