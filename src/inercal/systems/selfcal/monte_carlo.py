"""Monte Carlo of self-calibration: stated uncertainties against errors and bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Executor as Pool
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.computing.executors import Executor, Threads
from inercal.foundation.computing.runs import run
from inercal.foundation.errors import InputError
from inercal.foundation.geometry.rotations import boxminus, conjugate
from inercal.systems.selfcal.before.bounds import BAYESIAN_BOUNDS, bounds
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem, problem
from inercal.systems.selfcal.filters.run import estimate, load_kernels
from inercal.systems.selfcal.find_base import stated_well
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.settings import SelfcalSettings
from inercal.systems.selfcal.simulate import Experiment, SimulatedPlatform, experiment, simulate

if TYPE_CHECKING:
    from inercal.foundation.inference.consistency import Coverage, Nees


REFERENCES = (
    BAYESIAN_BOUNDS,
    "Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley (2001), "
    "section 5.4.2",
)
"""Publications behind the judgement of many runs."""


@dataclass(frozen=True, eq=False)
class Campaign:
    """Errors of one estimator over many simulated runs; coefficients in the product form, SI.

    ``error`` and stated ``u`` (runs, p); ``joint_error`` (runs, m) and ``joint_covariance`` (runs, m, m) with the
    attitude [rad, about the axes of p] before the coefficients, m = 3 + p, of estimators that state one. ``bound`` (p,)
    Cramer-Rao bound of the standard uncertainties. ``nis`` (runs,) mean normalised innovation squared over the ``rows``
    away from gimbal lock, ``nis_expected`` its expectation. Of ``attempted`` runs the arrays hold those whose estimator
    said that its numbers can be used.
    """

    kind: FilterKind
    names: tuple[str, ...]
    error: Array
    u: Array
    joint_error: Array
    joint_covariance: Array
    bound: Array
    nis: Array
    rows: float
    nis_expected: float
    attempted: int

    @property
    def runs(self) -> int:
        """Number of runs that converged."""
        return len(self.error)

    @property
    def passed(self) -> bool:
        """True where all runs converged, and neither coverage nor NEES nor NIS says that uncertainties are too small.

        They may seem too large: so look coefficients left at their prior, of a truth well within it.
        """
        coverage, nees = self.coverage, self.nees
        held = coverage.fraction.min() >= coverage.limits[0] and coverage.pooled >= coverage.pooled_limits[0]
        fitting = nees.mean <= nees.limits[1] and self.nis.mean() <= self.nis_limits[1]
        return bool(self.runs == self.attempted and held and fitting)

    @property
    def harmless(self) -> str:
        """Names and statistics outside their limits as uncertainties are rather too large, in words, if any."""
        coverage, nees = self.coverage, self.nees
        high = np.append(coverage.fraction > coverage.limits[1], coverage.pooled > coverage.pooled_limits[1])
        outside = [name for name, out in zip((*self.names, "all together"), high, strict=True) if out]
        outside += ["NEES"] if nees.mean < nees.limits[0] else []
        text = "outside, but harmless, as their uncertainties are rather too large"
        return f"{text}: {', '.join(outside)}" if outside else ""

    @property
    def message(self) -> str:
        """Verdict and number of runs, in words."""
        verdict = "hold" if self.passed else "are too small"
        text = f"the stated uncertainties {verdict}: {self.attempted} runs, {self.runs} of them converged"
        return "; ".join(filter(None, [text, self.harmless]))

    @property
    def result(self) -> dict[str, Any]:
        """The figures as plain objects."""
        coverage, nees = self.coverage, self.nees
        each = zip(self.names, self.rms_over_bound, coverage.fraction, self.bound, strict=True)
        return {
            "filter": self.kind,
            "runs": self.attempted,
            "converged": self.runs,
            "passed": self.passed,
            "parameters": [
                {"name": name, "rms_over_bound": ratio, "covered": covered, "bound": bound}
                for name, ratio, covered, bound in each
            ],
            "coverage": {"level": coverage.level, "limits": coverage.limits, "pooled": coverage.pooled},
            "nees": {"mean": nees.mean, "expected": nees.expected, "limits": nees.limits},
            "nis": {"mean": float(self.nis.mean()), "expected": self.nis_expected, "limits": self.nis_limits},
        }

    @property
    def rms_over_bound(self) -> Array:
        """(p,) root mean square error over the bound, 1 for an efficient estimator."""
        return np.asarray(np.sqrt(np.mean(np.square(self.error), axis=0)) / self.bound)

    @property
    def coverage(self) -> Coverage:
        """Coverage of the 95 % intervals."""
        from inercal.foundation.inference.consistency import coverage

        return coverage(self.error, self.u)

    @property
    def nees(self) -> Nees:
        """Normalised estimation error squared of all coefficients together."""
        from inercal.foundation.inference.consistency import nees

        return nees(self.joint_error, self.joint_covariance)

    @property
    def nis_limits(self) -> tuple[float, float]:
        """Limits of the mean of ``nis`` in 99 of 100 campaigns of a consistent filter."""
        half = 2.576 * math.sqrt(2.0 * self.nis_expected / (self.rows * self.runs))
        return self.nis_expected - half, self.nis_expected + half

    def table(self) -> str:
        """The figures as lines of text."""
        low, high = self.nis_limits
        each = zip(self.names, self.rms_over_bound, strict=True)
        lines = [
            f"{self.kind}: {self.attempted} runs, {self.runs} of them converged",
            self.coverage.table(self.names),
            self.nees.table(),
            f"NIS {self.nis.mean():.4f}, expected {low:.4f} to {high:.4f}",
            "rms error over the bound:",
            *(f"{name:8s} {ratio:6.3f}" for name, ratio in each),
        ]
        return "\n".join(lines)


def campaign(
    settings: SelfcalSettings,
    runs: int,
    seed: int,
    kind: FilterKind | None = None,
    executor: Executor | Pool | None = None,
    folder: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Campaign:
    """Simulate and estimate a study with plan and truth many times, with its estimator or another ``kind``.

    ``runs``, ``seed``, ``executor``, ``folder``, ``progress`` as in `inercal.foundation.computing.runs.run`; two
    threads if there is no executor. Raises StudyError where the study has no plan or truth, or a base that would have
    to be found first, and InputError where fewer than two runs converged.
    """
    stated_well(settings, "a campaign")
    of_study, made = problem(settings), experiment(settings)
    kind = of_study.filter.kind if kind is None else kind
    load_kernels(kind, of_study)
    assert (
        of_study.model
    )  # kept in the problem, so that the task is the same to the byte whenever it is asked for
    one = partial(_one_run, made, of_study, kind)
    sample = run(one, runs=runs, seed=seed, executor=executor or Threads(2), folder=folder, progress=progress)
    truth = settings.true_values
    assert truth is not None
    sound = sample["converged"] > 0.0
    if sound.sum() < 2:
        raise InputError(kind, f"{int(sound.sum())} of {runs} runs converged, expected two or more")
    return Campaign(
        kind=kind,
        names=of_study.names,
        error=sample["error"][sound],
        u=sample["u"][sound],
        joint_error=sample["joint_error"][sound],
        joint_covariance=sample["joint_covariance"][sound],
        bound=bounds(made.motion, of_study, truth).u,
        nis=sample["nis"][sound],
        rows=float(sample["rows"][sound].mean()),
        nis_expected=_expected_nis(made, of_study, kind, float(sample["dims"][sound].mean())),
        attempted=runs,
    )


def _expected_nis(experiment: Experiment, problem: FilterProblem, kind: FilterKind, dims: float) -> float:
    """Expectation of the mean NIS of a filter whose rows have ``dims`` scalars, which is a little less than that.

    The truth is the same in all runs, and not drawn from the prior: the sum over a run is smaller by the number of
    coefficients less the square of the truth over the prior. And all but two filters take the encoders for noisier
    than they are: of the covariance ``J J^T + f^2 I``, in units of their noise, ``J J^T`` has the eigenvalues 1 and
    1 +- sin thy.
    """
    angles = experiment.motion.angles[1:, 1]
    angles = angles[np.abs(np.cos(angles)) > LIMITS.lock_cosine]
    if not len(angles):
        return dims
    sine = np.abs(np.sin(angles))
    f = 0.0 if kind in ("svd-qukf", "gimbal-ukf") else LIMITS.encoder_floor
    floor = sum(f**2 / (each + f**2) for each in (np.ones_like(sine), 1.0 + sine, 1.0 - sine))
    truth = _truth(experiment, problem)
    learned = len(truth) - float(np.square((truth - problem.mean) / problem.prior).sum())
    return float(dims - np.mean(floor) - learned / len(angles))


def _one_run(
    experiment: Experiment, problem: FilterProblem, kind: FilterKind, rng: np.random.Generator
) -> Mapping[str, Array | float]:
    """Simulate once, estimate, and compare with the truth; fields of `Campaign` by name."""
    simulated = simulate(experiment, rng)
    filtered = estimate(simulated.recording, problem, kind, history=False)
    slope = product_slope(filtered.coefficients)
    error = to_product(filtered.coefficients) - to_product(_truth(experiment, problem))
    joint_error, joint = _joint(filtered, simulated, error, slope)
    away = np.abs(np.cos(simulated.angles[1:, 1])) > LIMITS.lock_cosine
    counted = away & np.isfinite(filtered.nis)
    return {
        "error": error,
        "u": np.sqrt(np.diag(slope @ filtered.covariance @ slope.T)),
        "joint_error": joint_error,
        "joint_covariance": joint,
        "nis": filtered.nis[counted].mean() if counted.any() else np.nan,
        "dims": filtered.dims[counted].mean() if counted.any() else 0.0,
        "rows": float(counted.sum()),
        "converged": float(filtered.converged),
    }


def _truth(experiment: Experiment, problem: FilterProblem) -> Array:
    """(p,) the true values of the states, linear form."""
    return np.asarray(experiment.truth[problem.states.index])


def _joint(
    filtered: FilterResult, simulated: SimulatedPlatform, error: Array, slope: Array
) -> tuple[Array, Array]:
    """Errors of attitude and coefficients together, and their covariance; coefficients alone without an attitude."""
    if filtered.state is None or len(filtered.state.attitude) != 4:
        return error, slope @ filtered.covariance @ slope.T
    q, P = filtered.attitude, filtered.state.covariance
    if len(P) == 4 + len(error):
        # from components of the quaternion to a rotation in p: dtheta = 2 Im(q* dq)
        to_rotation = np.zeros((3 + len(error), len(P)))
        to_rotation[:3, :4] = 2.0 * _left(conjugate(q))[1:]
        to_rotation[3:, 4:] = np.eye(len(error))
        P = to_rotation @ P @ to_rotation.T
    whole = np.eye(len(P))
    whole[3:, 3:] = slope
    miss = -boxminus(simulated.attitude[-1], q)
    return np.concatenate([miss, error]), whole @ P @ whole.T


def _left(q: Array) -> Array:
    """(4, 4) matrix of the product with ``q`` from the left."""
    w, x, y, z = q
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
