"""The estimators of the angle, a record each: what a measurement and a comparison need of one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.findings import Finding
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.diagnosis.choice import of_delay
from inercal.systems.aoa.diagnosis.effect import of_flexure
from inercal.systems.aoa.diagnosis.examination import diagnose
from inercal.systems.aoa.diagnosis.passed import AnglePass, heard, hidden, pass_of
from inercal.systems.aoa.diagnosis.spectrum import of_rectification
from inercal.systems.aoa.estimators import EstimatorKind
from inercal.systems.aoa.fusion import filter_result, live_band, smoother
from inercal.systems.aoa.fusion.band import fused_case
from inercal.systems.aoa.fusion.filter_result import FusionResult, fusion_label
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.paper.delay import Delay
from inercal.systems.aoa.paper.methods import MEASURED, label
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.result.systematic import by_fusion, by_methods
from inercal.systems.aoa.settings import AoaSettings

Progress = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class PreparedRecording:
    """A recording to be measured: as read, and ``zeroed`` by the study's zero.

    ``settings`` are those of the study with what the recording decides; ``problem`` is that of the fusion, ``delay``
    that of the gyro by the spectra, and ``findings`` are those of the recording so far.
    """

    recording: Recording
    zeroed: Recording
    settings: AoaSettings
    problem: FusionProblem
    delay: Delay | None
    findings: tuple[Finding, ...]


@dataclass(frozen=True, eq=False)
class MeasuredAngles:
    """The ``angles`` of a case, further ``findings``, and errors of the sensors as ``filtered``, with the pass that
    judged them; None without them."""

    angles: Angles
    findings: tuple[Finding, ...] = ()
    filtered: FusionResult | None = None
    passed: AnglePass | None = None


@dataclass(frozen=True)
class AngleEstimator:
    """An estimator.

    ``name`` is that of the angles which settings ask for; ``estimate`` measures a case, its steps told in words;
    ``angles`` finds angles alone, for a comparison; ``beside`` gives the settings that a comparison runs;
    ``load_kernels`` loads, or compiles, what it runs.
    """

    name: Callable[[AoaSettings], str]
    estimate: Callable[[PreparedRecording, Progress], MeasuredAngles]
    angles: Callable[[Recording, AoaSettings], Angles]
    beside: Callable[[AoaSettings], Sequence[AoaSettings]]
    load_kernels: Callable[[AoaSettings], None]


def estimator_of(settings: AoaSettings) -> AngleEstimator:
    """The estimator that settings ask for."""
    return ESTIMATORS[settings.estimator.kind]


def _fusion(case: PreparedRecording, progress: Progress) -> MeasuredAngles:
    """The angles by the fusion, and all that it says of the recording."""
    zeroed, settings, of = case.zeroed, case.settings, case.problem
    progress("smoothing" if settings.estimator.smooth else "filtering")
    filtered = filter_result.estimate(zeroed, of, settings.estimator.smooth)
    angles = by_fusion(zeroed, settings, of, filtered)
    progress("looking for faults")
    findings = diagnose(*fused_case(zeroed, settings), case.findings, settings.band.every)
    said = (*case.findings, *findings)
    named = any(finding.harm and not finding.code.endswith("_scatter") for finding in said)
    passed = pass_of(zeroed, of, settings, filtered)
    findings = [*findings, *of_delay(case.delay, of, filtered)]
    if passed is not None:
        shown = None if named else heard(passed)
        findings += [*(() if shown is None else (shown,)), *hidden(passed)]
    findings += of_flexure(zeroed, of, filtered, settings)
    known_u = angles.u[np.isfinite(angles.u)]
    if len(known_u):
        findings += of_rectification(case.recording, settings, float(np.median(known_u)))
    return MeasuredAngles(angles, tuple(findings), filtered, passed)


def _fusion_alone(recording: Recording, settings: AoaSettings) -> Angles:
    """The angles by the fusion."""
    of = problem(settings, recording.spatial)
    return by_fusion(
        recording, settings, of, filter_result.estimate(recording, of, settings.estimator.smooth)
    )


def _fusions(settings: AoaSettings) -> list[AoaSettings]:
    """The fusion small and large, causal and smoothed, without an earlier run."""
    return [
        replace(
            settings,
            estimator=replace(settings.estimator, kind="fusion", states=states, smooth=smooth, prior=None),
        )
        for states in (8, 19)
        for smooth in (False, True)
    ]


def _kernels_of_fusion(settings: AoaSettings) -> None:
    """Load the kernels of the fusion."""
    of = problem(settings)
    live_band.load_kernels(of)
    if settings.estimator.smooth:
        smoother.load_kernels(of)


def _by_paper(case: PreparedRecording, progress: Progress) -> MeasuredAngles:
    """The angles by the paper's methods."""
    progress(label(case.settings.methods))
    return MeasuredAngles(by_methods(case.recording, case.settings, case.settings.methods))


def _papers(settings: AoaSettings) -> list[AoaSettings]:
    """The paper's methods, its own choice first."""
    estimator = replace(settings.estimator, kind="paper")
    return [replace(settings, estimator=estimator, methods=methods) for methods in MEASURED]


ESTIMATORS: Mapping[EstimatorKind, AngleEstimator] = {
    "fusion": AngleEstimator(
        lambda of: fusion_label(of.estimator.smooth, of.estimator.states),
        _fusion,
        _fusion_alone,
        _fusions,
        _kernels_of_fusion,
    ),
    "paper": AngleEstimator(
        lambda of: label(of.methods),
        _by_paper,
        lambda recording, of: by_methods(recording, of, of.methods),
        _papers,
        lambda _: None,
    ),
}
"""The estimators, in the order of a comparison."""
