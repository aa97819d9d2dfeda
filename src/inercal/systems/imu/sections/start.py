"""First guess of a calibration from sections: gains by what is known, else by the range of the outputs."""

from __future__ import annotations

import numpy as np

from inercal.systems.imu.sections.problem import Iterate, Problem
from inercal.systems.imu.sections.unknowns import D_F, K0, K1, S, level_axes


def first_guess(problem: Problem) -> Iterate:
    """Coefficients and the directions that are not known. A gain that outputs and directions do not tell is typical of
    the instrument; the sign of a gain is that of the known directions."""
    r, priors = problem.readings, problem.priors
    n, x = len(r.sections), problem.mean.copy()
    up, axis = r.up.copy(), r.axis.copy()
    still = r.rate == 0.0
    gravity = np.where(r.forced, r.force, priors.site.gravity)
    for kind, bias, gain, base, told, size, scale in (
        (0, K0, K1, up, r.know_up, gravity, priors.acc_scale),
        (2, D_F, S, axis, r.know_axis | still, r.rate, priors.gyro_scale),
    ):
        seen = np.isfinite(r.y[:, kind]) & (r.seen[:, kind] | r.led[:, None])
        used = np.flatnonzero(seen.any(axis=1))
        x[gain], x[bias] = 1.0 if scale is None else scale.median, 0.0
        if not len(used):
            continue
        there = r.channels[kind // 2]
        y = np.where(seen[used], r.y[used, kind], 0.0)
        full = max(float(np.abs(size[used]).max()), 1e-12)
        inputs = (size[:, None] * base)[used] / full
        span = max(0.5 * float(np.ptp(y, axis=0).max()), 1e-12)
        typical = scale.median * full if scale is not None else span
        directed = told[used]
        if directed.sum() >= 2 and np.ptp(inputs[directed], axis=0).max() > 0.0:
            A = np.column_stack([np.ones(directed.sum()), inputs[directed]])
            ridge = np.diag([1e-12, 1.0, 1.0, 1.0]) * 1e-4 * len(A)
            B = np.linalg.solve(A.T @ A + ridge, A.T @ y[directed])
            own = np.diag(B[1:])
            x[bias], x[gain] = B[0], np.where(np.abs(own) > 0.2 * abs(typical), own, typical) / full
        else:
            rest = still[used] if kind == 2 else np.zeros(len(used), dtype=bool)
            x[bias] = y[rest].mean(axis=0) if rest.any() else 0.5 * (y.min(axis=0) + y.max(axis=0))
            moving = kind == 0 or not rest.all()
            by_range = np.maximum(0.5 * np.ptp(y, axis=0), 0.3 * span)
            # poses need not reach both ends of an axis: a gain that the unit tells is better known
            near = scale is not None and np.all(by_range < 1.5 * abs(typical))
            x[gain] = (by_range if moving and not near else typical) / full
        fitted = there & (
            problem.sd[gain] > 0.0
        )  # no range of outputs tells the scale of a gyro that never turned
        x[gain], x[bias] = np.where(fitted, x[gain], problem.mean[gain]), np.where(there, x[bias], 0.0)
        way = (y - x[bias]) / x[gain] * np.where(size[used] < 0.0, -1.0, 1.0)[:, None]
        size_of = np.linalg.norm(way, axis=1, keepdims=True)
        way = np.where(size_of > 0.0, way / np.where(size_of > 0.0, size_of, 1.0), [0.0, 0.0, 1.0])
        if kind == 0:
            lost = ~told[used] & ~r.tied[used]
            felt = np.sum(way * axis[used], axis=1) * (r.tied & ~r.forced)[used]
            for k, sign in zip(used, np.sign(felt), strict=True):  # which end of a level axis is up
                if sign and r.sections[k].up is None:
                    up[k] = sign * axis[k]
        else:
            lost = ~told[used]
        base[used[lost]] = way[lost]
    for base, unknown in ((up, ~r.know_up & ~r.tied), (axis, ~r.know_axis)):
        base[unknown] = base[r.leader[unknown]]
    unsaid = r.tied & ~r.know_axis & ~r.forced
    up[unsaid] = axis[unsaid] * np.where(np.sum(up * axis, axis=1) < 0.0, -1.0, 1.0)[unsaid, None]
    return Iterate(x, up, axis, level_axes(up), np.zeros((n, 2)), np.zeros((n, 2)))
