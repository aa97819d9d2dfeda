"""Calibration of an IMU from sections: the problem, its solution, and what it recovers."""

from dataclasses import replace

import numpy as np
import pytest
from ferraris_sessions import UNSURE, options_of, record_of
from turned_units import DEG, SIDES, Bench, Unit

from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.sections.calibration import calibrate_sections
from inercal.systems.imu.sections.outputs import centred, misfit, rows
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.problem import problem_of
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.solve import solved
from inercal.systems.imu.sections.start import first_guess


def site_of(unit):
    return Site(unit.gravity, (), unit.latitude)


def everything(unit, **bench):
    """Sections of all kinds: sides, poses of no known direction, turns, rates of one setup, two sessions."""
    b, u = Bench(unit, **bench), {"up_u": 0.3 * DEG, "axis_u": 0.3 * DEG}
    out = [
        b.rest(v, name=side, up_u=0.3 * DEG, session="ab"[k % 2]) for k, (side, v) in enumerate(SIDES.items())
    ]
    out += [
        b.turn(SIDES[side], a, name=f"turn {side}", **u) for side in ("+x", "+y", "+z") for a in (6.0, -6.0)
    ]
    swivel, vertical = b.tilted(SIDES["+x"], 0.3 * DEG), b.tilted(SIDES["+x"], 0.3 * DEG)
    for rate in (0.5, -0.5, 1.0):
        at = {"actual": swivel, "vertical": vertical, "setup": "x", "rate_group": f"{abs(rate)}"}
        out.append(b.spin(SIDES["+x"], rate, rate_u=abs(rate) * 1e-3, error=3e-4, **at, **u))
        out.append(b.rest(b.tilted(SIDES["-z"], 0.5), told=False))
    return [*out, b.turn(SIDES["+z"], 3.0, level=0.05 * DEG, axis_u=0.3 * DEG, session="a")]


@pytest.fixture(scope="module")
def sections():
    return everything(Unit(np.random.default_rng(45)), stated=False)


def at_solution(sections, unit=None, **known):
    """Problem, point and variances after one search."""
    unit = unit or Unit(np.random.default_rng(45))
    problem = problem_of(sections, Priors(site_of(unit), mounting_u=1e-3, clock_u=1e-5, **known))
    z = np.array([np.log(size.median) for size in problem.sizes.values()])
    point, linear, converged = solved(problem, first_guess(problem), z)
    assert converged
    return problem, point, linear, z


def test_derivatives_are_those_of_differences(sections):
    problem, point, _, _ = at_solution(sections)
    (block,) = rows(problem, point)
    n, p = len(sections), len(problem.mean)
    J = np.zeros((n, 9, p))
    J[:, :, : problem.shared] = block.shared
    for k in range(n):
        J[k, :, block.at[k]] += block.local[k].T
    for i in np.flatnonzero(problem.free):
        step = 1e-6 * np.eye(p)[i]
        up, down = (misfit(problem, replace(point, x=point.x + s * step)) for s in (1, -1))
        assert np.allclose(J[:, :, i] * block.seen, (down - up).reshape(n, 9) / 2e-6, atol=1e-7), (
            problem.source(i)
        )


def test_elimination_gives_what_the_dense_problem_gives(sections):
    problem, point, linear, z = at_solution(sections)
    (block,) = rows(problem, point)
    n, p, free = len(sections), len(problem.mean), np.flatnonzero(problem.free)
    J = np.zeros((n, 9, p))
    J[:, :, : problem.shared] = block.shared
    for k in range(n):
        J[k, :, block.at[k]] += block.local[k].T
    seen, names = block.seen.ravel(), list(problem.sizes)
    A, r = J.reshape(-1, p)[seen][:, free], block.residual.ravel()[seen]
    v = (block.variance + sum(np.exp(2 * z[names.index(c)]) * s for c, s in block.scatter.items())).ravel()[
        seen
    ]
    sd = np.where(problem.ruled >= 0, np.exp(z)[problem.ruled], problem.sd)[free]
    H = (A.T / v) @ A + np.diag(sd**-2.0)
    b = A.T @ (r / v) + ((problem.mean - point.x)[free]) / sd**2
    dx, C = np.linalg.solve(H, b), np.linalg.inv(H)
    phi = r @ (r / v) + np.sum(((problem.mean - point.x)[free] / sd) ** 2) - b @ dx
    finite = np.isfinite(sd)
    logdet = np.linalg.slogdet(H)[1] + np.sum(np.log(v)) + 2 * np.sum(np.log(sd[finite]))
    found = linear.at(z)
    s, place = len(linear.shared), {i: k for k, i in enumerate(free)}
    both = [place[i] for i in (*linear.shared, *linear.local)]
    size = np.sqrt(np.diag(C))
    assert np.allclose(np.r_[found.shared, found.local] / size[both], (dx / size)[both], atol=1e-8)
    scaled = (C / np.outer(size, size))[np.ix_(both[:s], both[:s])]
    assert np.allclose(found.covariance / np.outer(size[both[:s]], size[both[:s]]), scaled, atol=1e-9)
    assert np.allclose(found.local_variance, np.diag(C)[both[s:]], rtol=1e-9)
    assert found.chi2 == pytest.approx(phi, rel=1e-10)
    assert found.value == pytest.approx(-0.5 * (logdet + phi), rel=1e-10)
    ((rest, covariance),) = linear.left(z, found)
    assert np.allclose(rest.ravel()[seen], r - A @ dx, atol=1e-10 * np.abs(r).max() + 1e-12)
    dense = np.diag(v) - A @ C @ A.T
    for k in range(0, n, 5):
        mine = np.flatnonzero(seen.reshape(n, 9)[k])
        first = int(seen.reshape(n, 9)[:k].sum())
        want = dense[first : first + len(mine), first : first + len(mine)]
        assert np.allclose(covariance[k][np.ix_(mine, mine)], want, atol=1e-9 * v.max())


def test_shares_of_all_sources_make_up_the_variance(sections):
    _, _, linear, z = at_solution(sections)
    found = linear.at(z)
    J = np.eye(36)
    of_rows, of_priors = linear.shares(z, found, J)
    whole = sum(part.sum(axis=(0, 1)) for part in of_rows) + of_priors.sum(axis=0)
    assert np.allclose(whole, np.diag(found.covariance)[:36], rtol=1e-7)


def test_an_unplaced_and_noiseless_unit_is_recovered():
    unit = Unit(np.random.default_rng(7))
    b = Bench(unit, placing=0.0, acc_noise=1e-7, gyro_noise=1e-10)
    told = {"up_u": 1e-7, "axis_u": 1e-7}
    parts = [b.rest(v, up_u=1e-7) for v in SIDES.values()]
    parts += [b.rest(np.array(v) / np.sqrt(3), up_u=1e-7) for v in ([1, 1, 1], [-1, 1, 1], [1, -1, -1.0])]
    parts += [b.turn(SIDES[k], s * 2 * np.pi, **told) for k in ("+x", "+y", "+z") for s in (1, -1)]
    found = calibrate_sections(parts, Priors(site_of(unit)))
    error = np.array([found.x[k] - unit.truth[name] for k, name in enumerate(found.names)])
    for name, e in zip(found.names, error, strict=True):
        head = name.rpartition("_")[0]
        limit = {"K0": 1e-5, "K1": 1e-6, "M": 1e-6, "K2": 1e-7, "D_F": 3e-5, "S": 1e-5, "T": 1e-4, "G": 1e-5}[
            head
        ]
        assert abs(e) < limit, name
    assert not set(found.by_prior)


def test_six_sides_with_placing_nought_are_the_closed_form():
    """Ferraris' means of pairs, where no side is placed with an error and all is linear."""
    unit = Unit(np.random.default_rng(3))
    b = Bench(unit, placing=0.0, acc_noise=1e-5, gyro_noise=1e-6)
    parts = [b.rest(SIDES[s + a], up_u=0.0) for a in "xyz" for s in "+-"]
    turns = [b.turn(SIDES[f"+{a}"], 2 * np.pi, up_u=0.0, axis_u=0.0) for a in "xyz"]
    turns = [replace(s, acc=None, acc_after=None) for s in turns]
    # no earth rate: it differs from section to session by the heading, which Ferraris does not know
    site = Site(unit.gravity)
    known = Priors(
        site,
        k2=0.0,
        misalignment=10.0,
        acc_scale=Size(1.0, np.inf),
        gyro_scale=Size(1.0, np.inf),
        g_sensitivity=1e3,
    )
    found = calibrate_sections([*parts, *turns], known)
    force = np.array([s.acc for s in parts])
    gain = (force[0::2] - force[1::2]).T / (2.0 * unit.gravity)
    x = {f"K1_{a}": gain[k, k] for k, a in enumerate("xyz")}
    x |= {
        f"M_{a}{b}": gain[k, m] / gain[k, k]
        for k, a in enumerate("xyz")
        for m, b in enumerate("xyz")
        if k != m
    }
    for name, u in zip(found.names, found.u, strict=True):
        if name.startswith(("K1", "M")):
            assert found.value(name)[0] == pytest.approx(x[name], abs=1e-3 * u + 1e-12), name


def test_means_of_six_sides_give_half_differences():
    """A published table of six rests: half differences of K1 per local gravity, with the u of its own scatter."""
    g = 9.797
    half, sections = [], []
    table = {
        "+z": (0.10022128, 0.06043013, 0.77310415), "-z": (0.08154104, 0.03939825, -1.27257485),
        "+y": (0.09860194, 1.04469521, -0.25467340), "-y": (0.08734057, -0.95591161, -0.24708871),
        "+x": (1.09251864, 0.03867361, -0.25794764), "-x": (-0.90685814, 0.04860945, -0.23929469),
    }  # fmt: skip
    for side, row in table.items():
        sections.append(Section("rest", name=side, acc=9.80665 * np.array(row), up=SIDES[side]))
    for k, axis in enumerate("xyz"):
        half.append(0.5 * 9.80665 / g * (table[f"+{axis}"][k] - table[f"-{axis}"][k]))
    found = calibrate_sections(sections, Priors(Site(g, (GravityInput("site", 1e-3, "m/s^2", 1.0),))))
    for axis, want in zip("xyz", half, strict=True):
        value, u, _ = found.value(f"K1_{axis}")
        assert abs(value - want) < 0.1 * u
        assert 2e-4 < u < 2.5e-3


@pytest.mark.parametrize("name", ["ferraris", "ferraris-si"])
def test_a_shipped_session_gives_what_its_authors_found(name):
    """imucal's numbers from the same sections, within half of u but for D_F: imucal's is the mean of all samples, so
    that unequal holds leave some of G in it."""
    found = calibrate_ferraris(record_of(name), UNSURE, options_of(name)).estimate
    for term, other in found.result["imucal"].items():
        most = 0.6 if term.startswith("D_F") else 0.5
        assert abs(found[term].value - other) < most * found[term].u, term


def test_level_axes_stay_where_a_vertical_moves_a_little():
    """What is known along them would jump with them, and no step of the search near an upright pose would be better."""
    unit = Unit(np.random.default_rng(5))
    found = calibrate_sections(everything(unit), Priors(site_of(unit)))
    free = int(np.flatnonzero(~found.problem.readings.know_up & ~found.problem.readings.tied)[0])
    here = found.point.up.copy()
    here[free] = [1e-7, 2e-7, 1.0]
    before = centred(found.problem, replace(found.point, up=here))
    here = before.up.copy()
    here[free] = [2e-7, 1e-7, 1.0]
    after = centred(found.problem, replace(before, up=here))
    np.testing.assert_allclose(after.level, before.level, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(after.level), 1.0, atol=1e-12)


def test_what_gravity_does_is_the_same_error_in_repeat_runs():
    """As much as the values move with gravity as it is stated; what is read has no part in it."""
    unit, u = Unit(np.random.default_rng(6)), 1e-3
    sections, there = everything(unit), site_of(unit)
    of_gravity = (GravityInput("gravity", u, "m/s^2", 1.0),)
    known, stated = (calibrate_sections(sections, Priors(replace(there, inputs=i))) for i in ((), of_gravity))
    moved = calibrate_sections(sections, Priors(replace(there, gravity=there.gravity + u, inputs=of_gravity)))
    at = [stated.names.index(f"K1_{axis}") for axis in "xyz"]
    shift = (moved.x - stated.x)[at]
    by_gravity = (stated.common - known.common)[np.ix_(at, at)]
    np.testing.assert_allclose(by_gravity, np.outer(shift, shift), rtol=0.05)
    assert np.linalg.eigvalsh(stated.covariance - stated.common).min() > -1e-12
