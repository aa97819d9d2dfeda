"""Threshold, dead zone and hysteresis of accelerometers from a test by small steps: readings, fit, evidence.

The estimate of a test by small steps: terms with covariance and budget, the response, and verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.result import Estimate
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import FRAME
from inercal.systems.turntable.positions.outcome import COMMAND, unit_of_term
from inercal.systems.turntable.readings import Readings, readings
from inercal.systems.turntable.regression import FLOOR
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.step_response import Response, Tilted, respond, senses

MODEL = Formula(
    r"$y = K_0 + K_1 (x - d + s K_{\mathrm{hyst}}/2) + D t$, $D$ the drift, $x$ the specific force along the axis, "
    r"$s = +1$ where it was last raised, $-1$ lowered; within the dead zone, of width $K_{\mathrm{dz}}$ about $m$, "
    r"$d = x - m$; below it $d = -q$, above it $q$, from 0 to $K_{\mathrm{dz}}/2$; "
    r"$K_{\mathrm{th}} = \max(K_{\mathrm{dz}}/2, 2 q)$"
)

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "IEEE Std 528, Standard for inertial sensor terminology: threshold, dead zone, hysteresis error",
    "IEEE Std 1293, Specification format guide and test procedure for linear single-axis, nongyroscopic accelerometers",
)

_UG, _UG_SIZE = shown_unit("m/s^2")


def assemble(
    record: Record,
    means: Readings,
    settings: TurntableSettings,
    findings: Sequence[Finding],
    inputs: tuple[Tilted, ...],
    responses: tuple[Response, ...],
) -> Estimate:
    """Put the estimate together."""
    unit = means.unit.si
    names = tuple(name for each in responses for name in each.names)
    values = np.concatenate([each.values for each in responses])
    uncertainty = combine(names, sources(settings, inputs, responses, values, unit))
    u = dict(zip(names, uncertainty.u.tolist(), strict=True))
    return Estimate.of(
        _basis(record, means, settings, inputs),
        names,
        [unit_of_term(name, unit) for name in names],
        values,
        uncertainty,
        _verdict(means, inputs, responses, u),
        findings=[*findings, *(found for each in responses for found in _findings(each, u, means.times))],
        statistics={
            "dof": float(min(each.dof for each in responses)),
            "residual_rms": float(np.sqrt(np.mean([np.square(each.residuals) for each in responses]))),
            "positions": float(len(means.y)),
        },
        result={
            "instrument": settings.instrument.kind,
            "steps": [
                row
                for given, each in zip(inputs, responses, strict=True)
                for row in _rows(means, given, each)
            ],
        },
    )


def unobservable(
    record: Record, means: Readings, settings: TurntableSettings, findings: Sequence[Finding], message: str
) -> Estimate:
    """An estimate without terms."""
    return Estimate.without(
        _basis(record, means, settings, ()),
        Status.UNOBSERVABLE,
        message,
        findings=findings,
        statistics={"positions": float(len(means.y))},
        result={"instrument": settings.instrument.kind, "steps": []},
    )


def sources(
    settings: TurntableSettings,
    inputs: Sequence[Tilted],
    responses: Sequence[Response],
    values: Array,
    unit: str,
) -> list[TypeA | TypeB]:
    """Everything the terms are uncertain by: noise and steps, errors of the table, gravity."""
    ends = np.cumsum([0, *(len(each.values) for each in responses)]).tolist()
    blocks = [slice(a, b) for a, b in pairwise(ends)]
    p, made = ends[-1], list[TypeA | TypeB]()
    for each, block in zip(responses, blocks, strict=True):
        covariance = np.zeros((p, p))
        covariance[block, block] = each.covariance
        made.append(
            TypeA(f"noise and steps of acc_{each.axis}", each.noise, unit, covariance, each.noise_dof)
        )
    for k, error in enumerate(settings.chain.errors):
        std, shift = error.distribution.std, np.zeros(p)
        if error.scope.constant and std > 0.0:
            for given, block in zip(inputs, blocks, strict=True):
                shift[block.start] = values[block.start + 1] * given.level[k] / std
            made.append(TypeB(error.source, std, "m" if error.is_offset else "rad", shift))
    for given, block in zip(inputs, blocks, strict=True):
        if given.blur > 0.0:  # the two edges lie where two readings were made
            edges = np.zeros((p, 2))
            width, threshold = values[block.start + 2], values[block.start + 3]
            edges[block.start + 2] = [-1.0, 1.0]
            edges[block.start + 3] = [-1.0, 1.0] if not width else np.array([-1.0, 1.0]) * threshold / width
            made.append(
                TypeB(f"table at the steps of {given.channel}", given.blur, "m/s^2", edges, redrawn=True)
            )
    for site in settings.site.inputs:
        shift = np.zeros(p)
        for block in blocks:
            shift[block.start + 1] = -values[block.start + 1]
            shift[block.start + 2 : block.stop] = values[block.start + 2 : block.stop]
        relative = site.sensitivity / settings.site.gravity
        made.append(TypeB(site.source, site.u, site.unit, shift * relative))
    return made


def _verdict(
    means: Readings, inputs: Sequence[Tilted], responses: Sequence[Response], u: dict[str, float]
) -> tuple[Status, str]:
    """Status and its sentence."""
    from scipy.special import chdtrc

    for given, each in zip(inputs, responses, strict=True):
        K1 = abs(float(each.values[1]))
        if LIMITS.scale_sigmas * u[f"K1_{each.axis}"] > K1:
            return Status.INCONSISTENT, (
                f"the output of {given.channel} does not follow the steps: check channel, axis and units, or take "
                "larger ones"
            )
        chi2 = float(np.sum(np.square(each.residuals / each.noise)))
        if np.isinf(each.noise_dof) and chdtrc(each.dof, chi2) < LIMITS.misfit_probability:
            return Status.INCONSISTENT, (
                f"the readings of {given.channel} miss the response by {np.sqrt(chi2 / each.dof):.2g} times what the "
                "stated noise and the table explain: check noise and units"
            )
        if each.at_end > LIMITS.edge_at_end:
            return Status.ILL_CONDITIONED, (
                f"the dead zone of {given.channel} reaches as far as the steps: tilt it farther on both sides"
            )
        y = np.sort(means.y[:, means.channels.index(given.channel)])
        coarse = float(np.median(np.diff(np.unique(y)))) / K1 if len(np.unique(y)) > 1 else 0.0
        step = float(np.median(np.diff(np.unique(given.x))))
        if coarse > 1.5 * step and len(np.unique(y)) < len(y) // 2:
            return Status.ILL_CONDITIONED, (
                f"the output of {given.channel} moves in steps of {coarse / _UG_SIZE:.3g} {_UG}, its input in such of "
                f"{step / _UG_SIZE:.3g}: its dead zone cannot be told from its resolution; average samples with noise"
            )
    return Status.OK, f"{counted(len(u), 'term')} from {counted(len(means.y), 'small step')}"


def _findings(response: Response, u: dict[str, float], t: Array) -> list[Finding]:
    """Findings about a response: a dead zone, a hysteresis, a drift that is no straight line."""
    from scipy.special import stdtr

    found, values = [], dict(zip(response.names, response.values.tolist(), strict=True))
    channel = f"acc_{response.axis}"
    width, threshold, hysteresis = (f"{symbol}_{response.axis}" for symbol in ("K_dz", "K_th", "K_hyst"))
    if values[width] > LIMITS.term_sigmas * u[width]:
        text = (
            f"{channel} does not respond to {values[width] / _UG_SIZE:.3g} {_UG} of its input "
            f"(u {u[width] / _UG_SIZE:.2g}), and its threshold is {values[threshold] / _UG_SIZE:.3g} {_UG} "
            f"(u {u[threshold] / _UG_SIZE:.2g})"
        )
        found.append(Finding("dead_zone", text))
    if abs(values.get(hysteresis, 0.0)) > LIMITS.term_sigmas * u.get(hysteresis, 0.0):
        text = (
            f"{channel} reads {values[hysteresis] / _UG_SIZE:.3g} {_UG} (u {u[hysteresis] / _UG_SIZE:.2g}) more after "
            "its input was raised than after it was lowered"
        )
        found.append(Finding("hysteresis", text))
    dof = response.dof - 1
    if dof > 0:
        time = (t - t.mean()) / (float(np.ptp(t)) or 1.0)
        columns = response.columns
        curve = time**2 - columns @ np.linalg.lstsq(columns, time**2, rcond=None)[0]
        size = float(curve @ curve)
        bend = float(curve @ response.residuals) / size if size > 0.0 else 0.0
        left = response.residuals - bend * curve
        noise = response.noise if np.isinf(response.noise_dof) else float(np.sqrt(left @ left / dof))
        score = abs(bend) * np.sqrt(size) / noise if noise > 0.0 else 0.0
        if 2.0 * stdtr(dof if np.isfinite(response.noise_dof) else 1e9, -score) < LIMITS.residual_risk:
            text = (
                f"the bias of {channel} drifts, and not steadily: by up to "
                f"{abs(0.25 * bend / response.values[1]) / _UG_SIZE:.2g} {_UG} off a straight line"
            )
            action = "let it settle, or take the steps faster"
            found.append(Finding("trend", text, harm=response.names, action=action))
    return found


def _rows(means: Readings, given: Tilted, response: Response) -> list[dict[str, Any]]:
    """Input, output, response and residual at each step, in the order taken."""
    way = {1: "raised", -1: "lowered", 0: "first"}
    y = means.y[:, means.channels.index(given.channel)]
    return [
        {
            "channel": given.channel,
            "input_m_s2": float(given.x[k]),
            "output": float(y[k]),
            "response": float(response.line[k]),
            "residual": float(response.residuals[k]),
            "input_was": way[int(given.sense[k])],
        }
        for k in range(len(y))
    ]


def _basis(record: Record, means: Readings, settings: TurntableSettings, inputs: Sequence[Tilted]) -> Basis:
    """The basis of every estimate of such a test."""
    ranges = {f"input_of_{each.channel}_m_s2": [float(each.x.min()), float(each.x.max())] for each in inputs}
    conditions = conditions_of(
        settings, recorded_temperature(record), ranges, frame=FRAME, output_unit=means.unit.symbol
    )
    return studied(
        COMMAND, settings, (*record.sources, *settings.chain.sources), MODEL, REFERENCES, conditions
    )


@short_repr
@dataclass(frozen=True, eq=False)
class StepCalibration:
    """An ``estimate``, and the evidence behind it: readings, inputs and responses of the accelerometers."""

    estimate: Estimate
    readings: Readings
    inputs: tuple[Tilted, ...] = ()
    responses: tuple[Response, ...] = ()

    @property
    def shown(self) -> Estimate:
        """The estimate in units of the field."""
        return displayed(self.estimate, self.readings.unit)


def calibrate_steps(record: Record, settings: TurntableSettings) -> StepCalibration:
    """Find threshold, dead zone and hysteresis of the accelerometers that a table tilts by small steps about level.

    Parameters
    ----------
    record : Record
        Angles of the table and ``acc_x`` .. in the order taken: a row for each step (its mean), or samples with a
        ``position`` number for each step.
    settings : TurntableSettings
        With a ``step_test``, and an instrument of kind accelerometer.

    Raises
    ------
    InputError
        The record has no angles or accelerometers, or the study does not fit it.
    """
    instrument, chain = settings.instrument, settings.chain
    check_step_test(settings)
    means = readings(record, chain.joints, instrument.kind, by_row=True)
    if instrument.noise is not None and instrument.unit.dimension != means.unit.dimension:
        raise StudyError(
            "instrument.unit",
            f"noise is stated for outputs in {instrument.unit.symbol}, and the record's are in "
            f"{means.unit.symbol}, expected the same kind of unit",
        )
    findings = [*record.findings, *means.findings]
    inputs = []
    f = -gravity_reference(settings.site.gravity) @ chain.attitude(means.angles)
    widest = float(np.ptp(f, axis=0).max())
    for channel in means.channels:
        x = f[:, "xyz".index(channel[-1])]
        if np.abs(x).max() > LIMITS.small_step or np.ptp(x) < 0.5 * widest or not widest:
            text = f"{channel} is not tilted about level by the steps and is left out"
            findings.append(Finding("weak_term", text))
            continue
        inputs.append(_tilted(channel, x, means, settings))
    fewest = LIMITS.fewest_steps
    if not inputs or len(means.y) < fewest or min(len(np.unique(each.x)) for each in inputs) < fewest:
        least = 1e6 * LIMITS.small_step / settings.site.gravity
        text = (
            f"no accelerometer of the record is tilted about level (within {least:.0f} ug)"
            if not inputs
            else f"found {len(means.y)} steps, expected at least {fewest}, at as many angles"
        )
        return StepCalibration(unobservable(record, means, settings, findings, text), means)
    responses = tuple(_response(each, means, settings) for each in inputs)
    estimate = assemble(record, means, settings, findings, tuple(inputs), responses)
    return StepCalibration(estimate, means, tuple(inputs), responses)


def check_step_test(settings: TurntableSettings) -> None:
    """Refuse a study that cannot be a test by small steps; raises StudyError."""
    if settings.instrument.kind != "accelerometer":
        raise StudyError(
            "instrument.kind",
            f'found "{settings.instrument.kind}", expected "accelerometer" for a test by small steps',
        )
    if settings.rate_test is not None:
        raise StudyError("step_test", "found beside rate_test, expected one of them")


def _tilted(channel: str, x: Array, means: Readings, settings: TurntableSettings) -> Tilted:
    """The input of an accelerometer, and what the table makes of it."""
    chain, v = settings.chain, np.eye(3)["xyz".index(channel[-1])]
    f_n = -gravity_reference(settings.site.gravity)
    shift = (f_n @ chain.slopes(means.angles) @ v) * chain.std  # (n, k)
    constant = np.array([error.scope.constant for error in chain.errors], dtype=bool)
    blur = float(np.sqrt(np.mean(np.square(shift[:, ~constant]).sum(axis=1)))) if chain.errors else 0.0
    return Tilted(channel, x, senses(x), shift.mean(axis=0) * constant, blur)


def _response(tilted: Tilted, means: Readings, settings: TurntableSettings) -> Response:
    """The response of an accelerometer; errors of the table that are redrawn add to a stated noise."""
    y = means.y[:, means.channels.index(tilted.channel)]
    noise = settings.instrument.noise
    if noise is not None:
        noise = float(np.hypot(noise, np.polyfit(tilted.x, y, 1)[0] * tilted.blur))
    floor = FLOOR * float(np.sqrt(np.mean(np.square(y))) or 1.0)
    return respond(tilted.channel[-1], tilted.x, tilted.sense, means.times, y, noise, floor)
