"""Accelerometers from pose means: rows of mean outputs and settings in, an estimate out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array, short_repr
from inercal.errors import RecordError
from inercal.estimate.basis import conditions_of, studied
from inercal.estimate.budget import TypeA, TypeB, combine
from inercal.estimate.result import Estimate, timed
from inercal.findings import Finding, Status
from inercal.imu.identified import few_findings, outlying, weakness
from inercal.imu.limits import LIMITS
from inercal.imu.recording import unit_words
from inercal.imu.rows import rows_of
from inercal.imu.settings import COMMAND, ImuSettings
from inercal.imu.vector_sizes import PARAMETERS, SizeFit, fit_sizes
from inercal.instruments.terms import ACCELEROMETER_TRIAD, TERMS
from inercal.records.places import counted
from inercal.records.record import Record
from inercal.records.temperature import recorded_temperature

MODEL = (
    "y = S M f + b, S = diag(K1), M = 1 + misalignment (upper-triangular; M_ij: response of accelerometer i to specific "
    "force along j), b = K0, with |f| = g in every pose. Frame: z along the input axis of accelerometer z, y in the plane "
    "of the input axes of accelerometers y and z."
)

FRAME = "b, of the instrument: z along the input axis of accelerometer z, y in the plane of those of y and z"

REFERENCES = (
    "D. Tedaldi, A. Pretto, E. Menegatti, A robust and easy to implement method for IMU calibration without external "
    "equipments, ICRA 2014",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
)


@short_repr
@dataclass(frozen=True)
class MeansCalibration:
    """An ``estimate``, the ``outputs`` (n, 3) of the rows used, their ``numbers`` (n,) from 1, and the ``fit``, if any."""

    estimate: Estimate
    outputs: Array
    numbers: NDArray[np.int64]
    fit: SizeFit | None = None


def calibrate_means(
    record: Record, settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> MeansCalibration:
    """Calibrate accelerometers from the mean outputs of poses.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` in any unit, counts included, one row for each pose; times do not matter.
    settings : ImuSettings
        Site and what goes with the result.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    MeansCalibration
        Its estimate holds K0, K1 and the three misalignments; the status says whether they can be used.

    Raises
    ------
    InputError
        No accelerometer triad, or the rows are samples of a recording.
    """
    clock = time.perf_counter()
    triad = record.triad("acc")
    outputs, numbers, findings = rows_of(record, "acc")
    if "gyro_x" in record:
        text = "means of poses hold no turns: the gyro is not calibrated"
        findings = (*findings, Finding("gyro_missing", text))
    basis = studied(COMMAND, settings, record.sources, MODEL, REFERENCES, _conditions(record, settings))
    if len(outputs) < LIMITS.fewest_poses:
        text = f"found {counted(len(outputs), 'pose')}, expected at least {LIMITS.fewest_poses}, each side up and the edges between"
        estimate = Estimate.without(basis, Status.TOO_FEW_INTERVALS, text, findings=findings, result=_result(numbers))
        return MeansCalibration(timed(estimate, clock), outputs, numbers)
    _refuse_samples(outputs, triad.source.path)
    gravity = settings.site.gravity
    sizes = np.full(len(outputs), gravity)
    fit = fit_sizes(outputs, sizes, ACCELEROMETER_TRIAD)
    dof = len(outputs) - PARAMETERS
    variance = fit.fit.chi2 / dof
    covariance = variance * fit.fit.unit_covariance
    by_gravity = np.where(np.char.startswith(ACCELEROMETER_TRIAD, "K1_"), -fit.fit.x / gravity, 0.0)
    sources: list[TypeA | TypeB] = [TypeA("pose scatter", float(np.sqrt(variance)), "m/s^2", covariance, dof)]
    sources += [TypeB(i.source, i.u, i.unit, by_gravity * i.sensitivity) for i in settings.site.inputs]
    uncertainty = combine(ACCELEROMETER_TRIAD, sources)
    poses = counted(len(outputs), "pose")
    weak = weakness(fit, uncertainty.u, poses)
    wrong = unit_words(triad, fit.model)
    verdict = weak or (
        (Status.INCONSISTENT, wrong)
        if wrong
        else (Status.OK, f"{PARAMETERS} coefficients of the accelerometers from {poses}; condition "
              f"{fit.fit.identifiability.condition:.1f}")
    )  # fmt: skip
    if weak is None:
        findings += few_findings(dof, poses)
        findings += outlying(fit, outputs, sizes, uncertainty.u, variance, dof, "outlying_pose", numbers)
    estimate = Estimate.of(
        basis,
        ACCELEROMETER_TRIAD,
        [TERMS[name].unit_for(triad.unit.symbol) for name in ACCELEROMETER_TRIAD],
        fit.fit.x,
        uncertainty,
        verdict,
        findings=findings,
        statistics={
            "dof": float(dof),
            "condition": fit.fit.identifiability.condition,
            "residual_rms": float(np.sqrt(np.mean(fit.residuals**2))),
            "scatter": float(np.sqrt(variance)),
            "intervals": float(len(outputs)),
        },
        result=_result(numbers, fit) | {"unit": {"acc": triad.unit.symbol}},
    )
    return MeansCalibration(timed(estimate, clock), outputs, numbers, fit)


def _conditions(record: Record, settings: ImuSettings) -> dict[str, object]:
    """Conditions and ranges over which the result is valid."""
    g = settings.site.gravity
    ranges = {"specific_force_along_an_axis_m_s2": [-g, g]}
    return conditions_of(settings, recorded_temperature(record), ranges, frame=FRAME)


def _result(numbers: NDArray[np.int64], fit: SizeFit | None = None) -> dict[str, object]:
    """The command's own part of the result: a row for each pose."""
    if fit is None:
        return {"method": "means", "poses": []}
    rows = zip(numbers.tolist(), fit.directions, fit.residuals.tolist(), strict=True)
    return {
        "method": "means",
        "poses": [
            {"row": number, "direction": direction, "residual_m_s2": residual} for number, direction, residual in rows
        ],
    }


def _refuse_samples(outputs: Array, where: str) -> None:
    """Refuse rows that are samples of a recording: most of many are like the one before."""
    size = 0.5 * float(np.max(np.ptp(outputs, axis=0)))
    alike = np.linalg.norm(np.diff(outputs, axis=0), axis=1) < LIMITS.same_pose * size
    if len(outputs) > LIMITS.most_poses and np.mean(alike) > 0.5:
        raise RecordError(
            where,
            f"found {len(outputs)} rows, most of them like the one before, expected one row for each pose: for a "
            'recording set imu.method = "multiposition"',
        )
