"""What work costs against its size: rows, positions, errors, samples, poses and states, on log-log pictures.

    python benchmarks/scaling.py [--quick]

Each curve is measured in turn with the others of its panel, and the best of the rounds is kept: the cost of the work,
not of what else ran. A slope is that of the straight line through the logarithms of its upper half of sizes.
"""

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import allan
import numpy as np
import pandas
import plain_fusion
import polars
import reading
from aoa_fusion import plain
from measure import in_turn, named
from sting_study import BASE, study

import sensitivity
from inercal.examples import FOLDER
from inercal.faces.report.style import COLOURS, figure, powers_of_ten, svg
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.designs.criteria import NAMES, Candidates, D, basis
from inercal.foundation.designs.exchange import exchange
from inercal.foundation.geometry.earth import Site
from inercal.foundation.noise.deviation import allan_deviation
from inercal.foundation.records.read import read
from inercal.foundation.rigs.chain import Chain, Error
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.foundation.rigs.plans import grid
from inercal.foundation.sensitivities.exact import analyse
from inercal.systems.aoa.fusion import run as fusion
from inercal.systems.aoa.fusion import smoother
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.settings import Timing
from inercal.systems.aoa.simulate import simulate
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_truth, hand_poses
from inercal.systems.imu.simulate import simulate as simulate_imu
from inercal.systems.imu.task import calibrate as calibrate_imu
from inercal.systems.selfcal.filters.problem import problem as platform_problem
from inercal.systems.selfcal.filters.run import estimate as estimate_platform
from inercal.systems.selfcal.simulate import experiment
from inercal.systems.selfcal.simulate import simulate as simulate_platform


@dataclass(frozen=True)
class Curve:
    """Seconds of a work at several sizes, ``panel`` the picture it belongs to and ``variable`` what is varied."""

    panel: str
    variable: str
    name: str
    sizes: tuple[float, ...]
    seconds: tuple[float, ...]

    @property
    def slope(self) -> float:
        """Exponent of the cost at large sizes; NaN of fewer than three."""
        if len(self.sizes) < 3:
            return float("nan")
        n = max(3, (len(self.sizes) + 1) // 2)
        return float(np.polyfit(np.log(self.sizes[-n:]), np.log(self.seconds[-n:]), 1)[0])


def measured(
    panel: str, variable: str, rounds: int, works: dict[str, list[tuple[float, Callable, float]]]
) -> list[Curve]:
    """Curves of named works, each a list of (size, work, parts of it that are asked for)."""
    flat = {(name, k): work for name, each in works.items() for k, (_, work, _) in enumerate(each)}
    seconds = in_turn(flat, rounds, least=0.02 if rounds > 1 else 0.0)
    return [
        Curve(
            panel,
            variable,
            name,
            tuple(float(size) for size, _, _ in each),
            tuple(min(seconds[name, k]) / parts for k, (_, _, parts) in enumerate(each)),
        )
        for name, each in works.items()
    ]


def longer(times: int) -> Chain:
    """The two-axis table with each of its errors there several times."""
    elements = []
    for element in sensitivity.CHAIN.elements:
        copies = times if isinstance(element, Error) else 1
        elements += [replace(element, name=f"{element.name}{n}") for n in range(copies)]
    return Chain(tuple(elements))


def of_positions(quick: bool) -> list[Curve]:
    """Exact sensitivity and pick and freeze; SALib's time grows alike and is hundreds of times as long."""
    sides = (3, 6) if quick else (4, 8, 16, 32, 64, 128, 256)
    grids = {side**2: grid((side, side)).angles for side in sides}
    ours = [
        (n, lambda at=at: analyse(sensitivity.CHAIN, sensitivity.OUTPUTS, at, threads=1), 1)
        for n, at in grids.items()
    ]
    theirs = [(n, sensitivity.plain_numpy(at), 1) for n, at in grids.items() if n <= 300]
    works = {"inercal, exact": ours, "NumPy, N = 1024": theirs}
    return measured("Sensitivity, two-axis table", "positions", 1 if quick else 3, works)


def of_errors(quick: bool) -> list[Curve]:
    """The same with more errors in the chain, at 64 positions; pick and freeze at two of them."""
    angles = grid((8, 8)).angles
    chains = [longer(times) for times in ((1, 2) if quick else (1, 2, 4, 8))]
    ours = [
        (len(c.factors), lambda c=c: analyse(c, sensitivity.OUTPUTS, angles, threads=1), 1) for c in chains
    ]
    theirs = [(len(c.factors), sensitivity.plain_numpy(angles[:2], c), 2 / 64) for c in chains]
    works = {"inercal, exact": ours, "NumPy, N = 1024": theirs}
    return measured("Sensitivity, 64 positions", "errors of the chain", 1 if quick else 3, works)


def of_samples(quick: bool) -> list[Curve]:
    """Allan deviation at 30 averaging times."""
    records = {
        n: allan.noise(n) for n in ((3000, 6000) if quick else (10_000, 40_000, 160_000, 640_000, 2_560_000))
    }
    taus = {n: allan.INTERVAL * allan.lengths(n, 30) for n in records}
    ours = [(n, lambda n=n, x=x: allan_deviation(x, allan.INTERVAL, taus[n]), 1) for n, x in records.items()]
    theirs = [(n, lambda n=n, x=x: allan.theirs(x, taus[n]), 1) for n, x in records.items()]
    works = {"inercal, with limits": ours, named("AllanTools"): theirs}
    return measured("Allan deviation, 30 times", "samples", 1 if quick else 3, works)


def of_poses(quick: bool) -> list[Curve]:
    """Calibration by hand of simulated recordings, by the number of holds."""
    works = []
    for poses in (14, 20) if quick else (14, 28, 56, 112, 224):
        rng = np.random.default_rng(poses)
        record, _ = simulate_imu(draw_truth(rng), hand_poses(rng, poses), 9.81, 0.8, rng, rate=50.0)
        works.append((poses, lambda record=record: calibrate_imu(record, ImuSettings(Site(9.81))), 1))
    return measured("IMU by hand", "poses", 1 if quick else 2, {"inercal, with uncertainties": works})


def of_states(quick: bool) -> list[Curve]:
    """A row of the fusion with 8 to 19 states; the peers know the smallest and the largest."""
    n, few = (1000, 20) if quick else (60_000, 1000)
    recording = simulate(study(motion=replace(BASE, duration=1e-3 * n)), np.random.default_rng(1)).recording
    t, rows = recording.t, recording.rows
    names = ("inercal, filter", "inercal, smoother", "NumPy, filter", named("filterpy"))
    works: dict[str, list] = {name: [] for name in names}
    for states in (8, 11, 15, 19):
        settings = study(states, timing=Timing(0.0))
        of = problem(settings)
        _, trace = fusion.advance(fusion.initial(of), of, t, rows, last=True, block=smoother.BLOCK)
        works[names[0]].append(
            (states, lambda of=of: fusion.advance(fusion.initial(of), of, t, rows, last=True), n)
        )
        works[names[1]].append((states, lambda of=of, s=trace: smoother.smooth(of, t, rows, s), n))
        if states in (8, 19):
            told = (*plain(of, settings, recording), rows[:few, :4])
            for name, run in zip(names[2:], (plain_fusion.run_numpy, plain_fusion.run_filterpy), strict=True):
                works[name].append((states, lambda run=run, told=told: run(*told), few))
    return measured("Angle of attack, one row", "states", 1 if quick else 3, works)


def of_rows(quick: bool) -> list[Curve]:
    """The whole fusion of 19 states against the length of the record."""
    works: dict[str, list] = {"inercal, filter": [], "inercal, smoother": []}
    of = problem(study(19, timing=Timing(0.0)))
    for n in (500, 1000) if quick else (1000, 6000, 36_000, 216_000):
        recording = simulate(
            study(motion=replace(BASE, duration=1e-3 * n)), np.random.default_rng(1)
        ).recording
        t, rows = recording.t, recording.rows
        _, trace = fusion.advance(fusion.initial(of), of, t, rows, last=True, block=smoother.BLOCK)
        works["inercal, filter"].append(
            (n, lambda t=t, rows=rows: fusion.advance(fusion.initial(of), of, t, rows, last=True), 1)
        )
        works["inercal, smoother"].append(
            (n, lambda t=t, rows=rows, s=trace: smoother.smooth(of, t, rows, s), 1)
        )
    return measured("Angle of attack, 19 states", "rows", 1 if quick else 3, works)


def of_text(quick: bool) -> list[Curve]:
    """A recording of seven columns read from text, by ours with all checks."""
    sizes = (500, 1000) if quick else (10_000, 40_000, 160_000, 640_000)
    with tempfile.TemporaryDirectory() as folder:
        works: dict[str, list] = {"inercal, checked": [], named("pandas"): [], named("polars"): []}
        readers = (read, pandas.read_csv, polars.read_csv)
        for n in sizes:
            path = Path(folder) / f"{n}.csv"
            path.write_text(reading.recording(n))
            for name, reader in zip(works, readers, strict=True):
                works[name].append((n, lambda reader=reader, path=path: reader(path), 1))
        return measured("Reading, 7 columns", "rows", 1 if quick else 3, works)


def of_steps(quick: bool) -> list[Curve]:
    """Self-calibration of a platform with 18 coefficients, by the length of its path, to that of hours at 100 Hz; the
    batch estimator, which holds all rows, to a quarter of it."""
    settings = load_selfcal_study(FOLDER / "selfcal.toml")
    works: dict[str, list] = {"error-state": [], "map": []}
    for times in (1,) if quick else (1, 4, 16, 64, 256):
        plan = replace(settings.plan, moves=settings.plan.moves * times)
        recording = simulate_platform(
            experiment(replace(settings, plan=plan)), np.random.default_rng(1)
        ).recording
        of = platform_problem(settings)
        for name, each in works.items():
            if name != "map" or times <= 64:
                work = partial(estimate_platform, recording, of, name, history=False)
                each.append((len(recording.t), work, 1))
    return measured("Self-calibration, 18 coefficients", "rows", 1 if quick else 3, works)


def of_designs(quick: bool) -> list[Curve]:
    """The nine functions of gravity in a drift: the best positions among 1296, one start."""
    at = grid((12, 12) if quick else (36, 36)).angles
    rows = basis(gravity_reference() @ sensitivity.CHAIN.attitude(at))[:, None]
    table = Candidates(NAMES, rows, np.ones((len(at), 1)))
    sizes = (14, 16) if quick else (14, 28, 56, 112, 224)
    works = [(n, lambda n=n: exchange(table, n, D, np.random.default_rng(1), starts=1), 1) for n in sizes]
    return measured("Choice of positions", "positions", 1 if quick else 3, {"inercal, one start": works})


PANELS = (
    of_positions, of_errors, of_samples, of_poses, of_rows, of_states, of_text, of_steps, of_designs,
)  # fmt: skip


def curves(quick: bool) -> list[Curve]:
    """All curves, panel by panel."""
    return [curve for panel in PANELS for curve in panel(quick)]


def drawn(found: list[Curve]) -> str:
    """The picture of all panels, SVG."""
    panels = list(dict.fromkeys(curve.panel for curve in found))
    with figure(7.1, 7.5) as page:
        for axes, panel in zip(page.subplots(3, 3).ravel(), panels, strict=True):
            own = [curve for curve in found if curve.panel == panel]
            for curve, colour, marker in zip(own, COLOURS, "osD^", strict=False):
                slope = "" if np.isnan(curve.slope) else f", slope {curve.slope:.2f}"
                axes.loglog(curve.sizes, curve.seconds, color=colour, marker=marker, label=curve.name + slope)
            axes.set_title(panel)
            axes.set_xlabel(own[0].variable)
            axes.set_ylabel("seconds")
            axes.grid(True)
            low, high = axes.get_ylim()
            axes.set_ylim(low, high * (high / low) ** 0.45)
            axes.legend(fontsize=5.8, loc="upper left", handlelength=1.4, borderpad=0.1)
            powers_of_ten(axes.yaxis)
            if max(own[0].sizes) > 100 * min(own[0].sizes):
                powers_of_ten(axes.xaxis)
            else:
                axes.set_xticks(own[0].sizes, [f"{size:g}" for size in own[0].sizes])
                axes.set_xticks([], minor=True)
        return svg(page)


def as_objects(found: list[Curve]) -> list[dict]:
    """Curves as plain objects, with their slopes."""
    return [asdict(curve) | {"slope": None if np.isnan(curve.slope) else curve.slope} for curve in found]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="small sizes, once; no figure is to be judged")
    print(json.dumps(as_objects(curves(parser.parse_args().quick))))


if __name__ == "__main__":
    main()
