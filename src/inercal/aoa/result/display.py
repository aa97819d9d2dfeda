"""An angle of attack for people: units of the field, names and delays in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.aoa.reference.corrections import is_verified
from inercal.aoa.settings import GYROS
from inercal.estimate.result import Estimate
from inercal.estimate.rounding import rounded
from inercal.instruments.terms import term


def in_words(name: str) -> str:
    """What a coefficient is: ``b_2`` the bias of accelerometer 2."""
    of = term(name)
    return "" if of is None else of.name


def displayed(estimate: Estimate) -> Estimate:
    """The estimate for people, its sensors in words."""
    stated = estimate.conditions.get("sensors", {})
    shown = estimate.shown()
    sensors = {name: _sensor(name, of) for name, of in stated.items()}
    return replace(shown, conditions={**shown.conditions, "sensors": sensors})


def _sensor(name: str, stated: Mapping[str, float]) -> str:
    """A sensor as the study states it: ``lambda 90 deg, r -0.25 m, z 0 m``."""
    told = []
    if "angle_rad" in stated:
        angle = float(np.degrees(stated["angle_rad"]))
        told += [f"lambda {angle:.6g} deg", f"r {stated['r_m']:.6g} m", f"z {stated['z_m']:.6g} m"]
    if "scale" in stated:
        of_gyro = name in GYROS
        bias = float(np.degrees(stated["bias_si"])) if of_gyro else stated["bias_si"]
        told += [f"scale {stated['scale']:.8g}", f"bias {bias:.6g} {'deg/s' if of_gyro else 'm/s^2'}"]
    return ", ".join(told)


def use_of_fit(estimate: Estimate) -> str:
    """How the sensors that were fitted to a reference angle are used; nothing where there is no such fit."""
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
    """A coefficient of such a fit less what it is where a sensor is as the study states: 1 of a scale, else 0."""
    return float(parameter["value"] - (1.0 if parameter["name"].startswith("S_") else 0.0))


def off_statement(fit: Mapping[str, Any]) -> list[str]:
    """Names of the coefficients that such a fit sees off what the study states, by more than two u."""
    return [
        each["name"]
        for each in fit["parameters"]
        if each["name"] not in fit["unseen"] and abs(off_stated(each)) > 2.0 * each["u"]
    ]


def rest_of_fit(estimate: Estimate) -> str:
    """The coefficients of such a fit that are not `off_statement`, by name; nothing where there are none."""
    fit = estimate.result.get("verified")
    if fit is None:
        return ""
    off, unseen = off_statement(fit), list(fit["unseen"])
    stated = [each["name"] for each in fit["parameters"] if each["name"] not in (*off, *unseen)]
    told = (
        (stated, "within two u of what the study states"),
        (unseen, "not seen in this motion"),
    )
    parts = [f"{words}: {', '.join(names)}" for names, words in told if names]
    return f"Fitted to theta_ref, but not listed: {'; '.join(parts)}." if parts else ""


def delays(estimate: Estimate) -> str:
    """Sentences on delays: that of the gyro, and what one common to all sensors costs."""
    timing = estimate.result["timing"]
    sentences = [_of_gyro(estimate, timing["gyro_delay"]), _in_common(timing)]
    return " ".join(each for each in sentences if each)


def _of_gyro(estimate: Estimate, known: Mapping[str, Any]) -> str:
    """What is known of the delay of the gyro."""
    told = []
    if "tau_g" in estimate.names:
        told.append((estimate["tau_g"].value, estimate["tau_g"].u, "by the fusion"))
    elif known["stated"]:
        told.append((known["stated"], 0.0, "as stated"))
    if known["spectra"] is not None:
        told.append((known["spectra"]["value"], known["spectra"]["u"], "by the spectra"))
    if not told:
        return ""
    shown = [value for value, u, _ in told if abs(value) > 2.0 * u]
    turned = -1.0 if shown and shown[0] < 0.0 else 1.0
    values = ", ".join(f"{_ms(turned * value, u)} {how}" for value, u, how in told)
    if not shown:
        return f"No delay of the gyro against the accelerometers is seen: {values}."
    return f"The gyro is {'later' if turned > 0.0 else 'earlier'} than the accelerometers by {values}."


def _in_common(timing: Mapping[str, Any]) -> str:
    """What a delay of all sensors does to the angle."""
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
