"""The fusion in what tunnels do, by an independent simulator: before and after what the recording decides.

    python benchmarks/aoa_tunnels.py --seeds 20 --first 1001 --rate 500

15 deg + 10 deg at 1 Hz, polars and rest, 30 s, all constants drawn from the prior; rms error [deg], rms of error over
u, coverage of 95 % after 2 s. *Before*: a gyro taken for prompt, the usual snap, no band. Then the rms error of the
paper's way after a low pass of the same causality, and by how many standard errors of the paired differences over the
seeds the fusion is worse than that. With ``--verdicts`` how many of the runs end ``ok``, and what harm the others name.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from independent.aoa import AXES, CASES, DEG, DELAYS, G, R, Tunnel, simulate
from scipy.signal import butter, sosfilt, sosfilt_zi

from inercal.foundation.geometry.earth import Site
from inercal.systems.aoa.diagnosis.choice import decided
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.paper.methods import LOW_PASS, low_passed, measure
from inercal.systems.aoa.reading.recording import Recording, plain
from inercal.systems.aoa.settings import AoaSettings, Methods, Noise, Timing
from inercal.systems.aoa.simulate import to_record
from inercal.systems.aoa.task import measure as judged

STUDY = AoaSettings(
    Site(G),
    Layout(("a1", "a2", "a3"), np.arctan2(-AXES[:, 1], AXES[:, 0]), R, np.zeros(3)),
    Noise(1e-4 * G, 1e-4 * G, 0.2 * DEG, 5.0 * DEG / 3600.0),
)


def of_paper(recording: Recording, smoothed: bool) -> np.ndarray:
    """The paper's angle (improved, mechanical, dual) after a low pass of 30 Hz: zero phase where all rows are known,
    else causal, begun at rest."""
    angles = measure(recording, STUDY, Methods())
    if smoothed:
        return low_passed(angles, recording.t).theta
    step = float(np.median(np.diff(recording.t)))
    sections = butter(4, 2.0 * LOW_PASS * step, output="sos")
    theta = np.where(np.isfinite(angles.theta), angles.theta, 0.0)
    return np.asarray(sosfilt(sections, theta, zi=sosfilt_zi(sections) * theta[0])[0])


def cases() -> Iterator[tuple[str, str]]:
    """Each case with the motions that it is tried in."""
    kinds = {name: ("sine",) if name in DELAYS else ("sine", "polar", "rest") for name in CASES}
    return ((name, kind) for name, each in kinds.items() for kind in each)


def verdict(recording: Recording, smoothed: bool) -> str:
    """The verdict of the command on a recording, with the codes of what may harm."""
    settings = replace(STUDY, estimator=replace(STUDY.estimator, smooth=smoothed))
    of = judged(to_record(recording, settings), settings).estimate
    return " ".join([of.status.value, *sorted({each.code for each in of.findings if each.harm})])


def verdicts(seeds: range, rate: float, smoothed: bool) -> Iterator[str]:
    """Each case with the verdicts of its runs."""
    for name, kind in cases():
        found: Counter[str] = Counter()
        for seed in seeds:
            run = simulate(Tunnel(kind, duration=30.0, fs=rate, **CASES[name]), seed)
            found[verdict(plain(run.t, run.acc, run.gyro), smoothed)] += 1
        yield f"| {name}, {kind} | {', '.join(f'{count} {each}' for each, count in found.most_common())} |"


def rows(seeds: range, rate: float, smoothed: bool) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Each case at a rate [Hz] with its figures before and after, and the rms errors (seeds, 2) [deg] of the fusion and
    of the paper's way."""
    for name, kind in cases():
        both, errors = np.zeros((2, 3)), np.empty((len(seeds), 2))
        for number, seed in enumerate(seeds):
            run = simulate(Tunnel(kind, duration=30.0, fs=rate, **CASES[name]), seed)
            recording, late = plain(run.t, run.acc, run.gyro), run.t > 2.0
            prompt = replace(STUDY, timing=Timing(0.0))
            for k, settings in enumerate((prompt, decided(recording, STUDY))):
                filtered = estimate(recording, problem(settings), smoothed)
                error, u = (filtered.theta - run.theta)[late], filtered.u[late]
                answered = np.isfinite(error)
                error, u = error[answered], u[answered]
                figures = (
                    np.square(error / DEG).mean(),
                    np.square(error / u).mean(),
                    (abs(error) < 1.96 * u).mean(),
                )
                both[k] += np.array(figures) / len(seeds)
            paper = (of_paper(recording, smoothed) - run.theta)[late] / DEG
            errors[number] = np.sqrt(figures[0]), np.sqrt(np.nanmean(paper**2))
        both[:, :2] = np.sqrt(both[:, :2])
        yield f"{name}, {kind}", both, errors


def worse(errors: np.ndarray) -> float:
    """Mean of the paired differences of errors (n, 2), fusion less paper, over its standard error."""
    apart = errors[:, 0] - errors[:, 1]
    spread = apart.std(ddof=1) / np.sqrt(len(apart)) if len(apart) > 1 else 0.0
    return float(apart.mean() / spread) if spread > 0.0 else float("nan")


def main() -> None:
    """Print the table of the book."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--rate", type=float, default=500.0, help="rows a second [Hz]")
    parser.add_argument("--smooth", action="store_true", help="the smoother, and a low pass of zero phase")
    parser.add_argument(
        "--verdicts", action="store_true", help="the verdicts of the command in the place of figures"
    )
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    if options.verdicts:
        for line in verdicts(seeds, options.rate, options.smooth):
            print(line, flush=True)
        return
    print("| case | before | after | paper, low pass | worse by, se |\n|---|---|---|---|---|")
    for name, both, errors in rows(seeds, options.rate, options.smooth):
        cells = [f"{error:.2g} / {ratio:.2g} / {100.0 * covered:.0f} %" for error, ratio, covered in both]
        paper = np.sqrt(np.mean(errors[:, 1] ** 2))
        print(f"| {name} | {' | '.join(cells)} | {paper:.2g} | {worse(errors):.1f} |", flush=True)


if __name__ == "__main__":
    main()
