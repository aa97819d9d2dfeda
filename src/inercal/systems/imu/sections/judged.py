"""A fit of sections as its judge sees it: means of outputs, conditions of moves, and what is known beforehand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.judge import asked_of, blind, evidence_of, judge
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.inference.questions import JudgedFit, Question, StatedInput, questions
from inercal.systems.imu.sections.calibration import SectionCalibration, in_outputs
from inercal.systems.imu.sections.cutting.cut import ENDS
from inercal.systems.imu.sections.outputs import rows
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, K0, LOCAL, RATE, S

_CHANNELS = (*(f"acc_{axis}" for axis in "xyz"), *(f"gyro_{axis}" for axis in "xyz"))


def judged_sections(found: SectionCalibration) -> tuple[Finding, ...]:
    """Findings about all that the sections and moves show beside the coefficients, and about what they cannot show."""
    fit = fitted(found)
    try:
        of_fit = evidence_of(fit)
    except np.linalg.LinAlgError:
        return ()
    more = [*_of_physics(found, fit)]
    pairs = asked_of(of_fit, [*more, *questions(fit)])
    unseen = blind(fit.names, fit.u, of_fit, pairs) if of_fit.dof > 0 else ()
    # residuals of terms by what was known are smaller than noise, beside which noise would look like a fault
    told = found.freedom - len(found.by_prior)
    return (*(judge(fit, more=more) if told >= INFERENCE.fewest_degrees else ()), *unseen)


def _of_physics(found: SectionCalibration, fit: JudgedFit) -> Iterator[Question]:
    """Questions that name their cause: K2 beyond what was known of it, where |f| = g in unknown directions tells it; a
    bias of the gyro that drifts alike in all turns, which leaves S and T as they are."""
    readings, per_channel = found.problem.readings, fit.per_channel
    if "acc" in (name[:3] for name in fit.channels) and not readings.know_up.any():
        force = [
            (fit.predicted - found.point.x[K0]["xyz".index(name[-1])]) * per_channel[:, k]
            for k, name in enumerate(fit.channels)
            if name.startswith("acc")
        ]
        yield Question(
            "reading", "the accelerometers", True, "curve", "with the square of specific force",
            np.stack(force, axis=1) ** 2, "unmodelled_k2", "Set imu.k2 = true, or state their u.",
        )  # fmt: skip
    turns = {section.name for section in readings.sections if section.kind == "turn"}
    before, after = (
        np.array([s.name.endswith(end) and s.name.removesuffix(end) in turns for s in readings.sections])
        for end in ENDS
    )
    if before.any():
        of_section = after.astype(float) - before
        cell = fit.row // (1 + bool(readings.seen[:, 1].any()))
        share = np.where(fit.channel >= 0, of_section[np.minimum(cell, len(of_section) - 1)], 0.0)
        gyro = [k for k, name in enumerate(fit.channels) if name.startswith("gyro")]
        yield Question(
            "order", "the biases of the gyro", True, "drift", "alike in all turns, from before to after",
            share[:, None] * per_channel[:, gyro], "bias_drift", "Wait until the gyro is warm.",
        )  # fmt: skip


class _Dense(NamedTuple):
    """Rows that count: ``residual`` and ``variance`` (n,), derivatives ``by`` (n, p) by all unknowns, their ``block``
    and ``cell`` (n,), and the ``place`` (n,) in a cell."""

    residual: Array
    variance: Array
    by: Array
    block: NDArray[np.int64]
    cell: NDArray[np.int64]
    place: NDArray[np.int64]


def fitted(found: SectionCalibration) -> JudgedFit:
    """The fit. Unknowns with a prior are in the covariance; those without, and biases of sessions, whose scatter few
    sessions tell, are columns. Of coefficients that are by what was known before nothing is asked."""
    problem, point = found.problem, found.point
    z = np.log([found.scatter[name] for name in problem.sizes])
    dense = _dense(found, z)
    sd = np.where(problem.ruled >= 0, np.exp(np.append(z, 0.0))[problem.ruled], problem.sd)
    at = [COEFFICIENTS.index(name) for name in found.names if name not in found.by_prior]
    known = problem.free & np.isfinite(sd)
    known[at] = False
    known[problem.sessions_at : problem.sessions_at + 6 * len(problem.readings.sessions)] = False
    open_ = problem.free & ~known
    open_[at] = False
    by_known = dense.by[:, known] * sd[known]
    J, _ = in_outputs(found.names, point.x, point.x[[COEFFICIENTS.index(name) for name in found.names]])
    kept = [k for k, name in enumerate(found.names) if name not in found.by_prior]
    slope = J[np.ix_(kept, kept)]
    r = problem.readings
    means = dense.block == 0
    kind = np.where(means, dense.place // 3, -1)
    channel = np.where(means, dense.place % 3 + 3 * (kind == 2), -1)
    there = np.unique(channel[means])
    channel = np.where(means, np.searchsorted(there, channel), -1)
    y = np.zeros(len(dense.residual))
    y[means] = r.y.reshape(-1, 9)[dense.cell[means], dense.place[means]]
    twice = 1 + bool(np.any(kind == 1))
    ends = [extra.ends[0] for extra in problem.extras if hasattr(extra, "ends")]
    first = np.concatenate([np.zeros(0), *ends])
    time = dense.cell.astype(float)
    if len(first):
        time[~means] = first[dense.cell[~means]] + 0.5
    return JudgedFit(
        tuple(found.names[k] for k in kept),
        found.x[kept],
        found.u[kept],
        slope @ _gain(dense, problem.free, sd)[np.searchsorted(np.flatnonzero(problem.free), at)],
        dense.by[:, at] @ np.linalg.inv(slope),
        dense.by[:, open_],
        y,
        dense.residual - dense.by[:, known] @ (problem.mean - point.x)[known],
        np.diag(dense.variance) + by_known @ by_known.T,
        twice * dense.cell + (kind == 1),
        channel,
        time,
        tuple(_CHANNELS[k] for k in there),
        tuple(_inputs(found, dense)),
        0.0,
        *_files(found, dense),
    )


def _files(found: SectionCalibration, dense: _Dense) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """The file of each mean, -1 of a move, and the files by name where several hold some sections each."""
    of_section = [section.where.partition(", ")[0] for section in found.problem.readings.sections]
    files = tuple(sorted(set(of_section)))
    if len(files) < 2 or len(of_section) < 3 * len(files):
        return np.full(len(dense.cell), -1), ()
    number = np.array([files.index(name) for name in of_section])
    means = dense.block == 0
    return np.where(means, number[np.where(means, dense.cell, 0)], -1), files


def _dense(found: SectionCalibration, z: Array) -> _Dense:
    """The rows of all blocks."""
    problem = found.problem
    parts = []
    for number, block in enumerate(rows(problem, found.point)):
        count, k, _ = block.local.shape
        by = np.zeros((count, k, len(problem.sd)))
        by[:, :, : problem.shared] = block.shared
        for q in range(block.at.shape[1]):
            by[np.arange(count)[:, None], np.arange(k), block.at[:, q, None]] += block.local[:, :, q]
        variance = block.variance + sum(
            (
                np.exp(2.0 * of) * block.scatter.get(name, 0.0)
                for of, name in zip(z, problem.sizes, strict=True)
            ),
            np.zeros((count, k)),
        )
        cell, place = np.nonzero(block.seen)
        parts.append(
            _Dense(
                block.residual[cell, place],
                variance[cell, place],
                by[cell, place],
                np.full(len(cell), number),
                cell,
                place,
            )
        )
    return _Dense(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _gain(dense: _Dense, free: NDArray[np.bool_], sd: Array) -> Array:
    """Change (q, n) of the free unknowns by each row."""
    by = dense.by[:, free] / np.sqrt(dense.variance)[:, None]
    H = by.T @ by + np.diag(sd[free] ** -2.0)
    size = 1.0 / np.sqrt(np.where(np.diag(H) > 0.0, np.diag(H), 1.0))
    H = H * np.outer(size, size) + 1e-14 * np.eye(len(H))
    return np.asarray(size[:, None] * np.linalg.solve(H, size[:, None] * by.T) / np.sqrt(dense.variance))


def _inputs(found: SectionCalibration, dense: _Dense) -> list[StatedInput]:
    """Rates that are stated, where there are several."""
    problem = found.problem
    rate = problem.readings.rate[dense.cell] * (dense.block == 0) * (dense.place >= 6)
    if len(np.unique(rate[rate != 0.0])) < 2 or not np.any(problem.sd[S] > 0.0):
        return []
    slope = dense.by[np.arange(len(rate)), problem.shared + LOCAL * dense.cell + RATE]
    return [StatedInput("rate", rate, np.where(rate != 0.0, slope, 0.0))]
