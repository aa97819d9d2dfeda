"""What ordinary faults of a platform do, size by size: shift of the coefficients in u, verdicts, and what is said.

    python benchmarks/selfcal_faults.py --draws 50 --out build/selfcal-faults.json
    python benchmarks/selfcal_faults.py --draws 50 --states '["rig", "k2", "levers"]' --only careful

Records are those of benchmarks/independent/selfcal.py, with the same noise with a fault and without it. The table, as
Markdown, has for each fault the root mean square over the draws of the shift, over its u by noise and prior alone, of
the coefficient that is shifted most; how many draws end ok, and the largest error of these over u; the largest error of
all draws, over u by noise and prior alone and over u; all verdicts; and the first words of what is said to do harm.
NEES is that of the 18 coefficients, over 18; how much wider u is than that of the paper's model on a rig without a
fault, as median and largest.
"""

from __future__ import annotations

import argparse
import functools
import json
import os
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.places import add_options, answers, in_words
from independent.selfcal import (
    ARCSEC,
    DEG_H,
    PPM,
    THREE,
    TRUTH,
    UG,
    Drive,
    Faults,
    G,
    simulated,
    study,
)

import inercal as ic

SEED = 20261122
DRIVE = Drive(THREE, ramp=0.4)
MS = 1e-3

Drawn = Callable[[np.random.Generator], Faults]


def directed(rng, size, n=3):
    """A vector of that length in a random direction."""
    v = rng.standard_normal(n)
    return size * v / np.linalg.norm(v)


def wave(rng, size):
    """Harmonics 1 and 2 of each encoder, in random phase."""
    return tuple((joint, order, size, rng.uniform(0.0, 6.3)) for joint in range(3) for order in (1, 2))


def warmed(rng, kelvin):
    """Biases 10 ug/K and 0.01 deg/h/K, scales 5 ppm/K, of random sign."""
    signs = [rng.choice([-1.0, 1.0], 3) for _ in range(3)]
    return Faults(
        warming=kelvin,
        bias_by_k=10 * UG * signs[0],
        gyro_by_k=0.01 * DEG_H * signs[1],
        scale_by_k=5 * PPM * signs[2],
    )


#: name -> sizes in words, each with what is drawn
ALONE: dict[str, list[tuple[str, Drawn]]] = {
    "none": [("", lambda _: Faults())],
    "gamma": [(f"{s} arcsec", lambda rng, s=s: Faults(gamma=directed(rng, s * ARCSEC))) for s in (1, 5, 20)],
    "zero of th_y": [(f"{s} arcsec", lambda _, s=s: Faults(zero=s * ARCSEC * np.eye(3)[1])) for s in (1, 10)],
    "zeros of th_x, th_z": [
        (f"{s} arcsec", lambda _, s=s: Faults(zero=s * ARCSEC * np.array([1.0, 0.0, 1.0]))) for s in (5,)
    ],
    "non-orthogonality": [
        (f"{s} arcsec", lambda rng, s=s: Faults(non_orthogonality=directed(rng, s * ARCSEC, 2)))
        for s in (1, 3, 10)
    ],
    "base": [(f"{s} arcsec", lambda rng, s=s: Faults(base=directed(rng, s * ARCSEC))) for s in (5,)],
    "K2": [(f"{s} ug/g^2", lambda rng, s=s: Faults(k2=directed(rng, s * 1e-6 / G))) for s in (2, 5, 10)],
    "harmonics": [
        (f"{s} arcsec", lambda rng, s=s: Faults(harmonics=wave(rng, s * ARCSEC))) for s in (0.3, 1)
    ],
    "delay of encoders": [(f"{s} ms", lambda _, s=s: Faults(delay_encoder=s * MS)) for s in (0.2, 1, 10)],
    "delay of accelerometers": [
        (f"{s} ms", lambda _, s=s: Faults(delay_accelerometer=s * MS)) for s in (0.2, 1, 10)
    ],
    "delay of commands": [(f"{s} ms", lambda _, s=s: Faults(delay_gyro=s * MS)) for s in (0.2, 1, 10)],
    "1/f of accelerometers": [(f"{s} ug", lambda _, s=s: Faults(flicker=s * UG)) for s in (1, 2, 5)],
    "1/f of gyros": [(f"{s} deg/h", lambda _, s=s: Faults(gyro_flicker=s * DEG_H)) for s in (0.001, 0.003)],
    "levers": [
        (f"{s} cm", lambda rng, s=s: Faults(levers=0.01 * s * rng.uniform(-1.0, 1.0, (3, 3)))) for s in (1, 5)
    ],
    "gravity": [(f"{s} ppm", lambda _, s=s: Faults(gravity=s * PPM)) for s in (5, 20)],
    "latitude": [(f"{s} deg", lambda _, s=s: Faults(latitude=np.radians(s))) for s in (0.01,)],
    "warming": [(f"{s} K", lambda rng, s=s: warmed(rng, s)) for s in (0.2, 1)],
    "sag": [(f"{s} arcsec/g", lambda _, s=s: Faults(sag=s * ARCSEC)) for s in (0.5, 3)],
    "scale asymmetry": [
        (f"{s} ppm", lambda rng, s=s: Faults(asymmetry=directed(rng, s * PPM))) for s in (2, 5, 20)
    ],
    "g-sensitivity": [(f"{s} deg/h/g", lambda _, s=s: Faults(g_sensitivity=s * DEG_H)) for s in (0.01, 0.1)],
    "gyro scale": [(f"{s} ppm", lambda rng, s=s: Faults(gyro_scale=directed(rng, s * PPM))) for s in (2, 10)],
    "base sway, 0.3 Hz": [(f"{s} arcsec", lambda _, s=s: Faults(sway=s * ARCSEC)) for s in (0.5, 2)],
    "jitter of stamps": [(f"{s} ms", lambda _, s=s: Faults(jitter=s * MS)) for s in (0.1,)],
    "encoder quantum": [(f"{s} arcsec", lambda _, s=s: Faults(quantum=s * ARCSEC)) for s in (1, 10)],
    "gaps": [("10 s and 30 s", lambda _: Faults(gaps=((100.0, 110.0), (400.0, 430.0))))],
    "lost rows": [("5 %", lambda _: Faults(lost=0.05))],
}


def careful(rng, flicker, harmonic):
    """A careful rig: all at once, each small."""
    return (
        Faults(
            gamma=directed(rng, 5 * ARCSEC),
            zero=5 * ARCSEC * rng.choice([-1.0, 1.0], 3),
            non_orthogonality=directed(rng, 3 * ARCSEC, 2),
            k2=directed(rng, 5e-6 / G),
            delay_encoder=0.2 * MS,
            delay_accelerometer=0.2 * MS,
        )
        + Faults(flicker=flicker * UG, levers=rng.uniform(-0.03, 0.03, (3, 3)))
        + Faults(harmonics=wave(rng, harmonic * ARCSEC) if harmonic else ())
    )


TOGETHER: dict[str, list[tuple[str, Drawn]]] = {
    "careful rig": [
        ("1/f 1 ug", lambda rng: careful(rng, 1.0, 0.0)),
        ("1/f 2 ug, harmonics 1 arcsec", lambda rng: careful(rng, 2.0, 1.0)),
    ]
}
ALL = ALONE | TOGETHER


def calibrated(states: str, number: int, drawn: Faults):
    """The result of one record."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(study(more=f"[model]\nstates = {states}\n" if states else ""))
        simulated(np.random.default_rng([SEED, number]), DRIVE, faults=drawn).write(folder / "record.csv")
        return ic.calibrate(ic.read(folder / "record.csv"), folder / "study.toml").estimate


@functools.cache
def without_fault(states: str, number: int):
    """The result of a record without a fault, with the same noise."""
    return calibrated(states, number, Faults())


def summary_of(states: str, fault: str, size: int, draws: int) -> dict:
    """Shift, verdicts and words of a fault."""
    rng = np.random.default_rng([SEED, list(ALL).index(fault), size])
    shift, errors, nees, wider, worst_of = [], [], [], [], []
    verdicts, said = Counter(), Counter()
    for number in range(draws):
        drawn = ALL[fault][size][1](rng)
        done = calibrated(states, number, drawn)
        verdicts[done.status.value] += 1
        harmful = {" ".join(f"{f.code}: {f.message}".split()[:8]) for f in done.findings if f.harm}
        said.update(harmful)
        if len(done.names):
            values, u = done.values[:18], done.u[:18]
            alone = np.array([done.result["bounds"][name] for name in done.names[:18]])
            shift.append((values - without_fault(states, number).values[:18]) / alone)
            off = (values - TRUTH) / u
            worst_of.append([np.max(np.abs(values - TRUTH) / each) for each in (alone, u)])
            nees.append(off @ np.linalg.solve(done.covariance[:18, :18] / np.outer(u, u), off) / 18)
            wider.append(u / without_fault('"paper"', number).u[:18])
            if done.status.value == "ok":
                errors.append(np.abs(off).max())
    rms = np.sqrt(np.mean(np.square(shift), axis=0)) if shift else np.full(18, np.nan)
    worst = int(np.nanargmax(rms)) if shift else 0
    return {
        "rms": float(rms[worst]),
        "name": done.names[worst] if len(done.names) else "",
        "ok": verdicts["ok"] / draws,
        "worst_ok": float(max(errors, default=np.nan)),
        "worst": np.max(worst_of, axis=0).tolist() if worst_of else [],
        "nees": float(np.mean(nees)) if nees else np.nan,
        "wider": [float(f(wider)) for f in (np.median, np.max)] if wider else [],
        "verdicts": dict(verdicts),
        "said": dict(said.most_common(3)),
    }


@dataclass(frozen=True)
class Summaries:
    """The summaries of faults (name, number of its size), by their numbers."""

    states: str
    draws: int
    asked: tuple[tuple[str, int], ...]

    def __call__(self, number: int) -> dict:
        """One of them."""
        return summary_of(self.states, *self.asked[number], self.draws)


HEAD = (
    "| fault | size | shift | ok | worst of those ok | worst of all | NEES/18 | wider | verdicts | said |\n"
    + "|---" * 10
    + "|"
)


def row(key: str, each: dict) -> str:
    """Markdown of one fault."""
    fault, size = key.split("|")
    verdicts = ", ".join(f"{name} {count}" for name, count in each["verdicts"].items())
    words = "; ".join(f"{text} ({count})" for text, count in each["said"].items())
    return (
        f"| {fault} | {size} | {each['rms']:.1f} u of {each['name']} | {100 * each['ok']:.0f} % "
        f"| {each['worst_ok']:.1f} u | {' to '.join(f'{off:.1f}' for off in each['worst'])} u | {each['nees']:.2f} "
        f"| {' to '.join(f'{ratio:.2f}' for ratio in each['wider'])} | {verdicts} | {words} |"
    )


def main() -> None:
    """Run the campaign, and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument("--states", default="", help="of [model], as in the study; its default if absent")
    parser.add_argument("--only", default="", help="part of fault and size")
    parser.add_argument("--out", type=Path)
    add_options(parser)
    given = parser.parse_args()
    asked = [
        (fault, k)
        for fault, sizes in ALL.items()
        for k, (words, _) in enumerate(sizes)
        if given.only in f"{fault} {words}"
    ]
    from selfcal_faults import Summaries  # by this name, which workers know too

    about = {"selfcal_faults": asked, "states": given.states, "draws": given.draws}
    found = answers(Summaries(given.states, given.draws, tuple(asked)), len(asked), given, about, 1)
    results = {f"{fault}|{ALL[fault][k][0]}": each for (fault, k), each in zip(asked, found, strict=True)}
    print(HEAD)
    for key, each in results.items():
        print(row(key, each))
    if given.out is not None:
        given.out.parent.mkdir(parents=True, exist_ok=True)
        given.out.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    in_words(main)
