"""Moves between rests: rotations of the gyro, rows with their derivatives, and what they tell of an IMU."""

from dataclasses import replace

import numpy as np
from moved_units import EARTH, GRAVITY, LATITUDE, turned_by_hand
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.calibration import calibrate_sections
from inercal.systems.imu.sections.carried import increments, net_rotations, rotations
from inercal.systems.imu.sections.moves import move_rows
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.problem import problem_of
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, COMMON, LOCAL, SWIVEL, TILT
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
