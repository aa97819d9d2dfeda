"""Draws the pictures of docs/published/tan-2021.md: into this folder, or into the one given."""

import sys
from pathlib import Path

import numpy as np

from inercal.aoa import lever, static
from inercal.aoa.arms import axes, centrifugal_arms, tangential_arms
from inercal.aoa.layout import Layout
from inercal.report.aoa_published import (
    Curves,
    centrifugal_residual,
    lever_arm_untreated,
    static_methods,
    tangential_residual,
)
from inercal.units import STANDARD_GRAVITY as G

DEG = np.pi / 180.0
DA, DW = 1e-4 * G, 0.2 * DEG
LAYOUT = Layout(
    ("a1", "a2", "a3"), np.array([90.0, 0.0, -90.0]) * DEG, np.array([-0.25, 0.20, 0.25]), np.zeros(3)
)
H, Q, P = axes(LAYOUT), centrifugal_arms(LAYOUT), tangential_arms(LAYOUT)
DUAL, FREED = lever.dual(LAYOUT, 1.0)
MICRO, LARGE = (0.01 * DEG, 0.777), (10.0 * DEG, 0.5)
NAMES = {MICRO: "micro: 0.01° at 0.777 Hz", LARGE: "large: 10° at 0.5 Hz"}
SENSORS = "a1 (-z) at -0.25 m, a2 (+x) at 0.20 m, a3 (+z) at 0.25 m, 1000 samples a second."
T = np.arange(0.0, 40.0, 1e-3)  # long enough for the filter and for the frequency
DRAWN = (T >= 18.0) & (T < 22.0)

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent


def motion(amplitude, frequency):
    """Angle, rate and acceleration about 30°."""
    om = 2.0 * np.pi * frequency
    swing = amplitude * np.sin(om * T)
    return 30.0 * DEG + swing, amplitude * om * np.cos(om * T), -(om**2) * swing


def readings(theta, w, al):
    """What the axes read in motion, without errors."""
    return G * np.stack([np.sin(theta), np.cos(theta)], -1) @ H.T - np.outer(w**2, Q) + np.outer(al, P)


def errors(read, theta, way="improved"):
    """Errors [rad] of the angle as at rest."""
    return static.angle(way, read, LAYOUT, G).theta - theta


def drawn(title, lines, scale="linear"):
    """A panel of errors by name, every 16 ms."""
    shown = np.flatnonzero(DRAWN)[::16]
    time = T[shown] - T[shown[0]]
    return Curves(title, time, {name: line[shown] for name, line in lines.items()}, scale=scale)


def centrifugal(of):
    """What is left of the centrifugal term by a gyro that reads dw too much, the tangential one being taken off."""
    theta, w, al = motion(*of)
    read, still = readings(theta, w, al), readings(theta, 0.0 * w, 0.0 * al)
    ideal = still - np.mean(w**2) * Q  # the mean of the term stays, and nothing else is touched
    lines = {"low pass, ideal": errors(ideal, theta)}
    for name, way in (("mechanical", "mechanical"), ("low pass, real", "low-pass")):
        made, _ = lever.centrifugal(way, T, read, w + DW, LAYOUT, 1.0, DW)
        still[:, 1] = made[:, 1]
        lines[name] = errors(still, theta)
    return drawn(NAMES[of], lines, "log")


def tangential(of):
    """With the tangential term alone, taken off by accelerations that err by white noise; rms of 50 ms each."""
    theta, w, al = motion(*of)
    read, rng = readings(theta, 0.0 * w, al), np.random.default_rng(2021)
    noise = DA * rng.standard_normal(read.shape)
    ways = {
        "untreated": 0.0 * al,
        "differentiated gyro": lever.differentiated(T, w + DW * rng.standard_normal(len(T)), 1.0),
        "dual accelerometer": (read + noise) @ DUAL,
    }
    off = {name: errors(read - np.outer(e, P), theta)[DRAWN].reshape(-1, 50) for name, e in ways.items()}
    rms = {name: np.sqrt(np.mean(each**2, axis=1)) for name, each in off.items()}
    return Curves(NAMES[of], 0.05 * np.arange(80) + 0.025, rms, scale="log")


theta, w, al = motion(*LARGE)
untreated = drawn(
    f"30° + {NAMES[LARGE].partition(': ')[2]}",
    {
        "both terms": errors(readings(theta, w, al), theta),
        "tangential alone": errors(readings(theta, 0.0 * w, al), theta),
        "centrifugal alone": errors(readings(theta, w, 0.0 * al), theta),
    },
)
across = np.linspace(-90.0, 90.0, 721) * DEG
still = G * np.stack([np.sin(across), np.cos(across)], -1) @ H.T + DA
pair = ("complementary", "improved")
sweep = Curves("static", across, {way: np.abs(errors(still, across, way)) for way in pair}, sweep=True)
known = readings(theta, 0.0 * w, 0.0 * al) + DA
freed = (readings(theta, 0.0 * w, al) + DA) @ FREED.T
oscillating = {f"{way}, al known": np.abs(errors(known, theta, way)) for way in pair}
oscillating["either, dual"] = np.abs(errors(freed, theta))
about = f"Motion about 30°. {SENSORS}"
for number, picture in (
    (3, lever_arm_untreated(untreated, f"Improved mechanisation, no other errors. {SENSORS}")),
    (
        10,
        centrifugal_residual(
            centrifugal(MICRO),
            centrifugal(LARGE),
            "Ideal: the cosine of the term goes and nothing else; real: an offline filter of all that a2 reads. "
            f"A gyro that is off by 0.2°/s, no other errors. {about}",
        ),
    ),
    (
        11,
        tangential_residual(
            tangential(MICRO),
            tangential(LARGE),
            "Rms of every 50 ms. White noise of 1e-4 g and 0.2°/s in what measures the angular acceleration, no other "
            f"errors. {about}",
        ),
    ),
    (12, static_methods(sweep, drawn(NAMES[LARGE], oscillating), f"All axes off by +1e-4 g. {about}")),
):
    (folder / f"tan-2021-figure-{number}.svg").write_text(picture.svg, encoding="utf-8")
