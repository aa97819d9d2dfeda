"""The corpus of protocols: its halves are those drawn, its forward model is a rotation, its judge is honest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from protocols.__main__ import outcome
from protocols.corpus import HALVES, half, made, protocols
from protocols.outcome import judged, size
from protocols.physics import EARTH_RATE, poses_path, unit
from scipy.spatial.transform import Rotation


def test_halves_are_those_of_the_seed() -> None:
    """They were drawn before any protocol was run; one that is added later belongs to development, and shows here."""
    first, second = map(half, HALVES)
    assert sorted([*first, *second]) == sorted(protocols())
    assert len(first) == len(second) == 31
    assert (first[0], second[0]) == ("clipped_turns", "accelerometers_in_the_hand")


def test_rates_of_the_forward_model_are_those_of_its_attitudes() -> None:
    """Central differences of attitudes at 1 kHz leave the third derivative: below 1e-5 rad/s in 2 s turns."""
    motion = poses_path(np.random.default_rng(4), 3).sampled(1000)
    attitude = Rotation.from_matrix(motion.C)
    by_attitude = (attitude[:-2].inv() * attitude[2:]).as_rotvec() * 500
    assert np.max(np.abs(by_attitude - motion.rate[1:-1])) < 2e-5
    assert np.linalg.norm(EARTH_RATE) < 7.3e-5


def test_truth_in_the_frame_of_accelerometers_is_upper_triangular() -> None:
    made = unit(np.random.default_rng(3))
    values = {name: value for name, (value, _) in made.truth("accelerometers").items()}
    assert np.allclose([values["M_yx"], values["M_zx"], values["M_zy"]], 0.0, atol=1e-15)
    case = made.truth("case")
    lengths = [
        np.sqrt(sum((case[f"K1_{i}"][0] * case.get(f"M_{i}{j}", (1,))[0]) ** 2 for j in "xyz")) for i in "xyz"
    ]
    assert np.isclose(lengths[2], values["K1_z"])  # a row keeps its length in any frame


def test_units_of_results_have_their_size() -> None:
    assert size("count/(m/s^2)") == (1.0, "count")
    assert size("(deg/s)/(rad/s)") == (np.pi / 180, "")
    assert np.isclose(size("deg/sqrt(h)")[0], np.pi / 180 / 60)


def test_the_judge_tells_right_from_wrong(tmp_path) -> None:
    """Six files are calibrated right; with a truth that is off by 1e-3 the same result is wrong without a word."""
    case = made("german_spreadsheet", tmp_path)
    word, why, said = outcome(case, tmp_path)
    assert word == "right", (why, said)
    wrong = replace(case, unit=case.unit.given(K1=1.01 * case.unit.K1))
    assert outcome(wrong, tmp_path)[0] == "wrong"
    assert judged(replace(case, refusal=("magnetometer",)), 2, None, "error: no sensor")[0] == "refused"
    assert judged(case, 2, None, "error: which unit? --answer acc=g")[0] == "asked"
