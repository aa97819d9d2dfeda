"""The drift output of a gyrowheel as an output of the sensitivity analysis: linear in earth rate, quadratic in gravity.

    y = k^T w + D^T a + a^T Q a = (w, a, a x a) diag(R, R, R x R) (k, D, vec Q) + constant

with w, a the references in n and R the attitude (`inercal.foundation.sensitivities.dense`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.rigs.outputs import Output, gravity_reference, rate_reference
from inercal.foundation.sensitivities import dense
from inercal.foundation.sensitivities.exact import positions
from inercal.foundation.sensitivities.indices import Indices, by_position
from inercal.systems.turntable.model import stated_values
from inercal.systems.turntable.settings import TurntableSettings

_DEGREES = (1, 1, 2)
"""Degrees of the blocks of (w, a, a x a) in the attitude."""


@dataclass(frozen=True, eq=False)
class DriftOutput(Output):
    """An output ``y_x`` or ``y_y``; ``reference`` (15,) holds w, a, a x a in n, ``axis`` (15,) k, D, vec Q."""

    def value(self, C_nb: Array) -> Array:
        """The output (*batch) [``unit``], its constant left out, for attitudes (*batch, 3, 3)."""
        w, a = self.reference[:3] @ C_nb, self.reference[3:6] @ C_nb
        k, D, Q = self.axis[:3], self.axis[3:6], self.axis[6:].reshape(3, 3)
        return np.asarray(w @ k + a @ D + np.einsum("...i,ij,...j", a, Q, a))

    def slope(self, C_nb: Array, change: Array) -> Array:
        """Change (*batch) of the output for a small ``change`` of the attitudes, both (*batch, 3, 3)."""
        w, a, moved = self.reference[:3] @ change, self.reference[3:6] @ C_nb, self.reference[3:6] @ change
        k, D, Q = self.axis[:3], self.axis[3:6], self.axis[6:].reshape(3, 3)
        return np.asarray(w @ k + moved @ D + np.einsum("...i,ij,...j", moved, Q + Q.T, a))


def drift_output(settings: TurntableSettings, channel: str) -> DriftOutput:
    """The output of a channel with the stated coefficients; its scale is its rms over all directions of gravity.

    The constant, which no error moves, takes no part in either.

    Raises
    ------
    StudyError
        The instrument is no gyrowheel, or states no drift that depends on gravity.
    """
    instrument, site = settings.instrument, settings.site
    assert site.latitude is not None
    if instrument.kind != "gyrowheel":
        raise StudyError(
            "analysis.outputs", f'found {channel} of a {instrument.kind}, expected kind = "gyrowheel"'
        )
    model = channel_model(instrument.kind, channel)
    k, D, Q = np.zeros(3), np.zeros(3), np.zeros((3, 3))
    for monomial, value in zip(model.monomials, model.linear(stated_values(settings, model)), strict=True):
        at = [i for i in range(3) for _ in range(monomial.powers[i])]
        if monomial.of_rate:
            k[monomial.powers[3:].index(1)] = value
        elif len(at) == 1:
            D[at[0]] = value
        elif len(at) == 2:
            Q[at[0], at[1]] = value
    even = Q + Q.T
    # mean squares over the sphere: of a linear form |D|^2/3, of a quadratic one about its mean
    spread = (2.0 * np.sum(np.square(0.5 * even)) - 2.0 * np.trace(Q) ** 2 / 3.0) / 15.0
    scale = float(np.sqrt(D @ D / 3.0 + spread))
    if not scale > 0.0:
        raise StudyError(
            "instrument.coefficients",
            f"found no drift of {channel} that depends on gravity, expected coefficients such as "
            f'{"DX_X" if channel == "y_x" else "DY_Y"} = "60 deg/h"',
        )
    w, a = rate_reference(site.latitude), gravity_reference()
    reference = np.concatenate([w, a, np.kron(a, a)])
    return DriftOutput(channel, reference, np.concatenate([k, D, Q.ravel()]), instrument.unit.si, scale)


def exact(
    settings: TurntableSettings, outputs: Sequence[DriftOutput], angles: Array, shapley: bool, second: bool
) -> Indices:
    """Exact parts of variance of drift outputs at positions (n, joints) [rad]."""
    return by_position(
        lambda chain, at: dense.analyse(dense.blocks(chain, at, _DEGREES), outputs, shapley, second),
        settings.chain,
        positions(settings.chain, angles),
    )
