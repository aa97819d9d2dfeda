"""The overlapping Allan deviation beside AllanTools on the same samples, and beside Stable32's printed digits.

    python benchmarks/allan.py [--quick]

2 million samples of one channel and 50 averaging times from one sample to half the record, on one thread. Ours includes
the confidence limits by kind of noise; AllanTools is given the same averaging times and gives no such limits.
"""

import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import allantools
import numpy as np
from measure import Row, Spread, alone, in_turn, named, row

from inercal.foundation.instruments.noise import NoiseModel
from inercal.foundation.noise.coefficients import noise_coefficients
from inercal.foundation.noise.deviation import allan_deviation

INTERVAL = 0.01
STABLE32 = Path(__file__).parents[1] / "tests" / "data" / "stable32"


def lengths(n: int, count: int) -> np.ndarray:
    """So many different averaging times in samples, evenly spread in their logarithms from 1 to n/2 - 1."""
    asked = count
    while len(found := np.unique(np.geomspace(1, n // 2 - 1, asked).astype(int))) < count:
        asked += 1
    return found


def noise(n: int) -> np.ndarray:
    """Samples of one accelerometer at rest."""
    return 9.81 + NoiseModel(N=1e-3, B=1e-4, K=1e-5).simulate(n, INTERVAL, np.random.default_rng(1))[:, 0]


def theirs(x: np.ndarray, tau: np.ndarray) -> tuple:
    """Averaging times, deviations, errors and counts of AllanTools."""
    return allantools.oadev(x, rate=1.0 / INTERVAL, data_type="freq", taus=tau)


def printed_digits() -> Row:
    """How far deviations of Stable32's PHASE.DAT are from what it prints, in units of the fifth and last digit."""
    tau, sigma = np.loadtxt(STABLE32 / "phase_dat_oadev_octave.txt").T[[1, 5]]
    found = allan_deviation(np.diff(np.loadtxt(STABLE32 / "PHASE.DAT")), 1.0, tau).deviation[:, 0]
    away = float(np.max(np.abs(found - sigma) / (1e-4 * 10.0 ** np.floor(np.log10(sigma)))))
    unit = "units of the last digit"
    return Row(
        "Allan deviation beside Stable32",
        "PHASE.DAT, 1001 points",
        unit,
        Spread(away, away, away),
        at_most=0.501,
    )


def rows(quick: bool) -> list[Row]:
    n, count, rounds = (20_000, 20, 1) if quick else (2_000_000, 50, 7)
    x, tau = noise(n), INTERVAL * lengths(n, count)
    gaps = np.where(np.random.default_rng(2).random(n) < 1e-4, np.nan, x)
    found, expected = allan_deviation(x, INTERVAL, tau), theirs(x, tau)
    assert len(found.tau) == len(expected[0]) == count
    away = float(np.max(np.abs(found.deviation[:, 0] / expected[1] - 1.0)))
    seconds = in_turn(
        {
            "ours": lambda: allan_deviation(x, INTERVAL, tau),
            "theirs": lambda: theirs(x, tau),
            "gaps": lambda: allan_deviation(gaps, INTERVAL, tau),
            "coefficients": lambda: noise_coefficients(found),
        },
        rounds,
    )
    size, peer, unit = f"{n} samples, {count} averaging times", named("AllanTools"), ("s", 1.0)
    what = "Allan deviation with limits"
    return [
        row(what, size, unit, seconds["ours"], peer, seconds["theirs"], at_most=1.0),
        row(f"{what}, 1 in 10⁴ lost", size, unit, seconds["gaps"]),
        row("Noise coefficients of it", f"{count} averaging times", ("ms", 1e3), seconds["coefficients"]),
        Row("Allan deviation, relative difference", size, "1", Spread(away, away, away), peer, at_most=1e-6),
        printed_digits(),
    ]


if __name__ == "__main__":
    alone(rows, __doc__)
