"""Constant errors that the model leaves out, found in the innovations of the error-state filter.

Each is a hypothesis with some parameters, tested by the score test (`inercal.foundation.inference.hypotheses`): the
filter with them as further states, without a prior, would find the same. Systematic inputs are fitted along with all,
each with its stated uncertainty for a prior.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.geometry.rotations import boxminus
from inercal.foundation.inference.hypotheses import Fits, Fitted, Hypothesis, refitted, search, sigmas, tried
from inercal.foundation.records.places import counted
from inercal.systems.selfcal.diagnosis.fit_quality import JUDGE, Case, filtered, once, regular, short
from inercal.systems.selfcal.diagnosis.rig_errors import columns_of, kept, rig_errors
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS, World
from inercal.systems.selfcal.platform.states import MOST_WAVES

Stated = Hypothesis[Case] | None
"""Errors of the systematic inputs of a study, None where all are exact."""


def likely(recording: Recording, problem: FilterProblem, systematic: Stated) -> FilterProblem:
    """The problem with its systematic inputs moved, within their uncertainties, to where the recording fits best.

    Where one would have to move further than chance takes it, the recording contradicts the study, and none is moved.
    """
    if systematic is None:
        return problem
    case = recording, problem
    fewer = short(case)
    (fit,) = refitted(fewer, [tried(systematic, fewer)], JUDGE)
    limit = sigmas(LIMITS.risk, len(fit.values))
    if not np.abs(fit.values).max() <= limit * systematic.prior:
        return problem
    return systematic.without(case, fit.values)[1]


@once
def small_errors(case: Case, systematic: Stated = None) -> tuple[Fits[Case], Case]:
    """Constant errors beside those of the systematic inputs, and the case without any of them."""
    fewer = short(case)
    fits, there = search(
        fewer, constant_errors, JUDGE, LIMITS.risk, LIMITS.small_errors, systematic, _with_those_alike
    )
    if fewer is case:
        return fits, there
    if not fits and systematic is None:
        return fits, case
    recording, problem = case
    for fit in fits:
        recording = fit.hypothesis.without((recording, problem), fit.values)[0]
    return fits, (recording, replace(problem, world=there[1].world, vector=there[1].vector))


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
    step, dt = 1e-3 * EARTH_RATE, float(np.median(case[0].dt))
    yield Hypothesis(
        "latitude", "site_suspect", _latitude, _other_earth, ("north", "up"), step, harm=EVERYTHING
    )
    if not case[1].states.has("delay"):
        yield Hypothesis("delay", "command_shift", _delay, _delayed, ("delay",), 0.01 * dt, harm=EVERYTHING)
    yield from rig_errors(case, now)
    yield from _harmonics(case, now)


def _delay(fit: Fitted[Case]) -> str:
    """The finding of late commands."""
    late = float(fit.values[0])
    how = "later" if late > 0.0 else "earlier"
    return f"the platform acts {1e3 * abs(late):.3g} ms {how} than its commands are logged"


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
    """Commands that act later by a time [s]."""
    recording, problem = case
    t, dt, late = recording.t, recording.dt[:, None], float(values[0])
    turned = np.vstack([np.zeros(3), np.cumsum(recording.rate * dt, axis=0)])
    more = abs(late) * recording.rate  # before the first row, and behind the last, it turns on
    known = np.concatenate([[t[0] - abs(late)], t, [t[-1] + abs(late)]])
    turned = np.vstack([turned[:1] - more[:1], turned, turned[-1:] + more[-1:]])
    then = np.stack([np.interp(t - late, known, each) for each in turned.T], axis=-1)
    return replace(recording, rate=np.diff(then, axis=0) / dt), problem


def _harmonics(case: Case, now: FilterResult) -> Iterator[Hypothesis[Case]]:
    """Errors periodic in the angle of a joint: for each joint the order that its innovations show most, as long as
    there is room for further states."""
    recording, problem = case
    states = problem.states
    estimated = [wave for k, wave in enumerate(states.harmonics) if f"harmonic_{k + 1}_sin" in states.names]
    angles, by_joint = _found_angles(case, now)
    waves = list[tuple[int, int]]()
    for joint in range(3):
        angle, missed = angles[1:, joint], by_joint[:, joint]
        used = np.isfinite(missed + recording.th[1:, joint])
        # half a period is the least from which an order is told from a constant
        turned = np.ptp(angle[used]) if used.any() else 0.0
        known = [order for of, order in estimated if of == joint]
        powers = {
            order: power
            for order, power in enumerate(_powers(angle[used], missed[used]), 1)
            if order * turned > math.pi and order not in known
        }
        if powers:
            waves.append((joint, max(powers, key=lambda order: powers[order])))
    taken = len(states.harmonics)
    waves = waves[: MOST_WAVES - taken]
    names = [f"harmonic_{taken + 1 + k}_{part}" for k in range(len(waves)) for part in ("sin", "cos")]
    vector = replace(states, harmonics=(*states.harmonics, *waves))
    # at rest angles as read change with their noise alone, and would explain it
    found = replace(recording, th=angles), replace(problem, vector=vector)
    columns = kept(lambda _: columns_of((found, now), names))
    for k, (joint, order) in enumerate(waves):
        yield _harmonic(joint, order, partial(_some, columns, slice(2 * k, 2 * k + 2)))


def _some(columns: Callable[[Case], Array], which: slice, case: Case) -> Array:
    """Some of the columns of a case."""
    return columns(case)[:, :, which]


def _powers(angle: Array, missed: Array) -> Array:
    """Powers (k,) of innovations (m,) at the orders 1 .. k of angles (m,) [rad], each wave by the one before."""
    once = np.exp(1j * angle)
    wave, powers = once.copy(), np.empty(LIMITS.harmonic_orders)
    for k in range(len(powers)):
        powers[k] = abs(np.sum(wave * missed))
        wave *= once
    return powers


def _found_angles(case: Case, now: FilterResult) -> tuple[Array, Array]:
    """Gimbal angles (n, 3) [rad] that the filter found, and innovations (n - 1, 3) of the encoders about the joints."""
    recording, problem = case
    assert now.history is not None
    read, joints = gimbals(np.nan_to_num(recording.th), problem.world)
    inverse = np.linalg.pinv(joints, rcond=1e-3)
    angles = recording.th - np.einsum("kij,kj->ki", inverse, boxminus(read, now.history.attitude))
    size = np.sqrt(np.square(joints[1:]).sum(axis=2))
    return angles, np.einsum("kij,kj->ki", inverse[1:], regular(recording, now)[:, 3:] * size)


def _harmonic(joint: int, order: int, columns: Callable[[Case], Array]) -> Hypothesis[Case]:
    """An error ``a sin(k th) + b cos(k th)`` of an encoder."""

    def without(case: Case, values: Array) -> Case:
        th = case[0].th.copy()
        at = order * th[:, joint]
        th[:, joint] -= values[0] * np.sin(at) + values[1] * np.cos(at)
        return replace(case[0], th=th), case[1]

    def says(fit: Fitted[Case]) -> str:
        amplitude, periods = math.degrees(float(np.hypot(*fit.values))) * 3600.0, counted(order, "period")
        return f"{JOINTS[joint]} errs periodically with its angle: {amplitude:.2g} arcsec, {periods} a turn"

    return Hypothesis(
        f"harmonic {order} of {JOINTS[joint]}",
        "unmodelled",
        says,
        without,
        ("sin", "cos"),
        alternatives=LIMITS.harmonic_orders,
        harm=EVERYTHING,
        derivative=columns,
    )
