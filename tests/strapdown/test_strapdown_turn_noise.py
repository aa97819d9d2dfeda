"""Turns that do not close, and walks of biases: their noise is found from the recording, by restricted likelihood."""

from dataclasses import replace

import numpy as np
import pytest
import strapdown_faults as faults
from grades import MEMS, TACTICAL, drawn
from scipy.stats import chi2

import inercal as ic
from inercal.foundation.findings import Status
from inercal.systems.strapdown.fit.batch import fit
from inercal.systems.strapdown.fit.restricted import opened, separated, solved, with_noise
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.settings import TURN_NOISE, WALKS
from inercal.systems.strapdown.simulate import simulated, to_record
from inercal.systems.strapdown.task import calibrate


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


@pytest.mark.parametrize("times", [1.0, 20.0])
def test_walks_are_found(times):
    """Walks of MEMS, and larger ones: the true sizes are no less likely than one time in a thousand, of the larger none
    at all is."""
    noise = replace(MEMS.noise, **{name: times * getattr(MEMS.noise, name) for name in WALKS})
    samples, nodes = run(replace(MEMS, noise=noise), 3)
    settings = without(MEMS, *WALKS)
    found = with_noise(samples, nodes, settings, fit(samples, nodes, settings), WALKS)
    shown = replace(settings, noise=replace(found.noise, estimate=WALKS))
    fixed, parts, s = separated(found.fit, samples, shown, WALKS)

    def deviance(variances):
        W = np.linalg.inv(fixed + np.einsum("q,qkab->kab", np.array(variances), parts))
        return solved(found.fit.chain._replace(W=W), found.fit.prior).deviance

    true = [getattr(noise, name) ** 2 for name in WALKS]
    assert -0.1 < deviance(true) - deviance(s) < chi2.ppf(0.999, 2)
    assert (found.gain > chi2.ppf(0.999, 2)) == (times > 1.0)


def test_noise_that_is_found_is_no_less_likely_than_hardly_any():
    """Walks and turns together: the search does not end in a corner."""
    samples, nodes = run(TACTICAL, 4)
    settings, names = without(TACTICAL, *WALKS, *TURN_NOISE), (*WALKS, *TURN_NOISE)
    found = with_noise(samples, nodes, settings, fit(samples, nodes, settings), names)
    assert found is not None
    assert found.gain > 0.0


def test_what_the_size_of_a_walk_leaves_open_is_in_u():
    """Against a sum over two hundred sizes up to where none is likely; the likeliest alone knows too much."""
    samples, nodes = run(MEMS, 4)
    settings = without(MEMS, "gyro_walk")
    found = with_noise(samples, nodes, settings, fit(samples, nodes, settings), ("gyro_walk",))
    shown = replace(settings, noise=replace(found.noise, estimate=("gyro_walk",)))
    fixed, (part,), _ = separated(found.fit, samples, shown, ("gyro_walk",))
    tried = []
    for size in np.linspace(0.01, 4.0, 200) * MEMS.noise.gyro_walk:
        chain = found.fit.chain._replace(W=np.linalg.inv(fixed + size**2 * part))
        tried.append(solved(chain, found.fit.prior))
    weight = np.exp(
        -0.5 * (np.array([each.deviance for each in tried]) - min(each.deviance for each in tried))
    )
    moments = [each.covariance + np.outer(each.step, each.step) for each in tried]
    likely = np.einsum("k,kab->ab", weight / weight.sum(), moments)
    told = found.fit.covariance + opened(found.fit, samples, shown)
    assert np.sqrt(np.diag(told)) == pytest.approx(np.sqrt(np.diag(likely)), rel=0.02)
    assert np.all(np.diag(told) > np.diag(found.fit.covariance))


def named(case):
    """The estimate of a record whose turns do not close, and its errors over u."""
    estimate, errors = faults.estimated(0, *faults.CASES[case])
    assert "turn_noise" in {each.code for each in estimate.findings}
    assert "unmodelled" not in {each.code for each in estimate.findings}
    places = {name: z for name, z in errors.items() if name.startswith("r_")}
    assert max(map(abs, places.values())) < 4.0
    return estimate, errors


@pytest.mark.slow
def test_turns_that_are_clipped_leave_places_at_their_prior():
    estimate, _ = named("gyro clips at 1.0 rad/s")
    assert estimate.status is Status.UNOBSERVABLE
    text = next(each.message for each in estimate.findings if each.code == "turn_noise")
    assert "r_xx, r_xy, r_xz, r_yx, r_yy, r_yz" in text
    assert "`inercal calibrate imu` with method multiposition" in text
    for name in ("r_xx", "r_xy", "r_xz", "r_yx", "r_yy", "r_yz"):
        assert estimate[name].u > 0.9 * 0.05


def test_of_few_rests_turns_tell_as_much_to_poses_and_the_moves_between_them():
    """Seven rests by quarter turns: both methods calibrate, and agree within the uncertainty of either."""
    plan = replace(MEMS.plan, turns=MEMS.plan.turns[4:10], sample_rate=50.0, dwell=5.0, first_dwell=30.0)
    settings, rng = replace(MEMS, plan=plan), np.random.default_rng(3)
    record = to_record(simulated(settings, drawn(settings, rng), rng))
    one = calibrate(record, settings).estimate
    study = ic.study(
        "imu", latitude="34 deg", gravity=f"{settings.site.gravity} m/s^2", imu={"method": "multiposition"}
    )
    two = ic.calibrate(record, study).estimate
    assert one.status is two.status is Status.OK
    names = [name for name in one.names if name in two.names and not name.startswith("G")]
    assert {"K0_x", "K1_z", "S_y", "T_xy"} <= set(names)
    for name in names:
        assert abs(one[name].value - two[name].value) < 4.0 * np.hypot(one[name].u, two[name].u), name


@pytest.mark.campaign
def test_lost_samples_shift_nothing_beyond_u():
    _, errors = named("5 samples lost in a turn")
    assert max(map(abs, errors.values())) < 4.5


@pytest.mark.campaign
@pytest.mark.parametrize(
    "case", ["1 samples lost in a turn", "gyro clips at 1.2 rad/s", "gyros filtered, 50 ms"]
)
def test_turns_that_do_not_close_are_said(case):
    named(case)
