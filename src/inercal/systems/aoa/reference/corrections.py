"""A fit of the sensors to a turntable, as corrections of a study and as the prior of its fusion.

The fusion estimates biases, positions, and the gyro's scale and delay, but no scale and axis of an accelerometer, which
it could not separate from them. So scale S and axis error dlambda of the fit are corrected in the study: the reading A
of a sensor becomes A / S, along lambda + dlambda.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reference.sensor_fit import Verified
from inercal.systems.aoa.settings import AoaSettings, Estimator


def report_of(verified: Verified) -> dict[str, Any]:
    """A fit as the key ``verified`` of a result."""
    rows = zip(verified.names, verified.values.tolist(), verified.u.tolist(), verified.units, strict=True)
    return {
        "parameters": [{"name": name, "value": value, "u": u, "unit": unit} for name, value, u, unit in rows],
        "covariance": verified.covariance,
        "unseen": list(verified.unseen),
        "converged": verified.converged,
        "rows": verified.rows,
        "reference_noise_rad": verified.reference_noise,
    }


def is_verified(earlier: Estimate) -> bool:
    """True for a result with a fit to a reference angle that is worth more than the fusion of the same record.

    A short record, or one of few angles, hardly separates a scale or an axis from a bias: where a sensor would be known
    much worse than its bias is by the fusion, which takes axes and scales for exact, the fit is not used.
    """
    fit = earlier.result.get("verified", {})
    if not fit.get("converged", False):
        return False
    left = {each["name"]: float(each["u"]) for each in fit["parameters"]}
    of_fusion = dict(zip(earlier.names, np.sqrt(np.diag(earlier.covariance)).tolist(), strict=True))
    count = sum(name.startswith("S_") for name in left)
    return all(
        STANDARD_GRAVITY * left[f"{kind}_{k}"] <= LIMITS.fit_ratio * of_fusion.get(f"b_{k}", math.inf)
        and f"{kind}_{k}" not in fit["unseen"]
        for kind in ("S", "dlambda")
        for k in range(1, count + 1)
    )


def corrected(earlier: Estimate, settings: AoaSettings) -> AoaSettings:
    """The study with scales and axes corrected by the fit of an earlier result and by that result's own corrections."""
    names = settings.layout.names
    before = earlier.result.get("corrections", {})
    of = {name: (before[name]["scale"], before[name]["angle_rad"]) for name in names if name in before}
    if is_verified(earlier):
        values = {each["name"]: each["value"] for each in earlier.result["verified"]["parameters"]}
        for k, name in enumerate(names, start=1):
            scale, angle = of.get(name, (1.0, 0.0))
            of[name] = (scale * values[f"S_{k}"], angle + values[f"dlambda_{k}"])
    return _applied(settings, of)


def as_stated(settings: AoaSettings) -> AoaSettings:
    """The study without corrections: the inverse of `corrected`."""
    undone = {name: (1.0 / scale, -angle) for name, (scale, angle) in settings.corrections.items()}
    return replace(_applied(settings, undone), corrections={})


def _applied(settings: AoaSettings, of: Mapping[str, tuple[float, float]]) -> AoaSettings:
    """The study with scales and axis angles corrected by name."""
    layout, sensors = settings.layout, dict(settings.sensors)
    angle = layout.angle + [of.get(name, (1.0, 0.0))[1] for name in layout.names]
    for name, (scale, _) in of.items():
        sensor = settings.calibration(name)
        sensors[name] = replace(
            sensor,
            scale=sensor.scale / scale,
            bias=sensor.bias / scale,
            bias_slope=sensor.bias_slope / scale,
            range=None if sensor.range is None else sensor.range / scale,
        )
    return replace(settings, layout=replace(layout, angle=angle), sensors=sensors, corrections=dict(of))


def prior_of(earlier: Estimate, settings: AoaSettings) -> tuple[tuple[str, ...], Array, Array]:
    """Names, values (p,) and covariance (p, p) of the fusion's coefficients after a fit to a reference angle.

    The fit took the study's prior ten times as wide: here it is added. The rest of the uncertainty of scale and axis is
    added to the bias, as at the angle of its largest effect.
    """
    fit = earlier.result["verified"]
    names = [each["name"] for each in fit["parameters"]]
    in_study = ("S_", "dlambda_")
    values = np.array(
        [0.0 if each["name"].startswith(in_study) else float(each["value"]) for each in fit["parameters"]]
    )
    information = _inverse(np.array(fit["covariance"], dtype=float))
    usual = problem(
        replace(settings, estimator=Estimator(19), timing=replace(settings.timing, gyro_delay=None))
    )
    shared = [name for name in usual.nuisances if name in names]
    there, here = [names.index(name) for name in shared], [usual.nuisances[name] for name in shared]
    whole = information.copy()
    whole[np.ix_(there, there)] += _inverse(usual.covariance[np.ix_(here, here)])
    P = _inverse(whole)
    x = P @ information @ values
    covariance = P[np.ix_(there, there)]
    g = settings.site.gravity
    for k in range(1, len(settings.layout.names) + 1):
        left = max(P[names.index(f"{kind}_{k}"), names.index(f"{kind}_{k}")] for kind in ("S", "dlambda"))
        at = shared.index(f"b_{k}")
        covariance[at, at] += g * g * left
    return tuple(shared), x[there], covariance


def _inverse(matrix: Array) -> Array:
    """The inverse of a positive matrix with rows of very different size."""
    size = np.sqrt(np.diag(matrix))
    inverse = np.linalg.inv(matrix / np.outer(size, size)) / np.outer(size, size)
    return np.asarray(0.5 * (inverse + inverse.T))
