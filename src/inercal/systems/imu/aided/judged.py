"""A fit of an IMU on a table as its judge sees it: sensors are channels, the angles of the joints are inputs.

Faults that are named by their patterns are fitted beside the unknowns; what the judge finds is what is still there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.evidence import FitEvidence
from inercal.foundation.inference.judge import answers, asked_of, blind
from inercal.foundation.inference.questions import JudgedFit, Question, StatedInput, questions
from inercal.systems.imu.aided.diagnosis.examination import Misfit
from inercal.systems.imu.aided.diagnosis.fit_quality import whitened
from inercal.systems.imu.aided.diagnosis.small import STEP, at_fit, gain, seen
from inercal.systems.imu.aided.fit import AidedFit
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.limits import LIMITS

_LETTERS = {"acc": ("K0", "K1", "M"), "gyro": ("D_F", "S", "T")}


def judged_table(
    fit: AidedFit,
    names: tuple[str, ...],
    values: Array,
    u: Array,
    slope: Array,
    motion: TableMotion,
    gravity: float,
    named: Sequence[Misfit],
) -> Iterator[Finding]:
    """Findings about all that the outputs show beside the unknowns and the faults that were ``named``.

    ``slope`` (p, P) is of the values ``names`` (p,) by the unknowns of the fit, ``u`` (p,) theirs.
    """
    kept = [k for k, name in enumerate(names) if u[k] > 0.0]
    case = _case(fit, tuple(names[k] for k in kept), values[kept], u[kept], motion, gravity)
    try:
        of_fit, table = _evidence(fit, case, slope[kept], named)
    except np.linalg.LinAlgError:
        return
    if of_fit.dof < LIMITS.fewest_blocks:
        return
    pairs = asked_of(of_fit, table)
    yield from answers(case.names, case.u, of_fit, pairs)
    yield from blind(case.names, case.u, of_fit, pairs)


def _case(
    fit: AidedFit, names: tuple[str, ...], values: Array, u: Array, motion: TableMotion, gravity: float
) -> JudgedFit:
    """All blocks of all sensors, one sensor after the other; biases wander in the noise."""
    counts = [len(sensor.residual) for sensor in fit.sensors]
    channel = np.repeat(np.arange(len(counts)), counts)
    variance = [
        sensor.noise.white(sensor.side.blocks.length, sensor.side.blocks.resting) for sensor in fit.sensors
    ]
    y = [sensor.side.blocks.y[:, k % 3] for k, sensor in enumerate(fit.sensors)]
    return JudgedFit(
        names,
        values,
        u,
        np.zeros((len(names), 0)),
        _by_value(fit, names),
        np.zeros((len(channel), 0)),
        np.concatenate(y),
        np.concatenate([sensor.residual for sensor in fit.sensors]),
        np.concatenate(variance),
        np.concatenate([np.arange(count) for count in counts]),
        channel,
        np.concatenate([sensor.side.blocks.middle for sensor in fit.sensors]),
        tuple(f"{sensor.side.sensor}_{'xyz'[k % 3]}" for k, sensor in enumerate(fit.sensors)),
        tuple(_joints(fit, motion, gravity)),
        0.0,
    )


def _by_value(fit: AidedFit, names: tuple[str, ...]) -> Array:
    """Change (n, p) of the outputs by the biases, scale factors and misalignments among the values."""
    made = np.zeros((sum(len(sensor.residual) for sensor in fit.sensors), len(names)))
    begin = 0
    for k, sensor in enumerate(fit.sensors):
        rows, i = slice(begin, begin + len(sensor.residual)), k % 3
        begin = rows.stop
        bias, scale, cross = _LETTERS[sensor.side.sensor]
        B = gain(fit, sensor.side.sensor)[i]
        true = sensor.equation.columns[:, :3]
        by_name = {f"{bias}_{'xyz'[i]}": np.ones(len(true)), f"{scale}_{'xyz'[i]}": true @ B / B[i]}
        by_name |= {f"{cross}_{'xyz'[i]}{'xyz'[j]}": B[i] * true[:, j] for j in range(3) if j != i}
        for name, column in by_name.items():
            if name in names:
                made[rows, names.index(name)] = column
    return made


def _joints(fit: AidedFit, motion: TableMotion, gravity: float) -> Iterator[StatedInput]:
    """The joints that move, as inputs."""
    now = {triad: at_fit(fit, motion, triad) for triad in fit.identified}
    for k, name in enumerate(motion.chain.joints):
        if not np.ptp(motion.angles[:, k]):
            continue
        angles = motion.angles.copy()
        angles[:, k] += STEP
        moved = replace(motion, angles=angles)
        changes = {triad: ((at_fit(fit, moved, triad) - x) / STEP)[:, :, None] for triad, x in now.items()}
        patterns = seen(fit, changes, gravity)
        at = [motion.at(sensor.side.blocks.middle)[:, k] for sensor in fit.sensors]
        slopes = [patterns[number][:, 0] for number in range(len(fit.sensors))]
        yield StatedInput(name, np.concatenate(at), np.concatenate(slopes), 2.0 * np.pi)


def _evidence(
    fit: AidedFit, case: JudgedFit, slope: Array, named: Sequence[Misfit]
) -> tuple[FitEvidence, list[Question]]:
    """The evidence of a fit and all that is asked of it; the levels of noise count as known but for a factor.

    Of a column that is asked a part is taken for a bias: it shifts its mean without any unknown.
    """
    table = [*_terms(fit, case), *questions(case)]
    whole = np.hstack([question.columns for question in table])
    P, m = len(fit.x), len(named)
    sd, begin = fit.unknowns.sd, 0
    rows, direct = [], np.zeros((len(case.names), whole.shape[1]))
    for k, sensor in enumerate(fit.sensors):
        part = slice(begin, begin + len(sensor.residual))
        begin = part.stop
        index = sensor.equation.index
        own = whole[part]
        there = np.flatnonzero(own.any(axis=0))
        faults = np.column_stack([np.zeros((len(own), 0)), *(fault.patterns[k] for fault in named)])
        done = whitened(
            sensor,
            np.hstack([sensor.equation.columns * sd[index], faults, own[:, there], sensor.residual[:, None]]),
        )
        short = _summed(done.rows[1:])
        wide = np.zeros((len(short), P + m + whole.shape[1] + 1))
        wide[:, [*index, *range(P, P + m), *(P + m + there), -1]] = short
        rows.append(wide)
        bias = f"{_LETTERS[sensor.side.sensor][0]}_{'xyz'[k % 3]}"
        if bias in case.names:
            direct[case.names.index(bias), there] = done.mean[len(index) + m : -1]
    A = np.vstack([np.eye(P, P + m), *(part[:, : P + m] for part in rows)])
    X = np.vstack([np.zeros((P, whole.shape[1])), *(part[:, P + m : -1] for part in rows)])
    z = np.concatenate([(fit.unknowns.mean - fit.x) / sd, *(part[:, -1] for part in rows)])
    Q, R = np.linalg.qr(A)
    gain = np.hstack([slope * sd, np.zeros((len(slope), m))]) @ np.linalg.solve(R, Q.T)
    of_fit = FitEvidence(z - Q @ (Q.T @ z), None, Q, np.hstack([gain, np.eye(len(direct))]), 0.0)
    ends = np.cumsum([question.columns.shape[1] for question in table])
    parts = np.split(np.vstack([X, direct]), ends[:-1], axis=1)
    return of_fit, [replace(question, columns=part) for question, part in zip(table, parts, strict=True)]


def _terms(fit: AidedFit, case: JudgedFit) -> Iterator[Question]:
    """Terms that the study leaves out, and another earth rate."""
    force = case.predicted[:, None] * case.per_channel
    if "gain K2" not in fit.unknowns.places:
        yield Question(
            "reading", "the accelerometers", True, "curve", "with the square of specific force", force[:, :3] ** 2,
            "unmodelled_k2", "Set imu.k2 = true to estimate it.",
        )  # fmt: skip
    if "gyro" not in fit.identified:
        return
    C_bn = fit.references["gyro"].C_bn
    patterns = seen(fit, {"gyro": C_bn}, 1.0)
    earth = np.vstack([patterns.get(k, np.zeros((len(s.residual), 3))) for k, s in enumerate(fit.sensors)])
    yield Question(
        "place", "earth rate", False, "differ", "from what is stated", earth,
        "site_suspect", "Check the latitude, and the azimuth of the table.",
    )  # fmt: skip
    if "gain G" not in fit.unknowns.places:
        up = C_bn[:, :, 2]
        columns = np.zeros((len(case.time), 9))
        for k in range(3):
            columns[np.ix_(case.channel == 3 + k, [3 * k, 3 * k + 1, 3 * k + 2])] = up
        yield Question(
            "place", "the gyro output", False, "change", "with specific force", columns,
            "g_sensitivity", "Set imu.g_sensitivity = true to estimate it.",
        )  # fmt: skip


def _summed(rows: Array) -> Array:
    """White rows (n, c), of a long record sums of some over the root of their number, which are white, too."""
    several = -(-len(rows) // LIMITS.judged_rows)
    whole = len(rows) // several * several
    return np.asarray(rows[:whole].reshape(-1, several, rows.shape[1]).sum(axis=1) / np.sqrt(several))
