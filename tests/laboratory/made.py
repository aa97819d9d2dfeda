"""Results to keep: small ones, of simulated instruments."""

from dataclasses import replace

import numpy as np

from inercal.foundation.findings import Status
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate
from inercal.laboratory.keep import Item

ITEM = Item("Maker", "Model", "17", "Owner", "gyro")


def result(
    seed=0, names=("K1_x", "K1_y", "M_xy"), date="2026-01-31", values=None, u=None, inputs=(), message="done"
):
    """A result with random values, all of its doubles' digits in use."""
    rng = np.random.default_rng(seed)
    p = len(names)
    root = rng.normal(size=(p, p)) * 1e-3
    covariance = root @ root.T if u is None else np.diag(np.square(np.broadcast_to(u, p)))
    values = rng.normal(size=p) if values is None else np.asarray(values, dtype=float)
    basis = Basis("calibrate imu", traceability={"date": date, "operator": "N. N."}, inputs=tuple(inputs))
    dof = np.where(np.arange(p) % 2, np.inf, 7.5)
    estimate = Estimate.of(
        basis, names, ("1",) * p, values, Uncertainty(covariance, dof), (Status.OK, message)
    )
    return replace(estimate, provenance={"settings": {}, "seed": seed, "versions": {}})
