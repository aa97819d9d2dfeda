"""The exact analysis of the two-axis table beside SALib and a NumPy Monte Carlo.

    python benchmarks/sensitivity.py [--quick]

Eleven errors of ±2 arcmin, five outputs, first and total order at 36 x 36 positions. The peers are run at a few
positions and their time is scaled up. Both share one sample for all positions, whose cosines and sines are taken once
and not timed, one vectorised model that turns rows in place of multiplying matrices, and its values for outputs of one
reference. SALib is timed as its guide shows it, and with the fewest bootstrap resamples that it takes.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import PROCESSOR, WALL, Row, alone, in_turn, named, row, spread
from SALib.analyze import sobol as salib_indices
from SALib.sample import sobol as salib_sample
from scipy.stats import qmc

from inercal.foundation.rigs.chain import Chain, Joint
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities.exact import analyse

ROWS = 1024
SIZE = np.radians(2.0 / 60.0)
CHAIN = turntable("two_axis_turntable", uniform(SIZE))
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, np.radians(40.0))


class Sample:
    """Rows of the errors of a chain, (n, errors) [rad], as both peers are given them."""

    def __init__(self, chain: Chain, rows: np.ndarray):
        self.chain, self.cosines, self.sines = chain, np.cos(rows).T.copy(), np.sin(rows).T.copy()

    def carried(self, reference: np.ndarray, at: np.ndarray) -> list:
        """Components of a reference after the whole chain at one position, each (n,)."""
        x, k, j = list(reference), 0, 0
        for element in self.chain.elements:
            if isinstance(element, Joint):
                c, s = np.cos(at[j]), np.sin(at[j])
                j += 1
            else:
                c, s = self.cosines[k], self.sines[k]
                k += 1
            b = ("xyz".index(element.axis) + 1) % 3
            d = (b + 1) % 3
            x[b], x[d] = c * x[b] + s * x[d], c * x[d] - s * x[b]
        return x

    def outputs(self, at: np.ndarray) -> list[np.ndarray]:
        """Each output (n,) at one position; outputs of one reference share it."""
        known = {}
        for output in OUTPUTS:
            key = tuple(output.reference)
            if key not in known:
                known[key] = self.carried(output.reference, at)
        return [known[tuple(output.reference)][int(np.argmax(output.axis))] for output in OUTPUTS]


def salib(angles: np.ndarray, resamples: int = 100, chain: Chain = CHAIN):
    """A work that gives S (outputs, positions, errors)."""
    k = len(chain.factors)
    problem = {"num_vars": k, "names": list(chain.factors), "bounds": [[-SIZE, SIZE]] * k}
    sample = Sample(chain, salib_sample.sample(problem, ROWS, calc_second_order=False, seed=1))

    def work() -> np.ndarray:
        first = np.empty((len(OUTPUTS), len(angles), k))
        for n, at in enumerate(angles):
            for o, values in enumerate(sample.outputs(at)):
                found = salib_indices.analyze(
                    problem, values, calc_second_order=False, num_resamples=resamples, seed=1
                )
                first[o, n] = found["S1"]
        return first

    return work


def plain_numpy(angles: np.ndarray, chain: Chain = CHAIN):
    """The same by pick and freeze in vectorised NumPy (Saltelli 2010 and Jansen 1999), without a bootstrap."""
    k = len(chain.factors)
    ab = SIZE * (2.0 * qmc.Sobol(2 * k, rng=np.random.default_rng(1)).random(ROWS) - 1.0)
    A, B = ab[:, :k], ab[:, k:]
    sample = Sample(chain, np.concatenate([A, B, *(np.where(np.arange(k) == i, B, A) for i in range(k))]))

    def work() -> np.ndarray:
        first = np.empty((len(OUTPUTS), len(angles), k))
        for n, at in enumerate(angles):
            for o, y in enumerate(sample.outputs(at)):
                y = y.reshape(k + 2, ROWS)
                y = y - y[:2].mean()
                variance = y[:2].var()
                first[o, n] = (y[1] * (y[2:] - y[0])).mean(axis=1) / variance
                total = 0.5 * np.square(y[0] - y[2:]).mean(axis=1) / variance
                assert np.all(np.isfinite(total))
        return first

    return work


def rows(quick: bool) -> list[Row]:
    side, rounds = (6, 1) if quick else (36, 5)
    angles = grid((side, side)).angles
    rng = np.random.default_rng(0)
    one, few = (angles[rng.choice(len(angles), n, replace=False)] for n in ((1, 2) if quick else (2, 40)))
    peers = {
        f"{named('SALib')}, N = {ROWS}": (salib(one), one),
        f"{named('SALib')}, 2 resamples": (salib(one, 2), one),
        f"{named('numpy')} pick and freeze, N = {ROWS}": (plain_numpy(few), few),
    }
    works = {"ours": lambda: analyse(CHAIN, OUTPUTS, angles, threads=1)}
    works |= {name: work for name, (work, _) in peers.items()}
    seconds = in_turn(works, rounds, PROCESSOR, 0.0 if quick else 0.05)
    what, size, unit = "Exact sensitivity", f"{len(angles)} positions, 5 outputs, 11 errors", ("ms", 1e3)
    found = []
    for name, (_, some) in peers.items():
        scaled = [s * len(angles) / len(some) for s in seconds[name]]
        found.append(row(f"{what}, one thread", size, unit, seconds["ours"], name, scaled))
    walls = in_turn(
        {
            "": lambda: analyse(CHAIN, OUTPUTS, angles),
            ", with Shapley and second order": lambda: analyse(
                CHAIN, OUTPUTS, angles, shapley=True, second=True
            ),
        },
        rounds,
        WALL,
    )
    found += [row(f"{what}, all threads{more}", size, unit, each) for more, each in walls.items()]
    for name, (work, some) in list(peers.items())[::2]:
        errors = np.abs(work() - analyse(CHAIN, OUTPUTS, some).first)
        found.append(
            Row(
                "Error of S, median and largest",
                f"{len(some)} positions",
                "1",
                spread(errors.ravel().tolist()),
                name,
            )
        )
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
