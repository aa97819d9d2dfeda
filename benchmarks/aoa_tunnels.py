"""The causal fusion in what tunnels do, by an independent simulator: before and after what the recording decides.

    python benchmarks/aoa_tunnels.py --seeds 20 --first 1001 --rate 500

15 deg + 10 deg at 1 Hz, polars and rest, 30 s, all constants drawn from the prior; rms error [deg], rms of error over
u, coverage of 95 % after 2 s. *Before*: a gyro taken for prompt, the usual snap, no band.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from independent.aoa import AXES, CASES, DEG, DELAYS, G, R, Tunnel, simulate

from inercal.aoa.diagnosis.choice import decided
from inercal.aoa.fusion.filter_result import estimate
from inercal.aoa.fusion.problem import problem
from inercal.aoa.layout import Layout
from inercal.aoa.reading.recording import plain
from inercal.aoa.settings import AoaSettings, Noise, Timing
from inercal.geometry.site import Site

STUDY = AoaSettings(
    Site(G),
    Layout(("a1", "a2", "a3"), np.arctan2(-AXES[:, 1], AXES[:, 0]), R, np.zeros(3)),
    Noise(1e-4 * G, 1e-4 * G, 0.2 * DEG, 5.0 * DEG / 3600.0),
)


def rows(
    seeds: range, rate: float
) -> Iterator[tuple[str, tuple[float, float, float], tuple[float, float, float]]]:
    """Each case at a rate [Hz] with its figures before and after."""
    kinds = {name: ("sine",) if name in DELAYS else ("sine", "polar", "rest") for name in CASES}
    for name, kind in ((name, kind) for name, each in kinds.items() for kind in each):
        both = np.zeros((2, 3))
        for seed in seeds:
            run = simulate(Tunnel(kind, duration=30.0, fs=rate, **CASES[name]), seed)
            recording, late = plain(run.t, run.acc, run.gyro), run.t > 2.0
            prompt = replace(STUDY, timing=Timing(0.0))
            for k, settings in enumerate((prompt, decided(recording, STUDY))):
                filtered = estimate(recording, problem(settings))
                error, u = (filtered.theta - run.theta)[late], filtered.u[late]
                answered = np.isfinite(error)
                error, u = error[answered], u[answered]
                figures = (
                    np.square(error / DEG).mean(),
                    np.square(error / u).mean(),
                    (abs(error) < 1.96 * u).mean(),
                )
                both[k] += np.array(figures) / len(seeds)
        both[:, :2] = np.sqrt(both[:, :2])
        yield f"{name}, {kind}", tuple(both[0].tolist()), tuple(both[1].tolist())


def main() -> None:
    """Print the table of the book."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--rate", type=float, default=500.0, help="rows a second [Hz]")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    print("| case | before | after |\n|---|---|---|")
    for name, *both in rows(seeds, options.rate):
        cells = (f"{error:.2g} / {ratio:.2g} / {100.0 * covered:.0f} %" for error, ratio, covered in both)
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
