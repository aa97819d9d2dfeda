"""What Zhao et al. 2023 say about the errors of a turntable, and what is true: every claim of the page, computed.

The paper's case: eleven errors, uniform on ±2 arcmin, two-axis table, averages over the full circle of both angles.
Its printed equations are not used; its statements are. Factor names are the paper's.
"""

import subprocess
import sys
from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from inercal.foundation.geometry.earth import Site
from inercal.foundation.rigs.chain import Chain, Error, Joint, Scope
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, named
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import averages, exact, local, sampled
from inercal.foundation.units import parse_unit
from inercal.systems.turntable import regression
from inercal.systems.turntable.model import stated_values, table_model
from inercal.systems.turntable.positions import planning
from inercal.systems.turntable.positions.tolerance import shifts, sphere_moments
from inercal.systems.turntable.settings import Constraint, Instrument, PositionDesign, TurntableSettings

ARCMIN = np.radians(1.0 / 60.0)
LATITUDE = np.radians(39.1)  # any will do: only the shift of the maps depends on it
CHAIN = turntable("two_axis_turntable", uniform(2.0 * ARCMIN))
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, LATITUDE)
GRID = grid((36, 36)).angles
K = {name: k for k, name in enumerate(CHAIN.factors)}
AT = {output.name: o for o, output in enumerate(OUTPUTS)}

KEY = ("dphi_y1", "deps_y", "dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y")
TURNS_Z = ("dalpha_z1", "dphi_z2", "dtheta_z")
NEGLIGIBLE = {
    "ax": ("dalpha_x2", "dtheta_x"),
    "ay": ("dalpha_y2", "dtheta_y"),
    "az": (*TURNS_Z, "dalpha_x1", "deps_x"),
}
INNER = ("dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y")  # what choosing positions is said to help with
OUTER = ("dphi_y1", "deps_y")  # what only tightening is said to help with


def columns(names):
    return [K[name] for name in names]


def leading_order(phi1, phi2):
    """Parts of variance (3, 11) of ax, ay, az for small equal errors, in the order of the chain."""
    c1, s1, c2, s2 = (f(x) ** 2 for x in (phi1, phi2) for f in (np.cos, np.sin))
    o = np.zeros_like(c1)
    #        y1       x1       z1       ex       ey       z2       ax2      ay2      tx       ty       tz
    return np.stack(
        [
            np.stack([c1 * c2, c1 * s2, s1 * s2, c1 * s2, c1 * c2, s1 * s2, o, c1, o, c1, s1 * s2], -1),
            np.stack([c1 * s2, c1 * c2, s1 * c2, c1 * c2, c1 * s2, s1 * c2, c1, o, c1, o, s1 * c2], -1),
            np.stack([s1, o, o, o, s1, o, s1 * s2, s1 * c2, s1 * s2, s1 * c2, o], -1),
        ]
    )


@pytest.fixture(scope="module")
def indices():
    return exact.analyse(CHAIN, OUTPUTS, GRID)


@pytest.fixture(scope="module")
def mean(indices):
    return averages.mean(indices)


def test_the_leading_order_in_closed_form():
    parts = leading_order(*GRID.T)
    c1, s1, c2, s2 = (f(x) ** 2 for x in GRID.T for f in (np.cos, np.sin))
    whole = np.stack([4 * c1 + 3 * s1 * s2, 4 * c1 + 3 * s1 * c2, 4 * s1])
    assert_allclose(parts.sum(axis=-1), whole, atol=1e-14)
    found = local.analyse(CHAIN, OUTPUTS[:3], GRID).first
    assert_allclose(found, parts / whole[..., None], atol=1e-12)


def test_means_over_the_full_circle_in_closed_form():
    """With 1 arcsec, so that only the grid matters: its error falls with the square of the step."""
    p = 1.0 / (pi * sqrt(3.0))
    y, x, z = 5 / 18 - p, p - 1 / 9, 1 / 9
    expected = [y, x, z, x, y, z, 0.0, 1 / 6, 0.0, 1 / 6, z]
    small = turntable("two_axis_turntable", uniform(ARCMIN / 60.0))
    gaps = []
    for n in (36, 144):
        got = averages.mean(exact.analyse(small, OUTPUTS[:3], grid((n, n)).angles)).first
        gaps.append(np.abs(got[0] - expected).max())
        assert_allclose(got[2, columns(OUTER)], 0.25, atol=1e-9)
        assert_allclose(got[2, columns(INNER)], 0.125, atol=1e-9)
    assert gaps[0] < 1.2e-4
    assert gaps[1] == pytest.approx(gaps[0] / 16.0, rel=0.02)


def test_the_figures_of_the_36_by_36_grid(mean):
    got = mean.first[AT["ax"], columns(["dphi_y1", "dalpha_x1", "dtheta_z", "dtheta_y"])]
    assert_allclose(got, [0.09409, 0.07267, 0.11099, 0.16676], atol=6e-6)  # digits given, and 2 arcmin


def test_the_key_factors_lead_over_the_three_accelerations_together(indices):
    together = averages.aggregate(exact.analyse(CHAIN, OUTPUTS[:3], GRID)).total
    assert_allclose(together[columns(OUTER)], 2 / 15, rtol=1e-5)
    assert_allclose(together[columns(INNER)], 1 / 10, rtol=1e-5)
    assert_allclose(together[columns(set(K) - set(KEY))], 1 / 15, rtol=1e-5)


def test_the_key_factors_lead_over_the_five_outputs_with_other_shares(indices):
    """wz being left out, the rates weigh the factors otherwise: 6/52, 5/52, 4/52."""
    together = averages.aggregate(indices).total
    assert_allclose(together[columns(OUTER)], 6 / 52, rtol=1e-5)
    assert_allclose(together[columns(INNER)], 5 / 52, rtol=1e-5)
    assert_allclose(together[columns(set(K) - set(KEY))], 4 / 52, rtol=1e-5)


def test_the_key_factors_lead_by_the_papers_mean_over_the_accelerations_too(mean):
    three = mean.first[:3].mean(axis=0)
    assert set(np.argsort(-three)[:6]) == set(columns(KEY))


def test_on_ax_alone_two_key_factors_do_not_lead(mean):
    ax = mean.first[AT["ax"]]
    assert ax[columns(TURNS_Z)].min() > ax[columns(OUTER)].max()


def test_the_negligible_factors_are_nil(indices):
    for output, names in NEGLIGIBLE.items():
        assert np.all(indices.first[AT[output]][:, columns(names)] < 1e-6)
        assert np.all(np.mean(indices.total[AT[output]][:, columns(names)], axis=0) < 2e-6)


def test_two_negligible_factors_interact_where_the_inner_axis_is_vertical():
    found = exact.analyse(CHAIN, OUTPUTS, [[0.0, 0.4]])
    assert_allclose(found.total[AT["az"], 0, columns(["dalpha_x1", "deps_x"])], 16 / 68, rtol=1e-5)


def test_three_to_five_times_is_one_and_a_half_to_two_point_three(mean):
    ax = mean.first[AT["ax"]]
    ratios = ax[K["dalpha_y2"]] / ax[columns([*TURNS_Z, "dphi_y1", "deps_y", "dalpha_x1", "deps_x"])]
    assert ratios.min() == pytest.approx(1.50, abs=0.005)
    assert ratios.max() == pytest.approx(2.29, abs=0.01)


def test_three_to_five_times_is_two_weighted_by_variance(indices):
    ax = averages.weighted(indices).first[AT["ax"]]
    others = columns([*TURNS_Z, "dphi_y1", "deps_y", "dalpha_x1", "deps_x"])
    assert_allclose(ax[K["dalpha_y2"]] / ax[others], 2.0, rtol=1e-5)


def test_four_to_five_times_is_two(mean):
    az = mean.first[AT["az"]]
    assert_allclose(az[K["dphi_y1"]] / az[columns(INNER)], 2.0, rtol=1e-4)


def test_no_average_gives_three_to_five_times(indices):
    """Two indices add up to the leading one at every position, so the larger of the two is at least its half in any
    average; of first order in the tolerances, which are 6e-4."""
    for output, pair, leading in (
        ("ax", ("dphi_y1", "dalpha_x1"), "dalpha_y2"),
        ("ay", ("dphi_y1", "dalpha_x1"), "dalpha_x2"),
        ("az", ("dalpha_x2", "dalpha_y2"), "dphi_y1"),
    ):
        first = indices.first[AT[output]]
        both = first[:, columns(pair)].sum(axis=1)
        assert_allclose(both, first[:, K[leading]], atol=1e-6)
        assert first[:, K[leading]].min() > 0.0


def test_accelerations_and_rates_share_their_full_circle_means():
    """What is left is the grid's error, 1e-4 at 10 deg and falling with the square of the step."""
    fine = averages.mean(exact.analyse(CHAIN, OUTPUTS, grid((144, 144)).angles)).first
    assert_allclose(fine[[AT["wx"], AT["wy"]]], fine[[AT["ax"], AT["ay"]]], atol=5e-5)


def test_accelerations_and_rates_differ_position_by_position(indices):
    apart = np.abs(indices.first[AT["wx"]] - indices.first[AT["ax"]])
    assert apart.max() == pytest.approx(0.30, abs=0.005)
    assert apart.mean() == pytest.approx(0.074, abs=0.0005)


def test_the_maps_of_the_rates_are_those_of_the_accelerations_shifted(indices):
    """Both references lie in the plane that the outer axis turns: one chain, another start."""
    shifted = exact.analyse(CHAIN, OUTPUTS, GRID + np.array([LATITUDE - pi / 2, 0.0]))
    assert_allclose(indices.first[3:], shifted.first[:2], atol=1e-13)
    assert_allclose(indices.total_minus_first[3:], shifted.total_minus_first[:2], rtol=1e-9, atol=1e-16)


def test_first_and_total_order_agree_away_from_the_singular_attitudes(indices):
    assert indices.total_minus_first.max() < 1.2e-5  # the paper: 1e-3
    assert averages.flagged(indices) == ()


def test_first_and_total_order_part_where_an_axis_lies_along_gravity():
    found = exact.analyse(CHAIN, OUTPUTS, grid((36, 36), half_step=False).angles)
    flags = averages.flagged(found)
    places = {
        name: {tuple(np.degrees(f.angles).round().astype(int)) for f in flags if f.output == name}
        for name in AT
    }
    assert len(places["az"]) == 72
    assert {phi1 for phi1, _ in places["az"]} == {0, 180}
    assert places["ax"] == {(phi1, phi2) for phi1 in (90, 270) for phi2 in (0, 180)}
    assert places["ay"] == {(phi1, phi2) for phi1 in (90, 270) for phi2 in (90, 270)}
    assert not places["wx"] | places["wy"]
    assert len(flags) == 80
    # which moves the means
    assert averages.mean(found).first[AT["az"], K["dphi_y1"]] == pytest.approx(0.237, abs=0.0005)


def test_indices_at_a_singular_attitude_in_closed_form():
    """d_az = g (X^2 + Y^2)/2 with X, Y sums of four equal errors; Var of a square is 0.8 s^4."""
    found = exact.analyse(CHAIN, OUTPUTS, [[0.0, 0.0]])
    whole = 2.0 * (4.0 * 0.8 + 6.0 * 4.0)
    rows = columns([*OUTER, *INNER, "dalpha_x1", "deps_x"])
    assert_allclose(found.first[AT["az"], 0, rows], 0.8 / whole, rtol=1e-5)
    assert_allclose(found.total_minus_first[AT["az"], 0, rows], 3.0 * 4.0 / whole, rtol=1e-5)


def test_the_flagged_zone_is_ten_tolerances_wide():
    near = exact.analyse(CHAIN, OUTPUTS, np.array([[19.0, 0.0], [20.0, 0.0], [32.0, 0.0]]) * ARCMIN)
    sums = near.first[AT["az"]].sum(axis=1)
    assert sums[0] < 0.99 < sums[1]
    assert near.total_minus_first[AT["az"], 2].max() < 1e-3


def test_figure_5c_is_flat(indices):
    assert_allclose(indices.first[AT["az"], :, K["dphi_y1"]], 0.25, atol=2e-5)


def test_figure_5c_has_a_knife_edge():
    edge = exact.analyse(CHAIN, OUTPUTS, np.array([[0.0, 0.0], [2.0, 0.0], [20.0, 0.0]]) * ARCMIN)
    got = edge.first[AT["az"], :, K["dphi_y1"]]
    assert_allclose(got, [1 / 68, 0.125, 0.2474], rtol=1e-3)


def test_a_local_analysis_is_as_good_as_exact_at_two_arcminutes(indices):
    gap = np.abs(local.analyse(CHAIN, OUTPUTS, GRID).first - indices.first).max(axis=2)
    assert 5e-8 < np.median(gap) < 2e-7
    assert gap.max() < 1.5e-5


def test_a_local_analysis_fails_close_to_a_singular_attitude():
    at = np.array([[0.5 * ARCMIN, 0.0]])
    apart = np.abs(local.analyse(CHAIN, OUTPUTS, at).first - exact.analyse(CHAIN, OUTPUTS, at).first)
    assert apart.max() == pytest.approx(0.22, abs=0.005)


def test_a_local_analysis_has_nothing_to_say_at_one():
    assert np.all(np.isnan(local.analyse(CHAIN, OUTPUTS, [[0.0, 0.0]]).first[AT["az"]]))


@pytest.fixture(scope="module")
def procedure():
    angles = grid((12, 12)).angles
    true = exact.analyse(CHAIN, OUTPUTS, angles)
    rng = np.random.default_rng(2023)
    found = sampled.analyse(CHAIN, OUTPUTS, angles, 1000, rng, sampling="random")
    return true.first, found.first - true.first, found.total - true.total


@pytest.mark.slow
def test_noise_of_the_papers_procedure_on_null_factors(procedure):
    true, first, total = procedure
    null = true < 1e-12
    assert 5e-6 < np.sqrt(np.mean(np.square(first[null]))) < 2e-5  # the paper's 1e-5
    assert np.abs(total[null]).max() < 1e-7  # the total order of the same rows is far better


@pytest.mark.slow
def test_noise_of_the_papers_procedure_at_a_position(procedure):
    """A linear output of uniform errors: N Var(S_i) = 2 S_i - S_i^2 with this estimator, to 5 % or so.

    144 x 5 independent groups of factors: 13 % are five standard deviations of the rms, 18 with the 5 %.
    """
    true, first, total = procedure
    seen = true > 0.01
    z = first[seen] / np.sqrt((2.0 * true[seen] - true[seen] ** 2) / 1000.0)
    assert np.sqrt(np.mean(np.square(z))) == pytest.approx(1.0, abs=0.18)
    assert 0.01 < np.sqrt(np.mean(np.square(first[seen]))) < 0.03
    assert 0.005 < np.sqrt(np.mean(np.square(total[seen]))) < 0.01


def test_why_outputs_are_centred_first(indices):
    """X^2 + Y^2 as above: mean 8 s^2, variance 2 (4 x 0.8 + 6 x 4) s^4."""
    at = exact.analyse(CHAIN, OUTPUTS, [[0.0, 0.0]])
    ratio = at.bias[AT["az"], 0] / np.sqrt(at.variance[AT["az"], 0])
    assert ratio == pytest.approx(8.0 / sqrt(54.4), rel=1e-5)
    assert ratio == pytest.approx(1.08, abs=0.005)
    assert np.abs(indices.bias / np.sqrt(indices.variance)).max() < 0.01


def with_x_outer(axes):
    """The chain as data: the outer joint about x, some errors about other axes."""
    turned = {"phi1": "x", **axes}
    return Chain(
        tuple(
            replace(each, axis=turned.get(each.name, each.axis)) if isinstance(each, Joint | Error) else each
            for each in CHAIN.elements
        )
    )


def test_with_x_outer_the_null_factors_are_not_the_papers():
    """Whether the errors keep their axes, or positioning and wobble change places with the axis."""
    for axes in ({}, {"dphi_y1": "x", "dalpha_x1": "y"}):
        other = exact.analyse(with_x_outer(axes), OUTPUTS, GRID)
        az = averages.mean(other).first[AT["az"]]
        assert az[K["deps_y"]] < 1e-6  # a key factor of the paper
        assert az[K["deps_x"]] == pytest.approx(0.25, abs=1e-4)  # a negligible one


def test_with_x_outer_ax_and_wx_do_not_share_their_means():
    mean = averages.mean(exact.analyse(with_x_outer({}), OUTPUTS, GRID)).first
    assert mean[AT["ax"], K["dtheta_y"]] > 1.4 * mean[AT["wx"], K["dtheta_y"]]


DEG_H = parse_unit("deg/h")
COEFFICIENTS = {
    **{"DX_F": 50.0, "DX_X": 60.0, "DX_Y": 40.0, "DX_Z": 8.0, "DX_XX": 2.0},
    **{"DX_YY": 1.5, "DX_XY": 1.0, "DX_XZ": 3.0, "DX_YZ": 2.5},
}
PLANS = {
    "12": named("12-position").angles,
    "24": named("24-position").angles,
    "6 x 6": grid((6, 6)).angles,
    "36 x 36": GRID,
}


def study(chain=CHAIN, **design):
    """A gyrowheel of the paper's kind on the table, 0.01 deg/h of noise."""
    return TurntableSettings(
        Site(9.8, (), LATITUDE),
        "two_axis_turntable",
        chain,
        named("24-position"),
        PositionDesign(grid((36, 36)), **design),
        instrument=Instrument(
            unit=DEG_H,
            coefficients={name: value * DEG_H.factor for name, value in COEFFICIENTS.items()},
            noise=0.01 * DEG_H.factor,
        ),
    )


def drift(chain, angles, known=(), weighted=True):
    """RMS error of the predicted drift over all directions of gravity [deg/h], by error of the table (11,)."""
    settings = study(chain)
    model = table_model(settings, ["y_x"], known)
    c = model.channels[0].linear(stated_values(settings, model.channels[0]))
    noise = settings.instrument.noise
    fit = regression.fit(model, angles, model.outputs(angles, c), [noise], start=c)
    if not weighted:
        fit = replace(fit, gain=np.linalg.pinv(model.rows(angles)[:, 0])[..., None])
    moments = sphere_moments(model)
    return np.array([np.sqrt(np.trace(x.T @ moments @ x)) for x in shifts(fit)]) / DEG_H.factor


@pytest.fixture(scope="module")
def plans():
    """The paper's way with a limit that bites; the free design; D-optimal for noise alone."""
    limit = Constraint(INNER, ("ax", "ay"), 0.05)
    return planning.design(study(criterion="I", constraint=limit)).compare[:3]


@pytest.mark.slow
def test_a_constant_inner_error_is_the_same_in_every_plan(plans):
    """It turns the instrument, and coefficients turned with it read the same: no position tells the two apart."""
    constant = CHAIN.with_scope(Scope.RIG)
    angles = [plans[1].plan.angles, plans[2].plan.angles, PLANS["6 x 6"], PLANS["36 x 36"]]
    found = np.array([drift(constant, each) for each in angles])
    sizes = {("dalpha_x2", "dtheta_x"): 0.0079, ("dalpha_y2", "dtheta_y"): 0.0118, TURNS_Z: 0.0140}
    for names, size in sizes.items():
        inner = found[:, columns(names)]
        assert np.ptp(inner) < 1e-6 * inner.max()
        assert inner[0, 0] == pytest.approx(size, abs=6e-5)
    # the outer ones fall with the positions
    outer = found[:, columns(OUTER)]
    assert_allclose(outer[1], 0.0070, atol=3e-4)
    assert_allclose(outer[2:, 0], [0.0060, 0.0005], atol=6e-5)


@pytest.mark.slow
def test_where_earth_rate_is_known_the_outer_errors_nearly_vanish(plans):
    """And the inner ones about y with them; those about x leave the rate about x as it is."""
    constant, k = CHAIN.with_scope(Scope.RIG), ("k_x", "k_y", "k_z")
    angles = [PLANS["12"], PLANS["24"], plans[2].plan.angles, PLANS["36 x 36"]]
    found = np.array([drift(constant, each, k) for each in angles])
    assert_allclose(found[[0, 1, 3], K["dphi_y1"]], [0.0082, 0.0025, 0.0013], atol=6e-5)
    assert_allclose(found[[0, 1, 3], K["dtheta_y"]], [0.0104, 0.0038, 0.0009], atol=6e-5)
    assert found[2, K["dphi_y1"]] < 0.0025
    assert np.ptp(found[:, K["dtheta_x"]]) < 1e-6 * found[0, K["dtheta_x"]]


def test_redrawn_errors_average_out_alike():
    """Four times the positions of an even grid, each of the same weight: half the error, whichever it is."""
    redrawn, k = CHAIN.with_scope(Scope.POSITION), ("k_x", "k_y", "k_z")
    few, many = (drift(redrawn, grid((n, n)).angles, k, weighted=False) for n in (12, 24))
    assert_allclose(few / many, 2.0, rtol=1e-6)


@pytest.mark.slow
def test_limiting_the_indices_lowers_the_share_and_raises_the_error(plans):
    share = [sum(each.drift_shares[name] for name in INNER) for each in plans[:2]]
    assert share[0] == pytest.approx(0.25, abs=0.02)
    assert share[1] == pytest.approx(0.34, abs=0.02)
    rms = np.array([each.figures.rms_prediction for each in plans]) / DEG_H.factor
    assert_allclose(rms[:2], [0.060, 0.029], rtol=0.03)  # which of many good plans the search finds
    assert rms[1] < rms[2]


def test_on_az_no_limit_below_an_eighth_leaves_a_position(indices):
    """sin^2 phi2 / 4 and cos^2 phi2 / 4: one of them is 1/8 or more. On ax and ay they are 1/4 at most."""
    inner = indices.first[:3, :, columns(INNER)].max(axis=2)
    assert inner[2].min() >= 0.125 - 1e-5
    assert inner[:2].max() < 0.25 + 1e-5


@pytest.mark.campaign
def test_the_pictures_are_drawn(tmp_path):
    folder = Path(__file__).parents[2] / "docs" / "pictures"
    subprocess.run([sys.executable, str(folder / "zhao_2023.py"), str(tmp_path)], check=True, timeout=60)
    page = (folder.parent / "published" / "zhao-2023.md").read_text(encoding="utf-8")
    for drawn in tmp_path.iterdir():
        assert f"../pictures/{drawn.name}" in page
        assert drawn.stat().st_size < 64_000
    assert {each.name for each in tmp_path.iterdir()} == {each.name for each in folder.glob("zhao*.svg")}
