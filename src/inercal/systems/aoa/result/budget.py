"""Uncertainty budget of the angle and of the coefficients of the sensors: noise, prior, and stated inputs.

The covariance P of the best filter is homogeneous in the variances q_s of all its sources, and to first order changes
of its gains do not change it. So the part of a source is its slope, and the parts add up to the whole (Euler's theorem
on homogeneous functions):

    P_s = q_s dP/dq_s        sum_s P_s = P

Of a variance of the noise the filter is run again with it a little larger, over the beginning of a long recording. Of
priors of constants, with covariances Pi_s that make Pi, one run has all: the estimate changes with their means by
P Pi^-1, so that

    P_s = P Pi^-1 Pi_s Pi^-1 P

as long as no constant wanders or fades, and the angle is from the rows before. The last source is what is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.results.budget import BudgetItem
from inercal.systems.aoa.diagnosis.passed import AnglePass
from inercal.systems.aoa.fusion.band import fused
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.problem import problem as stated_problem
from inercal.systems.aoa.fusion.run import advance, initial
from inercal.systems.aoa.fusion.smoother import BLOCK, smooth
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later
from inercal.systems.aoa.result.systematic import leaning, leans, uncertain_roll
from inercal.systems.aoa.settings import AoaSettings

Mask = NDArray[np.bool_]

ANGLE = "theta"
"""Name of the angle among the shares of a budget."""

_STEP = 1e-3
"""Relative change of a variance, for its slope."""

MOST = 20_000
"""Rows that are examined, from the first with an angle on; half of them where they are smoothed."""


@dataclass(frozen=True)
class BudgetSource:
    """One source, ``u`` in ``unit``, and its places in a problem: ``constants`` of the model that are variances or, in
    ``levels``, standard deviations; ``states`` by their prior; the angle of the ``zero``."""

    name: str
    type: str
    u: float
    unit: str
    constants: tuple[str, ...] = ()
    levels: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    zero: bool = False


@dataclass(frozen=True, eq=False)
class AngleVariances:
    """Variances by source.

    ``budget`` has the share of each coefficient's variance at the end, and of that of `ANGLE`, its mean after the first
    2 s. ``common`` (p, p) is the covariance of the coefficients by stated gravity and roll, which runs at the same site
    and mounting share; ``by_gravity`` (p,) their change per change of gravity [m/s^2], None where gravity is known well
    enough.
    """

    budget: tuple[BudgetItem, ...]
    common: Array
    by_gravity: Array | None = None


def parts(
    recording: Recording,
    problem: FusionProblem,
    settings: AoaSettings,
    smoothed: bool,
    answered: Mask,
    filtered: FusionResult | None = None,
    passed: AnglePass | None = None,
) -> AngleVariances:
    """Split the uncertainty of the fusion by source.

    ``smoothed``: the angle is from all of the rows; the coefficients at the end are the same. ``answered`` (n,) marks
    the rows with an angle; those before the first, as where sensors are switched on late, are left out. What is
    ``filtered`` already, with the judge's pass, is not filtered again.
    """
    first = recording.t[np.argmax(answered)]
    limited, problem = fused(recording, problem)
    if limited is not recording:
        recording, answered = limited, limited.t >= first
    taken = later(recording.t)
    known = None if smoothed or filtered is None or passed is None else _known(filtered, taken)
    if known is None:
        passed, taken = None, taken[taken >= np.argmax(answered)][: MOST // 2 if smoothed else MOST]
    t, rows = recording.t[taken], recording.of(taken).rows
    settled = answered[taken] & (t - t[:1] >= LIMITS.settling_time)
    judged = settled if settled.any() else answered[taken]
    at = list(problem.nuisances.values())
    of = sources(problem, settings)
    plain = _run(problem, t, rows, smoothed, judged) if known is None else known(judged)
    priors = {} if passed is None else _of_priors(problem, of, passed, plain)
    rerun = [source for source in of[:-1] if source.name not in priors]
    changed = [_enlarged(problem, rows, source) for source in rerun]
    # neither gravity nor a stated roll is a state of the filter: their errors move the estimate
    changes = leans(settings, problem.spatial)
    run_again = [lean for lean in changes if passed is None or lean.name != "gravity"]
    moved = [(leaning(problem, lean, settings), rows) for lean in run_again]
    with ThreadPoolExecutor() as pool:
        cases = [*changed, *moved]
        others = list(pool.map(lambda case: _run(case[0], t, case[1], smoothed, judged), cases))
    parts_of = dict(priors)
    for source, run in zip(rerun, others[: len(rerun)], strict=True):
        slope = np.append(run.angle - plain.angle, np.diag(run.P - plain.P)[at]) / _STEP
        parts_of[source.name] = np.maximum(slope, 0.0)
    left = np.append(plain.angle, np.diag(plain.P)[at]) - sum(parts_of.values())
    parts_of[of[-1].name] = np.maximum(left, 0.0)
    variances: list[tuple[BudgetSource, Array]] = [(source, parts_of[source.name]) for source in of]
    shifts: list[tuple[BudgetSource, Array]] = []
    by_gravity: Array | None = None
    runs = iter(others[len(rerun) :])
    for lean in changes:
        if passed is not None and lean.name == "gravity":
            slope = passed.by_gravity
        else:
            run = next(runs)
            apart = (run.theta - plain.theta)[np.isfinite(run.theta - plain.theta)]
            slope = np.append(float(np.sqrt(np.mean(np.square(apart)))), (run.x - plain.x)[at]) / lean.step
        if lean.name == "gravity":
            by_gravity = slope[1:]
            shifts += [
                (BudgetSource(each.source, "B", each.u, each.unit), slope * each.sensitivity * each.u)
                for each in settings.site.inputs
            ]
        else:
            of_roll = uncertain_roll(settings, problem.spatial)
            shifts.append((BudgetSource("stated roll", "B", of_roll, "rad"), slope * of_roll))
    variances += [(source, np.square(shift)) for source, shift in shifts]
    common = np.zeros((len(at), len(at)))
    for _, shift in shifts:
        common += np.outer(shift[1:], shift[1:])
    return AngleVariances(_items(variances, (ANGLE, *problem.nuisances)), common, by_gravity)


def _known(filtered: FusionResult, taken: NDArray[np.int64]) -> Callable[[Mask], _BudgetRun] | None:
    """The run over all rows ``taken`` of what is filtered, by the rows that are judged; None where these are many."""
    trace, state = filtered.trace, filtered.state
    if len(taken) > MOST or len(trace.out) != len(taken) or len(trace.starts) != 1:
        return None

    def run(judged: Mask) -> _BudgetRun:
        u = trace.out[judged & np.isfinite(trace.out[:, 1]), 1]
        return _BudgetRun(float(np.mean(np.square(u))), state.P, state.x, trace.out[judged, 0])

    return run


def _of_priors(
    problem: FusionProblem, of: Sequence[BudgetSource], passed: AnglePass, plain: _BudgetRun
) -> dict[str, Array]:
    """Parts (1 + p,) of the variances of theta, its mean, and of the coefficients, of sources that are priors of
    constants alone, by name; none where constants wander."""
    constants, at = problem.constants, list(problem.nuisances.values())
    if constants.accelerometer_walk or constants.gyro_walk or passed.faded or problem.spatial:
        return {}
    known = [k for k, place in enumerate(at) if problem.covariance[place, place] > 0.0]
    places = [at[k] for k in known]
    inverse = np.linalg.pinv(problem.covariance[np.ix_(places, places)], hermitian=True, rcond=1e-12)
    found = {}
    for source in of:
        own = [problem.names.index(name) for name in source.states]
        if own and {*own} <= {*places} and not (source.constants or source.levels or source.zero):
            there = [places.index(k) for k in own]
            prior = problem.covariance[np.ix_(own, own)]
            by = inverse[:, there] @ prior @ inverse[there]
            angle = float(np.sum(passed.by_constants[np.ix_(known, known)] * by))
            across = plain.P[np.ix_(at, places)]
            found[source.name] = np.append(angle, np.einsum("pi,ij,pj->p", across, by, across))
    return found


def sources(problem: FusionProblem, settings: AoaSettings) -> tuple[BudgetSource, ...]:
    """All sources that a problem has, but for gravity and a stated roll."""
    noise, prior, timing = settings.noise, settings.prior, settings.timing
    before = _known_before(problem, settings)
    roll, zero = settings.attitude.roll, settings.zero
    lever = float(np.hypot(prior.lever_common, prior.lever))
    flexure = max(prior.heave.level, prior.axial.level)
    accelerometers = tuple(f"b_{k + 1}" for k in range(problem.count))

    def of_prior(name: str, u: float, unit: str, *begin: str) -> BudgetSource:
        states = tuple(each for each in problem.names if each.startswith(begin) and each not in before)
        levels = ("heave_level", "axial_level") if begin == ("s_", "flexure_") else ()
        return BudgetSource(name, "B", u, unit, levels=levels, states=states)

    of_bias = ("accelerometer bias", noise.accelerometer_bias)
    if prior.rectified:
        of_bias = (
            "accelerometer bias with rectified vibration",
            float(np.hypot(of_bias[1], prior.rectified)),
        )
    of_states = (
        of_prior(*of_bias, "m/s^2", *accelerometers),
        of_prior("gyro bias", noise.gyro_bias, "rad/s", "b_g", "b_roll", "b_yaw"),
        of_prior("lever arms", lever, "m", "dr_"),
        of_prior("heights", prior.height, "m", "zo_"),
        of_prior("gyro scale", prior.gyro_scale, "1", "k_g"),
        of_prior("gyro delay", prior.gyro_delay, "s", "tau_g"),
        of_prior("roll", 0.0 if roll is None else roll.u, "rad", "phi"),
        of_prior("flexure of the sting", flexure, "m/s^2", "s_", "flexure_"),
        BudgetSource("earlier run", "B", 1.0, "1", states=before),
    )
    of_inputs = []
    if timing.common_delay_u:
        of_inputs.append(
            BudgetSource("common delay", "B", timing.common_delay_u, "s", levels=("common_delay_u",))
        )
    if zero is not None:
        of_inputs.append(BudgetSource("stated zero", "B", zero.u, "rad", zero=True))
    of_walks = (
        BudgetSource(
            "accelerometer walk", "B", noise.accelerometer_walk, "m/s^2/sqrt(s)", ("accelerometer_walk",)
        ),
        BudgetSource("gyro walk", "B", noise.gyro_walk, "rad/s/sqrt(s)", ("gyro_walk",)),
    )
    return (
        BudgetSource("accelerometer noise", "A", noise.accelerometer, "m/s^2", ("accelerometer_noise",)),
        BudgetSource("gyro noise", "A", noise.gyro, "rad/s", ("gyro_noise", "turn_noise")),
        *(each for each in of_states if each.states),
        *of_inputs,
        *(each for each in of_walks if each.u),
        BudgetSource("motion between samples", "B", 1.0, "1", ("snap",)),
    )


def _known_before(problem: FusionProblem, settings: AoaSettings) -> tuple[str, ...]:
    """States whose prior is of an earlier run, not of the study."""
    usual = stated_problem(settings, problem.spatial).covariance
    return tuple(
        name
        for name, own, other in zip(problem.names, problem.covariance, usual, strict=True)
        if not np.array_equal(own, other)
    )


class _BudgetRun(NamedTuple):
    """One run: mean variance of theta ``angle`` [rad^2], covariance ``P`` and state ``x`` at the end, and ``theta``
    (k,) at the rows that are judged."""

    angle: float
    P: Array
    x: Array
    theta: Array


def _run(problem: FusionProblem, t: Array, rows: Array, smoothed: bool, judged: Mask) -> _BudgetRun:
    """Run the fusion."""
    block = BLOCK if smoothed else 0
    state, trace = advance(initial(problem), problem, t, rows, last=True, block=block)
    out = smooth(problem, t, rows, trace) if smoothed else trace.out
    u = out[judged & np.isfinite(out[:, 1]), 1]
    return _BudgetRun(float(np.mean(np.square(u))), state.P, state.x, out[judged, 0])


def _enlarged(problem: FusionProblem, rows: Array, source: BudgetSource) -> tuple[FusionProblem, Array]:
    """The problem and its rows with the variance of a source larger by `_STEP`."""
    by = 1.0 + _STEP
    constants, covariance = problem.constants, problem.covariance.copy()
    for names, factor in ((source.constants, by), (source.levels, by**0.5)):
        constants = constants._replace(**{name: factor * getattr(constants, name) for name in names})
    at = [problem.names.index(name) for name in source.states]
    covariance[np.ix_(at, at)] *= by
    if source.zero:
        rows = rows.copy()
        rows[:, problem.count + 2] *= by**0.5
    return replace(problem, constants=constants, covariance=covariance), rows


def _items(variances: list[tuple[BudgetSource, Array]], names: tuple[str, ...]) -> tuple[BudgetItem, ...]:
    """Lines of a budget from parts (1 + p,) of variances."""
    whole = np.sum([part for _, part in variances], axis=0)
    items = []
    for of, part in variances:
        own = zip(names, part, whole, strict=True)
        share = {name: float(x / total) for name, x, total in own if x > LIMITS.budget_share * total}
        items.append(BudgetItem(of.name, of.type, of.u, of.unit, share))
    return tuple(items)
