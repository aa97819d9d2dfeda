"""The paper's way to the angle: lever-arm terms taken off sample by sample, then an angle as at rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.angles import Angles, continuous
from inercal.systems.aoa.layout import all_weights, tangential_arms
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper import lever, static
from inercal.systems.aoa.paper.delay import aligned, relative_delay
from inercal.systems.aoa.paper.lever import zero_phase
from inercal.systems.aoa.paper.residuals import error_terms
from inercal.systems.aoa.paper.static import spread
from inercal.systems.aoa.reading.recording import Recording, later
from inercal.systems.aoa.settings import AoaSettings, Methods

LOW_PASS = 30.0
"""Cutoff [Hz] of the low pass that the fusion is compared with: twice the highest frequency of a usual buffet."""

_ORDER = 4

MEASURED = (
    Methods(),
    Methods(centrifugal="low-pass"),
    Methods(centrifugal="decision"),
    Methods(tangential="differentiated"),
    Methods(tangential="none"),
    Methods(static="complementary", tangential="none"),
    Methods(static="segmented", tangential="none"),
    Methods(centrifugal="none", tangential="none"),
)
"""Methods of a comparison, the paper's own choice first.

The static ways are set side by side without the dual pair, with which complementary and improved coincide in motion.
"""


def label(methods: Methods) -> str:
    """Name of the methods, such as ``improved, mechanical, dual``."""
    return f"{methods.static}, {methods.centrifugal}, {methods.tangential}"


def measure(recording: Recording, settings: AoaSettings, methods: Methods) -> Angles:
    """The angles of a recording by the paper's methods, each row by itself but for filters and differences.

    The gyro is shifted first, by its delay that the study states or that the spectra of the whole recording plainly
    show (`Limits.delay_sigmas`); the delay common to all sensors is made up for at the end by theta' tau. A roll is
    that which the study states.

    A row in which accelerometers are missing uses the others if the methods can; otherwise it has no angle. The
    uncertainty is of first order (`inercal.systems.aoa.paper.residuals.error_terms`), without flexure of the sting.

    Raises
    ------
    StudyError
        The layout lacks the axes that the methods need, or the model lies on its side.
    RecordError
        There is no gyro where the methods need one, or time does not go on.
    """
    settings.attitude.check_pitch_shows()
    _check_sensors(settings, methods, not len(recording.t) or bool(np.isfinite(recording.gyro).any()))
    gyro_delay = settings.timing.gyro_delay
    if gyro_delay is None:
        shown = relative_delay(recording, settings.layout)
        plain = shown is not None and abs(shown.value) > LIMITS.delay_sigmas * shown.u
        gyro_delay = shown.value if shown is not None and plain else 0.0
    recording = aligned(recording, gyro_delay)
    level, taken = settings.attitude.level, later(recording.t)
    t, acc, gyro = recording.t[taken], recording.acc[taken], recording.gyro[taken]
    noise = settings.noise
    acc, compensated = lever.centrifugal(
        methods.centrifugal, t, acc, gyro, settings.layout, level, noise.gyro
    )
    rate, acceleration = gyro / level, np.zeros(len(t))
    step = float(np.median(np.diff(t))) if len(t) > 1 else math.nan
    if methods.tangential == "differentiated":
        acceleration = lever.differentiated(t, gyro, level)
        p = tangential_arms(settings.layout, level)
        acc = acc - np.where(p == 0.0, 0.0, p * acceleration[:, None])
    theta, u = np.full((2, len(t)), np.nan)
    for rows, seen in _alike(acc):
        layout, read = settings.layout.of(*seen), acc[rows][:, seen]
        dual = np.eye(len(seen))
        try:
            if methods.tangential == "dual":
                weights, dual = lever.dual(layout, level)
                acceleration[rows] = read @ weights
            elif methods.tangential == "none" and (every := all_weights(layout)) is not None:
                acceleration[rows] = read @ every / level
            w, al = np.nan_to_num(rate[rows]), np.nan_to_num(acceleration[rows])
            terms = error_terms(settings, methods.tangential, layout, level, w, al, compensated[rows], step)
            errors = [(weight, dual @ matrix @ dual.T) for weight, matrix in terms]
            still = static.angle(methods.static, read @ dual.T, layout, settings.site.gravity, level)
        except StudyError:  # too few axes are left in these rows
            acceleration[rows] = np.nan
            continue
        theta[rows], u[rows] = still.theta, spread(still.gain, errors)
    return _at_stamps(recording, settings, methods, taken, theta, u, rate, np.nan_to_num(acceleration))


def low_passed(angles: Angles, t: Array, cutoff: float = LOW_PASS) -> Angles:
    """Angles (n,) at the times ``t`` [s] after a zero-phase low pass (Butterworth, gain 1/2 at ``cutoff`` [Hz]).

    For comparison with the fusion only: it looks ahead, and it takes motion faster than the cutoff out of the angle
    itself. The uncertainty stays, as an upper bound: no filter lowers the part of biases.
    """
    taken = later(t)
    smooth = zero_phase(t[taken], continuous(angles.theta[taken]), cutoff, _ORDER)
    theta = np.full(len(t), np.nan)
    theta[taken] = principal(smooth)
    return replace(angles, method=f"{angles.method}, {cutoff:.6g} Hz low pass", theta=theta)


def _check_sensors(settings: AoaSettings, methods: Methods, has_gyro: bool) -> None:
    """Refuse methods that lack sensors in all rows: raises `StudyError`, and `RecordError` without a gyro."""
    layout, level = settings.layout, settings.attitude.level
    if methods.tangential == "dual":
        lever.dual(layout, level)
    static.angle(methods.static, np.zeros((0, len(layout.names))), layout, settings.site.gravity, level)
    without_gyro = methods.centrifugal in ("none", "low-pass") and methods.tangential != "differentiated"
    if not (without_gyro or has_gyro):
        raise RecordError(
            "gyro", f"missing, which {label(methods)} needs: without it none, none or none, dual work"
        )


def _alike(acc: Array) -> Iterator[tuple[NDArray[np.intp], list[int]]]:
    """Rows with the same accelerometers, and these accelerometers; rows without any are left out."""
    finite = np.isfinite(acc)
    kind = np.zeros(len(acc), dtype=np.int64)
    for k in range(acc.shape[1]):
        kind = 2 * kind + finite[:, k]
    for combination in np.unique(kind[kind > 0]):
        rows = np.flatnonzero(kind == combination)
        seen = [int(k) for k in np.flatnonzero(finite[rows[0]])]
        yield rows, seen


def _at_stamps(
    recording: Recording,
    settings: AoaSettings,
    methods: Methods,
    taken: NDArray[np.int64],
    theta: Array,
    u: Array,
    rate: Array,
    acceleration: Array,
) -> Angles:
    """The angles of the rows ``taken``, made up for the delay common to all sensors; NaN in other rows.

    Without a gyro the rate that makes up for it is the slope of the angle.
    """
    timing, noise = settings.timing, settings.noise
    of_gyro = math.hypot(noise.gyro, noise.gyro_bias) / abs(settings.attitude.level)
    rate_u = np.where(np.isfinite(rate), of_gyro, np.nan)
    tau, tau_u = timing.common_delay, timing.common_delay_u
    if tau or tau_u:
        slope = np.gradient(continuous(theta), recording.t[taken]) if len(theta) > 1 else np.zeros(len(theta))
        moving = np.where(np.isfinite(rate), rate, slope)
        theta = principal(theta + tau * moving + 0.5 * tau**2 * acceleration)
        u = np.sqrt(u**2 + (moving * tau_u) ** 2 + (tau * np.nan_to_num(rate_u)) ** 2)
        rate_u = np.hypot(rate_u, acceleration * tau_u)
        rate = rate + tau * acceleration
    columns = np.full((4, len(recording.t)), np.nan)
    columns[:, taken] = theta, u, rate, rate_u
    return Angles(label(methods), *columns)
