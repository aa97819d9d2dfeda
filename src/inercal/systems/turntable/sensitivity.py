"""The sensitivity of a table: which error of the rig matters for what the instrument should read.

The drift output of a gyrowheel as an output of the sensitivity analysis: linear in earth rate, quadratic in gravity.

    y = k^T w + D^T a + a^T Q a = (w, a, a x a) diag(R, R, R x R) (k, D, vec Q) + constant

with w, a the references in n and R the attitude (`inercal.foundation.sensitivities.dense`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.computing.executors import Executor
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.records.places import counted
from inercal.foundation.results.shown import aligned, concise
from inercal.foundation.rigs.outputs import Output, gravity_reference, rate_reference, table_outputs
from inercal.foundation.sensitivities import averages, dense
from inercal.foundation.sensitivities.averages import Averages, Flag
from inercal.foundation.sensitivities.exact import positions
from inercal.foundation.sensitivities.indices import Indices, by_position, joined
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


def exact_drift(
    settings: TurntableSettings, outputs: Sequence[DriftOutput], angles: Array, shapley: bool, second: bool
) -> Indices:
    """Exact parts of variance of drift outputs at positions (n, joints) [rad]."""
    return by_position(
        lambda chain, at: dense.analyse(dense.blocks(chain, at, _DEGREES), outputs, shapley, second),
        settings.chain,
        positions(settings.chain, angles),
    )


_INDICES = (
    "I. M. Sobol, Sensitivity estimates for nonlinear mathematical models, Mathematical Modelling and Computational "
    "Experiment 1 (1993) 407-414",
    "F. Gamboa, A. Janon, T. Klein, A. Lagnoux, Sensitivity analysis for multidimensional and functional outputs, "
    "Electronic Journal of Statistics 8 (2014) 575-603",
)

_BY_METHOD = {
    "exact": (
        "A. B. Owen, Sobol' indices and Shapley value, SIAM/ASA Journal on Uncertainty Quantification 2 (2014) 245-251",
    ),
    "sampled": (
        "A. Saltelli et al., Variance based sensitivity analysis of model output, Computer Physics Communications 181 "
        "(2010) 259-270",
    ),
    "local": ("JCGM 100:2008, Guide to the expression of uncertainty in measurement",),
}
"""Publications behind each method."""


@short_repr
@dataclass(frozen=True, eq=False)
class Analysed:
    """A sensitivity analysis: ``indices`` at each position, and averages over them.

    ``joints`` names the columns of `Indices.angles`, ``what`` says each factor in words, ``note`` is for the
    user (may be empty), ``solve`` is the time of the computation alone [s].
    """

    indices: Indices
    joints: tuple[str, ...]
    what: tuple[str, ...]
    note: str = ""
    solve: float = field(default=0.0, compare=False)

    @cached_property
    def mean(self) -> Averages:
        """Mean over positions (o, k), as in Zhao et al. 2023."""
        return averages.mean(self.indices)

    @cached_property
    def weighted(self) -> Averages:
        """Parts summed over positions, over the variance summed (o, k)."""
        return averages.weighted(self.indices)

    @cached_property
    def aggregate(self) -> Averages:
        """All outputs and positions together (k,), each output divided by its scale."""
        return averages.aggregate(self.indices)

    @cached_property
    def flagged(self) -> tuple[Flag, ...]:
        """Outputs and positions where interactions rule."""
        return averages.flagged(self.indices)

    @property
    def references(self) -> tuple[str, ...]:
        """The publications behind the indices and the method."""
        return _INDICES + _BY_METHOD[self.indices.method["name"]]

    @property
    def message(self) -> str:
        """The result in a sentence."""
        indices = self.indices
        size = (
            f"{counted(len(indices.factors), 'error')}, {counted(len(indices.outputs), 'output')}, "
            f"{counted(len(indices.angles), 'position')}"
        )
        if not np.any(indices.variance > 0.0):
            return f"{size}; these errors do not move these outputs there"
        top = [indices.factors[k] for k in np.argsort(-self.aggregate.total, kind="stable")[:3]]
        head = f"{size}; the largest shares are those of {', '.join(top)}"
        if not self.flagged:
            return head
        places = len({flag.angles for flag in self.flagged})
        return f"{head}; interactions rule at {places} of the positions"


def analyse(
    settings: TurntableSettings,
    maps: bool = False,
    say: Callable[[str], None] = lambda _: None,
    progress: Callable[[int, int], None] | None = None,
    executor: Executor | None = None,
) -> Analysed:
    """Analyse the study's table by the study's method.

    Parameters
    ----------
    settings : TurntableSettings
    maps : bool
        Shapley effects and second-order parts too; only the exact method has them.
    say : callable
        Told, in words, what takes long before the computation begins.
    progress : callable, optional
        Told the positions done and all of them.
    executor : Executor, optional
        Place in which positions are sampled.

    Raises
    ------
    StudyError
        A table without errors, rates without a latitude.
    """
    chain, how = settings.chain, settings.analysis
    if not chain.errors:
        raise StudyError(
            "rig.errors",
            'found no errors of the table, expected some such as default = { uniform = "2 arcmin" }',
        )
    of_rig = [name for name in how.outputs if not name.startswith("y_")]
    drifts = [drift_output(settings, name) for name in how.outputs if name.startswith("y_")]
    outputs = table_outputs(of_rig, settings.site.gravity, settings.site.latitude)
    angles, note = settings.plan.angles, ""
    if how.method == "exact":
        from inercal.foundation._jit import compiling
        from inercal.foundation.sensitivities import exact

        if outputs:
            with compiling("sensitivity", say):
                exact.analyse(chain, outputs[:1], angles[:1], second=maps)
        clock = time.perf_counter()
        parts = [exact.analyse(chain, outputs, angles, shapley=maps, second=maps)] if outputs else []
        parts += [exact_drift(settings, drifts, angles, maps, maps)] if drifts else []
        indices = _together(parts)
    elif how.method == "sampled":
        from inercal.foundation.sensitivities import sampled

        clock = time.perf_counter()
        rng = np.random.default_rng(how.seed)
        indices = sampled.analyse(
            chain, [*outputs, *drifts], angles, how.samples, rng, how.sampling, progress, executor
        )
        indices = replace(indices, method={**indices.method, "seed": how.seed})
        taken = indices.method["samples"]
        if taken != how.samples:
            note = f"{how.samples} samples rounded up to {taken}, a power of two, for Sobol points"
    else:
        from inercal.foundation.sensitivities import local

        clock = time.perf_counter()
        indices = local.analyse(chain, [*outputs, *drifts], angles)
    solve = time.perf_counter() - clock
    return Analysed(indices, chain.joints, tuple(error.what for error in chain.errors), note, solve)


def _together(parts: Sequence[Indices]) -> Indices:
    """Indices of several groups of outputs as one."""
    return joined(
        parts,
        axis=0,
        outputs=tuple(name for part in parts for name in part.outputs),
        units=tuple(unit for part in parts for unit in part.units),
        scales=np.concatenate([part.scales for part in parts]),
    )


def result(analysed: Analysed) -> dict[str, Any]:
    """The command's own part of the JSON result: the contract's keys, arrays as arrays."""
    indices = analysed.indices
    return {
        "factors": indices.factors,
        "outputs": indices.outputs,
        "positions": {joint: analysed.indices.angles[:, k] for k, joint in enumerate(analysed.joints)},
        "mean": {**_plain(analysed.mean), **_shapley(indices, averages.mean)},
        "weighted": {**_plain(analysed.weighted), **_shapley(indices, averages.weighted)},
        "aggregate": {"outputs": indices.outputs, **_plain(analysed.aggregate)},
        "flagged": [
            {
                "output": flag.output,
                **dict(zip(analysed.joints, flag.angles, strict=True)),
                "sum_first": flag.sum_first,
                **({} if indices.resampled is None else {"u_sum_first": flag.u}),
            }
            for flag in analysed.flagged
        ],
        "method": indices.method,
    }


def table(analysed: Analysed) -> str:
    """The errors as aligned text, those with the largest shares first."""
    indices, share, mean = analysed.indices, analysed.aggregate, analysed.mean
    u_mean = [None] * len(mean.first) if mean.u_first is None else mean.u_first
    head = ("", "S", "ST", *(f"S {output}" for output in indices.outputs), "")
    rows = [
        (
            indices.factors[k],
            _number(share.first, share.u_first, k),
            _number(share.total, share.u_total, k),
            *(_number(*of_output, k) for of_output in zip(mean.first, u_mean, strict=True)),
            analysed.what[k],
        )
        for k in np.argsort(-share.total, kind="stable")
    ]
    return "\n".join(
        [
            *aligned([head, *rows], (0, len(head) - 1)),
            "",
            f"S, ST: first and total order over {', '.join(indices.outputs)} and all positions, each output in "
            "units of its reference",
            "S of an output: mean of its first-order indices over the positions",
            *(
                []
                if share.u_first is None
                else ["in brackets the standard uncertainty by sampling, of the last digits"]
            ),
        ]
    )


def _plain(means: Averages) -> Mapping[str, Array]:
    """Averages by name, those there are."""
    return {name: values for name, values in vars(means).items() if values is not None}


def _shapley(indices: Indices, average: Callable[[Indices], Averages]) -> Mapping[str, Array]:
    """Shapley effects, averaged as if they were parts of variance; none where they were not computed."""
    if indices.shapley is None:
        return {}
    parts = np.nan_to_num(indices.shapley) * indices.variance[..., None]
    return {"shapley": average(replace(indices, first_variance=parts)).first}


def _number(shares: Array, u: Array | None, k: int) -> str:
    """Index k in a column: to its uncertainty where it is sampled, else three digits, or its size."""
    share = float(shares[k])
    if np.isnan(share):
        return "-"
    if u is not None and u[k] > 0.0:
        return concise(share, float(u[k]))
    return f"{share:.4f}" if share >= 5e-5 or share == 0.0 else f"{share:.0e}"
