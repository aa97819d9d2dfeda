"""Moves between rests: rotations of the gyro, rows with their derivatives, and what they tell of an IMU."""

from dataclasses import replace

import numpy as np
import pytest
from moved_units import DEG, EARTH, GRAVITY, LATITUDE, turned_by_hand
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.calibration import calibrate_sections
from inercal.systems.imu.sections.carried import increments, net_rotations, rotations
from inercal.systems.imu.sections.moves import move_rows
from inercal.systems.imu.sections.outlying import outlying_of
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import problem_of
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, COMMON, LOCAL, SWIVEL, TILT
from inercal.systems.imu.sections.with_moves import calibrate_with_moves, not_seen, not_whole, verticals_of
from rows import for_each

PRIORS = Priors(Site(GRAVITY, (), LATITUDE), mounting_u=2e-3, clock_u=1e-3)


def some_unknowns(rng):
    """Common unknowns (43,) near those of a unit in SI."""
    x = np.concatenate([np.zeros(3), np.ones(3), np.zeros(12), np.ones(3), np.zeros(COMMON - 21)])
    x[:36] += rng.normal(0, 0.02, 36)
    x[27:36] *= 0.01
    return x


def true_unknowns(record):
    """Common unknowns (43,) by the truth."""
    x = np.zeros(COMMON)
    x[: len(COEFFICIENTS)] = [
        record.truth.get(name, float(name[:2] in ("K1", "S_"))) for name in COEFFICIENTS
    ]
    return x


@for_each("rate, move, most", [(100.0, 2.0, 1e-5), (20.0, 2.0, 4e-4), (50.0, 0.8, 4e-4)])
def test_rotations_are_those_of_the_attitudes(rate, move, most):
    """By samples without noise; what earth rate adds is below 1e-3 rad and of its own."""
    record = turned_by_hand(np.random.default_rng(1), 12, rate=rate, move=move, noise=(0.0, 0.0))
    found = rotations(increments(record.moves()), true_unknowns(record), np.zeros((11, 3))).R
    east = np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)])
    spun = record.attitudes[:-1].inv().apply(EARTH * (move + 1 / rate) * east)
    true = Rotation.from_rotvec(spun) * record.attitudes[:-1].inv() * record.attitudes[1:]
    off = (true.inv() * Rotation.from_matrix(found)).magnitude()
    assert np.sqrt(np.mean(off**2)) < most


def test_rotations_of_moves_do_not_know_each_other():
    """Each alone is as beside longer ones; a bias of a session is one of all outputs."""
    rng = np.random.default_rng(11)
    record, x = turned_by_hand(rng, 4), some_unknowns(rng)
    moves, bias = record.moves(), rng.normal(0, 1e-3, (3, 3))
    moves[1] = replace(moves[1], **{name: getattr(moves[1], name)[:77] for name in ("t", "gyro", "acc")})
    together = rotations(increments(moves), x, bias)
    for k, move in enumerate(moves):
        other = x.copy()
        other[15:18] += x[18:21] * bias[k]
        alone = rotations(increments([move]), other, np.zeros((1, 3)))
        np.testing.assert_allclose(alone.R[0], together.R[k], atol=1e-12)


def test_derivatives_of_rotations():
    """Against differences, for all unknowns that a gyro has; what is near follows to second order."""
    rng = np.random.default_rng(2)
    moved, x, bias = increments(turned_by_hand(rng, 4).moves()), some_unknowns(rng), np.zeros((3, 3))
    found = rotations(moved, x, bias)
    clock = 39 - 2
    for p in [*range(15, 36), clock]:
        h = 1e-6
        step = h * np.eye(COMMON)[p]
        if p == clock:  # a fast clock counts too much time
            up, down = (rotations(replace_time(moved, 1 - s * h), x, bias) for s in (1, -1))
        else:
            up, down = (rotations(moved, x + s * step, bias) for s in (1, -1))
        by = Rotation.from_matrix(up.R @ np.swapaxes(down.R, 1, 2)).as_rotvec() / (2 * h)
        np.testing.assert_allclose(found.by_unknowns[:, :, p], by, atol=2e-4 * max(1.0, np.abs(by).max()))
    other = x + np.r_[np.zeros(15), rng.normal(0, 2e-4, 21), np.zeros(7)]
    near = found.near(other, bias + 1e-5, 0.01)
    np.testing.assert_allclose(near.R, rotations(moved, other, bias + 1e-5).R, atol=1e-5)
    assert found.near(other + 0.1, bias, 0.01) is None


def replace_time(moved, part):
    """Increments of a clock of another rate."""
    return replace(moved, dt=part * moved.dt, gyro=part * moved.gyro, acc=part * moved.acc)


def test_net_rotations_are_products():
    v = np.random.default_rng(3).normal(0, 0.3, (13, 2, 3))
    for k in range(2):
        product = Rotation.identity()
        for step in v[:, k]:
            product = product * Rotation.from_rotvec(step)
        np.testing.assert_allclose(net_rotations(v)[k], product.as_matrix(), atol=1e-12)


def test_rows_have_the_derivatives_of_differences():
    """By all shared unknowns and those of the rests: mounting, earth rate, biases of two sessions, one setup for two
    rests, known rotations. What earth rate adds to derivatives by tilts, below 1e-3, is left out."""
    rng = np.random.default_rng(4)
    record = turned_by_hand(rng, 5)
    sections = record.sections(session=["a", "a", "b", "b", "b"], setup=["s", "s", "", "", ""])
    moves = record.moves()
    moves = [
        moves[0],
        replace(moves[2], turn=(record.attitudes[2].inv() * record.attitudes[3]).as_rotvec(), turn_u=0.01),
        moves[3],
    ]
    extra = move_rows(5, moves, PRIORS)
    problem = problem_of(sections, PRIORS, (extra,))
    point = first_guess(problem)
    point.x[problem.free] += rng.normal(0, np.minimum(problem.sd[problem.free], 1e-3))
    point = extra.centred(problem, point)
    (block,) = extra.blocks(problem, point)
    assert block.seen[:, 2:].any(axis=1).tolist() == [False, True, False]

    def at(x):
        return extra.blocks(problem, replace(point, x=x))[0].residual

    for p in [*range(15, 36), *range(37, problem.shared)]:
        if p == 39:  # along axes that are not known, of which there are none
            continue
        step = 1e-6 * np.eye(len(point.x))[p]
        by = (at(point.x - step) - at(point.x + step)) / 2e-6
        np.testing.assert_allclose(
            np.where(block.seen, block.shared[:, :, p] - by, 0.0), 0.0, atol=4e-3 * max(1, np.abs(by).max())
        )
    for p in range(problem.shared, len(point.x)):
        if (p - problem.shared) % LOCAL not in [*range(*TILT.indices(LOCAL)), *range(*SWIVEL.indices(LOCAL))]:
            continue
        step = 1e-6 * np.eye(len(point.x))[p]
        by = (at(point.x - step) - at(point.x + step)) / 2e-6
        told = np.einsum("ckq,cq->ck", block.local, block.at == p)
        np.testing.assert_allclose(np.where(block.seen, told - by, 0.0), 0.0, atol=1e-3)


def test_a_record_in_the_hand_gives_its_coefficients():
    """12 rests: 21 values within 4 u, of which the rms error is 0.7 to 1.3 u in all but 1 of 100 records."""
    record = turned_by_hand(np.random.default_rng(5), 12)
    sections = record.sections()
    priors = Priors(Site(GRAVITY, (), LATITUDE))
    fit = calibrate_sections(sections, priors, (move_rows(len(sections), record.moves(), priors),))
    z = np.array(
        [
            (fit.value(name)[0] - record.truth[name]) / fit.value(name)[1]
            for name in fit.names
            if name in record.truth
        ]
    )
    assert fit.converged
    assert len(z) == 21
    assert np.all(np.abs(z) < 4)
    assert fit.value("S_x")[1] < 1e-3
    assert fit.value("T_xy")[1] < 2e-3
    assert "noise of the gyro in moves" in fit.budget


# with the accelerometers alone, and what is not whole ----------------------------------------------------------------

HAND = Priors(Site(GRAVITY, (), LATITUDE))
ACCELEROMETERS = [f"{head}_{axis}" for head in ("K0", "K1") for axis in "xyz"] + ["M_xy", "M_xz", "M_yz"]


def errors_over_u(fit, record, heads=("K0", "K1", "M", "D_F", "S", "T")):
    """Errors over u of the coefficients of these heads, by name."""
    return {
        name: (fit.value(name)[0] - record.truth[name]) / fit.value(name)[1]
        for name in fit.names
        if name.rpartition("_")[0] in heads and name in record.truth
    }


def test_moves_that_are_not_whole_are_left_out_and_named():
    """A gap, lost samples, stamps that fall back and clipped samples; a value that is only large is none of them."""
    record = turned_by_hand(np.random.default_rng(12), 12)
    record.gyro[:, 1] = np.minimum(record.gyro[:, 1], np.quantile(record.gyro[:, 1], 0.995))
    moves = record.moves()
    keep = np.delete(np.arange(len(moves[1].t)), slice(60, 75))
    moves[1] = replace(moves[1], **{name: getattr(moves[1], name)[keep] for name in ("t", "gyro", "acc")})
    lost = moves[4].gyro.copy()
    lost[30] = np.nan
    moves[4] = replace(moves[4], gyro=lost)
    back = moves[7].t.copy()
    back[50] = back[49]
    moves[7] = replace(moves[7], t=back)
    clipped = {k for k, move in enumerate(moves) if np.sum(move.gyro[:, 1] == record.gyro[:, 1].max()) > 0}
    found = {each.move: each.why for each in not_whole(moves)}
    assert found.keys() == {1, 4, 7} | clipped
    assert clipped
    assert "gap of 0.16 s" in found[1]
    assert "1 of its samples are lost" in found[4]
    assert "do not rise" in found[7]
    assert all("clipped" in found[k] for k in clipped - {1, 4, 7})


def test_what_is_left_of_a_record_with_gaps_is_sound():
    record = turned_by_hand(np.random.default_rng(13), 24)
    moves = record.moves()
    for k in (3, 9):
        keep = np.delete(np.arange(len(moves[k].t)), slice(80, 95))
        moves[k] = replace(moves[k], **{name: getattr(moves[k], name)[keep] for name in ("t", "gyro", "acc")})
    found = calibrate_with_moves(record.sections(), moves, HAND)
    assert [each.move for each in found.left_out] == [3, 9]
    assert len(found.used) == 21
    assert found.calibration.converged
    assert np.all(np.abs(list(errors_over_u(found.calibration, record).values())) < 4)


@for_each(
    "unit, halved, said, rescaled",
    [
        ("SI", False, Size(1.0, 0.05), False),
        ("SI", True, Size(1.0, 0.05), True),
        ("counts", False, None, False),
    ],
)
def test_scale_of_the_gyro_is_found(unit, halved, said, rescaled):
    """Where nothing is known of it, and where what is said is off by a factor."""
    record = turned_by_hand(np.random.default_rng(14), 16, unit=unit)
    part = 0.5 if halved else 1.0
    record.gyro[:] *= part
    truth = {
        name: value * (part if name[:2] in ("S_", "D_") else 1.0) for name, value in record.truth.items()
    }
    priors = replace(HAND, gyro_scale=said, acc_scale=None if unit == "counts" else HAND.acc_scale)
    found = calibrate_with_moves(record.sections(), record.moves(), priors)
    assert found.rescaled == rescaled
    assert found.calibration.converged
    z = errors_over_u(found.calibration, replace(record, truth=truth))
    assert len(z) == 21
    assert np.all(np.abs(list(z.values())) < 4), z
    assert found.calibration.value("S_x")[1] < 1e-3 * truth["S_x"]


@pytest.mark.slow
@for_each(
    "of",
    [
        {"latitude": None},
        {"move": 30.0, "rests": 12},
        {"drift": 0.1 * DEG},
        {"walk": 2e-3},
        {"rate": 20.0, "move": 0.8},
        {"rate": 20.0},
    ],
)
def test_records_of_many_kinds(of):
    """An unknown latitude, moves of half a minute, a bias that drifts by 0.1 deg/s, moves that wander, a slow logger:
    21 errors over u with an rms of at most 1.6 (beyond that fewer than 1 of 1000 with 10 degrees of freedom)."""
    of = dict(of)
    site = Site(GRAVITY, (), of.pop("latitude", LATITUDE))
    record = turned_by_hand(np.random.default_rng(15), **{"rests": 24, **of})
    found = calibrate_with_moves(record.sections(), record.moves(), replace(HAND, site=site))
    z = np.array(list(errors_over_u(found.calibration, record).values()))
    assert found.calibration.converged
    assert not found.left_out
    assert np.sqrt(np.mean(z**2)) < 1.6, z


@pytest.mark.slow
def test_moves_that_spoil_the_accelerometers_lose_their_say():
    """One move of nine is off by 20 deg: the accelerometers are never worse for it, and where moves would make them so,
    they are those without a gyro."""
    spoiled = 0
    for seed in (0, 4):
        record = turned_by_hand(np.random.default_rng([seed, 10]), 10)
        record.gyro[1850:1860] += 200 * DEG / np.sqrt(3)
        found = calibrate_with_moves(record.sections(), record.moves(), HAND)
        fit, alone = found.calibration, found.alone
        assert all(fit.value(name)[1] <= 1.2 * alone.value(name)[1] for name in ACCELEROMETERS)
        assert np.all(np.abs(list(errors_over_u(fit, record, ("K0", "K1", "M")).values())) < 4)
        if found.spoiled:
            spoiled += 1
            at, own = ([each.names.index(name) for name in ACCELEROMETERS] for each in (fit, alone))
            gyro = [k for k, name in enumerate(fit.names) if name[:2] in ("S_", "T_", "D_", "G_")]
            np.testing.assert_array_equal(fit.x[at], alone.x[own])
            np.testing.assert_array_equal(fit.covariance[np.ix_(at, at)], alone.covariance[np.ix_(own, own)])
            assert not fit.covariance[np.ix_(at, gyro)].any()
            assert np.all(np.linalg.eigvalsh(fit.covariance / np.outer(fit.u, fit.u)) > -1e-9)
    assert spoiled


def test_without_moves_there_is_a_bias():
    record = turned_by_hand(np.random.default_rng(16), 12)
    found = calibrate_with_moves(record.sections(), [], HAND)
    assert found.calibration.value("D_F_x")[1] < 1e-3
    assert not found.used


def test_only_the_vertical_was_turned():
    """Moves about the vertical tell how the gyro's z lies, and no scale factor: what was not seen is by prior."""
    rng = np.random.default_rng(17)
    turns = [[0, 0, 1.0 + 0.1 * k] for k in range(6)] + rng.normal(0, 1.2, (11, 3)).tolist()
    record = turned_by_hand(rng, 18, turns=turns, swing=0.0, level=True)
    found = calibrate_with_moves(record.sections(), record.moves()[:6], HAND).calibration
    assert {"S_x", "S_y", "S_z", "T_xy", "T_yx", "T_zx", "T_zy"} <= {*found.by_prior}
    assert not {"T_xz", "T_yz", "K1_x", "D_F_z"} & {*found.by_prior}


def test_six_sides_twice_with_known_rotations():
    """A unit that is put back tells T and S about all axes, those about the vertical too, by the rotations between."""
    quarter = [[np.pi / 2, 0, 0], [0, np.pi / 2, 0], [0, 0, np.pi / 2]]
    turns = [quarter[k % 3] for k in range(17)]
    record = turned_by_hand(np.random.default_rng(18), 18, turns=turns)
    said = [
        replace(move, turn=np.array(turn), turn_u=1e-4)
        for move, turn in zip(record.moves(), turns, strict=True)
    ]
    priors = replace(HAND, misalignment=0.05)
    known, unknown = (
        calibrate_with_moves(record.sections(), moves, priors).calibration for moves in (said, record.moves())
    )
    z = np.array(list(errors_over_u(known, record).values()))
    assert known.converged
    assert np.sqrt(np.mean(z**2)) < 1.6, z
    for name in known.names:
        if name[:2] in ("S_", "T_", "M_"):
            assert known.value(name)[1] < 1.02 * unknown.value(name)[1]
    assert known.value("T_xy")[1] < 0.8 * unknown.value("T_xy")[1]


def named(seed, faulty):
    """What is named of a record of 24 rests, sound or with a move that is off by 1 deg and a rest by 2.4 mg."""
    record = turned_by_hand(np.random.default_rng([20, seed]), 24)
    if faulty:
        record.gyro[3850:3860] += 10 * DEG / np.sqrt(3)
        record.acc[5500:5800] += [0.02, -0.01, 0.01]
    found = calibrate_with_moves(record.sections(), record.moves(), HAND)
    return {(each.kind, each.place) for each in outlying_of(found.calibration)}


@pytest.mark.slow
def test_a_rest_and_a_move_that_are_off_are_both_named():
    """In at least one of three records, where three of four are expected, and nothing else; nothing in sound ones."""
    off = {("section", 11), ("move", 7)}
    found = [named(seed, True) for seed in range(3)]
    assert all(each <= off for each in found), found
    assert sum(each == off for each in found) >= 1, found
    assert [named(seed, False) for seed in range(3)] == [set()] * 3


@pytest.mark.campaign
def test_rests_and_moves_of_many_records():
    """Both named in 3 of 4 of 80 records, less three standard deviations; 3 of 1000 sound ones may name something, and
    of 200 more than 4 would in 1 of 3000 cases."""
    off = {("section", 11), ("move", 7)}
    assert sum(named(seed, True) >= off for seed in range(100, 180)) > 60 - 3 * np.sqrt(15)
    assert sum(bool(named(seed, False)) for seed in range(100, 300)) <= 4


def errors_in_the_hand(rests, seeds):
    """Errors over U of many records (records, 21)."""
    over_U = []
    for seed in seeds:
        record = turned_by_hand(np.random.default_rng([19, rests, seed]), rests)
        fit = calibrate_with_moves(record.sections(), record.moves(), HAND).calibration
        assert fit.converged
        z = errors_over_u(fit, record)
        over_U.append([z[name] * fit.value(name)[1] / fit.value(name)[2] for name in z])
    return np.array(over_U)


@pytest.mark.slow
def test_coverage_in_the_hand():
    """Of 21 values in 16 records of 12 rests, 95 % are within U: with some 100 independent ones at least 88 % are, in
    all but 1 of 1000 cases."""
    over_U = errors_in_the_hand(12, range(16))
    assert np.mean(np.abs(over_U) < 1) > 0.88


@pytest.mark.campaign
@pytest.mark.parametrize("rests", [12, 24])
def test_coverage_of_many_records_in_the_hand(rests):
    over_U = errors_in_the_hand(rests, range(100, 300))
    inside = np.mean(np.abs(over_U) < 1, axis=0)
    assert 0.94 < inside.mean() < 0.98, inside
    assert inside.min() > 0.89, inside  # of 200: 0.95 less four standard deviations of the binomial


def test_a_jump_to_another_side_is_no_move():
    """Rows between two poses are missing: the vertical turns, the gyro does not."""
    record = turned_by_hand(np.random.default_rng(3), 12)
    sections, moves = record.sections(), list(record.moves())
    short = {name: getattr(moves[4], name)[:3] for name in ("t", "gyro", "acc")}
    moves[4] = replace(moves[4], **short | {"gyro": np.zeros((3, 3))})
    alone = calibrate_sections([replace(s, gyro=None, gyro_var=None) for s in sections], PRIORS)
    for priors in (PRIORS, replace(PRIORS, gyro_scale=None)):
        out = not_seen(moves, sections, priors, verticals_of(alone))
        assert [one.move for one in out] == [4]


def test_turns_about_the_vertical_alone_give_no_scale_of_counts():
    """Where no vertical turns, gravity carries nothing: S of a gyro in counts stays open, and no move is used."""
    record = turned_by_hand(np.random.default_rng(3), 12)
    sections, moves = record.sections(), record.moves()
    same = [replace(move, last=move.first) for move in moves]
    alone = calibrate_sections([replace(s, gyro=None, gyro_var=None) for s in sections], PRIORS)
    up = verticals_of(alone)
    assert len(not_seen(same, sections, replace(PRIORS, gyro_scale=None), up)) == len(moves)
    assert not_seen(same, sections, PRIORS, up) == ()


@pytest.mark.parametrize("factor", [np.pi / 180.0, 180.0 / np.pi])
def test_a_wrong_unit_is_named_and_no_rows_are_missed(factor):
    """Outputs in rad/s that are said to be in deg/s are small in every move, and the other way round."""
    record = turned_by_hand(np.random.default_rng(3), 12)
    sections = [replace(s, gyro=factor * s.gyro) for s in record.sections()]
    moves = [replace(move, gyro=factor * move.gyro) for move in record.moves()]
    found = calibrate_with_moves(sections, moves, PRIORS)
    assert found.left_out == ()
    assert found.rescaled
