"""Errors of `calibrate strapdown` against its stated uncertainties at three grades.

    python benchmarks/strapdown_coverage.py --runs 100 --checkpoint build/coverage-strapdown

Truth is drawn from the prior, runs are those of the program's own simulator, 19 positions at 100 Hz. Of the fit: NEES
of 31 coefficients, coverage of 95 % intervals, scatter over bounds (geometric mean, least and largest coefficient),
chi-square over its degrees of freedom. Of the stated u, with drifts by force that are not fitted: the same coverage,
and by how much u is larger (geometric mean, worst coefficient). Where biases do not walk the largest difference of
filter and batch [u]; where they do, also with all noise but the white left to the recording: all figures of that are of
the stated u, which has what the sizes of noise leave open. The results are kept in docs/theory/strapdown.md, by hand.
"""

import argparse
import os
from collections import Counter

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.places import add_options, answers, in_words
from campaigns.strapdown import GRADES, Calibration, studies


def row(runs: list[dict]) -> str:
    """Figures of runs of a study."""
    z, z_stated, growth = (np.array([run[name] for run in runs]) for name in ("z", "z_stated", "growth"))
    nees, squares = ([run[name] for run in runs] for name in ("nees", "square"))
    differ = [each for run in runs for each in run["apart"]]
    verdicts = Counter(run["verdict"] for run in runs)
    scatter = np.sqrt(np.mean(z**2, axis=0))
    cells = [
        f"{np.mean(nees):.1f}",
        f"{100.0 * np.mean(abs(z) < 1.96):.1f} %",
        f"{np.exp(np.mean(np.log(scatter))):.3f} ({scatter.min():.2f} to {scatter.max():.2f})",
        f"{np.mean(squares):.3f}",
        f"{100.0 * np.mean(abs(z_stated) < 1.96):.1f} %",
        f"{np.exp(np.mean(np.log(growth))):.3f}, {growth.mean(axis=0).max():.2f}",
        f"{max(differ):.4f}" if differ else "–",
        ", ".join(f"{word} {count}" for word, count in sorted(verdicts.items())),
    ]
    return " | ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=2101)
    parser.add_argument("--grade", choices=tuple(GRADES), action="append", help="these alone")
    add_options(parser)
    options = parser.parse_args()
    print(
        "| grade, noise | NEES | 95 % | scatter over bounds | chi-square | stated u | larger | filter | verdicts |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for grade in options.grade or GRADES:
        for study in studies(GRADES[grade]):
            about = {"strapdown": grade, "study": study, "seed": options.seed}
            own = argparse.Namespace(**vars(options))
            own.checkpoint = options.checkpoint and options.checkpoint / f"{grade}-{study}"
            runs = answers(Calibration(grade, study, options.seed), options.runs, own, about)
            print(f"| {grade}, {study} | {row(runs)} |", flush=True)


if __name__ == "__main__":
    in_words(main)
