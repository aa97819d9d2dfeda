"""What 1/f noise of the accelerometers costs at least: the bound of any estimator, and what bias_walk makes of it.

    python benchmarks/selfcal_one_over_f.py [--level 1] [--waves 160]

The noise has the exact covariance of a sum of first-order processes an octave apart, its Allan deviation a floor at
that level, and an estimator is granted that it knows it: as so many cosines of time about the constant bias, over the
record of `independent/selfcal.py` (three joints, 3717 rows). Innovations and coefficients of a filter that knows
nothing of them change by A and S per cosine; no estimator has less than P + S (A'A + C^-1)^-1 S', C the covariance of
the cosines (R. L. Plackett, Some theorems in least squares, Biometrika 37 (1950) 149). In units of the u of the paper's
model on a rig without errors.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from independent.selfcal import THREE, UG, Drive, simulated, study
from scipy.linalg import toeplitz

from inercal.faces.studies.load import load_selfcal_study
from inercal.systems.selfcal.before.bounds import bounds, nominal_attitudes
from inercal.systems.selfcal.before.considered import both
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.plan import CommandedMotion
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import STATES


def covariance_in_time(level: float, step: float, n: int) -> np.ndarray:
    """(n, n) covariance of 1/f noise, samples every ``step`` [s]; its Allan deviation has its floor at ``level``."""
    lag = step * np.arange(n)
    times = step * 2.0 ** np.arange(0, np.ceil(np.log2(n)) + 2)
    x = 2.0 ** np.arange(-12, 21)
    allan = np.sum((2.0 / x**2) * (x - 1.5 + 2.0 * np.exp(-x) - 0.5 * np.exp(-2.0 * x)))
    return toeplitz(level**2 / allan * np.exp(-lag[:, None] / times).sum(axis=1))


def posed(folder: Path, states: str, level: float):
    """Problem of a filter with these states; walks stand for 1/f noise of a ``level`` [m/s^2]."""
    text = study(more=f"[model]\nstates = {states}\n")
    walk = f'accelerometer_walk = "{0.35 * level / UG} ug/sqrt(s)"'
    (folder / "study.toml").write_text(text.replace("[noise]", f"[noise]\n{walk}"))
    return problem(load_selfcal_study(folder / "study.toml"))


def at_best(motion: CommandedMotion, of, level: float, waves: int) -> np.ndarray:
    """(18,) u that no estimator undercuts, of states with the biases that wander and the spectrum known."""
    n, c = len(motion.t), of.mean
    own = bounds(motion, of).u
    through = np.linspace(0.0, np.pi, n)
    recording = Recording(motion.t, motion.rate, motion.angles, np.zeros((n, 3)))
    q = nominal_attitudes(motion, of, c, None)
    names = STATES["ka0_T1"].parameters  # a bias by temperature, which here is a course of time
    each = [both(replace(recording, warm=np.cos(j * through)), of, q, c, names, ()) for j in range(waves)]
    cosines = np.linalg.pinv(np.cos(np.outer(through, np.arange(waves))))
    root = np.linalg.cholesky(cosines @ covariance_in_time(level, motion.t[1], n) @ cosines.T)
    A = (np.stack([a for a, _ in each], -1) @ root).reshape(-1, 3 * waves)
    S = product_slope(c) @ (np.stack([s for _, s in each], -1) @ root).reshape(-1, 3 * waves)
    left = np.linalg.inv(A.T @ A + np.eye(3 * waves))
    return np.sqrt(own**2 + np.einsum("ia,ab,ib->i", S, left, S))[:18]


def compared(level: float, waves: int) -> tuple[tuple[str, ...], dict[str, np.ndarray]]:
    """Names of the 18 coefficients, and u (18,): of the ``paper`` on an ideal rig, of ``rig`` with K2 and lever arms,
    of the ``best`` there is with 1/f noise of a ``level`` [m/s^2], and ``walking``, with bias_walk."""
    record = simulated(np.random.default_rng(20261122), Drive(THREE, ramp=0.4))
    motion = CommandedMotion(record.t, record.th, record.rate[:-1])
    with tempfile.TemporaryDirectory() as name:
        paper, rig, walking = (
            posed(Path(name), states, level)
            for states in ('"paper"', '["rig", "k2", "levers"]', '["rig", "k2", "levers", "bias_walk"]')
        )
    u = {"paper": paper, "rig": rig, "walking": walking}
    found = {words: bounds(motion, of).u[:18] for words, of in u.items()}
    return paper.names[:18], found | {"best": at_best(motion, rig, level, waves)}


def main() -> None:
    """Print how much wider u becomes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--level", type=float, default=1.0, help="floor of the Allan deviation [ug]")
    parser.add_argument("--waves", type=int, default=160, help="cosines of each accelerometer")
    given = parser.parse_args()
    names, u = compared(given.level * UG, given.waves)
    rows = {
        "rig": "no 1/f, rig with k2 and levers",
        "best": "1/f, no estimator is better",
        "walking": "with bias_walk",
    }
    for key, words in rows.items():
        ratio = u[key] / u["paper"]
        print(
            f"{words}: u {np.median(ratio):.2f} times that of an ideal rig (median), {ratio.max():.2f} at most"
        )
    print("with bias_walk over the best:")
    print(", ".join(f"{name} {more:.2f}" for name, more in zip(names, u["walking"] / u["best"], strict=True)))


if __name__ == "__main__":
    main()
