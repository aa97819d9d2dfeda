"""A gyro alone, from a turn by a known angle about each axis: sections or files in, an estimate out.

The integral of the output over a turn, less the bias, is the column of the gain that belongs to its axis, times the
angle: y = S T omega + b. Nine equations give the nine terms of S and T, the rests the bias.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.instruments.terms import GYRO_TRIAD, TERMS
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.noise.dwell_means import AllanFit
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.known_turns.turn import RestToRestTurn, find_turn, noise_at_rest, stamped
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import clipped_rows, unit_words
from inercal.systems.imu.settings import COMMAND, ImuSettings, KnownTurnsSettings

MODEL = Formula(
    r"$y = S T \omega + b$, $S = \mathrm{diag}(S)$, $T = 1$ + misalignment (full; $T_{ij}$: response of gyro $i$ to "
    "rate about $j$), $b = D_F$. Frame: its axes x, y, z those of the three turns, taken as square to each other; "
    "turns positive about the positive axis by the right-hand rule."
)

FRAME = "b, of the instrument: its axes those of the three turns"

REFERENCES = (
    "F. Ferraris, U. Grimaldi, M. Parvis, Procedure for effortless in-field calibration of three-axial rate gyro and "
    "accelerometers, Sensors and Materials 7 (1995) 311-330",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
)


@short_repr
@dataclass(frozen=True)
class KnownTurnsCalibration:
    """An ``estimate``, and the ``turns`` behind it by axis, as far as they were found."""

    estimate: Estimate
    turns: Mapping[str, RestToRestTurn]


def calibrate_known_turns(
    records: Sequence[Record],
    settings: ImuSettings,
    options: KnownTurnsSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> KnownTurnsCalibration:
    """Calibrate a gyro by turns by known angles about each axis.

    Parameters
    ----------
    records : sequence of Record
        ``gyro_x..z`` in any unit: one record for each turn, in the order x, y, z, or one with labels ``x``, ``y``,
        ``z`` (or ``x_rot``, ``y_rot``, ``z_rot``), each from rest to rest.
    settings : ImuSettings
        Clock and what goes with the result.
    options : KnownTurnsSettings
        The angles, and how well the axes are square.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    KnownTurnsCalibration
        Its estimate holds D_F, S and all six T; the status says whether they can be used.

    Raises
    ------
    InputError
        No gyro triad, or no turn for each axis.
    """
    clock = time.perf_counter()
    progress("finding the turns")
    sections = _sections(records)
    triad = records[0].triad("gyro")
    sources = tuple(dict.fromkeys(source for record in records for source in record.sources))
    angles = np.array(options.angles)
    turns, problems = {}, []
    for axis, (t, values) in sections.items():
        turn = find_turn(t, values)
        if isinstance(turn, str):
            problems.append(f"the section of the turn about {axis} {turn}")
        else:
            turns[axis] = turn
    rates = [float(abs(angle) / turn.duration) for angle, turn in zip(angles, turns.values(), strict=False)]
    ranges = {"rate_of_turn_rad_s": [-max(rates, default=0.0), max(rates, default=0.0)]}
    conditions = conditions_of(settings, recorded_temperature(records[0]), ranges, frame=FRAME)
    basis = studied(COMMAND, settings, sources, MODEL, REFERENCES, conditions)
    of_records = tuple(dict.fromkeys(finding for record in records for finding in record.findings))
    if problems:
        estimate = Estimate.without(
            basis,
            Status.TOO_FEW_INTERVALS,
            "; ".join(problems),
            findings=of_records,
            result={"method": "known_turns", "turns": []},
        )
        return KnownTurnsCalibration(timed(estimate, clock), turns)
    three = list(turns.values())
    gain = np.stack(
        [
            (turn.integral - turn.duration * turn.bias) / angle
            for turn, angle in zip(three, angles, strict=True)
        ],
        axis=1,
    )
    scale = np.diag(gain).copy()
    bias = np.mean([turn.bias for turn in three], axis=0)
    findings = [*of_records, *_axes(gain), *_saturated(records), *_exact(options, angles)]
    usable = bool(np.all(np.abs(scale) > LIMITS.faint_response * np.max(np.abs(gain), axis=0)))
    if not usable:
        text = "the turns are not each mainly about their own axis: see the findings, and check order, signs and files"
        estimate = Estimate.without(
            basis, Status.INCONSISTENT, text, findings=findings, result=_result(turns, angles, gain, triad)
        )
        return KnownTurnsCalibration(timed(estimate, clock), turns)
    misalignment = gain / scale[:, None]
    values = np.concatenate([bias, scale, [misalignment[i, j] for i in range(3) for j in range(3) if i != j]])
    noise = noise_at_rest(three)
    drift, wander, dof = _wander(three, noise)
    uncertainty = combine(
        GYRO_TRIAD, _sources(three, noise, angles, options, settings, gain, wander, dof, triad.unit.symbol)
    )
    findings += drift
    wrong = unit_words(triad, TriadModel(np.abs(scale), misalignment, bias))
    text = f"{len(GYRO_TRIAD)} coefficients of the gyro from a turn about each axis"
    estimate = Estimate.of(
        basis,
        GYRO_TRIAD,
        [TERMS[name].unit_for(triad.unit.symbol) for name in GYRO_TRIAD],
        values,
        uncertainty,
        (Status.INCONSISTENT, wrong) if wrong else (Status.OK, text),
        findings=findings,
        statistics={"turns": 3.0, "dof": dof},
        result=_result(turns, angles, gain, triad),
    )
    return KnownTurnsCalibration(timed(estimate, clock), turns)


def _sections(records: Sequence[Record]) -> dict[str, tuple[Array, Array]]:
    """Times and outputs of the turn about each axis: a record for each, or by the labels of one."""
    if len(records) == 3:
        units = {record.triad("gyro").unit for record in records}
        if len(units) > 1:
            raise RecordError(
                "records", f"found gyros in {', '.join(unit.symbol for unit in units)}, expected one unit"
            )
        return {axis: stamped(record.triad("gyro")) for axis, record in zip("xyz", records, strict=True)}
    if len(records) != 1:
        raise StudyError(
            "imu.turns",
            f"found {len(records)} files for three turns, expected three, about x, y and z, or one with labels",
        )
    (record,) = records
    labels = np.array([label.strip().lower().removesuffix("_rot") for label in record.labels])
    triad = record.triad("gyro")
    if not all(np.any(labels == axis) for axis in "xyz"):
        raise RecordError(
            triad.source.path,
            "found one file without the labels x, y and z, expected a file for each turn, about "
            "x, y and z in this order, "
            "or a column of labels",
        )
    sections = {}
    for axis in "xyz":
        rows = labels == axis
        whole = rows & np.isfinite(triad.t) & np.isfinite(triad.values).all(axis=1)
        sections[axis] = (triad.t[whole], triad.values[whole])
    return sections


def _axes(gain: Array) -> list[Finding]:
    """Findings about turns that are mainly about another axis, or against the sense that is stated."""
    findings = []
    for j, axis in enumerate("xyz"):
        column = gain[:, j]
        leading = int(np.argmax(np.abs(column)))
        if leading != j:
            text = (
                f"in the turn about {axis} gyro_{'xyz'[leading]} turns most: check the order of the "
                "files and of the axes in the map"
            )
            findings.append(Finding("channel_swap", text, harm=EVERYTHING))
        elif column[j] < 0.0:
            text = (
                f"gyro_{axis} turns against the stated sense: check the sign of the angle (positive "
                "by the right-hand rule) and of the axis in the map"
            )
            findings.append(Finding("sign_suspect", text, harm=EVERYTHING))
    return findings


def _saturated(records: Sequence[Record]) -> list[Finding]:
    """A finding where the gyro saturates in a turn."""
    clipped = [
        record.triad("gyro").source.path for record in records if clipped_rows(record.triad("gyro")).any()
    ]
    text = f"the gyro saturates in {', '.join(clipped)}: its angle is short of the turn, turn more slowly"
    return [Finding("saturation", text, harm=EVERYTHING)] if clipped else []


def _exact(options: KnownTurnsSettings, angles: Array) -> list[Finding]:
    """Findings about what was stated without an uncertainty."""
    findings = []
    if not all(options.angles_u):
        axes = ", ".join(axis for axis, u in zip("xyz", options.angles_u, strict=True) if not u)
        text = f'the angles of the turns about {axes} are taken as exact: state them as in "361.338(5) deg"'
        findings.append(Finding("stated_exact", text))
    if options.alignment is None:
        text = (
            "the axes of the turns are taken as exactly square to each other, and T is too sure "
            "by what they are not: state "
            'imu.alignment, such as "0.1 deg"'
        )
        findings.append(Finding("stated_exact", text))
    return findings


def _wander(turns: Sequence[RestToRestTurn], noise: AllanFit) -> tuple[list[Finding], Array, float]:
    """A finding about biases that drift from rest to rest; the variance (3,) of a rest beyond its noise; its dof."""
    differences = np.array([turn.after - turn.before for turn in turns])
    expected = np.array([noise.variance(turn.rests).sum(axis=0) for turn in turns])
    wander = np.maximum(np.mean(differences**2 - expected, axis=0) / 2.0, 0.0)
    shift = np.abs(differences) * np.array([turn.duration for turn in turns])[:, None]
    total = np.array([np.linalg.norm(turn.integral - turn.duration * turn.bias) for turn in turns])
    worst = float(np.max(shift / total[:, None]))
    if worst < LIMITS.slight_turn_difference:
        return [], wander, 3.0
    text = (
        f"the output at rest differs before and after a turn by {100.0 * worst:.2g} % of the "
        "turn: the bias in the turn "
        "is taken from a straight line, and u allows for as much; wait until the gyro is warm"
    )
    return [Finding("bias_drift", text, harm=())], wander, 3.0


def _sources(
    turns: Sequence[RestToRestTurn],
    noise: AllanFit,
    angles: Array,
    options: KnownTurnsSettings,
    settings: ImuSettings,
    gain: Array,
    wander: Array,
    dof: float,
    unit: str,
) -> list[TypeA | TypeB]:
    """Uncertainties of the twelve coefficients, by way of the columns of the gain and of the biases."""
    by_gain = _by_gain(gain)
    by_noise, drifted = np.zeros((12, 12)), np.zeros((12, 12))
    for j, (turn, angle) in enumerate(zip(turns, angles, strict=True)):
        T = turn.duration
        in_turn = noise.variance(np.array([T]))[0]
        at_rest = noise.variance(turn.rests)
        for i in range(3):
            to_rest = -T / angle * by_gain[:, i, j]
            to_rest[i] += 1.0 / 3.0
            own = np.outer(by_gain[:, i, j], by_gain[:, i, j]) * (T / angle) ** 2
            rests = np.outer(to_rest, to_rest)
            by_noise += own * in_turn[i] + rests * float(turn.weights**2 @ at_rest[:, i])
            drifted += own * wander[i] + rests * float(turn.weights @ turn.weights) * wander[i]
    between = np.var([turn.bias for turn in turns], axis=0, ddof=1) / 3.0
    to_bias = np.zeros((12, 12))
    to_bias[range(3), range(3)] = np.maximum(between - np.diag(by_noise + drifted)[:3], 0.0)
    typical = float(np.sqrt(np.mean([noise.variance(turn.rests) for turn in turns])))
    sources: list[TypeA | TypeB] = [
        TypeA("gyro noise", typical, unit, by_noise, noise.dof(max(turn.duration for turn in turns))),
        TypeA("drift from rest to rest", float(np.sqrt(np.max(wander))), unit, drifted, dof),
        TypeA("bias from turn to turn", float(np.sqrt(np.max(between))), unit, to_bias, 2.0),
    ]
    for j, u in enumerate(options.angles_u):
        if u > 0.0:
            sources.append(
                TypeB(
                    f"angle of the turn about {'xyz'[j]}",
                    u,
                    "rad",
                    -by_gain[:, :, j] @ gain[:, j] / angles[j],
                )
            )
    if options.alignment:
        sources.append(
            TypeB(
                "alignment of the turns",
                options.alignment,
                "rad",
                _alignment(gain, by_gain, options.alignment),
                redrawn=True,
            )
        )
    if settings.time_base_u > 0.0:
        scaled = np.concatenate([np.zeros(3), np.diag(gain), np.zeros(6)])
        sources.append(TypeB("time base", settings.time_base_u, "1", scaled))
    # the rest tells what earth rate makes there; a turn of the instrument takes it elsewhere
    earth = [
        by_gain[:, :, j] @ gain[:, k] * turn.duration / angle
        for j, (turn, angle) in enumerate(zip(turns, angles, strict=True))
        for k in range(3)
    ]
    sources.append(
        TypeB(
            "earth rate",
            EARTH_RATE / math.sqrt(3.0),
            "rad/s",
            np.stack([*earth, *(np.eye(12)[:3].T @ gain).T], axis=1),
            redrawn=True,
        )
    )
    return sources


def _by_gain(gain: Array) -> Array:
    """(12, 3, 3): derivative of the coefficients with respect to the gain S T; that of the biases is 0."""
    scale = np.diag(gain)
    out = np.zeros((12, 3, 3))
    out[3 + np.arange(3), range(3), range(3)] = 1.0
    for row, (i, j) in enumerate(((i, j) for i in range(3) for j in range(3) if i != j), 6):
        out[row, i, j] = 1.0 / scale[i]
        out[row, i, i] = -gain[i, j] / scale[i] ** 2
    return out


def _alignment(gain: Array, by_gain: Array, tilt: float) -> Array:
    """(12, q): changes of the coefficients by a unit tilt of each axis in either direction.

    A tilt of the axis of turn j by d takes column j to S T (e_j + d), short along the axis by d^2 / 2: the mean of
    these over both directions, d^2, and its standard deviation, the same, count as uncertainties (GUM F.2.4.5).
    """
    first, second = [], []
    for j in range(3):
        first += [by_gain[:, :, j] @ gain[:, k] for k in range(3) if k != j]
        second.append(-by_gain[:, :, j] @ gain[:, j])
    return np.column_stack([*first, tilt * np.sum(second, axis=0), *(tilt * each for each in second)])


def _result(
    turns: Mapping[str, RestToRestTurn], angles: Array, gain: Array, triad: Triad
) -> dict[str, object]:
    """The command's own part of the result: a row for each turn."""
    return {
        "method": "known_turns",
        "turns": [
            {
                "axis": axis,
                "begin_s": turn.begin,
                "end_s": turn.end,
                "angle_rad": float(angle),
                "integral": turn.integral - turn.duration * turn.bias,
                "rest_before": turn.before,
                "rest_after": turn.after,
            }
            for (axis, turn), angle in zip(turns.items(), angles, strict=True)
        ],
        "gain": gain,
        "unit": {"gyro": triad.unit.symbol},
    }
