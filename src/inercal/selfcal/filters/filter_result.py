"""What every estimator of self-calibration takes and gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.geometry.rotations import multiply
from inercal.selfcal.platform.coefficients import product_slope, to_product
from inercal.selfcal.platform.kinematics import attitude
from inercal.selfcal.platform.rig import World
from inercal.selfcal.settings import Filter, Noise, SelfcalSettings


@dataclass(frozen=True, eq=False)
class Problem:
    """All that an estimator is told beside the recording: ``prior`` (p,) standard deviations about 0, p 18 or 24."""

    world: World
    noise: Noise
    prior: Array
    filter: Filter = field(default_factory=Filter)


def problem(settings: SelfcalSettings) -> Problem:
    """The problem that a study states."""
    return Problem(settings.world, settings.noise, settings.prior[: settings.size], settings.filter)


@dataclass(frozen=True, eq=False)
class Start:
    """Where an estimator begins other than at the first encoder reading.

    ``attitude`` (4,) q_bp at the first row, and its standard deviation ``sigma`` [rad] about each axis.
    """

    attitude: Array
    sigma: float


class State(NamedTuple):
    """What a recursive filter knows between two rows.

    ``attitude`` (4,) q_bp, or gimbal angles (3,) [rad] of the gimbal-ukf; ``coefficients`` (p,), linear form; their
    joint ``covariance`` (m, m); ``near`` (3,) which accelerometers count as near level; ``th`` (3,) [rad] the last
    known gimbal angles, on the turn on which they are counted.
    """

    attitude: Array
    coefficients: Array
    covariance: Array
    near: NDArray[np.int64]
    th: Array


class Trace(NamedTuple):
    """What a recursive filter says of m rows: as in `History` and `Filtered`, a row for each step.

    ``nis`` and ``dims`` are there always; the arrays before them have no rows where no history was asked for.
    ``restarts`` are the steps after which the attitude was taken anew (`inercal.selfcal.filters.gaps`).
    """

    attitude: Array
    attitude_u: Array
    coefficients: Array
    u: Array
    innovations: Array
    nis: Array
    dims: NDArray[np.int64]
    lowest_eigenvalue: float
    fallbacks: int
    gimbal_cosine: float
    restarts: tuple[int, ...] = ()


def empty_trace(m: int, p: int, history: bool) -> Trace:
    """A trace to be filled, of ``m`` rows and ``p`` coefficients."""
    rows = m if history else 0
    return Trace(
        attitude=np.empty((rows, 4)),
        attitude_u=np.empty((rows, 3)),
        coefficients=np.empty((rows, p)),
        u=np.empty((rows, p)),
        innovations=np.empty((rows, 6)),
        nis=np.empty(m),
        dims=np.empty(m, dtype=np.int64),
        lowest_eigenvalue=float("nan"),
        fallbacks=0,
        gimbal_cosine=1.0,
    )


@dataclass(frozen=True, eq=False)
class History:
    """From row to row, the first row the start.

    ``attitude`` (n, 4) q_bp and its standard deviations ``attitude_u`` (n, 3) [rad, about the axes of p; of the gimbal
    angles for the gimbal-ukf]; ``coefficients`` (n, p), linear form, and their ``u`` (n, p). Row k holds what is known
    with the measurements up to k; of ``map`` and ``lm``, which know all at once, the coefficients are those at the end.
    """

    attitude: Array
    attitude_u: Array
    coefficients: Array
    u: Array


def known_in(state: State, problem: Problem) -> History:
    """What a state knows, as the one row of a history."""
    with np.errstate(invalid="ignore"):  # NaN of a filter that fails, which is said
        u = np.sqrt(np.diag(state.covariance))
    q = attitude_of(state, problem)
    of_attitude = u[:3]
    if len(u) - len(problem.prior) == 4:  # of a quaternion: 2 |q (0, e_i)| along each axis
        across = multiply(q, np.eye(4)[1:])
        with np.errstate(invalid="ignore"):
            of_attitude = 2.0 * np.sqrt(np.einsum("ij,jk,ik->i", across, state.covariance[:4, :4], across))
    return History(
        q[None],
        of_attitude[None],
        state.coefficients[None].copy(),
        u[-len(problem.prior) :][None],
    )


def attitude_of(state: State, problem: Problem) -> Array:
    """q_bp of a state."""
    if len(state.attitude) == 4:
        return state.attitude.copy()
    return np.array(attitude(state.attitude, problem.world.axes, problem.world.signs))


@dataclass(frozen=True, eq=False)
class Filtered:
    """What an estimator found.

    Attributes
    ----------
    kind : str
    coefficients : (p,)
        Linear form, at the end; ``covariance`` (p, p).
    attitude : (4,)
        q_bp at the last row.
    nis : (n - 1,)
        Normalised innovation squared of each row but the first, NaN where nothing was measured; ``dims`` (n - 1,)
        how many scalars it is of. Of ``map`` and ``lm``, squared normalised residuals.
    innovations : (n - 1, 6)
        Of accelerometers (3) and of the attitude about the axes of p (3; gimbal angles for the gimbal-ukf), each over
        its own standard deviation; NaN where not measured. (0, 6) where no history was asked for.
    history : History or None
    seconds : float
        Time of the computation alone, kernels loaded.
    converged : bool
        False where the numbers must not be used: not finite, a covariance that lost its sign, an iteration that
        did not end, a singularity of the gimbal angles; ``message`` says why.
    lowest_eigenvalue : float
        Lowest eigenvalue of the correlation matrix that was to be factored, over all steps; NaN where none was
        computed. Below -1e-9 the filter is not converged.
    fallbacks : int
        Steps at which Cholesky's factor failed and the eigen factor was taken.
    gimbal_cosine : float
        Least |cos thy| on the path.
    restarts : tuple of int
        Rows at which the attitude was taken anew from the encoders, as these contradict a turn that was held
        (`inercal.selfcal.filters.gaps`).
    state : State or None
        Of a recursive filter, at the end, with the joint covariance of attitude and coefficients.
    """

    kind: str
    coefficients: Array
    covariance: Array
    attitude: Array
    nis: Array
    dims: NDArray[np.int64]
    innovations: Array
    history: History | None
    seconds: float
    converged: bool = True
    message: str = ""
    lowest_eigenvalue: float = float("nan")
    fallbacks: int = 0
    gimbal_cosine: float = 1.0
    restarts: tuple[int, ...] = ()
    state: State | None = None

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
        known = np.isfinite(self.nis)
        return float(self.nis[known].mean()) if known.any() else float("nan")


def found(filtered: Filtered) -> tuple[Array, Array]:
    """Coefficients (p,) of an estimator and their standard uncertainties (p,), product form."""
    slope = product_slope(filtered.coefficients)
    variances = np.diag(slope @ filtered.covariance @ slope.T)
    return to_product(filtered.coefficients), np.sqrt(np.where(variances > 0.0, variances, np.nan))
