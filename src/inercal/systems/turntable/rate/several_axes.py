"""Rate test in which several axes turn in sequence: every gyro about its own axis and across the others.

A leg is the stays about one joint while the others stand. Of gyro i, in a leg about axis k of the instrument::

    y = D_F_i,leg + S_i (x_i + S_asym |x_i| / 2 + S2 x_i^2 + S3 x_i^3 + T_ik w_k)

x_i the rate about its axis as table and Earth make it, w_k that about the turning axis. One fit takes the stays of all
legs: that about its own axis tells S_i, the others T_ik. The bias is another in each leg, since gravity acts elsewhere
on the gyro; D_F_i is that of the first leg about its own axis.

Gyros across the turning axis in a rate test: what they see of its rate is their misalignment.

Of gyro i while the table turns about axis k of the instrument::

    y = D_F_i + S_i (x_i + T_ik w_k)

x_i the rate about its axis as the table and the Earth make it, w_k that about the turning axis. At nearly no rate about
its own axis, such a gyro does not tell S_i: the study states it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.outcome import unit_of_term
from inercal.systems.turntable.rate.ends import settled
from inercal.systems.turntable.rate.fit import (
    ROUNDS,
    Across,
    GyroRateFit,
    fit_rates,
    levels,
    weighted,
    weights_of,
)
from inercal.systems.turntable.rate.linearity import SEED
from inercal.systems.turntable.rate.stays import Effect, Input, RateDwells, gyro_input, turning_axis
from inercal.systems.turntable.readings import apart
from inercal.systems.turntable.regression import FLOOR
from inercal.systems.turntable.settings import RateTest, TurntableSettings
from inercal.systems.turntable.weights import scatter


def axis_about(along: Array) -> str:
    """Axis of the instrument along which the turning axis (n, 3) lies in all stays; empty where there is none."""
    for k, axis in enumerate("xyz"):
        if np.abs(np.delete(along, k, axis=1)).max() < LIMITS.across_cosine:
            return axis
    return ""


def fit_across(
    dwells: RateDwells, settings: TurntableSettings, axis: str, about: str
) -> tuple[Input, GyroRateFit]:
    """Bias and misalignment of a gyro that lies across the turning axis.

    Parameters
    ----------
    dwells : RateDwells
    settings : TurntableSettings
        With S of the gyro among the stated coefficients; it counts with its standard uncertainty.
    axis, about : str
        ``x``, ``y`` or ``z`` of the gyro, and of the instrument along the turning axis.

    Returns
    -------
    Input
        Of the gyro; S and the rate of the table are among its effects.
    RateFit
        D_F and T; its residuals are those of the fit.
    """
    instrument, test = settings.instrument, settings.rate_test
    assert test is not None
    S = instrument.coefficients[f"S_{axis}"]
    given, w = (
        gyro_input(dwells, settings, "xyz".index(axis)),
        gyro_input(dwells, settings, "xyz".index(about)),
    )
    y = dwells.y[:, dwells.channels.index(f"gyro_{axis}")]
    rest, n = y - S * given.x, len(y)
    rows = np.column_stack([np.ones(n), S * w.x])
    floor = FLOOR * float(np.sqrt(np.mean(np.square(y))) or 1.0)
    D, T = np.linalg.lstsq(rows, rest, rcond=None)[0]
    for _ in range(ROUNDS):
        own = _with_scales(given, dwells, settings, axis, T, w)
        weight = weights_of(own.effects, S, n)
        noise = scatter(rows[:, None, :], rest[:, None], weight, [instrument.noise], np.array([floor]))
        solution = weighted(rows, rest, weight, float(noise.std[0]))
        D, T = solution.c
    gain = solution.gain[:, :, 0]
    fit = GyroRateFit(
        axis,
        (f"D_F_{axis}", f"T_{axis}{about}"),
        np.array([D, T]),
        (),
        gain,
        S,
        rest - rows @ solution.c,
        np.eye(n) - rows @ gain,
        float(noise.std[0]),
        float(noise.dof[0]),
        solution.chi2,
        n - 2,
        np.arange(n),
    )
    return own, fit


def _with_scales(
    given: Input, dwells: RateDwells, settings: TurntableSettings, axis: str, T: float, w: Input
) -> Input:
    """The input with what T makes of the uncertain rate of the table, and of a stated S that is uncertain."""
    test, instrument, S = settings.rate_test, settings.instrument, f"S_{axis}"
    assert test is not None
    effects = [each for each in given.effects if each.source != "rate of the table"]
    if test.rate_u > 0.0:
        shift = dwells.rate * (given.gain + T * w.gain) * test.rate_u
        effects.append(Effect("rate of the table", test.rate_u, "1", shift[:, None]))
    if u := instrument.coefficients_u.get(S, 0.0):
        shift = (given.x + T * w.x) * (u / instrument.coefficients[S])
        effects.append(Effect(f"stated {S}", u, unit_of_term(S, dwells.unit.si), shift[:, None]))
    return replace(given, effects=tuple(effects))


def excess_across(fit: GyroRateFit) -> list[Finding]:
    """A finding where the readings scatter about the straight line by more than their stated noise."""
    from scipy.special import chdtrc

    if fit.dof < 1 or np.isfinite(fit.noise_dof) or chdtrc(fit.dof, fit.chi2) >= LIMITS.misfit_probability:
        return []
    text = (
        f"gyro_{fit.axis} misses the straight line over the rate of the table by {np.sqrt(fit.chi2 / fit.dof):.1f} "
        f"times what the stated noise and the table explain: {fit.names[1]} may be off"
    )
    return [Finding("excess_scatter", text, harm=fit.names)]


@dataclass(frozen=True, eq=False)
class LegStays:
    """A leg: the ``joint`` that turns, its ``stays`` (indices), and the axis of the instrument it turns ``about``."""

    joint: str
    stays: NDArray[np.int64]
    about: str


def legs_of(dwells: RateDwells, settings: TurntableSettings) -> list[LegStays]:
    """Legs of a test, in the order in which they begin; ``about`` is empty where no axis of the instrument is along."""
    joints, made, left = settings.chain.joints, [], list(range(len(dwells.rate)))
    while left:
        turning = dwells.joint[left[0]]
        others = [k for k in range(len(joints)) if k != turning]
        away = np.abs(apart(dwells.angles[left][:, others], dwells.angles[left[0], others])).max(
            axis=1, initial=0.0
        )
        same = (dwells.joint[left] == turning) & (away <= LIMITS.position_angle)
        stays = np.array(left)[same]
        part, joint = dwells.some(stays), joints[turning]
        about = axis_about(turning_axis(settled(settings.chain, joint, part.angles), joint, part.angles))
        made.append(LegStays(joint, stays, about))
        left = [k for k in left if k not in set(stays.tolist())]
    return made


def unfit(legs: Sequence[LegStays], dwells: RateDwells) -> list[tuple[LegStays, str]]:
    """Legs that tell nothing of misalignments, and why."""
    wrong = []
    for leg in legs:
        if not leg.about:
            wrong.append((leg, "no axis of the instrument lies along the turning axis"))
        elif len(levels(dwells.rate[leg.stays])) < 2:
            wrong.append((leg, "it has one rate alone, expected two or more"))
    return wrong


def left_out(wrong: Sequence[tuple[LegStays, str]]) -> list[Finding]:
    """A finding for each leg that is left out."""
    return [
        Finding(
            "weak_term",
            f"the {len(leg.stays)} stays with {leg.joint} turning are left out: {why}",
            f"stay {leg.stays[0] + 1}",
        )
        for leg, why in wrong
    ]


def fit_axes(
    dwells: RateDwells,
    settings: TurntableSettings,
    legs: Sequence[LegStays],
    axis: str,
    asymmetry: bool,
    full_scale: float,
) -> tuple[Input, GyroRateFit]:
    """Fit a gyro that some leg turns about its own axis, by the stays of all legs.

    Parameters
    ----------
    dwells : RateDwells
    settings : TurntableSettings
    legs : sequence of LegStays
        Each about an axis of the instrument, all stays in one of them.
    axis : str
        ``x``, ``y`` or ``z`` of the gyro.
    asymmetry : bool
        Whether the rates separate S_asym from the other terms.
    full_scale : float
        rad/s
    """
    test, n = settings.rate_test, len(dwells.rate)
    assert test is not None
    y = dwells.y[:, dwells.channels.index(f"gyro_{axis}")]
    given = _input(dwells, settings, legs, axis, test)
    others = [k for k in "xyz" if k != axis and any(leg.about == k for leg in legs)]
    about = np.empty(n, dtype="<U1")
    for leg in legs:
        about[leg.stays] = leg.about
    rates = np.zeros((n, len(others)))
    for j, k in enumerate(others):
        rates[:, j] = _input(dwells, settings, legs, k, test).x
    first = next(leg for leg in legs if leg.about == axis)
    bias = np.zeros((n, len(legs) - 1))
    for j, leg in enumerate(leg for leg in legs if leg is not first):
        bias[leg.stays, j] = 1.0
    across = Across(about == axis, bias, tuple(f"T_{axis}{k}" for k in others), rates)

    def fit(own: Input) -> GyroRateFit:
        noise, rng = settings.instrument.noise, np.random.default_rng(SEED)
        return fit_rates(axis, dwells.rate, y, own, noise, test.order, asymmetry, full_scale, rng, across)

    found = fit(given)
    if test.rate_u > 0.0 and others:
        T = np.array([found.values[found.names.index(name)] for name in across.names])
        given = _with_rate(given, rates @ T * test.rate_u, test.rate_u)
        found = fit(given)
    return given, found


def _with_rate(given: Input, shift: Array, u: float) -> Input:
    """The input with what misalignments make of the uncertain rate of the table."""
    source = "rate of the table"
    effects = [
        replace(each, shift=each.shift + shift[:, None]) if each.source == source else each
        for each in given.effects
    ]
    if not any(each.source == source for each in effects):
        effects.append(Effect(source, u, "1", shift[:, None]))
    return replace(given, effects=tuple(effects))


def _input(
    dwells: RateDwells, settings: TurntableSettings, legs: Sequence[LegStays], axis: str, test: RateTest
) -> Input:
    """The input of a gyro over all legs.

    A constant error of the table, its rate and the latitude are the same in all of them. Others (cosines of
    misalignments, errors that follow the angle of the turning joint) count as independent from leg to leg.
    """
    n, parts = len(dwells.rate), []
    for leg in legs:
        of_leg = replace(settings, rate_test=replace(test, joint=leg.joint))
        parts.append(gyro_input(dwells.some(leg.stays), of_leg, "xyz".index(axis)))
    x, gain = np.zeros(n), np.zeros(n)
    for leg, part in zip(legs, parts, strict=True):
        x[leg.stays], gain[leg.stays] = part.x, part.gain
    throughout = {"latitude", "rate of the table", *(error.source for error in settings.chain.errors)}
    keys = dict.fromkeys((each.source, each.redrawn) for part in parts for each in part.effects)
    effects = []
    for source, redrawn in keys:
        own = [
            next((each for each in part.effects if (each.source, each.redrawn) == (source, redrawn)), None)
            for part in parts
        ]
        widths = [0 if each is None else each.shift.shape[1] for each in own]
        shared = redrawn or (source in throughout and max(widths) == 1)
        begins = max(widths) * np.arange(len(legs)) * (not shared)
        shift = np.zeros((n, max(widths) * (1 if shared else len(legs))))
        for leg, each, begin, width in zip(legs, own, begins, widths, strict=True):
            if each is not None:
                shift[leg.stays, begin : begin + width] = each.shift
        one = next(each for each in own if each is not None)
        # an error of scope angle is redrawn where its joint turns, and stands where that stands
        both = (source, not redrawn) in keys and not redrawn
        effects.append(replace(one, source=f"{source}, standing" if both else source, shift=shift))
    return Input(x, gain, tuple(effects))
