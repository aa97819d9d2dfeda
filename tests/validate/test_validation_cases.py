"""Every case of the validation passes as things are, and turns red when what it checks is wrong."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from inercal.faces.convert import other_tools
from inercal.faces.validate import aoa, foundation, imu, selfcal, strapdown, turntable
from inercal.faces.validate.case import SOURCES, Case, Numbers, find, judge
from inercal.faces.validate.run import SYSTEMS, cases_of, validate
from inercal.foundation.computing.executors import Serial
from inercal.foundation.findings import Status
from inercal.foundation.geometry import earth, rotations
from inercal.foundation.noise import deviation
from inercal.systems.aoa.paper import lever
from inercal.systems.selfcal.platform import rig
from rows import for_each

CASES = [case for system in SYSTEMS for case in cases_of(system)]


class Kept:
    """All systems in this process (pages run them in several), and what they found by the number of the system."""

    def __init__(self):
        self.found = {}

    def map(self, work, chunks):
        for chunk, results in Serial().map(work, chunks):
            self.found[chunk[0]] = results
            yield chunk, results


@pytest.fixture(scope="module")
def whole():
    """One run of the whole, and what each case found by its name."""
    kept, told = Kept(), []
    estimate = validate(kept, lambda done, total: told.append((done, total)))
    found = {
        case.name: each
        for number, system in enumerate(SYSTEMS)
        for case, each in zip(cases_of(system), kept.found[number], strict=True)
    }
    return estimate, found, told


@pytest.mark.slow
def test_all_pass(whole):
    estimate, _, told = whole
    assert [row["name"] for row in estimate.result["cases"] if not row["passed"]] == []
    assert estimate.status is Status.OK
    assert told[-1] == (len(CASES), len(CASES))
    assert told == sorted(told)


def test_each_says_what_it_shows_and_from_where():
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) >= 40
    for case in CASES:
        assert re.fullmatch(r"[a-z0-9-]{4,20}", case.name)
        assert case.shows
        assert not case.shows.endswith(".")
        limit = np.asarray(case.limit, dtype=float)
        assert np.all(np.isfinite(limit))
        assert np.all(limit >= 0.0)
        assert np.all(np.isfinite(np.asarray(case.expected, dtype=float)))
    assert {case.source for case in CASES} == SOURCES.keys()


@pytest.mark.slow
@for_each("case", CASES)
def test_any_number_that_is_wrong_fails(whole, case):
    """Each expected number in turn is moved by more than twice its limit, up and down: none is without effect."""
    found = whole[1][case.name]
    expected = np.asarray(case.expected, dtype=float).ravel()
    limit = np.broadcast_to(np.asarray(case.limit, dtype=float).ravel(), expected.shape)
    for k in range(0, len(expected), max(1, len(expected) // 40)):
        for sign in (-1.0, 1.0):
            moved = expected.copy()
            moved[k] += sign * (2.001 * limit[k] + 1e-12 * abs(moved[k]) + 1e-30 + (limit[k] == 0.0))
            verdict = judge(replace(case, expected=moved), found)
            assert not verdict.passed
            assert verdict.expected == moved[k]


# The judgement itself.

LINE = Case("line", "Two numbers", "closed form", [1.0, 2.0], [0.1, 0.2], lambda: [1.05, 2.19])


def test_the_number_that_is_furthest_off_in_terms_of_its_limit_is_shown():
    verdict = judge(LINE, find(LINE))
    assert verdict.passed
    assert (verdict.figure, verdict.expected, verdict.limit, verdict.count) == (2.19, 2.0, 0.2, 2)
    assert not judge(replace(LINE, limit=[0.04, 0.2]), find(LINE)).passed


@pytest.mark.parametrize("values", [[1.0, math.nan], [math.nan, math.inf], [1.0], [1.0, 2.0, 3.0], []])
def test_what_is_no_number_or_not_there_fails(values):
    verdict = judge(LINE, find(replace(LINE, find=lambda: values)))
    assert not verdict.passed
    assert not math.isfinite(verdict.figure)
    assert bool(verdict.error) == (len(values) != 2)


def test_an_exact_number_passes_a_limit_of_zero_and_no_other_does():
    exact = replace(LINE, limit=0.0)
    assert judge(exact, Numbers(np.array([1.0, 2.0]))).passed
    assert not judge(exact, Numbers(np.array([1.0, np.nextafter(2.0, 3.0)]))).passed


def test_a_case_that_raises_is_a_failure_with_one_line():
    def broken():
        raise RuntimeError("no\n  such thing")

    verdict = judge(LINE, find(replace(LINE, find=broken)))
    assert not verdict.passed
    assert verdict.error == "RuntimeError: no such thing"
    assert math.isnan(verdict.figure)


# Physics gone wrong.


def red(cases, *names):
    """Names of the cases that fail, of those given or all."""
    chosen = [case for case in cases if not names or case.name in names]
    return {case.name for case in chosen if not judge(case, find(case)).passed}


@pytest.fixture
def fresh():
    """No result of an earlier case is used, and none of this one by a later."""
    kept = [
        *(imu._calibrated, imu._session),
        *(turntable._full_circle, selfcal._study, selfcal._found, aoa._sting),
        *(strapdown._study, strapdown._found),
    ]
    for each in kept:
        each.cache_clear()
    yield
    for each in kept:
        each.cache_clear()


def test_gravity_that_is_off_by_a_part_in_a_million(monkeypatch):
    monkeypatch.setattr(earth, "_G_EQUATOR", 9.7803253359 * (1.0 + 1e-6))
    assert red(foundation.CASES) == {"wgs84-gravity"}


def test_rotations_in_the_other_order(monkeypatch):
    right = rotations.multiply
    monkeypatch.setattr(rotations, "multiply", lambda p, q: right(q, p))
    assert red(foundation.CASES) == {"rotations-combined"}


def test_least_squares_by_the_normal_equations(monkeypatch):
    """Which lose half of the digits: Longley's data were chosen to show it."""
    right = foundation.least_squares

    def normal(A, y, names):
        return replace(right(A, y, names), beta=np.linalg.solve(A.T @ A, A.T @ y))

    monkeypatch.setattr(foundation, "least_squares", normal)
    assert "nist-longley" in red(foundation.CASES)


def test_a_sum_of_squares_that_is_too_large(monkeypatch):
    right = deviation.mean_square
    monkeypatch.setattr(deviation, "mean_square", lambda sums, m: 1.0001 * right(sums, m))
    failed = red(foundation.NOISE_CASES)
    assert failed >= {"nist-nine-points", "nist-1000-points", "stable32-octaves", "ring-laser-allan"}


def test_gravity_along_the_outer_axis(monkeypatch, fresh):
    turned = tuple(replace(each, reference=each.reference[[0, 2, 1]]) for each in turntable._OUTPUTS)
    monkeypatch.setattr(turntable, "_OUTPUTS", turned)
    names = [case.name for case in turntable.CASES if case.name.startswith("zhao")]
    assert len(red(turntable.CASES, *names)) >= 4


def test_a_lever_arm_of_the_wrong_sign(monkeypatch):
    right = lever.centrifugal_arms
    monkeypatch.setattr(lever, "centrifugal_arms", lambda layout, level: -right(layout, level))
    names = [case.name for case in aoa.CASES if not case.name.startswith("sting")]
    assert {"lever-arms", "tan-oscillation"} <= red(aoa.CASES, *names)


def test_an_earth_that_turns_backward(monkeypatch, fresh):
    monkeypatch.setattr(
        rig, "earth_rate", lambda latitude: tuple(-part for part in earth.earth_rate(latitude))
    )
    assert "platform-truth" in red(selfcal.CASES, "platform-truth")


@pytest.mark.slow
def test_an_earth_that_turns_backward_under_a_strapdown_unit(monkeypatch, fresh):
    monkeypatch.setattr("inercal.systems.strapdown.fit.batch.EARTH_RATE", -earth.EARTH_RATE)
    assert "rests-psins-truth" in red(strapdown.CASES, "rests-psins-truth")


def test_a_tool_whose_matrix_is_transposed(monkeypatch, fresh):
    right = other_tools.CONVENTIONS["kalibr"]

    def transposed(files):
        terms, units = right.parse(files)
        return {name: value.T if value.ndim == 2 else value for name, value in terms.items()}, units

    monkeypatch.setitem(other_tools.CONVENTIONS, "kalibr", replace(right, parse=transposed))
    names = [case.name for case in imu.CASES if case.name.startswith("through")]
    assert red(imu.CASES, *names) == {"through-kalibr"}
