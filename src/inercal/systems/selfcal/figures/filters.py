"""Pictures of a self-calibration: gimbals, attitude, bounds beside the estimates, filters beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inercal.faces.report.courses import panels_of_lines, path, turning
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.rig import DrawnTriad, DrawnTurn, rig
from inercal.faces.report.style import ALARM, COLOURS, QUIET, plain_unit, power_of_ten
from inercal.foundation.arrays import Array
from inercal.foundation.results.shown import rounded
from inercal.systems.selfcal.platform.rig import JOINTS, Base, Gimbals
from inercal.systems.selfcal.result.comparison import attitude_errors as errors_of

_MARKS = "osD^vP"


def path_of(t: Array, th: Array, title: str, caption: str) -> Picture:
    """Gimbal angles (n, 3) [rad] over ``t`` (n,) [s], coloured by the joint that turns."""
    text = (
        f"{caption}; the background has the colour of the joint that turns: th_x the outer, th_y the inner one, th_z "
        "the platform's."
    )
    return path(t, th, JOINTS, title, text)


def gimbals_on_base(base: Base, gimbals: Gimbals) -> Picture:
    """Three gimbals on their base at zero angles: outer, inner and platform axis, and the axes of the platform."""
    to_geographic = base.from_geographic().T
    joints = [
        DrawnTurn(name, sign * to_geographic[:, "xyz".index(axis)])
        for name, axis, sign in zip(JOINTS, gimbals.axes, gimbals.signs, strict=True)
    ]
    return rig(
        "Axes and signs of the gimbals",
        "The gimbals at zero angles as the study states them: th_x turns the outer gimbal, th_y the inner one, th_z "
        "the platform, each plus along its arrow; X_p, Y_p, Z_p the axes of the platform. Compare with the rig: an "
        "axis in another place or an angle that counts the other way shows here first.",
        joints,
        DrawnTriad(("X_p", "Y_p", "Z_p"), np.asarray(to_geographic)),
    )


def changes_of_turn(t: Array, th: Array) -> list[float]:
    """Times [s] within a record at which another joint begins or ends to turn, by angles (n, 3) [rad]; those within 5 s
    are one, more than 40 none."""
    edges = sorted(edge for angle in th.T for span in turning(t, angle) for edge in span)
    apart = [edge for k, edge in enumerate(edges) if k == 0 or edge - edges[k - 1] > 5.0]
    inside = [edge for edge in apart if t[0] + 5.0 < edge < t[-1] - 5.0]
    return inside if len(inside) <= 40 else []


def attitude_errors(
    t: Array, truth: Array, attitudes: Mapping[str, Array], changes: Sequence[float] = ()
) -> Picture:
    """Errors of attitudes (n, 4), by the name of the filter, against the ``truth`` (n, 4) over ``t`` (n,) [s]; q and -q
    are one attitude. Dots at the ``changes`` [s] of the turn."""
    errors = {label: errors_of(q, truth).q for label, q in attitudes.items()}
    return _components(
        "Error of the attitude",
        "Estimated less true components of the unit quaternion of the platform's attitude; the gimbal-angle filter's "
        "angles are converted. A component is off by half the angle in radians at most.",
        t,
        errors,
        changes,
    )


def attitudes_apart(
    t: Array, first: Array, others: Mapping[str, Array], by: str, changes: Sequence[float] = ()
) -> Picture:
    """Attitudes (n, 4) of other filters less that of the ``first`` (n, 4), of the name ``by``, over ``t`` (n,) [s]."""
    return _components(
        "Attitudes of the filters apart",
        f"Components of the unit quaternion of each filter less those of {by}: what one line of the picture of errors "
        "hides under the other.",
        t,
        {label: errors_of(q, first).q for label, q in others.items()},
        changes,
    )


def _components(
    title: str, caption: str, t: Array, errors: Mapping[str, Array], changes: Sequence[float]
) -> Picture:
    """A panel for each component of ``errors`` (n, 4), by the name of the filter."""
    finite = (np.abs(e[np.isfinite(e)]) for e in errors.values())
    largest = max((float(e.max(initial=0.0)) for e in finite), default=0.0)
    power = 3 * int(np.floor(np.log10(largest) / 3.0)) if 0.0 < largest < 1e100 else 0
    unit = f" [{power_of_ten(10.0**power)}]" if power else ""
    panels = {f"q{k}{unit}": {label: e[:, k] / 10.0**power for label, e in errors.items()} for k in range(4)}
    rms = "; ".join(
        f"{label} " + ", ".join(f"{x:.1e}" for x in np.sqrt(np.nanmean(np.square(e), axis=0)))
        for label, e in errors.items()
    )
    dots = " Dotted: changes of the turn." if changes else ""
    text = f"{caption}{dots} Root mean square of q0, q1, q2, q3: {rms}."
    return panels_of_lines(title, text, t, panels, changes=changes)


def attitude_correction(
    t: Array, correction: Array, u: Array | None, changes: Sequence[float] = ()
) -> Picture:
    """Rotation (n, 3) [rad] from the encoders' attitude to the estimated one, about the axes of p, over ``t`` (n,) [s],
    with the standard uncertainties ``u`` (n, 3) [rad] of the estimate; dots at the ``changes`` [s] of the turn."""
    arcsec = np.radians(1.0 / 3600.0)
    labels = [f"about {axis}_p [″]" for axis in "XYZ"]
    panels = {
        label: {"estimate less encoders": about / arcsec}
        for label, about in zip(labels, correction.T, strict=True)
    }
    halves = {} if u is None else dict(zip(labels, 2.0 * u.T / arcsec, strict=True))
    band = " Band: ± two standard uncertainties of the estimate." if u is not None else ""
    return panels_of_lines(
        "Attitude against the encoders",
        "Rotation from the attitude that the encoders read to the estimated one, about the axes of the platform, in "
        f"seconds of arc: mostly the noise of the encoders.{band}",
        t,
        panels,
        halves,
        changes,
    )


def bounds_beside(
    names: Sequence[str], units: Sequence[str], u: Array, bound: Array, prior: Array, goal: Array
) -> Picture:
    """Standard uncertainties beside bounds and goals, over the priors (p,); all in ``units``; NaN unmarked."""
    rows = np.arange(len(names))
    marks: list[Mark] = [Strips((0.5, 1.0), ALARM, 0.08), Level(1.0, "", QUIET, 0.9, upright=True)]
    for label, own, mark, colour, size in (
        ("goal", goal, "D", COLOURS[2], 6.0),
        ("bound", bound, "s", COLOURS[1], 7.0),
        ("estimate", u, "o", COLOURS[0], 4.0),
    ):
        part = np.where(np.isfinite(own) & (own > 0.0), own, np.nan) / prior
        if np.isfinite(part).any():
            marks.append(Dots(part, rows, label, colour, mark, size, filled=mark == "o"))
    notes = [
        f"{rounded(value, value)[1]} of {own:.4g} {plain_unit(unit)}"
        if np.isfinite(value) and value > 0.0
        else ""
        for value, own, unit in zip(u, prior, units, strict=True)
    ]
    across = Axis("standard uncertainty / prior", "log")
    wanted = " Goal: what the study wants." if np.isfinite(goal).any() else ""
    return draw(
        "Uncertainties beside their bounds",
        "Standard uncertainty of each coefficient over that of its prior; at the right, both in units. Squares: the "
        "Cramér-Rao bound, the best that any filter can reach on this path with the stated noise. In the red strip "
        f"the path leaves a coefficient at its prior. A dot above its square holds other sources too.{wanted}",
        [[Panel(marks, across, Axis(names=names), notes=notes, grid="both")]],
        0.75 + 0.165 * len(names),
        where="center",
    )


def filters_apart(names: Sequence[str], apart: Mapping[str, Array], first: str) -> Picture:
    """Differences (p,) of filters from the ``first``, in its standard uncertainties."""
    finite = [np.abs(x[np.isfinite(x)]) for x in apart.values()]
    far = max((float(x.max()) for x in finite if len(x)), default=0.0)
    linear = 0.01
    top = max(1.0, min(far, 1e9))
    marks: list[Mark] = [Strips((-1.0, 1.0), alpha=0.1), Level(0.0, upright=True)]
    for k, (label, x) in enumerate(apart.items()):
        rows = np.arange(len(names)) + 0.6 * (k - 0.5 * (len(apart) - 1)) / max(len(apart), 1)
        off = np.where(np.isfinite(x), np.clip(x, -1e9, 1e9), np.nan)
        marks.append(Dots(off, rows, label, COLOURS[k % len(COLOURS)], _MARKS[k % len(_MARKS)], 3.5))
    across = Axis(f"difference from {first} / its u", "symlog", (-1.5 * top, 1.5 * top), linear=linear)
    return draw(
        "Filters against each other",
        f"Estimate of each filter less that of {first}, over the standard uncertainty of {first}; logarithmic beyond "
        f"± {linear:g}. Band: ± 1. All have the same data: good approximations lie close together.",
        [[Panel(marks, across, Axis(names=names), grid="both")]],
        0.8 + 0.17 * len(names),
        6,
        "center",
    )
