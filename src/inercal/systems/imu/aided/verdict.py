"""Verdict of a calibration on a table: its status in words, and its findings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.identifiability import WORST_BY_SIZE
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.results.shown import rounded
from inercal.foundation.units import RAW
from inercal.systems.imu.aided.coefficients import of_triad, standard_uncertainty
from inercal.systems.imu.aided.diagnosis.examination import Misfit
from inercal.systems.imu.aided.diagnosis.fit_quality import variation
from inercal.systems.imu.aided.fit import AidedFit, Sensor
from inercal.systems.imu.limits import LIMITS

_WORDS = {"acc": "accelerometers", "gyro": "gyro"}
_INPUT = {"acc": "specific force", "gyro": "rate"}
_CURE = {
    "acc": "add rests with each axis of the instrument up and down",
    "gyro": "add turns about each axis of the instrument",
}


def verdict(
    fit: AidedFit, values: Mapping[str, float], u: Mapping[str, float], rests: int, faults: Sequence[Misfit]
) -> tuple[Status, str]:
    """Status and message.

    ``values`` and standard uncertainties ``u`` of the coefficients by name, these without ``faults``, which are what
    was found in the residuals.
    """
    triads = tuple(fit.identified)
    limit = np.array(list(u.values()))
    for fault in faults:
        if fault.part > LIMITS.fault_part and np.any(
            np.abs(fault.shift[: len(limit)]) > LIMITS.fault_shift * limit
        ):
            return Status.INCONSISTENT, fault.finding.message
    for triad in triads:
        wrong = _unit_words(fit, triad)
        if wrong:
            return Status.INCONSISTENT, wrong
    for sensor, name in zip(fit.sensors, _sensor_names(fit), strict=True):
        left, size = _in_turns(sensor), variation(sensor.side.blocks.y)
        noise = sensor.noise.resting / np.sqrt(np.median(sensor.side.blocks.length))
        shifts = sensor.noise.excess > 0.0 and _shift(sensor) > LIMITS.turning_shift * size
        if faults and (shifts or left > max(LIMITS.turning_residual * size, LIMITS.fault_shift * noise)):
            return Status.INCONSISTENT, faults[0].finding.message
        if shifts or left > max(LIMITS.turning_residual * size, LIMITS.fault_shift * noise):
            part = 100.0 * (_shift(sensor) if shifts else left) / size
            return (
                Status.INCONSISTENT,
                f"the output of {name} departs from the table's angles by {part:.2g} % of its variation when the "
                "table turns, and not at rest: look at the residuals (angles that are not those of the table, an "
                "instrument that is not fixed to it, outputs that saturate or are not linear)",
            )
    for triad in triads:
        identified = fit.identified[triad]
        weak = [
            name
            for name in identified.names
            if name in values and _relative(name, values, u) > LIMITS.unknown_coefficient_u
        ]
        if weak:
            return (
                Status.UNOBSERVABLE,
                f"the test says next to nothing of {counted_names(weak)} ({_least(fit, triad)}): {_cure(fit, triad)}",
            )
    for triad in triads:
        identified = fit.identified[triad]
        if identified.condition > WORST_BY_SIZE and set(identified.names) <= set(values):
            term = identified.leading_term()
            return (
                Status.ILL_CONDITIONED,
                f"the test hardly fixes {term} ({' ± '.join(rounded(values[term], u[term]))}; weak combination "
                f"{identified.weakest()}, condition {identified.condition:.0f}; {_least(fit, triad)}): "
                f"{_cure(fit, triad)}",
            )
    if not fit.converged:
        return Status.NOT_CONVERGED, "the fit of all sensors together did not settle: look at the residuals"
    if not any(name.startswith(("K1_", "M_", "S_", "T_")) for name in values):
        return (
            Status.UNOBSERVABLE,
            "the turns about one axis tell no scale factor: turn by more, at other attitudes",
        )
    conditions = ", ".join(
        f"{fit.identified[triad].condition:.1f} ({_WORDS[triad]})"
        for triad in triads
        if set(fit.identified[triad].names) <= set(values)
    )
    from_turns = f"{counted(len(values), 'coefficient')} from {counted(rests, 'rest')} and the turns between"
    return Status.OK, f"{from_turns}; condition {conditions}" if conditions else from_turns


def _cure(fit: AidedFit, triad: str) -> str:
    """The remedy for a triad that the test leaves too uncertain."""
    clipped = of_triad(fit, triad)[0].side.blocks.clipped
    if clipped:
        what = "turn slower" if triad == "gyro" else "avoid knocks"
        return (
            f"{counted_names([f'{triad}_{axis}' for axis in clipped])} saturated, {what} or set a wider range"
        )
    return _CURE[triad]


def _sensor_names(fit: AidedFit) -> list[str]:
    """Names of the sensors in the fit."""
    return [sensor.name for sensor in fit.sensors]


def _in_turns(sensor: Sensor) -> float:
    """Root mean square of the residuals while the table turns."""
    moving = ~sensor.side.blocks.resting
    return float(np.sqrt(np.mean(sensor.residual[moving] ** 2))) if moving.any() else 0.0


def _shift(sensor: Sensor) -> float:
    """Standard deviation of the shift of an output by one turn."""
    resting, length = sensor.side.blocks.resting, sensor.side.blocks.length
    turns = max(np.count_nonzero(np.diff(resting.astype(np.int8)) == -1), 1)
    return sensor.noise.walk_moving * float(np.sqrt(length[~resting].sum() / turns))


def scatter(fit: AidedFit, gravity: float) -> float:
    """Angle [rad] that shifts of the accelerometers with each turn amount to; 0 where there are none."""
    sensors = of_triad(fit, "acc")
    if not sensors:
        return 0.0
    scale = np.abs(np.diag(fit.x[fit.unknowns.places["gain acc"]].reshape(3, 3)))
    angles = [
        _shift(sensor) / (gravity * scale[sensor.axis]) if sensor.noise.excess > 0.0 else 0.0
        for sensor in sensors
    ]
    return max(angles)


def _relative(name: str, values: Mapping[str, float], u: Mapping[str, float]) -> float:
    """Uncertainty of a scale factor over its value, of a misalignment as it is; G and K2 do not count."""
    if name.startswith(("G_", "K2_")):
        return 0.0
    return u[name] / abs(values[name]) if name.startswith(("K1", "S")) else u[name]


def _least(fit: AidedFit, triad: str) -> str:
    """Along which axis the input varies least, in words."""
    blocks = of_triad(fit, triad)[0].side.blocks
    ref = fit.references[triad]
    x = ref.C_bn[:, :, 2] if triad == "acc" else ref.rate
    spread = np.sqrt(np.average((x - np.average(x, axis=0)) ** 2, axis=0, weights=blocks.length))
    axis = int(np.argmin(spread))
    size = f"{spread[axis]:.2g} g" if triad == "acc" else f"{np.degrees(spread[axis]):.2g} deg/s"
    along = "along" if triad == "acc" else "about"
    return f"the {_INPUT[triad]} {along} {'xyz'[axis]} varies by {size} rms only"


def _unit_words(fit: AidedFit, triad: str) -> str:
    """Findings about the unit of physical outputs, whose scale factors should be near nominal."""
    unit = of_triad(fit, triad)[0].side.blocks.triad.unit
    if unit.dimension in RAW:
        return ""
    gain = fit.x[fit.unknowns.places[f"gain {triad}"]].reshape(3, 3)
    ratio = (
        float(np.median([abs(gain[sensor.axis, sensor.axis]) for sensor in of_triad(fit, triad)]))
        * unit.factor
    )
    if 0.5 < ratio < 2.0:
        return ""
    return (
        f"the output of {triad} is {ratio:.3g} times what the table's angles make of it in {unit.symbol}: check the "
        f"unit of {triad}{', of the angles and of the time stamps' if triad == 'gyro' else ''} in the map or header"
    )


def findings(
    fit: AidedFit, lag: float, faults: Sequence[Misfit], sound: bool, geometry: tuple[str, ...]
) -> Iterator[Finding]:
    """Findings about clocks, biases, saturation, and faults in the residuals of a result, ``sound`` or not.

    ``geometry`` names its lever arms and delays, which shifts with each turn move by more than their u.
    """
    for fault in faults:
        # where u allows for a fault, sensors and table do not contradict each other
        found = fault.finding
        code = "unmodelled" if sound and found.code == "contradiction" else found.code
        yield replace(found, code=code, headline=f"{found.headline}, which u allows for", harm=())
    for triad in fit.identified:
        blocks = of_triad(fit, triad)[0].side.blocks
        if blocks.clipped:
            lost = ", ".join(f"{triad}_{axis} {count}" for axis, count in blocks.clipped.items())
            yield Finding(
                "saturation",
                f"blocks of {float(np.median(blocks.length)):.2g} s in which a sensor is at an end of its range are "
                f"left out: {lost}; {len(blocks.y)} are left",
                harm=(),
            )
    moved = [
        f"{name} {_shift(sensor):.2g} {sensor.side.blocks.triad.unit.symbol}"
        for sensor, name in zip(fit.sensors, _sensor_names(fit), strict=True)
        if sensor.noise.excess > 0.0
    ]
    if moved and not faults:
        yield Finding(
            "excess_scatter",
            f"outputs shift with each turn of the table, and not at rest, by some {', '.join(moved)}: errors of the "
            "table that are not stated, or hysteresis; the uncertainties use it, but for lever arms and delays",
            harm=geometry,
        )
    for triad in fit.identified:
        group = f"time shift of {triad}"
        own = float(fit.x[fit.unknowns.places[group][0]])
        shift, u = own + lag, float(standard_uncertainty(fit, group)[0])
        if abs(shift) > max(5.0 * u, 1e-3):
            value, digits = rounded(1e3 * abs(shift), 1e3 * u)
            yield Finding(
                "command_shift",
                f"the table's angles come {value} ± {digits} ms {'late' if shift > 0 else 'early'} against the "
                f"{_WORDS[triad]}: corrected",
                harm=(),
            )
    for triad in fit.identified:
        sensors = of_triad(fit, triad)
        moved = [
            f"{'xyz'[sensor.axis]} {sensor.noise.walk * np.sqrt(np.ptp(sensor.side.blocks.middle)):.2g}"
            for sensor in sensors
            if sensor.noise.drift > LIMITS.wander_gain
        ]
        if moved:
            name = "K0" if triad == "acc" else "D_F"
            yield Finding(
                "bias_drift",
                f"the bias of the {_WORDS[triad]} wanders over the test, by about {', '.join(moved)} "
                f"{sensors[0].side.blocks.triad.unit.symbol}; {name} is its mean, and the wander is in the "
                "uncertainties",
                harm=(),
            )
