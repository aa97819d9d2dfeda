"""Coverage of calibrations from sections: the protocols of tests by an independent forward model, a fresh seed.

    python benchmarks/section_coverage.py SEED SECONDS

prints for each protocol the share of U that hold the truth, with the sd of that mean by the scatter of runs, and the
mean of error squared over covariance per coefficient (NEES). Protocols take turns until the processor time is spent.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT / "tests" / "imu"), str(ROOT / "tests")]
from section_protocols import PROTOCOLS  # noqa: E402

from inercal.systems.imu.sections.calibration import calibrate_sections  # noqa: E402


def one_run(name: str, seed: list[int]) -> tuple[float, float, bool]:
    """Share of coefficients whose U holds the truth, error squared over covariance per coefficient, and whether the
    fit converged; K2 is by prior and left aside. Where variances are estimated, u is that of Student's distribution."""
    protocol = PROTOCOLS[name]
    unit, sections, priors = protocol.run(seed)
    found = calibrate_sections(sections, priors)
    used = [k for k, term in enumerate(found.names) if not term.startswith("K2") and protocol.keep(term)]
    error = np.array([found.x[k] - unit.truth[found.names[k]] for k in used])
    student = float(np.median((found.dof[used] - 2.0) / found.dof[used]))
    weighed = np.linalg.solve(found.covariance[np.ix_(used, used)], error)
    inside = float(np.mean(np.abs(error) < found.U[used]))
    return inside, student * float(error @ weighed) / len(used), found.converged


def main(seed: int, seconds: float) -> None:
    """Runs of all protocols in turn, and their table."""
    runs: dict[str, list[tuple[float, float, bool]]] = {name: [] for name in PROTOCOLS}
    begin, number = time.process_time(), 0
    while time.process_time() - begin < seconds:
        for name, done in runs.items():
            done.append(one_run(name, [seed, number]))
        number += 1
    print(f"{'protocol':48} runs  coverage [%]   NEES mean  median  not converged")
    for name, done in runs.items():
        inside, squares, converged = (np.array(column, dtype=float) for column in zip(*done, strict=True))
        mean, sd = 100.0 * inside.mean(), 100.0 * inside.std(ddof=1) / np.sqrt(len(done))
        line = f"{name:48} {len(done):4d}  {mean:5.1f} ± {sd:3.1f}    {squares.mean():6.2f}     "
        print(f"{line}{np.median(squares):5.2f}  {len(done) - int(converged.sum()):3d}")


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]))
