"""Several runs in one view: angles of each point, error terms of each oscillation, verdicts together, and tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.results.basis import studied
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table, heads, rounded, short
from inercal.systems.aoa.layout import centrifugal_arms, pair_weights, tangential_arms
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper import residuals
from inercal.systems.aoa.result.outcome import COMMAND, REFERENCES
from inercal.systems.aoa.result.points import Point
from inercal.systems.aoa.runs.run_table import Role, Run, RunTable
from inercal.systems.aoa.settings import AoaSettings
from inercal.systems.aoa.task import Measurement


@dataclass(frozen=True)
class AtPoint:
    """One angle at which several runs paused.

    ``theta`` [rad] mean of all, ``u`` its standard uncertainty: the part ``u_angle`` of a point's u that all have in
    common, and that of scatter; ``runs`` that paused there. ``up`` and ``down`` [rad] are the means of polars in that
    sense, ``spread`` the standard deviation of repeats about the mean of their sense; NaN where there are none.
    ``u_apart`` is the standard uncertainty of down less up by the scatter within the points alone.
    """

    theta: float
    u: float
    runs: int
    up: float
    down: float
    u_apart: float
    spread: float


@dataclass(frozen=True)
class OscillationRuns:
    """Runs of one ``amplitude`` [rad] and ``frequency`` [Hz] of a sine: their number, and error terms as angles [rad].

    ``terms``: what each way of the paper leaves of the centrifugal and tangential terms in closed form, at the stated
    noise; ``errors``: rms of the angle less theta_ref by method, where a reference was recorded.
    """

    amplitude: float
    frequency: float
    runs: int
    terms: Mapping[str, float]
    errors: Mapping[str, float] = field(default_factory=dict)


def by_point(runs: Sequence[tuple[Role, Measurement]]) -> tuple[AtPoint, ...]:
    """The points of all runs, those of about the same angle together, by angle."""
    each = [(role, point) for role, measured in runs for point in measured.points]
    steps = [
        abs(b.theta - a.theta)
        for _, measured in runs
        for a, b in zip(measured.points, measured.points[1:], strict=False)
    ]
    if not each:
        return ()
    apart = LIMITS.points_apart * float(np.median(steps)) if steps else math.inf
    each.sort(key=lambda pair: pair[1].theta)
    cuts = np.flatnonzero(np.diff([point.theta for _, point in each]) > apart) + 1
    groups = np.split(np.arange(len(each)), cuts)
    return tuple(_together([each[int(k)] for k in group]) for group in groups)


def _together(points: Sequence[tuple[Role, Point]]) -> AtPoint:
    """Points of one angle."""
    theta = np.array([point.theta for _, point in points])
    own = np.array([point.u_scatter for _, point in points])
    common = max(point.u_angle for _, point in points)
    means: dict[str, tuple[float, float]] = {}
    squares, dof = 0.0, 0
    for sense in ("up", "down", "run"):
        chosen = np.array([role == sense for role, _ in points])
        if not chosen.any():
            continue
        of = theta[chosen]
        means[sense] = float(of.mean()), float(np.sqrt(np.sum(own[chosen] ** 2))) / len(of)
        squares += float(np.sum((of - of.mean()) ** 2))
        dof += len(of) - 1
    spread = math.sqrt(squares / dof) if dof else math.nan
    up, down = means.get("up", (math.nan, math.nan)), means.get("down", (math.nan, math.nan))
    scatter = float(np.sqrt(np.sum(own**2))) / len(theta)
    if len(theta) > 1:  # what polars and repeats differ by is seen, and counts where it is larger
        scatter = max(scatter, float(theta.std(ddof=1)) / math.sqrt(len(theta)))
    return AtPoint(
        theta=float(theta.mean()),
        u=math.hypot(common, scatter),
        runs=len(theta),
        up=up[0],
        down=down[0],
        u_apart=math.hypot(up[1], down[1]),
        spread=spread,
    )


def oscillations(runs: Sequence[tuple[Run, Measurement]]) -> tuple[OscillationRuns, ...]:
    """The runs that oscillate, repeats together, by amplitude and frequency: as stated in the table, or as measured."""
    groups: list[list[tuple[float, float, Measurement]]] = []
    for run, measured in runs:
        amplitude, frequency = sine_of(measured)
        if math.isfinite(run.amplitude) and math.isfinite(run.frequency):
            amplitude, frequency = run.amplitude, run.frequency
        if not (amplitude > 0.0 and frequency > 0.0):
            continue
        for group in groups:
            if (
                abs(group[0][0] / amplitude - 1.0) < LIMITS.oscillations_alike
                and abs(group[0][1] / frequency - 1.0) < LIMITS.oscillations_alike
            ):
                group.append((amplitude, frequency, measured))
                break
        else:
            groups.append([(amplitude, frequency, measured)])
    found = [_oscillation(group) for group in groups]
    return tuple(sorted(found, key=lambda each: (each.amplitude, each.frequency)))


def _oscillation(group: Sequence[tuple[float, float, Measurement]]) -> OscillationRuns:
    """Repeats of one oscillation."""
    amplitude = float(np.mean([each[0] for each in group]))
    frequency = float(np.mean([each[1] for each in group]))
    squares: dict[str, list[float]] = {}
    for _, _, measured in group:
        for name, errors in measured.errors.items():
            if math.isfinite(errors.all.rms):
                squares.setdefault(name, []).append(errors.all.rms**2)
    rms = {name: math.sqrt(float(np.mean(each))) for name, each in squares.items()}
    terms = error_terms(group[0][2].settings, amplitude, frequency)
    return OscillationRuns(amplitude, frequency, len(group), terms, rms)


def error_terms(settings: AoaSettings, amplitude: float, frequency: float) -> dict[str, float]:
    """Errors of the angle [rad], at most, by what the paper's ways leave of the lever-arm terms of a sine.

    Of the axes with the longest arms, at the angle where all of it counts, a residual over gravity; the sensors err by
    their stated noise of a sample and bias.
    """
    noise, layout, level = settings.noise, settings.layout, settings.attitude.level
    dA, dw = (
        math.hypot(noise.accelerometer, noise.accelerometer_bias),
        math.hypot(noise.gyro, noise.gyro_bias),
    )
    X = 2.0 * math.pi * frequency * amplitude
    r = float(np.abs(centrifugal_arms(layout, level)).max())
    p = float(np.abs(tangential_arms(layout, level)).max())
    left = {
        "centrifugal, low pass": residuals.low_pass(r, X),
        "centrifugal, mechanical": residuals.mechanical(r, X, dw),
        "tangential, none": p * residuals.untreated(X, frequency),
    }
    weights = pair_weights(layout, level)
    if weights is not None:
        left["tangential, dual"] = p * dA * float(np.linalg.norm(weights))
    return {name: each / settings.site.gravity for name, each in left.items()}


def sine_of(measured: Measurement) -> tuple[float, float]:
    """Amplitude [rad] and frequency [Hz] of the sine in the angle of a run after it settled; NaN where it has none."""
    t, theta = measured.recording.t, measured.angles.theta
    good = np.isfinite(theta) & np.isfinite(t)
    good &= t >= (t[good][0] + LIMITS.settling_time if good.any() else 0.0)
    if good.sum() < LIMITS.starting_rows:
        return math.nan, math.nan
    t, x = t[good] - t[good][0], np.unwrap(theta[good])
    step = float(np.median(np.diff(t)))
    if not step > 0.0:
        return math.nan, math.nan
    grid = np.arange(0.0, t[-1], step)
    even = np.interp(grid, t, x)
    even = even - np.polyval(np.polyfit(grid, even, 1), grid)
    power = np.abs(np.fft.rfft(even * np.hanning(len(even)), 8 * len(even))) ** 2
    f = np.fft.rfftfreq(8 * len(even), step)
    power[f * grid[-1] < 2.0] = 0.0
    peak = float(f[int(np.argmax(power))])
    amplitude, explained = _fit(grid, even, peak)
    for width in (0.5 / grid[-1], 0.05 / grid[-1]):
        for near in np.linspace(peak - width, peak + width, 11):
            other = _fit(grid, even, float(near))
            if other[1] > explained:
                peak, (amplitude, explained) = float(near), other
    return (amplitude, peak) if explained > LIMITS.sine_share else (math.nan, math.nan)


def _fit(t: Array, x: Array, frequency: float) -> tuple[float, float]:
    """Amplitude of a sine of that frequency, and the part of the variance that it explains."""
    basis = np.column_stack(
        [np.sin(2.0 * math.pi * frequency * t), np.cos(2.0 * math.pi * frequency * t), np.ones(len(t))]
    )
    found, *_ = np.linalg.lstsq(basis, x, rcond=None)
    whole = float(np.sum((x - x.mean()) ** 2))
    left = float(np.sum((x - basis @ found) ** 2))
    return float(math.hypot(found[0], found[1])), 1.0 - left / whole if whole > 0.0 else 0.0


MODEL = (
    "each run by the fusion or the paper's way; biases of a run are those of the wind-offs before and after it, linear "
    "in time, with a random walk between"
)

_ORDER = (
    Status.NOT_CONVERGED,
    Status.INCONSISTENT,
    Status.UNOBSERVABLE,
    Status.ILL_CONDITIONED,
    Status.SUSPECT,
)
"""Verdicts, the worst first."""


def assemble(
    table: RunTable,
    measured: Sequence[tuple[Run, Estimate, str]],
    at_points: Sequence[AtPoint],
    oscillating: Sequence[OscillationRuns],
    findings: Sequence[Finding],
    settings: AoaSettings,
) -> Estimate:
    """The estimate of a table of runs, each with its own estimate and its tare in words."""
    inputs = dict.fromkeys([table.source, *(source for _, each, _ in measured for source in each.inputs)])
    basis = studied(COMMAND, settings, inputs, MODEL, REFERENCES)
    statuses = [each.status for _, each, _ in measured]
    worst = next((status for status in _ORDER if status in statuses), Status.OK)
    others = [
        f"{run.name} is {each.status.value}" for run, each, _ in measured if each.status is not Status.OK
    ]
    words = f"{counted(len(measured), 'run')}, {counted(len(at_points), 'point')}"
    message = f"{words}; {'; '.join(others)}" if others else words
    own = _named([(run.name, finding) for run, each, _ in measured for finding in each.findings])
    result: dict[str, Any] = {
        "runs": [_row(run, each, tare) for run, each, tare in measured],
        "by_point": [asdict(each) for each in at_points],
        "oscillations": [asdict(each) for each in oscillating],
    }
    return Estimate.without(
        basis, worst, message, findings=[*findings, *own], result=result, beside=("theta",)
    )


def _named(found: Sequence[tuple[str, Finding]]) -> list[Finding]:
    """Findings of runs with the names of their files, the same ones once; what they harm beside the angle is told with
    each run alone."""
    files: dict[Finding, list[str]] = {}
    for name, each in found:
        harm = tuple(one for one in each.harm if one == "theta")
        files.setdefault(replace(each, harm=harm), []).append(name)
    return [
        replace(each, headline=f"{counted_names(list(dict.fromkeys(names)), 4)}: {each.headline}")
        for each, names in files.items()
    ]


def _row(run: Run, estimate: Estimate, tare: str) -> dict[str, Any]:
    """A run in the result."""
    angle = estimate.result["angle"]
    return {
        "file": run.name,
        "role": run.role,
        "tare": tare,
        "status": estimate.status.value,
        "message": estimate.message,
        "points": len(estimate.result["points"]),
        "range": angle["range"],
        "u": angle["u"]["median"],
        "reference": estimate.result.get("reference"),
    }


def tables(estimate: Estimate) -> list[Table]:
    """By run, by point, by oscillation; those with rows."""
    result = estimate.result
    return [
        each for each in (_by_run(result), _by_point(result), _terms(result), _errors(result)) if each.rows
    ]


def _by_run(result: Any) -> Table:
    rows = [
        (
            each["file"],
            each["role"],
            each["status"],
            each["tare"] or "–",
            str(each["points"]),
            *(_fixed(end) for end in each["range"] or (None, None)),
            _deg(each["u"], 2),
        )
        for each in result["runs"]
    ]
    columns = heads("file", "role", "status", "tare of", "points", "lowest [deg]", "highest [deg]", "u [deg]")
    caption = "u is the median of the samples; a tare of two wind-offs is interpolated between them."
    return Table("Runs", caption, columns, tuple(rows), 4)


def _by_point(result: Any) -> Table:
    rows = []
    for each in result["by_point"]:
        theta, u = rounded(math.degrees(each["theta"]), math.degrees(each["u"]))
        apart = each["down"] - each["up"]
        rows.append(
            (
                theta,
                u,
                str(each["runs"]),
                _fixed(each["up"]),
                _fixed(each["down"]),
                _deg(apart, 2),
                _deg(each["u_apart"], 2),
                _deg(each["spread"], 2),
            )
        )
    columns = heads(
        "theta [deg]", "u [deg]", "runs", "up [deg]", "down [deg]", "down - up [deg]", "u of that [deg]",
        "repeats differ by [deg]",
    )  # fmt: skip
    caption = (
        "Points of all runs, those of about the same angle together. The last column is the standard deviation of "
        "repeats."
    )
    return Table("By point", caption, columns, tuple(rows), 0)


def _terms(result: Any) -> Table:
    names = list(dict.fromkeys(name for each in result["oscillations"] for name in each["terms"]))
    rows = [
        (*_of_sine(each), *(_deg(each["terms"].get(name), 2) for name in names))
        for each in result["oscillations"]
    ]
    columns = (
        *heads("amplitude [deg]", "frequency [Hz]", "runs", "peak rate [deg/s]"),
        *((n, "deg") for n in names),
    )
    caption = (
        "Left of the lever-arm terms by each way of the paper, in closed form for the stated noise, at most."
    )
    return Table("By amplitude and frequency: error terms", caption, columns, tuple(rows), 0)


def _errors(result: Any) -> Table:
    names = list(dict.fromkeys(name for each in result["oscillations"] for name in each["errors"]))
    rows = [(name, *(_deg(each["errors"].get(name), 2) for each in result["oscillations"])) for name in names]
    sines = [
        (f"{math.degrees(each['amplitude']):.3g} deg, {each['frequency']:.3g} Hz", "deg")
        for each in result["oscillations"]
    ]
    caption = "Root mean square of the angle less theta_ref, of all repeats."
    return Table("By amplitude and frequency: methods", caption, (("method", ""), *sines), tuple(rows), 1)


def _of_sine(each: Any) -> tuple[str, str, str, str]:
    peak = 2.0 * math.pi * each["frequency"] * math.degrees(each["amplitude"])
    return (
        f"{math.degrees(each['amplitude']):.4g}",
        f"{each['frequency']:.4g}",
        str(each["runs"]),
        f"{peak:.4g}",
    )


def _fixed(value: float | None) -> str:
    """An angle [rad] in degrees to 1e-4; a dash without one."""
    return "–" if value is None or not math.isfinite(value) else f"{math.degrees(value):.4f}"


def _deg(value: float | None, digits: int) -> str:
    """An angle [rad] in degrees; a dash without one."""
    return "–" if value is None or not math.isfinite(value) else short(float(np.degrees(value)), digits)
