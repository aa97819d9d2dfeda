"""Pictures of a self-calibration: attitude, bounds beside the estimates, filters beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.report.histories import Line, panels_of_lines
from inercal.report.html import Picture
from inercal.report.style import (
    ALARM,
    COLOURS,
    QUIET,
    WIDTH,
    few_powers,
    figure,
    plain_unit,
    power_of_ten,
    svg,
)

_MARKS = "osD^vP"


def attitude_errors(t: Array, truth: Array, attitudes: Mapping[str, Array]) -> Picture:
    """Errors of the four components of the attitude over ``t`` (n,) [s].

    ``truth`` (n, 4) and estimates (n, 4) by the name of the filter; q and -q are one attitude.
    """
    errors = {}
    for label, q in attitudes.items():
        sign = np.where(np.sum(q * truth, axis=1) < 0.0, -1.0, 1.0)
        errors[label] = sign[:, None] * q - truth
    largest = max(
        (float(np.nanmax(np.abs(e), initial=0.0, where=np.isfinite(e))) for e in errors.values()), default=0.0
    )
    power = 3 * int(np.floor(np.log10(largest) / 3.0)) if 0.0 < largest < 1e100 else 0
    unit = f" [{power_of_ten(10.0**power)}]" if power else ""
    panels = {
        f"q{k}{unit}": [Line(label, e[:, k] / 10.0**power) for label, e in errors.items()] for k in range(4)
    }
    rms = "; ".join(
        f"{label} " + ", ".join(f"{x:.1e}" for x in np.sqrt(np.nanmean(np.square(e), axis=0)))
        for label, e in errors.items()
    )
    return panels_of_lines(
        "Error of the attitude",
        "Estimated less true components of the unit quaternion of the platform's attitude; the gimbal-angle filter's "
        f"angles are converted. A component is off by half the angle in radians at most. Root mean square of q0, q1, "
        f"q2, q3: {rms}.",
        t,
        panels,
    )


def attitude_correction(t: Array, correction: Array, u: Array | None) -> Picture:
    """Estimated attitude against the encoders' over ``t`` (n,) [s].

    ``correction`` (n, 3) [rad] rotation from the encoders' attitude to the estimated one, about the axes of p; ``u``
    (n, 3) [rad] standard uncertainties of the estimate.
    """
    arcsec = np.radians(1.0 / 3600.0)
    panels = {
        f"about {axis}_p [″]": [
            Line(
                "estimate less encoders",
                correction[:, k] / arcsec,
                None if u is None else 2.0 * u[:, k] / arcsec,
            )
        ]
        for k, axis in enumerate("XYZ")
    }
    band = " Band: ± two standard uncertainties of the estimate." if u is not None else ""
    return panels_of_lines(
        "Attitude against the encoders",
        "Rotation from the attitude that the encoders read to the estimated one, about the axes of the platform, in "
        f"seconds of arc: mostly the noise of the encoders.{band}",
        t,
        panels,
    )


def bounds_beside(
    names: Sequence[str], units: Sequence[str], u: Array, bound: Array, prior: Array, goal: Array
) -> Picture:
    """Standard uncertainties (p,) beside bounds and goals (p,), over the priors (p,); all in ``units``.

    What is NaN, as a goal that is not stated, has no mark.
    """
    places = np.arange(len(names))
    with figure(WIDTH, 0.75 + 0.165 * len(names)) as page:
        axes = page.subplots()
        axes.set_xscale("log")
        axes.axvline(1.0, color=QUIET, lw=0.9)
        axes.axvspan(0.5, 1.0, color=ALARM, alpha=0.08, lw=0)
        for label, values, mark, colour, size in (
            ("goal", goal, "D", COLOURS[2], 6.0),
            ("bound", bound, "s", COLOURS[1], 7.0),
            ("estimate", u, "o", COLOURS[0], 4.0),
        ):
            part = np.where(np.isfinite(values) & (values > 0.0), values, np.nan) / prior
            if np.isfinite(part).any():
                fill = colour if mark == "o" else "none"
                axes.plot(part, places, mark, color=colour, mfc=fill, mew=1.1, ms=size, label=label)
        axes.set_yticks(places, names, fontsize=7)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="both")
        axes.set_xlabel("standard uncertainty / prior")
        few_powers(axes.xaxis)
        axes.minorticks_off()
        for place, (value, own, unit) in enumerate(zip(u, prior, units, strict=True)):
            if np.isfinite(value) and value > 0.0:
                text = f"{rounded(value, value)[1]} of {own:.4g} {plain_unit(unit)}"
                across = axes.get_yaxis_transform()
                axes.text(1.01, place, text, transform=across, fontsize=6.5, va="center_baseline")
        page.legend(loc="outside upper center", ncols=3)
        drawn = svg(page)
    wanted = " Goal: what the study wants." if np.isfinite(goal).any() else ""
    return Picture(
        "Uncertainties beside their bounds",
        "Standard uncertainty of each coefficient over that of its prior; at the right, both in units. Squares: the "
        "Cramér-Rao bound, the best that any filter can reach on this path with the stated noise. In the red strip "
        f"the path leaves a coefficient at its prior. A dot above its square holds other sources too.{wanted}",
        drawn,
    )


def filters_apart(names: Sequence[str], apart: Mapping[str, Array], first: str) -> Picture:
    """Differences (p,) of filters from the ``first``, in its standard uncertainties."""
    finite = [np.abs(x[np.isfinite(x)]) for x in apart.values()]
    far = max((float(x.max()) for x in finite if len(x)), default=0.0)
    linear = 0.01
    with figure(WIDTH, 0.8 + 0.17 * len(names)) as page:
        axes = page.subplots()
        axes.axvspan(-1.0, 1.0, color=COLOURS[0], alpha=0.1, lw=0)
        axes.axvline(0.0, color=QUIET, lw=0.6)
        for k, (label, x) in enumerate(apart.items()):
            places = np.arange(len(names)) + 0.6 * (k - 0.5 * (len(apart) - 1)) / max(len(apart), 1)
            axes.plot(
                np.where(np.isfinite(x), np.clip(x, -1e9, 1e9), np.nan),
                places,
                _MARKS[k % len(_MARKS)],
                color=COLOURS[k % len(COLOURS)],
                ms=3.5,
                label=label,
            )
        axes.set_xscale("symlog", linthresh=linear, linscale=0.7)
        top = max(1.0, min(far, 1e9))
        powers = 10.0 ** np.arange(-2, int(np.ceil(np.log10(top))) + 1)
        powers = powers[:: max(1, -(-len(powers) // 5))]
        ticks = [*(-powers[::-1]), 0.0, *powers]
        axes.set_xticks(ticks, list(map(power_of_ten, ticks)), minor=False)
        axes.set_xticks([], minor=True)
        axes.set_xlim(-1.5 * top, 1.5 * top)
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_yticks(range(len(names)), names, fontsize=7)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel(f"difference from {first} / its u")
        axes.grid(axis="both")
        page.legend(loc="outside upper center", ncols=6)
        drawn = svg(page)
    return Picture(
        "Filters against each other",
        f"Estimate of each filter less that of {first}, over the standard uncertainty of {first}; logarithmic beyond "
        f"± {linear:g}. Band: ± 1. All have the same data: good approximations lie close together; lm, which "
        "leaves the noise of the gyros out of its fit, is a start for others and lies up to some u away.",
        drawn,
    )
