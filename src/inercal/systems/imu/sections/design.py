"""Design of sections: what a list of them would tell before anything is recorded, and what one more would.

The covariance of the fit at nominal values needs no data. Candidates are a rest on each side and between sides, a turn
and a rate about each axis, and a move between rests that follow each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import TERMS, shown_unit
from inercal.foundation.records.places import counted
from inercal.foundation.results.shown import Table, heads, short
from inercal.foundation.units import Quantity
from inercal.systems.imu.identified import pose_words
from inercal.systems.imu.sections.arrow import Linear
from inercal.systems.imu.sections.calibration import ruled_by_prior, shares_of
from inercal.systems.imu.sections.course import Pace
from inercal.systems.imu.sections.cutting.table import SectionRow, quantity_of, stated_rows
from inercal.systems.imu.sections.fit import shortened
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.missing import Missing, missing
from inercal.systems.imu.sections.moves import move_rows
from inercal.systems.imu.sections.outcome import placed, stated_priors
from inercal.systems.imu.sections.outputs import centred, rows
from inercal.systems.imu.sections.planned import Planned, move_between, planned
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import Iterate, problem_of, with_classes
from inercal.systems.imu.sections.unknowns import COEFFICIENTS
from inercal.systems.imu.settings import ImuSettings, SectionsSettings

REFERENCES: Final = ("V. V. Fedorov, Theory of Optimal Experiments, Academic Press (1972)",)

_MOST: Final = 1e3
"""Factor by which a section more helps at most, for one that first makes a term observable."""

_ALIKE: Final = 3
"""Rests, and moves, in the table of sections more."""


@dataclass(frozen=True, eq=False)
class Foretold:
    """Expected u [SI] of the coefficients by name, those that stay ``by_prior``, and what is known of each before."""

    u: Mapping[str, float]
    by_prior: tuple[str, ...]
    prior: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class OneMore:
    """A section more, in words: expected u [SI] with it by name, and by which factor that falls."""

    section: str
    u: Mapping[str, float]
    factors: Mapping[str, float]

    @property
    def mean(self) -> float:
        """The geometric mean of the factors."""
        return float(np.exp(np.mean(np.log(list(self.factors.values())))))


@short_repr
@dataclass(frozen=True, eq=False)
class DesignedSections:
    """Coefficients that ``count`` sections tell, and sections more, those that help most first.

    ``lacking`` is what they leave open, and what to add.
    """

    count: int
    foretold: Foretold
    candidates: tuple[OneMore, ...]
    lacking: Missing | None = None

    @property
    def message(self) -> str:
        """The answer in a line."""
        if self.lacking is not None:
            what = ", ".join(self.lacking.terms)
            return f"the sections would leave {what} open: add {self.lacking.cure}"
        told = len(self.foretold.u) - len(self.foretold.by_prior)
        best = self.candidates[0]
        return (
            f"{counted(self.count, 'section')} would tell {told} of {counted(len(self.foretold.u), 'coefficient')}; "
            f"{best.section} more would help most, u falls to {best.mean:.2g} of itself on average"
        )

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Terms that stay by prior."""
        if not self.foretold.by_prior:
            return ()
        names = ", ".join(self.foretold.by_prior)
        return (
            Finding(
                "by_prior",
                f"{counted(len(self.foretold.by_prior), 'term')} would stay by prior: {names}."
                if len(self.foretold.by_prior) < 7
                else f"{len(self.foretold.by_prior)} terms would stay by prior.",
                "",
                (),
                action="State what the data sheet says (imu.k2, imu.g_sensitivity), or add the section named for each.",
            ),
        )

    @property
    def result(self) -> dict[str, Any]:
        """The command's part of the JSON result, in SI."""
        return {
            "sections": self.count,
            "predicted": dict(self.foretold.u),
            "by_prior": list(self.foretold.by_prior),
            "open": [] if self.lacking is None else list(self.lacking.terms),
            "candidates": [
                {"section": one.section, "factor": one.mean, "predicted": dict(one.u)}
                for one in self.candidates
            ],
        }

    @property
    def shown(self) -> tuple[OneMore, ...]:
        """Sections more for people: of rests and moves, of which many are alike, the best few."""
        seen: dict[str, int] = {}
        shown = []
        for one in self.candidates:
            alike = one.section.split(" with ")[0].split(" from ")[0]
            seen[alike] = seen.get(alike, 0) + 1
            if seen[alike] <= _ALIKE:
                shown.append(one)
        return tuple(shown)

    def best_for(self, name: str) -> OneMore | None:
        """The section more that helps a term most; None where none helps."""
        best = min(self.candidates, key=lambda one: one.factors.get(name, 1.0), default=None)
        return None if best is None or best.factors.get(name, 1.0) > LIMITS.least_help else best

    def tables(self) -> list[Table]:
        """Coefficients with what would help each, and sections more."""
        rows = []
        for name, u in self.foretold.u.items():
            unit, size = _unit(name)
            best = self.best_for(name)
            rows.append(
                (
                    name,
                    "open" if self.lacking is not None and name in self.lacking.terms else short(u / size),
                    unit,
                    "prior" if name in self.foretold.by_prior else "sections",
                    "–" if best is None else best.section,
                    "–" if best is None else short(best.u[name] / size),
                )
            )
        more = [
            (
                one.section,
                f"{one.mean:.3g}",
                ", ".join(
                    f"{name} {factor:.2g}"
                    for name, factor in sorted(one.factors.items(), key=lambda pair: pair[1])[:3]
                    if factor < LIMITS.least_help
                ),
            )
            for one in self.shown
        ]
        return [
            Table(
                "Coefficients",
                "Standard uncertainty that the sections would give, what it rests on, and the section more that would "
                "help the term most.",
                heads("term", "u", "unit", "by", "one more", "u then"),
                tuple(rows),
                1,
            ),
            Table(
                "One section more",
                "Factor by which u falls: of all terms in the geometric mean, and of the three it helps most.",
                heads("section", "all", "most"),
                tuple(more),
                1,
            ),
        ]


def design(settings: ImuSettings, options: SectionsSettings) -> DesignedSections:
    """Judge the sections that a study states; without any, poses in the hand with moves between them.

    Raises `StudyError` for one that cannot be planned.
    """
    table = stated_rows(options) or _in_the_hand(settings.simulation.poses)
    if not any(row.kind not in ("swing", "move") for row in table):
        raise StudyError("imu.sections", "found no rest, rate or turn, expected a table of sections to judge")
    sizes = {sensor: Size(1.0, 0.05) for sensor in ("acc", "gyro")}
    priors, of = stated_priors(settings, sizes), settings.simulation
    placing = priors.placing.median if options.placing is None else options.placing
    pace = Pace(of.hold, of.turning, placing, options.level)
    plan = planned(table, pace, priors, of)
    plan = replace(plan, sections=tuple(placed(section, options) for section in plan.sections))
    told = _foretold(plan, priors)
    assert told is not None
    candidates = []
    for words, more in _more(table, plan, pace, priors, settings, options):
        after = _foretold(more, priors)
        if after is not None:
            factors = {
                name: float(np.clip(u / told.u.get(name, after.prior[name]), 1.0 / _MOST, 1.0))
                for name, u in after.u.items()
            }
            candidates.append(OneMore(words, after.u, factors))
    lacking = missing(plan.sections, priors, _extras(plan, priors))
    return DesignedSections(
        len(plan.sections), told, tuple(sorted(candidates, key=lambda one: one.mean)), lacking
    )


def _in_the_hand(poses: int) -> tuple[SectionRow, ...]:
    """Rests of which nothing is known, and moves between them."""
    pairs = ((SectionRow(f"rest {k}"), SectionRow(f"move {k}", kind="move")) for k in range(1, poses + 1))
    return tuple(itertools.chain.from_iterable(pairs))[:-1]


def _extras(plan: Planned, priors: Priors) -> tuple[Any, ...]:
    """Rows of the moves of a plan."""
    return (move_rows(len(plan.sections), list(plan.moves), priors),) if plan.moves else ()


def _foretold(plan: Planned, priors: Priors) -> Foretold | None:
    """The covariance of the fit at nominal values; None where it has none."""
    problem = problem_of(plan.sections, priors, _extras(plan, priors))
    r = problem.readings
    noise = {
        sensor: float(np.sqrt(np.median(r.variance[:, kinds][r.seen[:, kinds]])))
        for sensor, kinds in (("acc", [0, 1]), ("gyro", [2]))
        if r.seen[:, kinds].any()
    }
    problem = with_classes(problem, noise)
    up = np.array(
        [one.up if one.up is not None else _way(one.acc, r.up[k]) for k, one in enumerate(r.sections)]
    )
    axis = np.array(
        [one.axis if one.axis is not None else _way(one.gyro, r.axis[k]) for k, one in enumerate(r.sections)]
    )
    up = np.where(r.tied[:, None] & ~r.forced[:, None] | r.forced[:, None], r.up, up)
    none = np.zeros((len(up), 2))
    point = centred(problem, Iterate(problem.mean.copy(), up, axis, np.zeros((len(up), 3, 3)), none, none))
    linear = Linear(problem, point.x, rows(problem, point))
    z = np.array([np.log(size.median) for size in problem.sizes.values()])
    try:
        point = shortened(problem, point, linear, linear.at(z), z, whole=False)
        linear = Linear(problem, point.x, rows(problem, point))
        best = linear.at(z)
    except LinAlgError:
        return None
    count = int(np.sum(linear.shared < len(COEFFICIENTS)))
    at = linear.shared[:count]
    u, sd = np.sqrt(np.abs(np.diag(best.covariance)[:count])), problem.sd[at]
    ruled = ruled_by_prior(u, sd, shares_of(problem, linear, best, z, np.eye(count)))
    names = [COEFFICIENTS[p] for p in at]
    return Foretold(
        dict(zip(names, u.tolist(), strict=True)),
        tuple(name for name, flag in zip(names, ruled, strict=True) if flag),
        dict(zip(names, sd.tolist(), strict=True)),
    )


def _way(vector: np.ndarray | None, usual: np.ndarray) -> np.ndarray:
    """The direction (3,) of outputs of a sound unit."""
    size = 0.0 if vector is None else float(np.linalg.norm(vector))
    return usual if vector is None or size == 0.0 else np.asarray(vector / size)


def _more(
    table: Sequence[SectionRow],
    plan: Planned,
    pace: Pace,
    priors: Priors,
    settings: ImuSettings,
    options: SectionsSettings,
) -> Iterator[tuple[str, Planned]]:
    """The plan with each candidate, in words."""
    rests = [one for one in plan.sections if one.kind == "rest"]
    told = not rests or any(one.up is not None for one in rests)
    for words, row in _rows(table):
        more = planned([row], pace, priors, settings.simulation)
        (section,) = (placed(one, options) for one in more.sections)
        if row.kind == "rest" and not told:
            section = replace(section, up=None)
        yield words, Planned((*plan.sections, section), (*plan.ends, *more.ends), plan.moves)
    there = {(move.first, move.last) for move in plan.moves}
    for k, (one, other) in enumerate(itertools.pairwise(plan.sections)):
        if one.kind == other.kind == "rest" and (k, k + 1) not in there:
            move = move_between(k, k + 1, (plan.ends[k][1], plan.ends[k + 1][0]), pace.turning, priors)
            moves = tuple(sorted((*plan.moves, move), key=lambda each: each.first))
            yield f"a move from {one.name} to {other.name}", replace(plan, moves=moves)


def _rows(table: Sequence[SectionRow]) -> Iterator[tuple[str, SectionRow]]:
    """Candidates that are sections: angles and rates are those of the table, where it has some."""
    for way in itertools.product((1.0, 0.0, -1.0), repeat=3):
        count = sum(map(abs, way))
        if count in (1.0, 2.0):
            words = pose_words(np.array(way))
            yield f"a rest with {words} up", SectionRow("more", up=np.array(way) / np.sqrt(count))
    angle, rate = _usual(table, "angle"), _usual(table, "rate")
    for letter, axis in zip("xyz", np.eye(3), strict=True):
        turn = SectionRow("more", kind="turn", up=axis, axis=axis, angle=angle)
        yield f"a turn of {angle.text} about {letter}", turn
        spin = SectionRow("more", kind="rate", up=axis, axis=axis, rate=rate)
        yield f"a rate of {rate.text} about {letter}", spin


def _usual(table: Sequence[SectionRow], name: str) -> Quantity:
    """The first angle, or rate, of a table, else one as by hand, or of a plain rate table."""
    said = [getattr(row, name) for row in table if getattr(row, name) is not None]
    if said:
        first: Quantity = said[0]
        return first
    if name == "angle":
        return quantity_of(2.0 * np.pi, np.radians(1.0), "deg")
    return quantity_of(np.radians(30.0), np.radians(0.03), "deg/s")


def _unit(name: str) -> tuple[str, float]:
    """The unit of a coefficient for people, and how many of the SI unit it is."""
    si = TERMS[name].unit_for("m/s^2" if name.startswith(("K", "M")) else "rad/s")
    of_itself = si in ("(m/s^2)/(m/s^2)", "(rad/s)/(rad/s)")
    return shown_unit("1") if of_itself else shown_unit(si)
