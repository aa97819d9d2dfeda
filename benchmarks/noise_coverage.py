"""Are the stated uncertainties of noise coefficients true? Campaigns of simulated recordings.

    python benchmarks/noise_coverage.py --runs 2000 --checkpoint build/coverage-noise

Its result is kept in docs/uncertainty/noise.md.
"""

import argparse
import os
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.noise import MIXES, one_recording
from campaigns.places import add_options, in_words, place_of, progress
from scipy import stats

from inercal.foundation.computing.runs import run
from inercal.foundation.instruments.noise import SYMBOLS
from inercal.foundation.results.result import coverage_factor

SEED, LEVEL = 20261121, 0.95

CAMPAIGNS = (
    ("mems", 0.0),
    ("counting", 0.0),
    ("mems", 0.01),
    ("weak", 0.0),
    ("steps", 0.005),
    ("steps", 0.02),
)
"""Mix of noise, and share of the samples that is lost."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=SEED)
    add_options(parser)
    options = parser.parse_args()
    runs = options.runs

    low, high = (100 * float(stats.binom.ppf(q, runs, LEVEL)) / runs for q in (0.0005, 0.9995))
    print(f"{100 * LEVEL:.4g} % intervals in {runs} runs; expected {low:.2f} to {high:.2f} % of each")
    print(f"{'':24s}   seen %  covered %  of those seen %  rms(error/u)")
    for mix, lost in CAMPAIGNS:
        sample = run(
            partial(one_recording, mix, lost),
            runs=runs,
            seed=options.seed,
            executor=place_of(options),
            folder=options.checkpoint and options.checkpoint / f"{mix}-{lost:g}",
            progress=progress,
        )
        name = f"{mix}, {100 * lost:.2g} % lost" if lost else mix
        for k, symbol in enumerate(SYMBOLS):
            print(f"{name + ' ' + symbol:24s}", figures(sample, k, getattr(MIXES[mix], symbol)))
        print(f"{name:24s}   without a finding: {100 * np.mean(sample['sound']):.2f} %")


def figures(sample: dict[str, np.ndarray], k: int, truth: float) -> str:
    """One row: how often a coefficient was seen, and how often its interval or limit held the truth."""
    error, u, dof, limit = (sample[name][:, k] for name in ("error", "u", "dof", "limit"))
    seen = np.isfinite(error)
    row = f"{100 * np.mean(seen):8.2f}"
    if truth == 0.0 or not seen.any():
        return row
    held = np.array(
        [
            abs(e) <= coverage_factor(nu, LEVEL) * s
            for e, s, nu in zip(error[seen], u[seen], dof[seen], strict=True)
        ]
    )
    covered = (held.sum() + np.sum(limit[~seen] >= truth)) / len(error)
    rms = np.sqrt(np.mean((error[seen] / u[seen]) ** 2))
    return f"{row}  {100 * covered:9.2f}  {100 * held.mean():15.2f}  {rms:12.3f}"


if __name__ == "__main__":
    in_words(main)
