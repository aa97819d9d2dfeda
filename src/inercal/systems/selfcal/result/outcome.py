"""The estimate of a self-calibration: coefficients, covariance, budget and verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import CODES, EVERYTHING, Finding, Status, causes
from inercal.foundation.inference.consistency import Nis, nis
from inercal.foundation.inference.identifiability import HALF_SEEN, UNSEEN
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.records.places import counted
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import BudgetItem, combine
from inercal.foundation.results.remarks import at_prior, exact_inputs, missed, reached, singular
from inercal.foundation.results.result import Estimate
from inercal.systems.selfcal.before.bounds import PathBounds, recorded_bounds
from inercal.systems.selfcal.before.observability import Observability, not_positive, observability, useless
from inercal.systems.selfcal.diagnosis.examination import with_stated
from inercal.systems.selfcal.diagnosis.passed import PlatformPass, pass_of
from inercal.systems.selfcal.estimators import ESTIMATORS, FACTOR_OF
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import NAMES, product_slope, to_product, units
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.platform.states import ALL, BIAS_WALK, EXTENDED_MODEL, KIND_OF, STATES, UNIT_OF
from inercal.systems.selfcal.result.budget import considered, stated_errors, systematic, within
from inercal.systems.selfcal.result.unmodelled import SOURCE as UNMODELLED
from inercal.systems.selfcal.result.unmodelled import unmodelled
from inercal.systems.selfcal.settings import SelfcalSettings

COMMAND = "selfcal"

FRAME = "p, of the platform: X_p along accelerometer x, Y_p in the plane of accelerometers x and y"

MODEL = Formula(
    r"$w_{Ip}^p = w_c + M w_c + \mathrm{kg}_0$, $M = \begin{bmatrix}0 & \mathrm{ds}_x & -\mathrm{do}_x \\ "
    r"-\mathrm{do}_y & 0 & \mathrm{ds}_y \\ \mathrm{ds}_z & -\mathrm{do}_z & 0\end{bmatrix}$; "
    r"$a_x = \mathrm{ka}_{0,x} + (1 + \mathrm{ka}_{1,x}) f_x$, "
    r"$a_y = \mathrm{ka}_{0,y} + (1 + \mathrm{ka}_{1,y}) (f_y - \eta_{oy} f_x)$, "
    r"$a_z = \mathrm{ka}_{0,z} + (1 + \mathrm{ka}_{1,z}) (f_z + \eta_{pz} f_x - \eta_{oz} f_y)$; $f$ the specific "
    "force in p (+g up at rest), $w_c$ the commanded or measured rate of the platform against inertial space"
)

_EXTENSION = Formula(
    r"; $\mathrm{kg}_1$ on the diagonal of $M$; $q_{\mathrm{encoders}} = \mathrm{qexp}(\beta) q$, $\beta$ the zero of "
    "the encoders against the base"
)

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "Continuous self-calibration model of attitude quaternion for hybrid inertial navigation system, Journal of "
    "Beijing University of Aeronautics and Astronautics (2018-19)",
    "A. D. Jackson, Continuous calibration and alignment techniques for an all-attitude inertial platform, AIAA paper "
    "73-865 (1973)",
)

#: axis of p -> coefficients that only a turn about it shows well
_BY_AXIS = (("ds_z", "do_y"), ("ds_x", "do_z"), ("ds_y", "do_x"))


def assemble(
    recording: Recording,
    settings: SelfcalSettings,
    filtered: FilterResult,
    bounds: PathBounds,
    findings: Sequence[Finding] = (),
    passed: PlatformPass | None = None,
) -> Estimate:
    """Put the estimate together; ``bounds`` along the path as it was estimated, with ``contributions``; ``findings`` of
    the diagnosis, beside those of the recording; ``passed`` the pass at its values, made if absent."""
    if passed is None:
        passed = pass_of(recording, problem(settings), filtered)
    if passed is not None and filtered.kind == "error-state":
        filtered = passed.final
    p, kinds = len(filtered.coefficients), list(dict.fromkeys(KIND_OF[name] for name in filtered.names))
    basis = studied(
        COMMAND,
        settings,
        recording.sources,
        MODEL + (_EXTENSION if {"kg1", "beta"} <= {*kinds} else "") + _on_rig(kinds),
        REFERENCES + ESTIMATORS[filtered.kind].publications,
        _conditions(recording, settings),
    )
    read = {each.code for each in recording.findings} - {"gap", "outlier"}
    all_findings = [*recording.findings, *(each for each in findings if each.code not in read)]
    if filtered.kind == "gimbal-ukf" and filtered.gimbal_cosine < LIMITS.singular_cosine:
        angle = math.degrees(math.acos(filtered.gimbal_cosine))
        text = f"the inner gimbal comes to {angle:.2f} deg, where the gimbal-angle model does not hold"
        action = "take the error-state filter, by --filter error-state"
        all_findings.append(Finding("gimbal_lock", text, harm=EVERYTHING, action=action))
    interval, own = float(np.median(recording.dt)), FACTOR_OF.get(filtered.kind)
    result: dict[str, Any] = {
        "filter": filtered.kind,
        **({"factor": settings.filter.factor or own} if own else {}),
        "states": kinds,
        "bounds": {},
        "at_prior": [],
        "goal": {},
        "sample_interval": interval,
        "compare": {},
    }
    slope, values = product_slope(filtered.coefficients), to_product(filtered.coefficients)
    agreement = nis(filtered.nis, filtered.dims) if filtered.dims.any() else None
    limit = 0.0 if agreement is None else _limit(agreement, passed, settings)
    misfit = 1.0 if agreement is None else _misfit(agreement, limit)
    by_filter = slope @ filtered.covariance @ slope.T
    if misfit <= INFERENCE.gross:
        by_filter *= misfit**2
    if (unusable := useless(filtered, bounds, by_filter)) is not None:
        return Estimate.without(basis, *unusable, findings=all_findings, result=result)

    result["bounds"] = dict(zip(bounds.names, bounds.u.tolist(), strict=True))
    measured = np.isfinite(filtered.innovations)
    dof = float((measured.sum() if len(measured) else filtered.dims.sum()) - p - 3)
    if passed is None:
        text = "the covariance is numerically singular at the values of the filter: check units of noise and prior"
        return Estimate.without(basis, Status.ILL_CONDITIONED, text, findings=all_findings, result=result)
    of_site, exact = systematic(passed, settings, np.sqrt(np.diag(by_filter)))
    of_rig, left_out = considered(passed, settings, np.sqrt(np.diag(by_filter)))
    sources = [*within(by_filter, bounds, settings.noise.of_readings, max(dof, 1.0)), *of_site, *of_rig]
    rest = unmodelled(passed, settings, combine(filtered.names, sources).u)
    if rest is not None:
        sources.append(rest.source)
        left_out = {kind: text for kind, text in left_out.items() if kind not in rest.counted}
    uncertainty = combine(filtered.names, sources)
    if (unusable := not_positive(bounds.prior, uncertainty.covariance)) is not None:
        wide = [
            own.source for own in (*of_site, *of_rig) if (np.diag(own.covariance) > bounds.prior**2).any()
        ]
        if wide:
            text = f"{', '.join(wide)}: stated so uncertainly that nothing is told; state it better"
            unusable = Status.ILL_CONDITIONED, text
        return Estimate.without(basis, *unusable, findings=all_findings, result=result)
    # all noises are judged by one set of innovations; their parts add up to them but for rounding
    more = np.square(np.diag(uncertainty.covariance) / np.diag(by_filter))
    effective = max(dof, 1.0) * np.where(np.abs(more - 1.0) < 1e-6, 1.0, more)
    u = uncertainty.u

    judged = observability(replace(bounds, covariance=by_filter), settings.goal)
    assert agreement is not None
    hidden = _hidden(judged, u / bounds.prior, uncertainty.budget)
    result["at_prior"] = [name for name in filtered.names if name in {*judged.at_prior, *hidden}]
    result["goal"] = reached(filtered.names, u, settings.goal)
    hints = _hardly_turned(recording, settings) | _gated(recording, settings, filtered, bounds)
    # of biases that walk no recording tells more
    left = {name: part for name, part in judged.at_prior.items() if KIND_OF[name] not in BIAS_WALK}
    all_findings += at_prior(left, hints)
    status, message = _verdict(judged, misfit, _cause(findings, recording.findings), hints, agreement)
    if misfit > 1.0 and status is not Status.INCONSISTENT:
        text = f"Innovations are {misfit:.3g} times what noise explains, and u allows for it."
        all_findings.append(
            Finding("excess_scatter", text, harm=(), action="State the noise as it is under [noise].")
        )
    # numbers that must not be used need no more findings
    if status is not Status.INCONSISTENT:
        all_findings += missed(result["goal"], UNIT_OF, hints)
        all_findings += [Finding("at_prior", f"{name}: {why}") for name, (_, why) in hidden.items()]
        all_findings += exact_inputs(exact)
        cure = "Name them in states under [model], or state them with uncertainties."
        all_findings += exact_inputs(left_out, "are no states", cure)
        if rest is not None and rest.finding is not None:
            all_findings.append(rest.finding)
    lost = {name: why for name, (ratio, why) in hidden.items() if ratio > UNSEEN and name in NAMES}
    if status is Status.OK and lost:
        status = Status.UNOBSERVABLE
        message = f"{', '.join(lost)}: {next(iter(lost.values()))}; state it better"
    return Estimate.of(
        basis,
        filtered.names,
        units(filtered.names),
        values,
        uncertainty._replace(dof=effective),
        (status, message),
        findings=all_findings,
        statistics={
            "dof": dof,
            "condition": judged.learned.condition**2,
            "residual_rms": math.sqrt(float(np.nansum(filtered.nis)) / float(filtered.dims.sum())),
            "chi2": float(np.nansum(filtered.nis)),
            "nis_mean": agreement.mean,
            "nis_expected": agreement.expected,
            "nis_limit": limit,
            "steps": float(filtered.steps),
        },
        result=result,
    )


def _on_rig(kinds: Sequence[str]) -> str:
    """States of the rig in words."""
    named = [
        f"{', '.join(STATES[kind].parameters)}: {STATES[kind].words}"
        for kind in kinds
        if kind not in EXTENDED_MODEL
    ]
    return "".join(f"; {each}" for each in named)


def verdict(
    filtered: FilterResult,
    recording: Recording,
    settings: SelfcalSettings,
    findings: Sequence[Finding] = (),
    passed: PlatformPass | None = None,
) -> tuple[Status, str]:
    """Status and sentence of an estimator, for comparisons; ``passed`` the pass of the one that counts."""
    slope, p = product_slope(filtered.coefficients), len(filtered.coefficients)
    prior = settings.priors[[ALL.index(name) for name in filtered.names]]
    bounds = PathBounds(filtered.names, slope @ filtered.covariance @ slope.T, prior, np.empty((0, p)))
    if (unusable := useless(filtered, bounds, bounds.covariance)) is not None:
        return unusable
    if passed is None:
        passed = pass_of(recording, problem(settings), filtered)
    agreement = nis(filtered.nis, filtered.dims)
    cause = _cause(findings, recording.findings)
    misfit = _misfit(agreement, _limit(agreement, passed, settings))
    hints = _hardly_turned(recording, settings) | _gated(recording, settings, filtered, bounds)
    return _verdict(observability(bounds, {}), misfit, cause, hints, agreement)


def _cause(diagnosed: Sequence[Finding], recorded: Sequence[Finding]) -> str:
    """Explanation of innovations that are too large: by the diagnosis, else by the reading of the recording."""
    explaining = [*(each for each in diagnosed if CODES[each.code].rank), *causes(recorded)]
    return explaining[0].message if explaining else "check noise, commands, signs and units"


def _limit(agreement: Nis, passed: PlatformPass | None, settings: SelfcalSettings) -> float:
    """Largest mean NIS of a recording that does not contradict the model: that of an exact study, plus the part that
    disappears with systematic inputs moved, within their uncertainties, to where the recording fits best."""
    if passed is None or not (moved := stated_errors(settings)):
        return agreement.limit(LIMITS.nis_sigmas)
    stated = with_stated(passed, moved)
    gained = passed.sums.chi2 - stated.chi2
    return agreement.limit(LIMITS.nis_sigmas) + max(0.0, gained) / agreement.rows


def _misfit(agreement: Nis, limit: float) -> float:
    """Innovations over what noise explains, 1 where their mean NIS is below the ``limit``: u grows by it."""
    if not agreement.mean > limit:
        return 1.0
    stated = limit - agreement.limit(LIMITS.nis_sigmas)
    return math.sqrt(max((agreement.mean - stated) / agreement.expected, 1.0))


def _verdict(
    judged: Observability, misfit: float, cause: str, hints: Mapping[str, str], agreement: Nis
) -> tuple[Status, str]:
    """Status and sentence of numbers that can be used."""
    if misfit > INFERENCE.gross:
        return Status.INCONSISTENT, (
            f"the recording contradicts the model: innovations are {misfit:.3g} times what noise explains; {cause}"
        )
    ratio = judged.learned.ratio[: len(NAMES)]
    unseen = [name for name, left in zip(NAMES, ratio, strict=True) if left > UNSEEN]
    if unseen:
        help = next(
            (hints[name] for name in unseen if name in hints), "add turns about other axes, or there and back"
        )
        return Status.UNOBSERVABLE, (
            f"the path says nothing about {', '.join(unseen)}: {100 * float(ratio.max()):.0f} % of the prior is left; "
            f"the weakest combination is {judged.learned.weakest()[0]}; {help}"
        )
    if weak := singular(judged.learned, "add turns about other axes"):
        return weak
    many = counted(len(judged.learned.left), "coefficient")
    return Status.OK, f"{many} from {counted(agreement.rows, 'row')}, mean NIS {agreement.mean:.3g}"


def _hardly_turned(recording: Recording, settings: SelfcalSettings) -> dict[str, str]:
    """Coefficients that only a turn about one axis of p shows well, where there is none -> advice."""
    earth = float(np.linalg.norm(settings.world.earth))
    moving = np.abs(recording.rate).max(axis=1) > LIMITS.turning_ratio * earth
    turned = (np.abs(recording.rate) * recording.dt[:, None])[moving].sum(axis=0)
    words = dict[str, str]()
    for axis, coefficients in zip("XYZ", _BY_AXIS, strict=True):
        if (by := float(turned["XYZ".index(axis)])) < LIMITS.turned_angle:
            text = (
                f"{axis}_p is turned by {math.degrees(by):.2g} deg in all, so that {' and '.join(coefficients)} see "
                f"little more than earth rate: add turns with {axis}_p along the turning axis"
            )
            words |= dict.fromkeys(coefficients, text)
    return words


def _gated(
    recording: Recording, settings: SelfcalSettings, filtered: FilterResult, bounds: PathBounds
) -> dict[str, str]:
    """Coefficients that the rows show which near-level gating leaves out -> advice."""
    if settings.filter.gating is None or filtered.history is None:
        return {}
    free = problem(replace(settings, filter=replace(settings.filter, gating=None)))
    whole = recorded_bounds(
        recording, free, filtered.history.attitude, filtered.coefficients, restarts=filtered.restarts
    )
    text = (
        "near-level gating leaves out the rows that show it, without it u is {:.2g} of this: set filter.gating to off, "
        "or narrow filter.gating_near"
    )
    ratio = whole.u / bounds.u
    return {
        name: text.format(part)
        for name, part in zip(bounds.names, ratio, strict=True)
        if part < LIMITS.gated_part
    }


def _hidden(
    judged: Observability, ratio: Array, budget: Sequence[BudgetItem]
) -> dict[str, tuple[float, str]]:
    """Coefficients that the path shows, but a systematic input hides: u over prior, and why."""
    hidden = {}
    for name, left in zip(judged.learned.names, ratio, strict=True):
        if left > HALF_SEEN and name not in judged.at_prior and KIND_OF[name] not in BIAS_WALK:
            source = max(budget, key=lambda each, name=name: each.share.get(name, 0.0)).source  # type: ignore[misc]
            what = f"{source} leave" if source == UNMODELLED else f"what is stated of {source} leaves"
            why = f"{what} {100.0 * left:.0f} % of its prior uncertain"
            hidden[name] = (float(left), why)
    return hidden


def _conditions(recording: Recording, settings: SelfcalSettings) -> dict[str, Any]:
    """Conditions and ranges over which the result is valid."""
    angles = recording.th[np.isfinite(recording.th).all(axis=1)]
    return conditions_of(
        settings,
        recording.temperature,
        {
            "duration_s": float(recording.t[-1] - recording.t[0]),
            "step_s": float(np.median(recording.dt)),
            "rate_rad_s": float(np.linalg.norm(recording.rate, axis=1).max()),
            **{
                f"{name}_rad": [float(low), float(high)]
                for name, low, high in zip(JOINTS, angles.min(axis=0), angles.max(axis=0), strict=True)
            },
        },
        frame=FRAME,
        rate="measured" if recording.measured else "commanded",
    )
