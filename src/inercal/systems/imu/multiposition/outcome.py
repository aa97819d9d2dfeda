"""The estimate of a calibration, put together from its fits: covariance, budget, tables, conditions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import Uncertainty, combine
from inercal.foundation.results.result import Estimate
from inercal.systems.imu.identified import spread_words
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.deletion import held_out
from inercal.systems.imu.multiposition.gyro import GyroFit
from inercal.systems.imu.multiposition.joint import JointTriads, PoseScatter, noise_covariance, type_a, type_b
from inercal.systems.imu.multiposition.outliers import linear_poses
from inercal.systems.imu.multiposition.poses import MULTIPLES, Poses, distinct, dwells_at
from inercal.systems.imu.multiposition.squares import squares_source
from inercal.systems.imu.multiposition.verdict import by_turns, rms_miss, verdict
from inercal.systems.imu.recording import Recording
from inercal.systems.imu.second_order import k2_size
from inercal.systems.imu.settings import COMMAND, MASKED, ImuSettings

MODEL = Formula(
    r"$y = S M x + b$, $S = \mathrm{diag}$(scale factor), $M = 1$ + misalignment ($M_{ij}$: response of sensor $i$ to "
    "the input along frame axis $j$); accelerometers: $K_1$, $M$ upper-triangular, $K_0$, with $|f| = g$ in every "
    "static pose; gyro: $S$, $T$ full, $D_F$, and $+ G f$ where g-sensitivity, $+ D_R (t - t_0)$ where the drift of "
    r"the bias in this recording is estimated, $t_0$ = bias_time_s. Frame: z along the input axis of accelerometer z, "
    "y in the plane of the input axes of accelerometers y and z."
)

FRAME = "b, of the instrument: z along the input axis of accelerometer z, y in the plane of those of y and z"

REFERENCES = (
    "D. Tedaldi, A. Pretto, E. Menegatti, A robust and easy to implement method for IMU calibration without external "
    "equipments, ICRA 2014",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "J. Mandel, R. C. Paule, Interlaboratory evaluation of a material with unequal numbers of replicates, Analytical "
    "Chemistry 42 (1970) 1194",
    "W. J. Riley, D. A. Howe, Handbook of frequency stability analysis, NIST SP 1065 (2008)",
)


def assemble(
    record: Record,
    recording: Recording,
    poses: Poses,
    scatter: PoseScatter,
    joint: JointTriads,
    settings: ImuSettings,
    findings: list[Finding],
) -> Estimate:
    """Put the estimate together."""
    uncertainty = uncertainty_of(joint, scatter, recording, settings)
    from_scatter = type_a(joint, scatter, _gyro_unit(recording))
    residual = np.sum([source.covariance for source in from_scatter], axis=0)
    u = dict(zip(joint.names, uncertainty.u.tolist(), strict=True))
    noise = noise_covariance(joint, *_noise(recording, poses, joint))
    acc, gyro = poses.accelerometer, joint.gyro
    statistics = {
        "dof": float(acc.fit.dof),
        "condition": acc.fit.identifiability.condition,
        "residual_rms": float(np.sqrt(np.mean(acc.fit.residuals**2))),
        "scatter": scatter.s,
        "scatter_over_noise": scatter.over_noise,
        "threshold": poses.multiple,
        "intervals": float(len(poses.dwells)),
    }
    if gyro is not None:
        statistics |= {
            "gyro_dof": float(gyro.dof),
            "gyro_condition": gyro.geometry.condition,
            "gyro_residual_rms_rad": rms_miss(gyro),
            "turns": float(len(gyro.miss)),
        }
    return Estimate.of(
        _basis(record, settings, _conditions(record, recording, settings)),
        joint.names,
        [_unit(name, recording) for name in joint.names],
        joint.values,
        uncertainty,
        verdict(recording, poses, joint.gyro, settings.site.gravity, u, findings),
        findings=(*settled(record.findings, *MASKED), *recording.findings, *findings),
        statistics=statistics,
        result={
            "method": "multiposition",
            "intervals": _interval_table(recording, poses),
            "turns": _turn_table(joint, poses, recording),
            "held_out": _held_out(poses, scatter, gyro),
            "u_residual": _named(joint.names, np.sqrt(np.diag(residual))),
            "u_noise": _named(joint.names, np.sqrt(np.diag(noise))),
            "unit": {triad.sensor: triad.unit.symbol for triad in _triads(recording)},
            "bias_time_s": float(poses.times.mean()),
        },
    )


def uncertainty_of(
    joint: JointTriads, scatter: PoseScatter, recording: Recording, settings: ImuSettings
) -> Uncertainty:
    """Covariance, degrees of freedom and budget of the coefficients."""
    unit = _gyro_unit(recording)
    resolution = recording.resolution.get("gyro", np.zeros(3))
    from_outside = type_b(joint, settings.site, settings.time_base_u, resolution, unit)
    squares = squares_source(joint, scatter, k2_size(settings, scatter.s))
    return combine(joint.names, [*type_a(joint, scatter, unit), *from_outside, *squares])


def _gyro_unit(recording: Recording) -> str:
    """Unit of the gyro's output; empty where there is none."""
    return "" if recording.gyro is None else recording.gyro.unit.symbol


def _basis(record: Record, settings: ImuSettings, conditions: Mapping[str, Any] | None = None) -> Basis:
    """The basis of the estimate."""
    return studied(COMMAND, settings, record.sources, MODEL, REFERENCES, conditions)


def _triads(recording: Recording) -> list[Triad]:
    """The triads there are."""
    return [triad for triad in (recording.accelerometer, recording.gyro) if triad is not None]


def _unit(name: str, recording: Recording) -> str:
    """Unit of a coefficient, from that of the output of its sensor."""
    triad = recording.accelerometer if name.startswith(("K", "M")) else recording.gyro
    assert triad is not None
    return TERMS[name].unit_for(triad.unit.symbol)


def _named(names: tuple[str, ...], values: Array) -> dict[str, float]:
    """Values by name."""
    return dict(zip(names, np.asarray(values).tolist(), strict=True))


def _noise(recording: Recording, poses: Poses, joint: JointTriads) -> tuple[Array, Array, Array]:
    """Variances that the sensors' noise explains: see `noise_covariance`."""
    pose = np.repeat(poses.noise_variance, 3)
    if joint.gyro is None:
        return pose, np.zeros(3), np.zeros(0)
    lengths = np.array([dwell.samples for dwell in poses.dwells]) / recording.accelerometer.rate
    noise = recording.noise["gyro"]
    return pose, noise.coefficients[0] / joint.gyro.model.scale**2, noise.variance(lengths).ravel()


def _conditions(record: Record, recording: Recording, settings: ImuSettings) -> dict[str, Any]:
    """Conditions and ranges over which the result is valid, as recorded."""
    t = recording.accelerometer.t
    g = settings.site.gravity
    ranges: dict[str, Any] = {
        "specific_force_along_an_axis_m_s2": [-g, g],
        "duration_s": float(t[-1] - t[0]),
        "rate_hz": recording.accelerometer.rate,
    }
    if recording.gyro is not None:
        finite = recording.gyro.values[np.isfinite(recording.gyro.values).all(axis=1)]
        ranges["gyro_output"] = [finite.min(axis=0), finite.max(axis=0)]
    return conditions_of(settings, recorded_temperature(record), ranges, frame=FRAME)


def _interval_table(recording: Recording, poses: Poses) -> list[Mapping[str, Any]]:
    """One row for each static interval."""
    t, fit = recording.accelerometer.t, poses.accelerometer
    return [
        {
            "pose": number,
            "start_s": float(t[d.start]),
            "end_s": float(t[d.stop - 1]),
            "samples": d.samples,
            "direction": direction,
            "residual_m_s2": float(residual),
        }
        for number, d, direction, residual in zip(
            poses.numbers, poses.dwells, fit.directions, fit.fit.residuals, strict=True
        )
    ]


def _turn_table(joint: JointTriads, poses: Poses, recording: Recording) -> list[Mapping[str, Any]]:
    """One row for each turn used."""
    if joint.gyro is None:
        return []
    gyro, t = joint.gyro, recording.accelerometer.t
    misses = np.linalg.norm(gyro.miss, axis=1)
    return [
        {
            "from_pose": poses.numbers[k],
            "start_s": float(t[poses.dwells[k].stop - 1]),
            "duration_s": float(d),
            "miss_rad": float(m),
        }
        for k, d, m in zip(gyro.first, gyro.durations, misses, strict=True)
    ]


def _held_out(poses: Poses, scatter: PoseScatter, gyro: GyroFit | None) -> Mapping[str, Any]:
    """Every second pose and turn foretold by the others: rms error over u, its count, and the 99 % range of that."""
    of_poses = held_out(linear_poses(poses.accelerometer), scatter.s**2)
    of_turns = None if gyro is None else held_out(gyro.linear, gyro.walk**2)
    named = {"poses": of_poses, "turns": of_turns}
    return {
        name: {"rms_z": each.rms, "residuals": each.count, "range_99": [each.low, each.high]}
        for name, each in named.items()
        if each is not None
    }


def without_fit(record: Record, recording: Recording, settings: ImuSettings) -> Estimate:
    """The estimate of a recording whose poses fix nothing: no parameters, but why, and what to do."""
    y, window = recording.accelerometer.values, recording.window
    candidates = {m: distinct(dwells_at(recording, m, False), y, window) for m in MULTIPLES}
    best = max(candidates, key=lambda m: len(candidates[m]))
    dwells = candidates[best]
    if len(dwells) < LIMITS.fewest_poses:
        status = Status.TOO_FEW_INTERVALS
        message = (
            f"found {counted(len(dwells), 'static interval')} of at least {window / recording.accelerometer.rate:.1f} "
            f"s at a threshold of {best:g} times the variance at rest, expected at least {LIMITS.fewest_poses}: hold "
            "the instrument still for 3 s or more in 12 to 40 different poses, each side up and the edges between"
            f"{by_turns(recording, len(dwells))}"
        )
    else:
        status = Status.UNOBSERVABLE
        message = (
            f"the {len(dwells)} poses do not fix the nine coefficients of the accelerometers (the specific force lies "
            f"{spread_words(np.array([dwell.of(y).mean(axis=0) for dwell in dwells]))}): hold each side up, and the "
            f"edges between{by_turns(recording, len(dwells))}"
        )
    return Estimate.without(
        _basis(record, settings),
        status,
        message,
        findings=(*record.findings, *recording.findings),
        statistics={"intervals": float(len(dwells)), "threshold": best},
        result={"method": "multiposition", "intervals": [], "turns": []},
    )
