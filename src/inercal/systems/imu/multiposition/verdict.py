"""Verdict of a calibration: its status in words, the pose that would cure a weak one, its findings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.inference.identifiability import WORST_BY_SIZE
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.places import counted
from inercal.foundation.results.shown import rounded
from inercal.systems.imu.identified import pose_words
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.multiposition.accelerometer import AccelerometerFit
from inercal.systems.imu.multiposition.drivers import Drivers
from inercal.systems.imu.multiposition.gyro import GyroFit, regress_static
from inercal.systems.imu.multiposition.joint import PoseScatter
from inercal.systems.imu.multiposition.poses import Poses
from inercal.systems.imu.recording import Recording, unit_words
from inercal.systems.imu.turns import Turns, first_guess


def curing_pose(fit: AccelerometerFit, gravity: float) -> Array:
    """The direction (3,) of specific force in b, a unit vector, that tells most of the weakest combination.

    One of the 26 along axes, edges and corners of a cube; ``gravity`` [m/s^2] is the size it would have there.
    """
    identified = fit.fit.identifiability
    weak = identified.directions[-1] / identified.scale
    grid = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
    grid /= np.linalg.norm(grid, axis=1, keepdims=True)
    there = AccelerometerFit(fit.model, fit.k2, gravity * grid, fit.fit)
    # residual |f| - g changes with the parameters as f does along its own direction
    gain = np.einsum("ni,nip,p->n", grid, there.force_sensitivity(), weak)
    return np.asarray(grid[np.argmax(np.abs(gain))])


def rms_miss(gyro: GyroFit) -> float:
    """Root-mean-square angle [rad] between the carried and the measured verticals."""
    return float(np.sqrt(np.mean(np.sum(gyro.miss**2, axis=1))))


def verdict(
    recording: Recording,
    poses: Poses,
    gyro: GyroFit | None,
    gravity: float,
    u: dict[str, float],
    findings: list[Finding],
) -> tuple[Status, str]:
    """Status and message; ``u`` are the standard uncertainties by name, ``findings`` the earlier ones."""
    acc = poses.accelerometer
    of_gyro = None if gyro is None else gyro.model
    for triad, model in ((recording.accelerometer, acc.model), (recording.gyro, of_gyro)):
        wrong = "" if triad is None or model is None else unit_words(triad, model)
        if wrong:
            return Status.INCONSISTENT, wrong
    identified = acc.fit.identifiability
    if identified.condition > WORST_BY_SIZE:
        term = identified.leading_term()
        value = float(acc.fit.x[identified.names.index(term)])
        number = " ± ".join(rounded(value, u[term])) + (" rad" if term.startswith("M_") else "")
        # poses that leave a null space never come so far: see `inercal.systems.imu.multiposition.poses`
        return (
            Status.ILL_CONDITIONED,
            f"the {len(poses.dwells)} poses hardly fix {term} ({number}; weak "
            f"combination {identified.weakest()}, condition {identified.condition:.0f}): add poses with the specific "
            f"force along {pose_words(curing_pose(acc, gravity))} and its opposite"
            f"{by_turns(recording, len(poses.dwells))}",
        )
    if gyro is None and recording.gyro is not None:
        contradictions = [finding.message for finding in findings if finding.code == "contradiction"]
        if contradictions:
            return Status.INCONSISTENT, contradictions[0]
        return (
            Status.TOO_FEW_INTERVALS,
            f"{len(u)} coefficients of the accelerometers from {len(poses.dwells)} poses; the gyro could not be "
            "calibrated: see the findings",
        )
    if gyro is None:
        return Status.OK, f"{len(u)} coefficients of the accelerometers from {len(poses.dwells)} poses"
    identified = gyro.geometry
    if identified.condition > WORST_BY_SIZE:
        term = identified.leading_term()
        return (
            Status.UNOBSERVABLE if identified.rank < len(identified.names) else Status.ILL_CONDITIONED,
            f"the {len(gyro.miss)} turns hardly fix {term} (weak combination {identified.weakest()}, condition "
            f"{identified.condition:.0f}): add turns of 90 deg and more about every axis, each held horizontal",
        )
    return Status.OK, (
        f"{len(u)} coefficients from {len(poses.dwells)} poses and {len(gyro.miss)} turns; condition "
        f"{acc.fit.identifiability.condition:.1f} (accelerometers), {identified.condition:.1f} (gyro)"
    )


def by_turns(recording: Recording, rests: int) -> str:
    """The other method, where a recording is fit for it: between rests in few poses the turns tell of the
    accelerometers what poses by themselves do not."""
    fit = (
        recording.gyro is not None
        and recording.accelerometer.rate >= LIMITS.rate_for_turns
        and rests >= LIMITS.rests_for_turns
    )
    return (
        "; or take `inercal calibrate strapdown`, which uses every sample of the turns between the rests"
        if fit
        else ""
    )


def scatter_findings(poses: Poses, scatter: PoseScatter) -> Iterator[Finding]:
    """Findings about the fit of the poses."""
    dof = poses.accelerometer.fit.dof
    if dof < 5:
        yield Finding(
            "few_degrees_of_freedom",
            f"{len(poses.dwells)} poses leave {counted(dof, 'degree')} of freedom for {len(poses.accelerometer.fit.x)} "
            "parameters, so that u itself is uncertain.",
            action="Record more poses.",
        )
    if scatter.excess:
        yield Finding(
            "excess_scatter",
            f"|f| scatters by {scatter.s:.2g} m/s^2 from pose to pose, {scatter.over_noise:.1f} times the noise at "
            "rest, and u has that.",
            harm=(),
            action="Hold the instrument stiller, or let the model have more terms, such as imu.k2.",
        )


def clipped_poses(poses: Poses, scatter: PoseScatter, recording: Recording) -> Iterator[Finding]:
    """Accelerometers that sit at the end of their range in a pose, so that its mean is short."""
    if not scatter.excess:
        return
    triad, short = recording.accelerometer, list[int]()
    for values in triad.values.T:
        at_end = at_ends(values).astype(np.float64)
        parts = [dwell.of(at_end).mean() for dwell in poses.dwells]
        short += [
            number for number, part in zip(poses.numbers, parts, strict=True) if part > LIMITS.clipped_part
        ]
    if short:
        words = ", ".join(map(str, sorted(set(short))))
        yield Finding(
            "saturation",
            f"accelerometers sit at the end of their range in poses {words}, whose means are short",
            harm=EVERYTHING,
            action="leave them out (imu.exclude), or record once more with a wider range",
        )


def gyro_findings(poses: Poses, drivers: Drivers, means: Array, recording: Recording) -> Iterator[Finding]:
    """Findings about the gyro's output at rest: its steps, drift with time, change with the pose.

    ``means`` (n, 3) are the mean outputs in the poses, less what earth rate makes; what the fit has as a driver is
    not looked for again.
    """
    assert recording.gyro is not None
    unit, resolution = recording.gyro.unit.symbol, recording.resolution["gyro"]
    if np.any(resolution > 0):
        words = ", ".join(
            f"{axis} {step:.3g}" for axis, step in zip("xyz", resolution, strict=True) if step > 0
        )
        yield Finding(
            "resolution",
            f"the noise of the gyro at rest is below half a step of its output ({words} {unit}), so that averaging "
            "does not help: D_F is no better known than step/sqrt(12)",
        )
        return
    if "D_R_x" not in drivers.names:
        p, fitted = _f_test(means, drivers.at_rest, poses.times[:, None])
        if np.any(drifting := p < LIMITS.driver_probability):
            total = fitted[-1] * np.ptp(poses.times)
            words = ", ".join(f"{axis} {d:+.3g}" for axis, d in zip("xyz", total, strict=True))
            yield Finding(
                "bias_drift",
                f"the gyro bias drifts over the recording by {words} {unit}, and D_F is its mean",
                harm=_of_axes(drifting),
                action="set imu.bias_drift = true to estimate the drift",
            )
    f = poses.accelerometer.f
    if "G_xx" in drivers.names or len(f) < 8:
        return
    p, fitted = _f_test(means, drivers.at_rest, f)
    if np.any(leaning := p < LIMITS.driver_probability):
        size = float(np.max(np.linalg.norm(fitted[-3:], axis=0)) * np.mean(np.linalg.norm(f, axis=1)))
        yield Finding(
            "g_sensitivity",
            f"the gyro output at rest changes with the pose by up to {size:.3g} {unit} per g",
            harm=_of_axes(leaning),
            action="set imu.g_sensitivity = true to estimate it",
        )


def axis_findings(turns: Turns, verticals: Array, bias: Array) -> Iterator[Finding]:
    """A finding where other signs or another order of the gyro's axes would make sense of the turns."""
    tried = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            axes = np.zeros((3, 3))
            axes[range(3), order] = signs
            tried.append((first_guess(turns, verticals, bias, axes)[1], order, signs))
    miss, order, signs = min(tried)
    if miss > LIMITS.vertical_miss or (order == (0, 1, 2) and min(signs) > 0):
        return
    measured = ", ".join(
        f"gyro_{name} seems to measure {'+' if sign > 0 else '-'}{'xyz'[axis]}"
        for name, axis, sign in zip("xyz", order, signs, strict=True)
    )
    code = "sign_suspect" if order == (0, 1, 2) else "channel_swap"
    yield Finding(
        code,
        f"against the accelerometers {measured}",
        harm=EVERYTHING,
        action="check the order and signs in the map",
    )


def _of_axes(axes: NDArray[np.bool_]) -> tuple[str, ...]:
    """Coefficients of those gyro ``axes`` (3,) whose bias is not one: turns are integrated with it."""
    return tuple(
        name
        for i, other in zip("xyz", axes, strict=True)
        if other
        for name in (f"D_F_{i}", f"S_{i}", *(f"T_{i}{j}" for j in "xyz" if j != i))
    )


def _f_test(means: Array, base: Array, more: Array) -> tuple[Array, Array]:
    """Probability (3,) that further regressors help an axis by chance alone, of three; their coefficients."""
    from scipy.special import fdtrc

    small, large = regress_static(means, base), regress_static(means, np.hstack([base, more]))
    if large.dof < 3:
        return np.ones(3), large.coefficients
    rest = np.sum(large.residuals**2, axis=0)
    gained = np.sum(small.residuals**2, axis=0) - rest
    k = more.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(rest > 0, (gained / k) / (rest / large.dof), 0.0)
    return np.minimum(1.0, 3.0 * fdtrc(k, large.dof, ratio)), large.coefficients
