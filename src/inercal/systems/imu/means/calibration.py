"""Accelerometers from pose means: rows of mean outputs and settings in, an estimate out.

The fit is that of the un-aided multi-position method; poses are rows in the place of stretches of a recording, so that
the scatter of the residuals is all that tells of noise.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeA, TypeB, Uncertainty, combine
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.identified import weakness
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit, fit_accelerometer
from inercal.systems.imu.multiposition.deletion import outlying
from inercal.systems.imu.multiposition.joint import JointTriads, PoseScatter, join, type_a, type_b
from inercal.systems.imu.multiposition.outcome import FRAME, REFERENCES
from inercal.systems.imu.multiposition.outliers import linear_poses
from inercal.systems.imu.multiposition.squares import squares_finding, squares_shown, squares_source
from inercal.systems.imu.multiposition.verdict import curing_pose
from inercal.systems.imu.recording import unit_words
from inercal.systems.imu.rows import rows_of
from inercal.systems.imu.second_order import k2_size
from inercal.systems.imu.settings import COMMAND, ImuSettings

MODEL = Formula(
    r"$y = S (l + K_2 l^2) + b$, $l = M f$ along the input axes, $S = \mathrm{diag}(K_1)$, $M = 1$ + misalignment "
    r"(upper-triangular; $M_{ij}$: response of accelerometer $i$ to specific force along $j$), $b = K_0$, $K_2 = 0$ "
    "unless it is estimated, with $|f| = g$ in every pose. Frame: z along the input axis of accelerometer z, y in the "
    "plane of the input axes of accelerometers y and z."
)


@short_repr
@dataclass(frozen=True)
class MeansCalibration:
    """An ``estimate``, the ``outputs`` (n, 3) of the rows used, their ``numbers`` (n,) from 1, and the ``fit``, if
    any."""

    estimate: Estimate
    outputs: Array
    numbers: NDArray[np.int64]
    fit: AccelerometerFit | None = None


@dataclass(frozen=True)
class _FittedRows:
    """Rows fitted: the accelerometers with their scatter and covariance."""

    fit: AccelerometerFit
    scatter: PoseScatter
    joint: JointTriads
    uncertainty: Uncertainty


def calibrate_means(
    record: Record, settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> MeansCalibration:
    """Calibrate accelerometers from the mean outputs of poses.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` in any unit, counts included, one row for each pose; times do not matter.
    settings : ImuSettings
        Site, K2, poses to be left out by the number of their row, and what goes with the result.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    MeansCalibration
        Its estimate holds K0, K1 and the three misalignments, and K2 if asked for; the status says whether they can be
        used.

    Raises
    ------
    InputError
        No accelerometer triad, rows that are samples of a recording, or the study leaves out a row that is not there.
    """
    clock = time.perf_counter()
    progress("fitting the poses")
    triad = record.triad("acc")
    outputs, numbers, findings = _used(*rows_of(record, "acc"), settings)
    _refuse_samples(outputs, triad.source.path)
    if "gyro_x" in record:
        text = "means of poses hold no turns: the gyro is not calibrated"
        findings = (*findings, Finding("gyro_missing", text))
    g = settings.site.gravity
    ranges = {"specific_force_along_an_axis_m_s2": [-g, g]}
    conditions = conditions_of(settings, recorded_temperature(record), ranges, frame=FRAME)
    basis = studied(COMMAND, settings, record.sources, MODEL, REFERENCES[:2], conditions)
    poses = counted(len(outputs), "pose")
    fewest = LIMITS.poses_with_k2 if settings.k2 else LIMITS.fewest_poses
    if len(outputs) < fewest:
        text = f"found {poses}, expected at least {fewest}: each side up, and the edges between"
        none = {"method": "means", "poses": []}
        estimate = Estimate.without(basis, Status.TOO_FEW_INTERVALS, text, findings=findings, result=none)
        return MeansCalibration(timed(estimate, clock), outputs, numbers)
    fitted = _fit(outputs, settings)
    fit, u = fitted.fit, fitted.uncertainty.u
    verdict = weakness(fit.fit, u, outputs, curing_pose(fit, g), poses)
    if verdict is None:
        findings = (*findings, *_findings(fitted, outputs, numbers, settings))
        wrong = unit_words(triad, fit.model)
        condition = f"condition {fit.fit.identifiability.condition:.1f}"
        text = f"{len(fit.names)} coefficients of the accelerometers from {poses}; {condition}"
        verdict = (Status.INCONSISTENT, wrong) if wrong else (Status.OK, text)
    residuals = zip(numbers.tolist(), fit.directions, fit.fit.residuals.tolist(), strict=True)
    estimate = Estimate.of(
        basis,
        fit.names,
        [TERMS[name].unit_for(triad.unit.symbol) for name in fit.names],
        fit.fit.x,
        fitted.uncertainty,
        verdict,
        findings=findings,
        statistics={
            "dof": float(fit.fit.dof),
            "condition": fit.fit.identifiability.condition,
            "residual_rms": float(np.sqrt(np.mean(fit.fit.residuals**2))),
            "scatter": fitted.scatter.s,
            "intervals": float(len(outputs)),
        },
        result={
            "method": "means",
            "poses": [{"row": row, "direction": way, "residual_m_s2": left} for row, way, left in residuals],
            "unit": {"acc": triad.unit.symbol},
        },
    )
    return MeansCalibration(timed(estimate, clock), outputs, numbers, fit)


def _used(
    outputs: Array, numbers: NDArray[np.int64], findings: tuple[Finding, ...], settings: ImuSettings
) -> tuple[Array, NDArray[np.int64], tuple[Finding, ...]]:
    """The rows that the study does not leave out."""
    if settings.exclude.times:
        raise StudyError(
            "imu.exclude", 'found a time, expected the numbers of rows, such as "pose 12": rows have no times'
        )
    missing = [number for number in settings.exclude.poses if number not in numbers]
    if missing:
        raise StudyError(
            "imu.exclude", f"found pose {missing[0]}, expected one of the rows 1 to {max(numbers, default=0)}"
        )
    kept = ~np.isin(numbers, settings.exclude.poses)
    return outputs[kept], numbers[kept], findings


def _fit(outputs: Array, settings: ImuSettings) -> _FittedRows:
    """Fit the rows, with their covariance."""
    fit = fit_accelerometer(outputs, settings.site.gravity, squares=settings.k2)
    dof = max(fit.fit.dof, 1)
    scatter = PoseScatter(float(np.sqrt(fit.fit.chi2 / dof)), dof, False, np.nan)
    joint = join(fit, None)
    sources: list[TypeA | TypeB] = [
        *type_a(joint, scatter, ""),
        *type_b(joint, settings.site, 0.0, np.zeros(3), ""),
        *squares_source(joint, scatter, k2_size(settings, scatter.s)),
    ]
    return _FittedRows(fit, scatter, joint, combine(joint.names, sources))


def _findings(
    fitted: _FittedRows, outputs: Array, numbers: NDArray[np.int64], settings: ImuSettings
) -> list[Finding]:
    """Findings about poses that lie off all others or are hardly enough, and about K2."""
    findings = []
    dof = fitted.fit.fit.dof
    if dof < 5:
        text = (
            f"{len(outputs)} poses leave {counted(dof, 'degree')} of freedom for "
            f"{len(fitted.fit.names)} parameters: "
        )
        text += "the uncertainties themselves are uncertain, measure more poses"
        findings.append(Finding("few_degrees_of_freedom", text))
    off = outlying(linear_poses(fitted.fit), LIMITS.outlier_risk)
    if not off:
        size = k2_size(settings, fitted.scatter.s)
        shown = squares_shown(fitted.joint, outputs, settings.site.gravity)
        of_k2 = squares_finding(fitted.joint, outputs, fitted.uncertainty, settings, size, shown)
        return [*findings, *of_k2]
    without = _fit(np.delete(outputs, off, axis=0), settings)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = (fitted.fit.fit.x - without.fit.fit.x) / without.uncertainty.u
    worst = int(np.argmax(np.abs(shift)))
    rows = [f"pose {number}" for number in numbers[off]]
    what, them = ("a row lies", "it") if len(off) == 1 else (f"{len(off)} rows lie", "them")
    text = (
        f"{what} off what all others say ({counted_names(rows)}, counted from 1); without {them} "
        f"{fitted.fit.names[worst]} "
        f"would be {abs(shift[worst]):.1f} u {'smaller' if shift[worst] > 0 else 'larger'}: was "
        "the instrument moving, or "
        f"the mean taken of another stretch? leave {them} out by imu.exclude = "
        f"[{', '.join(chr(34) + row + chr(34) for row in rows)}]"
    )
    harm = tuple(name for name, each in zip(fitted.fit.names, shift, strict=True) if abs(each) > 1.0)
    return [*findings, Finding("outlying_pose", text, ", ".join(rows), harm)]


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
