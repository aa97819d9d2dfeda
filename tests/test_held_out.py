"""The held-out campaign: its halves are those drawn, its kinds are simulated, and its simulators make what they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from held_out.kinds import check, kinds
from held_out.run import seed_of
from held_out.systems import METHODS, fault_of, module_of, scene_of
from held_out.table import bound, harmed, said
from held_out.trial import Case, outcome, pattern

CHEAP = [("turntable", "rates"), ("imu", "means"), ("imu", "known_rates"), ("imu", "known_turns")]


def made(case: Case) -> list[Any]:
    """All numbers of the records of a case, and its study."""
    records = case.records if isinstance(case.records, list) else [case.records]
    columns = [record[name].values for record in records for name in record.columns]
    return [*columns, None if case.residual is None else case.residual]


def differ(first: Case, second: Case) -> bool:
    """True where two cases have other numbers."""
    pairs = list(zip(made(first), made(second), strict=True))
    return any(np.shape(a) != np.shape(b) or np.any(np.asarray(a) != np.asarray(b)) for a, b in pairs)


def test_halves_are_those_of_the_seed() -> None:
    """The halves were drawn once; a kind that is added or moved shows here."""
    check()
    assert len(kinds()) >= 120
    assert abs(len(kinds("development")) - len(kinds("held-out"))) <= len(METHODS)


def test_every_kind_is_simulated_and_no_other() -> None:
    """Of each method the faults of its simulator are those of the list."""
    for system, method in METHODS:
        listed = {kind.name for kind in kinds() if (kind.system, kind.method) == (system, method)}
        assert set(module_of(system, method).FAULTS) == listed


@pytest.mark.parametrize(("system", "method"), CHEAP)
def test_a_fault_changes_the_record_and_only_it_does(system: str, method: str) -> None:
    """The same draw gives the same record; each kind of the half for development gives another."""
    scene = scene_of(system, method, np.random.default_rng(seed_of("test", system, method)))
    sound = scene.case()
    assert not differ(sound, scene.case())
    for kind in kinds("development"):
        if (kind.system, kind.method) == (system, method):
            act, nominal = fault_of(kind)
            assert differ(sound, scene.case(act, 3 * nominal)), kind.name


def test_sound_means_are_within_their_uncertainty() -> None:
    """Errors over u of 40 sound tables of pose means are of unit size: nine values each, rms within 1 +- 0.25."""
    ratios = []
    for draw in range(40):
        scene = scene_of("imu", "means", np.random.default_rng(seed_of("test", draw)))
        found = outcome(scene.case())
        ratios.append(found.error / found.u)
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.25


def test_a_pattern_of_the_values_is_none() -> None:
    """What a scale does to readings is projected out: wrong gravity leaves no pattern, a mistyped number does."""
    scene = scene_of("imu", "means", np.random.default_rng(5))
    acts = module_of("imu", "means").FAULTS
    sizes = [
        pattern(scene.case(acts[name][1], 1e-3), scene.case()) for name in ("wrong_gravity", "digit_mistyped")
    ]
    assert sizes[0] is not None
    assert sizes[1] is not None
    assert sizes[0] < 0.02 * sizes[1]


def test_the_bound_of_a_share_is_that_of_clopper_and_pearson() -> None:
    """None of n: the bound p has (1 - p)^n = 0.05; all of n: it is 1; one of n: 0.05 for none or one."""
    assert bound(0, 20) == pytest.approx(1 - 0.05 ** (1 / 20))
    p = bound(1, 20)
    assert (1 - p) ** 20 + 20 * p * (1 - p) ** 19 == pytest.approx(0.05)
    assert bound(20, 20) == 1.0


def test_harm_and_what_is_said_of_it() -> None:
    """Harmed: off by more than 3 U / 2, and itself shifted. Said: a new finding, or an old one about the fault."""
    values = {
        "K1_x": [3.2, 1.6, 0.5],
        "S_x": [3.2, 1.6, 3.0],
        "S_y": [-4.0, 2.0, 2.1],
        "S_z": [2.8, 1.4, 9.0],
    }
    row: dict[str, Any] = {"kind": "clock_fast", "values": values, "sound_codes": ["weak_test"]}
    assert harmed(row) == ["S_y", "S_x"]
    assert harmed({**row, "values": {}}) == []
    old = {"code": "weak_test", "headline": "This test hides a harmonic.", "action": "", "items": []}
    assert not said({**row, "findings": [old]})
    assert said({**row, "findings": [{**old, "headline": "This test hides an error of the clock."}]})
    assert said({**row, "findings": [{**old, "code": "trend"}]})
