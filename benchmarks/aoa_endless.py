"""Does the fusion ever lose its numbers? Its filter of 19 states over very many rows with spikes and lost rows.

    python benchmarks/aoa_endless.py --rows 10000000

Blocks of a million rows go through one filter; each is simulated anew, so that time goes on.
"""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import numpy as np
from sting_study import BASE, DEG, study

from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.fusion import run as fusion
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.simulate import simulate


def endless(rows: int, block: float = 1000.0) -> None:
    """Feed so many rows, in blocks of so many seconds, and say after each what is missing."""
    plan = replace(BASE, duration=block)
    settings = study(19, motion=plan, disturbances=Disturbances(spikes=1e-3, dropouts=1e-3))
    of, rng = problem(settings), np.random.default_rng(1)
    errors = {name: value for name, value in simulate(settings, rng).errors.items() if name[:2] == "b_"}
    state, done, missing, worst, starts = fusion.initial(of), 0, 0, 0.0, 0
    while done < rows:
        recording = simulate(settings, rng, errors).recording
        some = min(rows - done, len(recording.t))
        t = recording.t[:some] + 1e-3 * done
        state, trace = fusion.advance(state, of, t, recording.rows[:some], last=True)
        missing += int(np.isnan(trace.out[:, :5]).any(axis=1).sum())
        away = np.abs(trace.out[:, 0] - recording.reference[:some])[5000:]
        worst = max(worst, float(away.max(initial=0.0)))
        starts, done = starts + len(trace.starts), done + some
        scale = np.sqrt(np.diag(state.P))
        least = np.linalg.eigvalsh(state.P / np.outer(scale, scale)).min()
        print(
            f"{done} rows: {missing} without an angle, largest error {worst / DEG:.3g} deg, {starts} starts, "
            f"least eigenvalue of the correlations {least:.1e}",
            flush=True,
        )


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rows", type=int, default=10_000_000)
    options = parser.parse_args(arguments)
    endless(options.rows, min(1000.0, 1e-3 * options.rows))


if __name__ == "__main__":
    main()
