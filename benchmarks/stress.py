"""Do absurd studies and recordings ever get a number that is none, or no end? A campaign of random runs.

    python benchmarks/stress.py selfcal --runs 100000
    python benchmarks/stress.py drift --runs 100000
    python benchmarks/stress.py aoa --runs 100000
    python benchmarks/stress.py --table selfcal.json drift.json aoa.json

Every run draws a study and a recording, most of them such as nobody would take, goes the way of the command from the
parsed study to the result, and is held against laws: a result without NaN, of a covariance that is one, with a status;
or a refusal in one sentence; no warning; an end within 30 s of computing. `--only N` makes run N again and shows it. An
interrupted campaign with --keep goes on where it stopped; `--again` makes those of its runs again that broke a law,
after a mend. Its results are kept in docs/design/stress.md.
"""

import argparse
import faulthandler
import importlib
import json
import os
import platform
import pprint
import signal
import sys
import time
import traceback
import warnings
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

SEED = 20261121

LONGEST = 30.0
"""Time of the processor [s] that a run may take, kernels loaded."""

ROOMS = ("selfcal", "drift", "aoa")

WHOLE = 10
"""Every so many runs go the whole way of the command, the others without its search for named faults."""


class TooLongError(Exception):
    """A run that did not end in time."""


def generator(room, number, seed=SEED):
    """The random stream of one run."""
    return np.random.default_rng([seed, ROOMS.index(room), number])


def load(room):
    """Load, or compile, the kernels of a room."""
    importlib.import_module(f"absurd.{room}").load()


def one(room, number, seed=SEED):
    """One run; what it raises beyond a refusal, warnings too, is a law that it broke."""
    from absurd.outcome import Run

    of = importlib.import_module(f"absurd.{room}")

    def too_long(*_):
        raise TooLongError(f"no end within {LONGEST:g} s")

    before = signal.signal(signal.SIGPROF, too_long)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        with warnings.catch_warnings(), ExitStack() as without:
            warnings.simplefilter("error")
            for search, found in of.SEARCH.items() if number % WHOLE else ():
                without.enter_context(patch(search, found))
            return of.run(generator(room, number, seed))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)
        place = next((each for each in reversed(where) if "inercal" in each.filename), where[-1])
        text = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        return Run({}, outcome="failed", wrong=[text.replace("\n", " ")[:300]])
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def campaign(room, numbers, seed=SEED, progress=lambda done, total: None):
    """Outcomes by how often they came, broken laws (run, outcome, law), and the longest time [s] of a run."""
    outcomes, wrong, longest = Counter(), [], 0.0
    for k, number in enumerate(numbers, start=1):
        began = time.process_time()
        done = one(room, number, seed)
        longest = max(longest, time.process_time() - began)
        outcomes[done.outcome] += 1
        wrong += [(number, done.outcome, each) for each in done.wrong]
        if k % 100 == 0:
            progress(k, len(numbers))
    return outcomes, wrong, longest


CHUNK = 1000


def kept(path, room, runs, seed, again=False):
    """The campaign in chunks, each kept in a file as soon as it is done: its state.

    With ``again``, runs that broke a law before are made again first, and count as they end now.
    """
    state = {
        "room": room,
        "seed": seed,
        "runs": 0,
        "outcomes": {},
        "wrong": [],
        "longest_s": 0.0,
        "cpu_s": 0.0,
    }
    if path is not None and path.exists():
        state = json.loads(path.read_text())
        if (state["room"], state["seed"]) != (room, seed):
            raise SystemExit(f"{path} is of another campaign")
    state["versions"] = versions()

    def taken(numbers, progress=lambda done, total: None):
        began = time.process_time()
        more, broken, longest = campaign(room, numbers, seed, progress)
        state["outcomes"] = dict(Counter(state["outcomes"]) + more)
        state["wrong"] += broken
        state["longest_s"] = max(state["longest_s"], longest)
        state["cpu_s"] += time.process_time() - began
        for number, _, law in broken:
            print(f"run {number}: {law}", flush=True)

    if again:
        before = {number: outcome for number, outcome, _ in state["wrong"]}
        state["outcomes"] = dict(Counter(state["outcomes"]) - Counter(before.values()))
        state["wrong"] = []
        taken(sorted(before))
        save(path, state)
    while state["runs"] < runs:
        done = state["runs"]
        numbers = range(done, min(done + CHUNK, runs))

        def progress(k, total, done=done):
            print(f"\r{done + k} of {runs}", end="", file=sys.stderr, flush=True)

        taken(numbers, progress)
        state["runs"] = numbers[-1] + 1
        save(path, state)
    return state


def save(path, state):
    """Keep a state, whole or not at all."""
    if path is not None:
        new = path.with_suffix(".part")
        new.write_text(json.dumps(state, indent=1))
        new.replace(path)


def versions():
    """What a campaign ran on."""
    import numba
    import scipy

    import inercal

    text = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = next((line.partition(":")[2].strip() for line in text.splitlines() if "model name" in line), "")
    return {
        "inercal": inercal.__version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "SciPy": scipy.__version__,
        "numba": numba.__version__,
        "machine": f"{model or platform.machine()}, {platform.system()}",
    }


TITLES = {"selfcal": "self-calibration", "drift": "drift", "aoa": "angle of attack"}

OUTCOMES = (
    "ok",
    "unobservable",
    "inconsistent",
    "not_converged",
    "ill_conditioned",
    "stream",
    "recording refused",
    "study refused",
    "failed",
)


def table(states):
    """The results of campaigns side by side, in Markdown."""
    rows = [("", *(TITLES[each["room"]] for each in states)), ("---",) * (1 + len(states))]
    for outcome in OUTCOMES:
        counts = [each["outcomes"].get(outcome, 0) for each in states]
        if any(counts):
            rows.append((outcome, *map(str, counts)))
    rows.append(("runs", *(str(each["runs"]) for each in states)))
    rows.append(
        ("runs that broke a law", *(str(len({number for number, *_ in each["wrong"]})) for each in states))
    )
    rows.append(("longest run [s]", *(f"{each['longest_s']:.2f}" for each in states)))
    rows.append(("mean run [ms]", *(f"{1e3 * each['cpu_s'] / max(each['runs'], 1):.0f}" for each in states)))
    lines = [f"| {' | '.join(row)} |".replace("|  |", "| |") for row in rows]
    seeds = ", ".join(sorted({str(each["seed"]) for each in states}))
    told = sorted(
        {", ".join(f"{k} {v}" for k, v in each["versions"].items() if k != "machine") for each in states}
    )
    machines = sorted({each["versions"]["machine"] for each in states})
    return "\n".join([*lines, "", f"Seed {seeds}; {'; '.join(told)}; {'; '.join(machines)}."])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("room", choices=ROOMS, nargs="?")
    parser.add_argument("--runs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", type=int, help="make this run again, and show it")
    parser.add_argument("--keep", type=Path, help="keep finished chunks in this file")
    parser.add_argument(
        "--again", action="store_true", help="first make runs of --keep that broke a law again"
    )
    parser.add_argument("--table", type=Path, nargs="+", help="show kept campaigns as a table in Markdown")
    options = parser.parse_args()
    faulthandler.enable()
    if options.table is not None:
        print(table([json.loads(path.read_text()) for path in options.table]))
        return
    if options.room is None:
        parser.error(f"found no system, expected one of {', '.join(ROOMS)}")
    load(options.room)
    if options.only is not None:
        found = one(options.room, options.only, options.seed)
        pprint.pprint(found.study, width=110, sort_dicts=False)
        print(f"{found.outcome}; {', '.join(found.words) or 'nothing besides'}")
        print("\n".join(found.wrong) or "no law broken")
        return
    state = kept(options.keep, options.room, options.runs, options.seed, options.again)
    print(file=sys.stderr)
    for outcome, count in Counter(state["outcomes"]).most_common():
        print(f"{outcome:>20} {count}")
    wrong = state["wrong"]
    print(f"{len(wrong)} laws broken in {len({number for number, *_ in wrong})} of {state['runs']} runs")
    print(f"longest run {state['longest_s']:.2f} s; {state['cpu_s']:.0f} s in all, of the processor")
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    main()
