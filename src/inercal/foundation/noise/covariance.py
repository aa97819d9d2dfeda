"""Covariance of overlapping Allan variances under Gaussian noise of the kinds N, B, K, Q and a ramp.

Allan variances v = sum D_i^2 / (2 m^2 M) are mean squares of M second differences D of the running sum of the
samples (of "phase"). For Gaussian noise cov(D_i^2, D'_j^2) = 2 C^2 + 4 d d' C with C = cov(D_i, D'_j), which depends
on the lag between their centres alone, and d, d' their means (from a ramp). C is a combination of nine values of the
generalised autocovariance of phase, which is closed for each kind (for unit coefficients, in samples)::

    N  -|l|/2      B  l^2 ln|l| / (2 pi)      K  |l|^3/12      Q  1 at l = 0

and so 2 m, (4 ln 2 / pi) m^2, 2 m^3/3 and 6 for E D^2, as the Allan variance has it. The sums over all pairs are
trapezoidal over lags that lie densely about the kinks of C; they are quadratic in the squared coefficients, so
they are made once for any mix.

References
----------
C. A. Greenhall and W. J. Riley, "Uncertainty of stability variances based on finite differences", 35th PTTI (2003):
the same sums for one kind and one averaging time, and their generalised autocovariances.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.noise.kernels import KINDS, covariance_sums

Integers = NDArray[np.int64]

ALPHA = (0, -1, -2, 2)
"""Exponent of the spectrum of the samples of N, B, K and Q."""

#: lags lie no further apart than this part of their distance to the nearest kink
_SPACING = 0.1


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums over pairs of second differences at ``lengths`` (k,): products (k, k, 4, 4) and single values (k, k, 4)."""

    lengths: Integers
    products: Array
    singles: Array

    def without_first(self) -> Sums:
        """The sums without the shortest averaging time."""
        return Sums(self.lengths[1:], self.products[1:, 1:], self.singles[1:, 1:])

    def with_gaps(self, n: int, white: Array, steps: Array) -> Sums:
        """The sums of ``n`` samples whose gaps enlarge the variance of N by ``white`` (k,), of Q by ``steps`` (k,).

        The part that gaps add to Q has, on average over the places, the covariance of white noise. But it comes in
        shots, one of variance 2 Q^2 a gap, so that C varies with them: for gaps that are independent of each other, r a
        sample, by r (2 Q^2)^2 times the sum over gaps of the squared weights in D and in D'. The mean of C^2 is larger
        than the square of the mean C by that, and the differences D to which a gap belongs are 2 m.
        """
        k = len(self.lengths)
        mixed = np.zeros((k, k, KINDS, KINDS)) + np.eye(KINDS)  # covariances with gaps by those without
        mixed[:, :, 0, 0] = np.sqrt(np.outer(white, white))
        # 6 Q^2 of a second difference without gaps; N^2 has 2 m
        added = 6.0 * np.maximum(steps - 1.0, 0.0) / (2.0 * self.lengths)
        mixed[:, :, -1, 0] = np.sqrt(np.outer(added, added))
        products = mixed @ self.products @ mixed.swapaxes(2, 3)
        shots = self.lengths * np.sqrt(added)  # 2 r = added
        products[:, :, -1, -1] += 8.0 * np.outer(shots, shots) / n
        return Sums(
            self.lengths,
            products,
            np.einsum("ijab,ijb->ija", mixed, self.singles),
        )

    def covariance(self, squares: Array, ramp: float = 0.0) -> Array:
        """(k, k) of the Allan variances for squared coefficients N, B, K, Q and of a ramp, in samples."""
        k, m = len(self.lengths), self.lengths.astype(float)
        both = self.products.reshape(k * k, -1) @ np.outer(squares, squares).ravel()
        return np.asarray(both.reshape(k, k) / np.outer(m, m) ** 2 / 2.0 + ramp * (self.singles @ squares))


def degrees_of_freedom(n: int, m: int, alpha: int) -> float:
    """Equivalent degrees of freedom of the overlapping Allan variance over ``m`` of ``n`` samples, at least 1.

    Twice the squared mean over the variance, for noise of one kind: ``alpha`` is in `ALPHA`.
    """
    kind = ALPHA.index(alpha)
    return float(_at(m, 0)[kind] ** 2 / pair_sums(n, m, m)[0][kind, kind])


@lru_cache(maxsize=1 << 12)
def lag_one(m: int) -> Array:
    """Lag 1 autocorrelation (4,) of the differences of adjacent means over ``m`` samples, for each kind."""
    return _at(m, m) / _at(m, 0)


def _at(m: int, lag: int) -> Array:
    """Autocovariance (4,) of the second differences over ``m`` samples at one lag, for each kind of unit size."""
    single = np.zeros(KINDS)
    covariance_sums(np.array([lag]), np.ones(1), m, m, np.zeros((KINDS, KINDS)), single)
    return single


def sums(n: int, lengths: tuple[int, ...]) -> Sums:
    """Sums for ``n`` samples and means over ``lengths`` samples, each at most n/2."""
    k = len(lengths)
    products, singles = np.zeros((k, k, KINDS, KINDS)), np.zeros((k, k, KINDS))
    for i, one in enumerate(lengths):
        for j in range(i, k):
            short, long = sorted((one, lengths[j]))
            products[i, j], singles[i, j] = pair_sums(n, short, long)
            products[j, i], singles[j, i] = products[i, j], singles[i, j]
    return Sums(np.array(lengths), products, singles)


@lru_cache(maxsize=1 << 14)
def pair_sums(n: int, m: int, other: int) -> tuple[Array, Array]:
    """Mean over all pairs of C_k C_h (4, 4) and C_k (4,), for ``m`` <= ``other`` <= n/2 of ``n`` samples."""
    last = n - m - other
    kinks = np.unique([0, m, other - m, other, other + m])
    grid = _offsets(last + other + m)
    lags = np.concatenate([kinks[:, None] + grid, kinks[:, None] - grid], axis=None)
    lags = np.unique(np.concatenate([lags[(lags >= 0) & (lags <= last)], [0, last]]))
    gaps = np.diff(lags) - 1.0
    weights = np.ones(len(lags))
    weights[1:] += gaps / 2.0
    weights[:-1] += gaps / 2.0
    weights[1:] *= 2.0  # both signs of the lag
    # so many pairs have that lag between their centres
    pairs = n + 1 - 2 * other - np.maximum(lags - (other - m), 0)
    products, singles = np.zeros((KINDS, KINDS)), np.zeros(KINDS)
    covariance_sums(lags, weights * pairs, m, other, products, singles)
    all_pairs = float((n + 1 - 2 * m) * (n + 1 - 2 * other))
    return products / all_pairs, singles / all_pairs


@lru_cache(maxsize=16)
def _offsets(last: int) -> Integers:
    """Distances 0, 1, 2, ... from a kink, further apart the further away, up to ``last``."""
    offsets, d = [], 0
    while d <= last:
        offsets.append(d)
        d += max(1, int(_SPACING * d))
    return np.array(offsets)
