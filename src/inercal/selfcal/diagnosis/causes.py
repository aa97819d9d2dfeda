"""What is wrong with a recording that contradicts the model: named, with its place.

First the gross faults (`inercal.selfcal.diagnosis.gross`), each judged by what the error-state filter makes of the
recording without it; single rows far off come last of these. Of what then is left, small constant errors that the
model leaves out (`inercal.selfcal.diagnosis.small`), and last the size and the whiteness of the innovations. Every
limit keeps a risk of a false finding of about 1e-3.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.estimate.consistency import nis, surprising, whiteness
from inercal.estimate.identifiability import UNSEEN
from inercal.estimate.rounding import rounded
from inercal.findings import EVERYTHING, Finding
from inercal.geometry.earth import EARTH_RATE
from inercal.instruments.terms import shown_unit
from inercal.records.places import counted, places
from inercal.selfcal.diagnosis.gross import RISK, Proposal, proposals
from inercal.selfcal.diagnosis.small import Case, Cause, Found, directions, filtered, likely, regular, search
from inercal.selfcal.filters.filter_result import Filtered, Problem
from inercal.selfcal.platform.coefficients import names, units
from inercal.selfcal.platform.recording import Recording

SENSORS = ("accelerometers", "encoders")

MOST_OUTLIERS = 60
"""Rows that are left out one after the other before they no longer count as single."""

WORTH = 1.1
"""Ratio of scatter to stated noise, or its reciprocal, from which it is worth a word: 10 % in every u."""

SAID = ("unit_suspect", "channel_swap", "sign_suspect")
"""Findings of the reading of a recording before which nothing else can be told of it."""

_FAULTS = 4


def diagnose(
    recording: Recording, problem: Problem, found: Filtered, stated: Cause | None = None
) -> list[Finding]:
    """Name what is wrong with a recording; nothing for a sound one, nor where its reading found units or axes wrong.

    Parameters
    ----------
    recording : Recording
    problem : Problem
    found : Filtered
        What the estimator of the study made of it; the error-state filter judges the recording itself.
    stated : Cause, optional
        What the study states with an uncertainty: no error within that is named.
    """
    if any(finding.code in SAID for finding in recording.findings) or not found.dims.any():
        return []
    repaired, fair, findings = _without_faults(recording, problem, stated)
    if not findings or not _sound(filtered((repaired, fair))):
        findings += _small_errors((repaired, problem), fair, stated)
    if findings or _sound(found):
        return findings
    # where what is stated is wrong within its uncertainty all estimators have large innovations
    if not found.converged or _sound(filtered((recording, problem))):
        text = (
            f"the error-state filter finds no contradiction in this recording: the {found.kind} fails on it"
        )
        findings.append(Finding("filter_fails", text))
    return findings


def _fair(problem: Problem, moved: Problem, found: Filtered) -> Problem:
    """The problem as it may be meant: what is stated ``moved`` to where the recording fits best, and no prior that is
    in the way of what the filter then ``found``."""
    if not found.converged:
        return problem
    u, prior = np.sqrt(np.diag(found.covariance)), problem.prior
    # values are distributed about 0 with this variance where the prior holds
    spread = np.sqrt(np.maximum(prior**2 - u**2, 0.0))
    far = (u < UNSEEN * prior) & ~(np.abs(found.coefficients) < _most(len(prior)) * spread)
    return replace(moved, prior=np.where(far, 10.0 * np.maximum(np.abs(found.coefficients), prior), prior))


def _most(alternatives: int) -> float:
    """Standard deviations that a normal variable keeps to, at `RISK` over some of them (Bonferroni)."""
    from scipy.special import ndtri

    return -float(ndtri(0.5 * RISK / alternatives))


def _small_errors(case: Case, meant: Problem, stated: Cause | None) -> list[Finding]:
    """What the model leaves out, a prior that is too narrow, and noise that is not what is stated; ``meant`` as of
    `_fair`."""
    recording, problem = case
    fair = (recording, meant)
    errors, corrected = search(recording, replace(problem, prior=meant.prior), stated)
    now = filtered(corrected)
    # a walk of the gyros larger than stated looks like many errors, none of which makes innovations white
    if errors and not _white(corrected, now) and (walk := _restless(fair)) is not None:
        return [walk]
    rest = _scatter(corrected, now)
    if errors and any(finding.code == "contradiction" for finding in rest):
        return _scatter(fair, filtered(fair))  # errors that leave a contradiction are none
    return [*(_in_words(each, corrected) for each in errors), *_beyond_prior(now, problem.prior), *rest]


def _beyond_prior(found: Filtered, prior: Array) -> list[Finding]:
    """Coefficients, found without a prior in the way, that the prior [SI] did not expect."""
    if not found.converged:
        return []
    values, variance = found.coefficients, np.diag(found.covariance)
    findings = []
    far = ~(np.abs(values) <= _most(len(prior)) * np.sqrt(prior**2 + variance))
    for i in np.flatnonzero(far):
        unit, size = shown_unit(units(len(prior))[i])
        value, u = rounded(values[i] / size, math.sqrt(variance[i]) / size)
        text = f"{names(len(prior))[i]}: the recording says {value} +- {u} {unit}, its prior is {prior[i] / size:.3g}"
        findings.append(Finding("prior_suspect", f"{text} {unit}: state a wider one"))
    return findings


def _white(case: Case, found: Filtered) -> bool:
    """Whether innovations are of the size that is stated and uncorrelated."""
    return _sound(found) and whiteness(regular(case[0], found)) > RISK


def _sound(found: Filtered) -> bool:
    """Whether a filter agrees with its recording, as a whole and in each row; not where nothing is measured."""
    if not found.converged or not found.dims.any():
        return False
    mean = nis(found.nis, found.dims)
    return mean.excess <= 5.0 and not len(surprising(found.nis, found.dims, RISK))


def _without_faults(
    recording: Recording, problem: Problem, stated: Cause | None
) -> tuple[Recording, Problem, list[Finding]]:
    """The recording without its gross faults, the problem as it may then be meant (`_fair`), and these faults."""
    findings = list[Finding]()
    of = likely(recording, problem, stated)
    now = filtered((recording, of))
    while len(findings) < _FAULTS and not _sound(now):
        best, then = _best(proposals(recording, of), now, of)
        if not _sound(then) and not _misfit(then) < 0.1 * _misfit(now):
            fair = _fair(problem, of, now)
            if _sound(filtered((recording, fair))):
                break
            single, after = _best(_outliers(recording, of, now), now, of)
            if single is not None and _sound(after):
                best, then = single, after
            elif _sound(filtered(search(recording, replace(problem, prior=fair.prior), stated)[1])):
                break
        # what explains less than half is not what happened
        if best is None or not _misfit(then) < 0.5 * _misfit(now):
            break
        recording = best.recording
        of = likely(recording, problem, stated)
        now = filtered((recording, of))
        findings.append(best.finding)
    return recording, _fair(problem, of, now), findings


def _best(tried: Iterable[Proposal], now: Filtered, problem: Problem) -> tuple[Proposal | None, Filtered]:
    """The proposal that explains most beyond what chance does, and what the filter then makes of the recording."""
    best, then, least = None, now, _misfit(now)
    for each in tried:
        found = filtered((each.recording, problem))
        if (misfit := _misfit(found) + each.cost) < least:
            best, then, least = each, found, misfit
    return best, then


def _misfit(found: Filtered) -> float:
    """Sum of the normalised innovations squared; infinite where the filter diverged or nothing is measured."""
    total = float(found.nis[found.dims > 0].sum())
    return total if found.converged and found.dims.any() and math.isfinite(total) else math.inf


def _outliers(recording: Recording, problem: Problem, now: Filtered) -> list[Proposal]:
    """Single readings far from what the filter expects, left out one row after the other: an early one spoils what
    follows."""
    rows = np.zeros(0, dtype=np.int64)
    left_out = 0
    channels = set[str]()
    acc, th = recording.acc.copy(), recording.th.copy()
    while now.converged and len(off := surprising(now.nis, now.dims, RISK)):
        row = int(off[0])
        wrong = np.abs(now.innovations[row]) > 4.0
        if len(rows) == MOST_OUTLIERS or not wrong.any():
            return []
        if wrong[3:].any():
            th[row + 1] = np.nan
            channels.add("th")
        else:
            acc[row + 1, wrong[:3]] = np.nan
            channels |= {f"acc_{axis}" for axis, each in zip("xyz", wrong[:3], strict=True) if each}
        rows = np.append(rows, row)
        left_out += 3 if wrong[3:].any() else int(wrong[:3].sum())
        now = filtered((replace(recording, acc=acc.copy(), th=th.copy()), problem))
    rows = np.unique(rows)
    if not len(rows) or (len(rows) > 3 and np.ptp(rows) < 2 * len(rows)):
        return []  # a change, not single readings
    text = (
        f"{counted(len(rows), 'reading')} far from what the filter expects, of {', '.join(sorted(channels))}"
    )
    cost = left_out + 2.0 * len(rows) * math.log(2.0 * len(recording.t) / RISK)
    finding = Finding("outlier", text, places("row", rows + 2), EVERYTHING)
    return [Proposal(finding, replace(recording, acc=acc, th=th), cost)]


#: constant error -> what it is, its SI unit, what to do about it
_CONSTANT = {
    "base": (
        "the base or the zero of the encoders is turned",
        "rad",
        "set extended = true under [filter], or correct heading and tilt under [rig]",
    ),
    "scale": ("the gyros have scale errors", "1", "set extended = true under [filter]"),
    "mounting": (
        "the sensors are turned on the platform, against the axis of its joint",
        "rad",
        "the angles are not those of the sensors' axes: align them, or take the turn out of the angles",
    ),
}


def _in_words(error: Found, case: Case) -> Finding:
    """A small constant error as a finding."""
    cause, values, u = error.cause, error.values, error.u
    if cause.kind == "latitude":
        return _latitude(error, case)
    if cause.kind == "delay":
        rows, dt = float(values[0]), float(np.median(case[0].dt))
        how = "later" if rows > 0.0 else "earlier"
        text = f"the platform acts {1e3 * abs(rows) * dt:.3g} ms {how} than its commands are logged"
        return Finding("command_shift", text, harm=EVERYTHING)
    if cause.kind in _CONSTANT:
        what, dimension, advice = _CONSTANT[cause.kind]
        unit, size = shown_unit(dimension)
        seen = [
            f"{name} = {value / size:.3g} +- {each / size:.1g} {unit}"
            for name, value, each in zip(cause.names, values, u, strict=True)
            if abs(value) > 3.0 * each
        ] or [f"{', '.join(cause.names)} together"]
        text = f"{what}, which the model leaves out: {', '.join(seen)}; {advice}"
        return Finding("unmodelled", text, harm=EVERYTHING)
    amplitude = math.degrees(float(np.hypot(*values))) * 3600.0
    _, order, _, joint = cause.kind.split()
    text = f"{joint} errs periodically with its angle: {amplitude:.2g} arcsec, {counted(int(order), 'period')} a turn"
    return Finding("unmodelled", text, harm=EVERYTHING)


def _latitude(error: Found, case: Case) -> Finding:
    """Earth rate that is not that of the stated latitude; the case is corrected already."""
    world = case[1].world
    north, up = directions(world)
    seen = math.atan2(float(world.earth @ up), float(world.earth @ north))
    stated_earth = world.earth - error.values[0] * north - error.values[1] * up
    stated = math.atan2(float(stated_earth @ up), float(stated_earth @ north))
    u = float(np.hypot(error.u[0] * math.sin(seen), error.u[1] * math.cos(seen))) / EARTH_RATE
    text = (
        f"the earth rate seen is that of latitude {math.degrees(seen):.2f} +- {math.degrees(u):.1g} deg, stated is "
        f"{math.degrees(stated):.2f} deg: check latitude and heading"
    )
    return Finding("site_suspect", text, harm=EVERYTHING)


def _scatter(case: Case, now: Filtered) -> list[Finding]:
    """Innovations larger or smaller than the stated noise has them, or correlated in time."""
    if not now.converged:
        text = f"the error-state filter fails on this recording: {now.message}"
        return [Finding("contradiction", text, harm=EVERYTHING)]
    z = regular(case[0], now)
    findings, wide = [], False
    for sensor, columns in zip(SENSORS, (z[:, :3], z[:, 3:]), strict=True):
        known = columns[np.isfinite(columns)]
        if len(known) < 100:
            continue
        mean, error = float(np.mean(np.square(known))), math.sqrt(2.0 / len(known))
        factor = math.sqrt(mean)
        if mean > 1.0 + 5.0 * error:
            wide = True
            if _even(columns, mean) and whiteness(columns) > RISK:
                text = f"{sensor}: noise is {factor:.3g} times what is stated, evenly over the recording"
                findings.append(Finding("excess_scatter", text, harm=EVERYTHING))
        elif mean < 1.0 - 5.0 * error and factor * WORTH < 1.0:
            text = f"{sensor}: noise is only {factor:.2g} of what is stated; the uncertainties are too large"
            findings.append(Finding("low_scatter", text))
    if findings:
        return findings
    if not wide and whiteness(z) > RISK:
        return []
    return [_restless(case) or _unexplained(z)]


def _even(columns: Array, mean: float) -> bool:
    """Whether the mean square is the same over ten parts of the recording (Bonferroni over the parts)."""
    from scipy.special import ndtri

    limit = -float(ndtri(0.5 * RISK / 10.0))
    for part in np.array_split(columns, 10):
        known = part[np.isfinite(part)]
        if len(known) and abs(np.mean(np.square(known)) / mean - 1.0) > limit * math.sqrt(2.0 / len(known)):
            return False
    return True


def _restless(case: Case) -> Finding | None:
    """Gyro noise other than stated, where that explains the innovations."""
    for octaves in (np.arange(0.5, 10.1, 0.5), -np.arange(0.5, 3.1, 0.5)):
        fitting = list[float]()
        for factor in 2.0**octaves:
            if _explained_by_walk(case, factor):
                fitting.append(float(factor))
            elif fitting:
                break
        if fitting:
            about = _short(math.sqrt(fitting[0] * fitting[-1]))
            text = f"the gyros' angle random walk looks about {about} times what is stated"
            code, span = (
                "excess_scatter" if octaves[0] > 0.0 else "low_scatter",
                sorted((fitting[0], fitting[-1])),
            )
            more = f" ({_short(span[0])} to {_short(span[1])})" if len(fitting) > 1 else ""
            harm = EVERYTHING if code == "excess_scatter" else ()
            return Finding(code, text + more, harm=harm)
    return None


def _short(factor: float) -> str:
    """A number to two digits, without an exponent."""
    return f"{float(f'{factor:.2g}'):g}"


def _explained_by_walk(case: Case, factor: float) -> bool:
    """Whether a walk of the gyros, larger by a factor, leaves innovations white."""
    recording, problem = case
    noise = replace(problem.noise, angle_random_walk=factor * problem.noise.angle_random_walk)
    tried = (recording, replace(problem, noise=noise))
    now = filtered(tried)
    # half an octave too much makes squares of innovations half as large at most; a walk that is none, much smaller
    return _white(tried, now) and float(np.nanmean(np.square(now.innovations[:, 3:]))) > 0.5


def _unexplained(z: Array) -> Finding:
    """Innovations that no known fault explains, with the part of the recording where they are largest."""
    parts = np.array_split(np.arange(len(z)), 20)
    squares = np.square(z)
    size = [float(np.nanmean(squares[part])) if np.isfinite(squares[part]).any() else 0.0 for part in parts]
    worst = parts[int(np.argmax(size))]
    text = (
        f"innovations contradict the model (mean square {max(size):.3g} at most, expected 1{_correlated(z)})"
    )
    return Finding(
        "contradiction",
        f"{text}, and no fault that is looked for explains them",
        places("row", worst + 2),
        EVERYTHING,
    )


def _correlated(z: Array) -> str:
    """Correlation from one row to the next of the sensors that have it, in words."""
    words = ""
    for sensor, columns in zip(SENSORS, (z[:, :3], z[:, 3:]), strict=True):
        products = columns[1:] * columns[:-1]
        count = int(np.isfinite(products).sum())
        if count and abs(
            share := float(np.nanmean(products) / np.nanmean(np.square(columns)))
        ) > 5.0 / math.sqrt(count):
            words += f"; {sensor}: correlated from row to row, by {share:.2g}"
    return words or ", or correlated in time"
