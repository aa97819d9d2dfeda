"""Turns that do not close, and walks of biases: their noise is found from the recording, by restricted likelihood."""

from dataclasses import replace

import numpy as np
import pytest
import strapdown_faults as faults
from grades import MEMS, TACTICAL, drawn
from scipy.stats import chi2

from inercal.findings import Status
from inercal.strapdown.batch import fit
from inercal.strapdown.restricted import solved, with_noise
from inercal.strapdown.rests import found_rests, nodes_of
from inercal.strapdown.settings import TURN_NOISE, WALKS
from inercal.strapdown.simulate import simulated


def run(settings, seed):
    """Samples and nodes of a simulated run."""
    rng = np.random.default_rng([seed, 21])
    settings = replace(settings, plan=replace(settings.plan, sample_rate=50.0, dwell=8.0, first_dwell=20.0))
    samples = simulated(settings, drawn(settings, rng), rng)
    return samples, nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)


def without(settings, *names):
    return replace(settings, noise=replace(settings.noise, **dict.fromkeys(names, 0.0), estimate=names))


def test_the_deviance_is_that_of_all_rows_together():
    """-2 ln L, its determinant and all, against the dense matrix of rows of a short chain."""
    settings = replace(TACTICAL, plan=replace(TACTICAL.plan, turns=TACTICAL.plan.turns[5:10]))
    samples, nodes = run(settings, 1)
    chain = fit(samples, nodes, settings).chain
    m, p, count = 6, len(chain.prior), len(chain.rest)
    rests = int(chain.rest[-1]) + 1
    size = m * count + 3 * rests + p
    H, right, squares, volume = np.zeros((size, size)), np.zeros(size), 0.0, 0.0

    def add(A, e, W):
        nonlocal squares, volume
        H[:] += A.T @ W @ A
        right[:] += A.T @ W @ e
        squares += e @ W @ e
        volume -= np.linalg.slogdet(W)[1] if len(W) == m else 0.0

    place = np.eye(size)
    state = [place[m * k : m * k + m] for k in range(count)]
    angles = [place[m * count + 3 * r : m * count + 3 * r + 3] for r in range(rests)]
    coefficients = place[-p:]
    for k in range(count):
        if k < count - 1:
            A = state[k + 1] - chain.F[k] @ state[k] - chain.G[k] @ coefficients
            add(A, chain.e[k], chain.W[k])
        add(state[k][3:], -chain.v[k], chain.velocity * np.eye(3))
        add(state[k][:3] - angles[chain.rest[k]], -chain.angles[k], chain.attitude * np.eye(3))
    H[:m, :m] += np.diag(chain.start)
    right[:m] -= chain.start * chain.begin
    H[-p:, -p:] += np.diag(chain.prior)
    right[-p:] -= chain.prior * chain.c
    squares += chain.start @ chain.begin**2 + chain.prior @ chain.c**2
    scale = 1.0 / np.sqrt(np.diag(H))
    least = squares - right @ (scale * np.linalg.solve(H * np.outer(scale, scale), right * scale))
    volume += np.linalg.slogdet(H * np.outer(scale, scale))[1] - 2.0 * np.sum(np.log(scale))
    size_of_prior = chain.prior**-0.5
    volume += 2.0 * np.sum(np.log(size_of_prior))  # coefficients count in units of their prior
    found = solved(chain, size_of_prior)
    assert found.squares == pytest.approx(least, rel=1e-6)
    assert found.deviance == pytest.approx(least + volume, abs=1e-3)


def test_noise_of_turns_is_found():
    """Of 18 turns: 54 numbers of each kind, less what the coefficients follow; variances within their 99.9 % range."""
    noisy = replace(TACTICAL, noise=replace(TACTICAL.noise, turn_velocity=0.02, turn_attitude=5e-4))
    samples, nodes = run(noisy, 2)
    settings = without(noisy, *TURN_NOISE)
    found = with_noise(samples, nodes, settings, fit(samples, nodes, settings), TURN_NOISE)
    low, high = chi2.ppf([0.0005, 0.9995], 35) / 35
    assert low < (found.noise.turn_velocity / 0.02) ** 2 < high
    assert low < (found.noise.turn_attitude / 5e-4) ** 2 < high
    assert found.gain > 100.0


def test_walks_are_found():
    """MEMS walks within a third; for hundreds of rests would tell them better."""
    samples, nodes = run(MEMS, 3)
    settings = without(MEMS, *WALKS)
    found = with_noise(samples, nodes, settings, fit(samples, nodes, settings), WALKS)
    assert found.noise.gyro_walk == pytest.approx(MEMS.noise.gyro_walk, rel=0.35)
    assert found.noise.accelerometer_walk < 4.0 * MEMS.noise.accelerometer_walk


def named(case):
    """The estimate of a record whose turns do not close, and its errors over u."""
    estimate, errors = faults.estimated(0, *faults.CASES[case])
    assert "turn_noise" in {each.code for each in estimate.findings}
    assert "unmodelled" not in {each.code for each in estimate.findings}
    places = {name: z for name, z in errors.items() if name.startswith("r_")}
    assert max(map(abs, places.values())) < 4.0
    return estimate, errors


def test_turns_that_are_clipped_leave_places_at_their_prior():
    estimate, _ = named("gyro clips at 1.0 rad/s")
    assert estimate.status is Status.UNOBSERVABLE
    text = next(each.message for each in estimate.findings if each.code == "turn_noise")
    assert "r_xx, r_xy, r_xz, r_yx, r_yy, r_yz" in text
    for name in ("r_xx", "r_xy", "r_xz", "r_yx", "r_yy", "r_yz"):
        assert estimate[name].u > 0.9 * 0.05


def test_lost_samples_shift_nothing_beyond_u():
    _, errors = named("5 samples lost in a turn")
    assert max(map(abs, errors.values())) < 4.5


@pytest.mark.campaign
@pytest.mark.parametrize(
    "case", ["1 samples lost in a turn", "gyro clips at 1.2 rad/s", "gyros filtered, 50 ms"]
)
def test_turns_that_do_not_close_are_said(case):
    named(case)
