"""The fusion of the angle of attack beside the same in plain NumPy and with filterpy.

    python benchmarks/aoa_fusion.py [--quick]

Three accelerometers and a gyro at 1 kHz (`tests/studies/sting_study.py`), with 8 and 19 states: the causal filter, the
filter and the smoother, one row at a time (`Live`), and on the first rows `plain_fusion`, whose filters are checked to
give the same angles. Times are of one processor.
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import numpy as np
import plain_fusion
from measure import WALL, Row, alone, in_turn, named, peak, row, spread
from sting_study import BASE, G, study

from inercal.systems.aoa.fusion import model, smoother
from inercal.systems.aoa.fusion import run as fusion
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.live import Live
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.settings import Timing
from inercal.systems.aoa.simulate import simulate

#: states -> microseconds a row that are promised of the filter, and of filter and smoother
PROMISED = {8: (1.0 / 1.2, 4.0 / 0.6), 19: (2.0, 10.0 / 0.6)}


def plain(of, settings, recording):
    """The model of `plain_fusion` for a problem, and where our filter starts."""
    dt, d = 1e-3, len(of.places.moving)
    F, Q = np.empty((d, d)), np.empty((d, d))
    model.transition(dt, of.model, F, Q)
    _, trace = fusion.advance(fusion.initial(of), of, recording.t[:20], recording.rows[:20], last=True)
    return plain_fusion.Model(of, G, settings.noise, dt, F, Q), trace.starts[0].x, trace.starts[0].P


def live(of, recording, rows: int) -> list[float]:
    """Seconds on the wall of each of some rows fed by themselves, after the start."""
    going, each, rows_of = Live(of), [], recording.rows
    for k in range(rows):
        t, readings = float(recording.t[k]), rows_of[k]
        clock = WALL()
        going.feed(t, readings)
        each.append(WALL() - clock)
    return each[LIMITS.starting_rows :]


def advanced(of, recording, block=0):
    """The causal filter over a recording; with heads of blocks as the smoother takes them."""
    return fusion.advance(fusion.initial(of), of, recording.t, recording.rows, last=True, block=block)


def of_states(states: int, recording, few: int, rounds: int) -> list[Row]:
    """All rows with so many states; the peers on the first ``few`` samples."""
    settings = study(states, timing=Timing(0.0))
    of, n = problem(settings), len(recording.t)
    told, x, P = plain(of, settings, recording)
    _, trace = advanced(of, recording, smoother.BLOCK)
    peers = {
        f"{named('numpy')}, a loop": lambda: plain_fusion.run_numpy(told, x, P, recording.rows[:few, :4]),
        named("filterpy"): lambda: plain_fusion.run_filterpy(told, x, P, recording.rows[:few, :4]),
    }
    for name, run in peers.items():
        gap = np.max(np.abs(run()[:, 0] - trace.out[:few, 0]) / trace.out[:few, 1])
        assert gap < 1e-4, f"{name} differs by {gap:.1e} standard deviations"
    filtered = {
        "causal": lambda: advanced(of, recording),
        "before": lambda: advanced(of, recording, smoother.BLOCK),
        "back": lambda: smoother.smooth(of, recording.t, recording.rows, trace),
    }
    seconds = in_turn(filtered | peers, rounds)
    size, unit, promised = f"{n} rows, {states} states", ("µs a row", 1e6), PROMISED[states]
    causal = [s / n for s in seconds["causal"]]
    both = [(a + b) / n for a, b in zip(seconds["before"], seconds["back"], strict=True)]
    found = [row("Angle of attack, filter", size, unit, causal, at_most=promised[0])]
    found += [
        row("Angle of attack, filter", size, unit, causal, name, [s / few for s in seconds[name]])
        for name in peers
    ]
    found.append(row("Angle of attack, filter and smoother", size, unit, both, at_most=promised[1]))
    found.append(Row("Angle of attack, live row", size, "µs", live_row(of, recording), at_most=8.0))
    return found


def live_row(of, recording):
    """Median over rows, of the medians of five pieces."""
    each = live(of, recording, min(5000, len(recording.t)))
    return spread([1e6 * float(np.median(piece)) for piece in np.array_split(each, 5)])


def rows(quick: bool) -> list[Row]:
    n, few, rounds = (1000, 50, 1) if quick else (600_000, 2000, 3)
    made = study(motion=replace(BASE, duration=1e-3 * n))
    recording = simulate(made, np.random.default_rng(1)).recording
    found = [each for states in (8, 19) for each in of_states(states, recording, few, rounds)]
    estimate(recording, problem(study(19)), smoothed=True)
    size = f"{n} rows, 19 states"
    return [
        *found,
        Row("Angle of attack, memory of the process", size, "MiB", spread([peak()]), at_most=1024.0),
        *long_record(2000 if quick else 10_000_000),
    ]


def long_record(n: int) -> list[Row]:
    """A record in memory, from its columns to the verdict, in a process of its own: seconds, and memory in all."""
    done = subprocess.run(
        [sys.executable, "-c", LONG, str(n)], env=dict(os.environ, PYTHONPATH=os.pathsep.join(sys.path)),
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    seconds, memory = map(float, done.stdout.split())
    size = f"{n} rows, 19 states"
    return [
        row("Angle of attack, whole record", size, ("s", 1.0), [seconds], at_most=35.0),
        Row("Angle of attack, whole record, memory", size, "GiB", spread([memory]), at_most=2.0),
    ]


LONG = """
import dataclasses, sys
import numpy as np
from measure import PROCESSOR, peak
from sting_study import BASE, study
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import load_kernels, measure
n = int(sys.argv[1])
settings = study(motion=dataclasses.replace(BASE, duration=1e-3 * min(n, 100_000)))
record = to_record(simulate(settings, np.random.default_rng(1)).recording, settings)
times = -(-n // len(record["a1"].t))
t = np.arange(times * len(record["a1"].t)) * 1e-3
columns = {
    name: dataclasses.replace(each, t=t, values=np.tile(each.values, times))
    for name, each in record.columns.items() if name != "theta_ref"
}
load_kernels(settings)
began = PROCESSOR()
measure(dataclasses.replace(record, columns=columns), settings)
print(PROCESSOR() - began, peak() / 1024.0)
"""


if __name__ == "__main__":
    alone(rows, __doc__)
