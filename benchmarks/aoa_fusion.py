"""Time the fusion of the angle of attack beside the same in plain NumPy and with filterpy, in one run.

    python benchmarks/aoa_fusion.py [--rows 600000] [--runs 5] [--smoke]
    python benchmarks/aoa_fusion.py --endless 10000000

Three accelerometers and a gyro at 1 kHz (`tests/studies/sting_study.py`), with 8 and 19 states: the causal filter, the
filter and the smoother with the memory that they add, one row at a time (`Live`), and on the first rows `plain_fusion`,
one after the other in each run. The end says how far the filters are from each other. ``--endless`` runs the filter of
19 states over that many rows, spoiled by spikes and lost rows, and says whether a number was missing.
"""

import argparse
import os
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import numpy as np
import plain_fusion
from sting_study import BASE, DEG, G, study

from inercal.aoa import fusion, model, smoother
from inercal.aoa.filtered import estimate
from inercal.aoa.live import Live
from inercal.aoa.problem import problem
from inercal.aoa.settings import Disturbances
from inercal.aoa.simulate import simulate

OURS, SMOOTHED, LIVE = "causal filter", "filter and smoother", "one row, live"
NUMPY, FILTERPY = "plain NumPy", "filterpy"


def peak() -> float:
    """Largest memory of this process so far, MiB; NaN where the system does not tell."""
    try:
        import resource
    except ImportError:
        return float("nan")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def plain(states: int, recording, of):
    """The same model for `plain_fusion`, and where our filter starts."""
    settings, dt, d = study(states), 1e-3, int(of.places[model.MOVING])
    F, Q = np.empty((d, d)), np.empty((d, d))
    model.transition(dt, of.places, of.constants, F, Q)
    _, trace = fusion.advance(fusion.initial(of), of, recording.t[:20], recording.rows[:20], last=True)
    return plain_fusion.Model(of, G, settings.noise, dt, F, Q), trace.starts[0].x, trace.starts[0].P


def live(of, recording, rows: int) -> float:
    """Median seconds of a row fed by itself."""
    going, each = Live(of), []
    for k in range(rows):
        t, acc, gyro = float(recording.t[k]), recording.acc[k], float(recording.gyro[k])
        clock = time.perf_counter()
        going.feed(t, acc, gyro)
        each.append(time.perf_counter() - clock)
    return statistics.median(each[fusion.HELD :])


def compared(states: int, recording, few: int) -> dict[str, float]:
    """Processor seconds a row, one after the other."""
    of = problem(study(states))
    t, rows = recording.t, recording.rows
    found = {}
    clock = time.process_time()
    _, trace = fusion.advance(fusion.initial(of), of, t, rows, last=True)
    found[OURS] = (time.process_time() - clock) / len(t)
    clock = time.process_time()
    smoother.smooth(of, t, rows, trace.starts)
    found[SMOOTHED] = found[OURS] + (time.process_time() - clock) / len(t)
    found[LIVE] = live(of, recording, min(5000, len(t)))
    told, x, P = plain(states, recording, of)
    for name, run in ((NUMPY, plain_fusion.run_numpy), (FILTERPY, plain_fusion.run_filterpy)):
        clock = time.process_time()
        angles = run(told, x, P, rows[:few, :4])
        found[name] = (time.process_time() - clock) / few
        gap = np.max(np.abs(angles[:, 0] - trace.out[:few, 0]) / trace.out[:few, 1])
        assert gap < 1e-4, f"{name} differs by {gap:.1e} standard deviations"
    return found


def endless(rows: int) -> None:
    """Blocks of a million rows through one filter; each is simulated anew, so that time goes on."""
    plan = replace(BASE, duration=1000.0)
    settings = study(19, motion=plan, disturbances=Disturbances(spikes=1e-3, dropouts=1e-3))
    of, rng = problem(settings), np.random.default_rng(1)
    simulated = simulate(settings, rng)
    errors = {name: value for name, value in simulated.errors.items() if name[:2] == "b_"}
    state, done, missing, worst, starts = fusion.initial(of), 0, 0, 0.0, 0
    while done < rows:
        recording = simulate(settings, rng, errors).recording
        some = min(rows - done, len(recording.t))
        t = recording.t[:some] + 1e-3 * done
        state, trace = fusion.advance(state, of, t, recording.rows[:some], last=True)
        missing += int(np.isnan(trace.out[:, :5]).any(axis=1).sum())
        worst = max(
            worst, float(np.abs(trace.out[:, 0] - recording.reference[:some])[5000:].max(initial=0.0))
        )
        starts, done = starts + len(trace.starts), done + some
        scale = np.sqrt(np.diag(state.P))
        least = np.linalg.eigvalsh(state.P / np.outer(scale, scale)).min()
        print(
            f"{done} rows: {missing} without an angle, largest error {worst / DEG:.3g} deg, {starts} starts, "
            f"least eigenvalue of the correlations {least:.1e}",
            flush=True,
        )


def spread(values: list[float]) -> tuple[float, float, float]:
    """Median, least and largest."""
    return statistics.median(values), min(values), max(values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--rows", type=int, default=600_000)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--few", type=int, default=2000, help="rows of NumPy and filterpy")
    parser.add_argument("--endless", type=int, help="rows to look for missing numbers in, and no more")
    parser.add_argument("--smoke", action="store_true", help="one run of few rows; no timing is to be judged")
    options = parser.parse_args()
    if options.endless:
        endless(options.endless)
        return
    rows, runs, few = (1000, 1, 50) if options.smoke else (options.rows, options.runs, options.few)
    recording = simulate(
        study(motion=replace(BASE, duration=1e-3 * rows)), np.random.default_rng(1)
    ).recording
    for states in (8, 19):
        compared(states, recording, 20)  # compiles or loads
        each = [compared(states, recording, few) for _ in range(runs)]
        print(f"{states} states, {rows} rows")
        for name in each[0]:
            step, low, high = spread([1e6 * one[name] for one in each])
            print(f"  {name:20s} {step:9.2f} us a row ({low:.2f} to {high:.2f})", end="")
            if name in (OURS, SMOOTHED):
                print(f", {1e-6 * step * rows:.2f} s in all, {1.0 / step:.2f} million rows/s", end="")
            if name in (NUMPY, FILTERPY):
                ratio, low, high = spread([one[name] / one[OURS] for one in each])
                print(f", ours {ratio:.0f} times as fast ({low:.0f} to {high:.0f})", end="")
            print()
        before = peak()
        estimate(recording, problem(study(states)), smoothed=True)
        print(f"  memory of the process {peak():.0f} MiB at most, {before:.0f} before the last smoothing")


if __name__ == "__main__":
    main()
