"""Recordings of a model on a sting in a real tunnel: numpy alone, no code of inercal.

A sensor is a point of the body that is carried by two unit vectors, forward and upward, in a frame at rest; its
specific force is the second derivative of its place less gravity, projected on its axis as that lies in the frame.
Angles in rad, m/s^2, rad/s, s.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

G = 9.80665
DEG = np.pi / 180.0
AXES = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
"""Input axes of a1, a2, a3 in the body: forward and upward components."""

R = np.array([-0.25, 0.20, 0.25])
"""Places of the sensors ahead of the pivot [m], as the study states them."""


class Tones(NamedTuple):
    """A sum of sines: amplitudes, frequencies [Hz] and phases, (k,) each."""

    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray

    def at(self, t):
        """Value and its first two derivatives (3, n) at times (n,)."""
        out = np.zeros((3, len(t)))
        for a, f, phase in zip(*self, strict=True):
            om = 2.0 * np.pi * f
            s, c = a * np.sin(om * t + phase), a * np.cos(om * t + phase)
            out += s, om * c, -om * om * s
        return out


def tones(frequencies, amplitudes, rng):
    """Sines of stated frequencies and amplitudes, with random phases."""
    f = np.atleast_1d(np.asarray(frequencies, float))
    a = np.broadcast_to(np.asarray(amplitudes, float), f.shape)
    return Tones(a, f, rng.uniform(0.0, 2.0 * np.pi, f.shape))


def band(rms, low, high, rng, count=60):
    """Random noise in a band [Hz], of a standard deviation, as equal sines of random frequencies and phases."""
    return tones(rng.uniform(low, high, count), rms * np.sqrt(2.0 / count), rng)


@dataclass(frozen=True)
class Tunnel:
    """A run: motion, sensors, and what a tunnel adds; amplitudes in SI.

    ``kind`` is ``sine`` (``mean`` + ``amplitude`` at ``frequency``), ``polar`` (steps of 5 deg from ``mean``, moves of
    1.5 s and pauses of 4 s), or ``rest``. ``lines`` (frequency, amplitude) shake the whole model along x and z,
    ``local`` (rms, low, high) each accelerometer by itself, ``mains`` (frequency, amplitude) is picked up by each
    accelerometer, ``buffet`` (rms, low, high) turns the model, ``plunge`` (frequency, amplitude) heaves it. The gyro is
    late by ``gyro_delay``. ``constants`` times the prior's standard deviations: pivot 3 mm, places 1 mm, heights 5 mm,
    gyro scale 0.1 %.
    """

    kind: str = "sine"
    mean: float = 15.0 * DEG
    amplitude: float = 10.0 * DEG
    frequency: float = 1.0
    duration: float = 30.0
    fs: float = 500.0
    lines: tuple[tuple[float, float], ...] = ()
    local: tuple[float, float, float] | None = None
    mains: tuple[float, float] | None = None
    buffet: tuple[float, float, float] | None = None
    plunge: tuple[float, float] | None = None
    gyro_delay: float = 0.0
    constants: float = 1.0
    acc_noise: float = 1e-4 * G
    acc_bias: float = 1e-4 * G
    gyro_noise: float = 0.2 * DEG
    gyro_bias: float = 5.0 * DEG / 3600.0


@dataclass(frozen=True, eq=False)
class Run:
    """Readings: stamps ``t`` (n,), accelerometers ``acc`` (n, 3), ``gyro`` (n,), and the true ``theta`` (n,)."""

    t: np.ndarray
    acc: np.ndarray
    gyro: np.ndarray
    theta: np.ndarray
    errors: dict = field(default_factory=dict)


def _planned(tunnel, t):
    """Planned angle and its first two derivatives (3, n)."""
    out = np.zeros((3, len(t)))
    out[0] = tunnel.mean
    if tunnel.kind == "sine":
        om = 2.0 * np.pi * tunnel.frequency
        s, c = tunnel.amplitude * np.sin(om * t), tunnel.amplitude * np.cos(om * t)
        out += s, om * c, -om * om * s
    elif tunnel.kind == "polar":
        step, move, pause = 5.0 * DEG, 1.5, 4.0
        number = np.maximum(np.floor(t / (move + pause)), 0.0)
        s = np.clip((t - number * (move + pause) - pause) / move, 0.0, 1.0)
        # quintic: at rest at both ends
        out[0] += step * (number + 10 * s**3 - 15 * s**4 + 6 * s**5)
        out[1] += step / move * (30 * s**2 - 60 * s**3 + 30 * s**4)
        out[2] += step / move**2 * (60 * s - 180 * s**2 + 120 * s**3)
    return out


def simulate(tunnel, seed):
    """A run of a tunnel."""
    rng = np.random.default_rng(seed)
    c = tunnel.constants
    errors = {
        "b": tunnel.acc_bias * np.sqrt(0.5) * (rng.standard_normal() + rng.standard_normal(3)),
        "b_g": tunnel.gyro_bias * rng.standard_normal(),
        "dr": c * (3e-3 * rng.standard_normal() + 1e-3 * rng.standard_normal(3)),
        "zo": c * 5e-3 * rng.standard_normal(3),
        "k_g": c * 1e-3 * rng.standard_normal(),
    }
    none = Tones(*np.zeros((3, 0)))
    buffet = none if tunnel.buffet is None else band(*tunnel.buffet, rng)
    along = [
        Tones(*(np.concatenate(part) for part in zip(*each, strict=True)))
        for each in (
            [tones(f, 0.3 * a, rng) for f, a in tunnel.lines] or [none],
            [tones(f, a, rng) for f, a in tunnel.lines] or [none],
        )
    ]
    plunge = none if tunnel.plunge is None else tones(*tunnel.plunge, rng)
    local = [none if tunnel.local is None else band(*tunnel.local, rng) for _ in range(3)]
    mains = [none if tunnel.mains is None else tones(*tunnel.mains, rng) for _ in range(3)]

    def moved(t):
        return _planned(tunnel, t) + buffet.at(t)

    t = np.arange(round(tunnel.duration * tunnel.fs)) / tunnel.fs
    theta, w, al = moved(t)
    # unit vectors of the body in the frame at rest (2, n), and their second derivatives
    forward = np.array([np.cos(theta), np.sin(theta)])
    upward = np.array([-np.sin(theta), np.cos(theta)])
    forward2 = al * upward - w * w * forward
    upward2 = -al * forward - w * w * upward
    # lines act along the body's axes, a plunge along the vertical
    shaken = along[0].at(t)[0] * forward + along[1].at(t)[0] * upward
    shaken[1] += plunge.at(t)[0] + G
    acc = np.empty((len(t), 3))
    for k in range(3):
        force = (R[k] + errors["dr"][k]) * forward2 + errors["zo"][k] * upward2 + shaken
        axis = AXES[k, 0] * forward + AXES[k, 1] * upward
        acc[:, k] = np.sum(force * axis, axis=0) + errors["b"][k]
        acc[:, k] += local[k].at(t)[0] + mains[k].at(t)[0]
    gyro = (1.0 + errors["k_g"]) * moved(t - tunnel.gyro_delay)[1] + errors["b_g"]
    acc += tunnel.acc_noise * rng.standard_normal(acc.shape)
    gyro = gyro + tunnel.gyro_noise * rng.standard_normal(len(t))
    return Run(t, acc, gyro, theta, errors)


LINES = {
    "quiet": {},
    "local 0.5 g, 120-240 Hz": {"local": (0.5 * G, 120.0, 240.0)},
    "lines 0.3 g, 112 and 230 Hz": {"lines": ((112.0, 0.3 * G), (230.0, 0.3 * G))},
    "lines 0.05 g, 47, 112, 230 Hz": {"lines": ((47.0, 0.05 * G), (112.0, 0.05 * G), (230.0, 0.05 * G))},
    "mains 50 mg": {"mains": (50.0, 0.05 * G)},
}
BUFFETS = {
    f"buffet {rms:g} deg, {low:g}-{high:g} Hz": {"buffet": (rms * DEG, low, high)}
    for rms, low, high in (
        (0.05, 5.0, 40.0),
        (0.1, 5.0, 40.0),
        (0.3, 5.0, 40.0),
        (0.1, 20.0, 40.0),
        (0.2, 2.0, 15.0),
    )
}
DELAYS = {f"gyro late {ms:g} ms": {"gyro_delay": ms * 1e-3} for ms in (0.5, 1.0, 5.0)}
PLUNGE = {"plunge 0.02 g, 2 Hz": {"plunge": (2.0, 0.02 * G)}}
CASES = LINES | BUFFETS | DELAYS | PLUNGE
"""Cases of the issue by name: what they add to a `Tunnel`."""
