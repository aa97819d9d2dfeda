"""A simulated rate test: a gyro of known terms on a table that turns at each rate in its order."""

from __future__ import annotations

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.rigs.chain import Chain, follows_angle
from inercal.foundation.rigs.outputs import gravity_reference, rate_reference
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.disturbances import displaced, disturbed
from inercal.systems.turntable.model import channels_of, stated_values
from inercal.systems.turntable.rate.calibration import check_rate_test
from inercal.systems.turntable.rate.ends import ends, known_change, settled
from inercal.systems.turntable.rate.fit import approaches
from inercal.systems.turntable.rate.stays import arc, over_turn, sensed
from inercal.systems.turntable.settings import TurntableSettings


def simulate_rate_test(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """Turn the table at each rate of the study and record the gyros, one row for each stay.

    Parameters
    ----------
    settings : TurntableSettings
        The stated coefficients are the truth, those of rate tests among them (half of S_hyst is added where a rate
        was reached from below, and taken off where from above); each error of the table is drawn by its scope.
    rng : Generator

    Returns
    -------
    Record
        ``position``, ``joint`` where the test has legs, ``rate`` [deg/s], angles [deg] (that of the turning joint at
        the start of the stay) and mean outputs.

    Raises
    ------
    StudyError
        No rates, an instrument that is no gyro, drift by squares of force, or a true
        value of S_nl, which follows from the others.
    """
    check_rate_test(settings)
    test, chain, instrument = settings.rate_test, settings.chain, settings.instrument
    assert test is not None
    if not test.rates:
        raise StudyError("rate_test.rates", 'missing, expected rates such as ["-10 deg/s", "10 deg/s"]')
    if any(symbol.startswith("S_nl") for symbol in instrument.coefficients):
        raise StudyError("instrument.coefficients", "S_nl is not stated but follows, expected S2 or S3")
    other = settings.disturbances
    alien = [
        key for key in ("angle", "harmonics", "magnetic", "dead_zone", "hysteresis") if getattr(other, key)
    ]
    if alien:
        raise StudyError(
            f"disturbances.{alien[0]}", "found in a study of a rate test, expected one of positions"
        )
    chain = displaced(chain, other)
    squares = [symbol for symbol in instrument.coefficients if TERMS[symbol].unit == "output/(m/s^2)^2"]
    if squares:
        raise StudyError(
            "instrument.coefficients",
            f"found {squares[0]}, expected no squares of force in a simulated rate test",
        )
    legs: list[tuple[str, list[float]]] = [(leg.joint, leg.of(chain.joints)) for leg in test.legs] or [
        (test.joint, test.at.of(chain.joints))
    ]
    rate = np.tile(test.rates, len(legs))
    n, each = len(rate), len(test.rates)
    t = np.asarray(instrument.dwell * (np.arange(n) + 0.5))
    turning = np.repeat([chain.joints.index(joint) for joint, _ in legs], each)
    angles = np.repeat([begin for _, begin in legs], each, axis=0)
    ended = angles.copy()
    ended[np.arange(n), turning] += rate * instrument.dwell
    both = (
        chain.draw(rng, np.concatenate([angles, ended])) if any(map(follows_angle, chain.elements)) else None
    )
    errors = chain.draw(rng, n) if both is None else both[:n]
    true_rate = rate * (1.0 + test.rate_u * rng.standard_normal())
    w, f = np.empty((n, 3)), np.empty((n, 3))
    way = np.empty(n)
    for k, (joint, _) in enumerate(legs):
        of = slice(k * each, (k + 1) * each)
        at_ends = None if both is None else np.concatenate([both[:n][of], both[n:][of]])
        w[of], f[of] = _felt(settings, chain, joint, angles[of], true_rate[of], errors[of], at_ends)
        way[of] = approaches(rate[of])
    full_scale = test.full_scale or float(np.abs(rate).max())
    y = []
    channels = channels_of(settings)
    for channel in channels:
        model, axis = channel_model(instrument.kind, channel), channel[-1]
        values = stated_values(settings, model)
        x = w[:, "xyz".index(axis)]
        asymmetry, second, third, hysteresis = (
            instrument.coefficients.get(f"{symbol}_{axis}", 0.0)
            for symbol in ("S_asym", "S2", "S3", "S_hyst")
        )
        bent = 0.5 * asymmetry * np.abs(x) + second * x**2 + third * x**3
        bent = bent + 0.5 * hysteresis * full_scale * way
        linear = model.linear(values)
        y.append(model.regressors(f, w) @ linear + linear[model.symbols.index(f"S_{axis}")] * bent)
    outputs: Array = np.stack(y, axis=-1)
    bias = np.array([instrument.coefficients.get(f"D_F_{channel[-1]}", 0.0) for channel in channels])
    outputs = disturbed(outputs, bias, t, other, rng)
    if instrument.noise is not None:
        outputs = outputs + rng.normal(0.0, instrument.noise, outputs.shape)
    degrees = parse_unit("deg")
    one, numbers = parse_unit("1"), np.arange(1.0, n + 1.0)
    return record_of(
        [
            ("position", one, numbers),
            *([("joint", one, turning + 1.0)] if test.legs else []),
            ("rate", parse_unit("deg/s"), np.degrees(rate)),
            *((name, degrees, np.round(np.degrees(angles[:, k]), 12)) for k, name in enumerate(chain.joints)),
            *(
                (channel, instrument.unit, outputs[:, k] / instrument.unit.factor)
                for k, channel in enumerate(channels)
            ),
        ],
        t,
    )


def _felt(
    settings: TurntableSettings,
    chain: Chain,
    joint: str,
    angles: Array,
    rate: Array,
    errors: Array,
    both: Array | None,
) -> tuple[Array, Array]:
    """Mean rate [rad/s] and specific force [m/s^2] (n, 3) on the instrument's axes while a joint turns.

    ``errors`` (n, k) of the table; ``both`` (2 n, k) those at start and end where some follow the angle.
    """
    duration, latitude = settings.instrument.dwell, settings.site.latitude
    assert latitude is not None
    at_ends = None if both is None else _at_ends(chain, joint, angles, rate, duration, both)
    turning = chain.joints.index(joint)
    chain = settled(chain, joint, angles)
    errors = np.where(chain.std > 0.0, errors, 0.0)
    turn = arc(angles[:, turning], rate * duration)
    w = sensed(chain, joint, rate_reference(latitude), rate, angles, turn, errors)
    f_n = -gravity_reference(settings.site.gravity)
    f = over_turn(lambda at: f_n @ chain.attitude(at, errors), angles, turning, turn)
    return w if at_ends is None else w + at_ends, f


def _at_ends(chain: Chain, joint: str, angles: Array, rate: Array, duration: float, both: Array) -> Array:
    """Change (n, 3) of the mean rates by what follows the turning joint; ``both`` (2 n, k) errors at start and end."""
    n, made = len(angles), np.zeros((len(angles), 3))
    for i, axis in enumerate(np.eye(3)):
        arcs = (joint, angles, rate * duration, duration, axis)
        made[:, i] = known_change(chain, *arcs)
        for each in ends(chain, *arcs):
            drawn = both[:, chain.factors.index(each.error.name)].reshape(2, n)
            values = np.zeros(each.change.shape[1])
            values[each.numbers.ravel()] = drawn.ravel()
            made[:, i] += each.change @ values
    return made
