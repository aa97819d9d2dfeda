"""Time the exact analysis of the two-axis table against SALib and a NumPy Monte Carlo, in one run.

    python benchmarks/sensitivity.py [--runs 20] [--smoke]

Eleven errors of ±2 arcmin, five outputs, first and total order. The peers are run at a few positions, with the
number of rows below, and their time is scaled up to all positions; both are given the same sample at each position,
which saves them the drawing.
"""

import argparse
import os
import time
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from inercal.rigs.chain import Chain, Error, Joint
from inercal.rigs.distribution import uniform
from inercal.rigs.outputs import table_outputs
from inercal.rigs.plans import grid
from inercal.rigs.tables import turntable
from inercal.sensitivity.exact import analyse

ROWS = 1024
SIZE = np.radians(2.0 / 60.0)
CHAIN = turntable("two_axis_turntable", uniform(SIZE))
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, np.radians(40.0))


def best(work, runs: int) -> float:
    """Seconds of the fastest of several runs: the machine may have other things to do."""
    seconds = []
    for _ in range(runs):
        clock = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - clock)
    return min(seconds)


def salib(angles: np.ndarray) -> tuple[float, np.ndarray]:
    """Seconds of SALib as its guide shows it, and S (outputs, positions, errors); all outputs share the model runs."""
    from SALib.analyze import sobol as estimate
    from SALib.sample import sobol as sample

    problem = {"num_vars": 11, "names": list(CHAIN.factors), "bounds": [[-SIZE, SIZE]] * 11}
    rows = sample.sample(problem, ROWS, calc_second_order=False, seed=1)
    clock, first = time.perf_counter(), np.empty((len(OUTPUTS), len(angles), 11))
    for n, at in enumerate(angles):
        attitude = CHAIN.attitude(at, rows)
        for o, output in enumerate(OUTPUTS):
            values = output.value(attitude)
            values = (values - values.mean()) / values.std()
            first[o, n] = estimate.analyze(problem, values, calc_second_order=False, seed=1)["S1"]
    return time.perf_counter() - clock, first


def carried(row: np.ndarray, cosines: np.ndarray, sines: np.ndarray, at: np.ndarray) -> list:
    """Components of a reference after the whole chain, each (rows of errors)."""
    x, k, j = list(row), 0, 0
    for element in CHAIN.elements:
        if isinstance(element, Joint):
            c, s = np.cos(at[j]), np.sin(at[j])
            j += 1
        else:
            c, s = cosines[k], sines[k]
            k += 1
        b = ("xyz".index(element.axis) + 1) % 3
        d = (b + 1) % 3
        x[b], x[d] = c * x[b] + s * x[d], c * x[d] - s * x[b]
    return x


def plain_numpy(angles: np.ndarray) -> tuple[float, np.ndarray]:
    """Seconds of pick and freeze in vectorised NumPy (Saltelli 2010 and Jansen 1999), and S.

    Cosines and sines are taken once for all positions, and rows are turned in place of matrices multiplied.
    """
    from scipy.stats import qmc

    k = len(CHAIN.factors)
    ab = SIZE * (2.0 * qmc.Sobol(2 * k, rng=np.random.default_rng(1)).random(ROWS) - 1.0)
    A, B = ab[:, :k], ab[:, k:]
    rows = np.concatenate([A, B, *(np.where(np.arange(k) == i, B, A) for i in range(k))])
    cosines, sines = np.cos(rows).T.copy(), np.sin(rows).T.copy()
    clock, first = time.perf_counter(), np.empty((len(OUTPUTS), len(angles), k))
    distinct = np.unique(np.array([output.reference for output in OUTPUTS]), axis=0)
    for n, at in enumerate(angles):
        read = [carried(row, cosines, sines, at) for row in distinct]
        for o, output in enumerate(OUTPUTS):
            which = int(np.flatnonzero((distinct == output.reference).all(axis=1))[0])
            y = read[which][int(np.argmax(output.axis))].reshape(k + 2, ROWS)
            y = y - y[:2].mean()
            variance = y[:2].var()
            first[o, n] = (y[1] * (y[2:] - y[0])).mean(axis=1) / variance
            total = 0.5 * np.square(y[0] - y[2:]).mean(axis=1) / variance
            assert np.all(np.isfinite(total))
    return time.perf_counter() - clock, first


def longer(times: int) -> Chain:
    """The table with each of its errors there several times."""
    elements = []
    for element in CHAIN.elements:
        copies = times if isinstance(element, Error) else 1
        elements += [replace(element, name=f"{element.name}{n}") for n in range(copies)]
    return Chain(tuple(elements))


def against(name: str, peer, angles: np.ndarray, few: int, ours: float) -> None:
    """One peer: time scaled to all positions, ratio, and how far its first-order indices are from the exact ones."""
    some = angles[np.random.default_rng(0).choice(len(angles), few, replace=False)]
    seconds, first = peer(some)
    error = np.abs(first - analyse(CHAIN, OUTPUTS, some).first)
    scaled = seconds * len(angles) / few
    print(
        f"{name:34s} {scaled:10.2f} s   ratio {scaled / ours:9.0f}   "
        f"error of S: median {np.median(error):.1e}, largest {error.max():.1e}   ({few} positions, scaled)"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument(
        "--smoke", action="store_true", help="few positions, one run; no timing is to be judged"
    )
    options = parser.parse_args()
    side, runs = (6, 1) if options.smoke else (36, options.runs)

    analyse(CHAIN, OUTPUTS, np.zeros((2, 2)), second=True)  # compiles or loads
    angles = grid((side, side)).angles
    ours = best(lambda: analyse(CHAIN, OUTPUTS, angles), runs)
    print(f"{len(angles)} positions, {len(OUTPUTS)} outputs, {len(CHAIN.factors)} errors; S and ST")
    print(f"{'inercal, exact':34s} {ours:10.5f} s")
    one = best(lambda: analyse(CHAIN, OUTPUTS, angles, threads=1), runs)
    print(f"{'  on one thread':34s} {one:10.5f} s")
    more = best(lambda: analyse(CHAIN, OUTPUTS, angles, shapley=True, second=True), min(runs, 5))
    print(f"{'  with Shapley and second order':34s} {more:10.5f} s")
    against(f"SALib, N = {ROWS}", salib, angles, 1 if options.smoke else 6, ours)
    against(f"NumPy pick and freeze, N = {ROWS}", plain_numpy, angles, 2 if options.smoke else 60, ours)
    for times in (1, 2) if options.smoke else (2, 4, 10):
        more_angles = grid((times * side, times * side)).angles
        seconds = best(lambda at=more_angles: analyse(CHAIN, OUTPUTS, at), 2)
        per = 1e6 * seconds / len(more_angles)
        print(f"{times * side} x {times * side} positions: {seconds:8.4f} s, {per:.2f} us a position")
    for times in (1, 2, 4):
        chain = longer(times)
        seconds = best(lambda chain=chain: analyse(chain, OUTPUTS, angles, threads=1), min(runs, 5))
        per = 1e9 * seconds / len(angles) / len(chain.factors)
        print(f"{len(chain.factors)} errors, one thread: {seconds:8.4f} s, {per:.0f} ns a position and error")


if __name__ == "__main__":
    main()
