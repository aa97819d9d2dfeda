"""What may be wrong with a test on a table: the pattern that each fault would leave in the outputs.

A bias that wanders, and noise that is larger in turns, can imitate nearly any of them, so that residuals alone do not
tell. Patterns do: an angle recorded half a percent too large leaves errors that go with the angle, a gyro at the end
of its range errors that go with the cube of the rate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from inercal.arrays import Array
from inercal.geometry.earth import EARTH_RATE
from inercal.geometry.rotations import Axis, elementary
from inercal.imu.aided.fit import Fit, Sensor
from inercal.imu.aided.suspects import expected
from inercal.imu.aided.table import Motion
from inercal.rigs.chain import Chain, Fixed, Joint

STEP = 1e-6
"""Step of the derivatives by an angle or the clock."""

MEMORY = 0.05
"""Step [s] of the second derivatives with time."""

FALLS_SHORT = 0.01
"""Part of the largest input by which an output has to fall short to be called saturated."""


@dataclass(frozen=True, eq=False)
class Fault:
    """A pattern: of each sensor in the fit the columns (n, q), or None where it leaves none.

    ``code`` of the finding; ``words`` from the amplitudes (q,).
    """

    code: str
    columns: tuple[Array | None, ...]
    words: Callable[[Array], str]

    @property
    def width(self) -> int:
        """Number q of amplitudes."""
        return next(int(each.shape[1]) for each in self.columns if each is not None)


def faults(fit: Fit, motion: Motion, gravity: float) -> Iterator[Fault]:
    """All that is looked for."""
    told = {triad: _at_fit(fit, motion, triad) for triad in fit.identified}
    yield from _of_angles(fit, motion, gravity, told)
    yield _of_clock(fit, motion, gravity, told)
    if "gyro" in fit.identified:
        yield from _of_gyro(fit, gravity)
    for triad in fit.identified:
        yield _memory(fit, motion, gravity, triad)
        yield from _nonlinear(fit, gravity, triad)


def _at_fit(fit: Fit, motion: Motion, triad: str) -> Array:
    """Force over gravity, or rate [rad/s], (n, 3) by a motion whose angles come as late as the fit says."""
    sensor = next(each for each in fit.sensors if each.side.sensor == triad)
    late = fit.references[triad].shift
    return expected(sensor.side.blocks, replace(motion, t=motion.t - late))


def _seen(fit: Fit, changes: dict[str, Array], gravity: float) -> tuple[Array | None, ...]:
    """What sensors make of changes (n, 3, q) of the force over gravity, or of the rate, by triad."""
    found: list[Array | None] = []
    for k, sensor in enumerate(fit.sensors):
        triad = sensor.side.sensor
        if triad not in changes:
            found.append(None)
            continue
        B = gain(fit, triad)[k % 3] * (gravity if triad == "acc" else 1.0)
        found.append(np.einsum("j,njq->nq", B, changes[triad]))
    return tuple(found)


def gain(fit: Fit, triad: str) -> Array:
    """Gains (3, 3) of a triad."""
    return fit.x[fit.unknowns.places[f"gain {triad}"]].reshape(3, 3)


def _of_angles(fit: Fit, motion: Motion, gravity: float, told: dict[str, Array]) -> Iterator[Fault]:
    """Angles of a wrong scale, and with errors that come back in each turn; axes that are not where they should be."""
    for k, joint in enumerate(motion.chain.joints):
        angle = motion.angles[:, k]
        patterns = []
        for wrong in (np.ones_like(angle), angle, np.sin(angle), np.cos(angle)):
            angles = motion.angles.copy()
            angles[:, k] += STEP * wrong
            moved = replace(motion, angles=angles)
            patterns.append({triad: (_at_fit(fit, moved, triad) - x) / STEP for triad, x in told.items()})
        for kind, words in ((0,), _zero), ((0, 1), _scale), ((2, 3), _round):
            changes = {triad: np.stack([patterns[each][triad] for each in kind], axis=-1) for triad in told}
            yield Fault("contradiction", _seen(fit, changes, gravity), partial(words, joint))
    elements = motion.chain.elements
    before = ""
    for k, element in enumerate(elements):
        if isinstance(element, Joint):
            # a turn of the base about up is that of the azimuth
            axes: tuple[Axis, ...] = ("x", "y", "z") if before else ("x", "y")
            changes = {triad: np.zeros((*x.shape, len(axes))) for triad, x in told.items()}
            for j, axis in enumerate(axes):
                turned = Chain((*elements[:k], Fixed(elementary(axis, STEP)), *elements[k:]))
                moved = replace(motion, chain=turned)
                for triad, x in told.items():
                    changes[triad][:, :, j] = (_at_fit(fit, moved, triad) - x) / STEP
            yield Fault("contradiction", _seen(fit, changes, gravity), partial(_tilted, before, element.name))
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


def _round(joint: str, a: Array) -> str:
    return (
        f"the angles {joint} are wrong by up to {np.degrees(abs(a[0]) + np.hypot(a[1], a[2])):.2g} deg, in a way that "
        "goes with the angle: check the levelling, or an encoder off its centre"
    )


def _of_clock(fit: Fit, motion: Motion, gravity: float, told: dict[str, Array]) -> Fault:
    """A clock of the angles that runs at another rate."""
    middle, span = float(np.mean(motion.t)), float(np.ptp(motion.t))
    moved = replace(motion, t=middle + (motion.t - middle) * (1.0 + STEP))
    changes = {triad: ((_at_fit(fit, moved, triad) - x) / STEP)[:, :, None] for triad, x in told.items()}
    return Fault(
        "command_shift",
        _seen(fit, changes, gravity),
        lambda a: (
            f"the clocks of angles and sensors run apart, by {1e6 * abs(a[0]):.0f} ppm or {1e3 * span * abs(a[0]):.2g} "
            f"ms over the test: multiply the times of the angles by {1.0 + a[0]:.6f}"
        ),
    )


def _of_gyro(fit: Fit, gravity: float) -> Iterator[Fault]:
    """Another earth rate than stated, and a gyro that feels the specific force."""
    C_bn = fit.references["gyro"].C_bn
    h = fit.x[fit.unknowns.places["earth rate"]]

    def rate(a: Array) -> str:
        north, west, up = h + EARTH_RATE * a
        turned = np.degrees(np.arctan2(-west, north))
        return (
            f"the gyro sees an earth rate of {np.degrees(north) * 3600:.2g}, {np.degrees(west) * 3600:.2g} and "
            f"{np.degrees(up) * 3600:.2g} deg/h north, west and up, which contradicts what is stated: check the "
            f"latitude, and the azimuth of the table (off by {turned:.0f} deg)"
        )

    yield Fault("contradiction", _seen(fit, {"gyro": EARTH_RATE * C_bn}, gravity), rate)
    if "gain G" in fit.unknowns.places:
        return
    up = C_bn[:, :, 2]
    columns: list[Array | None] = []
    for k, sensor in enumerate(fit.sensors):
        wide = np.zeros((len(up), 9))
        if sensor.side.sensor == "gyro":
            wide[:, 3 * (k % 3) : 3 * (k % 3) + 3] = up
        columns.append(wide if sensor.side.sensor == "gyro" else None)
    unit = next(each for each in fit.sensors if each.side.sensor == "gyro").side.blocks.triad.unit.symbol
    yield Fault(
        "g_sensitivity",
        tuple(columns),
        lambda a: (
            f"the gyro output changes with the specific force by up to {np.max(np.abs(a)):.2g} {unit} per g: set "
            "imu.g_sensitivity = true to estimate it"
        ),
    )


def _memory(fit: Fit, motion: Motion, gravity: float, triad: str) -> Fault:
    """Outputs that go through a slow filter: beside the delay there is a second derivative."""
    early, now, late = (
        _at_fit(fit, replace(motion, t=motion.t + by), triad) for by in (-MEMORY, 0.0, MEMORY)
    )
    words = "accelerometers" if triad == "acc" else "gyro"
    return Fault(
        "contradiction",
        _seen(fit, {triad: ((early - 2.0 * now + late) / MEMORY**2)[:, :, None]}, gravity),
        lambda a: (
            f"the outputs of the {words} are smoothed over some {1e3 * np.sqrt(2.0 * abs(a[0])):.0f} ms against the "
            "angles: use a faster filter, or start and stop the turns more gently"
        ),
    )


def _nonlinear(fit: Fit, gravity: float, triad: str) -> Iterator[Fault]:
    """Outputs that go with the square or the cube of the input."""
    ref = fit.references[triad]
    x = gravity * ref.C_bn[:, :, 2] if triad == "acc" else ref.rate
    for k, sensor in enumerate(fit.sensors):
        if sensor.side.sensor != triad:
            continue
        output = x @ gain(fit, triad)[k % 3]
        size = float(np.max(np.abs(output)))
        for power in (2, 3) if size > 0.0 else ():
            columns: list[Array | None] = [None] * len(fit.sensors)
            columns[k] = (output / size)[:, None] ** power
            yield _curved(columns, sensor, f"{triad}_{'xyz'[k % 3]}", size, power)


def _curved(columns: list[Array | None], sensor: Sensor, name: str, size: float, power: int) -> Fault:
    """An output with a term of a power of its input."""
    unit = sensor.side.blocks.triad.unit.symbol

    def words(a: Array) -> str:
        part = float(a[0]) / size
        if power == 3 and part < -FALLS_SHORT:
            return (
                f"{name} falls short at the largest input, by some {100.0 * abs(part):.2g} % at {size:.3g} {unit}: it "
                "saturates or is not linear; turn slower, or set a wider range"
            )
        order = "square" if power == 2 else "cube"
        term = f"{float(a[0]):.2g} {unit} at {size:.3g} {unit}"
        return f"{name} is not linear: a term with the {order} of the input, of {term}"

    return Fault("saturation" if power == 3 else "contradiction", tuple(columns), words)
