"""A gyro at known rates in unknown orientations: one record for each rate in, an estimate out.

An orientation that lies off all others is named, with what it does to the coefficients. A bias, a rate or a scale
factor that drifts over the orientations is looked for in the residuals; times are no part of rows of means, so that a
trend goes with the number of the orientation, file after file.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.results.shown import rounded
from inercal.systems.imu.identified import weakness
from inercal.systems.imu.known_rates.fit import NAMES, RateFit, contradiction, fit_rates
from inercal.systems.imu.known_rates.orientations import Orientations, orientations
from inercal.systems.imu.known_rates.vector_sizes import (
    PARAMETERS,
    SizeFit,
    curing,
    residual_rows,
    without_rows,
)
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import unit_words
from inercal.systems.imu.settings import COMMAND, ImuSettings, KnownRatesSettings


def trend_findings(rate_fit: RateFit, sizes: Array, u: Array) -> Iterator[Finding]:
    """Findings about trends, each at `LIMITS.driver_probability`.

    ``sizes`` (n,) are the known sizes of the rates [rad/s], ``u`` (9,) the standard uncertainties of the coefficients,
    by more than which those move that are harmed.
    """
    fit = rate_fit.fit
    row, axis = residual_rows(sizes)
    along = np.where((axis >= 0)[:, None], np.eye(3)[np.maximum(axis, 0)], fit.directions[row])
    passed = (row - row.mean()) / max(int(np.max(row)), 1)
    bias, bias_p = _told(rate_fit, passed[:, None] * along)
    scale, scale_p = _told(rate_fit, (passed * np.where(axis < 0, sizes[row], 0.0))[:, None])
    if min(bias_p, scale_p) >= LIMITS.driver_probability:
        return
    if bias_p <= scale_p:
        value, size, effect = bias[0], bias[1], passed[:, None] * along
        each = zip("xyz", np.degrees(value) * 3600.0, np.degrees(size) * 3600.0, strict=True)
        words = ", ".join(f"{name} {' ± '.join(rounded(of, of_u))} deg/h" for name, of, of_u in each)
        what, cure = (
            f"the biases drift from the first to the last orientation ({words})",
            "wait until the gyro is warm",
        )
    else:
        value, size, effect = scale[0], scale[1], (passed * np.where(axis < 0, sizes[row], 0.0))[:, None]
        words = " ± ".join(rounded(1e6 * float(value[0]), 1e6 * float(size[0])))
        what = f"the rate or the scale factors change by {words} ppm from the first to the last orientation"
        cure = "let both get warm, and check the rate at the end"
    shift = np.abs(fit.gain() @ (effect @ value))
    yield Finding(
        "trend",
        f"{what}: {cure}, or take the orientations in an order that tells, there and back",
        harm=tuple(name for name, each_shift, own in zip(NAMES, shift, u, strict=True) if each_shift > own),
    )


def _told(rate_fit: RateFit, columns: Array) -> tuple[tuple[Array, Array], float]:
    """Sizes (k,) of effects ``columns`` (N, k) with their u (k,), and the probability of such by chance."""
    from scipy.special import fdtrc

    P, r, k = rate_fit.fit.left(), rate_fit.fit.residuals, columns.shape[1]
    dof = float(np.sum(rate_fit.dof)) - k
    information = columns.T @ P @ columns
    if dof < 3.0 or np.linalg.cond(information) > 1.0 / math.sqrt(np.finfo(float).eps):
        return (np.zeros(k), np.zeros(k)), 1.0
    inverse = np.linalg.inv(information)
    value = inverse @ columns.T @ P @ r
    gained = float(value @ information @ value)
    left = max(float(r @ P @ r) - gained, 1e-300) / dof
    return (value, np.sqrt(np.diag(inverse) * left)), float(fdtrc(k, dof, gained / k / left))


def outlying(rate_fit: RateFit) -> int | None:
    """Place of the orientation that lies off what all others say, at `LIMITS.outlier_risk` over all; None if none
    does."""
    fit = rate_fit.fit
    probability = without_rows(fit, rate_fit.dof[rate_fit.group]) * len(fit.row)
    worst = int(np.argmin(probability))
    return int(fit.row[worst]) if probability[worst] < LIMITS.outlier_risk else None


def outlying_finding(values: Array, without: Array, u: Array, place: str, number: int) -> Finding:
    """The finding about the orientation at that ``place``, the ``number`` th.

    ``values`` (9,) are the coefficients, ``without`` (9,) those without it with their ``u`` (9,), by more than which
    those move that are harmed.
    """
    shift = (values - without) / u
    leading = int(np.argmax(np.abs(shift)))
    text = (
        f"one orientation lies off what all others say ({place}); without it {NAMES[leading]} would be "
        f"{abs(shift[leading]):.1f} u {'smaller' if shift[leading] > 0 else 'larger'}: was it moved while the table "
        f'turned, or did the table turn at another rate? leave it out by imu.exclude = ["pose {number}"]'
    )
    harm = tuple(name for name, each in zip(NAMES, shift, strict=True) if abs(each) > 1.0)
    return Finding("outlying_pose", text, place, harm)


MODEL = Formula(
    r"$y = S T \omega + b$, $S = \mathrm{diag}(S)$, $T = 1$ + misalignment (upper-triangular; $T_{ij}$: response of "
    r"gyro $i$ to rate about $j$), $b = D_F$, with $|\omega|$ the rate of the table in every orientation. Frame: z "
    "along the input axis of gyro z, y in the plane of the input axes of gyros y and z."
)

FRAME = "b, of the instrument: z along the input axis of gyro z, y in the plane of those of y and z"

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "S. R. Searle, G. Casella, C. E. McCulloch, Variance Components, Wiley 1992",
)


@short_repr
@dataclass(frozen=True)
class KnownRatesCalibration:
    """An ``estimate``, the ``orientations`` behind it, and the ``fit``, if there is one."""

    estimate: Estimate
    orientations: Orientations
    fit: RateFit | None = None


def calibrate_known_rates(
    records: Sequence[Record],
    settings: ImuSettings,
    options: KnownRatesSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> KnownRatesCalibration:
    """Calibrate a gyro that a platter or rate table turned at known rates.

    Parameters
    ----------
    records : sequence of Record
        ``gyro_x..z`` in any unit, one record for each of the rates, in order: rows of means without times, one for each
        orientation, or a recording.
    settings : ImuSettings
        Site, orientations to be left out by number, and what goes with the result.
    options : KnownRatesSettings
        The rates with their uncertainties.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    KnownRatesCalibration
        Its estimate holds D_F, S and three misalignments; the status says whether they can be used.

    Raises
    ------
    InputError
        Another number of records than of rates, a record without a gyro or a steady stretch, or the study leaves out
        an orientation that is not there.
    """
    clock = time.perf_counter()
    rates, rates_u = np.array(options.rates), np.array(options.rates_u)
    if len(records) != len(rates):
        raise StudyError(
            "imu.rates",
            f"found {counted(len(rates), 'rate')} for {counted(len(records), 'file')}, expected "
            "one for each FILE, in order",
        )
    if not np.any(rates):
        raise StudyError("imu.rates", "found rates of zero alone, expected one at least that turns")
    progress("finding the orientations")
    rows = _used(orientations(records, rates), settings)
    triad = records[0].triad("gyro")
    sources = tuple(dict.fromkeys(source for record in records for source in record.sources))
    at = np.abs(rates)[rows.file]
    ranges = {"rate_of_turn_rad_s": [0.0, float(np.max(np.abs(rates)))]}
    conditions = conditions_of(settings, recorded_temperature(records[0]), ranges, frame=FRAME)
    basis = studied(COMMAND, settings, sources, MODEL, REFERENCES, conditions)
    turning = int(np.count_nonzero(at > 0.0))
    if turning < LIMITS.fewest_poses:
        text = (
            f"found {counted(turning, 'orientation')} in which the table turned, expected at least "
            f"{LIMITS.fewest_poses}: each side up and the edges between"
        )
        estimate = Estimate.without(
            basis,
            Status.TOO_FEW_INTERVALS,
            text,
            findings=rows.findings,
            result={"method": "known_rates", "orientations": []},
        )
        return KnownRatesCalibration(timed(estimate, clock), rows)
    progress("fitting the gyro")
    rate_fit = fit_rates(rows.outputs, rows.file, rates, rates_u)
    fit = rate_fit.fit
    uncertainty = combine(NAMES, _sources(rate_fit, rates, rates_u, settings.site))
    words = f"{counted(turning, 'orientation')} at {counted(int(np.count_nonzero(rates)), 'rate')}"
    geometry = rate_fit.geometry
    cure = curing(fit, geometry.identifiability)
    weak = weakness(geometry, uncertainty.u, rows.outputs[at > 0.0], cure, words)
    wrong = unit_words(triad, fit.model)
    ok = f"{PARAMETERS} coefficients of the gyro from {words}; condition {geometry.identifiability.condition:.1f}"
    verdict = weak or ((Status.INCONSISTENT, wrong) if wrong else (Status.OK, ok))
    findings = list(rows.findings)
    dof = float(np.sum(rate_fit.dof))
    if weak is None:
        trends = list(trend_findings(rate_fit, at, uncertainty.u))
        # what drifts makes single orientations look off
        off = None if trends else outlying(rate_fit)
        if off is not None:
            kept = np.arange(len(rows.outputs)) != off
            others = fit_rates(rows.outputs[kept], rows.file[kept], rates, rates_u)
            u = combine(NAMES, _sources(others, rates, rates_u, settings.site)).u
            place, number = rows.places[off], int(rows.numbers[off])
            findings.append(outlying_finding(fit.fit.x, others.fit.fit.x, u, place, number))
        findings += trends
        findings += _of_rates(rate_fit, rates, rates_u)
    estimate = Estimate.of(
        basis,
        NAMES,
        [TERMS[name].unit_for(triad.unit.symbol) for name in NAMES],
        fit.fit.x,
        uncertainty,
        verdict,
        findings=findings,
        statistics={
            "dof": dof,
            "condition": geometry.identifiability.condition,
            "residual_rms": float(np.sqrt(np.mean(fit.residuals**2))),
            "orientations": float(len(rows.outputs)),
        },
        result={
            "method": "known_rates",
            "orientations": _table(rows, fit, rates),
            "left_out": rows.left_out,
            "unit": {"gyro": triad.unit.symbol},
        },
    )
    return KnownRatesCalibration(timed(estimate, clock), rows, rate_fit)


def _used(rows: Orientations, settings: ImuSettings) -> Orientations:
    """The orientations that the study does not leave out."""
    if settings.exclude.times:
        raise StudyError(
            "imu.exclude",
            'found a time, expected the numbers of orientations, such as "pose 12": each FILE has times of its own',
        )
    missing = [number for number in settings.exclude.poses if number not in rows.numbers]
    if missing:
        raise StudyError(
            "imu.exclude",
            f"found pose {missing[0]}, expected one of the orientations 1 to {len(rows.numbers)}",
        )
    return rows.only(~np.isin(rows.numbers, settings.exclude.poses))


def _sources(rate_fit: RateFit, rates: Array, rates_u: Array, site: Site) -> list[TypeA | TypeB]:
    """Uncertainties by the scatter of each group of files, by the rates, and by earth rate."""
    gain = rate_fit.fit.gain()
    sources: list[TypeA | TypeB] = []
    for g, (scatter, dof) in enumerate(zip(rate_fit.scatter.tolist(), rate_fit.dof.tolist(), strict=True)):
        turned = rate_fit.of_rate[rate_fit.group == g].any(axis=0)
        names = ", ".join(_rpm(rate) for rate in rates[turned]) if turned.any() else "rest"
        covariance = gain @ rate_fit.by_scatter(g) @ gain.T
        sources.append(TypeA(f"scatter at {names}", scatter, "rad/s", covariance, dof))
    sources += [
        TypeB(f"rate {_rpm(rates[k])}", float(rates_u[k]), "rad/s", gain @ rate_fit.of_rate[:, k])
        for k in np.flatnonzero(rates_u > 0.0)
    ]
    # earth rate adds to the rate of a table that turns one way, and takes from the other: the way is not known
    vertical = math.hypot(site.vertical_rate, site.vertical_rate_u)
    spinning = np.asarray(rate_fit.of_rate.any(axis=1))
    sources.append(TypeB("vertical earth rate", vertical, "rad/s", gain @ spinning))
    if np.any(~spinning):
        # at rest it may point the same way in all rows; each third of the residuals at rest is of one axis
        axes = np.zeros((len(spinning), 3))
        at_rest = np.flatnonzero(~spinning)
        axes[at_rest, np.arange(len(at_rest)) % 3] = 1.0
        sources.append(
            TypeB("earth rate at rest", EARTH_RATE / math.sqrt(3.0), "rad/s", gain @ axes, redrawn=True)
        )
    return sources


def _rpm(rate: float) -> str:
    """A rate for people."""
    return f"{rate * 30.0 / math.pi:.5g} rpm"


def _of_rates(rate_fit: RateFit, rates: Array, rates_u: Array) -> list[Finding]:
    """Findings about the rates: contradictions, missing uncertainties, and the specific force that goes with them."""
    findings = []
    probability, difference, u = contradiction(rate_fit, rates, rates_u)
    if probability < LIMITS.driver_probability:
        others = [rate for rate in rates if rate != 0.0]
        words = ", ".join(
            f"{_rpm(rate)} seems {1e6 * d:+.0f} ± {1e6 * each:.0f} ppm larger"
            for rate, d, each in zip(others[1:], difference, u, strict=True)
        )
        findings.append(
            Finding(
                "rate_suspect",
                f"the rates contradict each other: against {_rpm(others[0])} {words} (by chance "
                f"in {probability:.1g} of "
                "tests): check their order and values, the gyro's linearity, and its g-sensitivity, which on a level "
                "table adds the same to every rate",
                harm=EVERYTHING,
            )
        )
    exact = [_rpm(rate) for rate, each in zip(rates, rates_u, strict=True) if rate != 0.0 and each == 0.0]
    if exact:
        text = f"taken as exact: {', '.join(exact)}; the scale factors are too sure by what it is not: state the rate "
        findings.append(Finding("stated_exact", text + 'with its uncertainty, such as "33.333(15) rpm"'))
    slowest = float(np.min(np.abs(rates[rates != 0.0])))
    S = rate_fit.fit.model.scale
    gain = rate_fit.fit.gain()
    turned = rate_fit.of_rate.any(axis=1)
    # on a level table specific force lies along the rate: G adds G g to the size of the rate, whatever its own
    relative = float(np.max(np.abs(gain @ turned)[3:6] / S))
    own = float(np.max(np.sqrt(np.diag(gain @ rate_fit.fit.covariance @ gain.T))[3:6] / S))
    if relative > 0.0 and own > 0.0:
        per_g = math.degrees(own / relative)
        findings.append(
            Finding(
                "g_sensitivity",
                f"rates of {_rpm(slowest)} and more on a level table cannot tell the gyro's "
                "g-sensitivity from its scale "
                f"factors: {per_g:.2g} deg/s per g would shift them by their u; on a table with a "
                "level axis it averages "
                "out",
                harm=(),
            )
        )
    return findings


def _table(rows: Orientations, fit: SizeFit, rates: Array) -> list[dict[str, object]]:
    """One row for each orientation."""
    size = np.linalg.norm(fit.x, axis=1)
    return [
        {
            "pose": int(number),
            "place": place,
            "rate_rad_s": float(rates[k]),
            "direction": direction,
            "residual_rad_s": float(length - abs(rates[k])),
        }
        for number, place, k, direction, length in zip(
            rows.numbers, rows.places, rows.file, fit.directions, size, strict=True
        )
    ]
