"""Simulated tests on a table, by positions, rates or small steps: an instrument of known coefficients, errors of the
table by scope, noise, and disturbances that its study leaves out.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.rigs.chain import Chain, Fixed, Scope, follows_angle
from inercal.foundation.rigs.outputs import gravity_reference, rate_reference
from inercal.foundation.rigs.plans import Plan
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, channels_of, stated_values, table_model
from inercal.systems.turntable.rate.calibration import check_rate_test
from inercal.systems.turntable.rate.ends import ends, known_change, settled
from inercal.systems.turntable.rate.fit import approaches
from inercal.systems.turntable.rate.stays import arc, over_turn, sensed
from inercal.systems.turntable.settings import Disturbances, StepTest, TurntableSettings
from inercal.systems.turntable.step_test import check_step_test


def truth(settings: TurntableSettings) -> tuple[TableModel, Array]:
    """The model of all terms, and its linear coefficients (p,) from what the study states."""
    everything = replace(settings, instrument=replace(settings.instrument, terms=_all_terms(settings)))
    model = table_model(everything, channels_of(settings))
    parts = [channel.linear(stated_values(settings, channel)) for channel in model.channels]
    return model, np.concatenate(parts)


def simulate_positions(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """Take the plan's positions one after the other and record the instrument.

    Parameters
    ----------
    settings : TurntableSettings
        The stated coefficients are the truth; each error of the table is drawn by its scope, and its disturbances
        are added.
    rng : Generator

    Returns
    -------
    Record
        ``position``, commanded angles [deg] and outputs: one row for each position (the mean over the dwell,
        at its middle), or all samples where the study gives a rate. An error of scope ``sample`` is redrawn at
        every sample; without a rate, a position has only one.

    Raises
    ------
    StudyError
        Too many samples.
    """
    other = settings.disturbances
    model, c = truth(replace(settings, chain=displaced(settings.chain, other)))
    instrument, plan = settings.instrument, settings.plan
    n = len(plan)
    per_dwell = instrument.samples
    if n * per_dwell > LIMITS.most_samples:
        raise StudyError(
            "instrument.sample_rate",
            f"found {n * per_dwell:.4g} samples in all, expected at most {LIMITS.most_samples:.0e}",
        )
    errors = np.repeat(model.chain.draw(rng, plan.angles)[:, None, :], per_dwell, axis=1)
    for k, error in enumerate(model.chain.errors):
        if error.scope is Scope.SAMPLE:
            errors[..., k] = error.distribution.sample(rng, (n, per_dwell))
    begin = instrument.dwell * np.arange(n)[:, None]
    t = (begin + instrument.dwell * (np.arange(per_dwell) + 0.5) / per_dwell).ravel()
    true = true_angles(plan.angles, model.chain.joints, other, rng)[:, None, :]
    y = model.outputs(true, c, errors)
    if other.magnetic:
        axes = ["xyz".index(channel.channel[-1]) for channel in model.channels]
        y = y + magnetic_field(model.chain.attitude(true, errors), other)[..., axes]
    if other != Disturbances():
        bias = [
            channel.regressors(np.zeros(3), np.zeros(3)) @ c[block]
            for channel, block in zip(model.channels, model.blocks, strict=True)
        ]
        y = disturbed(y.reshape(len(t), -1), np.array(bias), t, other, rng).reshape(y.shape)
    if instrument.noise is not None:
        y = y + rng.normal(0.0, instrument.noise * np.sqrt(per_dwell), y.shape)
    angles = np.repeat(plan.angles, per_dwell, axis=0)
    columns = [("position", parse_unit("1"), np.repeat(np.arange(1.0, n + 1.0), per_dwell))]
    columns += [
        (name, parse_unit("deg"), np.round(np.degrees(angles[:, k]), 12))
        for k, name in enumerate(model.chain.joints)
    ]
    columns += [
        (channel.channel, instrument.unit, y[..., k].ravel() / instrument.unit.factor)
        for k, channel in enumerate(model.channels)
    ]
    return record_of(columns, t)


def _all_terms(settings: TurntableSettings) -> tuple[str, ...]:
    """Every term of the instrument's channels."""
    kind = settings.instrument.kind
    return tuple(
        symbol for channel in channels_of(settings) for symbol in channel_model(kind, channel).symbols
    )


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


def simulate_step_test(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """Tilt the table by the steps of the study and record the accelerometers.

    Parameters
    ----------
    settings : TurntableSettings
        The dead zone and hysteresis are those of its disturbances.
    rng : Generator

    Returns
    -------
    Record
        As `inercal.systems.turntable.simulate.simulate_positions` gives it.

    Raises
    ------
    StudyError
        An instrument that is no accelerometer, or too many samples.
    """
    check_step_test(settings)
    test, joints = settings.step_test, settings.chain.joints
    assert test is not None
    tilts = sequence(test)
    angles = np.tile(test.at.of(joints), (len(tilts), 1))
    angles[:, joints.index(test.joint)] += tilts
    return simulate_positions(replace(settings, plan=Plan("steps", angles)), rng)


def sequence(test: StepTest) -> Array:
    """Tilts (n,) [rad] from level, in the order taken."""
    count = max(1, round(test.largest / test.step))
    up, down = np.arange(count + 1), np.arange(count - 1, -count - 1, -1)
    once = np.concatenate([up, down, np.arange(-count + 1, 1)])
    return np.asarray(test.step * np.concatenate([once, *[once[1:]] * (test.cycles - 1)]), dtype=float)


def displaced(chain: Chain, other: Disturbances) -> Chain:
    """The table on a base that stands otherwise than its study says: about up, then north, then west."""
    turns = [("z", other.heading), ("x", other.tilt_north), ("y", other.tilt_west)]
    if not any(angle for _, angle in turns):
        return chain
    rotation = np.linalg.multi_dot(
        [elementary("z", turns[0][1]), elementary("x", turns[1][1]), elementary("y", turns[2][1])]
    )
    return Chain((Fixed(rotation), *chain.elements))


def true_angles(
    angles: Array, joints: tuple[str, ...], other: Disturbances, rng: np.random.Generator
) -> Array:
    """Angles (n, joints) [rad] at which a table stands for those commanded: its encoders err."""
    true = angles.copy()
    if other.angle > 0.0:
        for k in range(len(joints)):
            commanded = np.round(np.remainder(angles[:, k], 2.0 * np.pi), 9)
            each, of = np.unique(commanded, return_inverse=True)
            true[:, k] += rng.normal(0.0, other.angle, len(each))[of]
    for wave in other.harmonics:
        k = joints.index(wave.joint)
        true[:, k] += wave.amplitude * np.sin(wave.order * angles[:, k] + wave.phase)
    return true


def disturbed(y: Array, bias: Array, t: Array, other: Disturbances, rng: np.random.Generator) -> Array:
    """Outputs with what acts on them over a test.

    Parameters
    ----------
    y : (n, c)
        Outputs of the instrument without noise, in the order of time.
    bias : (c,)
        Output at no input.
    t : (n,) s
    other : Disturbances
    rng : Generator

    Returns
    -------
    (n, c)
    """
    if other.dead_zone > 0.0:
        y = np.where(np.abs(y - bias) < other.dead_zone, bias, y)
    if other.hysteresis:
        y = y + 0.5 * other.hysteresis * _directions(y)
    elapsed = t - t[0]
    length = float(elapsed[-1]) or 1.0
    part = (elapsed / length)[:, None]
    if other.scale_drift:
        y = bias + (y - bias) * (1.0 + other.scale_drift * part)
    y = y + other.ramp * part + other.warm_up * np.exp(-elapsed / other.warm_up_time)[:, None]
    if other.random_walk > 0.0:
        steps = np.sqrt(np.diff(part, axis=0, prepend=0.0)) * rng.standard_normal(y.shape)
        y = y + other.random_walk * np.cumsum(steps, axis=0)
    return np.asarray(y)


def magnetic_field(C_nb: Array, other: Disturbances) -> Array:
    """Output (*batch, 3) that a field fixed to the ground, to the north and down, makes along x, y, z."""
    field = np.array([np.cos(other.dip), 0.0, -np.sin(other.dip)])
    return np.asarray(other.magnetic * (field @ C_nb))


def _directions(y: Array) -> Array:
    """+1 (n, c) where an output was last raised, -1 where lowered; 0 before it changes."""
    sign = np.sign(np.diff(y, axis=0, prepend=y[:1]))
    for k in range(1, len(sign)):
        sign[k] = np.where(sign[k] == 0.0, sign[k - 1], sign[k])
    return np.asarray(sign)
