"""Noise for the filters of other tools: Kalibr, OpenVINS and VINS, from the Allan deviation of an IMU.

Kalibr and OpenVINS take densities: N of each triad, and the random walk K of its biases. VINS takes standard deviations
of samples, N sqrt(rate) and K sqrt(rate). The bias instability B is no random walk and is never written as one. A triad
has one number, the root mean square of its axes.

Source: kalibr_common/ConfigReader.py of github.com/ethz-asl/kalibr; config/*/kalibr_imu_chain.yaml of
github.com/rpng/open_vins; vins_estimator/src/factor/integration_base.h of github.com/HKUST-Aerial-Robotics/VINS-Mono,
where each step adds (noise dt)^2.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from inercal.faces.convert.other_tools import Converted
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.results.basis import Formula
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit

NOISE_TOOLS = ("kalibr", "openvins", "vins")
"""Tools whose noise files are written."""

_SENSORS = {"acc": "accelerometers", "gyro": "gyros"}
_UNITS = {
    "N_acc": "m/s/sqrt(s)",
    "N_gyro": "rad/sqrt(s)",
    "K_acc": "m/s^2/sqrt(s)",
    "K_gyro": "rad/s/sqrt(s)",
}


def noise_to_tool(estimate: Estimate, tool: str, where: object) -> Converted:
    """The noise of an IMU, as an Allan deviation of six channels tells it, in a tool's file.

    Where a random walk was not seen, its upper limit (95 %) stands in the file, and that is said: a filter that takes a
    bias for steadier than it is becomes too sure.

    Raises `InputError`: no noise of three accelerometers and three gyros in units of acceleration and rate, or another
    tool.
    """
    if tool not in NOISE_TOOLS:
        raise InputError(
            where, f"holds noise, which {tool} has no file for, expected {', '.join(NOISE_TOOLS)}"
        )
    channels: Mapping[str, Mapping[str, object]] = estimate.result["channels"]
    missing = [name for name in (f"{s}_{axis}" for s in _SENSORS for axis in "xyz") if name not in channels]
    if missing:
        raise InputError(where, f"holds no noise of {', '.join(missing)}, expected that of a whole IMU")
    values, us, limited = {}, {}, []
    for symbol in "NK":
        for sensor in _SENSORS:
            key = f"{symbol}_{sensor}"
            terms = [_term(estimate, f"{key}_{axis}", where) for axis in "xyz"]
            squares = [value**2 for value, _, _ in terms]
            values[key] = math.sqrt(sum(squares) / 3.0)
            us[key] = math.sqrt(sum((value * u) ** 2 for value, u, _ in terms)) / 3.0 / values[key]
            limited += [f"{key}_{axis}" for axis, term in zip("xyz", terms, strict=True) if term[2]]
    intervals = [float(str(channels[f"{sensor}_x"]["interval_s"])) for sensor in _SENSORS]
    rate = 1.0 / float(np.mean(intervals))
    findings: tuple[Finding, ...] = ()
    if limited:
        findings = (
            Finding(
                "not_stated",
                f"the random walk of {len(limited)} channels was not seen: its upper limit is written",
                action="record longer at rest, at a steady temperature, to see it",
                items=tuple({"coefficient": name} for name in limited),
                harm=(),
            ),
        )
    names = tuple(values)
    converted = replace(
        estimate,
        command="convert",
        names=names,
        units=tuple(_UNITS[name] for name in names),
        values=np.array([values[name] for name in names]),
        covariance=np.diag([us[name] ** 2 for name in names]),
        common=None,
        dof=np.full(len(names), np.inf),
        findings=(*(replace(finding, harm=()) for finding in estimate.findings), *findings),
        budget=(),
        model=Formula(r"$\mathrm{density} = \sqrt{(N_x^2 + N_y^2 + N_z^2)/3}$, and of $K$ likewise"),
        timing={},
        result={"convention": tool, "rate_Hz": rate},
    )
    return Converted(converted, {"": _text(tool, values, rate, limited)})


def _term(estimate: Estimate, name: str, where: object) -> tuple[float, float, bool]:
    """Value and u of a coefficient, or its upper limit where it was not seen, and whether it is that limit."""
    symbol, channel = name.split("_", 1)
    sensor = channel.split("_")[0]
    at = estimate.names.index(name) if name in estimate.names else None
    if at is not None and estimate.values[at] > 0.0:
        unit = parse_unit(estimate.units[at])
        wanted = parse_unit(_UNITS[f"{symbol}_{sensor}"])
        if unit.dimension != wanted.dimension:
            raise InputError(
                where, f"{name} is in {unit.symbol}, expected {wanted.symbol}: outputs in counts have none"
            )
        factor = unit.factor / wanted.factor
        return factor * float(estimate.values[at]), factor * float(estimate.u[at]), False
    limit = estimate.result["channels"][channel].get("upper_limits", {}).get(symbol)
    if limit is None:
        raise InputError(where, f"found neither {name} nor an upper limit of it, expected a longer recording")
    factor = parse_unit(str(estimate.result["channels"][channel]["unit"])).factor
    return factor * float(limit), 0.0, True


def _text(tool: str, values: Mapping[str, float], rate: float, limited: list[str]) -> str:
    """The file of a tool (YAML)."""
    upper = (
        ["# random walks of " + ", ".join(limited) + " are upper limits: they were not seen"]
        if limited
        else []
    )
    if tool == "vins":
        root = math.sqrt(rate)
        lines = [
            f"# standard deviations of samples at {rate:.6g} Hz: densities times sqrt(rate); at another rate others",
            *upper,
            f"acc_n: {root * values['N_acc']:.6g}          # m/s^2",
            f"gyr_n: {root * values['N_gyro']:.6g}          # rad/s",
            f"acc_w: {root * values['K_acc']:.6g}          # m/s^3, per sample",
            f"gyr_w: {root * values['K_gyro']:.6g}          # rad/s^2, per sample",
        ]
        return "\n".join(lines) + "\n"
    pad = "  " if tool == "openvins" else ""
    lines = [
        f"{pad}accelerometer_noise_density: {values['N_acc']:.6g}    # m/s^2/sqrt(Hz), white noise N",
        f"{pad}accelerometer_random_walk: {values['K_acc']:.6g}    # m/s^3/sqrt(Hz), random walk K of the bias",
        f"{pad}gyroscope_noise_density: {values['N_gyro']:.6g}    # rad/s/sqrt(Hz), white noise N",
        f"{pad}gyroscope_random_walk: {values['K_gyro']:.6g}    # rad/s^2/sqrt(Hz), random walk K of the bias",
        f"{pad}rostopic: /imu0    # put yours here",
        f"{pad}update_rate: {rate:.6g}    # Hz",
    ]
    if tool == "openvins":
        lines = ["%YAML:1.0", "", "imu0:", *lines]
    return "\n".join([*lines[:1], *upper, *lines[1:]] if tool == "openvins" else [*upper, *lines]) + "\n"
