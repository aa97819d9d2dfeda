"""Pictures and pages of calibrations and designs, for sound, weak and failed ones, and what people see of numbers."""

import base64
import re

import numpy as np
import pytest

from inercal.faces.report.html import render
from inercal.faces.report.marks import Dots
from inercal.faces.report.sphere import hemispheres
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import rounded
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, named
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.figures import pictures
from inercal.systems.turntable.figures.design import page as design_page
from inercal.systems.turntable.positions.planning import design
from inercal.systems.turntable.settings import Instrument, PositionDesign, TurntableSettings
from inercal.systems.turntable.simulate import simulate_positions
from inercal.systems.turntable.task import calibrate

DEG_H = parse_unit("deg/h")
ARCMIN = np.radians(1.0 / 60.0)
DRIFT = {
    "DX_F": 50.0,
    "DX_X": 60.0,
    "DX_Y": 40.0,
    "DX_Z": 8.0,
    "DX_XX": 2.0,
    "DX_XZ": 3.0,
    "DY_F": 30.0,
    "DY_X": -20.0,
}
ALL = [
    "Residual of each position",
    "Coefficients and their uncertainties",
    "Positions",
    "Axes and signs of the table",
    "Correlation of the coefficients",
    "Where the uncertainty comes from",
    "Which tolerance matters for which coefficient",
    "What halving a tolerance brings",
    "What the scopes mean",
]


def gyrowheel(**changes):
    given = {"unit": DEG_H, "coefficients": {k: v * DEG_H.factor for k, v in DRIFT.items()}} | changes
    return Instrument(noise=0.01 * DEG_H.factor, **given)


def study(plan, instrument, half_width=2.0 * ARCMIN, **changes):
    chain = turntable("two_axis_turntable", None if half_width is None else uniform(half_width))
    site = Site(9.8, latitude=np.radians(39.1))
    return TurntableSettings(
        site,
        "two_axis_turntable",
        chain,
        plan,
        PositionDesign(grid((12, 12)), **changes),
        instrument=instrument,
    )


def calibrated(plan, instrument, half_width=2.0 * ARCMIN):
    settings = study(plan, instrument, half_width)
    return calibrate(simulate_positions(settings, np.random.default_rng(4)), settings)


def check(page):
    assert "<script" not in page
    links = re.findall(r'(?:src|href)="([^"]*)"', page)
    assert all(link.startswith("data:") for link in links)
    for link in links:
        svg = base64.b64decode(link.partition(",")[2]).decode()
        assert all(target.startswith(("#", "data:")) for target in re.findall(r'href="([^"]*)"', svg))
    return page


@pytest.mark.slow
@pytest.mark.parametrize("plan", [named("24-position"), grid((6, 6))], ids=["stated", "fitted"])
def test_a_sound_calibration(plan):
    calibration = calibrated(plan, gyrowheel())
    assert calibration.estimate.status is Status.OK
    drawn = pictures(calibration)
    assert [picture.title for picture in drawn] == ALL
    assert all(len(picture.svg) < 300_000 for picture in drawn)
    page = check(render(calibration.shown, drawn, "Drift"))
    assert '<th colspan="7">Axis X</th>' in page
    assert '<th colspan="7">Axis Y</th>' in page
    assert "{" not in page[page.index("<h2>How it was done</h2>") :]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "unit", "noise"),
    [
        pytest.param("accelerometer", "mg", 1e-4, marks=pytest.mark.campaign),
        pytest.param("gyro", "deg/h", 1e-7, marks=pytest.mark.campaign),
        ("gyro", "count", 1.0),
    ],
)
def test_every_kind_of_instrument(kind, unit, noise):
    gain = {f"S_{axis}": 1e6 for axis in "xyz"} if unit == "count" else {}
    instrument = Instrument(kind, parse_unit(unit), noise=noise, coefficients=gain)
    calibration = calibrated(grid((8, 8)), instrument)
    assert calibration.estimate.names
    page = check(render(calibration.shown, pictures(calibration), "Test"))
    assert ("Accelerometers" if kind == "accelerometer" else "Gyro") in page


def test_a_perfect_table_has_no_tolerances():
    drawn = pictures(calibrated(grid((6, 6)), gyrowheel(), None))
    assert [picture.title for picture in drawn] == ALL[:6]


def test_positions_that_identify_too_little_are_shown():
    calibration = calibrated(named("16-cube"), gyrowheel())
    assert calibration.estimate.status is Status.UNOBSERVABLE
    drawn, table = pictures(calibration)
    assert drawn.title == "Positions"
    assert table.title == "Axes and signs of the table"
    assert "16-cube" in drawn.caption
    assert "residual" not in drawn.caption
    check(render(calibration.shown, [drawn], "Too few"))


@pytest.mark.slow
def test_many_positions_stay_small():
    drawn = pictures(calibrated(grid((36, 36)), gyrowheel()))
    assert all(len(picture.svg) < 700_000 for picture in drawn)


def test_every_position_is_drawn_on_its_hemisphere():
    rng = np.random.default_rng(6)
    directions = rng.normal(size=(30, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for panel, upper in zip(hemispheres(directions, rng.normal(size=30), "x"), (True, False), strict=True):
        here = directions[(directions[:, 2] > 0) == upper]
        (dots,) = (mark for mark in panel.marks if isinstance(mark, Dots))
        places = np.stack([dots.x, dots.y], axis=-1)
        # equal-area: the distance from the middle is that of the chord to the pole over the square root of two
        assert np.linalg.norm(places, axis=1) ** 2 == pytest.approx(1.0 - np.abs(here[:, 2]))
        assert np.arctan2(places[:, 1], places[:, 0]) == pytest.approx(np.arctan2(here[:, 1], here[:, 0]))


def test_what_people_see_is_the_same_in_other_units():
    calibration = calibrated(grid((6, 6)), gyrowheel())
    si, seen = calibration.estimate, displayed(calibration.estimate, DEG_H)
    assert seen.values / seen.u == pytest.approx(si.values / si.u)
    assert seen.correlation == pytest.approx(si.correlation)
    for name, p in seen.parameters.items():
        text, per_g, power = p.unit.partition("/g")
        # per unit g for people, per gravity of the site inside
        size = (9.8 / 9.80665) ** int(power.removeprefix("^") or 1) if per_g else 1.0
        assert p.value * parse_unit(text).factor * size == pytest.approx(si[name].value)
    for a, b in zip(seen.budget, si.budget, strict=True):
        assert a.u * parse_unit(a.unit).factor == pytest.approx(b.u)
        assert a.share == b.share
    assert seen["DX_F"].value == pytest.approx(50.0, abs=6.0 * seen["DX_F"].u)
    rms = seen.statistics["residual_rms [deg/h]"]
    assert rms * DEG_H.factor == pytest.approx(si.statistics["residual_rms"])
    (row, before) = seen.result["table_errors"][0], si.result["table_errors"][0]
    assert row["u_arcsec"] == pytest.approx(np.degrees(before["u_rad"]) * 3600.0)
    low, high = seen.conditions["ranges"]["reading_of_y_x [deg/h]"]
    assert [low * DEG_H.factor, high * DEG_H.factor] == pytest.approx(
        si.conditions["ranges"]["reading_of_y_x"]
    )
    assert seen.conditions["site"]["latitude_deg"] == pytest.approx(39.1)
    assert seen.result["noise"][0]["noise"] == pytest.approx(0.01)


def test_units_of_other_things_stay():
    assert shown_unit("(m/s^2)/(rad/s)", DEG_H) == ("(m/s^2)/(rad/s)", 1.0)
    assert shown_unit("1", DEG_H) == ("1", 1.0)
    assert shown_unit("count", parse_unit("count")) == ("count", 1.0)


@pytest.mark.slow
def test_a_design_on_a_page():
    settings = study(
        grid((12, 12)), gyrowheel(), positions=24, criterion="D", compare=("24-position", "6-position")
    )
    designed = design(settings)
    told = Estimate.without(Basis("design positions"), Status.OK, designed.message)
    page = check(design_page(designed, settings, told))
    rows = [
        [re.sub("<.*?>", "", cell) for cell in re.findall("<td.*?>(.*?)</td>", row, re.DOTALL)]
        for row in re.findall("<tr>(.*?)</tr>", page, re.DOTALL)
    ]
    cells = next(row for row in rows if row and row[0] == "DX_F")
    u = [each.figures.u[each.names.index("DX_F")] / DEG_H.factor for each in designed.compare]
    assert cells[1:-1] == [rounded(x, x)[1] if np.isfinite(x) else "free" for x in u]
    assert cells[-1] == "deg/h"
    k_x = next(row for row in rows if row and row[0] == "k_x")
    assert k_x[-2] == "stated"  # the 6-position plan identifies no earth rate
    positions = [row for row in rows if len(row) == 3 and row[0].isdigit()]
    assert np.array(positions, dtype=float)[:, 1:] == pytest.approx(
        np.degrees(designed.plan.angles), abs=0.005
    )
    assert "6-position</b> does not identify" in page
    for title in ("Positions chosen", "Angles of the table", "Uncertainties by plan"):
        assert re.search(f"<h[23]>{title}</h[23]>", page)
