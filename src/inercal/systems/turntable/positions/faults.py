"""Ordinary faults of a test on a table, as columns by which each would change the readings.

Of the fitted coefficients c only those parts are taken that the residuals do not depend on, so that a column made with
them is as good as a given one: of normal errors, coefficients and residuals are independent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.systems.turntable.model import UNIT_GAINS
from inercal.systems.turntable.readings import Readings, apart
from inercal.systems.turntable.regression import Regression

_WARM_UP = (0.05, 0.15, 0.4)
"""Time constants of a warm-up that are tried, over the length of the test."""

_STEP = 1e-4
"""Angle [rad] for derivatives by the angle of a joint."""


@dataclass(frozen=True, eq=False)
class Fault:
    """Something that is wrong, or may be.

    Attributes
    ----------
    name : str
        Of the fault, each once.
    code : str
        Of its finding.
    columns : (n, c, m)
        Change of the readings by a unit of each parameter.
    what : str
        A noun in words, its size apart.
    size : callable
        Its size in words, from values (m,) and the unit of an output: a factor and its symbol.
    kind : str
        Of the fault, whatever the channel or joint.
    bend : callable, optional
        Change (n, c) of the readings by values (m,) beyond the linear one.
    within : (n, c), optional
        Change of the readings within a dwell by a unit of the fault, over the length of the test.
    """

    name: str
    code: str
    columns: Array
    what: str
    size: Callable[[Array, tuple[float, str]], str]
    kind: str
    bend: Callable[[Array], Array] | None = None
    within: Array | None = None

    def effect(self, values: Array) -> Array:
        """Change (n, c) of the readings by a fault of these values (m,)."""
        linear = self.columns @ values
        return np.asarray(linear if self.bend is None else linear + self.bend(values))


def fraction(times: Array) -> Array:
    """Time (n,) from 0 at the first reading to 1 at the last."""
    return np.asarray((times - times[0]) / (times[-1] - times[0]))


def faults(means: Readings, fit: Regression) -> Iterator[Fault]:
    """The faults that are asked for in the residuals of a fit."""
    if len(means.times) < 3:
        return
    yield from _drifts(means, fit)
    yield from _base(means, fit)
    yield from _joints(means, fit)
    yield from _fields(means, fit)


def _of_output(values: Array, unit: tuple[float, str]) -> str:
    """Root of the sum of squares, in the unit of the outputs; one value with its sign."""
    size = float(values[0]) if len(values) == 1 else float(np.linalg.norm(values))
    return f"{size / unit[0]:.2g} {unit[1]}"


def _of_scale(values: Array, unit: tuple[float, str]) -> str:
    """A relative change."""
    return f"{1e6 * values[0]:.2g} ppm"


def _of_angle(values: Array, unit: tuple[float, str]) -> str:
    """Arc seconds or minutes."""
    size = float(np.degrees(np.linalg.norm(values))) * 60.0
    return f"{size:.2g} arcmin" if size >= 1.0 else f"{60.0 * size:.2g} arcsec"


def reading(means: Readings, k: int) -> Fault:
    """A single reading that is wrong, in each channel: an angle that was mistyped, rows exchanged, a knock."""
    columns = np.zeros((*means.y.shape, means.y.shape[1]))
    columns[k] = np.eye(means.y.shape[1])
    angles = ", ".join(f"{angle:.6g}" for angle in np.degrees(means.angles[k]))
    what = f"a departure of position {k + 1} in the order taken (at {angles} deg) from what all others say"
    return Fault(f"reading {k}", "outlier", columns, what, _of_output, "reading")


def _drifts(means: Readings, fit: Regression) -> Iterator[Fault]:
    """Bias and scale factor that change with time, of each channel."""
    s, fitted = fraction(means.times), fit.y - fit.residuals
    for k, name in enumerate(means.channels):
        what = f"a trend of {name} from first to last position"
        one = on_channel(means, k, np.ones_like(s))[..., 0]
        column = on_channel(means, k, s - 0.5)
        yield Fault(f"trend {name}", "trend", column, what, _of_output, "trend", within=one)
        for tau in _WARM_UP:
            column = on_channel(means, k, np.exp(-s / tau))
            what = f"a warm-up of {name}, with a time constant of {tau:g} of the test,"
            within = -column[..., 0] / tau
            yield Fault(
                f"warm-up {tau} {name}", "warm_up", column, what, _of_output, "warm-up", within=within
            )
        changed = on_channel(means, k, (s - 0.5) * fitted[:, k])
        what = f"a drift of the scale factor of {name} over the test"
        yield Fault(f"scale drift {name}", "trend", changed, what, _of_scale, "scale drift")


def on_channel(means: Readings, channel: int, columns: Array) -> Array:
    """Columns (n, c, m) of an effect (n, m) or (n,) on a single channel."""
    made = np.zeros((*means.y.shape, 1 if columns.ndim == 1 else columns.shape[1]))
    made[:, channel] = columns.reshape(len(columns), -1)
    return made


def _base(means: Readings, fit: Regression) -> Iterator[Fault]:
    """Azimuth and levelling of the base."""
    model, c = fit.model, fit.c
    for k in range(len(model.channels)):
        yield from _heading(means, fit, k)
    tilts = [
        model.by_references(fit.angles, c, np.cross(model.a_n, about), np.cross(model.w_n, about))
        for about in np.eye(3)[:2]
    ]
    yield Fault("level", "level_suspect", np.stack(tilts, axis=-1), "a tilt of the base", _of_angle, "level")


def _heading(means: Readings, fit: Regression, k: int) -> Iterator[Fault]:
    """The response of a channel to the east rate along its own axis: with the heading wrong by delta its response to
    the north rate is ``gain = S cos delta`` and that to the west rate ``-S sin delta``."""
    model = fit.model
    gains = dict(zip(model.channels[k].symbols, fit.c[model.blocks[k]].tolist(), strict=True))
    if model.stated:
        fixed = model.stated[k]
        gains |= dict(zip(fixed.channel.symbols, fixed.values.tolist(), strict=True))
    own = next((each for each in gains if each in UNIT_GAINS and not each.startswith("K")), None)
    north = float(np.linalg.norm(model.w_n[:2]))
    if own is None or not north:
        return
    C_nb, gain = model.chain.attitude(fit.angles), gains[own]
    felt = north * C_nb[:, :2, "xyz".index(own[-1])]
    yield Fault(
        f"heading {means.channels[k]}",
        "heading_suspect",
        on_channel(means, k, felt[:, 1]),
        f"a response of {means.channels[k]} to the east rate, as with an error of heading",
        lambda values, unit: f"{np.degrees(np.arctan2(-values[0], gain)):.2g} deg",
        "heading",
        lambda values: on_channel(
            means, k, (gain - np.copysign(np.hypot(gain, values[0]), gain)) * felt[:, 0]
        )[..., 0],
    )


def _joints(means: Readings, fit: Regression) -> Iterator[Fault]:
    """Harmonics of the angles of the joints, and the sense in which they were reached."""
    sense, joints = approach(means.angles), fit.model.chain.joints
    for j, (joint, step) in enumerate(zip(joints, _STEP * np.eye(len(joints)), strict=True)):
        ends = [fit.model.outputs(fit.angles + sign * step, fit.c) for sign in (1.0, -1.0)]
        slope = (ends[0] - ends[1])[..., None] / (2.0 * _STEP)
        for order, word in ((1, "first"), (2, "second")):
            angle = order * fit.angles[:, j]
            waves = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
            what = f"an error of {joint} that goes with its {word} harmonic"
            name = f"harmonic {order} {joint}"
            yield Fault(name, "angle_harmonic", slope * waves, what, _of_angle, f"harmonic {order}")
        what = f"an error of {joint} that goes with the sense in which it was reached"
        column = slope * sense[:, j, None, None]
        yield Fault(f"backlash {joint}", "approach_hysteresis", column, what, _of_angle, "backlash")
        for k, name in enumerate(means.channels):
            what = f"a part of {name} that goes with the sense in which {joint} was reached"
            column = on_channel(means, k, sense[:, j])
            yield Fault(
                f"hysteresis {joint} {name}", "approach_hysteresis", column, what, _of_output, "hysteresis"
            )


def approach(angles: Array) -> Array:
    """Sense (n, joints), 1 or -1, in which each angle was reached by the shorter way.

    It stays while a joint stands, and is 0 before the first move and after half a turn.
    """
    sense = np.zeros_like(angles)
    for k, step in enumerate(apart(angles[1:], angles[:-1]), start=1):
        half = np.abs(np.abs(step) - np.pi) < _STEP
        sense[k] = np.where(half, 0.0, np.where(np.abs(step) > _STEP, np.sign(step), sense[k - 1]))
    return sense


def _fields(means: Readings, fit: Regression) -> Iterator[Fault]:
    """A field that stands still while the case turns: its parts north, west and up along each axis of the case.

    The vertical part acts as gravity does, and shows in no residual.
    """
    C_nb = fit.model.chain.attitude(fit.angles)
    for k, name in enumerate(means.channels):
        what = f"a response of {name} to a field fixed to the ground, its vertical part above all,"
        yield Fault(
            f"field {name}",
            "ground_field",
            on_channel(means, k, C_nb.reshape(-1, 9)),
            what,
            _of_output,
            "field",
        )
