"""The estimators of self-calibration: names, words, factors, publications; light, as ``--help`` reads it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple, get_args

FilterKind = Literal["error-state", "svd-qukf", "gimbal-ukf", "map"]
FactorKind = Literal["cholesky", "eigen", "svd"]

KINDS: Final[tuple[FilterKind, ...]] = get_args(FilterKind)
"""All estimators, the product's default first."""

FACTOR_OF: Final[Mapping[FilterKind, FactorKind]] = {
    "svd-qukf": "eigen",
    "gimbal-ukf": "cholesky",
}
"""Factor of the covariance that each sigma-point filter takes where the study names none."""


class EstimatorWords(NamedTuple):
    """An estimator in ``words``, and the ``publications`` behind it beside those of self-calibration; ``rig``: it can
    have states of the rig."""

    words: str
    publications: tuple[str, ...] = ()
    rig: bool = False


_JULIER = (
    "S. J. Julier, J. K. Uhlmann, Unscented filtering and nonlinear estimation, Proceedings of the IEEE 92 (2004) "
    "401"
)
_LEFFERTS = (
    "E. J. Lefferts, F. L. Markley, M. D. Shuster, Kalman filtering for spacecraft attitude estimation, Journal of "
    "Guidance, Control, and Dynamics 5 (1982) 417"
)

ESTIMATORS: Final[Mapping[FilterKind, EstimatorWords]] = {
    "error-state": EstimatorWords("error-state filter", (_LEFFERTS,), rig=True),
    "svd-qukf": EstimatorWords("quaternion sigma-point filter", (_JULIER,)),
    "gimbal-ukf": EstimatorWords("gimbal-angle sigma-point filter", (_JULIER,)),
    "map": EstimatorWords("batch, largest posterior", rig=True),
}
