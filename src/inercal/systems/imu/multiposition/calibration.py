"""Un-aided multi-position calibration of an IMU: a recording and settings in, an estimate out."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.drift import (
    bias_drift_finding,
    bias_drift_shown,
    gyro_scale_drift,
    scale_drift_finding,
    scale_drift_shown,
)
from inercal.systems.imu.multiposition.drivers import drivers_of
from inercal.systems.imu.multiposition.earth_rate import earth_rate_at
from inercal.systems.imu.multiposition.gyro import GyroFit, fit_gyro
from inercal.systems.imu.multiposition.joint import JointTriads, PoseScatter, force_error, join
from inercal.systems.imu.multiposition.left_out import unexplained
from inercal.systems.imu.multiposition.outcome import assemble, uncertainty_of, without_fit
from inercal.systems.imu.multiposition.outliers import Outliers, outlier_finding, outliers_of
from inercal.systems.imu.multiposition.poses import Poses, choose, excluded, refitted, sweep
from inercal.systems.imu.multiposition.squares import squares_finding, squares_shown
from inercal.systems.imu.multiposition.verdict import (
    axis_findings,
    clipped_poses,
    gyro_findings,
    rms_miss,
    scatter_findings,
)
from inercal.systems.imu.recording import Recording, clipped_rows, prepare
from inercal.systems.imu.second_order import k2_size
from inercal.systems.imu.settings import Exclusion, ImuSettings
from inercal.systems.imu.turns import Turns, cut_turns, first_guess


@short_repr
@dataclass(frozen=True)
class MultipositionCalibration:
    """An ``estimate`` and, where the fit came that far, the evidence behind it for pictures and tests."""

    estimate: Estimate
    recording: Recording
    poses: Poses | None = None
    gyro: GyroFit | None = None
    outliers: Outliers = field(default_factory=Outliers)


@dataclass(frozen=True)
class _Fitted:
    """Accelerometers and gyro fitted to some of the poses and turns, with findings about that."""

    poses: Poses
    scatter: PoseScatter
    gyro: GyroFit | None
    joint: JointTriads
    findings: list[Finding]


def calibrate_multiposition(
    record: Record, settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> MultipositionCalibration:
    """Calibrate the accelerometers, and the gyro if the record has one.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and perhaps ``gyro_x..z``, in any unit, counts included.
    settings : ImuSettings
        Site and options.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    MultipositionCalibration
        Its estimate's status says whether the values can be used; nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record has no accelerometer triad or no rest, or the study leaves out what is not there.
    """
    import scipy.optimize  # noqa: F401  (loading it is not part of the computation)

    clock = time.perf_counter()
    progress("finding static poses")
    recording = prepare(record, settings.static_start)
    gravity = settings.site.gravity
    candidates = list(sweep(recording, gravity))
    if not candidates:
        return MultipositionCalibration(timed(without_fit(record, recording, settings), clock), recording)
    poses = refitted(
        choose(candidates), recording, gravity, excluded(candidates, recording, settings), settings.k2
    )
    progress("fitting the gyro to the turns")
    fitted = _fit(recording, poses, settings)
    progress("looking for what the model lacks")
    uncertainty = uncertainty_of(fitted.joint, fitted.scatter, recording, settings)
    findings = list(fitted.findings)
    outliers = outliers_of(poses, fitted.gyro)
    if outliers:
        findings.append(_outlier_finding(recording, fitted, outliers, settings))
    else:
        findings += _left_out(fitted, recording, uncertainty, settings)
    estimate = assemble(record, recording, poses, fitted.scatter, fitted.joint, settings, findings)
    return MultipositionCalibration(timed(estimate, clock), recording, poses, fitted.gyro, outliers)


def _fit(
    recording: Recording, poses: Poses, settings: ImuSettings, left_out: Collection[tuple[int, int]] = ()
) -> _Fitted:
    """Fit all, but for the turns ``left_out``, pairs of the numbers of poses."""
    scatter = _scatter(poses)
    gyro, of_gyro = _calibrate_gyro(recording, poses, scatter, settings, left_out)
    joint = join(poses.accelerometer, gyro)
    findings = [*scatter_findings(poses, scatter), *clipped_poses(poses, scatter, recording), *of_gyro]
    return _Fitted(poses, scatter, gyro, joint, findings)


def _outlier_finding(
    recording: Recording, fitted: _Fitted, outliers: Outliers, settings: ImuSettings
) -> Finding:
    """The finding about outliers, from the calibration without them."""
    poses, gyro = fitted.poses, fitted.gyro
    numbers = {poses.numbers[k] for k in outliers.poses}
    others = refitted(poses, recording, settings.site.gravity, numbers, settings.k2)
    turns = [] if gyro is None else [gyro.first[k] for k in outliers.turns]
    without = _fit(recording, others, settings, {(poses.numbers[k], poses.numbers[k + 1]) for k in turns})
    uncertainty = uncertainty_of(without.joint, without.scatter, recording, settings)
    u = np.sqrt(np.diag(uncertainty.covariance))
    return outlier_finding(outliers, poses, recording.accelerometer.t, gyro, fitted.joint, without.joint, u)


def _left_out(
    fitted: _Fitted, recording: Recording, uncertainty: Uncertainty, settings: ImuSettings
) -> Iterator[Finding]:
    """Findings about K2 and drifts of biases and scale factors; of the accelerometers those that no other explains."""
    joint, poses = fitted.joint, fitted.poses
    noise = float(np.mean(poses.noise_variance)), poses.noise_dof
    found = {
        "squares": squares_shown(joint, poses.means, settings.site.gravity, *noise),
        "bias": bias_drift_shown(joint, poses.times, *noise),
        "scale": scale_drift_shown(joint, poses.times, *noise),
    }
    stand = unexplained(joint, found, *noise)
    if (bias := stand.get("bias")) is not None:
        yield bias_drift_finding(joint, bias, recording.accelerometer.unit.symbol, uncertainty)
    if (scale := stand.get("scale")) is not None:
        yield scale_drift_finding(joint, scale, uncertainty)
    if fitted.gyro is not None and bias is None and scale is None:
        yield from gyro_scale_drift(fitted.gyro, poses.times, joint.names, uncertainty)
    size = k2_size(settings, fitted.scatter.s)
    yield from squares_finding(joint, poses.means, uncertainty, settings, size, stand.get("squares"))


def _scatter(poses: Poses) -> PoseScatter:
    """Residual scatter, pooled with the noise at rest unless it clearly differs from that (F test, both sides)."""
    from scipy.special import fdtr, fdtrc

    fit, noise = poses.accelerometer.fit, float(np.mean(poses.noise_variance))
    own = fit.chi2 / fit.dof
    ratio = own / noise if noise > 0 else np.inf
    more = noise <= 0 or fdtrc(fit.dof, poses.noise_dof, ratio) < LIMITS.scatter_probability
    if more or fdtr(fit.dof, poses.noise_dof, ratio) < LIMITS.low_scatter_probability:
        return PoseScatter(float(np.sqrt(own)), fit.dof, bool(more), float(np.sqrt(ratio)))
    return PoseScatter(float(np.sqrt(poses.misfit)), fit.dof + poses.noise_dof, False, float(np.sqrt(ratio)))


def _gyro_index(recording: Recording, sample: int) -> int:
    """The gyro's sample at the time of a sample of the accelerometers."""
    gyro, acc = recording.gyro, recording.accelerometer
    assert gyro is not None
    if gyro.t is acc.t:
        return sample
    return int(np.clip(np.searchsorted(gyro.t, acc.t[sample]), 0, len(gyro.t) - 1))


def _gyro_means(recording: Recording, poses: Poses) -> Array:
    """Mean gyro output (n, 3) in each pose; NaN where it has no samples."""
    gyro, t = recording.gyro, recording.accelerometer.t
    assert gyro is not None
    first = np.searchsorted(gyro.t, [t[d.start] for d in poses.dwells])
    last = np.searchsorted(gyro.t, [t[d.stop - 1] for d in poses.dwells], side="right")
    parts = [gyro.values[a:b] for a, b in zip(first, last, strict=True)]
    return np.array([part.mean(axis=0) if len(part) else np.full(3, np.nan) for part in parts])


def _turns(
    recording: Recording,
    poses: Poses,
    drivers: Array,
    exclude: Exclusion,
    without: Collection[tuple[int, int]],
) -> tuple[Turns | None, list[Finding]]:
    """The turns between neighbouring poses that can be integrated, and findings about the others."""
    gyro = recording.gyro
    assert gyro is not None
    longest = LIMITS.motion_gap / gyro.rate
    clipped = clipped_rows(gyro)
    spans, left_out = [], []
    for k, (here, there) in enumerate(itertools.pairwise(poses.dwells)):
        start, stop = _gyro_index(recording, here.stop - 1), _gyro_index(recording, there.start)
        part = slice(start, stop + 1)
        numbers = poses.numbers[k], poses.numbers[k + 1]
        if numbers in without or exclude.touches(gyro.t[start], gyro.t[stop]):
            continue
        steps = np.diff(gyro.t[part])
        if len(steps) == 0 or not np.all(steps >= 0):
            why = "the time axis breaks"
        elif np.any(steps > longest):
            why = "samples are missing"
        elif clipped[part].any():
            why = "the gyro saturates"
        else:
            spans.append((k, start, stop))
            continue
        where = f"t {gyro.t[start]:.2f} to {gyro.t[stop]:.2f} s"
        left_out.append(Finding("skipped_turn", f"a turn is left out: {why}", where))
    if len(spans) < LIMITS.fewest_turns:
        left_out.append(
            Finding(
                "gyro_missing",
                f"found {counted(len(spans), 'turn')} between poses, expected at least {LIMITS.fewest_turns}: "
                "the gyro is not calibrated",
            )
        )
        return None, left_out
    return cut_turns(gyro.t, gyro.values, drivers, spans), left_out


def _calibrate_gyro(
    recording: Recording,
    poses: Poses,
    scatter: PoseScatter,
    settings: ImuSettings,
    without: Collection[tuple[int, int]],
) -> tuple[GyroFit | None, list[Finding]]:
    """The gyro's fit, if it can be made, and findings about it."""
    if recording.gyro is None:
        text = "the record has no gyro: only the accelerometers are calibrated"
        return None, [Finding("gyro_missing", text)]
    findings = []
    if not poses.with_gyro:
        text = "the gyro is so restless in most holds that the poses were found by the accelerometers alone"
        findings.append(Finding("gyro_restless", text))
    drivers = drivers_of(recording, poses, settings)
    turns, skipped = _turns(recording, poses, drivers.at_samples, settings.exclude, without)
    findings += skipped
    if turns is None:
        return None, findings
    acc, means = poses.accelerometer, _gyro_means(recording, poses)
    if not np.isfinite(means).all():
        text = "the gyro has no numbers in some poses: it is not calibrated"
        return None, [*findings, Finding("gyro_missing", text)]
    scale, miss = first_guess(turns, acc.directions, means[0])
    start = TriadModel(np.full(3, scale), np.eye(3), means[0])
    error, earth = force_error(acc), earth_rate_at(settings.site)
    gyro = None
    if miss < LIMITS.first_guess_miss:
        gyro = fit_gyro(turns, means, acc.f, error, scatter.s, start, drivers, earth)
        miss = rms_miss(gyro)
    if gyro is None or not gyro.converged or miss > LIMITS.vertical_miss:
        text = (
            f"gyro and accelerometers contradict each other by {np.degrees(miss):.0f} deg rms after turns, and the "
            "gyro is not calibrated"
        )
        action = "check its signs and order of axes in the map"
        axes = axis_findings(turns, acc.directions, means[0])
        return None, [*findings, Finding("contradiction", text, harm=EVERYTHING, action=action), *axes]
    findings += gyro_findings(poses, drivers, means - gyro.by_earth, recording)
    return gyro, findings
