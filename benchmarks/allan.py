"""Time the overlapping Allan deviation against AllanTools on the same samples, in one run.

    python benchmarks/allan.py [--runs 7] [--smoke]

2 million samples of one channel and 50 averaging times from one sample to half the record. Ours includes the
confidence limits by kind of noise. Both run on one thread. A ratio is that of the medians, with the ratios of single
runs, the slowest and the fastest, behind it.
"""

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import allantools
import numpy as np

from inercal.instruments.noise import NoiseModel
from inercal.noise.coefficients import noise_coefficients
from inercal.noise.deviation import allan_deviation

INTERVAL = 0.01


def seconds(work) -> float:
    """Seconds of one call."""
    clock = time.perf_counter()
    work()
    return time.perf_counter() - clock


def shown(times: list[float]) -> str:
    """Median and spread."""
    return f"{np.median(times):8.3f} s   ({min(times):.3f} to {max(times):.3f})"


def lengths(n: int, count: int) -> np.ndarray:
    """So many different averaging times in samples, evenly spread in their logarithms from 1 to n/2 - 1."""
    asked = count
    while len(found := np.unique(np.geomspace(1, n // 2 - 1, asked).astype(int))) < count:
        asked += 1
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument(
        "--smoke", action="store_true", help="few samples, one run; no timing is to be judged"
    )
    options = parser.parse_args()
    n, count, runs = (20_000, 20, 1) if options.smoke else (2_000_000, 50, options.runs)

    rng = np.random.default_rng(1)
    x = 9.81 + NoiseModel(N=1e-3, B=1e-4, K=1e-5).simulate(n, INTERVAL, rng)[:, 0]
    tau = INTERVAL * lengths(n, count)
    noise_coefficients(allan_deviation(x[:200], INTERVAL))  # compiles or loads

    def ours():
        return allan_deviation(x, INTERVAL, tau)

    def theirs():
        return allantools.oadev(x, rate=1.0 / INTERVAL, data_type="freq", taus=tau)

    found, expected = ours(), theirs()
    away = np.max(np.abs(found.deviation[:, 0] / expected[1] - 1.0))
    assert len(found.tau) == len(expected[0]) == count
    assert away < 1e-6, away
    pairs = [(seconds(ours), seconds(theirs)) for _ in range(runs)]
    mine, peer = ([pair[k] for pair in pairs] for k in range(2))
    ratios = [their / our for our, their in pairs]
    print(f"{n} samples, {count} averaging times; largest relative difference {away:.1e}")
    print(f"{'inercal, with limits':28s} {shown(mine)}")
    print(
        f"{'AllanTools oadev':28s} {shown(peer)}   ratio {np.median(peer) / np.median(mine):.1f} "
        f"({min(ratios):.1f} to {max(ratios):.1f})"
    )
    with_gaps = np.where(rng.random(n) < 1e-4, np.nan, x)
    gaps = [seconds(lambda: allan_deviation(with_gaps, INTERVAL, tau)) for _ in range(runs)]
    print(f"{'inercal, 1 in 10^4 lost':28s} {shown(gaps)}")
    fit = [seconds(lambda: noise_coefficients(found)) for _ in range(2)]
    print(f"{'coefficients, first time':28s} {fit[0]:8.3f} s, again {fit[1]:.3f} s")


if __name__ == "__main__":
    main()
