"""Gross faults of a recording or its study: signs, units and order of rates, angles and accelerometers; another path.

Before anything is filtered they are seen roughly, to some per cent: the coefficients are a hundred times smaller.
Whole recordings are compared, so that single bad stretches stay with the tests of the innovations. Each other sign or
order is a hypothesis, and the first with which two sensors agree is named.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.geometry.rotations import (
    Axis,
    attitude_difference,
    boxminus,
    conjugate,
    log,
    multiply,
    rotate,
)
from inercal.foundation.inference.hypotheses import Hypothesis, tried
from inercal.foundation.records.checks.values import saturated
from inercal.systems.selfcal.diagnosis.rows import GrossFault
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.plan import PlatformPlan
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS, Gimbals, World
from inercal.systems.selfcal.settings import SelfcalSettings

#: ratio of rates to angles -> units that look exchanged
_EXCHANGED = {
    180.0 / math.pi: "degrees and radians",
    60.0: "per second and per minute, or minutes of arc and degrees",
    3600.0: "per second and per hour, or seconds of arc and degrees",
    3600.0 * 180.0 / math.pi: "deg/h and rad/s",
    1000.0: "thousandths and wholes",
}


_CHUNK = 1 << 16
"""Rows whose joints are held at once."""


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Motion in each of m steps between rows whose angles are known: ``th`` (m + 1, 3) [rad] at the rows, ``dt`` (m,)
    [s] between them, ``rate`` (m, 3) [rad] the turns against inertial space, in p, by the rates; the ``stretch`` (m,)
    of each step; ``recorded`` (m,) true where all rates in it were."""

    th: Array
    dt: Array
    rate: Array
    stretch: NDArray[np.int64]
    recorded: NDArray[np.bool_]

    def turned(self, world: World) -> Array:
        """Turns (s, 3) [rad] of the stretches against inertial space, in p, by the angles of a rig."""
        steps = np.empty((len(self.dt), 3))
        for first in range(0, len(steps), _CHUNK):
            some = slice(first, first + _CHUNK)
            q, _ = gimbals(self.th[first : first + _CHUNK + 1], world)
            of_earth = rotate(conjugate(q[:-1]), world.earth) * self.dt[some, None]
            steps[some] = log(multiply(conjugate(q[:-1]), q[1:])) + of_earth
        return self.summed(steps)

    def summed(self, steps: Array) -> Array:
        """Sums (s, 3) over each stretch, without steps whose rates are a guess."""
        return np.stack([np.bincount(self.stretch, steps[:, k] * self.recorded) for k in range(3)], axis=-1)


def implausible(recording: Recording, settings: SelfcalSettings, where: object) -> list[Finding]:
    """Contradictions between rates, angles and accelerometers: signs, order, units, or ``at_prior`` without any motion.

    Raises RecordError, naming ``where``, for rates many times as fast as the angles, or the reverse: a unit is wrong,
    and nothing can be computed.
    """
    findings: list[Finding] = []
    complete = np.flatnonzero(np.isfinite(recording.th).all(axis=1))
    if complete.size < 2:
        raise RecordError(where, "found one row with all angles th_x, th_y, th_z, expected more")
    motion = _motion(recording, complete)
    moved = np.linalg.norm(motion.summed(np.diff(motion.th, axis=0)), axis=1)
    commanded = motion.summed(motion.rate)
    noise = LIMITS.noise_sigmas * settings.noise.encoder
    if moved.max() < noise:
        still = "the platform does not turn, expected turns: most coefficients stay as they were known before"
        findings.append(Finding("at_prior", f"th: {still}", action="check that th are angles of this test"))
    else:
        _units(commanded, moved, noise, where)
        findings += _rig(motion, commanded, settings, "gyro" if recording.measured else "wc")
    if all(finding.code not in ("channel_swap", "sign_suspect", "contradiction") for finding in findings):
        findings += _accelerometers(recording, settings, complete)
    return findings


def _motion(recording: Recording, complete: NDArray[np.int64]) -> _Stretches:
    """Motion between the rows with ``complete`` angles."""
    t = recording.t
    gained = np.vstack([np.zeros(3), np.cumsum(recording.rate * recording.dt[:, None], axis=0)])
    part = (t[complete[:-1]] - t[complete[0]]) / (t[complete[-1]] - t[complete[0]])
    _, numbered = np.unique((LIMITS.compared_stretches * part).astype(np.int64), return_inverse=True)
    held = np.zeros(len(t), dtype=np.int64)
    held[np.array(recording.held, dtype=np.int64) + 1] = 1
    recorded = np.diff(np.cumsum(held)[complete]) == 0
    return _Stretches(
        recording.th[complete], np.diff(t[complete]), np.diff(gained[complete], axis=0), numbered, recorded
    )


def _units(commanded: Array, moved: Array, noise: float, where: object) -> None:
    """Refuse rates that turn the platform many times as fast as the angles do, or the reverse."""
    turned = np.linalg.norm(commanded, axis=1)
    moving = (turned > LIMITS.moving_share * turned.max()) & (moved > noise)
    if not moving.any():
        return
    ratio = float(np.median(turned[moving] / moved[moving]))
    factor = max(ratio, 1.0 / ratio)
    if factor < LIMITS.unit_ratio:
        return
    words = next(
        (
            units
            for of, units in _EXCHANGED.items()
            if 1.0 / LIMITS.unit_window < factor / of < LIMITS.unit_window
        ),
        "units",
    )
    raise RecordError(
        where,
        f"the rates turn the platform {ratio:.4g} times as far as the angles say, expected the same: {words} look "
        "exchanged",
    )


def _rig(motion: _Stretches, commanded: Array, settings: SelfcalSettings, sensor: str) -> list[Finding]:
    """Rates against angles: gimbals of another order or with other signs, exchanged or reversed rates."""
    noise = 2.0 * settings.noise.encoder
    turned = motion.turned(settings.world)
    by_angles = _Pair(turned, commanded, noise)
    if by_angles.misfit < LIMITS.rough_misfit:
        return []
    suspect = _fitting(by_angles, _other_angles(motion, settings)) or _fitting(
        _Pair(commanded, turned, noise), _other_axes(sensor)
    )
    if suspect is not None:
        return [suspect]
    off = f"off by {100.0 * by_angles.misfit:.3g} % of the motion"
    text = f"th: the angles do not follow the rates {sensor}_x..z, {off}"
    return [
        Finding(
            "contradiction", text, harm=EVERYTHING, action="check units, signs and order of both in the map"
        )
    ]


@dataclass(frozen=True, eq=False)
class _Pair:
    """Stretches (s, 3) as one sensor has ``seen`` them and as they are ``expected``, with the ``noise`` of an axis."""

    seen: Array
    expected: Array
    noise: float

    @property
    def misfit(self) -> float:
        """Root mean square difference, less that of the noise, over that expected; infinite where that is 0."""
        squares = float(np.sum((self.seen - self.expected) ** 2))
        left = max(squares - 3.0 * len(self.seen) * self.noise**2, 0.0)
        whole = float(np.sum(self.expected**2))
        return math.sqrt(left / whole) if whole > 0.0 else math.inf if left > 0.0 else 0.0


def _fitting(pair: _Pair, hypotheses: Iterable[Hypothesis[_Pair]]) -> Finding | None:
    """The first hypothesis with which a pair fits."""
    fits = (tried(each, pair) for each in hypotheses)
    return next((fit.finding for fit in fits if fit.case.misfit < LIMITS.rough_fit), None)


def _other_angles(motion: _Stretches, settings: SelfcalSettings) -> Iterator[Hypothesis[_Pair]]:
    """Gimbals of another order or with other signs, the fewest changes first; exchanged angles."""
    of_study, world = settings.gimbals, settings.world
    now = (*of_study.axes, *of_study.signs)

    def hypothesis(code: str, text: str, moved: _Stretches, rig: World) -> Hypothesis[_Pair]:
        def without(pair: _Pair, _: Array) -> _Pair:
            return replace(pair, seen=moved.turned(rig))

        return Hypothesis(text, code, text, without, harm=EVERYTHING)

    def changes(other: Gimbals) -> int:
        return sum(a != b for a, b in zip((*other.axes, *other.signs), now, strict=True))

    others = [
        Gimbals(axes, (outer, inner, platform))
        for axes in itertools.permutations(get_args(Axis))
        for outer, inner, platform in itertools.product((1, -1), repeat=3)
    ]
    for other in sorted(others, key=changes)[1:]:
        code = "sign_suspect" if other.axes == of_study.axes else "channel_swap"
        text = f"the angles follow the rates with gimbals = {list(other.axes)}, signs = {list(other.signs)}"
        rig = world._replace(axes=other.index, signs=other.sign)
        yield hypothesis(
            code, f"{text}, not with those of the study: correct gimbals under [rig]", motion, rig
        )
    for order in itertools.permutations(range(3)):
        pairs = ((axis, "xyz"[order.index(k)]) for k, axis in enumerate("xyz"))
        names = ", ".join(f"th_{axis} looks like th_{other}" for axis, other in pairs if axis != other)
        moved = replace(motion, th=motion.th[:, order])
        what = f"{names}, as the rates have it"
        yield hypothesis("channel_swap", f"{what}: exchange their columns in the map", moved, world)


def _other_axes(sensor: str) -> Iterator[Hypothesis[_Pair]]:
    """Axes of a sensor in another order or with other signs, the fewest changes first."""

    def changes(way: tuple[tuple[int, ...], tuple[float, ...]]) -> float:
        return sum(k != j for k, j in enumerate(way[0])) + way[1].count(-1.0)

    for order, signs in sorted(_signed_orders(), key=changes)[1:]:
        words = ", ".join(
            f"{sensor}_{axis} should be {'-' if sign < 0.0 else ''}{sensor}_{'xyz'[k]}"
            for axis, k, sign in zip("xyz", order, signs, strict=True)
            if "xyz"[k] != axis or sign < 0.0
        )
        code = "sign_suspect" if order == (0, 1, 2) else "channel_swap"
        text = f"{words}, as the angles have it: correct their columns or signs in the map"
        yield Hypothesis(text, code, text, partial(_reordered, order, signs), harm=EVERYTHING)


def _reordered(order: tuple[int, ...], signs: tuple[float, ...], pair: _Pair, _: Array) -> _Pair:
    """A pair with the axes that are seen in another order and with other signs."""
    return replace(pair, seen=pair.seen[:, list(order)] * signs)


def _signed_orders() -> list[tuple[tuple[int, ...], tuple[float, ...]]]:
    """All orders of three axes with all signs."""
    return list(itertools.product(itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)))


def _accelerometers(
    recording: Recording, settings: SelfcalSettings, complete: NDArray[np.int64]
) -> list[Finding]:
    """Accelerometers against the specific force at the angles: wrong units, exchanged or reversed axes."""
    world = settings.world
    whole = complete[np.isfinite(recording.acc[complete]).all(axis=1)]
    if not whole.size:
        return []
    acc, g0 = recording.acc[whole], float(np.linalg.norm(world.up))
    norm = float(np.median(np.linalg.norm(acc, axis=1)))
    if not abs(norm / g0 - 1.0) < LIMITS.gravity_share:
        if any(
            finding.code == "unit_suspect" and finding.message.startswith("acc")
            for finding in recording.findings
        ):
            return []
        text = f"acc: a median norm of {norm:.4g} m/s^2 is not gravity, {g0:.5g} m/s^2"
        return [
            Finding("unit_suspect", text, harm=EVERYTHING, action="correct the unit in the header or the map")
        ]
    force = np.empty_like(acc)
    for first in range(0, len(acc), _CHUNK):
        some = slice(first, first + _CHUNK)
        force[some] = rotate(conjugate(gimbals(recording.th[whole[some]], world)[0]), world.up)
    pair = _Pair(acc, force, 2.0 * settings.noise.accelerometer)
    if pair.misfit < LIMITS.rough_misfit:
        return []
    suspect = _fitting(pair, _other_axes("acc"))
    if suspect is not None:
        return [suspect]
    text = f"acc: specific force does not follow the angles, off by {100.0 * pair.misfit:.3g} % of gravity"
    return [
        Finding("contradiction", text, harm=EVERYTHING, action="check signs and order of both in the map")
    ]


def clipped(recording: Recording, settings: SelfcalSettings, channel: str) -> bool:
    """True for a channel (``acc_x``, ``gyro_z``) beyond whose extremes the encoders say that the motion goes on.

    A quiet gyro sits at an extreme through each turn of constant rate, and is sound. A loss below
    `LIMITS.clipped_share` is left to the innovations. True also where the encoders are silent.
    """
    world, noise, k = settings.world, settings.noise, "xyz".index(channel[-1])
    q, _ = gimbals(recording.th, world)
    if channel.startswith("acc"):
        level = read = recording.acc[:, k]
        expected, spread = rotate(conjugate(q), world.up)[:, k], noise.accelerometer
    else:
        level, read = recording.rate[:, k], recording.rate[:, k] * recording.dt
        of_earth = rotate(conjugate(q[:-1]), world.earth) * recording.dt[:, None]
        expected, spread = (boxminus(q[1:], q[:-1]) + of_earth)[:, k], math.sqrt(2.0) * noise.encoder
    rows = saturated(level)
    for run in filter(len, np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)):
        outward = 1.0 if level[run[0]] == np.nanmax(level) else -1.0
        lost, slack = outward * (expected[run] - read[run]).sum(), LIMITS.noise_sigmas * spread
        if not lost <= slack * math.sqrt(len(run)) + LIMITS.clipped_share * abs(read[run].sum()):
            return True
    return False


def reordered_accelerometers(recording: Recording, problem: FilterProblem) -> Iterator[GrossFault]:
    """Accelerometers exchanged or reversed: the signed permutation that agrees best with the encoders."""
    q, _ = gimbals(recording.th, problem.world)
    acc, up = recording.acc[1:], rotate(conjugate(q), problem.world.up)[1:]
    both = np.isfinite(acc).all(axis=1) & np.isfinite(up).all(axis=1)
    match = acc[both].T @ up[both]
    sensors = (0, 1, 2)

    def fit(order: tuple[int, ...], signs: tuple[float, ...]) -> float:
        return float(sum(signs[i] * match[i, order[i]] for i in sensors))

    ways = _signed_orders()
    order, signs = max(ways, key=lambda way: fit(*way))
    words = []
    for i in sensors:
        if order[i] != i:
            words.append(f"acc_{'xyz'[i]} looks like {'-' if signs[i] < 0.0 else ''}acc_{'xyz'[order[i]]}")
        elif signs[i] < 0.0:
            words.append(f"acc_{'xyz'[i]} looks reversed")
    if not words:
        return

    right = np.empty_like(recording.acc)
    for i in sensors:
        right[:, order[i]] = signs[i] * recording.acc[:, i]
    code = "sign_suspect" if order == sensors else "channel_swap"
    found = Finding(
        code, ", ".join(words), harm=EVERYTHING, action="correct their columns or signs in the map"
    )
    chance = 2.0 * math.log((len(ways) - 1) / LIMITS.risk)
    yield GrossFault(found, replace(recording, acc=right), chance)


def off_the_path(
    recording: Recording, plan: PlatformPlan, world: World, began: float, rows: NDArray[np.int64]
) -> list[Finding]:
    """``truncated`` and ``contradiction``: a recording against the path of its study, which ``began`` at a time [s];
    ``rows`` (n,) of the file, from 0. Angles that make the attitude of the path are on it, also at gimbal lock."""
    t = recording.t - began
    findings = []
    if t[-1] < plan.duration - LIMITS.missing_steps * plan.step:
        text = f"the recording ends after {t[-1]:.6g} s, the study's path takes {plan.duration:.6g} s"
        findings.append(Finding("truncated", text))
    nominal = plan.angles()
    then = plan.step * np.arange(len(nominal))
    expected = np.stack([np.interp(t, then, nominal[:, k]) for k in range(3)], axis=-1)
    away = np.abs(np.remainder(recording.th - expected + math.pi, 2.0 * math.pi) - math.pi)
    turned = np.empty((len(t), 1))
    for begin in range(0, len(t), _CHUNK):
        some = slice(begin, begin + _CHUNK)
        there, meant = (gimbals(np.nan_to_num(th[some]), world)[0] for th in (recording.th, expected))
        turned[some, 0] = attitude_difference(meant, there)
    away = np.where(
        np.isfinite(recording.th).all(axis=1, keepdims=True) & (turned > LIMITS.off_the_path), away, 0.0
    )
    if away.max() > LIMITS.off_the_path:
        first, joint = divmod(int(np.argmax(away > LIMITS.off_the_path)), 3)
        text = (
            f"{JOINTS[joint]} leaves the study's path at {t[first]:.6g} s, and the angles are up to "
            f"{math.degrees(away.max()):.3g} deg away from it"
        )
        # the recorded angles count in the fit, not those of the plan
        findings.append(Finding("contradiction", text, f"row {rows[first] + 1}", ()))
    return findings
