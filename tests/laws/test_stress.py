"""Laws of every run, however absurd its study and its recording: benchmarks/stress.py.

The test run makes 62 runs of each system, `make campaign` the rest of 500.

A result is finite, with a covariance that is one and a known status, or the run is refused in one sentence; nothing
warns, and nothing takes longer than 30 s. The seed was fixed before the first run.
"""

import numpy as np
import pytest
import stress
from absurd import laws

from inercal.foundation.findings import Status
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.result import Estimate

RUNS, PARTS = 500, 8


@pytest.mark.slow
@pytest.mark.parametrize("part", [0, *(pytest.param(k, marks=pytest.mark.campaign) for k in range(1, PARTS))])
@pytest.mark.parametrize("room", stress.ROOMS)
def test_absurd_runs_end_in_a_sound_result_or_in_words(room, part, monkeypatch):
    held, of_truth = [], laws.of_truth

    def counted(values, u, truth, names):
        held.extend(names)
        return of_truth(values, u, truth, names)

    monkeypatch.setattr(laws, "of_truth", counted)
    stress.load(room)
    share = RUNS // PARTS
    numbers = range(part * share, (part + 1) * share)
    outcomes, wrong, *_ = stress.campaign(numbers, [*map(stress.Absurd(room), numbers)])
    assert wrong == []
    # the draws reach sound results and bad verdicts as well as refusals, and results that can be held against the truth
    assert {"ok", "study refused", "recording refused"} <= outcomes.keys()
    assert outcomes.keys() & {"unobservable", "not_converged", "inconsistent", "ill_conditioned"}
    assert held


def test_a_run_is_the_same_again():
    first, second = (stress.one("drift", 7) for _ in range(2))
    assert (first.study, first.words, first.outcome) == (second.study, second.words, second.outcome)


def test_the_laws_see_what_is_wrong():
    from dataclasses import replace

    none = Estimate.without(Basis("test"), Status.OK, "sound")
    estimate = replace(
        none,
        names=("a",),
        units=("1",),
        values=np.ones(1),
        covariance=np.eye(1),
        dof=np.ones(1),
    )
    assert laws.of_estimate(estimate) == []
    assert laws.of_estimate(replace(estimate, values=np.array([np.nan]))) == ["values is not finite"]
    assert laws.of_estimate(replace(estimate, covariance=-np.eye(1)))
    assert laws.of_estimate(replace(estimate, message="mean NIS nan")) == ["a sentence says nan"]
    assert laws.of_covariance(np.array([[1.0, 2.0], [2.0, 1.0]]), "P")
    assert laws.of_covariance(np.array([[1.0, 0.5], [0.4, 1.0]]), "P") == ["P: not symmetric"]
    assert laws.of_truth([1.0], np.array([9e-4]), 0.0, ["a"])
    assert laws.of_truth([1.0], np.array([1.1e-3]), 0.0, ["a"]) == []
    assert laws.of_refusal(ValueError("found no row"))
