"""Errors and uncertainties of the angle of attack over many simulated runs: the table that the fusion must reach.

    python benchmarks/aoa_bands.py --seeds 50 --draws 400 --json bands.json

Largest error / rms in degrees after 5 s, of 1 kHz records of a minute (`tests/studies/sting_study.py`): median and 90th
percentile over the seeds, beside the figure. Then the mean of (error / u)^2 of 12 s records, with all that the filters
take as constant drawn from their prior. The tables are Markdown.
"""

import argparse
import json
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import numpy as np
from sting_bands import (
    FIGURES,
    FILTERS,
    LOW_PASSED,
    MEDIAN,
    MOTIONS,
    PAPER,
    UPPER,
    errors_of,
    judged,
    over_its_uncertainty,
)

METHODS = (PAPER, LOW_PASSED, *FILTERS)
LIMITS = {8: (0.8, 1.2), 19: (0.5, 1.2)}


def said(done: str) -> None:
    """What is done, on standard error."""
    print(f"\r{done:40s}", end="", file=sys.stderr, flush=True)


def two(values) -> str:
    """Largest / rms."""
    return "/".join(f"{value:.2g}" for value in values)


def bands(name: str, seeds: int) -> dict:
    """Median and 90th percentile of each method in a scenario, and whether they are within the bands."""
    each = []
    for seed in range(seeds):
        said(f"{name} {seed + 1} of {seeds}")
        each.append(errors_of(name, seed, METHODS))
    figures = dict(zip((PAPER, *FILTERS), FIGURES[name], strict=True))
    found = {}
    for method in METHODS:
        errors = np.array([of[method] for of in each])
        median, upper = np.median(errors, axis=0), np.quantile(errors, 0.9, axis=0)
        found[method] = {"median": median.tolist(), "90 %": upper.tolist()}
        if method in figures:
            found[method]["figure"] = figures[method]
        if judged(name, method):
            limit = np.array(figures[method])
            found[method]["within"] = bool(
                (median <= MEDIAN * limit).all() and (upper <= UPPER * limit).all()
            )
    return found


def consistency(draws: int) -> dict:
    """Mean of (error / u)^2 by states and kind, over ``draws`` shared by the motions."""
    found = {}
    for states in LIMITS:
        ratios = {}
        for k, motion in enumerate(MOTIONS):
            said(f"{states} states, {motion}")
            own = [over_its_uncertainty(motion, states, 4 * seed + k) for seed in range(-(-draws // 4))]
            ratios[motion] = np.array(own)
        for j, kind in enumerate(("causal", "smoothed")):
            means = {motion: float(of[:, j].mean()) for motion, of in ratios.items()}
            mean, (low, high) = float(np.mean(list(means.values()))), LIMITS[states]
            found[f"{kind} {states}"] = {"mean": mean, "within": low <= mean <= high, **means}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50, help="runs of each scenario")
    parser.add_argument("--draws", type=int, default=400, help="records of 12 s, over all motions")
    parser.add_argument("--scenario", choices=tuple(FIGURES), action="append", help="these alone")
    parser.add_argument("--json", type=Path, help="write all numbers here")
    options = parser.parse_args()

    table = {name: bands(name, options.seeds) for name in options.scenario or FIGURES}
    told = consistency(options.draws) if options.draws else {}
    said("")
    print(file=sys.stderr)
    print(f"| error [deg], median (90 %) of {options.seeds} | " + " | ".join(METHODS) + " |")
    print("|---" * (len(METHODS) + 1) + "|")
    for name, of in table.items():
        cells = []
        for method in METHODS:
            mark = "" if of[method].get("within", True) else " **out of band**"
            cells.append(f"{two(of[method]['median'])} ({two(of[method]['90 %'])}){mark}")
        print(f"| {name} | " + " | ".join(cells) + " |")
    if told:
        print(f"\n| (error / u)^2, mean of {options.draws} | all | " + " | ".join(MOTIONS) + " |")
        print("|---" * (len(MOTIONS) + 2) + "|")
        for name, of in told.items():
            mark = "" if of["within"] else " **out of band**"
            print(
                f"| {name} | {of['mean']:.2f}{mark} | " + " | ".join(f"{of[m]:.2f}" for m in MOTIONS) + " |"
            )
    if options.json is not None:
        found = {"seeds": options.seeds, "errors": table, "draws": options.draws, "consistency": told}
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
