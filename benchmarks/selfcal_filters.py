"""A step of the self-calibration filters beside filterpy's unscented filter with the same model.

    python benchmarks/selfcal_filters.py [--quick]

filterpy draws the same 61 points (`plain_filterpy`), with Cholesky's factor first and with the eigen factor, on the
first steps of the 540 s record of the paper's path; ours run on all of it. The error-state filter solves the same
problem in another way and is set against the faster of the two; with states of the rig it has more to solve than any
peer here, and is timed by itself, one pass. Times are of one processor.
"""

import os
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import plain_filterpy
from measure import Row, Spread, alone, in_turn, named, row

from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.settings import Filter
from inercal.systems.selfcal.simulate import experiment, simulate

CHOLESKY, EIGEN = "Cholesky first", "eigen"
PEERS = {CHOLESKY: plain_filterpy.cholesky_first, EIGEN: plain_filterpy.eigen}

#: ours -> filter, the peer that it is set against, and the ratio and microseconds that are promised
OURS = {
    "svd-qukf, Cholesky": (Filter("svd-qukf", factor="cholesky"), CHOLESKY, {"at_least": 60.0}),
    "svd-qukf, eigen": (Filter("svd-qukf", factor="eigen"), EIGEN, {"at_least": 18.0}),
    "svd-qukf, SVD": (Filter("svd-qukf", factor="svd"), EIGEN, {}),
    "gimbal-ukf": (Filter("gimbal-ukf"), CHOLESKY, {}),
    "gimbal-ukf, Euler": (Filter("gimbal-ukf", integration="euler"), CHOLESKY, {}),
    "error-state": (Filter("error-state"), CHOLESKY, {"at_least": 150.0}),
}

#: states of a rig -> microseconds of a step of the error-state filter that are promised
RIGS = {'["extended", "delay"]': 3.0, '"rig"': 7.0, '["rig", "k2", "levers"]': 15.0}


def rows(quick: bool) -> list[Row]:
    rounds, steps = (1, 10) if quick else (5, 500)
    settings = load_selfcal_study(FOLDER / "selfcal.toml")
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    told = problem(settings)
    works = {
        name: lambda factor=factor: plain_filterpy.run(told, recording, steps, factor)
        for name, factor in PEERS.items()
    }
    chosen = {name: OURS[name] for name in ("svd-qukf, Cholesky", "error-state")} if quick else OURS
    asked = {name: replace(told, filter=kind) for name, (kind, _, _) in chosen.items()}
    works |= {name: lambda of=of: estimate(recording, of, history=False) for name, of in asked.items()}
    rigs = {
        states: problem(load_selfcal_study(FOLDER / "selfcal.toml", [f"model.states={states}"]))
        for states in RIGS
    }
    works |= {
        states: lambda of=of: estimate(recording, of, "error-state", history=False, brief=True)
        for states, of in rigs.items()
    }
    seconds = in_turn(works, rounds)
    reference = estimate(recording, told, "error-state", history=False)
    u, found, gaps = np.sqrt(np.diag(reference.covariance)), [], []
    for name, (_, peer, promised) in chosen.items():
        ours, theirs = (
            [s / count for s in seconds[of]] for of, count in ((name, reference.steps), (peer, steps))
        )
        size = f"{reference.steps} steps of 0.2 s"
        beside = f"{named('filterpy')}, {peer}"
        found.append(
            row(f"Self-calibration, {name}", size, ("µs a step", 1e6), ours, beside, theirs, **promised)
        )
        if name == "error-state":
            found.append(row(f"Self-calibration, {name}", size, ("µs a step", 1e6), ours, at_most=5.0))
        else:
            got = estimate(recording, asked[name], history=False)
            gap = float(np.max(np.abs(got.coefficients - reference.coefficients) / u))
            promised_gap = (
                None if asked[name].filter.integration == "euler" else 0.05
            )  # at 0.2 s Euler's steps are too long
            gaps.append(
                Row(
                    f"{name} from the error-state filter",
                    size,
                    "u",
                    Spread(gap, gap, gap),
                    at_most=promised_gap,
                )
            )
    for states, of in rigs.items():
        ours = [s / reference.steps for s in seconds[states]]
        size = f"{reference.steps} steps, {len(of.prior)} coefficients"
        found.append(
            row("Self-calibration, error-state", size, ("µs a step", 1e6), ours, at_most=RIGS[states])
        )
    return found + gaps


if __name__ == "__main__":
    alone(rows, __doc__)
