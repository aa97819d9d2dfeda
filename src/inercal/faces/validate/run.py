"""All cases of the validation: run, judged, and put into one estimate without parameters.

The systems share two processes: where kernels are compiled meanwhile, no two threads can do it at a time.
"""

from __future__ import annotations

import math
import os
import platform
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any, cast

from inercal import __version__
from inercal.examples import EXAMPLES, shipped
from inercal.faces.report.html import page as template
from inercal.faces.validate import foundation
from inercal.faces.validate.case import SOURCES, USED, Case, Numbers, Outcome, find, judge
from inercal.foundation._jit import source_hash, way
from inercal.foundation.computing.executors import Executor, Processes, Serial
from inercal.foundation.findings import Finding, Status
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.results.shown import aligned
from inercal.systems import listed

SYSTEMS: Mapping[str, str] = {
    "foundation": "units, rotations, gravity, least squares",
    "noise": "Allan deviation and coefficients of noise",
    **{kind: system.shows for kind, system in listed.SYSTEMS.items()},
}
"""Groups of cases, in the order of the floors, and what they are about."""

_LIBRARIES = ("numpy", "scipy")


def cases_of(system: str) -> Sequence[Case]:
    """The cases of a system, or of the floors below the systems."""
    below = {"foundation": foundation.CASES, "noise": foundation.NOISE_CASES}
    return below[system] if system in below else listed.SYSTEMS[system].cases()


def executor() -> Executor:
    """Two processes, or this one where there is a single processor."""
    return Processes(2) if (os.cpu_count() or 1) > 1 else Serial()


def validate(executor: Executor, progress: Callable[[int, int], None] | None = None) -> Estimate:
    """Run all cases; ``progress`` is told how many are done, of how many, after each system.

    The estimate has no parameters. Its status is ok where all cases passed, else inconsistent, and the message names
    those that did not. ``result`` holds ``cases``, in the form of the JSON contract; ``provenance`` versions, machine
    and the checksum of the package's sources.
    """
    began = time.perf_counter()
    systems = list(SYSTEMS)
    cases = {system: cases_of(system) for system in systems}
    total, done = sum(map(len, cases.values())), 0
    numbers: dict[str, list[Numbers]] = {}
    # the last systems compile longest: one each for the two processes, and the small ones after them
    chunks = [range(k, k + 1) for k in reversed(range(len(systems)))]
    for chunk, results in executor.map(cast(Any, _find_all), chunks):
        system = systems[chunk[0]]
        numbers[system] = cast(list[Numbers], results)
        done += len(cases[system])
        if progress is not None:
            progress(done, total)
    rows = [
        _row(system, case, judge(case, each))
        for system in systems
        for case, each in zip(cases[system], numbers[system], strict=True)
    ]
    failed = [row["name"] for row in rows if not row["passed"]]
    sources = {row["source"]: SOURCES[row["source"]] for row in rows}
    basis = Basis(
        "validate",
        "a case passes where every number found is within its limit of the number expected",
        traceability={"date": datetime.now(UTC).isoformat(timespec="seconds")},
        inputs=tuple(shipped(file) for name in USED for file in EXAMPLES[name].records),
        provenance={"versions": _versions(), "machine": _machine(), "sources_sha256": source_hash()},
        references=tuple(f"{short}: {full}" for short, full in sources.items()),
    )
    estimate = Estimate.without(
        basis,
        Status.INCONSISTENT if failed else Status.OK,
        f"{len(failed)} of {total} cases failed: {', '.join(failed)}"
        if failed
        else f"all {total} cases passed",
        findings=tuple(_finding(row) for row in rows if not row["passed"]),
        result={"cases": rows, "systems": dict(SYSTEMS), "sources": sources},
    )
    return timed(estimate, began)


def _find_all(numbers: Iterable[int]) -> list[Numbers]:
    """Results of the cases of some systems, by number."""
    systems = list(SYSTEMS)
    return [find(case) for number in numbers for case in cases_of(systems[number])]


def _row(system: str, case: Case, outcome: Outcome) -> dict[str, Any]:
    """A case as the JSON result has it."""
    return {
        "name": case.name,
        "passed": outcome.passed,
        "figure": outcome.figure,
        "expected": outcome.expected,
        "limit": outcome.limit,
        "unit": case.unit or "1",
        "numbers": outcome.count,
        "system": system,
        "shows": case.shows,
        "source": case.source,
        "seconds": outcome.seconds,
        "error": outcome.error,
    }


def _finding(row: Mapping[str, Any]) -> Finding:
    """Why a case did not pass."""
    numbers = "found {figure:.9g}, expected {expected:.9g} within {limit:.2g}".format(**row)
    return Finding("failed_case", f"{row['name']}: {row['error'] or numbers}")


def _versions() -> dict[str, str]:
    """Versions of the package, of Python, and of the libraries that compute; and how kernels run."""
    return {
        "inercal": __version__,
        "python": platform.python_version(),
        **{name: version(name) for name in _LIBRARIES},
        "kernels": f"numba {version('numba')}" if way().how == "numba" else way().how,
    }


def _machine() -> dict[str, Any]:
    """Machine that computed the numbers."""
    return {
        "system": platform.platform(),
        "processor": platform.processor() or platform.machine(),
        "processors": os.cpu_count() or 1,
    }


_HEAD = ("", "case", "found", "expected", "", "unit", "source")
_WORDS = (0, 1, 4, 5, 6)


def table(estimate: Estimate) -> str:
    """The cases as aligned text, one a line; of each the number that is furthest off in terms of its limit."""
    rows = estimate.result["cases"]
    lines = [_HEAD] + [
        (
            "pass" if row["passed"] else "FAIL",
            row["name"],
            *_numbers(row)[:2],
            f"± {_numbers(row)[2]}",
            "" if row["unit"] == "1" else row["unit"],
            row["source"],
        )
        for row in rows
    ]
    texts = aligned(lines, _WORDS, " ")
    reasons = ["", *(f"  {row['error']}" if row["error"] else "" for row in rows)]
    return "\n".join(text + reason for text, reason in zip(texts, reasons, strict=True))


def _numbers(row: Mapping[str, Any]) -> tuple[str, str, str]:
    """Found, expected and limit as texts, the first two to the first digit of the limit."""
    figure, expected, limit = row["figure"], row["expected"], row["limit"]
    return _shown(figure, expected, limit), _shown(expected, expected, limit), f"{limit:.2g}"


def _shown(value: float, expected: float, limit: float) -> str:
    """A number to the first digit of the limit; an error, where 0 is expected, to two digits of its own."""
    if not math.isfinite(value):
        return "–"
    if expected == 0.0 or limit == 0.0:
        return f"{value:.2g}"
    places = -math.floor(math.log10(limit))
    if places > 10 and abs(value) < 1e-3:
        return f"{value:.{max(0, places + math.floor(math.log10(abs(value) or limit)))}e}"
    return f"{value:.{max(0, places)}f}"


def page(estimate: Estimate) -> str:
    """The page of a validation: HTML that needs nothing but itself, with places to sign."""
    result, made = estimate.result, estimate.provenance
    rows = result["cases"]
    return template(
        "validation.html",
        estimate,
        "Validation of inercal",
        [
            ("date", "", estimate.traceability["date"]),
            ("software", "", ", ".join(f"{name} {text}" for name, text in made["versions"].items())),
            ("sources, SHA-256", "", made["sources_sha256"]),
            ("machine", "", made["machine"]["system"]),
        ],
        systems=[
            (words, [(row, *_numbers(row)) for row in rows if row["system"] == system])
            for system, words in result["systems"].items()
        ],
    )
