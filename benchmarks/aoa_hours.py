"""What the fusion knows after hours of one motion, by an independent simulator.

    python benchmarks/aoa_hours.py --rate 100 --duration 10000 --seeds 20

15 deg + 10 deg at 1 Hz, all constants drawn from the prior. Of the last minute the rms error [deg] and rms of error
over u; of all constants at the end the rms of error over u, the share beyond 2 u, and the largest. Then, of runs of
30 s with the same sensors, error and error over u with the usual prior and with what the long run has found. A seed
takes 3 s at 100 Hz, and half a minute at 1 kHz. With ``--smooth`` the long run is smoothed too, and judged in all rows.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from aoa_tunnels import STUDY
from independent.aoa import DEG, Run, Tunnel, simulate

from inercal.systems.aoa.fusion.filter_result import FusionResult, estimate
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.reading.recording import plain

NEXT = {
    "the same": {},
    "25 deg + 5 deg at 2 Hz": {"mean": 25.0 * DEG, "amplitude": 5.0 * DEG, "frequency": 2.0},
    "a polar": {"kind": "polar"},
}


def measured(tunnel: Tunnel, seed: int, number: int) -> tuple[Run, np.ndarray]:
    """A run of a tunnel with the constants of a seed, its noise that of its number; the rows after 2 s."""
    run = simulate(replace(tunnel, acc_noise=0.0, gyro_noise=0.0), seed)
    rng = np.random.default_rng([seed, number])
    acc = run.acc + tunnel.acc_noise * rng.standard_normal(run.acc.shape)
    gyro = run.gyro + tunnel.gyro_noise * rng.standard_normal(len(run.t))
    return replace(run, acc=acc, gyro=gyro), run.t > 2.0


def off(run: Run, found: FusionResult, rows: np.ndarray) -> tuple[float, float]:
    """Mean squares of error [deg] and of error over u."""
    error = (found.theta - run.theta)[rows]
    return np.square(error / DEG).mean(), np.square(error / found.u[rows]).mean()


def constants(run: Run, of: FusionProblem, found: FusionResult) -> Iterator[float]:
    """Errors of the constants at the end over their u."""
    e = run.errors
    true = {"b_g": e["b_g"], "k_g": e["k_g"], "tau_g": 0.0}
    for k in range(3):
        true |= {f"b_{k + 1}": e["b"][k], f"dr_{k + 1}": e["dr"][k], f"zo_{k + 1}": e["zo"][k]}
    for name, k in of.nuisances.items():
        yield (found.state.x[k] - true[name]) / np.sqrt(found.state.P[k, k])


def known(of: FusionProblem, found: FusionResult) -> FusionProblem:
    """The problem with what was found as its prior."""
    at, P = of.nuisances, found.state.P
    values = {name: float(found.state.x[k]) for name, k in at.items()}
    return problem(
        STUDY, posterior=(values, {(a, b): float(P[i, j]) for a, i in at.items() for b, j in at.items()})
    )


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rate", type=float, default=100.0, help="rows a second [Hz]")
    parser.add_argument("--duration", type=float, default=10_000.0, help="[s]")
    parser.add_argument("--seeds", type=int, default=20, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--smooth", action="store_true", help="the smoothed angle of the long run, too")
    options = parser.parse_args()
    of, tunnel = problem(STUDY), Tunnel(fs=options.rate, duration=options.duration)
    angles, smoothed, ratios, later = [], [], [], {name: [] for name in NEXT}
    for seed in range(options.first, options.first + options.seeds):
        run, _ = measured(tunnel, seed, 0)
        found = estimate(plain(run.t, run.acc, run.gyro), of)
        angles.append(off(run, found, run.t > run.t[-1] - 60.0))
        ratios.append(list(constants(run, of, found)))
        if options.smooth:
            smoothed.append(off(run, estimate(plain(run.t, run.acc, run.gyro), of, True), run.t > 2.0))
        for number, (name, changes) in enumerate(NEXT.items(), start=1):
            run, late = measured(replace(tunnel, duration=30.0, **changes), seed, number)
            recording = plain(run.t, run.acc, run.gyro)
            each = (off(run, estimate(recording, which), late) for which in (of, known(of, found)))
            later[name].append(list(each))
    (error, ratio), z = np.sqrt(np.mean(angles, axis=0)), np.abs(ratios)
    print(
        f"{options.duration:g} s at {options.rate:g} Hz, {options.seeds} seeds: {error:.2g} deg, {ratio:.2f} u;"
    )
    print(
        f"constants {np.sqrt(np.mean(z**2)):.2f} u, beyond 2 u {np.mean(z > 2.0):.1%}, largest {z.max():.1f} u"
    )
    if smoothed:
        error, ratio = np.sqrt(np.mean(smoothed, axis=0))
        print(f"smoothed, all rows: {error:.2g} deg, {ratio:.2f} u")
    for name, each in later.items():
        (a, b), (c, d) = np.sqrt(np.mean(each, axis=0))
        print(f"then {name}: {a:.2g} deg, {b:.2f} u; with what was found {c:.2g} deg, {d:.2f} u")


if __name__ == "__main__":
    main()
