"""Pictures, tables and pages of self-calibration: they are drawings that can be read, and say what the numbers say."""

import base64
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from paper_study import ARCSEC, MICRO_G, PER_HOUR, PRIOR, TRUTH, study

import inercal.systems.selfcal.figures as drawn_by
from inercal.faces.report import courses as filtering
from inercal.faces.report.cells import Cell
from inercal.faces.report.coefficients import dots
from inercal.faces.report.courses import turning
from inercal.foundation.findings import Status
from inercal.foundation.geometry.rotations import exp, multiply, normalize
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.budget import TypeA, combine
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.before.bounds import PathBounds
from inercal.systems.selfcal.before.observability import observability
from inercal.systems.selfcal.before.path_design import ComparedPath, DesignedPath
from inercal.systems.selfcal.figures.design import page as design_page
from inercal.systems.selfcal.figures.filters import attitude_errors
from inercal.systems.selfcal.figures.monte_carlo import page as campaign_page
from inercal.systems.selfcal.filters.filter_result import FilterResult, RowHistory
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.filters.residuals import gimbals
from inercal.systems.selfcal.monte_carlo import Campaign
from inercal.systems.selfcal.platform.coefficients import (
    names,
    product_slope,
    shown_units,
    to_linear,
    to_product,
    units,
)
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn, path
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.result.tables import bounds_by_path, side_by_side, turns, weak_combinations
from inercal.systems.selfcal.task import Calibration

SHORT = PlatformPlan((Turn("z", np.radians(30.0)), Rest(5.0), Turn("x", np.radians(-20.0))))
"""55 s, 276 rows."""

SIZES = np.concatenate([np.full(3, s) for s in (PER_HOUR, *3 * (ARCSEC,), MICRO_G, 1e-6, 1e-6, ARCSEC)])


def filtered(kind="error-state", p=18, seed=1, **changes):
    """A filter that converges as one over the square root of time to within 1 % of the prior, with honest errors."""
    rng, th = np.random.default_rng(seed), SHORT.angles()
    n = len(th)
    q, _ = gimbals(th, study().world)
    u = PRIOR[:p] * 0.01 * np.sqrt(n / np.maximum(np.arange(n), n / 1e4))[:, None]
    course = to_linear(TRUTH)[:p] + u * rng.standard_normal(p)
    error = 0.5 * ARCSEC * rng.standard_normal((n, 3))
    history = RowHistory(multiply(q, exp(error)), np.full((n, 3), 0.5 * ARCSEC), course, u)
    innovations = rng.standard_normal((n - 1, 6))
    return replace(
        FilterResult(
            kind=kind,
            names=names(p),
            coefficients=course[-1],
            covariance=np.diag(u[-1] ** 2),
            attitude=history.attitude[-1],
            nis=np.sum(innovations**2, axis=1),
            dims=np.full(n - 1, 6),
            innovations=innovations,
            history=history,
            seconds=0.0027,
        ),
        **changes,
    )


def evidence(found=None, status=Status.OK, **changes):
    """A calibration that found that."""
    found = filtered() if found is None else found
    p, rng = len(found.coefficients), np.random.default_rng(2)
    th = SHORT.angles()
    measured = th + 2.0 * ARCSEC * rng.standard_normal(th.shape)
    t = SHORT.step * np.arange(len(th), dtype=float)
    recording = Recording(t, np.zeros((len(t) - 1, 3)), measured, np.zeros((len(t), 3)))
    slope = product_slope(found.coefficients)
    covariance = slope @ found.covariance @ slope.T
    sources = [
        TypeA("noise", 1.0, "1", 0.7 * covariance, 900.0),
        TypeA("prior", 1.0, "1", 0.3 * covariance, 9e9),
    ]
    total, dof, budget, _ = combine(names(p), sources)
    estimate = Estimate(
        "selfcal",
        names(p),
        units(names(p)),
        to_product(found.coefficients),
        total,
        dof,
        status,
        "as it is",
        budget=budget,
        provenance={"settings": {}},
    )
    bounds = PathBounds(names(p), 0.9 * covariance, PRIOR[:p], np.zeros((0, p)))
    of = FilterProblem(study().world, study().noise, PRIOR[:p])
    return replace(Calibration(estimate, of, recording, found, bounds, study(plan=SHORT)), **changes)


def words_of(svg):
    """All words of a drawing, which has to be well-formed and to need nothing else."""
    assert ET.fromstring(svg).tag.endswith("svg")
    assert all(link.startswith(("#", "data:")) for link in re.findall(r'href="([^"]*)"', svg))
    assert "nan" not in " ".join(re.findall(r' d="([^"]*)"', svg)).lower()
    assert len(svg) < 450_000
    return re.findall(r"<!-- (.*?) -->", svg)


def texts(picture):
    return words_of(picture.svg)


def check(page):
    """A page that needs nothing but itself, and each of its drawings."""
    assert "<script" not in page
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(link.startswith("data:") for link in links)
    for link in links:
        words_of(base64.b64decode(link.partition(",")[2]).decode())
    return page


def titles(pictures):
    return [picture.title for picture in pictures]


def test_a_calibration_without_a_known_truth():
    drawn = drawn_by.pictures(evidence())
    assert titles(drawn) == [
        "Uncertainties beside their bounds",
        "Convergence of the coefficients",
        "How the uncertainties fall",
        "The path",
        "Axes and signs of the gimbals",
        "Attitude against the encoders",
        "Change still to come of the accelerometers' coefficients, in percent",
        "Normalised innovations squared",
        "Innovations and whether they are white",
        "Correlation of the coefficients",
        "Where the uncertainty comes from",
    ]
    words = {picture.title: texts(picture) for picture in drawn}
    assert {"th_x", "th_y", "th_z", "angle [°]", "time [s]"} <= set(words["The path"])
    shown = " ".join(words["Convergence of the coefficients"])
    assert all(f"{name}: " in shown for name in names(18))
    assert all(unit in shown for unit in ("deg/h", "arcsec", "ug", "ppm"))
    assert set(names(18)) <= set(words["How the uncertainties fall"])
    assert {"acc x", "attitude Z", "lag [rows]"} <= set(words["Innovations and whether they are white"])
    assert {"bound", "estimate", "3.0 of 300 arcsec"} <= set(words["Uncertainties beside their bounds"])
    assert "truth" not in drawn[1].caption


@pytest.mark.slow
def test_a_simulation_is_set_against_its_truth():
    q, _ = gimbals(SHORT.angles(), study().world)
    found = evidence(compared={"gimbal-ukf": filtered("gimbal-ukf", seed=3)}, truth=TRUTH)
    drawn = {picture.title: picture for picture in drawn_by.pictures(found, q)}
    assert "Red dots: the truth" in drawn["Convergence of the coefficients"].caption
    assert {"error-state", "gimbal-ukf"} <= set(texts(drawn["Error of the attitude"]))
    assert [f"q{k} [10⁻⁶]" in texts(drawn["Error of the attitude"]) for k in range(4)] == [True] * 4
    assert "error of ka0 [%]" in texts(drawn["Error of the accelerometers' coefficients, in percent"])


def test_errors_of_the_attitude_do_not_know_the_sign_of_a_quaternion():
    """q and -q are one attitude; the root mean square that is told is that of the components."""
    rng, t = np.random.default_rng(4), np.arange(50.0)
    truth = normalize(rng.normal(size=(50, 4)))
    estimated = multiply(truth, exp(1e-5 * rng.standard_normal((50, 3))))
    flipped = estimated * rng.choice([-1.0, 1.0], size=(50, 1))
    one, other = (attitude_errors(t, truth, {"f": q}) for q in (estimated, flipped))
    assert one.svg == other.svg
    rms = np.sqrt(np.mean((estimated - truth) ** 2, axis=0))
    assert ", ".join(f"{x:.1e}" for x in rms) in one.caption


def test_the_attitude_against_the_encoders_turns_from_these_to_the_estimate(monkeypatch):
    """An estimate that is turned by 5 arcsec about X_p from the encoders' attitude is drawn so, with its sign."""
    told = {}
    monkeypatch.setattr(
        drawn_by, "attitude_correction", lambda t, rotation, u, changes: told.update(rotation=rotation)
    )
    none = Estimate.without(Basis("selfcal"), Status.NOT_CONVERGED, "")  # spares the other pictures
    found = evidence(filtered("map", innovations=np.zeros((0, 6))), estimate=none)
    read, _ = gimbals(found.recording.th, study().world)
    turned = multiply(read, exp(np.array([5.0 * ARCSEC, 0.0, 0.0])))
    estimated = replace(found.filtered, history=replace(found.filtered.history, attitude=turned))
    drawn_by.pictures(replace(found, filtered=estimated))
    assert told["rotation"] / ARCSEC == pytest.approx(np.tile([5.0, 0.0, 0.0], (len(read), 1)), abs=1e-6)


def with_gaps(found):
    """The same with rows in which nothing was measured."""
    lost = slice(40, 60)
    recording, of = found.recording, found.filtered
    th, innovations, nis, dims = recording.th.copy(), of.innovations.copy(), of.nis.copy(), of.dims.copy()
    th[lost], innovations[lost], nis[lost], dims[lost] = np.nan, np.nan, np.nan, 0
    return replace(
        found,
        recording=replace(recording, th=th),
        filtered=replace(of, innovations=innovations, nis=nis, dims=dims),
    )


def diverged():
    """A filter whose numbers ended as NaN and infinity."""
    found = filtered("gimbal-ukf")
    course, u = found.history.coefficients.copy(), found.history.u.copy()
    course[100:], u[100:], course[90:100] = np.nan, np.inf, 1e300
    return replace(
        found,
        coefficients=np.full(18, np.nan),
        covariance=np.full((18, 18), np.nan),
        nis=np.where(np.arange(len(found.nis)) < 99, found.nis, np.inf),
        innovations=np.where(np.arange(len(found.nis))[:, None] < 99, found.innovations, np.nan),
        history=replace(found.history, coefficients=course, u=u),
        converged=False,
        message="the filter diverged where the gimbals lock",
    )


def without_coefficients():
    """A calibration that says why it has none."""
    none = Estimate.without(Basis("selfcal", provenance={"settings": {}}), Status.NOT_CONVERGED, "diverged")
    return evidence(diverged(), bounds=evidence().bounds, estimate=none)


@pytest.mark.parametrize(
    "found",
    [
        pytest.param(lambda: with_gaps(evidence(filtered(p=24), truth=TRUTH)), id="extended, with gaps"),
        pytest.param(
            lambda: evidence(filtered("map"), compared={"gimbal-ukf": diverged()}, truth=TRUTH), id="compared"
        ),
        pytest.param(
            lambda: evidence(filtered(history=None, innovations=np.zeros((0, 6))), Status.UNOBSERVABLE),
            id="unobservable, no history",
        ),
        pytest.param(without_coefficients, id="diverged"),
    ],
)
def test_every_case_has_a_page(found):
    found, settings = found(), study(plan=SHORT, goal={"kg0_x": 0.001 * PER_HOUR})
    page = check(drawn_by.page(replace(found, settings=settings)))
    assert found.estimate.status.meaning in page
    assert "What the path cannot see" in page
    assert ("Filters side by side" in page) == bool(found.compared)
    assert ("Filters against each other" in page) == bool(found.compared)
    assert ("beta_z" in page) == (len(found.bounds.names) == 24)
    assert ("Convergence of the coefficients" in page) == (
        found.filtered.history is not None and found.filtered.kind != "map"
    )


def test_what_people_see_is_the_same_in_other_units():
    si = evidence(filtered(p=24)).estimate
    shown = si.shown()
    factor = [parse_unit(unit).factor for unit in shown.units]
    assert shown.units == shown_units(names(24))[0]
    assert shown.values * factor == pytest.approx(si.values)
    assert shown.u * factor == pytest.approx(si.u)
    assert shown.correlation == pytest.approx(si.correlation)
    assert shown.budget[0].share == si.budget[0].share
    assert (shown.budget[0].u, shown.budget[0].unit) == (1.0, "1")


def test_angles_of_the_conditions_are_degrees_for_people():
    given = {"site": {"latitude_rad": np.pi / 4.0, "gravity_m_s2": 9.8}, "ranges": {"th_x_rad": [0.0, np.pi]}}
    unknown = {"latitude_rad": None}
    shown = replace(evidence().estimate, conditions=given | {"other": unknown}).shown().conditions
    assert shown == {
        "site": {"latitude_deg": pytest.approx(45.0), "gravity_m_s2": 9.8},
        "ranges": {"th_x_deg": pytest.approx([0.0, 180.0])},
        "other": unknown,
    }


def test_filters_side_by_side_with_the_truth():
    """(estimate - truth) / truth in percent; a truth of zero has no percentage; 10 us of 0.2 s are 0.005 %."""
    found, truth = filtered(), TRUTH.copy()
    truth[0] = 0.0
    estimates, errors, costs = side_by_side(
        {"error-state": found}, np.zeros(18), truth, 0.2, {"error-state": "not_converged"}
    )
    value = to_product(found.coefficients)
    for k, row in enumerate(errors.rows):
        assert row[0] == names(18)[k]
        if k:
            assert float(row[1]) == pytest.approx(100.0 * (value[k] - truth[k]) / truth[k], rel=0.01)
        shown, u = float(estimates.rows[k][3]), float(estimates.rows[k][4])
        assert shown == pytest.approx(value[k] / SIZES[k], abs=0.06 * u)
    assert errors.rows[0][1:] == ("–", "–")
    assert costs.rows[0][2] == "not converged"
    assert float(costs.rows[0][5]) == pytest.approx(found.step_us, rel=0.01)
    assert float(costs.rows[0][6]) == pytest.approx(100.0 * found.step_us * 1e-6 / 0.2, rel=0.01)


def test_filters_side_by_side_without_a_truth():
    """Differences from the first, over its uncertainty; a filter that failed says so."""
    first, other = filtered(), filtered("svd-qukf", seed=6)
    _, apart, costs = side_by_side(
        {"error-state": first, "svd-qukf": other, "map": diverged()}, np.zeros(18), None, 0.2, {}
    )
    u = np.sqrt(np.diag(first.covariance))
    linear = (other.coefficients - first.coefficients) / u
    for k in (0, 8, 14, 17):  # those that are alike in both forms
        assert [float(apart.rows[k][1]), float(apart.rows[k][2])] == pytest.approx([0.0, linear[k]], rel=0.01)
        assert apart.rows[k][3] == "–"
    assert [row[2] for row in costs.rows] == ["ok", "ok", "not converged"]
    assert "diverged where the gimbals lock" in costs.caption


def test_what_the_path_cannot_see_is_named():
    """A coefficient left at its prior comes first; one that is known only together with another, as a combination."""
    prior, p = PRIOR[:18], 18
    scaled = 1e-4 * np.eye(p)
    scaled[8, 8] = 0.95**2
    scaled[np.ix_([0, 6], [0, 6])] = 0.5 * 0.7**2 * np.array([[1.0, -1.0], [-1.0, 1.0]]) + 1e-5 * np.eye(2)
    table = weak_combinations(PathBounds(names(p), scaled * np.outer(prior, prior), prior, np.zeros((0, p))))
    assert table.rows[0] == ("ds_z", "not seen", "95")
    combination, remark, left = table.rows[1]
    assert set(combination.split()) >= {"kg0_x", "ds_x", "-"}
    assert (remark, float(left)) == ("left at its prior", pytest.approx(70.0, abs=0.1))
    assert all(row[1] == "" for row in table.rows[2:])
    assert table.text().splitlines()[1].startswith("ds_z")


def test_turns_are_counted_up():
    rows = turns(SHORT).rows
    assert [row[1] for row in rows] == ["th_z (platform)", "rest", "th_x (outer)"]
    assert [float(row[5]) for row in rows] == [30.0, 35.0, 55.0]
    assert rows[-1][6:] == ("-20", "0", "30")


def test_the_joint_that_turns_is_found_in_noise_and_gaps():
    th, t = SHORT.angles(), SHORT.step * np.arange(276)
    noisy = th + 5.0 * ARCSEC * np.random.default_rng(7).standard_normal(th.shape)
    noisy[60:70] = np.nan
    (z,), (x,) = turning(t, noisy[:, 2]), turning(t, noisy[:, 0])
    assert z == pytest.approx((0.0, 30.0), abs=2.0)
    assert x == pytest.approx((35.0, 55.0), abs=2.0)
    assert turning(t, noisy[:, 1]) == []
    assert turning(t, np.full(276, np.nan)) == []


def test_autocorrelation_of_a_known_process():
    """First-order autoregression: phi^k, each to 5/sqrt(n) times the spread (1 + phi^2)/(1 - phi^2) of its estimate."""
    rng, n, phi = np.random.default_rng(8), 20_000, 0.6
    x = np.empty(n)
    x[0] = rng.standard_normal()
    for k in range(1, n):
        x[k] = phi * x[k - 1] + np.sqrt(1.0 - phi**2) * rng.standard_normal()
    x[rng.random(n) < 0.2] = np.nan
    r, pairs = filtering.autocorrelation(x, 8)
    spread = np.sqrt((1.0 + phi**2) / (1.0 - phi**2) / pairs)
    assert np.all(np.abs(r - phi ** np.arange(1, 9)) < 5.0 * spread)
    assert pairs == pytest.approx(0.64 * n, rel=0.05)
    assert filtering.autocorrelation(np.full(5, np.nan), 8)[0].tolist() == [0.0] * 4


@pytest.mark.parametrize(("size", "verdict"), [(1.0, "within"), (1.2, "above"), (0.8, "below")])
def test_the_mean_nis_is_judged_by_its_own_band(size, verdict):
    nis = size * np.random.default_rng(9).chisquare(6, 3000)
    picture = filtering.nis(np.arange(3000.0), nis, np.full(3000, 6))
    assert (
        f"the mean is {nis.mean():.3f}, {verdict} 5.877 to 6.125" in picture.caption
    )  # 6 ± 1.96 sqrt(12 / 3000)
    texts(picture)


def test_nothing_measured_has_no_nis():
    picture = filtering.nis(np.arange(3.0), np.full(3, np.nan), np.zeros(3, dtype=np.int64))
    assert picture.caption == "Nothing was measured."
    texts(picture)


@given(st.floats(-1e6, 1e6), st.floats(1e-9, 1e9))
@example(0.5, 999999999.0)
@example(0.0, 2.0 * np.nextafter(0.1, 0.0))
def test_ticks_are_few_and_inside(low, span):
    cell = Cell(0.0, 0.0, 1.0, 1.0, (0.0, 1.0), (low, low + span))
    if cell.y[1] - cell.y[0] < 1e-9 * abs(low):
        return  # too close for doubles
    ticks = np.array(cell.ticks())
    assert 2 <= len(ticks) <= 6
    slack = 1e-9 * (abs(low) + span)
    assert np.all((low - slack <= ticks) & (ticks <= low + span + slack))


def test_a_cell_maps_its_limits_to_its_edges():
    cell = Cell(1.0, 2.0, 3.0, 4.0, (10.0, 20.0), (1e-2, 1e2), "log")
    assert cell.across(np.array([10.0, 15.0, 20.0])).tolist() == [1.0, 2.5, 4.0]
    assert cell.up(np.array([1e-2, 1.0, 1e2])) == pytest.approx([2.0, 4.0, 6.0])
    assert np.isnan(cell.up(np.array([0.0, -1.0, np.nan]))).all()
    assert cell.ticks() == pytest.approx([1e-2, 1e0, 1e2])


def judged(name, plan, size, settings):
    bounds = PathBounds(names(18), np.diag((size * PRIOR[:18]) ** 2), PRIOR[:18], np.zeros((0, 18)))
    return ComparedPath(name, plan, observability(bounds, settings.goal), float(np.max(size)), ())


def told(found):
    """What a command brings back, without its numbers."""
    return Estimate.without(Basis("design selfcal"), Status.OK, found.message)


def test_the_page_of_a_design():
    settings = study(goal={"kg0_x": 0.01 * PER_HOUR})
    sight = np.full(18, 0.01)
    sight[8] = 0.95
    found = DesignedPath(
        (
            judged("found", path("plain"), np.full(18, 0.002), settings),
            judged("study", SHORT, sight, settings),
        ),
        "up to 5 turns",
        (),
    )
    page = check(design_page(found, settings, told(found)))
    assert page.index("Comparison of paths") < page.index("Turns") < page.index("What the path cannot see")
    for words in ("found", "ds_z", "(rest 5 s)", "up to 5 turns", "0.0005 deg/√h", "10 ug", "The path found"):
        assert words in page


def test_a_design_is_set_against_its_goals():
    """The last column is the bound of the path found over the goal, and the picture has a bar at each goal."""
    settings = study(goal={"kg0_x": 0.01 * PER_HOUR})
    found = DesignedPath((judged("found", SHORT, np.full(18, 0.002), settings),), "", ())
    table = bounds_by_path(found)
    ratio = 0.002 * PRIOR[0] / (0.01 * PER_HOUR)
    assert table.columns[-1] == ("of goal", "")
    assert [row[-1] for row in table.rows] == [f"{ratio:.3g}", *["–"] * 17]
    assert "Bar: the goal." in design_page(found, settings, told(found))
    without = DesignedPath((judged("found", SHORT, np.full(18, 0.002), study()),), "", ())
    assert bounds_by_path(without).columns[-1] == ("prior", "")
    assert "Bar: the goal." not in design_page(without, study(), told(without))
    with_goal, plain = (
        dots("", "", ("a", "b"), ("1", "1"), {"found": np.array([2.0, 3.0])}, goal)
        for goal in (np.array([1.0, np.nan]), None)
    )
    assert "goal" in texts(with_goal)
    assert "goal" not in texts(plain)


@pytest.mark.slow
def test_statistics_are_in_words():
    """Nothing of a self-calibration is a residual of |f|; what a row cost is there with its share of the interval."""
    statistics = {"residual_rms": 1.001, "chi2": 16220.0, "nis_mean": 6.008, "steps": 2700.0}
    calibration = evidence()
    cost = {"result": {"sample_interval": 0.2}, "timing": {"step": 4e-6}}
    own = replace(calibration.estimate, statistics=statistics, **cost)
    page = drawn_by.page(replace(calibration, estimate=own))
    for words in (
        "<dt>root-mean-square normalised innovation, expected 1</dt><dd>1.001</dd>",
        "<dt>normalised innovation squared (NIS), mean</dt><dd>6.008</dd>",
        "<dt>time of a row</dt><dd>4 µs</dd>",
        "<dt>time of a row, of the sample interval</dt><dd>0.002 %</dd>",
    ):
        assert words in page
    assert "|f|" not in page


def test_logarithmic_axes_have_one_style():
    (drawn,) = (each for each in drawn_by.convergence(evidence()) if "fall" in each.title)
    assert {"10⁻²", "1"} <= set(texts(drawn))
    assert "0.01" not in texts(drawn)


def test_the_page_of_a_campaign():
    """Errors of the stated size pass; those of twice the size are outside, in numbers and in colour."""
    rng, u = np.random.default_rng(10), 0.01 * PRIOR[:18]
    error = u * rng.standard_normal((200, 18))

    def campaign(size):
        wrong = size * error
        return Campaign(
            "error-state",
            names(18),
            wrong,
            np.tile(u, (200, 1)),
            wrong,
            np.tile(np.diag(u**2), (200, 1, 1)),
            u,
            rng.chisquare(6 * 275, 200) / 275,
            275.0,
            6.0,
            200,
        )

    sound, poor, cautious = (
        campaign_page(found, study(), told(found)) for found in map(campaign, (1.0, 2.0, 0.3))
    )
    assert "the stated uncertainties hold: 200 runs" in sound
    assert "the stated uncertainties are too small" in poor
    assert "of them converged; outside, but harmless" in cautious
    assert campaign(1.0).harmless == ""
    assert campaign(0.3).message.endswith("NEES")
    for page in (check(sound), check(poor)):
        assert "error-state filter (error-state)" in page
        assert "Coverage, and errors beside uncertainties and bounds" in page
    ratio = np.sqrt(np.mean((error / u) ** 2, axis=0))
    for k, name in enumerate(names(18)):
        row = re.search(rf"<tr><td><b>{name}</b></td>(.*?)</tr>", poor)[1]
        assert f">{2.0 * ratio[k]:.3f}<" in row
