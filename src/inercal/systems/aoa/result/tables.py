"""An angle of attack for people: tables of angle, points, sensors, sources of u, methods; delays and fits in words."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.instruments.terms import shown_unit, sized
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table, rounded, short
from inercal.systems.aoa.angles import gives_alpha
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reference.corrections import is_verified
from inercal.systems.aoa.result.budget import ANGLE
from inercal.systems.aoa.result.outcome import term_of
from inercal.systems.aoa.result.points import Point
from inercal.systems.aoa.settings import GYROS, AoaSettings

_OF_AXIS = ("mrad", 1e-3)
"""Unit of the error of an axis."""


def answer(estimate: Estimate, points: Iterable[Point], settings: AoaSettings) -> list[Table]:
    """Tables of the answer: the angle, and the points where there are any."""
    return _with_rows(angle(estimate), points_table(points, settings))


def on_page(estimate: Estimate) -> list[Table]:
    """Tables of a page beside the answer and the errors of the sensors."""
    return _with_rows(fitted(estimate), uncertainty(estimate), methods(estimate))


def on_terminal(estimate: Estimate) -> list[Table]:
    """Tables of a terminal beside the answer: of a fit to a reference only coefficients that differ from the study."""
    fit = estimate.result.get("verified")
    off = fitted(estimate, () if fit is None else off_statement(fit))
    return _with_rows(sensors(estimate), off, uncertainty(estimate), methods(estimate))


def _with_rows(*tables: Table) -> list[Table]:
    """Tables with rows."""
    return [each for each in tables if each.rows]


def angle(estimate: Estimate) -> Table:
    """Range of the angle, its uncertainty, and its error where there is a reference."""
    result = estimate.result
    span, u, judged = result["angle"]["range"], result["angle"]["u"], result.get("reference", {})
    rate = estimate.conditions["ranges"]["rate_rad_s"]
    rows = [
        ("angle, smallest", *_degrees(None if span is None else span[0], 6)),
        ("angle, largest", *_degrees(None if span is None else span[1], 6)),
        ("u of the angle, median after 2 s", *_degrees(u["median"])),
        ("u of the angle, largest after 2 s", *_degrees(u["max"])),
        ("rate, largest", short(None if rate is None else math.degrees(rate)), "deg/s"),
    ]
    for key, words in (("max_abs_deg", "largest"), ("rms_deg", "rms"), ("mean_deg", "mean")):
        if key in judged:
            rows.append((f"{words} error against theta_ref", short(judged[key]), "deg"))
    return Table("Angle", f"By {result['method']}.", (("", ""), ("value", ""), ("unit", "")), tuple(rows))


def points_table(points: Iterable[Point], settings: AoaSettings) -> Table:
    """Points, a row each, with alpha and beta where the study states how the model lies in the stream."""
    rows = [
        (
            f"{each.number:g}",
            _numbers(each.trigger, each.last_trigger),
            f"{each.begin:.3f}",
            f"{each.end:.3f}",
            *_rounded(each.theta, each.u),
            short(math.degrees(each.scatter)),
            *_rounded(each.alpha, each.u_alpha),
            *_rounded(each.beta, each.u_beta),
        )
        for each in points
    ]
    angles = ("theta", "u", "scatter", "alpha", "u", "beta", "u")
    heads = (
        ("point", ""),
        ("trigger", ""),
        ("begins", "s"),
        ("ends", "s"),
        *((name, "deg") for name in angles),
    )
    shown = len(heads) if gives_alpha(settings.attitude) else len(heads) - 4
    return Table(
        "Points",
        "Mean angle of each point and its standard uncertainty; scatter is the standard deviation about it.",
        heads[:shown],
        tuple(row[:shown] for row in rows),
        2,
    )


def sensors(estimate: Estimate) -> Table:
    """Errors of the sensors, with the uncertainty before and after."""
    rows = []
    for name, each in estimate.parameters.items():
        unit, size = shown_unit(each.unit)
        prior = estimate.result["posterior"][name]["prior"]
        value, u = rounded(each.value / size, each.u / size)
        rows.append((name, term_of(name).name, value, u, short(prior / size), unit))
    return Table(
        "Errors of the sensors",
        "As estimated at the end of the recording; u before is the standard uncertainty that the study, or an earlier "
        "run, gave.",
        (("", ""), ("what it is", ""), ("value", ""), ("u", ""), ("u before", ""), ("unit", "")),
        tuple(rows),
        2,
    )


def fitted(estimate: Estimate, names: Container[str] | None = None) -> Table:
    """Coefficients of the fit to the reference angle: those with these ``names``, or all."""
    fit = estimate.result.get("verified")
    heads = (("", ""), ("what it is", ""), ("value", ""), ("u", ""), ("unit", ""), ("as angle", "deg"))
    title, rows = "Sensors as fitted to the reference angle", []
    if fit is None:
        return Table(title, "", heads, ())
    for each in fit["parameters"]:
        name, value = each["name"], off_stated(each)
        if names is not None and name not in names:
            continue
        unit, size = _OF_AXIS if name.startswith("dlambda_") else shown_unit(each["unit"])
        shown, u = rounded(value / size, each["u"] / size)
        angle = f"{math.degrees(value):.4f}" if name.startswith("dlambda_") else ""
        cells = ("not seen", "–", "", "") if name in fit["unseen"] else (shown, u, unit, angle)
        rows.append((name, term_of(name).name, *cells))
    title += "" if fit["converged"] else ": it did not converge, and is not to be used"
    noise = short(math.degrees(fit["reference_noise_rad"]))
    rows.append(("", "noise of theta_ref from sample to sample", noise, "–", "deg", ""))
    caption = f"What each sensor reads against theta_ref, its zero and its clock taken as true. {use_of_fit(estimate)}"
    return Table(title, caption, heads, tuple(rows), 2)


def uncertainty(estimate: Estimate) -> Table:
    """Sources of the uncertainty of the angle, the largest first."""
    variance = estimate.result["angle"]["u"]["median"]
    largest_first = sorted(estimate.budget, key=lambda each: -each.share.get(ANGLE, 0.0))
    rows = []
    for each in largest_first:
        share = each.share.get(ANGLE, 0.0)
        if share >= LIMITS.listed_share and variance is not None:
            stated_u, unit = sized(each.u, each.unit)
            size = "" if unit == "1" else f"{short(stated_u)} {unit}"
            part = math.degrees(variance) * math.sqrt(share)
            rows.append((each.source, size, short(100.0 * share), short(part)))
    return Table(
        "Where the uncertainty of the angle comes from",
        "Share of each source in the variance of the angle, on average after the first 2 s of a stretch at the "
        "beginning, and its part of the median u.",
        (("source", ""), ("standard uncertainty", ""), ("share", "%"), ("part of u", "deg")),
        tuple(rows),
        2,
    )


def methods(estimate: Estimate) -> Table:
    """Methods side by side: errors against the reference angle where there is one, else differences from the first."""
    result = estimate.result
    judged = "reference" in result
    first = _errors(result.get("reference")) if judged else ("–", "–")
    lines = [(result["method"], *first, _degrees(result["angle"]["u"]["median"])[0])]
    for name, each in result["compare"].items():
        apart = each["difference"]
        differences = short(apart["max_abs_deg"]), short(apart["rms_deg"])
        numbers = _errors(each.get("reference")) if judged else differences
        lines.append((name, *numbers, short(each["u_median_deg"])))
    if judged:
        caption = "Angle less theta_ref after the first 2 s, also where the reference rests and moves."
        heads: tuple[str, ...] = ("largest error", "rms", "mean", "rms at rest", "rms moving")
    else:
        caption = f"Difference of the angle from that of {result['method']}."
        heads = ("largest difference", "rms")
    return Table(
        "Methods side by side",
        f"{caption} The last column is the median u that each method states.",
        (("method", ""), *((head, "deg") for head in heads), ("u", "deg")),
        tuple(lines) if result["compare"] else (),
    )


def _errors(judged: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Largest, rms and mean error, and rms at rest and in motion."""
    if judged is None:
        return ("–",) * 5
    of_all = (judged["max_abs_deg"], judged["rms_deg"], judged["mean_deg"])
    return tuple(short(each) for each in (*of_all, judged["static"]["rms_deg"], judged["moving"]["rms_deg"]))


def _degrees(value: float | None, digits: int = 2) -> tuple[str, str]:
    """An angle [rad] in degrees, and the unit."""
    return short(None if value is None else math.degrees(value), digits), "deg"


def _rounded(value: float, u: float) -> tuple[str, str]:
    """An angle and its standard uncertainty [rad] in degrees; dashes where there is none."""
    if not math.isfinite(value):
        return "–", "–"
    shown, spread = rounded(float(np.degrees(value)), float(np.degrees(u)))
    return shown, spread


def _numbers(first: float, last: float) -> str:
    """Trigger numbers: the first and the last."""
    if math.isnan(first):
        return "–"
    return f"{first:g}" if first == last else f"{first:g}-{last:g}"


def displayed(estimate: Estimate) -> Estimate:
    """The estimate for people, its sensors in words."""
    nominal = estimate.conditions.get("sensors", {})
    shown = estimate.shown()
    sensors = {name: _sensor(name, of) for name, of in nominal.items()}
    return replace(shown, conditions={**shown.conditions, "sensors": sensors})


def _sensor(name: str, nominal: Mapping[str, float]) -> str:
    """A sensor as the study states it: ``lambda 90 deg, r -0.25 m, z 0 m``."""
    parts = []
    if "angle_rad" in nominal:
        angle = float(np.degrees(nominal["angle_rad"]))
        parts += [f"lambda {angle:.6g} deg", f"r {nominal['r_m']:.6g} m", f"z {nominal['z_m']:.6g} m"]
    if "scale" in nominal:
        of_gyro = name in GYROS
        bias = float(np.degrees(nominal["bias_si"])) if of_gyro else nominal["bias_si"]
        parts += [f"scale {nominal['scale']:.8g}", f"bias {bias:.6g} {'deg/s' if of_gyro else 'm/s^2'}"]
    return ", ".join(parts)


def use_of_fit(estimate: Estimate) -> str:
    """A sentence on the use of the sensors fitted to a reference angle; empty without a fit."""
    fit = estimate.result.get("verified")
    if fit is None:
        return ""
    if not fit["converged"]:
        return "The fit of the sensors to theta_ref did not converge: it is not to be used."
    if not is_verified(estimate):
        return (
            "The fit of the sensors to theta_ref knows the scale or the axis of an accelerometer too badly to be of "
            "use to a next run: sweep to and fro, over more angles, or longer."
        )
    return (
        'To use the fit to theta_ref: write this result by --out result.json, and put prior = "result.json" under '
        "[estimator] of the study; scales and axes are then put right, and the rest is what is known before."
    )


def off_stated(parameter: Mapping[str, Any]) -> float:
    """A coefficient of the fit to a reference angle less its value for a sensor as stated: 1 for a scale, else 0."""
    return float(parameter["value"] - (1.0 if parameter["name"].startswith("S_") else 0.0))


def off_statement(fit: Mapping[str, Any]) -> list[str]:
    """Names of the coefficients that the fit to a reference angle puts more than two u from the study."""
    return [
        each["name"]
        for each in fit["parameters"]
        if each["name"] not in fit["unseen"] and abs(off_stated(each)) > LIMITS.disagreeing_sigmas * each["u"]
    ]


def rest_of_fit(estimate: Estimate) -> str:
    """A sentence on the other coefficients of the fit (`off_statement`), by name; empty without any."""
    fit = estimate.result.get("verified")
    if fit is None:
        return ""
    off, unseen = off_statement(fit), list(fit["unseen"])
    agreeing = [each["name"] for each in fit["parameters"] if each["name"] not in (*off, *unseen)]
    groups = {"within two u of what the study states": agreeing, "not seen in this motion": unseen}
    parts = [f"{words}: {', '.join(names)}" for words, names in groups.items() if names]
    return f"Fitted to theta_ref, but not listed: {'; '.join(parts)}." if parts else ""


def delays(estimate: Estimate) -> str:
    """Sentences on delays: that of the gyro, and the cost of one common to all sensors."""
    timing = estimate.result["timing"]
    sentences = [_of_gyro(estimate, timing["gyro_delay"]), _in_common(timing)]
    return " ".join(each for each in sentences if each)


def _of_gyro(estimate: Estimate, delay: Mapping[str, Any]) -> str:
    """A sentence on the delay of the gyro."""
    estimates = []
    own = estimate.result["posterior"].get("tau_g")
    if delay["stated"]:
        estimates.append((delay["stated"], 0.0, "as stated"))
    elif own is not None and own["u"] < UNSEEN * own["prior"]:
        estimates.append((own["value"], own["u"], "by the fusion"))
    if delay["spectra"] is not None:
        estimates.append((delay["spectra"]["value"], delay["spectra"]["u"], "by the spectra"))
    if not estimates:
        return ""
    shown = [value for value, u, _ in estimates if abs(value) > 2.0 * u]
    turned = -1.0 if shown and shown[0] < 0.0 else 1.0
    values = ", ".join(f"{_ms(turned * value, u)} {how}" for value, u, how in estimates)
    if not shown:
        return f"No delay of the gyro against the accelerometers is seen: {values}."
    return f"The gyro is {'later' if turned > 0.0 else 'earlier'} than the accelerometers by {values}."


def _in_common(timing: Mapping[str, Any]) -> str:
    """A sentence on the effect of a common delay on the angle."""
    delay, each = timing["common_delay"], timing["cost_per_ms"]
    if each["max"] is None:
        return ""
    costs = f"{_deg(each['max'])} at most and {_deg(each['rms'])} rms for each millisecond"
    if not delay["value"] and not delay["u"]:
        return (
            f"A delay that all sensors have in common is not stated, and no sensor sees it: it costs {costs} "
            "(the rate of the angle times the delay)."
        )
    value, left = timing["cost"], timing["cost_u"]
    return (
        f"The stated common delay of {_ms(delay['value'], delay['u'])} is put right: it moves the angle by "
        f"{_deg(value['max'])} at most, {_deg(value['rms'])} rms (the rate of the angle times the delay); its "
        f"uncertainty leaves {_deg(left['max'])} at most, {_deg(left['rms'])} rms."
    )


def _ms(value: float, u: float) -> str:
    """A time with its standard uncertainty."""
    if not u:
        return f"{1e3 * value:.4g} ms"
    shown, spread = rounded(1e3 * value, 1e3 * u)
    return f"{shown} ms (u {spread} ms)"


def _deg(value: float) -> str:
    """An angle [rad] in degrees."""
    return f"{np.degrees(value):.2g} deg"
