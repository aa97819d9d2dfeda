"""State, estimates and result of the estimators of self-calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion
from inercal.foundation.geometry.rotations import multiply
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.platform.kinematics import attitude


class FilterState(NamedTuple):
    """State of a recursive filter between two rows.

    ``attitude`` (4,) q_bp, or gimbal angles (3,) [rad] of the gimbal-ukf; ``coefficients`` (p,), linear form; their
    joint ``covariance`` (m, m); ``near`` (3,) which accelerometers count as near level; ``th`` (3,) [rad] the last
    known gimbal angles, on the turn on which they are counted.
    """

    attitude: Array
    coefficients: Array
    covariance: Array
    near: NDArray[np.int64]
    th: Array


class Estimates(NamedTuple):
    """Estimates after each of m steps, as in `RowHistory` and `FilterResult`; without a history no rows but of ``nis``
    and ``dims``."""

    attitude: Array
    attitude_u: Array
    coefficients: Array
    u: Array
    innovations: Array
    nis: Array
    dims: NDArray[np.int64]


def empty_estimates(m: int, p: int, history: bool) -> Estimates:
    """Room for the estimates of ``m`` steps and ``p`` coefficients."""
    rows = m if history else 0
    return Estimates(
        attitude=np.empty((rows, 4)),
        attitude_u=np.empty((rows, 3)),
        coefficients=np.empty((rows, p)),
        u=np.empty((rows, p)),
        innovations=np.empty((rows, 6)),
        nis=np.empty(m),
        dims=np.empty(m, dtype=np.int64),
    )


@kernel
def remember(out: Estimates, k: int, q: Quaternion, c: Array, index: NDArray[np.int64], P: Array) -> None:
    """Write row ``k`` of a history: attitude and states, at places ``index`` (p,) of the full vector ``c``, and their
    standard deviations by the covariance (3 + p, 3 + p)."""
    for i in range(4):
        out.attitude[k, i] = q[i]
    for i in range(3):
        out.attitude_u[k, i] = math.sqrt(P[i, i])
    for j in range(len(index)):
        out.coefficients[k, j] = c[index[j]]
        out.u[k, j] = math.sqrt(P[3 + j, 3 + j])


class Trace(NamedTuple):
    """Estimates of a recursive filter after each of m steps, and its health over all of them, as in `FilterResult`;
    ``restarts`` are steps here."""

    estimates: Estimates
    lowest_eigenvalue: float = math.nan
    fallbacks: int = 0
    gimbal_cosine: float = 1.0
    restarts: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class RowHistory:
    """From row to row, the first row the start.

    ``attitude`` (n, 4) q_bp and its standard deviations ``attitude_u`` (n, 3) [rad, about the axes of p; of the gimbal
    angles for the gimbal-ukf]; ``coefficients`` (n, p), linear form, and their ``u`` (n, p). Row k holds what is known
    with the measurements up to k; of ``map``, which knows all at once, the coefficients are those at the end.
    """

    attitude: Array
    attitude_u: Array
    coefficients: Array
    u: Array


def estimate_of(state: FilterState, problem: FilterProblem) -> RowHistory:
    """The estimate of a state, as the one row of a history."""
    with np.errstate(invalid="ignore"):  # NaN of a filter that fails, which is said
        u = np.sqrt(np.diag(state.covariance))
    q = attitude_of(state, problem)
    of_attitude = u[:3]
    if len(u) - len(problem.prior) == 4:  # of a quaternion: 2 |q (0, e_i)| along each axis
        across = multiply(q, np.eye(4)[1:])
        with np.errstate(invalid="ignore"):
            of_attitude = 2.0 * np.sqrt(np.einsum("ij,jk,ik->i", across, state.covariance[:4, :4], across))
    of_coefficients = u[-len(problem.prior) :]
    return RowHistory(q[None], of_attitude[None], state.coefficients[None].copy(), of_coefficients[None])


def attitude_of(state: FilterState, problem: FilterProblem) -> Array:
    """q_bp of a state."""
    if len(state.attitude) == 4:
        return state.attitude.copy()
    return np.array(attitude(state.attitude, problem.world.axes, problem.world.signs))


@dataclass(frozen=True, eq=False)
class FilterResult:
    """Result of an estimator.

    ``coefficients`` (p,) by ``names``, linear form, their ``covariance`` (p, p); ``attitude`` (4,) q_bp at the
    last row. ``nis`` (n - 1,) normalised innovation squared of each row but the first, NaN where nothing was measured,
    of ``dims`` (n - 1,) scalars; of ``map`` squared normalised residuals. ``innovations`` (n - 1, 6) of
    accelerometers and of the attitude about the axes of p (gimbal angles for the gimbal-ukf), each over its standard
    deviation, NaN where not measured; no rows without a history. ``seconds`` of the computation alone, kernels loaded.

    Not ``converged`` where the numbers must not be used, and the ``message`` says why. ``lowest_eigenvalue`` of the
    correlation matrix that was factored, over all steps, NaN where none was; ``fallbacks`` steps at which Cholesky's
    factor failed and the eigen factor was taken. ``gimbal_cosine`` least |cos thy| on the path; ``restarts`` rows at
    which the attitude was taken anew (`inercal.systems.selfcal.filters.gaps`); ``state`` of a recursive filter at the
    end.
    """

    kind: FilterKind
    names: tuple[str, ...]
    coefficients: Array
    covariance: Array
    attitude: Array
    nis: Array
    dims: NDArray[np.int64]
    innovations: Array
    history: RowHistory | None
    seconds: float
    converged: bool = True
    message: str = ""
    lowest_eigenvalue: float = float("nan")
    fallbacks: int = 0
    gimbal_cosine: float = 1.0
    restarts: tuple[int, ...] = ()
    state: FilterState | None = None

    @property
    def steps(self) -> int:
        """Number of rows but the first."""
        return len(self.nis)

    @property
    def step_us(self) -> float:
        """Time of a step [us]."""
        return 1e6 * self.seconds / max(self.steps, 1)

    @property
    def nis_mean(self) -> float:
        """Mean of the normalised innovations squared, per row with measurements; NaN without any."""
        finite = np.isfinite(self.nis)
        return float(self.nis[finite].mean()) if finite.any() else math.nan


def product_form(result: FilterResult, names: Sequence[str] = ()) -> tuple[Array, Array]:
    """Coefficients (p,) of an estimator and their standard uncertainties (p,), product form; of other ``names``, where
    these are given, NaN for those that it does not have."""
    slope = product_slope(result.coefficients)
    variances = np.diag(slope @ result.covariance @ slope.T)
    values, u = to_product(result.coefficients), np.sqrt(np.where(variances > 0.0, variances, np.nan))
    if not names or tuple(names) == result.names:
        return values, u
    of = {name: k for k, name in enumerate(result.names)}
    there = [of.get(name, -1) for name in names]
    return np.append(values, np.nan)[there], np.append(u, np.nan)[there]
