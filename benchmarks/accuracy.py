"""Errors beside what is the least possible, and beside the published methods: the long campaigns, shortened.

    python benchmarks/accuracy.py [--quick]

Self-calibration beside the Cramér-Rao bound, with the time of a simulated run; angles of attack beside the method of
the paper. The campaigns themselves (`*_coverage.py`, `selfcal_robustness.py`, `aoa_bands.py`) are run alone.
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

from measure import Row, alone, in_turn, row, spread
from sting_bands import FIGURES, FILTERS, PAPER, UPPER, errors_of, judged

from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.computing.executors import Threads
from inercal.systems.selfcal.monte_carlo import campaign

SEED = 20261121


def self_calibration(runs: int, rounds: int) -> list[Row]:
    """Errors over the bound, coverage, and the time of a run with its simulation."""
    settings, found = load_selfcal_study(FOLDER / "selfcal.toml"), []

    def work() -> None:
        found.append(campaign(settings, runs, SEED, "error-state", executor=Threads(os.cpu_count() or 1)))

    seconds = [s / runs for s in in_turn({"campaign": work}, rounds)["campaign"]]
    made, size = found[-1], f"{runs} runs, 18 coefficients"
    return [
        row("Self-calibration, simulated and estimated", size, ("ms a run", 1e3), seconds, at_most=20.0),
        Row(
            "Self-calibration, rms error over its bound",
            size,
            "1",
            spread(made.rms_over_bound.tolist()),
            at_most=1.1,
        ),
        Row(
            "Self-calibration, mean (error/u)², 1 expected",
            size,
            "1",
            spread([made.nees.mean / made.nees.expected]),
            at_most=made.nees.limits[1] / made.nees.expected,
        ),
    ]


def angle_of_attack(seeds: int, scenarios: tuple[str, ...]) -> list[Row]:
    """Rms errors [deg] after 5 s of simulated minutes, beside the paper's method on the same."""
    found = []
    for name in scenarios:
        methods = (PAPER, *FILTERS[2:])
        each = [errors_of(name, seed, methods) for seed in range(seeds)]
        peer = spread([of[PAPER][1] for of in each])
        for method in methods[1:]:
            figure = dict(zip((PAPER, *FILTERS), FIGURES[name], strict=True))[method][1]
            ours, ratio = [of[method][1] for of in each], [of[PAPER][1] / of[method][1] for of in each]
            # of few records each is judged as the worst tenth of many is
            promised = {"at_most": UPPER * figure} if judged(name, method) else {}
            found.append(
                Row(
                    f"Angle of attack, {method} states, rms error",
                    f"{name}, {seeds} records of a minute",
                    "°",
                    spread(ours),
                    PAPER,
                    peer,
                    spread(ratio),
                    **promised,
                )
            )
    return found


def rows(quick: bool) -> list[Row]:
    if quick:
        return self_calibration(4, 1)
    return self_calibration(1000, 2) + angle_of_attack(
        3, ("base", "pitch-pause", "flexure", "pivot", "clipping")
    )


if __name__ == "__main__":
    alone(rows, __doc__)
