"""States of the rig: derivatives against differences of a model written again, and values found in recordings by a
simulator of its own: joints that move, and sensors that read them, with SciPy's rotations."""

from dataclasses import replace

import numpy as np
import pytest
from paper_study import ARCSEC, DEG, MICRO_G, study
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.before.considered import sensitivities
from inercal.systems.selfcal.filters.problem import encoders_at, problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform import linearised, model
from inercal.systems.selfcal.platform.coefficients import to_linear, to_product
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.rig import Gimbals
from inercal.systems.selfcal.platform.states import (
    ALL,
    BIAS_WALK,
    ENTRY_OF,
    EXTENDED_MODEL,
    KIND_OF,
    RIG,
    STATES,
    TEMPERATURE,
    WALK,
)
from inercal.systems.selfcal.result.outcome import assemble
from inercal.systems.selfcal.settings import PlatformStates
from inercal.systems.selfcal.still_joints import still_joints, told_apart

WHOLE = (
    *RIG, "k2", "levers", "scale_asymmetry", "g_sensitivity", "sag", *TEMPERATURE, "harmonics", *BIAS_WALK,
)  # fmt: skip
MOVES = (("y", 60), ("z", 180), ("x", 90), ("y", -100), ("z", -180), ("x", -120), ("y", 70), ("z", 90))
"""Turns of one joint after the other [deg], each axis of p through the vertical and the level."""


def of(name, c):
    """Parameters of a kind in the full vector, linear form."""
    return np.array([c[ALL.index(each)] for each in STATES[name].parameters])


def turned(axis, angle):
    """Rotations about an axis 0, 1, 2 by angles (n,) [rad]."""
    return Rotation.from_rotvec(np.multiply.outer(np.atleast_1d(angle), np.eye(3)[axis]))


def harmonics(th, c):
    """Errors (n, 3) of encoders at angles (n, 3) [rad], orders 1 and 2 of each."""
    parts = of("harmonics", c)[:12].reshape(3, 2, 2)
    waves = np.stack([[np.sin(order * th), np.cos(order * th)] for order in (1, 2)])
    return np.einsum("jop,opnj->nj", parts, waves)


def chain(th, c, gimbals, up):
    """Attitudes of p in e as joints (n, 3) [rad] are read; specific force ``up`` (3,) in e bends the platform."""
    th = th - harmonics(th, c)
    (i, j, k), signs = gimbals.index, gimbals.sign
    xy, yz = of("non_orthogonality", c)
    outer = turned(i, signs[0] * th[:, 0]) * turned(k, xy)
    inner = turned(j, signs[1] * (th[:, 1] - of("zero_y", c)[0])) * turned(i, yz)
    stiff = outer * inner * turned(k, signs[2] * th[:, 2]) * Rotation.from_rotvec(of("gamma", c))
    return stiff * Rotation.from_rotvec(np.cross(of("sag", c), stiff.inv().apply(up)))


def gyro_matrix(c):
    """Matrix and signs' part of the gyros: w_p = (1 + M) w + |w| asymmetry / 2 + kg0."""
    ds, do = of("ds", c), of("do", c)
    return (
        np.eye(3)
        + np.array([[0, ds[0], -do[0]], [-do[1], 0, ds[1]], [ds[2], -do[2], 0]])
        + np.diag(of("kg1", c))
    )


def accelerometer_outputs(f, w, c, warm):
    """Outputs (n, 3) at specific force (n, 3) at the centre and rate (n, 3), product form, term by term; ``warm`` [K],
    (n, 1) or one."""
    c = to_product(c)
    arm = of("levers", c).reshape(3, 3)
    f = f + np.stack([np.cross(w, np.cross(w, arm[i]))[:, i] for i in range(3)], axis=-1)
    pz, oy, oz = of("eta", c)
    along = np.stack([f[:, 0], f[:, 1] - oy * f[:, 0], f[:, 2] + pz * f[:, 0] - oz * f[:, 1]], axis=-1)
    momentary = of("ka0", c) + of("accelerometer_walk", c) + warm * of("ka0_T1", c)
    scale = 1 + of("ka1", c) + warm * of("ka1_T1", c)
    return momentary + scale * (along + of("k2", c) * along**2)


def bias(c, f=(0.0, 0.0, 0.0), warm=0.0):
    """Biases of the gyros now, at specific force ``f`` (3,) or (n, 3) in p and ``warm`` [K] above."""
    by_force = np.asarray(f) @ of("g_sensitivity", c).reshape(3, 3).T
    return of("kg0", c) + of("gyro_walk", c) + by_force + warm * of("kg0_T1", c)


def random_vector(rng, settings):
    """A full vector, linear form: every parameter of the size of its prior."""
    return settings.priors * rng.standard_normal(len(ALL))


def turns(name):
    """True for a state of the gyros."""
    return KIND_OF[name] in ("kg0", "ds", "do") or ENTRY_OF[name].port == "rate"


def without(kinds, c):
    """The full vector with parameters of some kinds at 0."""
    c[[ALL.index(name) for kind in kinds for name in STATES[kind].parameters]] = 0.0
    return c


@pytest.mark.kernels
@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("gimbals", [Gimbals(), Gimbals(("y", "z", "x"), (1, -1, -1))])
def test_columns_of_the_encoders_are_derivatives(gimbals, exact):
    settings = study(model=PlatformStates(WHOLE), gimbals=gimbals)
    posed, rng = problem(settings), np.random.default_rng(5)
    c, th, w = random_vector(rng, settings), rng.uniform(-1.2, 1.2, 3), 0.3 * rng.standard_normal(3)
    c = without(("delay", "sag") if exact else (), c)
    world, (late, _) = posed.world, of("delay", c)

    def attitude(states):
        full = c.copy()
        full[posed.states.index] = states
        rate = gyro_matrix(full) @ w + bias(full) + 0.5 * of("scale_asymmetry", full) * np.abs(w)
        base = Rotation.from_rotvec(of("beta", full))
        earth, tau = base.apply(world.earth), of("delay", full)[0]
        return (
            Rotation.from_rotvec(-earth * tau)
            * chain(th[None], full, gimbals, base.apply(world.up))[0]
            * Rotation.from_rotvec(rate * tau)
        )

    x = c[posed.states.index]
    q, slope = encoders_at(posed, th, x, w)
    assert exact or abs(late) > 1e-4
    np.testing.assert_allclose(
        Rotation.from_quat(np.roll(q, -1)).as_matrix(), attitude(x).as_matrix(), atol=1e-12
    )
    for k, name in enumerate(posed.names):
        step = 0.1 * posed.prior[k] * np.eye(len(x))[k]
        expected = (attitude(x - step).inv() * attitude(x + step)).as_rotvec() / (0.2 * posed.prior[k])
        # turns by sag, and what other states do within a delay, are left out
        off, size = np.abs(slope[:, k] - expected).max() * posed.prior[k], np.abs(slope[:, k]).max()
        relative, absolute = (1e-6, 1e-6) if exact else (1e-4, 1.0 if turns(name) else 3e-3)
        assert off < relative * size * posed.prior[k] + absolute * ARCSEC, name


@pytest.mark.kernels
@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_rows_of_the_accelerometers_are_derivatives(seed, exact):
    settings = study(model=PlatformStates(WHOLE))
    posed, rng = problem(settings), np.random.default_rng(seed)
    c, w = random_vector(rng, settings), 0.03 * rng.standard_normal(3)
    c = without(("delay", "k2", "ka1_T1") if exact else (), c)
    layout, world, start = posed.states.layout, posed.world, Rotation.random(random_state=seed)
    read = model.Rates(tuple(w), tuple(w))

    def outputs(error):
        full = c.copy()
        full[posed.states.index] += error[3:]
        base, tau = Rotation.from_rotvec(of("beta", full)), of("delay", full)[1]
        rate = gyro_matrix(full) @ w + bias(full) + 0.5 * of("scale_asymmetry", full) * np.abs(w)
        at = start * Rotation.from_rotvec(error[:3])
        then = Rotation.from_rotvec(base.apply(world.earth) * tau) * at * Rotation.from_rotvec(-rate * tau)
        return accelerometer_outputs(then.inv().apply(base.apply(world.up))[None], rate[None], full, 0.7)[0]

    n = 3 + len(posed.names)
    own, q = model.room(), tuple(np.roll(start.as_quat(), 1))
    found, _ = model.accelerometers(q, read, 0.7, model.base_of(c, True, world), c, layout, own)
    np.testing.assert_allclose(found, outputs(np.zeros(n)), atol=1e-8)
    size = np.append(np.full(3, 1e-4), posed.prior)
    rows = np.zeros((3, n))
    for i in range(3):
        rows[i, layout.rows[i, : layout.sizes[i]]] = own.entries[i, : layout.sizes[i]]
    for k in range(n):
        step = 0.1 * size[k] * np.eye(n)[k]
        expected = (outputs(step) - outputs(-step)) / 0.2
        # K2, temperature and delays are left out of derivatives by others, rates out of levers, and these out of the
        # other axes: much less than 10 ug
        relative, absolute = (1e-6, 1e-5) if exact else (0.02, 0.5)
        if exact and k >= 3 and (turns(posed.names[k - 3]) or KIND_OF[posed.names[k - 3]] == "levers"):
            relative, absolute = 5e-3, 0.1
        off = np.abs(rows[:, k] * size[k] - expected).max()
        assert off < relative * np.abs(expected).max() + absolute * MICRO_G, k


@pytest.mark.kernels
def test_columns_of_a_step_are_derivatives():
    settings = study(model=PlatformStates(WHOLE))
    posed, rng = problem(settings), np.random.default_rng(7)
    c, w, dt = random_vector(rng, settings), 0.3 * rng.standard_normal(3), 0.2
    start, layout = Rotation.random(random_state=1), posed.states.layout
    force, warm = (3.0, -6.0, 7.0), -0.7

    def after(states):
        full = c.copy()
        full[posed.states.index] = states
        momentary = bias(full, force, warm)
        rate = gyro_matrix(full) @ w + momentary + 0.5 * of("scale_asymmetry", full) * np.abs(w)
        earth = Rotation.from_rotvec(of("beta", full)).apply(posed.world.earth)
        return Rotation.from_rotvec(-earth * dt) * start * Rotation.from_rotvec(rate * dt)

    x = c[posed.states.index]
    q = tuple(np.roll(after(x).as_quat(), 1))
    own, p = model.room(), len(x)
    rate, earth = (
        model.turning(tuple(w), force, warm, c, layout, own),
        model.base_of(c, True, posed.world).earth,
    )
    F = linearised.transition(tuple(w), rate, dt, q, earth, c, True)
    found, each = np.empty((3, p)), np.vstack([np.zeros((3, p)), np.eye(p)])
    linearised.times(F, each, layout, own, found, np.empty((3, p)))
    for k, name in enumerate(posed.names):
        size = max(0.1 * posed.prior[k], 1e-7)
        step = size * np.eye(len(x))[k]
        expected = (after(x - step).inv() * after(x + step)).as_rotvec() / (2.0 * size)
        np.testing.assert_allclose(found[:, k], expected, rtol=1e-4, atol=1e-8, err_msg=name)


def moved(t):
    """Angles of the joints (n, 3) [rad] at times (n,), 2 deg/s, at rest before the first turn and after the last."""
    ends, angles = [5.0], [np.zeros(3)]
    for joint, by in MOVES:
        step = np.zeros(3)
        step["xyz".index(joint)] = by * DEG
        ends.append(ends[-1] + abs(by) / 2.0)
        angles.append(angles[-1] + step)
    return np.stack([np.interp(t, ends, np.array(angles)[:, k]) for k in range(3)], axis=-1)


LONG = 5.0 + sum(abs(by) for _, by in MOVES) / 2.0 + 5.0


def walked(settings, n, dt, rng):
    """Biases (n, 6) of gyros and accelerometers about their means: first order, 60 s, step by step."""
    walk = np.repeat([settings.noise.gyro_walk, settings.noise.accelerometer_walk], 3)
    sigma, keep = walk * np.sqrt(30.0), np.exp(-dt / 60.0)
    rows = [sigma * rng.standard_normal(6)]
    for _ in range(n - 1):
        rows.append(keep * rows[-1] + sigma * np.sqrt(1.0 - keep**2) * rng.standard_normal(6))
    return np.array(rows)


def recorded(settings, c, rng, dt=0.2):
    """A recording by joints that move as `moved`, read by sensors of the full vector ``c`` (linear form); where the
    study has biases that walk they do, and what they are in the end is put into ``c``."""
    noise, world, gimbals = settings.noise, settings.world, settings.gimbals
    t = dt * np.arange(int(LONG / dt) + 1)
    base = Rotation.from_rotvec(of("beta", c))
    earth, up = base.apply(world.earth), base.apply(world.up)
    # joints as they are, not as they are read
    zero = replace_kind(replace_kind(c, "zero_y", 0.0), "harmonics", 0.0)

    def attitude(at):
        return chain(moved(at), zero, gimbals, up)

    def rate(begin, end):
        """Mean rates against inertial space, in p."""
        spin = Rotation.from_rotvec(np.multiply.outer(end - begin, earth))
        return (attitude(begin).inv() * spin * attitude(end)).as_rotvec() / (end - begin)[:, None]

    late, of_acc = of("delay", c)
    th = moved(t - late)
    th = (
        th
        + harmonics(th, c)
        + [0.0, of("zero_y", c)[0], 0.0]
        + noise.encoder * rng.standard_normal((len(t), 3))
    )
    h = 1e-3
    w = rate(t - of_acc - h, t - of_acc)
    warm = 10.0 * (t / t[-1] - 0.5)
    acc = accelerometer_outputs(attitude(t - of_acc).inv().apply(up), w, c, warm[:, None])
    acc += noise.accelerometer * rng.standard_normal(acc.shape)
    drift = np.zeros((len(t), 6))
    if "gyro_walk" in settings.kinds:
        drift = walked(settings, len(t), dt, rng)
        c[WALK:] = drift[-1]
    acc += drift[:, 3:]
    true = rate(t[:-1], t[1:]) + noise.angle_random_walk / np.sqrt(dt) * rng.standard_normal((len(t) - 1, 3))
    # w_p = (1 + M) w + |w| asymmetry / 2 + kg0, for w
    read = true
    momentary = bias(
        replace_kind(c, "gyro_walk", 0.0), attitude(t[:-1] + 0.5 * dt).inv().apply(up), warm[:-1, None]
    )
    for _ in range(5):
        fixed = true - momentary - drift[:-1, :3] - 0.5 * of("scale_asymmetry", c) * np.abs(read)
        read = np.linalg.solve(gyro_matrix(c), fixed.T).T
    return Recording(t, read, th, acc, measured=True, warm=warm)


def replace_kind(c, kind, value):
    """A full vector with other values of a kind."""
    c = c.copy()
    c[[ALL.index(name) for name in STATES[kind].parameters]] = value
    return c


def drawn(settings, rng, kinds, delay=1.0):
    """A full vector, linear form, with values drawn from the priors of some kinds."""
    c = np.zeros(len(ALL))
    for kind in kinds:
        if kind in BIAS_WALK:
            continue
        at = [ALL.index(name) for name in STATES[kind].parameters]
        c[at] = settings.priors[at] * rng.standard_normal(len(at)) * (delay if kind == "delay" else 1.0)
    return to_linear(c)


PAPER_KINDS = tuple(STATES)[:6]
BASE = study(prior=np.append(study().prior[:18], [100e-6] * 3 + [60 * ARCSEC] * 3))


@pytest.mark.parametrize("kind", [kind for kind in WHOLE if kind not in (*EXTENDED_MODEL, *BIAS_WALK)])
def test_each_state_is_found_in_a_recording_by_another_simulator(kind):
    """All states within 4.5 u of the truth, and those asked for are worth something; without them all is wrong."""
    settings = replace(BASE, model=PlatformStates((*PAPER_KINDS, kind)))
    posed, rng = problem(settings), np.random.default_rng(11)
    c = drawn(settings, rng, (*PAPER_KINDS, kind))
    recording = recorded(settings, c, rng)
    found = estimate(recording, posed, "error-state", history=False)
    u = np.sqrt(np.diag(found.covariance))
    error = (found.coefficients - c[posed.states.index]) / u
    assert np.abs(error).max() < 4.5
    assert error @ np.linalg.solve(found.covariance / np.outer(u, u), error) < chi2.ppf(1 - 1e-4, len(u))
    assert (u[18:] < 0.5 * posed.prior[18:]).any()
    paper = estimate(recording, problem(BASE), "error-state", history=False)
    off = np.abs(paper.coefficients - c[:18]) / np.sqrt(np.diag(paper.covariance))
    assert off.max() > 5.0


@pytest.mark.parametrize("kind", ["error-state", "map"])
def test_estimators_agree_on_a_rig_with_all_errors(kind):
    kinds = tuple(each for each in WHOLE if kind != "map" or each not in BIAS_WALK)
    settings = replace(BASE, model=PlatformStates(kinds))
    posed, rng = problem(settings).for_kind(kind), np.random.default_rng(12)
    c = drawn(settings, rng, STATES, delay=0.1)
    found = estimate(recorded(settings, c, rng), posed, kind, history=False)
    error = found.coefficients - c[posed.states.index]
    assert found.converged
    assert error @ np.linalg.solve(found.covariance, error) < chi2.ppf(1 - 1e-4, len(error))


@pytest.mark.slow
@pytest.mark.parametrize("draws", [12, pytest.param(100, marks=pytest.mark.campaign)])
def test_uncertainties_of_rig_states_hold(draws):
    """NEES of the states over draws from their priors, within limits that 1 in 10000 leaves; of each state the mean of
    squared errors over u^2, within limits that 1 in 10000 leaves of all."""
    settings = replace(BASE, model=PlatformStates(RIG))
    posed, rng, total = problem(settings), np.random.default_rng(13), 0.0
    squares = np.zeros(len(posed.names))
    for _ in range(draws):
        c = drawn(settings, rng, RIG)
        found = estimate(recorded(settings, c, rng), posed, "error-state", history=False)
        error = found.coefficients - c[posed.states.index]
        total += error @ np.linalg.solve(found.covariance, error)
        squares += error**2 / np.diag(found.covariance)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], draws * len(posed.names))
    assert low < total < high
    least, most = chi2.ppf([5e-5 / len(squares), 1 - 5e-5 / len(squares)], draws)
    assert least < squares.min()
    assert squares.max() < most


def test_sensitivities_are_those_of_the_filter_run_again():
    """Each error of the rig that is no state: one run of the sensitivity, and two of the filter with it stated."""
    posed, rng = problem(BASE), np.random.default_rng(14)
    recording = recorded(BASE, drawn(BASE, rng, PAPER_KINDS), rng)
    found = estimate(recording, posed, "error-state")
    names = ("kg1_z", "gamma_y", "nonorth_yz", "zero_y", "tau_enc", "tau_a", "K2_x", "r_yy", "S_asym_z", "G_xx",
             "G_yz", "sag_z", "kg0_y_T1", "ka0_x_T1", "ka1_y_T1", "harmonic_2_cos", "harmonic_5_sin")  # fmt: skip
    slopes = sensitivities(recording, posed, found.history.attitude, found.coefficients, names)
    u = np.sqrt(np.diag(found.covariance))
    for name, slope in zip(names, slopes.T, strict=True):
        step = 0.01 * BASE.priors[ALL.index(name)]
        ends = [
            estimate(
                recording,
                problem(replace(BASE, model=PlatformStates(None, {name: (by, 0.0)}))),
                "error-state",
                None,
                False,
            )
            for by in (step, -step)
        ]
        # a value that is taken out acts as its opposite in the recording
        by_runs = (ends[1].coefficients - ends[0].coefficients) / (2.0 * step)
        # of delays the two sides differ where a turn begins
        assert np.abs((slope - by_runs) / u).max() < 0.03 * np.abs(slope / u).max(), name


def test_what_is_stated_but_not_estimated_enters_u():
    """gamma stated as 0(5) arcsec: u of the coefficients covers errors of so much, which the paper's model does not."""
    gamma = dict.fromkeys(STATES["gamma"].parameters, (0.0, 5 * ARCSEC))
    settings = replace(BASE, model=PlatformStates(None, gamma))
    rng = np.random.default_rng(15)
    c = drawn(BASE, rng, PAPER_KINDS)
    c[[ALL.index(name) for name in gamma]] = 5 * ARCSEC
    recording = recorded(BASE, c, rng)
    results = {}
    for key, each in (("stated", settings), ("exact", BASE)):
        posed = problem(each)
        found = estimate(recording, posed, "error-state")
        path = recorded_bounds(
            recording, posed, found.history.attitude, found.coefficients, contributions=True
        )
        results[key] = assemble(recording, each, found, path)
    stated = results["stated"]
    error = np.abs(stated.values - to_product(c[:18]))
    assert (error / stated.u).max() < 4.0
    assert not results["exact"].names or (error / results["exact"].u).max() > 15.0
    assert {"gamma_x", "gamma_y", "gamma_z"} <= {item.source for item in stated.budget}
    (told,) = (f.message for f in stated.findings if "are no states" in f.message)
    assert "non_orthogonality" in told
    assert "gamma" not in told.split(" are no states")[0]


def told(settings, th):
    """What is left of the states along a path."""
    return told_apart(settings, still_joints(settings, th), th[0])


def test_joints_that_stand_still_leave_states_out():
    th = np.zeros((10, 3))
    th[:, 0] = np.linspace(0.0, 1.0, 10)
    th[:, 2] = np.linspace(0.0, 2.0, 10)
    settings, said = told(replace(BASE, model=PlatformStates(RIG)), th)
    assert not {"nonorth_xy", "nonorth_yz"} & set(settings.states.names)
    assert len(settings.states.names) == 30
    assert said[0].message.startswith("nonorth_xy, nonorth_yz: th_y stands still")
    assert told(BASE, th) == (BASE, ())
    th[:, 1] = np.linspace(0.0, 0.5, 10)
    assert told(replace(BASE, model=PlatformStates(RIG)), th)[1] == ()
