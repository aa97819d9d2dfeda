"""Draws the pictures of docs/published/tan-2021.md: into this folder, or into the one given."""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from inercal.faces.report.style import COLOURS, QUIET, WIDTH, envelope, few_powers, figure, svg
from inercal.foundation.units import STANDARD_GRAVITY as G
from inercal.systems.aoa.layout import Layout, axes, centrifugal_arms, tangential_arms
from inercal.systems.aoa.paper import lever, residuals, static

DEG = np.pi / 180.0
DA, DW = 1e-4 * G, 0.2 * DEG
LAYOUT = Layout(
    ("a1", "a2", "a3"), np.array([90.0, 0.0, -90.0]) * DEG, np.array([-0.25, 0.20, 0.25]), np.zeros(3)
)
H, Q, P = axes(LAYOUT), centrifugal_arms(LAYOUT), tangential_arms(LAYOUT)
DUAL, FREED = lever.dual(LAYOUT, 1.0)
MICRO, LARGE = (0.01 * DEG, 0.777), (10.0 * DEG, 0.5)
NAMES = {MICRO: "micro: 0.01° at 0.777 Hz", LARGE: "large: 10° at 0.5 Hz"}
T = np.arange(0.0, 40.0, 1e-3)  # long enough for the filter and for the frequency
DRAWN = (T >= 18.0) & (T < 22.0)

SPAN = 1e-5  # part of its highest value down to which a logarithmic axis reaches: errors that change sign have none

folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent


@dataclass(frozen=True, eq=False)
class Curves:
    """Angle errors (n,) [rad] by name, over ``along`` (n,): a time [s], or an angle [rad] where ``sweep``."""

    title: str
    along: np.ndarray
    errors: Mapping[str, np.ndarray]
    sweep: bool = False
    log: bool = False


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


def sampled(title, lines, log=False):
    """A panel of errors by name, every 16 ms."""
    shown = np.flatnonzero(DRAWN)[::16]
    time = T[shown] - T[shown[0]]
    return Curves(title, time, {name: line[shown] for name, line in lines.items()}, log=log)


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
    return sampled(NAMES[of], lines, log=True)


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
    return Curves(NAMES[of], 0.05 * np.arange(80) + 0.025, rms, log=True)


def drawn(panels: Sequence[Curves]) -> str:
    """Panels side by side, each with its own axes and legend; on a logarithmic axis sizes of the errors."""
    with figure(WIDTH, 2.6) as page:
        for axes, panel in zip(page.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            if panel.log:
                axes.set_yscale("log")
            else:
                axes.axhline(0.0, color=QUIET, lw=0.6)
            along = np.degrees(panel.along) if panel.sweep else panel.along
            for k, (name, errors) in enumerate(panel.errors.items()):
                shown = np.degrees(np.abs(errors) if panel.log else errors)
                shown = np.where(shown > 0.0, shown, np.nan) if panel.log else shown
                axes.plot(*envelope(along, shown, 1000), color=COLOURS[k], lw=0.9, label=name)
            axes.set_xlabel("angle of attack [°]" if panel.sweep else "time [s]")
            axes.set_ylabel("size of the angle error [°]" if panel.log else "angle error [°]")
            axes.set_title(panel.title)
            axes.margins(x=0.01)
            axes.grid(axis="y")
            if panel.log:
                low, high = axes.get_ylim()
                axes.set_ylim(max(low, high * SPAN), high)
                few_powers(axes.yaxis)
                axes.minorticks_off()
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
        return svg(page)


theta, w, al = motion(*LARGE)
untreated = sampled(
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


def a_minute():
    """The 0.12°: 30° ± 10° at a peak rate of 80°/s, r2 X = 0.867 m/s, by a gyro with white errors and nothing else."""
    t, peak = np.arange(0.0, 60.0, 1e-3), 80.0 * DEG
    om, far = (
        peak / (10.0 * DEG),
        Layout(LAYOUT.names, LAYOUT.angle, np.array([-0.25, 0.867 / peak, 0.25]), LAYOUT.z),
    )
    swing = 10.0 * DEG * np.sin(om * t)
    theta, w, al = 30.0 * DEG + swing, peak * np.cos(om * t), -(om**2) * swing
    read = G * np.stack([np.sin(theta), np.cos(theta)], -1) @ H.T
    read += -np.outer(w**2, centrifugal_arms(far)) + np.outer(al, tangential_arms(far))
    gyro = w + DW * np.random.default_rng(12).standard_normal(len(t))
    made, _ = lever.centrifugal("mechanical", t, read, gyro, far, 1.0, DW)
    off = static.angle("improved", made @ lever.dual(far, 1.0)[1].T, far, G).theta - theta
    largest = np.abs(off).reshape(-1, 100).max(axis=1)
    level = residuals.sampled(1.0, 0.867, DW, G, len(t), 30.0 * DEG)
    lines = {"largest of each 0.1 s": largest, "level that one sample exceeds": np.full(len(largest), level)}
    return Curves("30° ± 10° at 1.27 Hz, r2 = 0.62 m", 0.1 * np.arange(len(largest)) + 0.05, lines)


for number, panels in (
    (3, [untreated]),
    (10, [centrifugal(MICRO), centrifugal(LARGE)]),
    (11, [tangential(MICRO), tangential(LARGE)]),
    (12, [sweep, sampled(NAMES[LARGE], oscillating)]),
    ("12-minute", [a_minute()]),
):
    (folder / f"tan-2021-figure-{number}.svg").write_text(drawn(panels), encoding="utf-8")
