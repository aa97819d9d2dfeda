"""The model and its sensitivities: closed forms, differences, dense algebra."""

from dataclasses import replace

import numpy as np
import pytest
from grades import GRADES, MEMS, NAV, TACTICAL, drawn, plan

from inercal.foundation.geometry.rotations import conjugate, exp, from_matrix, log, multiply
from inercal.systems.strapdown.fit.batch import empty_shot, fit, variances_of, world_of
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.fit.start import beginning, carried_through
from inercal.systems.strapdown.model.coefficients import (
    GRAVITY,
    KA,
    LATITUDE,
    OPTIONS,
    SIZE,
    TAU,
    A,
    D,
    G,
    R,
    array_of,
    free_places,
    names,
    slope,
    stated,
)
from inercal.systems.strapdown.model.delay import delayed
from inercal.systems.strapdown.model.kernels import NodeState, shoot
from inercal.systems.strapdown.model.samples import Samples, freed, gains
from inercal.systems.strapdown.settings import Motion
from inercal.systems.strapdown.simulate import _turns, simulated, truth

SHORT = replace(
    TACTICAL,
    terms=OPTIONS,
    plan=plan("y y z x x", turn_time=2.0, dwell=5.0, first_dwell=8.0),
    motion=Motion(np.radians(3.0), 1.5, 0.3),
)


@pytest.fixture(scope="module")
def run():
    """A short noise-free run of a unit with all errors, its nodes and its coefficients."""
    rng = np.random.default_rng(3)
    c = drawn(SHORT, rng)
    samples = simulated(SHORT, c, rng, noise=False)
    return samples, nodes_of(samples, found_rests(samples, SHORT.rests), 1.0), c


def carried(samples, nodes, c, state):
    """The solution carried from each node to the next."""
    shot = empty_shot(len(nodes.sample) - 1, 6)
    world, variances = world_of(SHORT, c, samples.ts), variances_of(SHORT.noise)
    shoot(freed(samples, c), nodes.cuts, nodes.first, state, gains(c), world, variances, shot)
    return shot


def begun(samples, nodes, c):
    motion = freed(samples, c)
    q = carried_through(motion, nodes, beginning(motion, nodes, SHORT))
    return NodeState(q, np.zeros((len(q), 3)), np.zeros((len(q), 6)))


def difference(plus, minus, by):
    """Derivative (k, 6) of attitude and velocity after each interval, of two solutions."""
    return np.hstack([log(multiply(plus.q, conjugate(minus.q))), plus.v - minus.v]) / (2.0 * by)


def test_sensitivities_are_those_of_differences(run):
    samples, nodes, c = run
    c = 1e-2 * c  # what is of second order in the coefficients is left out of sensitivities
    state, steps = begun(samples, nodes, c), SHORT.deviations()
    steps[[GRAVITY, LATITUDE]] = 1e-4, 1.0
    found = carried(samples, nodes, c, state).G
    places = free_places(SHORT.terms, True, True)
    apart = {}
    for place in places:
        by = np.zeros(SIZE)
        by[place] = 1e-2 * steps[place]
        plus, minus = (carried(samples, nodes, c + sign * by, state) for sign in (1.0, -1.0))
        expected = difference(plus, minus, by[place])
        apart[place] = np.abs(found[:, :, place] - expected).max() / np.abs(expected).max()
    # that of the delay is of first order in what turns do within a block; that of latitude leaves Coriolis out
    assert apart.pop(TAU) < 1e-2
    assert apart.pop(LATITUDE) < 0.1
    assert max(apart.values()) < 1e-3


def test_transitions_are_those_of_differences(run):
    samples, nodes, c = run
    state, by = begun(samples, nodes, c), 1e-5
    found = carried(samples, nodes, c, state).F
    for k in range(6):
        step = np.zeros(6)
        step[k] = by
        plus, minus = (
            carried(
                samples,
                nodes,
                c,
                NodeState(multiply(exp(sign * step[:3]), state.q), state.v + sign * step[3:], state.bias),
            )
            for sign in (1.0, -1.0)
        )
        expected = difference(plus, minus, by)
        assert np.abs(found[:, :6, k] - expected).max() < 1e-3 * np.abs(expected).max()


@pytest.mark.parametrize("settings", [TACTICAL, MEMS], ids=["attitude", "walks"])
def test_block_elimination_is_dense_algebra(settings):
    """The arrow of the chain against one dense system of normal equations."""
    short = replace(settings, plan=plan("y y z x x", turn_time=2.0, dwell=4.0, first_dwell=6.0))
    rng = np.random.default_rng(4)
    samples = simulated(short, drawn(short, rng), rng)
    found = fit(samples, nodes_of(samples, found_rests(samples, short.rests), 2.0), short)
    chain, m, p = found.chain, found.chain.F.shape[1], len(found.free)
    nodes, rests = len(chain.rest), chain.rest[-1] + 1
    at_rest, at_c, n = nodes * m, nodes * m + 3 * rests, nodes * m + 3 * rests + p
    H = np.zeros((n, n))

    def add(rows, W):
        H[:] += rows.T @ W @ rows

    for k in range(nodes - 1):
        rows = np.zeros((m, n))
        rows[:, k * m : (k + 1) * m], rows[:, (k + 1) * m : (k + 2) * m] = -chain.F[k], np.eye(m)
        rows[:, at_c:] = -chain.G[k]
        add(rows, chain.W[k])
    for k in range(nodes):
        rows = np.zeros((3, n))
        rows[:, k * m + 3 : k * m + 6] = np.eye(3)
        add(rows, chain.velocity * np.eye(3))
        rows = np.zeros((3, n))
        rows[:, k * m : k * m + 3] = np.eye(3)
        reference = at_rest + 3 * chain.rest[k]
        rows[:, reference : reference + 3] = -np.eye(3)
        add(rows, chain.attitude * np.eye(3))
    H[:m, :m] += np.diag(chain.start)
    H[at_c:, at_c:] += np.diag(chain.prior)
    scale = 1.0 / np.sqrt(np.diag(H))
    covariance = np.linalg.inv(H * np.outer(scale, scale)) * np.outer(scale, scale)
    np.testing.assert_allclose(
        found.covariance / np.outer(found.prior, found.prior),
        covariance[at_c:, at_c:] / np.outer(found.prior, found.prior),
        rtol=1e-5,
        atol=1e-9,
    )
    assert found.redundancy.sum() < m * (nodes - 1)


@pytest.mark.kernels
def test_an_accelerometer_outward_on_a_turn_reads_less():
    """A turn about z at the rate w: at r_xx > 0 the x accelerometer reads -w^2 r_xx; late sensors read what was."""
    rate, ts, count = 1.5, 0.01, 400
    level = np.tile([0.0, 0.0, 9.8], (count, 1))
    outputs = np.tile([0.0, 0.0, rate], (count, 1))
    c = np.zeros(SIZE)
    c[R.start] = 0.02
    motion = freed(Samples(outputs, level, ts), c)
    np.testing.assert_allclose(motion.f[10:-10, 0], rate**2 * 0.02, rtol=1e-12)
    assert motion.f[10:-10, 1:] == pytest.approx(level[10:-10, 1:])


@pytest.mark.kernels
@pytest.mark.parametrize("samples", [0.3, -0.3, 1.7, 4.0])
def test_a_delay_of_a_cubic_is_exact(samples):
    t = np.arange(60.0)
    sums = np.stack([t**3 - 40.0 * t**2, 5.0 * t**2, 3.0 * t], axis=1) * 1e-3
    earlier = t - samples
    expected = np.stack([earlier**3 - 40.0 * earlier**2, 5.0 * earlier**2, 3.0 * earlier], axis=1) * 1e-3
    found = delayed(np.diff(sums, axis=0), samples)
    np.testing.assert_allclose(found[8:-8], np.diff(expected, axis=0)[8:-8], rtol=1e-9, atol=1e-12)


@pytest.mark.kernels
def test_outputs_are_undone_exactly(run):
    """Truth -> outputs -> truth of a still unit, with K2, asymmetry and g-sensitivity."""
    c = drawn(SHORT, np.random.default_rng(1))
    c[[36, *range(27, 36)]] = 0.0
    w, f = np.array([2e-5, -3e-5, 5e-5]), np.array([3.0, -5.0, 8.0])
    rate = (np.eye(3) + c[3:12].reshape(3, 3)) @ w + c[A] * np.abs(w) + c[G].reshape(3, 3) @ f + c[D]
    force = (np.eye(3) + c[KA].reshape(3, 3)) @ f + c[24:27] * f**2 + c[12:15]
    motion = freed(Samples(np.tile(rate, (9, 1)), np.tile(force, (9, 1)), 0.01), c)
    np.testing.assert_allclose(motion.w, np.tile(w, (9, 1)), rtol=1e-9)
    np.testing.assert_allclose(motion.f, np.tile(f, (9, 1)), rtol=1e-12)


@pytest.mark.kernels
@pytest.mark.parametrize("frame", ["upper", "lower"])
def test_a_frame_is_left_and_entered_without_loss(frame):
    c = drawn(replace(NAV, terms=OPTIONS), np.random.default_rng(2))
    values = stated(c, OPTIONS, frame)
    again = array_of(dict(zip(names(OPTIONS, frame), values.tolist(), strict=True)), frame)
    # the origin is accelerometer z: r_z stays 0
    np.testing.assert_allclose(again, c, atol=1e-13)


@pytest.mark.kernels
def test_frames_differ_by_a_rotation_and_so_do_their_covariances():
    """Gram matrices of the gains know no frame; neither does the length of an error in units of u."""
    c = drawn(NAV, np.random.default_rng(2))
    places = free_places(NAV.terms, False, False)

    def of(frame, free):
        whole = c.copy()
        whole[places] = free
        return stated(whole, NAV.terms, frame)

    P = np.diag(NAV.deviations()[places] ** 2)
    step, lengths = 1e-4 * NAV.deviations()[places], []
    for frame in ("upper", "lower"):
        J = slope(lambda free, frame=frame: of(frame, free), c[places])
        moved = of(frame, c[places] + step) - of(frame, c[places])
        lengths.append(moved @ np.linalg.solve(J @ P @ J.T, moved))
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-4)
    assert lengths[0] == pytest.approx(len(places) * 1e-8, rel=1e-4)


@pytest.mark.kernels
@pytest.mark.parametrize("grade", GRADES)
def test_the_simulated_motion_is_one_motion(grade):
    """Rate and force of the simulator's closed forms against differences of its attitude."""
    settings = replace(GRADES[grade], motion=Motion(np.radians(3.0), 1.5, 0.0))
    turn = next(iter(_turns(settings.plan, settings.motion, np.random.default_rng(1))))
    h, t = 1e-4, turn.begin + np.linspace(0.1, 0.9, 7) * turn.time
    earth = np.array([0.0, 6e-5, 4e-5])
    before, here, after = (truth(turn, t + by, settings.motion, earth, 9.8) for by in (-h, 0.0, h))
    of_b = log(from_matrix(np.einsum("nji,njk->nik", before.C_nb, after.C_nb))) / (2.0 * h)
    of_earth = np.einsum("nji,j->ni", here.C_nb, earth)
    np.testing.assert_allclose(of_b + of_earth, here.w, atol=1e-6)
    np.testing.assert_allclose((after.w - before.w) / (2.0 * h), here.wd, atol=1e-5)
    up = np.einsum("nij,nj->ni", here.C_nb, here.f)
    np.testing.assert_allclose(up, np.tile([0.0, 0.0, 9.8], (7, 1)), atol=1e-12)
