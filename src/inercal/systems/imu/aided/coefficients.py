"""The coefficients of the instrument from the unknowns of the fit, with their sources of uncertainty."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import Site
from inercal.foundation.instruments.terms import ACCELEROMETERS_IN_A_FRAME, GYRO_G_SENSITIVITY, GYRO_TRIAD
from inercal.foundation.results.budget import TypeA, TypeB
from inercal.systems.imu.aided.fit import AidedFit, Sensor
from inercal.systems.imu.limits import LIMITS

SQUARES = tuple(f"K2_{axis}" for axis in "xyz")
"""The second-order coefficients of the accelerometers."""

LEVER_ARMS = tuple(f"r_{i}{j}" for i in "xyz" for j in "xyz")
"""Places of the accelerometers beside the crossing of the axes."""

_DELAYS = {"acc": "tau_a", "gyro": "tau_g"}
_LETTERS = {"acc": ("K0", "K1", "M"), "gyro": ("D_F", "S", "T")}


def gain_names(triad: str, g_sensitivity: bool = False, squares: bool = False) -> tuple[str, ...]:
    """Names of the gains of a triad, row by row; the diagonal is the scale factor."""
    _, scale, cross = _LETTERS[triad]
    rows = [f"{scale}_{i}" if i == j else f"{cross}_{i}{j}" for i in "xyz" for j in "xyz"]
    if triad == "acc":
        return (*rows, *(SQUARES if squares else ()))
    return (*rows, *(GYRO_G_SENSITIVITY if g_sensitivity else ()))


def names_of(fit: AidedFit, g_sensitivity: bool, squares: bool = False) -> tuple[str, ...]:
    """Names of the coefficients of the sensors in a fit, in the order of results."""
    whole = (*ACCELEROMETERS_IN_A_FRAME, *(SQUARES if squares else ()))
    whole = (*whole, *GYRO_TRIAD, *(GYRO_G_SENSITIVITY if g_sensitivity else ()))
    there = {sensor.name for sensor in fit.sensors}
    return tuple(name for name in whole if _sensor_of(name) in there)


def circumstances_of(fit: AidedFit) -> tuple[str, ...]:
    """Names of what belongs to the test: lever arms, and delays of the sensors against the table's angles."""
    there = {sensor.name for sensor in fit.sensors}
    arms = (name for name in LEVER_ARMS if _sensor_of(name) in there)
    return (*arms, *(_DELAYS[triad] for triad in fit.identified))


def _sensor_of(name: str) -> str:
    """The channel that a coefficient is of: ``acc_x`` of ``M_xy``."""
    letter, axes = name.rsplit("_", 1)
    return f"{'gyro' if letter in ('D_F', 'S', 'T', 'G') else 'acc'}_{axes[0]}"


def told(fit: AidedFit, rows: Array, own: Array) -> NDArray[np.bool_]:
    """True (p,) for values of which the data say more than what was known of gains, arms and delays before.

    ``rows`` (p, P) and ``own`` (p,) as from `coefficients`. What has a prior itself is told where its u is below a part
    of that prior's (`LIMITS.left_at_prior`); a bias has none, and is told where no such prior makes most of its u.
    """
    sd, places = fit.unknowns.sd, fit.unknowns.places
    named = [at for name, at in places.items() if name.startswith(("gain ", "lever arm", "time shift of "))]
    index = np.concatenate(named)
    gain = rows @ fit.covariance
    variance = np.einsum("pi,pi->p", gain, rows) + own
    before = np.sum((rows[:, index] * sd[index]) ** 2, axis=1)
    by_prior = np.sum((gain[:, index] / sd[index]) ** 2, axis=1)
    left = LIMITS.left_at_prior
    of_a_prior = (before == 0.0) | (variance < left**2 * before)
    return np.asarray(np.where(own > 0.0, by_prior <= left * variance, of_a_prior))


def coefficients(fit: AidedFit, names: tuple[str, ...], lag: float) -> tuple[Array, Array, Array]:
    """Values (p,), their derivatives (p, P) by the unknowns, and variances (p,) of their own.

    ``lag`` [s] is the time that the angles were taken earlier by before the fit.
    """
    P = len(fit.x)
    by_name: dict[str, tuple[float, Array, float]] = {}
    for sensor in fit.sensors:
        triad, i = sensor.side.sensor, "xyz"[sensor.axis]
        bias, scale, cross = _LETTERS[triad]
        row = np.zeros(P)
        row[sensor.equation.index] = -sensor.whitened.mean[:-1]
        by_name[f"{bias}_{i}"] = (sensor.bias, row, sensor.whitened.mean_variance)
        places = fit.unknowns.places[f"gain {triad}"][3 * sensor.axis : 3 * sensor.axis + 3]
        own = places[sensor.axis]
        S = fit.x[own]
        for j, place in zip("xyz", places, strict=True):
            row = np.zeros(P)
            row[place] = 1.0 if place == own else 1.0 / S
            value = fit.x[place]
            if place != own:
                row[own] = -value / S**2
                value = value / S
            by_name[f"{scale}_{i}" if place == own else f"{cross}_{i}{j}"] = (float(value), row, 0.0)
    for name, place in zip(GYRO_G_SENSITIVITY, fit.unknowns.places.get("gain G", ()), strict=False):
        by_name[name] = (float(fit.x[place]), np.eye(P)[place], 0.0)
    squares = fit.unknowns.places.get("gain K2", ())
    gains = fit.unknowns.places["gain acc"][[0, 4, 8]] if len(squares) else ()
    for name, place, own in zip(SQUARES, squares, gains, strict=False):
        row = np.zeros(P)
        row[place], row[own] = 1.0 / fit.x[own], -fit.x[place] / fit.x[own] ** 2
        by_name[name] = (float(fit.x[place] / fit.x[own]), row, 0.0)
    for name, place in zip(LEVER_ARMS, fit.unknowns.places.get("lever arm", ()), strict=False):
        by_name[name] = (float(fit.x[place]), np.eye(P)[place], 0.0)
    for triad in fit.identified:
        # angles that come late are sensors that are early
        (place,) = fit.unknowns.places[f"time shift of {triad}"]
        by_name[_DELAYS[triad]] = (-float(fit.x[place]) - lag, -np.eye(P)[place], 0.0)
    chosen = [by_name[name] for name in names]
    return (
        np.array([value for value, _, _ in chosen]),
        np.array([row for _, row, _ in chosen]),
        np.array([own for _, _, own in chosen]),
    )


def type_a(fit: AidedFit, rows: Array, own: Array, names: tuple[str, ...]) -> list[TypeA]:
    """Uncertainties of the coefficients by noise in the data: white noise and wander of the biases, by triad.

    ``rows`` (p, n) derivatives of the coefficients ``names`` (p,) by the unknowns of the fit; ``own`` (p,) variance
    that a coefficient has beside them.
    """
    sources = []
    gain = rows @ fit.covariance
    for triad in dict.fromkeys(sensor.side.sensor for sensor in fit.sensors):
        sensors = [sensor for sensor in fit.sensors if sensor.side.sensor == triad]
        words = "accelerometers" if triad == "acc" else "gyro"
        unit = sensors[0].side.blocks.triad.unit.symbol
        white, walk = np.zeros((2, len(fit.x), len(fit.x)))
        for sensor in sensors:
            index = np.ix_(sensor.equation.index, sensor.equation.index)
            by_white, by_walk = sensor.whitened.information()
            white[index] += by_white[:-1, :-1]
            walk[index] += by_walk[:-1, :-1]
        biases = np.array([name.startswith(f"{_LETTERS[triad][0]}_") for name in names])
        levels = [sensor.noise for sensor in sensors]
        sources += [
            TypeA(
                f"white noise of the {words}",
                _rms([level.resting for level in levels]),
                f"{unit} sqrt(s)",
                gain @ white @ gain.T + np.diag(np.where(biases, own, 0.0)),
                float(np.mean([level.dof for level in levels])),
            ),
            TypeA(
                f"wander of the biases of the {words}",
                _rms([level.walk for level in levels]),
                f"{unit}/sqrt(s)",
                gain @ walk @ gain.T,
                float(np.mean([level.walk_dof for level in levels])),
            ),
        ]
    return sources


def type_b(
    fit: AidedFit, rows: Array, names: tuple[str, ...], values: Array, site: Site, clock_u: float
) -> list[TypeB]:
    """Uncertainties of the coefficients by inputs: gravity, the clock, earth rate, the errors of the table.

    Gravity sets the scale of specific force, the clock, with the relative standard uncertainty ``clock_u``, that of
    rate. Earth rate and the errors of the table are unknowns of the fit with a prior; the part of their uncertainty
    that the data leave is listed here. ``rows`` and ``names`` as in `type_a`, ``values`` (p,) of the coefficients in
    SI.
    """

    def scaled(factor: float, *prefixes: str) -> Array:
        pairs = zip(names, values, strict=True)
        return np.array([factor * value if name.startswith(prefixes) else 0.0 for name, value in pairs])

    by_gravity = scaled(-1.0 / site.gravity, "K1_", "K2_", "G_")
    sources = [TypeB(each.source, each.u, each.unit, by_gravity * each.sensitivity) for each in site.inputs]
    if clock_u > 0.0 and "S_x" in names:
        sources.append(TypeB("time base", clock_u, "1", scaled(1.0, "S_")))
    layout = fit.unknowns
    gain = rows @ fit.covariance
    variance = np.einsum("pi,ij,pj->p", rows, fit.covariance, rows)
    for name, places in layout.places.items():
        u = float(np.max(layout.sd[places]))
        redrawn = name not in layout.stated or name in layout.redrawn
        by_input = gain[:, places] / layout.sd[places] / u
        source = TypeB(layout.sources.get(name, name), u, layout.units[name], by_input, redrawn)
        # priors of gains, arms and shifts are only there for order, unless the test says nothing of these
        if name in layout.stated or np.any(np.diag(source.covariance) > LIMITS.prior_share * variance):
            sources.append(source)
    return sources


def standard_uncertainty(fit: AidedFit, group: str) -> Array:
    """Standard uncertainties of a group of unknowns."""
    return np.asarray(np.sqrt(np.diag(fit.covariance)[fit.unknowns.places[group]]))


def of_triad(fit: AidedFit, triad: str) -> list[Sensor]:
    """The sensors of a triad."""
    return [sensor for sensor in fit.sensors if sensor.side.sensor == triad]


def _rms(values: list[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
