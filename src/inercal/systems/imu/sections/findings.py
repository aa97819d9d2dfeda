"""Findings about a calibration from sections, and its verdict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import chdtrc

from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.inference.plausible import beyond_prior, implausible
from inercal.foundation.records.places import counted, counted_names
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.sections.calibration import SectionCalibration, gross
from inercal.systems.imu.sections.cutting.checks import direction
from inercal.systems.imu.sections.judged import judged_sections
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.unknowns import G

_WORDS = {
    "acc": "accelerometers",
    "gyro": "gyro",
    "acc session": "bias of the accelerometers from session to session",
    "gyro session": "bias of the gyro from session to session",
}


def findings_of(found: SectionCalibration, priors: Priors) -> tuple[Finding, ...]:
    """All that a calibration says of its sections and of itself; ``priors`` are those that were stated."""
    return (
        *_contradictions(found),
        *_values(found, priors),
        *_rates(found),
        *(judged_sections(found) if found.converged and not gross(found) else ()),
        *(() if found.problem.extras else _outlying(found)),
        *_scatters(found),
        *_placing(found),
        *_exact(found),
        *_g_sensitivity(found),
        *_by_prior(found),
    )


def verdict(found: SectionCalibration, before: Sequence[Finding]) -> tuple[Status, str]:
    """Status and message of a calibration; ``before`` are findings of checks before the fit."""
    sections = counted(len(found.problem.readings.sections), "section")
    if before:
        return Status.INCONSISTENT, before[0].message
    if not found.converged:
        return Status.NOT_CONVERGED, f"the search from {sections} ended before it reached a minimum"
    values = _values(found, found.problem.priors)
    against = [*_contradictions(found), *(one for one in values if one.code == "sign_suspect")]
    if against:
        return Status.INCONSISTENT, against[0].message
    return Status.OK, f"{len(found.names)} coefficients from {sections}"


def _section(found: SectionCalibration, k: int) -> str:
    """A section in words."""
    section = found.problem.readings.sections[k]
    return section.name or f"section {k + 1}"


def _contradictions(found: SectionCalibration) -> Iterator[Finding]:
    """Sections that contradict what is said of them."""
    sections = found.problem.readings.sections
    if found.converged and gross(found):
        sigmas = found.placed_sigmas.max(axis=1)
        items: tuple[dict[str, str | float], ...] = tuple(
            {"section": _section(found, k), "off its place [deg]": math.degrees(found.placed[k].max())}
            for k in np.argsort(-sigmas)[:3].tolist()
            if sigmas[k] > 0.0
        )
        lone = float(found.outlying.min()) < LIMITS.contradiction or not items
        worst = int(np.argmin(found.outlying) if lone else np.argmax(sigmas))
        wide = max(found.beyond, key=lambda name: found.beyond[name], default="")
        if found.probability < LIMITS.contradiction:
            p = f"p = {found.probability:.1g}"
            text = f"Sections contradict what is said of them ({p}), most of all {_section(found, worst)}."
        else:
            what = "placing" if wide == "placing" else f"means of the {_WORDS.get(wide, wide)}"
            where = f"Sections contradict each other, most of all {_section(found, worst)}"
            text = f"{where}: {what} would scatter more than in any instrument."
        yield Finding(
            "sections_contradict",
            text,
            sections[worst].where,
            EVERYTHING,
            action="Check names, units and signs of these sections, or leave one out.",
            items=items,
        )


def _expected(size: Size | None) -> float:
    """A scale factor beforehand; where its size is not known 0, by its sign."""
    if size is None:
        return 0.0
    return size.median if math.isfinite(size.spread) else math.copysign(0.0, size.median)


def _values(found: SectionCalibration, priors: Priors) -> Iterator[Finding]:
    """Values that cannot be: exchanged sides and other units leave no other trace."""
    sizes = {"K1": priors.acc_scale, "S": priors.gyro_scale}
    scales = {
        name: _expected(sizes[head]) for name in found.names if (head := name.rpartition("_")[0]) in sizes
    }
    angles = [name for name in found.names if name.startswith(("M_", "T_"))]
    g = priors.site.gravity
    full = {f"K0_{axis}": g * found.value(f"K1_{axis}")[0] for axis in "xyz" if f"K0_{axis}" in found.names}
    yield from implausible(found.names, found.x, found.u, scales, angles, full)
    if priors.k2 and np.isfinite(priors.k2):
        squares = [k for k, name in enumerate(found.names) if name.startswith("K2_")]
        names = [found.names[k] for k in squares]
        of_prior = np.full(len(squares), priors.k2)
        yield from beyond_prior(names, found.x[squares], found.u[squares], of_prior, INFERENCE.value_risk)


def _rates(found: SectionCalibration) -> Iterator[Finding]:
    """The rate that fits the others least, where the sum of squares of all sections hides how little."""
    group = max(found.pulled_rates, key=lambda name: abs(found.pulled_rates[name]), default="")
    if group and chdtrc(len(found.pulled_rates), found.pulled_rates[group] ** 2) < LIMITS.contradiction:
        size = abs(found.pulled_rates[group])
        yield Finding(
            "rate_suspect",
            f"Rates contradict each other: that of {group} differs by {size:.1f} times what was stated.",
            group,
            EVERYTHING,
            action="Check order, values and u of the rates, and linearity and g-sensitivity of the gyro.",
            items=tuple(
                {"rate": name, "off [of its u]": round(float(pull), 1)}
                for name, pull in found.pulled_rates.items()
            ),
        )


def _outlying(found: SectionCalibration) -> Iterator[Finding]:
    """The section that lies farthest off all others, left out in turn."""
    p = found.outlying
    k = int(np.argmin(p))
    if p[k] < IMU_LIMITS.outlier_risk / len(p):
        yield Finding(
            "outlying_section",
            f"{_section(found, k)} lies off what all other sections say (p = {p[k]:.1g}).",
            found.problem.readings.sections[k].where,
            EVERYTHING,
            action="Was the instrument moving, or placed otherwise? Leave the section out, or measure it again.",
        )


def _scatters(found: SectionCalibration) -> Iterator[Finding]:
    """Scatters beyond the stated noise, or known by hardly more than a guess."""
    if found.widened > 1.0:
        yield Finding(
            "excess_scatter",
            f"Sections miss what is said of them by {found.widened:.2g} times its uncertainty, and u allows for it.",
            harm=(),
            action="State what is known of directions, rates and noise with the uncertainty that it has.",
        )
    for sensor in sorted(found.excess):
        yield Finding(
            "excess_scatter",
            f"The means of the {_WORDS[sensor]} scatter by more than their stated noise explains, and u allows for it.",
            harm=(),
            action="State the noise of the means, or look for what moved or warmed the instrument.",
        )
    for name, dof in found.scatter_dof.items():
        if dof < LIMITS.fewest_scatter_dof:
            what = "placing" if name == "placing" else f"scatter of the {_WORDS.get(name, name)}"
            act = f"Measure a second round, or state the {'placing' if name == 'placing' else 'noise of the means'}."
            yield Finding(
                "placing_by_prior" if name == "placing" else "scatter_by_prior",
                f"The {what} is rather what is usual than found: {counted(round(dof), 'degree')} of freedom.",
                action=act,
            )


def _placing(found: SectionCalibration) -> Iterator[Finding]:
    """Sections far off their places, and rates about one side that nobody says were one setup."""
    angles = found.placed.max(axis=1)
    large = np.flatnonzero(angles > LIMITS.large_placing).tolist()
    if large:
        worst = int(np.argmax(angles))
        yield Finding(
            "large_placing",
            f"{_section(found, worst)} lies {math.degrees(angles[worst]):.0f} deg off its place.",
            found.problem.readings.sections[worst].where,
            EVERYTHING,
            action="Correct its direction or axis, or leave the section out.",
            items=tuple(
                {"section": _section(found, k), "off its place [deg]": math.degrees(found.placed[k].max())}
                for k in large
            ),
        )
    alone: dict[str, int] = {}
    for section in found.problem.readings.sections:
        if (
            section.kind == "rate"
            and section.axis is not None
            and not section.setup
            and section.axis_u != 0.0
        ):
            axis = direction(section.axis)[1]
            alone[axis] = alone.get(axis, 0) + 1
    axes = sorted(axis for axis, count in alone.items() if count > 1)
    if axes:
        yield Finding(
            "one_setup",
            f"Several rates about {counted_names(axes)} are taken to be placed anew each time.",
            harm=(),
            action="Give those between which the instrument was not touched the same setup.",
        )


def _exact(found: SectionCalibration) -> Iterator[Finding]:
    """Rates and angles that were stated without an uncertainty."""
    for kind, what, example in (("rate", "rate", "33.333(15) rpm"), ("turn", "angle", "361.338(5) deg")):
        exact = [
            section
            for section in found.problem.readings.sections
            if section.kind == kind and getattr(section, what) and not getattr(section, f"{what}_u")
        ]
        if exact:
            yield Finding(
                "stated_exact",
                f"The {what} of {counted(len(exact), 'section')} is taken as exact: S is too sure by what it is not.",
                counted_names([section.name for section in exact]),
                action=f'State it with its uncertainty, such as "{example}".',
            )


def _g_sensitivity(found: SectionCalibration) -> Iterator[Finding]:
    """The g-sensitivity of a gyro that looks like its scale, where specific force during steady rates is not known."""
    readings, scales = found.problem.readings, [f"S_{axis}" for axis in "xyz" if f"S_{axis}" in found.names]
    blind = readings.whole & readings.seen[:, 2].any(axis=1) & ~readings.has_force
    if not scales or not blind.any() or np.any(found.problem.sd[G] > 0.0):
        return
    sure = min(u / abs(value) for value, u, _ in map(found.value, scales))
    slowest = float(np.min(np.abs(readings.rate[blind])))
    yield Finding(
        "g_sensitivity",
        f"Specific force is not known: a g-sensitivity of {math.degrees(sure * slowest):.2g} deg/s per g would shift "
        "the scale factors by their u.",
        harm=(),
        action="Turn faster, or about a level axis, on which it averages out.",
    )


def _by_prior(found: SectionCalibration) -> Iterator[Finding]:
    """Terms of which the sections say less than what was known before."""
    names = (*found.by_prior, *found.leaning)
    if names:
        few = "is by" if len(names) == 1 else "are by"
        yield Finding(
            "by_prior",
            f"{counted(len(names), 'term')} {few} what was known before more than by the sections, or lean on it.",
            action="Add sections that show these terms, or take them for what they are.",
            items=tuple(
                {"term": name, "by": "what was known" if name in found.by_prior else "both"} for name in names
            ),
        )
