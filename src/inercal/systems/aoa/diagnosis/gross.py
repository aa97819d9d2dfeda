"""Gross faults of a recording or of its study: hypotheses without parameters, of signs, units, order and clocks.

The commonest slips at the edge: a sensor reversed, columns exchanged, a unit taken for another, positions in mm taken
for m or counted backwards. Each is judged by what the fusion makes of the recording without it
(`inercal.systems.aoa.diagnosis.examination`); none is believed here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING
from inercal.foundation.inference.hypotheses import Hypothesis
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.diagnosis.fit_quality import Case, fit_quality, rms
from inercal.systems.aoa.diagnosis.noise_check import scatter
from inercal.systems.aoa.layout import AXES, Layout
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper.delay import aligned, relative_delay
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings

Change = Callable[[Recording, AoaSettings], Case]

OTHER_CHANNEL = "gyro does not tell of the pitch that the accelerometers show"
"""Name of the least likely hypothesis."""

#: factor that corrects values [SI] -> the unit they look to be in, and the unit they were taken for
_ACCELEROMETER_UNITS = {
    STANDARD_GRAVITY: ("g", "m/s^2"),
    1.0 / STANDARD_GRAVITY: ("m/s^2", "g"),
    1e-3: ("mg", "g"),
    1e3: ("g", "mg"),
    1e-3 * STANDARD_GRAVITY: ("mg", "m/s^2"),
    1e3 / STANDARD_GRAVITY: ("m/s^2", "mg"),
}
_GYRO_UNITS = {
    math.pi / 180.0: ("deg/s", "rad/s"),
    180.0 / math.pi: ("rad/s", "deg/s"),
    1e-3: ("mdeg/s", "deg/s"),
    1e3: ("deg/s", "mdeg/s"),
    1.0 / 3600.0: ("deg/h", "deg/s"),
    3600.0: ("deg/s", "deg/h"),
}
_LENGTHS = {
    1e-3: ("mm", "m"),
    1e3: ("m", "mm"),
    1e-2: ("cm", "m"),
    1e2: ("m", "cm"),
    1e-1: ("mm", "cm"),
    1e1: ("cm", "mm"),
}


def gross_faults(case: Case) -> Iterator[Hypothesis[Case]]:
    """All faults that the sensors of a recording may have."""
    recording, settings = case
    there = [k for k in range(recording.acc.shape[1]) if np.isfinite(recording.acc[:, k]).any()]
    shown = _shown(recording, settings)
    if np.isfinite(recording.gyro).any():
        # at rest a gyro shows noise alone, which has no sign and no unit
        if rms(shown) > settings.noise.gyro:
            yield from _of_gyro()
        yield from _of_clock(recording, settings, shown)
    if recording.spatial:
        yield from _of_turns()
    yield from _reversed(there, settings)
    yield from _orders(there, settings)
    yield from _units(there, settings)
    # in steady motion positions show no more than small errors of the sensors do
    arm = max(float(np.abs(settings.layout.r).max()), LIMITS.least_arm)
    if arm * rms(np.gradient(shown, recording.t)) > LIMITS.plain_acceleration:
        yield from _positions(there, settings)


def _fault(code: str, text: str, change: Change) -> Hypothesis[Case]:
    """A fault that a change of the recording or its study takes out."""
    return Hypothesis(text.split(":")[0], code, text, lambda case, _: change(*case), harm=EVERYTHING)


def _shown(recording: Recording, settings: AoaSettings) -> Array:
    """Rate (n,) [rad/s] that the accelerometers show."""
    return fit_quality(replace(recording, gyro=np.full_like(recording.gyro, np.nan)), settings).rate


def _follows(recording: Recording, shown: Array, gyro_noise: float) -> bool:
    """True where a gyro explains half of the mean square of the rate that accelerometers show, beside its bias and
    noise, or where there is hardly any rate; ``gyro_noise`` [rad/s] is the stated one."""
    gyro = recording.gyro
    both = np.isfinite(gyro) & np.isfinite(shown)
    both[: len(both) // 10] = False
    if both.sum() < LIMITS.compared_rows:
        return False
    gyro_scatter = scatter(recording.t[both], gyro[both])
    noise = gyro_noise if gyro_scatter is None else gyro_scatter.size
    left = float(np.var(gyro[both] - shown[both])) - noise**2
    return left < 0.5 * max(float(np.var(shown[both])), (LIMITS.still_gyro_ratio * noise) ** 2)


def _of_gyro() -> Iterator[Hypothesis[Case]]:
    """A gyro that is reversed, or of another unit."""

    def times(factor: float) -> Change:
        return lambda r, s: (replace(r, gyro=factor * r.gyro), s)

    text = "gyro looks reversed, it is positive nose-up: write sign = -1 for it in the map"
    yield _fault("sign_suspect", text, times(-1.0))
    for factor, (looks, taken) in _GYRO_UNITS.items():
        text = f"gyro looks to be in {looks}, taken for {taken}: correct its unit in the header or the map"
        yield _fault("unit_suspect", text, times(factor))


def _of_clock(recording: Recording, settings: AoaSettings, shown: Array) -> Iterator[Hypothesis[Case]]:
    """A gyro that is late, or one that does not measure pitch."""
    stated, delay = settings.timing.gyro_delay, relative_delay(recording, settings.layout)
    if delay is not None:
        shift = delay.value - (stated or 0.0)
        # an estimated delay is taken up as far as its prior goes
        expected = LIMITS.prior_sigmas * settings.prior.gyro_delay if stated is None else 0.0
        if abs(shift) > max(LIMITS.delay_sigmas * delay.u, expected):
            value, other = f"{1e3 * delay.value:.2g} ms", "" if stated is None else ' or "estimate"'
            how = "later" if shift > 0.0 else "earlier"
            text = (
                f"gyro comes {1e3 * abs(shift):.2g} ms {how} than the accelerometers and the study say: write "
                f'gyro_delay = "{value}"{other} under [timing]'
            )
            yield _fault("command_shift", text, lambda r, s: (aligned(r, shift), s))
    if _follows(recording, shown, settings.noise.gyro):
        return
    text = f"{OTHER_CHANNEL}: it may look along another axis, or be another channel or on another clock"
    none = np.full_like(recording.gyro, np.nan)
    yield _fault("channel_swap", text, lambda r, s: (replace(r, gyro=none), s))


def _of_turns() -> Iterator[Hypothesis[Case]]:
    """Gyros for roll and yaw reversed, exchanged, or both of another unit."""

    def times(factors: tuple[float, float], order: tuple[int, int] = (0, 1)) -> Change:
        return lambda r, s: (replace(r, turns=r.turns[:, order] * np.array(factors)), s)

    for name, signs in (("gyro_roll", (-1.0, 1.0)), ("gyro_yaw", (1.0, -1.0))):
        text = f"{name} looks reversed, it is right-handed about {'x forward' if signs[0] < 0.0 else 'z up'}: write "
        yield _fault("sign_suspect", f"{text}sign = -1 for it in the map", times(signs))
    text = "gyro_roll and gyro_yaw look exchanged: exchange their columns in the map"
    yield _fault("channel_swap", text, times((1.0, 1.0), (1, 0)))
    for factor, (looks, taken) in list(_GYRO_UNITS.items())[:2]:
        text = f"gyro_roll and gyro_yaw look to be in {looks}, taken for {taken}: correct their unit"
        yield _fault("unit_suspect", text, times((factor, factor)))


def _scaled(columns: list[int], factor: float) -> Change:
    """Accelerometers times a factor."""

    def change(recording: Recording, settings: AoaSettings) -> Case:
        acc = recording.acc.copy()
        acc[:, columns] *= factor
        return replace(recording, acc=acc), settings

    return change


def _reversed(there: list[int], settings: AoaSettings) -> Iterator[Hypothesis[Case]]:
    """Accelerometers that look the other way."""
    opposite = {"+x": "-x", "-x": "+x", "+z": "-z", "-z": "+z"}
    for k in there:
        name, angle = settings.layout.names[k], float(settings.layout.angle[k])
        axis = next((text for text, of in AXES.items() if abs(of - angle) < 1e-6), None)
        turned = f'angle = "{math.degrees(angle) + 180.0:.4g} deg"'
        what = turned if axis is None else f'axis = "{opposite[axis]}"'
        text = f"{name} looks reversed: write sign = -1 for it in the map, or {what} in the study"
        yield _fault("sign_suspect", text, _scaled([k], -1.0))


def _orders(there: list[int], settings: AoaSettings) -> Iterator[Hypothesis[Case]]:
    """Accelerometers exchanged."""
    names = settings.layout.names
    if math.factorial(len(there)) <= LIMITS.tried_orders:
        orders = list(itertools.permutations(there))
    else:
        pairs = itertools.combinations(there, 2)
        orders = [tuple({a: b, b: a}.get(k, k) for k in there) for a, b in pairs]
    for order in orders:
        moved = [(a, b) for a, b in zip(there, order, strict=True) if a != b]
        if not moved:
            continue
        if len(moved) == 2:
            what = f"{names[moved[0][0]]} and {names[moved[0][1]]} look exchanged"
        else:
            # the column of b holds the readings of a
            what = ", ".join(f"{names[b]} looks like {names[a]}" for a, b in moved)
        text = f"{what}: correct their columns in the map, or their axes and positions in the study"
        yield _fault("channel_swap", text, _ordered(there, order))


def _ordered(there: list[int], order: tuple[int, ...]) -> Change:
    """Accelerometers in another order."""

    def change(recording: Recording, settings: AoaSettings) -> Case:
        acc = recording.acc.copy()
        acc[:, there] = recording.acc[:, list(order)]
        return replace(recording, acc=acc), settings

    return change


def _units(there: list[int], settings: AoaSettings) -> Iterator[Hypothesis[Case]]:
    """All accelerometers, or one, of another unit."""
    for columns in (there, *([k] for k in there)) if len(there) > 1 else (there,):
        names = ", ".join(settings.layout.names[k] for k in columns)
        look, their = ("looks", "its") if len(columns) == 1 else ("look", "their")
        for factor, (looks, taken) in _ACCELEROMETER_UNITS.items():
            text = f"{names} {look} to be in {looks}, taken for {taken}: correct {their} unit in the header or the map"
            yield _fault("unit_suspect", text, _scaled(columns, factor))


def _positions(there: list[int], settings: AoaSettings) -> Iterator[Hypothesis[Case]]:
    """Positions of another unit, or counted backwards."""
    layout = settings.layout
    if not np.any(layout.r):
        return

    def times(factor: Array | float, of_height: float = 1.0) -> Change:
        def moved(of: Layout) -> Layout:
            return replace(of, r=of.r * factor, z=of.z * of_height)

        return lambda r, s: (r, replace(s, layout=moved(s.layout)))

    example = int(np.argmax(np.abs(layout.r)))
    arm = layout.r[example]
    for factor, (looks, taken) in _LENGTHS.items():
        likely, then_likely = (LIMITS.shortest_arm < abs(r) < LIMITS.longest_arm for r in (arm, factor * arm))
        # mm and cm are both likely
        if not then_likely or (likely and factor not in (1e-1, 1e1)):
            continue
        text = (
            f"the positions r of the accelerometers look to be in {looks}, taken for {taken}: write them with their "
            f'unit, for {layout.names[example]} "{factor * arm:g} m" in the place of "{arm:g} m"'
        )
        yield _fault("unit_suspect", text, times(factor, factor))
    text = "the positions r of all accelerometers look reversed, they are positive ahead of the pivot"
    yield _fault("sign_suspect", text, times(-1.0))
    for k in there:
        if layout.r[k] != 0.0:
            text = f'the position r of {layout.names[k]} looks reversed: write r = "{-layout.r[k]:g} m"'
            signs = np.where(np.arange(len(layout.r)) == k, -1.0, 1.0)
            yield _fault("sign_suspect", text, times(signs))
