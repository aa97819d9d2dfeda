"""Readings of the sections: mean outputs, integrals of the turns, noise at rest, and findings about the sections."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.geometry.earth import Site
from inercal.foundation.noise.dwell_means import AllanFit, fit_pooled
from inercal.foundation.records.column import Triad
from inercal.systems.imu.ferraris.method import Inputs
from inercal.systems.imu.ferraris.names import POSITIONS, TURNS
from inercal.systems.imu.ferraris.sections import Sections
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import clipped_rows, coarse_steps
from inercal.systems.imu.settings import FerrarisSettings

_EDGE = 5


@dataclass(frozen=True, eq=False)
class SectionReadings:
    """Readings of the nine sections.

    ``inputs`` of the method and the ``weights`` (6,) of the positions in the gyro's bias; ``lengths`` (6,) of the
    positions [s]; ``noise`` the Allan fit of each sensor at rest;
    ``resolution`` (3,) of each sensor the step of those axes whose noise is below half a step, else 0 [output];
    ``swing`` (3, 2) the mean cosine and sine of the angle over each turn; ``findings`` what is wrong with a section.
    """

    inputs: Inputs
    weights: Array
    lengths: Array
    noise: dict[str, AllanFit]
    resolution: dict[str, Array]
    swing: Array
    findings: tuple[Finding, ...]


def read_sections(
    acc: Triad, gyro: Triad, sections: Sections, site: Site, options: FerrarisSettings
) -> SectionReadings:
    """Average and integrate the sections, all nine of them."""
    at_rest = {
        triad.sensor: [triad.values[rows[name]] for name in POSITIONS]
        for triad, rows in ((acc, sections.acc), (gyro, sections.gyro))
    }
    counts = np.array([len(part) for part in at_rest["gyro"]], dtype=float)
    rate = np.array([part.mean(axis=0) for part in at_rest["gyro"]])
    weights = counts / counts.sum()
    bias = weights @ rate
    clipped, longest = clipped_rows(gyro), LIMITS.motion_gap / gyro.rate
    turned, durations, swing, findings = [], [], [], list(_moving(at_rest))
    for axis, name in enumerate(TURNS):
        t, output = gyro.t[sections.gyro[name]], gyro.values[sections.gyro[name]]
        cells = _cells(t)
        turned.append(cells @ output / cells.sum())
        durations.append(cells.sum())
        passed = np.cumsum(cells * (output[:, axis] - bias[axis]))
        angle = options.turn * passed / passed[-1] if passed[-1] else np.zeros(len(t))
        swing.append([cells @ np.cos(angle) / cells.sum(), cells @ np.sin(angle) / cells.sum()])
        findings += _of_turn(
            name, t, output - bias, bool(clipped[sections.gyro[name]].any()), longest, options
        )
    inputs = Inputs(
        force=np.array([part.mean(axis=0) for part in at_rest["acc"]]),
        rate=rate,
        turned_force=np.array([acc.values[sections.acc[name]].mean(axis=0) for name in TURNS]),
        turned_rate=np.array(turned),
        durations=np.array(durations),
        angles=np.full(3, options.turn),
        gravity=np.array(site.gravity),
        vertical_rate=np.array(site.vertical_rate),
    )
    return SectionReadings(
        inputs,
        weights,
        np.array([len(sections.acc[name]) for name in POSITIONS]) / acc.rate,
        {triad.sensor: _noise(triad, at_rest[triad.sensor]) for triad in (acc, gyro)},
        {
            triad.sensor: coarse_steps(triad.values, np.std(max(at_rest[triad.sensor], key=len), axis=0))
            for triad in (acc, gyro)
        },
        np.array(swing),
        tuple(findings),
    )


def _noise(triad: Triad, parts: list[Array]) -> AllanFit:
    """Allan fit of the positions together; none of them is long enough for one: white noise from their scatter."""
    if max(map(len, parts)) >= 16:
        return fit_pooled(parts, 1.0 / triad.rate)
    white = np.mean([part.var(axis=0, ddof=1) for part in parts], axis=0) / triad.rate
    return AllanFit(np.stack([white, 0.0 * white, 0.0 * white]), sum(map(len, parts)), 1.0 / triad.rate)


def _cells(t: Array) -> Array:
    """Length of time of each sample [s]: half the way to its neighbours, at the ends a whole interval as inside.

    With even stamps all are equal, and the integral is the sum over the rate, as Ferraris and imucal take it.
    """
    steps = np.diff(t)
    padded = np.concatenate([steps[:1], steps, steps[-1:]])
    return np.asarray(0.5 * (padded[:-1] + padded[1:]))


def _moving(at_rest: dict[str, list[Array]]) -> Iterator[Finding]:
    """Positions in which the instrument was not still."""
    for sensor, parts in at_rest.items():
        sizes = np.array([np.linalg.norm(np.var(part, axis=0)) for part in parts])
        usual = float(np.median(sizes))
        for name, size in zip(POSITIONS, sizes, strict=True):
            if size > LIMITS.position_variance * usual > 0.0:
                yield Finding(
                    "poor_section",
                    f"the instrument moves in section {name}: {sensor} varies {math.sqrt(size / usual):.0f} times as "
                    "much as in the others",
                    harm=EVERYTHING,
                )


def _of_turn(
    name: str, t: Array, rate: Array, clipped: bool, longest: float, options: FerrarisSettings
) -> Iterator[Finding]:
    """Findings about a turn: ``rate`` (n, 3) its output less the bias, ``longest`` step of time [s] allowed."""
    where, axis = f"t {t[0]:.2f} to {t[-1]:.2f} s", name[0]
    gains = (f"S_{axis}", *(f"T_{i}{axis}" for i in "xyz" if i != axis))
    steps = np.diff(t)
    if not np.all((steps > 0.0) & (steps <= longest)):
        text = f"samples are missing in the turn {name}: its angle is not known"
        yield Finding("poor_section", text, where, gains)
    if clipped:
        text = f"the gyro saturates in the turn {name}: its integral is too small"
        yield Finding("saturation", text, where, gains)
    largest = float(np.max(np.abs(rate)))
    edges = [float(np.max(np.abs(part.mean(axis=0)))) for part in (rate[:_EDGE], rate[-_EDGE:])]
    if max(edges) > LIMITS.cut_rate * largest:
        end = "beginning" if edges[0] == max(edges) else "end"
        code = "poor_section" if max(edges) > LIMITS.lost_rate * largest else "turn_cut"
        part = f"{100 * max(edges) / largest:.0f} % of its largest rate"
        text = f"the turn {name} is under way at the {end} of its section, at {part}: some of its angle is cut off"
        # at a steady deceleration this part of the angle is left
        small = max(edges) ** 2 / largest**2 * abs(options.turn) < options.turn_u
        yield Finding(code, text, where, () if code == "turn_cut" and small else gains)
