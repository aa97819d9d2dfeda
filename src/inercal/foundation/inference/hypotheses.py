"""Hypotheses about a measurement: what may have happened to it, and one search for what did.

A case is a recording with its study. A hypothesis says what may have happened, and gives the case as it would be
without that. A judge turns a case into residuals z: normalised, white, of variance 1 where the case holds.

An error with parameters theta changes the residuals linearly where it is small: ``z = z_0 + Z theta``, where column i
of Z is the change of z when a small theta_i is taken out of the case. Least squares gives theta, and the sum of squares
that it takes away is chi-square where there is no error: the score test (Breusch and Pagan, Review of Economic Studies
47 (1980) 239; of filters Friedland, IEEE Trans. Automatic Control 14 (1969) 359, Willsky and Jones, ibid. 21 (1976)
108). What a study states with an uncertainty has that for a prior. A hypothesis without parameters, such as a reversed
sign, is tried as it is: the likelihood ratio of two models exceeds 1/r by chance with probability r at most (Markov's
inequality), and twice its logarithm is the fall of the sum of squares.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding, with_alternatives

Case = TypeVar("Case")
AnyCase = TypeVar("AnyCase", contravariant=True)

CLEAR = 4.0
"""Standard uncertainties by which one parameter of an error must still differ from 0 beside errors found later."""

CLOSE = 0.1
"""Change of a parameter over its standard uncertainty at which a fit ends."""

ROUNDS = 10
"""Linearisations of a fit at most."""

FLAT = 1e-12
"""Strength of a combination of parameters, over that of each alone, below which it has no effect."""


@dataclass(frozen=True, eq=False)
class Hypothesis(Generic[Case]):
    """One explanation of the misfit of a case.

    Each ``name`` is looked for once; ``code``, ``where`` and ``harm`` are those of the finding. ``says`` is its
    sentence, or makes that of what was fitted; the part up to the first colon says what and
    how much, the rest what to do. ``items`` are rows of a table for the finding. ``without`` gives
    the case as it would be without an error of some ``parameters`` (m,), each near 0; there may be none.

    Of a parameter [SI], ``step`` is the change for the derivative, ``bounds`` are the values that are believed,
    ``prior`` is the standard deviation about 0, infinite without one. The hypothesis was picked of so many
    ``alternatives``, so many ``times``; ``left_out`` counts the scalars that the case without it leaves out, each of
    which counts 1. ``derivative`` gives the change (..., m) of the residuals of a case where it is taken out, for those
    that know it without differences.
    """

    name: str
    code: str
    says: str | Callable[[Fitted[Case]], str]
    without: Callable[[Case, Array], Case]
    parameters: tuple[str, ...] = ()
    step: float = 1.0
    bounds: tuple[float, float] = (-math.inf, math.inf)
    prior: float = math.inf
    alternatives: float = 1.0
    times: int = 1
    left_out: int = 0
    where: str = ""
    harm: tuple[str, ...] = EVERYTHING
    derivative: Callable[[Case], Array] | None = None
    items: Callable[[Fitted[Case]], tuple[Mapping[str, str | float], ...]] = lambda _: ()

    def chance(self, risk: float) -> float:
        """Fall of the sum of squares that chance exceeds with the probability ``risk`` at most."""
        from scipy.special import chdtri

        if self.parameters:
            return float(chdtri(len(self.parameters), risk / self.alternatives))
        return self.left_out + 2.0 * self.times * math.log(self.alternatives / risk)


@dataclass(frozen=True, eq=False)
class Fitted(Generic[Case]):
    """A hypothesis with the ``values`` (m,) of its parameters and their standard uncertainties ``u`` (m,), in SI.

    ``case`` is the case without it and without those fitted beside it; ``alike`` are others equally possible.
    """

    hypothesis: Hypothesis[Case]
    values: Array
    u: Array
    case: Case
    alike: tuple[Fitted[Case], ...] = ()

    @property
    def sentence(self) -> str:
        """The sentence of the finding: fault, size, and remedy."""
        says = self.hypothesis.says
        return says if isinstance(says, str) else says(self)

    @property
    def finding(self) -> Finding:
        """The sentence in its two parts, with those of the equally possible ones."""
        of = self.hypothesis
        what, _, remedy = self.sentence.partition(": ")
        found = Finding(of.code, what, of.where, of.harm, action=remedy, items=of.items(self))
        return with_alternatives(found, (each.sentence.partition(": ")[0] for each in self.alike))


class Judge(Protocol[AnyCase]):
    """Fit quality of a case."""

    def residuals(self, case: AnyCase) -> Array:
        """Normalised residuals of any shape, always the same; NaN where one does not count."""

    def misfit(self, case: AnyCase) -> float:
        """Sum of squares, or what stands for it; infinite where nothing can be made of a case."""


def tried(hypothesis: Hypothesis[Case], case: Case) -> Fitted[Case]:
    """A hypothesis at zero, which one without parameters takes out as a whole."""
    m = len(hypothesis.parameters)
    none = np.zeros(m)
    return Fitted(hypothesis, none, np.ones(m), hypothesis.without(case, none))


def likeliest(
    case: Case, hypotheses: Iterable[Hypothesis[Case]], judge: Judge[Case], risk: float
) -> Fitted[Case] | None:
    """The hypothesis without parameters that explains most, if it explains more than chance does."""
    best, least = None, judge.misfit(case)
    for each in hypotheses:
        one = tried(each, case)
        if (misfit := judge.misfit(one.case) + each.chance(risk)) < least:
            best, least = one, misfit
    return best


Fits = list[Fitted[Case]]


def search(
    case: Case,
    table: Callable[[Case], Iterable[Hypothesis[Case]]],
    judge: Judge[Case],
    risk: float,
    most: int,
    systematic: Hypothesis[Case] | None = None,
    choose: Callable[[Case, Iterator[Fits[Case]]], Fits[Case] | None] = lambda _, fits: next(fits, None),
) -> tuple[Fits[Case], Case]:
    """Find the hypotheses that explain a case, one after the other, all of them fitted together.

    Parameters
    ----------
    table : callable
        Hypotheses about a case.
    risk : float
        Probability at each step, of ``most`` at most, that any hypothesis is found in a sound case.
    systematic : Hypothesis, optional
        Systematic inputs, with their prior: fitted along with all, never a finding.
    choose : callable
        Choice of the fit, the new hypothesis last in each, the likeliest fit first; None to end. The likeliest if
        absent.

    Returns
    -------
    fitted : list of `Fitted`
    case
        Without the fitted hypotheses, and with the systematic inputs where they are likeliest.
    """
    fitted = [] if systematic is None else refitted(case, [tried(systematic, case)], judge)
    now = fitted[-1].case if fitted else case
    for _ in range(most):
        ranked = _ranked(now, table, judge, risk, fitted)
        fits = (refitted(case, [*fitted, tried(each, now)], judge) for each in ranked)
        chosen = choose(now, (each for each in fits if _believed(each[-1])))
        if chosen is None:
            break
        *earlier, last = chosen
        # earlier ones that were taken for a part of this one
        fitted = [*(each for each in earlier if each.hypothesis is systematic or _clear(each)), last]
        if len(fitted) <= len(earlier):
            fitted = refitted(case, fitted, judge)
        now = fitted[-1].case
    return [each for each in fitted if each.hypothesis is not systematic], now


def _ranked(
    case: Case,
    table: Callable[[Case], Iterable[Hypothesis[Case]]],
    judge: Judge[Case],
    risk: float,
    fitted: Sequence[Fitted[Case]],
) -> list[Hypothesis[Case]]:
    """Hypotheses that explain more than chance beside those already ``fitted``; the likeliest first."""
    names = {each.hypothesis.name for each in fitted}
    asked = [each for each in table(case) if each.name not in names]
    if not asked:
        return []
    z, share = judge.residuals(case), risk / len(asked)
    held = [slopes(case, each.hypothesis, z, judge) for each in fitted]
    beside = _Beside(held, z)
    before = _solved(beside.normal, fitted).gained if held else 0.0

    def surplus(each: Hypothesis[Case]) -> float:
        one = tried(each, case)
        if not each.parameters:
            return judge.misfit(case) - judge.misfit(one.case) - each.chance(share)
        after = _solved(beside.and_with(slopes(case, each, z, judge)), [*fitted, one])
        with np.errstate(over="ignore", invalid="ignore"):  # numbers of no use explain nothing
            gain = (after.gained - before) / after.left - each.chance(share)
        return gain if math.isfinite(gain) else -math.inf

    gains = [surplus(each) for each in asked]
    order = sorted(range(len(asked)), key=lambda k: -gains[k])
    return [asked[k] for k in order if gains[k] > 0.0]


def _believed(fit: Fitted[Case]) -> bool:
    """True where all values are within their bounds."""
    least, most = fit.hypothesis.bounds
    return bool(np.all((least <= fit.values) & (fit.values <= most)))


def _clear(fit: Fitted[Case]) -> bool:
    """True where a parameter differs from 0; a hypothesis without parameters was tried as a whole."""
    return not len(fit.values) or bool((np.abs(fit.values) > CLEAR * fit.u).any())


def refitted(case: Case, fitted: Sequence[Fitted[Case]], judge: Judge[Case]) -> Fits[Case]:
    """All hypotheses together by least squares, linearised again where they are large."""
    fits = list(fitted)
    now = _without(case, fits)
    ends = np.cumsum([len(each.values) for each in fits])[:-1]
    for _ in range(ROUNDS):
        z = judge.residuals(now)
        columns = [slopes(now, each.hypothesis, z, judge) for each in fits]
        fit = _solved(normal_equations(columns, z), fits)
        parts = zip(fits, np.split(fit.change, ends), np.split(fit.u, ends), strict=True)
        fits = [Fitted(each.hypothesis, each.values + change, u, case) for each, change, u in parts]
        now = _without(case, fits)
        # far beyond its bounds an error has no likely value
        far = any(np.any(np.abs(each.values) > 2.0 * each.hypothesis.bounds[1]) for each in fits)
        if far or np.all(np.abs(fit.change) < CLOSE * fit.u):
            break
    return [Fitted(each.hypothesis, each.values, each.u, now) for each in fits]


def _without(case: Case, fitted: Sequence[Fitted[Case]]) -> Case:
    """A case without the fitted hypotheses."""
    for each in fitted:
        case = each.hypothesis.without(case, each.values)
    return case


def slopes(case: Case, hypothesis: Hypothesis[Case], z: Array, judge: Judge[Case]) -> Array:
    """Derivative (..., m) of the residuals ``z`` (...) of a case by the parameters of a hypothesis."""
    if hypothesis.derivative is not None:
        return hypothesis.derivative(case)
    m, step = len(hypothesis.parameters), hypothesis.step
    # of a long recording one copy, of seven digits, is enough
    out = np.empty((*z.shape, m), dtype=np.float32 if z.size > _LONG else np.float64)
    for k, values in enumerate(step * np.eye(m)):
        column = judge.residuals(hypothesis.without(case, values)) - z
        column /= step
        out[..., k] = column
    return out


_BLOCK = 1 << 16
"""Residuals that are squared at once."""

_LONG = 1 << 20
"""Residuals from which their derivatives are kept to seven digits."""


class Normal(NamedTuple):
    """Normal equations of ``z + Z x``, x (m,): ``matrix`` (m, m) is Z^T Z, ``right`` (m,) Z^T z, ``square`` z^T z, over
    ``rows`` residuals."""

    matrix: Array
    right: Array
    square: float
    rows: int


def normal_equations(parts: Sequence[Array], z: Array) -> Normal:
    """Normal equations of residuals ``z`` (...) by ``parts`` (..., m_i) together, without those that are NaN in any."""
    m, z = sum(each.shape[-1] for each in parts), z.reshape(-1)
    columns = [each.reshape(z.size, each.shape[-1]) for each in parts]
    total = Normal(np.zeros((m, m)), np.zeros(m), 0.0, 0)
    for first in range(0, len(z), _BLOCK):
        own = z[first : first + _BLOCK]
        some = np.hstack([np.empty((len(own), 0)), *(each[first : first + _BLOCK] for each in columns)])
        used = np.isfinite(own) & np.isfinite(some).all(axis=-1)
        some, own = (some, own) if used.all() else (some[used], own[used])
        total = Normal(
            total.matrix + some.T @ some,
            total.right + some.T @ own,
            total.square + float(own @ own),
            total.rows + len(own),
        )
    return total


class _Beside:
    """Normal equations of ``held`` columns and those of one hypothesis after the other beside them."""

    def __init__(self, held: Sequence[Array], z: Array) -> None:
        self._held, self._z = held, z
        self.normal = normal_equations(held, z)
        self._used = np.isfinite(z.reshape(-1))
        for each in held if z.size <= _LONG else ():
            self._used &= np.isfinite(each).reshape(z.size, -1).all(axis=1)
        short = z.size <= _LONG  # of a longer one there is no room for a copy
        parts = [each.reshape(z.size, -1)[self._used] for each in held] if short else []
        self._columns = np.hstack([np.empty((int(self._used.sum()), 0)), *parts]) if short else None

    def and_with(self, columns: Array) -> Normal:
        """Those of the held columns and some (..., m) more."""
        z = self._z.reshape(-1)
        own = None if self._columns is None else columns.reshape(z.size, -1)[self._used]
        if self._columns is None or own is None or not np.isfinite(own).all():
            return normal_equations([*self._held, columns], self._z)
        across, right = self._columns.T @ own, own.T @ z[self._used]
        matrix = np.block([[self.normal.matrix, across], [across.T, own.T @ own]])
        return self.normal._replace(matrix=matrix, right=np.append(self.normal.right, right))


class LeastSquares(NamedTuple):
    """Least squares: ``change`` (m,) of the parameters, its ``u`` (m,), mean square ``left`` and sum of squares
    ``gained``."""

    change: Array
    u: Array
    left: float
    gained: float


def _solved(normal: Normal, fitted: Sequence[Fitted[Case]]) -> LeastSquares:
    """Least squares of the fitted hypotheses, with their priors."""
    values = np.concatenate([each.values for each in fitted])
    prior = np.concatenate([np.full(len(each.values), each.hypothesis.prior) for each in fitted])
    return least_squares(normal, values, prior)


def least_squares(equations: Normal, values: Array, prior: Array) -> LeastSquares:
    """Change from ``values`` (m,) that makes ``z + Z change`` and their misfit to their ``prior`` (m,) smallest;
    combinations without effect stay as they are."""
    normal, right, square, count = equations
    weight = math.sqrt(max(1.0, square / max(count, 1))) / prior
    normal, right = normal + np.diag(weight**2), right + weight**2 * values
    square += float(np.square(weight * values).sum())
    if not (np.isfinite(normal).all() and np.isfinite(right).all()):  # a case that is lost
        return LeastSquares(np.zeros(len(right)), np.full(len(right), np.inf), math.inf, 0.0)
    size = np.sqrt(np.diag(normal))
    without = size == 0.0
    size[without] = 1.0
    strength, ways = np.linalg.eigh(normal / np.outer(size, size))
    ways[without] = 0.0  # eigenvectors have them in other combinations by rounding
    inverse = np.where(strength > FLAT, 1.0 / np.maximum(strength, FLAT), 0.0)
    along = ways.T @ (right / size)
    gained = float(along @ (inverse * along))
    # residuals larger than stated, for whatever reason, must not make errors of the model
    left = max(1.0, (square - gained) / max(count, 1))
    u = np.sqrt(left * (np.square(ways) @ inverse)) / size
    return LeastSquares(-(ways @ (inverse * along)) / size, u + np.finfo(float).tiny, left, gained)


def sigmas(risk: float, alternatives: int = 1) -> float:
    """Standard deviations that normal variables keep to, all of so many, but for the probability ``risk``."""
    from scipy.special import ndtri

    return -float(ndtri(0.5 * risk / alternatives))
