"""Do absurd studies and recordings ever get a number that is none, or no end? A campaign of random runs.

    python benchmarks/stress.py selfcal --runs 100000 --checkpoint build/selfcal
    python benchmarks/stress.py drift --runs 100000 --checkpoint build/drift
    python benchmarks/stress.py aoa --runs 100000 --checkpoint build/aoa
    python benchmarks/stress.py --table build/selfcal build/drift build/aoa

Every run draws a study and a recording, most of them such as nobody would take, goes the way of the command from the
parsed study to the result, and is held against laws: a result without NaN, of a covariance that is one, with a status;
or a refusal in one sentence; no warning; an end within 30 s of computing. `--only N` makes run N again and shows it. An
interrupted campaign with --checkpoint goes on where it stopped; `--again` makes its chunks again in which a run broke a
law, after a mend. Its results are kept in docs/design/stress.md.
"""

import argparse
import faulthandler
import json
import os
import platform
import pprint
from collections import Counter
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from absurd.runs import ROOMS, SEED, Absurd, load, one
from campaigns.places import add_options, answers, in_words

from inercal.foundation._files import write_text

CHUNK = 1000


def campaign(numbers, answers):
    """Outcomes by how often they came, broken laws (run, outcome, law), longest and summed time [s] of the runs."""
    outcomes = Counter(outcome for outcome, _, _ in answers)
    broken = [
        (number, outcome, law)
        for number, (outcome, wrong, _) in zip(numbers, answers, strict=True)
        for law in wrong
    ]
    times = [seconds for *_, seconds in answers]
    return outcomes, broken, max(times), sum(times)


def state_of(options):
    """The campaign that the options ask for, as plain objects; kept in its folder, if any."""
    about = {"stress": options.room, "seed": options.seed}
    found = answers(
        Absurd(options.room, options.seed),
        options.runs,
        options,
        about,
        CHUNK,
        again=lambda answer: options.again and bool(answer[1]),
    )
    outcomes, wrong, longest, together = campaign(range(options.runs), found)
    state = {
        "room": options.room,
        "seed": options.seed,
        "runs": options.runs,
        "outcomes": dict(outcomes),
        "wrong": wrong,
        "longest_s": longest,
        "cpu_s": together,
        "versions": versions(),
    }
    if options.checkpoint is not None:
        write_text(options.checkpoint / SUMMARY, json.dumps(state, indent=1))
    return state


SUMMARY = "summary.json"
"""File of a finished campaign in its folder."""


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
    parser.add_argument(
        "--again", action="store_true", help="make chunks of the checkpoint again in which a law was broken"
    )
    parser.add_argument(
        "--table", type=Path, nargs="+", help="show campaigns in these folders as a table in Markdown"
    )
    add_options(parser)
    options = parser.parse_args()
    faulthandler.enable()
    if options.table is not None:
        print(table([json.loads((folder / SUMMARY).read_text()) for folder in options.table]))
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
    state = state_of(options)
    for outcome, count in Counter(state["outcomes"]).most_common():
        print(f"{outcome:>20} {count}")
    wrong = state["wrong"]
    for number, _, law in wrong:
        print(f"run {number}: {law}")
    print(f"{len(wrong)} laws broken in {len({number for number, *_ in wrong})} of {state['runs']} runs")
    print(f"longest run {state['longest_s']:.2f} s; {state['cpu_s']:.0f} s in all, of the processor")
    raise SystemExit(1 if wrong else 0)


if __name__ == "__main__":
    in_words(main)
