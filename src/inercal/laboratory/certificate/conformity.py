"""Statements of conformity: which coefficients are within their tolerances, by the rule that the laboratory states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from inercal.foundation.errors import InputError
from inercal.laboratory.certificate.elements import dcc, number, of_result, words
from inercal.laboratory.specification import Conformity, Specification

if TYPE_CHECKING:
    from lxml.etree import _Element

    from inercal.foundation.results.result import Estimate


def limits_used(specification: Specification, estimates: Sequence[Estimate], where: object) -> None:
    """Refuse limits of a coefficient that no result has."""
    names = {name for estimate in estimates for name in estimate.names}
    for key in specification.without_value(names):
        raise InputError(
            where, f"specification.{key}: found limits of what no result has, expected one of {_some(names)}"
        )


def _some(names: set[str]) -> str:
    """A few names."""
    return ", ".join(sorted(names)[:8])


def stated(found: Conformity, unit: str) -> _Element:
    """The conformity of one coefficient, with its limits, as metadata of its quantity."""
    ends = (
        dcc("quantity", words("name", name), of_result(limit, unit), ref_type=f"basic_acceptanceLimit{end}")
        for name, end, limit in (
            ("Lower limit", "Lower", found.low),
            ("Upper limit", "Upper", found.high),
        )
    )
    said = (
        f"By {found.rule}; probability that the true value is within the limits: {number(found.probability)}"
    )
    return dcc(
        "measurementMetaData",
        dcc(
            "metaData",
            words("declaration", said),
            dcc("conformity", _verdict(found)),
            dcc("data", *ends),
            ref_type="basic_conformity",
        ),
    )


def _verdict(found: Conformity) -> str:
    """The verdict in the words of the schema."""
    return "pass" if found.verdict == "conform" else "fail"


def statement(specification: Specification, found: Sequence[Conformity]) -> _Element:
    """The statement on all coefficients that have limits, with the rule of decision."""
    all_pass = all(_verdict(each) == "pass" for each in found)
    rules = {
        "simple acceptance": "a value conforms where it is within its limits",
        "guard band": "a value conforms where it is within its limits by U at least",
    }
    rule = rules.get(
        specification.rule, "a value conforms where the true one is outside with that probability at most"
    )
    verdict = "all conform" if all_pass else "not all conform"
    said = f"{len(found)} coefficients have limits; {verdict}. The rule is {specification.rule}: {rule}."
    return dcc(
        "statement",
        dcc("norm", "ILAC-G8:09/2019"),
        dcc("reference", "ISO/IEC 17025:2017, 7.8.6"),
        words("declaration", said),
        dcc("conformity", "pass" if all_pass else "fail"),
        ref_type="basic_conformity",
    )
