"""Values that no instrument has, whatever a fit says of them: their own size tells that something else is wrong."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.limits import LIMITS
from inercal.foundation.records.places import counted_names

_RANGES = (0.125, 0.25, 0.5, 2.0, 4.0, 8.0)
"""Scale factors of a range that was taken for another one."""


def implausible(
    names: Sequence[str],
    values: Array,
    u: Array,
    scales: Mapping[str, float],
    angles: Collection[str] = (),
    gravity: Mapping[str, float] = {},
) -> Iterator[Finding]:
    """Findings about values (p,) of standard uncertainties ``u`` (p,) that are outside what they can be by more than
    2 u.

    Parameters
    ----------
    names : (p,)
    scales : mapping
        What each scale factor should be, by name; 0 where nobody knows, -0 of an output that counts backward: then its
        u and its sign alone are judged.
    angles : collection of str
        Names of misalignments [rad], judged where all scale factors can be.
    gravity : mapping
        Output of 1 g by the name of a bias of accelerometers.
    """
    rows = list(zip(names, values.tolist(), u.tolist(), strict=True))
    told = list(_of_scales([row for row in rows if row[0] in scales], scales))
    yield from told
    for name, value, own in rows:
        if not told and name in angles and abs(value) - 2.0 * own > LIMITS.angle_off:
            text = f"{name} is {np.degrees(value):.3g} deg, more than a misalignment can be."
            action = "Check the order of the axes and the mounting."
            yield Finding("channel_swap", text, "", (name,), action=action)
        full = abs(gravity.get(name, 0.0))
        count = round(abs(value) / full) if full else 0
        if count in (1, 2) and abs(abs(value) / full - count) < max(LIMITS.bias_of_gravity, own / full):
            yield Finding(
                "implausible",
                f"{name} is {'gravity itself' if count == 1 else 'twice gravity'}.",
                "",
                (name,),
                action="Was the output set to zero at rest, or does the sensor stand upside down?",
            )


def _of_scales(rows: Sequence[tuple[str, float, float]], scales: Mapping[str, float]) -> Iterator[Finding]:
    """Findings about scale factors that cannot be, one for those that are off alike."""
    off: dict[tuple[str, int], list[tuple[str, float, float]]] = {}
    for name, value, u in rows:
        about = scales[name]
        size = abs(about) or abs(value)
        over = value / about if about else math.copysign(1.0, value) * math.copysign(1.0, about)
        if u > LIMITS.scale_off * max(size, abs(value)):
            text = f"{name} = {value:.2g} ± {2.0 * u:.2g}: the recording fixes no scale."
            action = "Turn or tilt this axis further, both ways, within the range of the sensor."
            yield Finding("implausible", text, "", (name,), action=action)
        elif abs(over - 1.0) - 2.0 * u / size > LIMITS.scale_off:
            off.setdefault((name.rpartition("_")[0], _kind(over)), []).append((name, value, over))
    for alike in off.values():
        names = tuple(name for name, *_ in alike)
        plain = all(scales[name] in (0.0, 1.0) for name in names)
        sizes = counted_names([f"{value if plain else over:.4g}" for _, value, over in alike])
        said = sizes if plain else f"{sizes} times what is expected"
        yield off_scale(counted_names(names), said, alike[0][2], harm=names)


def _kind(over: float) -> int:
    """Place in `_OFF` of what is wrong with an output that is ``over`` times what it should be."""
    if abs(over) < LIMITS.scale_off:
        return 0
    if any(abs(over / size - 1.0) < LIMITS.range_off for size in _RANGES):
        return 1
    return 2 if over < 0.0 else 3


_OFF = (
    (
        "channel_swap",
        "not following its axis",
        "Check the order of the axes, the mounting, and whether the channel works.",
    ),
    (
        "unit_suspect",
        "as if the sensor had another range",
        "Check range and unit of this output, and the time stamps of a gyro.",
    ),
    (
        "sign_suspect",
        "negative",
        "Check the sign of this axis, the heading, and the sense in which the joints turn.",
    ),
    ("implausible", "more than a tenth off what it can be", "Check units, signs and the order of the axes."),
)
"""Code, words and action."""


def off_scale(name: str, size: str, over: float, where: str = "", harm: tuple[str, ...] = ()) -> Finding:
    """The finding about a scale factor, or an output, that is ``over`` times what it should be; ``size`` says it in
    words, such as "0.505"."""
    code, words, action = _OFF[_kind(over)]
    are = "are" if len(harm) > 1 else "is"
    return Finding(code, f"{name} {are} {size}, {words}.", where, harm or (name,), action=action)


def beyond_prior(
    names: Sequence[str], off: Array, u: Array, prior_u: Array, risk: float
) -> Iterator[Finding]:
    """The finding about values so far ``off`` (p,) what a study states of them that its uncertainty ``prior_u`` (p,)
    cannot be; ``risk`` is shared by all.

    A value that leans on its prior differs from it with a variance of prior_u^2 - u^2 only.
    """
    from scipy.special import ndtri

    told = np.isfinite(prior_u) & (prior_u > 0.0)
    if not told.any():
        return
    limit = -float(ndtri(0.5 * risk / int(told.sum())))
    with np.errstate(invalid="ignore"):
        free = np.sqrt(np.maximum(prior_u**2 - u**2, LIMITS.least_freedom**2 * prior_u**2))
        far = told & (np.abs(off) > limit * free)
    if far.any():
        worst = int(np.argmax(np.where(far, np.abs(off) / np.where(told, prior_u, 1.0), 0.0)))
        yield Finding(
            "prior_suspect",
            f"{names[worst]} is {abs(off[worst]) / prior_u[worst]:.2g} times its stated uncertainty away from what is "
            "stated.",
            "",
            tuple(name for name, is_far in zip(names, far.tolist(), strict=True) if is_far),
            action="Check units and signs, or state a larger uncertainty.",
            items=tuple(
                {"value": names[k], "off, in stated uncertainties": float(off[k] / prior_u[k])}
                for k in np.flatnonzero(far).tolist()
            ),
        )
