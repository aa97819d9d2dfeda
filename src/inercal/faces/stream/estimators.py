"""The estimator that a study asks for on a stream: the one of ``--stream`` and of live sources."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from inercal.foundation._jit import compiling
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.systems.listed import SYSTEMS

if TYPE_CHECKING:
    from inercal.faces.python.study import Study
    from inercal.faces.stream.lines import Lines
    from inercal.faces.stream.run import Recursive
    from inercal.systems.aoa.settings import AoaSettings
    from inercal.systems.selfcal.settings import SelfcalSettings
    from inercal.systems.strapdown.settings import StrapdownSettings

    Make = Callable[[Lines], Recursive[Any]]
    """Makes the estimator for the columns of a stream."""

Say = Callable[[str], None]
SayFinding = Callable[[Finding], None]


def of_study(study: Study, interval: float, say: Say, say_finding: SayFinding) -> Make:
    """Prepare the estimator of a study, its kernels loaded, with a line each ``interval`` [s], 0 for each row.

    A study of an IMU asks for its monitor: rest and noise. Raises `StudyError` where none works on a stream.
    """
    if (prepare := study.system.stream) is None:
        *kinds, last = (kind for kind, system in SYSTEMS.items() if system.stream)
        raise StudyError(
            study.path or "study",
            f"is of the kind {study.kind}, expected {', '.join(kinds)} or {last} for a stream",
        )
    with study.at_fault():
        make = prepare(study.settings, interval, say, say_finding)

    def of_columns(lines: Lines) -> Recursive[Any]:
        with study.at_fault():
            return make(lines)

    return of_columns


def aoa(settings: AoaSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    """Prepare a measurement of angles by the fusion. Raises `StudyError` for one that looks ahead."""
    from inercal.faces.stream.aoa import Aoa
    from inercal.systems.aoa.estimators import STREAMED
    from inercal.systems.aoa.fusion.live_band import load_kernels
    from inercal.systems.aoa.fusion.problem import problem

    if (kind := settings.estimator.kind) not in STREAMED:
        raise StudyError(
            "estimator.kind",
            f"found {kind} with a stream, expected {' or '.join(STREAMED)}: {kind} is for files",
        )
    if settings.estimator.smooth:
        raise StudyError(
            "estimator.smooth", "found true with a stream, expected false: it knows the past alone"
        )
    with compiling("aoa", say):
        load_kernels(problem(settings))
    return lambda lines: Aoa(lines, settings, interval, say_finding)


def selfcal(
    settings: SelfcalSettings,
    interval: float,
    say: Say,
    say_finding: SayFinding,
    until_goals: bool = False,
) -> Make:
    """Prepare a calibration of a platform row by row, to its end or until the goals are met. Raises `StudyError`."""
    from inercal.faces.stream.selfcal import Selfcal, filter_of, load_kernels
    from inercal.systems.selfcal.before.next_turn import next_turns
    from inercal.systems.selfcal.filters.problem import problem
    from inercal.systems.selfcal.find_base import stated_well
    from inercal.systems.selfcal.reading import as_recorded
    from inercal.systems.selfcal.still_joints import without_fixed

    if settings.placed:
        raise StudyError("records", "found records on bases of their own, expected one base for a stream")
    stated_well(settings, "a stream")
    settings, left_out = without_fixed(settings)
    of = problem(settings)
    filter_of(of)
    goal = _goals(settings, of.names) if until_goals else {}
    for finding in left_out:
        say_finding(finding)
    with compiling(f"selfcal stream {of.filter.kind}", say):
        load_kernels(of)

    def estimator(lines: Lines) -> Selfcal:
        of_stream = as_recorded(lines.record, settings)
        of_rows = problem(of_stream)
        advise = partial(next_turns, of_stream, of_rows)
        made = Selfcal(lines, of_rows, interval, say_finding, of_stream.fixed, goal, advise)
        say(_OF_A_STREAM)
        return made

    return estimator


_OF_A_STREAM = (
    "u of a stream is by noise and prior alone: record it, and `inercal selfcal FILE` counts what is stated with an "
    "uncertainty and errors of the rig that are no states as well, and judges them"
)
"""Words on u of a platform's lines."""


_WITHOUT_A_RECORDING = (
    "walks of biases and noise of turns that the study does not state count as none in a stream: record it, and "
    "`inercal calibrate strapdown FILE` finds them, and counts them in u"
)
"""Words on noise that the lines of a strapdown unit leave out."""


def _goals(settings: SelfcalSettings, names: Sequence[str]) -> Mapping[str, float]:
    """The goals of a study; raises `StudyError` where it has none, or one for what is no state."""
    if not settings.goal:
        raise StudyError("goal", "missing, expected wanted uncertainties with --until-goals")
    if others := [name for name in settings.goal if name not in names]:
        raise StudyError("goal", f"found {others[0]}, which is no state of the model, expected states alone")
    return settings.goal


def strapdown(settings: StrapdownSettings, interval: float, say: Say, say_finding: SayFinding) -> Make:
    """Prepare a calibration of a strapdown unit rest by rest."""
    from inercal.faces.stream.strapdown import Strapdown, load_kernels

    with compiling("strapdown stream", say):
        load_kernels(settings)

    def estimator(lines: Lines) -> Strapdown:
        made = Strapdown(lines, settings, interval, say_finding)
        if settings.noise.estimate:
            say(_WITHOUT_A_RECORDING)
        return made

    return estimator


def monitor(interval: float, say: Say) -> Make:
    """Prepare a monitor of rest and noise."""
    from inercal.faces.stream.monitor import Monitor
    from inercal.foundation.noise.running import load_kernels

    with compiling("monitor", say):
        load_kernels()
    return lambda lines: Monitor(lines, interval)
