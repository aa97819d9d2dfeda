"""Errors of the sensors found by an earlier run, as the prior of the next."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.results.files import load as load_estimate
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reference.corrections import corrected as put_right
from inercal.systems.aoa.reference.corrections import is_verified, prior_of
from inercal.systems.aoa.result.outcome import COMMAND, geometry
from inercal.systems.aoa.result.systematic import carried, gravity_u
from inercal.systems.aoa.result.verdict import is_covariance
from inercal.systems.aoa.settings import AoaSettings

WHERE = "estimator.prior"

_USUAL = {"scale": 1.0, "bias_si": 0.0}
"""Calibration of a sensor without a stated one."""

_IN_WORDS = {
    "angle_rad": "lambda = {:.6g} rad",
    "r_m": "r = {:.6g} m",
    "z_m": "z = {:.6g} m",
    "scale": "scale = {:.8g}",
    "bias_si": "bias = {:.6g} (SI)",
}


def load(path: str | Path, settings: AoaSettings) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Coefficients by name, and their covariances by pairs of names, for `inercal.systems.aoa.fusion.problem.problem`.

    They are errors of the sensors as the earlier study stated them, so this study must state the same. The coefficients
    of a result with a reference angle are those fitted to it, and belong to the study as `corrected` gives it.

    Raises
    ------
    InputError
        The file cannot be read, or is no result (`inercal.foundation.results.files.load`).
    StudyError
        It is of another command, holds no coefficients, ended with a bad verdict, or is of other sensors.
    """
    with _in_form(path):
        earlier = _usable(path, settings)
        if is_verified(earlier):
            names, x, P = prior_of(earlier, settings)
        else:
            names, x, P = earlier.names, earlier.values, _own(earlier, settings)
    if not (np.isfinite(x).all() and np.isfinite(P).all()):
        raise StudyError(WHERE, f"{path} holds coefficients without numbers, expected all of them")
    if not is_covariance(P):
        raise StudyError(WHERE, f"{path} holds a covariance with negative variances, expected none")
    return _by_name(names, x, P)


def posterior_of(
    earlier: Estimate, settings: AoaSettings
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Coefficients of a result of the fusion of the same study, as `load` gives those of a file."""
    return _by_name(earlier.names, earlier.values, _own(earlier, settings))


def _by_name(
    names: tuple[str, ...], x: Array, P: Array
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Values by name, and covariances by pairs of names."""
    covariances = {(a, b): float(P[i, j]) for i, a in enumerate(names) for j, b in enumerate(names)}
    return dict(zip(names, x.tolist(), strict=True)), covariances


def _own(earlier: Estimate, settings: AoaSettings) -> Array:
    """Covariance (p, p) without the part of gravity, whose error is the same in all runs:
    `inercal.systems.aoa.result.systematic` carries it on from run to run."""
    slopes = carried(earlier, settings)
    shift = gravity_u(settings) * np.array([slopes.get(name, 0.0) for name in earlier.names])
    return np.asarray(earlier.covariance - np.outer(shift, shift))


def corrected(path: str | Path, settings: AoaSettings) -> AoaSettings:
    """The study with scales and axes corrected as the earlier run, or those before it, found them on a turntable.

    Raises `InputError` as `load` does.
    """
    with _in_form(path):
        return put_right(_usable(path, settings), settings)


@contextmanager
def _in_form(path: str | Path) -> Iterator[None]:
    """Refuse a file that was changed by hand, or by another program, so that this command did not write its parts."""
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        text = f"{path} does not have the form of a result of {COMMAND}, expected one as inercal wrote it"
        raise StudyError(WHERE, text) from error


def _usable(path: str | Path, settings: AoaSettings) -> Estimate:
    """The earlier result; refuses one that cannot be used."""
    earlier = load_estimate(path)
    if earlier.command != COMMAND:
        raise StudyError(WHERE, f"{path} is a result of {earlier.command}, expected one of {COMMAND}")
    if not is_verified(earlier):
        if not earlier.status.done:
            text = f"ended {earlier.status.value} ({earlier.message}), expected a run that ended ok"
            raise StudyError(WHERE, f"{path} {text}")
        if not earlier.names:
            text = f"holds no coefficients ({earlier.result.get('method', 'its method')})"
            raise StudyError(WHERE, f"{path} {text}, expected a result of the fusion")
    _same_sensors(earlier, settings, path)
    return earlier


def _same_sensors(earlier: Estimate, settings: AoaSettings, path: str | Path) -> None:
    """Refuse a result of sensors stated differently, or of another instrument."""
    then: Any = earlier.conditions.get("sensors")
    if not isinstance(then, Mapping) or not all(isinstance(of, Mapping) for of in then.values()):
        raise StudyError(WHERE, f"{path} does not say where its sensors were, expected conditions.sensors")
    now = geometry(settings)
    names, wanted = (", ".join(name for name, of in all.items() if "angle_rad" in of) for all in (then, now))
    if names != wanted:
        raise StudyError(WHERE, f"{path} is of the sensors {names}, expected those of the study, {wanted}")
    for name in dict.fromkeys((*now, *then)):
        before, current = (_USUAL | dict(all.get(name, {})) for all in (then, now))
        for key, value in current.items():
            tolerance = 0.0 if key == "scale" else LIMITS.same_sensor
            if not math.isclose(value, before[key], rel_tol=LIMITS.same_sensor, abs_tol=tolerance):
                words = _IN_WORDS[key]
                raise StudyError(
                    WHERE,
                    f"{path} was found with {words.format(before[key])} of {name}, expected {words.format(value)} as "
                    "in the study: its coefficients are errors of what was stated then",
                )
    instruments = [of.get("instrument", "") for of in (earlier.traceability, settings.traceability)]
    if all(instruments) and instruments[0] != instruments[1]:
        raise StudyError(
            WHERE,
            f"{path} is of the instrument {instruments[0]}, expected that of the study, {instruments[1]}",
        )
