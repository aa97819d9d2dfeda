"""Findings about a recording or a result, and the verdict that programs test."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any


class Harm(enum.Enum):
    """Harm of a code: an effect outside the model may shift a value by more than its u."""

    NEVER = "never"
    BY_SIZE = "by size"
    ALWAYS = "always"


@dataclass(frozen=True)
class Code:
    """Meaning of a code, and the harm of its findings.

    ``rank`` orders codes that may cause residuals that are too large, 1 the likeliest; 0 explains none. ``gross``: the
    fault is one of unit, order, sign or time, for which a result is another one.
    """

    meaning: str
    harm: Harm
    rank: int = 0
    gross: bool = False


_NEVER, _BY_SIZE, _ALWAYS = Harm

#: codes are a contract; more may be added
CODES: dict[str, Code] = {
    "gap": Code("samples are missing", _NEVER, rank=15),
    "duplicate_time": Code("a time stamp is repeated", _NEVER),
    "backward_time": Code("time runs backward", _NEVER),
    "outlying_time": Code("a time stamp is wrong, and set aside", _NEVER),
    "nan": Code("values are missing or not numbers", _NEVER),
    "bad_row": Code("rows that cannot be read as numbers", _NEVER),
    "truncated": Code("the file ends within a row", _NEVER),
    "file_changed": Code("a file was written to while it was read", _NEVER),
    "saturation": Code("a sensor sits at an extreme of its range", _BY_SIZE, rank=8),
    "dead_channel": Code("a channel never changes", _BY_SIZE, rank=6),
    "no_data": Code("a stretch of a recording repeats one row", _BY_SIZE),
    "held_samples": Code("each value stands for several rows", _NEVER),
    "rate_change": Code("the sample rate changes", _NEVER, rank=7),
    "other_clock": Code("channels have clocks of their own", _NEVER),
    "unit_suspect": Code("the values do not fit the stated unit", _BY_SIZE, rank=1, gross=True),
    "sign_suspect": Code("an axis looks reversed", _BY_SIZE, rank=3, gross=True),
    "channel_swap": Code("axes look exchanged", _BY_SIZE, rank=2, gross=True),
    "stuck_encoder": Code("an angle stands still while the instrument turns", _BY_SIZE, rank=5),
    "command_shift": Code("commanded and measured motion are shifted in time", _BY_SIZE, rank=4, gross=True),
    "wrap_2pi": Code("an angle jumps by a full turn", _NEVER),
    "at_prior": Code("a parameter is no better known than before the measurement", _NEVER),
    "gimbal_lock": Code("two axes of the gimbals come close to each other", _BY_SIZE),
    "restless_start": Code("the instrument is not at rest at the start, or restless there", _NEVER),
    "outlier": Code("single samples far from their neighbours", _BY_SIZE, rank=16),
    "contradiction": Code("sensors contradict each other", _BY_SIZE, rank=14),
    "gyro_missing": Code("there are no gyro channels, or they cannot be calibrated", _NEVER),
    "gyro_restless": Code("the gyro is too restless in the holds to help in finding them", _NEVER),
    "g_sensitivity": Code("the gyro output changes with the pose", _BY_SIZE),
    "bias_drift": Code("a bias drifts over the recording", _BY_SIZE),
    "between_runs": Code("a coefficient changes from run to run by more than its uncertainty", _NEVER),
    "several_instruments": Code("repeat runs look like runs of different instruments", _ALWAYS),
    "rate_suspect": Code("a stated rate of a table does not fit the others", _BY_SIZE),
    "rate_without_u": Code(
        "a sample rate was typed without an uncertainty, or time stamps are taken as exact", _BY_SIZE
    ),
    "stated_exact": Code("a quantity of the study was stated without an uncertainty", _NEVER),
    "considered": Code("an effect that is not fitted counts in u, by its usual size", _NEVER),
    "unused_labels": Code("labels of a recording that were of no use", _NEVER),
    "temperature_kink": Code("an output jumps or bends at a temperature", _BY_SIZE),
    "hysteresis": Code("values on rising and on falling temperature or input differ", _NEVER),
    "dead_zone": Code("an output does not follow small changes of its input", _NEVER),
    "outside_range": Code("a value is stated outside the range it was measured over", _ALWAYS),
    "excess_scatter": Code(
        "the scatter of the residuals exceeds what the sensor noise explains", _BY_SIZE, rank=12
    ),
    "few_degrees_of_freedom": Code("hardly more data than unknowns", _NEVER),
    "resolution": Code(
        "steps of the output hide its noise, or numbers have more digits than can be kept", _NEVER
    ),
    "poor_section": Code("a section of the recording does not hold what it should", _BY_SIZE),
    "turn_cut": Code("a turn goes on beyond its section", _BY_SIZE),
    "turn_doubtful": Code("which motion is a turn is not certain", _NEVER),
    "outlying_pose": Code("a static pose lies off what all others say", _BY_SIZE),
    "outlying_section": Code("a section lies off what all others say", _BY_SIZE),
    "sections_contradict": Code("sections contradict what is said of them", _ALWAYS, rank=24),
    "large_placing": Code("a section lies far off the direction or axis that is said of it", _BY_SIZE),
    "one_setup": Code("several rates about one side are taken to be placed anew each time", _BY_SIZE),
    "by_prior": Code("terms rest on what was known before rather than on the data", _NEVER),
    "placing_by_prior": Code("placing is rather what is usual than found", _NEVER),
    "scatter_by_prior": Code("a scatter is rather what is usual than found", _NEVER),
    "outlying_turn": Code("a turn lies off what all others say", _BY_SIZE),
    "unmodelled_k2": Code(
        "second-order coefficients of the accelerometers are not fitted, and show or rule u", _BY_SIZE
    ),
    "skipped_turn": Code("a turn was left out of the fit", _NEVER),
    "stated_earth_rate": Code("earth rate is subtracted and its terms are not fitted", _NEVER),
    "uncertain_site": Code(
        "gravity or earth rate is known so badly that it rules the uncertainties", _BY_SIZE
    ),
    "whole_turns": Code(
        "the angle of a turning axis is not known, and whole turns are taken for granted", _NEVER
    ),
    "weak_term": Code("a term is hardly known", _NEVER),
    "noise_misfit": Code("the noise is not of the kinds that are fitted", _NEVER),
    "by_order": Code("readings depend on when they were taken", _BY_SIZE, rank=29),
    "by_place": Code("readings depend on where an input stands, beside the model", _BY_SIZE, rank=25),
    "by_reading": Code("an output is distorted by its own size", _BY_SIZE, rank=26),
    "by_history": Code("readings depend on what came before", _BY_SIZE, rank=27),
    "row_order": Code("readings fit much better in another order of the rows", _ALWAYS, rank=28, gross=True),
    "row_copies": Code("rows are exact copies of others at other inputs", _ALWAYS, rank=32),
    "coarse_output": Code("an output has steps larger than its scatter", _BY_SIZE, rank=31),
    "implausible": Code("a value is outside what it can be", _ALWAYS, rank=30),
    "large_errors": Code("errors of the table are so large that more than their squares matters", _ALWAYS),
    "trend": Code("outputs or scale factors change over the test", _BY_SIZE, rank=18),
    "warm_up": Code("outputs settle over the test", _BY_SIZE, rank=19),
    "heading_suspect": Code("outputs respond to the east rate", _BY_SIZE, rank=17),
    "level_suspect": Code("the base looks tilted", _BY_SIZE, rank=20),
    "angle_harmonic": Code("an angle errs with its own harmonics", _BY_SIZE, rank=21),
    "approach_hysteresis": Code(
        "readings depend on the sense in which a position is reached", _BY_SIZE, rank=22
    ),
    "ground_field": Code("outputs respond to a field that is fixed to the ground", _BY_SIZE, rank=23),
    "blind": Code("what a plan cannot exclude, though it would shift a value", _NEVER),
    "weak_test": Code("faults that would shift a value and that the residuals would not show", _NEVER),
    "not_stated": Code("a file does not state what a calibration should", _BY_SIZE),
    "not_held": Code("something of a calibration is not taken along", _NEVER),
    "other_frame": Code("the axes are not those of the calibration", _NEVER),
    "no_coefficients": Code("nothing is known of the instrument by which table errors act", _NEVER),
    "not_at_rest": Code("the instrument moves, or is disturbed, where it should be at rest", _BY_SIZE),
    "bad_verdict": Code("a calibration that is used ended with a bad verdict", _ALWAYS),
    "calibration_left_out": Code("calibrations that are not ok do not count in a history", _NEVER),
    "undated": Code("a calibration does not say when it was measured", _NEVER),
    "other_model": Code("two calibrations are not of the same kind", _ALWAYS),
    "same_recording": Code("two calibrations rest on the same recording", _NEVER),
    "goal_missed": Code("a coefficient is less well known than wanted", _NEVER),
    "flexure": Code("the support of the model shakes its sensors", _BY_SIZE),
    "wide_flexure": Code("the support shakes the model beyond its usual flexure, which u allows for", _NEVER),
    "wide_gyro_scale": Code("a gyro's scale is beyond its usual prior, which u allows for", _NEVER),
    "band_limited": Code("vibration is taken out of the sensors, motion above the band with it", _NEVER),
    "beyond_limits": Code("an angle is beyond the limits that the study states", _NEVER),
    "rectification": Code("vibration makes an offset of the accelerometers", _BY_SIZE),
    "unmodelled": Code("the recording shows errors that the model leaves out", _BY_SIZE, rank=9),
    "site_suspect": Code("earth rate or gravity does not fit the stated site", _BY_SIZE, rank=10),
    "turn_noise": Code("attitude and velocity over turns close less well than the stated noise says", _NEVER),
    "low_scatter": Code("the scatter of the residuals is below what the stated noise explains", _NEVER),
    "prior_suspect": Code("a value is far outside what its prior allows", _ALWAYS, rank=11),
    "filter_fails": Code("an estimator fails on a sound recording", _ALWAYS, rank=13),
    "estimators_differ": Code("two estimators of one model differ by too much of u", _BY_SIZE),
    "perhaps_common": Code("sources that may act alike in two calibrations", _NEVER),
    "failed_case": Code("a case of the validation did not pass", _NEVER),
}


def causes(findings: Iterable[Finding]) -> list[Finding]:
    """Those of the findings that explain residuals too large, the likeliest first."""
    explaining = [each for each in findings if CODES[each.code].rank]
    return sorted(explaining, key=lambda each: CODES[each.code].rank)


def settled(findings: Iterable[Finding], *codes: str) -> tuple[Finding, ...]:
    """The findings, those of these codes without harm: what they say was left out of the fit, or corrected."""
    return tuple(replace(each, harm=()) if each.code in codes else each for each in findings)


EVERYTHING = ("*",)
"""The ``harm`` of a finding that may shift every value; an estimate puts its own names in its place."""


_UNSTATED = ("?",)


@dataclass(frozen=True)
class Finding:
    """One thing worth knowing: a code of `CODES`, what it is and how bad, what to do about it, and where it was seen.

    The ``headline`` has at most 20 words, no semicolon and no list; the ``action`` as many, and names a key, an option
    or an act, and is empty only where nothing can be done. ``items`` are the rows of a table, a text or number [SI or
    the unit of its heading] by heading, for pages and JSON.

    ``harm`` names what an effect outside the model may shift by more than its u: parameters, ``theta`` of angles,
    channels of a recording, or `EVERYTHING`. Always empty for a code that never does harm, and `EVERYTHING` if absent
    for any other: who finds something that does no harm says so by an empty one.
    """

    code: str
    headline: str
    where: str = ""
    harm: tuple[str, ...] = _UNSTATED
    action: str = field(default="", kw_only=True)
    items: tuple[Mapping[str, str | float], ...] = field(default=(), kw_only=True, hash=False)

    def __post_init__(self) -> None:
        """Refuse a code that is not in the table, and harm that its code rules out."""
        if self.code not in CODES:
            raise ValueError(f"unknown finding code {self.code!r}")
        never = CODES[self.code].harm is Harm.NEVER
        if self.harm is _UNSTATED or (CODES[self.code].harm is Harm.ALWAYS and not self.harm):
            object.__setattr__(self, "harm", () if never else EVERYTHING)
        if never and self.harm:
            raise ValueError(f"findings of the code {self.code!r} do no harm, found {self.harm}")

    @property
    def message(self) -> str:
        """Headline and action in one text."""
        if not self.action:
            return self.headline
        return f"{self.headline}{' ' if self.headline.endswith('.') else ': '}{self.action}"

    @property
    def line(self) -> str:
        """All but the items, for one line of a terminal."""
        return f"{self.code}: {self.message}{f' ({self.where})' if self.where else ''}"

    @property
    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Headings and rows of the items as texts, numbers with three digits; no headings without items."""
        heads = tuple(dict.fromkeys(head for item in self.items for head in item))
        return heads, [tuple(_cell(item.get(head, "")) for head in heads) for item in self.items]

    def to_json(self) -> dict[str, Any]:
        """The finding as plain objects, its message among them."""
        return {
            "code": self.code,
            "headline": self.headline,
            "action": self.action,
            "items": [dict(item) for item in self.items],
            "message": self.message,
            "where": self.where,
            "harm": [name for name in self.harm if name not in EVERYTHING],
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Finding:
        """The inverse of `to_json`; until version 0.2.0 the message was all there was, and is the headline then.

        Raises KeyError, TypeError or ValueError where something is missing or is not what it should be.
        """
        return cls(
            data["code"],
            data["headline"] if "headline" in data else data["message"],
            data["where"],
            tuple(data.get("harm", ())),
            action=data.get("action", ""),
            items=tuple(dict(item) for item in data.get("items", ())),
        )


def _cell(value: Any) -> str:
    """A text, or a number with three digits."""
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def most_harmful(findings: Iterable[Finding]) -> list[Finding]:
    """The findings, those first that may shift most values, gross faults ahead of all; of those that shift none, gross
    faults, then what asks for something."""

    def order(finding: Finding) -> tuple[bool, float, bool, bool]:
        values = math.inf if finding.harm == EVERYTHING else len(finding.harm)
        gross = CODES[finding.code].gross
        return not (gross and finding.harm), -values, not gross, not finding.action

    return sorted(findings, key=order)


def with_alternatives(finding: Finding, others: Iterable[str]) -> Finding:
    """The finding with ``others``, headlines of what explains the recording as well: counted in its headline, and named
    in its items."""
    named = [each for each in dict.fromkeys(others) if each != finding.headline]
    if not named:
        return finding
    count = "1 other cause is" if len(named) == 1 else f"{len(named)} other causes are"
    return replace(
        finding,
        headline=f"{finding.headline.removesuffix('.')} ({count} equally possible)",
        items=(*finding.items, *({"equally possible": each} for each in named)),
    )


class Status(enum.Enum):
    """Verdict on an estimate. The value is the code of the JSON result; codes are a contract."""

    OK = "ok"
    SUSPECT = "suspect"
    ILL_CONDITIONED = "ill_conditioned"
    NOT_CONVERGED = "not_converged"
    INCONSISTENT = "inconsistent"
    UNOBSERVABLE = "unobservable"
    TOO_FEW_INTERVALS = "too_few_intervals"

    @property
    def meaning(self) -> str:
        """One sentence: what this verdict says."""
        return _MEANING[self]

    @property
    def done(self) -> bool:
        """True where there are numbers to be used, though perhaps with care: ``ok`` and ``suspect``."""
        return self in (Status.OK, Status.SUSPECT)


_MEANING = {
    Status.OK: "the estimate is sound",
    Status.SUSPECT: "an effect outside the model may shift some values by more than their uncertainty",
    Status.ILL_CONDITIONED: "the data fix some combination of the parameters only weakly",
    Status.NOT_CONVERGED: "the iteration ended before it reached a minimum",
    Status.INCONSISTENT: "the data contradict the model or the stated noise",
    Status.UNOBSERVABLE: "the data say nothing about some combination of the parameters",
    Status.TOO_FEW_INTERVALS: "too few static intervals were found to fit the model",
}
