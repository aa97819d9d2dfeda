"""Constant errors of a test on a table: hypotheses, each with the pattern that it would leave in the outputs.

A bias that wanders, and noise that is larger in turns, can imitate nearly any of them, so that residuals alone do not
tell. Patterns do: an angle recorded half a percent too large leaves errors that go with the angle. What needs no name,
such as an angle that errs once a turn or an output that bends, is left to the judge.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import Axis, elementary
from inercal.foundation.inference.hypotheses import Fitted, Hypothesis
from inercal.foundation.rigs.chain import Chain, Fixed, Joint
from inercal.systems.imu.aided.diagnosis.fit_quality import Whitening, without_patterns
from inercal.systems.imu.aided.diagnosis.gross import expected
from inercal.systems.imu.aided.fit import AidedFit
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.limits import LIMITS

STEP = 1e-6
"""Step of the derivatives by an angle or the clock."""

Patterns = dict[int, Array]
"""Columns (n, q) by the number of each sensor in the fit that sees them."""


def constant_errors(
    fit: AidedFit, motion: TableMotion, gravity: float, judge: Whitening
) -> Iterator[Hypothesis[AidedFit]]:
    """All hypotheses that some output would show."""
    for name, code, patterns, words in _entries(fit, motion, gravity):
        width = next(iter(patterns.values())).shape[1]
        columns = [
            patterns.get(k, np.zeros((len(each.residual), width))) for k, each in enumerate(fit.sensors)
        ]
        combinations = judge.observable(columns)
        if combinations.size:
            yield _error(name, code, columns, combinations, words)


def _error(
    name: str, code: str, columns: Sequence[Array], combinations: Array, words: Callable[[Array], str]
) -> Hypothesis[AidedFit]:
    """A fault of columns (n, q) in the output of each sensor; its parameters are ``combinations`` (q, m) of them."""

    def without(fit: AidedFit, values: Array) -> AidedFit:
        return without_patterns(fit, [each @ (combinations @ values) for each in columns])

    def says(fitted: Fitted[AidedFit]) -> str:
        return words(combinations @ fitted.values)

    return Hypothesis(
        name, code, says, without, tuple(f"{name} {j + 1}" for j in range(combinations.shape[1]))
    )


Entry = tuple[str, str, Patterns, Callable[[Array], str]]
"""Name, code of the finding, patterns, and the sentence from the amplitudes (q,)."""


def _entries(fit: AidedFit, motion: TableMotion, gravity: float) -> Iterator[Entry]:
    """Faults of the angles, the clock, and the filters of the outputs."""
    outputs = {triad: at_fit(fit, motion, triad) for triad in fit.identified}
    yield from _of_angles(fit, motion, gravity, outputs)
    yield _of_clock(fit, motion, gravity, outputs)
    for triad in fit.identified:
        yield _memory(fit, motion, gravity, triad)


def at_fit(fit: AidedFit, motion: TableMotion, triad: str) -> Array:
    """Force over gravity, or rate [rad/s], (n, 3) by a motion whose angles come as late as the fit says."""
    sensor = next(each for each in fit.sensors if each.side.sensor == triad)
    late = fit.references[triad].shift
    return expected(sensor.side.blocks, replace(motion, t=motion.t - late))


def seen(fit: AidedFit, changes: dict[str, Array], gravity: float) -> Patterns:
    """Outputs by changes (n, 3, q) of the force over gravity, or of the rate, by triad."""
    patterns: Patterns = {}
    for k, sensor in enumerate(fit.sensors):
        triad = sensor.side.sensor
        if triad in changes:
            B = gain(fit, triad)[k % 3] * (gravity if triad == "acc" else 1.0)
            patterns[k] = np.einsum("j,njq->nq", B, changes[triad])
    return patterns


def gain(fit: AidedFit, triad: str) -> Array:
    """Gains (3, 3) of a triad."""
    return fit.x[fit.unknowns.places[f"gain {triad}"]].reshape(3, 3)


def _of_angles(
    fit: AidedFit, motion: TableMotion, gravity: float, outputs: dict[str, Array]
) -> Iterator[Entry]:
    """Angles of a wrong zero or scale; axes that are not where they should be."""
    for k, joint in enumerate(motion.chain.joints):
        angle = motion.angles[:, k]
        patterns = []
        for wrong in (np.ones_like(angle), angle):
            angles = motion.angles.copy()
            angles[:, k] += STEP * wrong
            moved = replace(motion, angles=angles)
            patterns.append({triad: (at_fit(fit, moved, triad) - x) / STEP for triad, x in outputs.items()})
        for name, kind, words in (("zero", (0,), _zero), ("scale", (0, 1), _scale)):
            changes = {
                triad: np.stack([patterns[each][triad] for each in kind], axis=-1) for triad in outputs
            }
            yield f"{name} of {joint}", "contradiction", seen(fit, changes, gravity), partial(words, joint)
    elements = motion.chain.elements
    before = ""
    for k, element in enumerate(elements):
        if isinstance(element, Joint):
            # a turn of the base about up is that of the azimuth
            axes: tuple[Axis, ...] = ("x", "y", "z") if before else ("x", "y")
            changes = {triad: np.zeros((*x.shape, len(axes))) for triad, x in outputs.items()}
            for j, axis in enumerate(axes):
                turned = Chain((*elements[:k], Fixed(elementary(axis, STEP)), *elements[k:]))
                moved = replace(motion, chain=turned)
                for triad, x in outputs.items():
                    changes[triad][:, :, j] = (at_fit(fit, moved, triad) - x) / STEP
            words = partial(_tilted, before, element.name)
            yield f"tilt of {element.name}", "contradiction", seen(fit, changes, gravity), words
            before = element.name


def _zero(joint: str, a: Array) -> str:
    return f"the angles {joint} are wrong by {np.degrees(a[0]):.2g} deg throughout: check their zero, and the levelling"


def _tilted(before: str, joint: str, a: Array) -> str:
    size = np.degrees(np.linalg.norm(a))
    if before:
        return (
            f"the axes {before} and {joint} are off the angle they should make by {size:.2g} deg, more than is stated: "
            "state errors deps of the table, or check the zeros of the angles"
        )
    return (
        f"the base of the table is tilted by {size:.2g} deg, more than is stated: state dbase_x and dbase_y, or check "
        f"the zero of {joint}"
    )


def _scale(joint: str, a: Array) -> str:
    return (
        f"the table turns by {100.0 * abs(a[1]):.2g} % {'more' if a[1] > 0 else 'less'} than the angles {joint} say: "
        "check the scale of this encoder, or a gear"
    )


def _of_clock(fit: AidedFit, motion: TableMotion, gravity: float, outputs: dict[str, Array]) -> Entry:
    """A clock of the angles that runs at another rate."""
    middle, span = float(np.mean(motion.t)), float(np.ptp(motion.t))
    moved = replace(motion, t=middle + (motion.t - middle) * (1.0 + STEP))
    changes = {triad: ((at_fit(fit, moved, triad) - x) / STEP)[:, :, None] for triad, x in outputs.items()}
    return (
        "clock",
        "command_shift",
        seen(fit, changes, gravity),
        lambda a: (
            f"the clocks of angles and sensors run apart, by {1e6 * abs(a[0]):.0f} ppm or {1e3 * span * abs(a[0]):.2g} "
            f"ms over the test: multiply the times of the angles by {1.0 + a[0]:.6f}"
        ),
    )


def _memory(fit: AidedFit, motion: TableMotion, gravity: float, triad: str) -> Entry:
    """Outputs that go through a slow filter: beside the delay there is a second derivative."""
    step = LIMITS.smoothing_step
    early, now, late = (at_fit(fit, replace(motion, t=motion.t + by), triad) for by in (-step, 0.0, step))
    words = "accelerometers" if triad == "acc" else "gyro"
    return (
        f"smoothing of {triad}",
        "contradiction",
        seen(fit, {triad: ((early - 2.0 * now + late) / step**2)[:, :, None]}, gravity),
        lambda a: (
            f"the outputs of the {words} are smoothed over some {1e3 * np.sqrt(2.0 * abs(a[0])):.0f} ms against the "
            "angles: use a faster filter, or start and stop the turns more gently"
        ),
    )
