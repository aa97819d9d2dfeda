"""Design of the sensors of a model: where n accelerometers sit and look best, and how good they must be.

Two bounds, along the motion of the study. Sample by sample, as the paper works, the readings of one row tell the angle
and the angular acceleration: with the covariance C of their errors (`inercal.aoa.paper.residuals.error_terms`), h their
slopes by the angle and p by the angular acceleration (the arms),

    1 / u^2 = h C^-1 h - (h C^-1 p)^2 / (p C^-1 p)

which no unbiased estimate from one row betters. For the axes -z, +x, +z it holds that of the paper: the angular
acceleration is known to sqrt(2) dA / L, so that the base line L matters. With a filter: the covariance of the fusion
along the motion without noise, where it is linearised at the truth, which is the bound of Cramer and Rao for its model.

The search takes the first bound of all layouts (or exchanges one accelerometer after another, where they are too many),
and ranks the best of them by the second.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np

from inercal.aoa.fusion.filter_result import estimate
from inercal.aoa.fusion.problem import problem
from inercal.aoa.layout import AXES, Layout, axes, tangential_arms
from inercal.aoa.limits import LIMITS
from inercal.aoa.motion import course, duration
from inercal.aoa.paper.residuals import error_terms
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import AoaSettings
from inercal.aoa.simulate import simulate
from inercal.arrays import Array
from inercal.errors import StudyError
from inercal.estimate.rounding import short
from inercal.estimate.table import Table, heads
from inercal.findings import Finding
from inercal.units import STANDARD_GRAVITY

REFERENCES = (
    "Tan et al., Large angle-of-attack measurement architecture for wind-tunnel models based on inertial technology "
    "(2021)",
    "H. L. Van Trees, Detection, Estimation, and Modulation Theory, Part I, Wiley (1968), section 2.4",
)

_ROWS = 40
"""Instants of the motion at which the bound of a sample is taken."""

_MOST_LAYOUTS = 8000
"""Layouts up to which all are tried."""

_RANKED = 6
"""Layouts that are ranked by the bound of the fusion."""

_LONGEST = 20.0
"""Time [s] of the motion along which the fusion's bound is computed."""

_NO_NOISE = 1e-9
"""Part of the noise that is left in a recording for the bound."""

_FACTORS = (1e-2, 1e2)
"""Accelerometers that are looked at: times better and worse than stated."""

_QUALITIES = 13
"""So many of them."""

_BASE_LINES = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Parts of the best layout's positions whose bounds are shown."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A layout with its bounds [rad]: ``sample`` rms over the motion, ``fusion`` rms after it settled; NaN if not
    computed."""

    layout: Layout
    sample: float
    fusion: float = math.nan


@dataclass(frozen=True, eq=False)
class Designed:
    """The ``best`` of the layouts, the ``stated`` one of the study, and the ``ranked`` ones.

    ``factor``: times the stated noise and bias of the accelerometers with which the best layout reaches the wanted u;
    NaN without a goal, or where none reaches it. ``base_lines``: parts of the best positions, and the bounds there.
    ``qualities``: times the stated noise and bias of the accelerometers, and u [rad] of the best layout by the fusion.
    """

    best: Candidate
    stated: Candidate
    ranked: tuple[Candidate, ...]
    base_lines: tuple[tuple[float, Candidate], ...]
    qualities: tuple[tuple[float, float], ...]
    factor: float
    message: str
    result: dict[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def tables(self) -> list[Table]:
        """Layouts by rank with the stated one, and the base lines."""
        rows = [("best", *_cells(self.best))]
        rows += [(f"{k}.", *_cells(each)) for k, each in enumerate(self.ranked[1:], start=2)]
        rows.append(("as stated", *_cells(self.stated)))
        columns = heads("", "accelerometers", "u, fusion [deg]", "u, one sample [deg]")
        caption = (
            "u of the angle along the motion, by the fusion and from single samples, with the stated sensors."
        )
        lines = [(f"{part:g}", _deg(each.fusion), _deg(each.sample)) for part, each in self.base_lines]
        of_lines = heads("positions times", "u, fusion [deg]", "u, one sample [deg]")
        return [
            Table("Layouts", caption, columns, tuple(rows), 2),
            Table("Base line", "The best layout drawn in towards the pivot.", of_lines, tuple(lines), 1),
        ]


def design(settings: AoaSettings, progress: Callable[[str], None] = lambda _: None) -> Designed:
    """The best layout of the accelerometers that the study's design asks for.

    Raises `StudyError` without a motion, or where no layout shows the angle.
    """
    plan, motion = settings.design, settings.motion
    if motion is None:
        raise StudyError("motion", "missing, expected the motion to design the sensors for")
    count = plan.accelerometers or len(settings.layout.names)
    states = courses_of(settings)
    places = np.linspace(plan.rearmost, plan.foremost, plan.places)
    spots = [(AXES[axis], float(r)) for axis in plan.axes for r in places]
    if count > len(spots):
        raise StudyError(
            "design.accelerometers", f"found {count}, expected {len(spots)} at most: axes times places"
        )
    progress("trying layouts")
    found = _search(settings, spots, count, states)
    if not found:
        raise StudyError("design", "found no layout that shows the angle, expected more places or axes")
    progress("bounds of the fusion")
    ranked = sorted(
        (replace(each, fusion=fusion_bound(settings, each.layout)) for each in found[:_RANKED]),
        key=lambda each: each.fusion,
    )
    best = ranked[0]
    stated = Candidate(
        settings.layout,
        sample_bound(settings, settings.layout, states),
        fusion_bound(settings, settings.layout),
    )
    lines = []
    for part in _BASE_LINES:
        drawn = replace(best.layout, r=best.layout.r * part)
        lines.append(
            (part, Candidate(drawn, sample_bound(settings, drawn, states), fusion_bound(settings, drawn)))
        )
    progress("how good they must be")
    factors = np.geomspace(*_FACTORS, _QUALITIES).tolist()
    qualities = tuple((each, fusion_bound(_times(settings, each), best.layout)) for each in factors)
    return _designed(settings, best, stated, tuple(ranked), tuple(lines), qualities)


def sample_bound(settings: AoaSettings, layout: Layout, states: tuple[Array, Array, Array]) -> float:
    """Rms u [rad] of the angle from single samples at angles, rates and accelerations (m,) each; inf where they do not
    show it."""
    theta, rate, acceleration = states
    level = settings.attitude.level
    terms = error_terms(settings, "dual", layout, level, rate, acceleration, np.ones(len(theta)), 1.0)
    C = sum(np.multiply.outer(np.broadcast_to(weight, theta.shape), matrix) for weight, matrix in terms)
    of_axes = axes(layout, level)
    h = settings.site.gravity * (
        np.outer(np.cos(theta), of_axes[:, 0]) - np.outer(np.sin(theta), of_axes[:, 1])
    )
    p = np.broadcast_to(tangential_arms(layout, level), h.shape)
    both = np.stack([h, p], axis=-1)
    information = both.transpose(0, 2, 1) @ np.linalg.solve(np.asarray(C), both)
    tt, ta, aa = information[:, 0, 0], information[:, 0, 1], information[:, 1, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        left = tt - np.where(aa > 0.0, ta**2 / aa, 0.0)
        u2 = np.where(left > _NO_NOISE * tt, 1.0 / left, np.inf)
    return math.sqrt(float(u2.mean()))


def fusion_bound(settings: AoaSettings, layout: Layout) -> float:
    """Rms u [rad] of the angle by the fusion along the study's motion, of 20 s at most, after it settled."""
    return settled_u(settings, layout, undisturbed(settings, layout))


def undisturbed(settings: AoaSettings, layout: Layout) -> Recording:
    """The study's motion, of 20 s at most, as sensors without noise would record it."""
    assert settings.motion is not None
    lasting = min(duration(settings.motion), _LONGEST)
    motion = (
        settings.motion
        if settings.motion.kind == "pitch-pause"
        else replace(settings.motion, duration=lasting)
    )
    of = replace(settings, layout=layout, motion=motion)
    noise = settings.noise
    quiet = replace(noise, accelerometer=noise.accelerometer * _NO_NOISE, gyro=noise.gyro * _NO_NOISE)
    made = simulate(
        replace(of, noise=quiet, disturbances=type(of.disturbances)()), np.random.default_rng(0), {}
    )
    return made.recording


def settled_u(settings: AoaSettings, layout: Layout, recording: Recording) -> float:
    """Rms u [rad] of the angle by the fusion along a recording without noise, after it settled."""
    # a bound holds nothing back
    of = replace(settings, layout=layout, estimator=replace(settings.estimator, gate=math.inf))
    filtered = estimate(recording, problem(of), settings.estimator.smooth)
    u = filtered.u[(recording.t >= LIMITS.settling_time) & np.isfinite(filtered.u)]
    return math.sqrt(float(np.mean(np.square(u)))) if len(u) else math.inf


def courses_of(settings: AoaSettings) -> tuple[Array, Array, Array]:
    """Angles, rates and accelerations of the motion at some instants."""
    assert settings.motion is not None
    t = np.linspace(0.0, duration(settings.motion), _ROWS, endpoint=False)
    return course(settings.motion, np.random.default_rng(0))(t)


def _layout(spots: Iterable[tuple[float, float]]) -> Layout:
    """Accelerometers at (axis, position)."""
    angle, r = np.array(list(spots)).T
    return Layout(tuple(f"a{k}" for k in range(1, len(r) + 1)), angle, r, np.zeros(len(r)))


def _search(
    settings: AoaSettings,
    spots: Sequence[tuple[float, float]],
    count: int,
    states: tuple[Array, Array, Array],
) -> list[Candidate]:
    """Layouts by the bound of a sample, the best first."""
    if math.comb(len(spots), count) <= _MOST_LAYOUTS:
        chosen: Iterable[tuple[int, ...]] = combinations(range(len(spots)), count)
    else:
        chosen = _exchanged(settings, spots, count, states)
    found = []
    for each in chosen:
        layout = _layout(spots[k] for k in each)
        if layout.spans:
            bound = sample_bound(settings, layout, states)
            if math.isfinite(bound):
                found.append(Candidate(layout, bound))
    return sorted(found, key=lambda each: each.sample)


def _exchanged(
    settings: AoaSettings,
    spots: Sequence[tuple[float, float]],
    count: int,
    states: tuple[Array, Array, Array],
) -> list[tuple[int, ...]]:
    """Layouts at which no exchange of one accelerometer helps, from random starts."""
    rng, ends = np.random.default_rng(0), set()

    def bound(chosen: Sequence[int]) -> float:
        layout = _layout(spots[k] for k in chosen)
        return sample_bound(settings, layout, states) if layout.spans else math.inf

    for _ in range(_RANKED):
        chosen = [int(k) for k in rng.choice(len(spots), count, replace=False)]
        value, better = bound(chosen), True
        while better:
            better = False
            for place in range(count):
                for other in range(len(spots)):
                    if other in chosen:
                        continue
                    changed = [*chosen[:place], other, *chosen[place + 1 :]]
                    if (trial := bound(changed)) < value * (1.0 - 1e-9):
                        chosen, value, better = changed, trial, True
        ends.add(tuple(sorted(chosen)))
    return sorted(ends)


def _designed(
    settings: AoaSettings,
    best: Candidate,
    stated: Candidate,
    ranked: tuple[Candidate, ...],
    lines: tuple[tuple[float, Candidate], ...],
    qualities: tuple[tuple[float, float], ...],
) -> Designed:
    """The design with its words; how good the sensors must be, where the study wants a u."""
    wanted, noise = settings.goal.theta, settings.noise
    factor, findings = math.nan, []
    words = f"{_words(best.layout)}: u {_deg(best.fusion)} deg, as stated {_deg(stated.fusion)} deg"
    if wanted is not None:
        factor = _factor(settings, best.layout, wanted, qualities)
        if math.isnan(factor):
            left = min(u for _, u in qualities)
            text = (
                f"no accelerometers reach the wanted {_deg(wanted)} deg: with perfect ones {_deg(left)} deg are "
                "left, of positions, gyro and motion: state these better under [prior] and [noise]"
            )
            findings.append(Finding("goal_missed", text))
        else:
            words += (
                f"; for {_deg(wanted)} deg noise of {_ug(noise.accelerometer * factor)} and bias of "
                f"{_ug(noise.accelerometer_bias * factor)}"
            )
    result = {
        "wanted": wanted,
        "best": _record(best),
        "stated": _record(stated),
        "ranked": [_record(each) for each in ranked],
        "base_lines": [{"part": part, **_record(each)} for part, each in lines],
        "qualities": [{"times": times, "u": _finite(u)} for times, u in qualities],
        "accelerometer": None if math.isnan(factor) else noise.accelerometer * factor,
        "accelerometer_bias": None if math.isnan(factor) else noise.accelerometer_bias * factor,
    }
    return Designed(best, stated, ranked, lines, qualities, factor, words, result, tuple(findings))


def _factor(
    settings: AoaSettings, layout: Layout, wanted: float, qualities: Sequence[tuple[float, float]]
) -> float:
    """Largest factor on noise and bias of the accelerometers at which the fusion knows the angle as wanted; NaN where
    none does."""
    reached = [k for k, (_, u) in enumerate(qualities) if u <= wanted]
    if not reached:
        return math.nan
    last = reached[-1]
    if last == len(qualities) - 1:
        return qualities[-1][0]
    low, high = math.log(qualities[last][0]), math.log(qualities[last + 1][0])
    while high - low > 0.02:
        middle = 0.5 * (low + high)
        if fusion_bound(_times(settings, math.exp(middle)), layout) <= wanted:
            low = middle
        else:
            high = middle
    return math.exp(low)


def _times(settings: AoaSettings, factor: float) -> AoaSettings:
    """The study with accelerometers so many times worse."""
    noise = settings.noise
    return replace(
        settings,
        noise=replace(
            noise,
            accelerometer=noise.accelerometer * factor,
            accelerometer_bias=noise.accelerometer_bias * factor,
        ),
    )


def study_tables(layout: Layout) -> str:
    """A layout as the tables of a study."""
    lines = []
    for name, angle, r in zip(layout.names, layout.angle.tolist(), layout.r.tolist(), strict=True):
        lines += [f"[sensors.{name}]", f'axis = "{_axis(angle)}"', f'r = "{1e3 * r:.10g} mm"', ""]
    return "\n".join(lines)


def _record(of: Candidate) -> dict[str, Any]:
    """A layout in a result."""
    each = zip(of.layout.angle.tolist(), of.layout.r.tolist(), of.layout.z.tolist(), strict=True)
    sensors = [{"angle_rad": angle, "r_m": r, "z_m": z} for angle, r, z in each]
    return {"sensors": sensors, "u": _finite(of.fusion), "u_sample": _finite(of.sample)}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _cells(of: Candidate) -> tuple[str, str, str]:
    return _words(of.layout), _deg(of.fusion), _deg(of.sample)


def _words(layout: Layout) -> str:
    """A layout in words: ``-z -250 mm, +x 0 mm``."""
    each = zip(layout.angle.tolist(), layout.r.tolist(), strict=True)
    return ", ".join(f"{_axis(angle)} {1e3 * r:.4g} mm" for angle, r in each)


def _axis(angle: float) -> str:
    """The name of an axis, or its angle."""
    for name, of in AXES.items():
        if abs(math.remainder(angle - of, 2.0 * math.pi)) < 1e-9:
            return name
    return f"{math.degrees(angle):.4g} deg"


def _deg(value: float) -> str:
    """An angle [rad] in degrees."""
    return short(math.degrees(value)) if math.isfinite(value) else "–"


def _ug(value: float) -> str:
    """An acceleration in g."""
    return f"{1e6 * value / STANDARD_GRAVITY:.3g} ug"
