"""An angle of attack for people: units of the field, names and delays in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.aoa.limits import LIMITS
from inercal.aoa.reference.corrections import is_verified
from inercal.aoa.settings import GYROS
from inercal.estimate.result import Estimate
from inercal.estimate.rounding import rounded


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
    if "tau_g" in estimate.names:
        estimates.append((estimate["tau_g"].value, estimate["tau_g"].u, "by the fusion"))
    elif delay["stated"]:
        estimates.append((delay["stated"], 0.0, "as stated"))
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
