"""A platform whose joints are driven by motors and whose gyros measure, in plain NumPy: rigs of one, two and three axes
on any base, in a vehicle too. It shares no code with the product.

Frames and joints are those of `independent.selfcal`. The attitude is what joints and base make of it,

    C_np = C_nb C_sway C_bp(th),   C_nb = R(about north, 0, about east) Y(-heading),

and the gyros read the rate that takes it from row to row: w + M w + kg0 + noise is the true rate, w the one read.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .selfcal import (
    NOMINAL,
    TRUTH,
    Faults,
    Noise,
    Record,
    about,
    earth_and_up,
    gimballed,
    turned,
    vee,
)


@dataclass(frozen=True)
class Place:
    """Of the base: ``heading`` from north to east, ``tilt`` (2,) about north and about east, ``sway`` about these two,
    a quarter of a period apart [rad], and its ``frequency`` [Hz]; ``vibration`` [m/s^2] rms along each axis of p, of
    many frequencies about ``shaking`` [Hz]; ``begin`` (3,) angles of the joints [rad]."""

    heading: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    sway: float = 0.0
    frequency: float = 0.3
    vibration: float = 0.0
    shaking: float = 37.0
    begin: tuple[float, float, float] = (0.0, 0.0, 0.0)


def driven(rng, drive, truth=TRUTH, noise: Noise = NOMINAL, faults=None, place=None) -> Record:
    """One record: gyros, encoders of all joints, accelerometers; ``truth`` (18,) and of ``faults`` those of the rig."""
    faults, place = faults or Faults(), place or Place()
    kg0, eta, ds, do, ka0, ka1 = truth.reshape(6, 3)
    earth, up = earth_and_up(faults)
    rows = round(drive.spans()[1] / drive.step) + 1
    t = drive.step * np.arange(rows)
    C_nb = turned(np.array([place.tilt[0], 0.0, place.tilt[1]])) @ about(1, -place.heading)
    phase = rng.uniform(0.0, 2.0 * np.pi)

    def joints_at(times):
        return np.array(place.begin) + drive.angles(times)

    def attitudes(times):
        angle = 2.0 * np.pi * place.frequency * times + phase
        sway = place.sway * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], -1)
        C_bp = gimballed(joints_at(times), faults, np.zeros((len(times), 3)))
        return turned(sway) @ C_nb @ turned(faults.base) @ C_bp

    C_np = attitudes(t)
    spin = turned(earth * drive.step)
    gained = vee(np.swapaxes(C_np[:-1], -1, -2) @ spin @ C_np[1:]) / drive.step
    M = np.array([[0.0, ds[0], -do[0]], [-do[1], 0.0, ds[1]], [ds[2], -do[2], 0.0]])
    M = M + np.diag(faults.gyro_scale)
    own = noise.walk / np.sqrt(drive.step) * rng.standard_normal(gained.shape)
    read = np.linalg.solve(np.eye(3) + M, (gained - kg0 - own).T).T

    th = joints_at(t - faults.delay_encoder) + faults.zero + noise.encoder * rng.standard_normal((rows, 3))
    f = np.einsum("kji,j->ki", attitudes(t - faults.delay_accelerometer), up)
    if place.vibration:
        waves = place.shaking * (1.0 + 0.2 * rng.standard_normal((40, 1, 3)))
        begin = rng.uniform(0.0, 2.0 * np.pi, waves.shape)
        f = f + place.vibration * np.sin(2.0 * np.pi * waves * t[:, None] + begin).sum(0) / np.sqrt(20.0)
    along = np.stack([f[:, 0], f[:, 1] - eta[1] * f[:, 0], f[:, 2] + eta[0] * f[:, 0] - eta[2] * f[:, 1]], -1)
    acc = ka0 + (1.0 + ka1) * (along + faults.k2 * along**2)
    acc = acc + noise.accelerometer * rng.standard_normal((rows, 3))
    rates = np.vstack([read, np.full(3, np.nan)])
    return Record(t, rates, th, acc, C_np, np.full(rows, 25.0), True)
