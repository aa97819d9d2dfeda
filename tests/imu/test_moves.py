"""Moves between rests: rotations of the gyro, rows with their derivatives, and what they tell of an IMU."""

from dataclasses import replace

import numpy as np
from moved_units import GRAVITY, LATITUDE, turned_by_hand
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.earth import Site
from inercal.systems.imu.sections.calibration import calibrate_sections
from inercal.systems.imu.sections.carried import increments, net_rotations, rotations
from inercal.systems.imu.sections.moves import move_rows
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.problem import problem_of
from inercal.systems.imu.sections.start import first_guess
from inercal.systems.imu.sections.unknowns import COEFFICIENTS, COMMON, LOCAL, SWIVEL, TILT

PRIORS = Priors(Site(GRAVITY, (), LATITUDE), mounting_u=2e-3, clock_u=1e-3)


def some_unknowns(rng):
    """Common unknowns (43,) near those of a unit in SI."""
    x = np.concatenate([np.zeros(3), np.ones(3), np.zeros(12), np.ones(3), np.zeros(COMMON - 21)])
    x[:36] += rng.normal(0, 0.02, 36)
    x[27:36] *= 0.01
    return x


def test_rotations_are_products_of_all_samples():
    """Against SciPy's, sample by sample; of moves of unequal length."""
    rng = np.random.default_rng(1)
    record, x = turned_by_hand(rng, 4), some_unknowns(rng)
    moves = record.moves()
    moves[1] = replace(moves[1], **{name: getattr(moves[1], name)[:77] for name in ("t", "gyro", "acc")})
    bias = rng.normal(0, 1e-3, (3, 3))
    found = rotations(increments(moves), x, bias)
    M, T = np.eye(3), np.eye(3)
    for matrix, at in ((M, 6), (T, 21)):
        matrix[[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]] = x[at : at + 6]
    for k, move in enumerate(moves):
        attitude = Rotation.identity()
        for i in range(len(move.t) - 1):
            y, f = (0.5 * (v[i] + v[i + 1]) for v in (move.gyro, move.acc))
            f = np.linalg.solve(M, (f - x[:3]) / x[3:6])
            w = np.linalg.solve(T, (y - x[15:18]) / x[18:21] - x[27:36].reshape(3, 3) @ f - bias[k])
            attitude = attitude * Rotation.from_rotvec(w * (move.t[i + 1] - move.t[i]))
        np.testing.assert_allclose(found.R[k], attitude.as_matrix(), atol=1e-12)


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
        replace(moves[2], turn=Rotation.from_matrix(true_rotation(record, 2)).as_rotvec(), turn_u=0.01),
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


def true_rotation(record, k):
    """The rotation of a move by the true coefficients."""
    x = np.zeros(COMMON)
    x[: len(COEFFICIENTS)] = [
        record.truth.get(name, float(name[:2] in ("K1", "S_"))) for name in COEFFICIENTS
    ]
    return rotations(increments(record.moves()[k : k + 1]), x, np.zeros((1, 3))).R[0]


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
