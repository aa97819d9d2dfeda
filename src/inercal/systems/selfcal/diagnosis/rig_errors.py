"""Errors of the rig that are no states, as hypotheses: each kind of `inercal.systems.selfcal.platform.states`, sensors
that are late, and biases that wander.

The innovations change with an error of the rig as its column in the model says; a run of the error-state filter beside
the errors that are sought gives these columns (`inercal.systems.selfcal.before.considered`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.inference.hypotheses import Fitted, Hypothesis
from inercal.foundation.instruments.terms import shown_unit
from inercal.systems.selfcal.before.considered import innovation_slopes
from inercal.systems.selfcal.diagnosis.fit_quality import Case, filtered, regular
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.kinematics import axes_of
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, STATES, TEMPERATURE, UNIT_OF, twins

Columns = Callable[[Case, Sequence[str]], Array]
"""Change (k, 6, m) of the innovations of a case, as the judge has them, where an error of each of some parameters (m,)
is taken out."""

Judged = tuple[Case, FilterResult]
"""A case, and what the error-state filter makes of it."""

_EXTENDED = 'take states = "extended" under [model]'

#: kind -> what is wrong, and what to do where naming it under [model] is not enough
_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "beta": (
        "the base or the zero of the encoders is turned",
        f"{_EXTENDED}, or correct heading and tilt under [rig]",
    ),
    "kg1": ("the gyros have scale errors", _EXTENDED),
    "gamma": (
        "the sensors are turned on the platform, against the axis of its joint",
        "name gamma in states under [model], or align them",
    ),
    "non_orthogonality": ("the axes of the joints are not orthogonal", ""),
    "zero_y": ("the inner encoder does not read zero where its joint is at zero", ""),
    "k2": ("the accelerometers have second-order errors", ""),
    "levers": ("the accelerometers are not at the centre of the gimbals", ""),
    "scale_asymmetry": ("the scale of the gyros is not the same both ways", ""),
    "g_sensitivity": ("the gyros drift by specific force", ""),
    "harmonics": ("the encoders err periodically with their angles", ""),
    "sag": ("gravity turns the sensors on the platform", ""),
    "kg0_T1": ("the gyro biases change with temperature", ""),
    "ka0_T1": ("the accelerometer biases change with temperature", ""),
    "ka1_T1": ("the accelerometer scales change with temperature", ""),
}

WANDERING: Final = {"ka0": "accelerometer biases wander", "kg0": "gyro biases wander"}
"""Biases -> the hypothesis that they wander."""

#: parameter of a delay -> its sensors
_LATE: Final = {"tau_enc": "encoders", "tau_a": "accelerometers"}


def rig_errors(case: Case, now: FilterResult) -> Iterator[Hypothesis[Case]]:
    """Hypotheses of errors of the rig, without those that nobody can tell from others of them on this path; ``now`` is
    what the filter makes of the case."""
    about = case, now
    recording, problem = case
    still = np.nanmax(recording.th, axis=0) - np.nanmin(recording.th, axis=0) < LIMITS.still_joint
    about_axes = axes_of(recording.th[0], problem.world.axes, problem.world.signs).tolist()
    hidden = twins(tuple(_WORDS), np.flatnonzero(still).tolist(), about_axes)
    left_out = {*hidden, *_unturned(recording, problem)}
    kinds = dict[str, tuple[str, ...]]()
    for kind in _WORDS:
        names = tuple(name for name in STATES[kind].parameters if name not in left_out)
        known = any(name in problem.names for name in STATES[kind].parameters)
        if names and not known and (recording.warm is not None or kind not in TEMPERATURE):
            kinds[kind] = names
    late = tuple(name for name in _LATE if name not in problem.names)
    columns = _together(about, (*(name for names in kinds.values() for name in names), *late))
    for kind, names in kinds.items():
        yield _kind(kind, names, columns)
    for name in late:
        yield _delay(name, columns)
    yield _asymmetry(about)
    constant = [of for of in WANDERING if f"{of}_walk_x" not in problem.names]
    names = tuple(name for of in constant for name in STATES[f"{of}_T1"].parameters)
    wanders = kept(lambda case: _columns_by(about, case, [(wave, names) for wave in _waves(case[0])]))
    for k, of in enumerate(constant):
        yield _wander(of, wanders, slice(3 * k, 3 * k + 3))


def _unturned(recording: Recording, problem: FilterProblem) -> tuple[str, ...]:
    """Harmonics that cannot be told from a constant, as their joints turn by less than half a period; and those for
    which the study names no wave."""
    turned, waves = (
        np.nanmax(recording.th, axis=0) - np.nanmin(recording.th, axis=0),
        problem.states.harmonics,
    )
    names = STATES["harmonics"].parameters
    few = [k for k, (joint, order) in enumerate(waves) if order * turned[joint] < np.pi]
    return *names[2 * len(waves) :], *(name for k in few for name in names[2 * k : 2 * k + 2])


def _together(about: Judged, names: tuple[str, ...]) -> Columns:
    """Columns of some parameters, all found in one run."""
    all_of = kept(lambda case: _columns_by(about, case, [(case[0].warm, names)]))
    return lambda case, some: all_of(case)[:, :, [names.index(name) for name in some]]


def kept(columns: Callable[[Case], Array]) -> Callable[[Case], Array]:
    """Columns of the first case for all: a refit moves them by next to nothing, and takes its residuals anew, so that
    it ends in the same place."""
    first = list[Array]()

    def of(asked: Case) -> Array:
        if not first:
            first.append(columns(asked))
        return first[0]

    return of


def _columns_by(about: Judged, case: Case, errors: Sequence[tuple[Array | None, Sequence[str]]]) -> Array:
    """Change (k, 6, m) of the innovations where errors ``(course, names)`` are taken out, one after the other: those of
    temperature go with the ``course`` (n,) [K]."""
    now = about[1] if case is about[0] else filtered(case)
    ends = np.cumsum([len(names) for _, names in errors])
    changes = np.empty((len(case[0].rate), 6, int(ends[-1])))
    for (course, names), end in zip(errors, ends, strict=True):
        warmed = replace(case[0], warm=course), case[1]
        changes[:, :, end - len(names) : end] = columns_of((warmed, now), names)
    return changes


def columns_of(about: Judged, names: Sequence[str]) -> Array:
    """Change (k, 6, m) of the innovations, NaN where none counts, where errors of ``names`` (m,) are taken out."""
    (recording, problem), now = about
    assert now.history is not None
    slopes = innovation_slopes(
        recording, problem, now.history.attitude, now.coefficients, names, now.restarts
    )
    np.negative(slopes, out=slopes)
    slopes[~np.isfinite(regular(recording, now))] = np.nan
    return slopes


def _stated_with(names: Sequence[str]) -> Callable[[Case, Array], Case]:
    """The case with errors of some parameters stated."""

    def without(case: Case, values: Array) -> Case:
        recording, problem = case
        stated = problem.states.stated.copy()
        stated[[ALL.index(name) for name in names]] += values
        return recording, replace(problem, vector=replace(problem.states, stated=stated))

    return without


def _largest(names: Sequence[str], unit: str, fit: Fitted[Case]) -> str:
    """The parameter that is clearest, in words; all of them where none is clear by itself."""
    shown, size = shown_unit(unit)
    over = np.abs(fit.values) / fit.u
    worst = int(np.argmax(over))
    if not over[worst] > LIMITS.shown_sigmas:
        return f"all {len(names)} together"
    return f"{names[worst]} by {fit.values[worst] / size:.3g} +- {fit.u[worst] / size:.1g} {shown}"


def _items(names: Sequence[str], unit: str, fit: Fitted[Case]) -> tuple[Mapping[str, str | float], ...]:
    """The parameters with their values, as rows of a table."""
    shown, size = shown_unit(unit)
    return tuple(
        {"error": name, "value": value / size, "u": u / size, "unit": shown}
        for name, value, u in zip(names, fit.values.tolist(), fit.u.tolist(), strict=True)
    )


def _kind(kind: str, names: tuple[str, ...], columns: Columns) -> Hypothesis[Case]:
    """An error of the rig."""
    what, advice = _WORDS[kind]
    remedy = advice or f"name {'temperature' if kind in TEMPERATURE else kind} in states under [model]"

    def says(fit: Fitted[Case]) -> str:
        return f"{what}, which the model leaves out ({_largest(names, UNIT_OF[names[0]], fit)}): {remedy}"

    return Hypothesis(
        kind,
        "unmodelled",
        says,
        _stated_with(names),
        names,
        derivative=lambda case: columns(case, names),
        items=lambda fit: _items(names, UNIT_OF[names[0]], fit),
    )


def _delay(name: str, columns: Columns) -> Hypothesis[Case]:
    """Encoders or accelerometers that are late."""

    def says(fit: Fitted[Case]) -> str:
        late = float(fit.values[0])
        how = "late" if late > 0.0 else "early"
        return (
            f"{_LATE[name]} are {1e3 * abs(late):.3g} ms {how}: name delay in states under [model], "
            "or shift their times"
        )

    return Hypothesis(
        name,
        "command_shift",
        says,
        _stated_with((name,)),
        (name,),
        bounds=(-LIMITS.small_delay, LIMITS.small_delay),
        derivative=lambda case: columns(case, (name,)),
    )


def _asymmetry(about: Judged) -> Hypothesis[Case]:
    """Accelerometers whose scale differs with the sign of the force; no state has it."""
    names = tuple(f"scale of accelerometer {i} forward less backward" for i in "xyz")

    def without(case: Case, values: Array) -> Case:
        recording, problem = case
        return replace(recording, acc=recording.acc - 0.5 * values * np.abs(recording.acc)), problem

    def derivative(case: Case) -> Array:
        signs = 0.5 * np.sign(np.nan_to_num(case[0].acc)).T
        names = STATES["ka1_T1"].parameters
        courses = [(np.ascontiguousarray(sign), (name,)) for sign, name in zip(signs, names, strict=True)]
        return _columns_by(about, case, courses)

    def says(fit: Fitted[Case]) -> str:
        what = f"the scale of the accelerometers is not the same both ways ({_largest(names, '1', fit)})"
        return f"{what}: take it out of their readings"

    return Hypothesis(
        "asymmetry",
        "unmodelled",
        says,
        without,
        names,
        derivative=kept(derivative),
        items=lambda fit: _items(names, "1", fit),
    )


def _wander(of: str, columns: Callable[[Case], Array], mine: slice) -> Hypothesis[Case]:
    """Biases ``ka0`` or ``kg0`` that wander about their means: cosines of time, of half a period, a whole one ..; of
    each there are ``columns`` of all biases, of which some are ``mine``."""
    words = WANDERING[of]
    parameters = tuple(f"{of}_{i} {j}" for j in range(1, LIMITS.wandering + 1) for i in "xyz")

    def without(case: Case, values: Array) -> Case:
        recording, problem = case
        biases = _waves(recording).T @ values.reshape(-1, 3)
        if of == "ka0":
            return replace(recording, acc=recording.acc - biases), problem
        return replace(recording, rate=recording.rate + biases[1:]), problem

    def derivative(case: Case) -> Array:
        found = columns(case)
        by_wave = found.reshape(*found.shape[:2], LIMITS.wandering, -1)[..., mine]
        return by_wave.reshape(*found.shape[:2], len(parameters))

    def says(fit: Fitted[Case]) -> str:
        unit, size = shown_unit(UNIT_OF[f"{of}_x"])
        course = _waves(fit.case[0]).T @ fit.values.reshape(-1, 3)
        worst = int(np.argmax(np.ptp(course, axis=0)))
        about = f"{of}_{'xyz'[worst]} by {np.ptp(course[:, worst]) / size:.2g} {unit}"
        return f"{words}, {about}: name bias_walk, or temperature, in states under [model]"

    return Hypothesis(words, "unmodelled", says, without, parameters, derivative=derivative)


def _waves(recording: Recording) -> Array:
    """Cosines of time (LIMITS.wandering, n) over a recording."""
    through = (recording.t - recording.t[0]) / (recording.t[-1] - recording.t[0])
    return np.asarray(np.cos(np.pi * np.multiply.outer(np.arange(1, LIMITS.wandering + 1), through)))
