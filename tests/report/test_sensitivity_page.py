"""The page of a sensitivity analysis: its numbers are those of the analysis, and its maps show each position."""

import base64
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.result import Estimate
from inercal.foundation.rigs.patterns import normal, uniform
from inercal.foundation.rigs.plans import grid, listed, named
from inercal.foundation.rigs.tables import turntable
from inercal.systems.turntable.figures.sensitivity import _even_grid, _map, interactions, maps
from inercal.systems.turntable.figures.sensitivity import page as sensitivity_page
from inercal.systems.turntable.sensitivity import analyse
from inercal.systems.turntable.settings import Analysis, PositionDesign, TurntableSettings

ARCMIN = np.radians(1.0 / 60.0)
EXACT = Analysis()
PARIS = Site(9.809, latitude=np.radians(48.8))


class Rows(HTMLParser):
    """Cells of all table rows of a page, its headings, and what its images hold."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.rows, self.heads, self.svgs, self.links, self._open = [], [], [], [], []
        self.feed(text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.links += [given[key] for key in ("src", "href") if key in given]
        if tag not in ("meta", "img", "br"):
            self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag in ("h2", "h3"):
            self.heads.append("")
        if tag == "img":
            self.svgs.append(base64.b64decode(given["src"].partition(",")[2]).decode())

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if {"td", "th"} & set(self._open):
            self.rows[-1][-1] += data
        if {"h2", "h3"} & set(self._open):
            self.heads[-1] += data


def study(plan, table="two_axis_turntable", analysis=EXACT, **errors):
    chain = turntable(table, uniform(2.0 * ARCMIN), errors)
    return TurntableSettings(PARIS, table, chain, plan, PositionDesign(grid((4, 4))), analysis)


def told(analysed):
    """What the command brings back, without its numbers."""
    return Estimate.without(Basis("sensitivity"), Status.OK, analysed.message)


def page_of(settings):
    analysed = analyse(settings)
    text = sensitivity_page(analysed, settings, told(analysed))
    found = Rows(text)
    assert "<script" not in text
    assert all(link.startswith("data:") for link in found.links)
    for svg in found.svgs:
        assert all(target.startswith(("#", "data:")) for target in re.findall(r'href="([^"]*)"', svg))
        assert len(svg) < 300_000
    return analysed, text, found


@pytest.fixture(scope="module")
def paper():
    """The positions of the paper; analysed and drawn once, since nothing below changes it."""
    return page_of(study(grid((8, 8))))


@pytest.mark.slow
def test_numbers_are_those_of_the_analysis(paper):
    analysed, _, found = paper
    assert found.heads[:3] == ["Which errors matter", "Findings", "Ranking"]
    order = np.argsort(-analysed.aggregate.total, kind="stable")
    rows = [row for row in found.rows if len(row) == 5 and row[0].isdigit()]
    assert [row[1].split()[0] for row in rows] == [analysed.indices.factors[k] for k in order]
    assert [float(row[3]) for row in rows] == pytest.approx(analysed.aggregate.total[order], rel=6e-3)
    tables = [row for row in found.rows if len(row) == 6 and row[0] in analysed.indices.factors]
    shown = (
        np.array([[float(cell) for cell in row[1:]] for row in tables]).reshape(-1, 11, 5).transpose(0, 2, 1)
    )
    titles = [head for head in found.heads if head.endswith(("over the positions", "by variance"))]
    titles.remove("Maps over the positions")
    assert len(titles) == len(shown)
    for kind, words in (
        (analysed.mean, "mean over the positions"),
        (analysed.weighted, "weighted by variance"),
    ):
        for key, name in (("first", "First order S"), ("total", "Total order ST")):
            assert shown[titles.index(f"{name}, {words}")] == pytest.approx(getattr(kind, key), rel=0.06)


@pytest.mark.slow
def test_figures_four_and_five_of_the_paper(paper):
    _, text, found = paper
    for title in ("Which errors matter", "Mean indices by output", "Maps over the positions", "Interactions"):
        assert title in found.heads
    assert "figure 4 of Zhao" in text
    assert "figure 5 of Zhao" in text


@pytest.mark.slow
def test_factors_with_their_sizes():
    rows = page_of(
        study(grid((4, 4)), dphi_y1=normal(0.2 * ARCMIN), deps_x=uniform(90.0 * ARCMIN), d_eta=uniform(2e-5))
    )[2].rows
    sizes = {row[0].split()[0]: row[1:] for row in rows if len(row) == 4 and row[1] in ("uniform", "normal")}
    assert sizes["dphi_y1"] == ["normal", "σ = 12 arcsec", "position"]
    assert sizes["deps_x"] == ["uniform", "± 1.5°", "rig"]
    assert sizes["d_eta"] == ["uniform", "± 0.02 mm", "rig"]
    assert sizes["dtheta_z"] == ["uniform", "± 2 arcmin", "run"]


@pytest.mark.slow
def test_flagged_positions_are_counted_and_the_worst_come_first(paper):
    analysed, text, found = page_of(study(grid((8, 8), half_step=False)))
    assert len(analysed.flagged) > 12
    count = sum(flag.output == "az" for flag in analysed.flagged)
    assert f"{count} positions for az" in " ".join(text.split())
    sums = [float(row[3]) for row in found.rows if len(row) == 4 and row[0] in ("ax", "ay", "az", "wx", "wy")]
    assert len(sums) == 12
    assert sums == sorted(sums)
    assert sums[0] == pytest.approx(min(flag.sum_first for flag in analysed.flagged), abs=1e-3)
    assert "There are none" in paper[1]


def test_sampled_differences_are_not_drawn_as_interactions():
    settings = study(grid((4, 4)), analysis=Analysis(("ax", "az"), "sampled", samples=64))
    analysed, text, found = page_of(settings)
    assert "Interactions" not in found.heads
    assert "seed 1" in text
    assert interactions(analysed.indices, analysed.mean, analysed.weighted) is None


def test_a_local_analysis_has_no_interactions_and_no_shapley_effects():
    _, text, found = page_of(study(named("24-position"), analysis=Analysis(("ax", "az"), "local")))
    assert "Interactions" not in found.heads
    assert "Shapley" not in text


@pytest.mark.parametrize(
    ("plan", "table"),
    [(listed([[0.1, 0.2]]), "two_axis_turntable"), (grid((2, 3, 4)), "three_axis_turntable")],
)
def test_no_maps_of_one_position_or_of_three_angles(plan, table):
    assert "Maps over the positions" not in page_of(study(plan, table))[2].heads


def test_an_output_without_variance():
    """About x and y alone nothing moves az to first order; about z of the mounting nothing moves it at all."""
    chain = turntable("two_axis_turntable", None, {"dtheta_z": uniform(ARCMIN)})
    settings = TurntableSettings(
        PARIS, "two_axis_turntable", chain, grid((4, 4)), PositionDesign(grid((4, 4)))
    )
    analysed, text, _ = page_of(settings)
    assert np.isnan(analysed.mean.first[2]).all()
    assert "–" in text
    assert "nan" not in text


@pytest.mark.parametrize("shuffle", [False, True])
def test_a_cell_of_a_map_holds_the_value_of_its_position(shuffle):
    angles = grid((5, 7)).angles
    values = np.arange(len(angles), dtype=float)
    if shuffle:
        order = np.random.default_rng(3).permutation(len(angles))
        angles, values = angles[order], values[order]
    image = _map(angles, values)
    (left, right, low, high), cells = image.extent, image.values
    for (phi1, phi2), value in zip(np.degrees(angles), values, strict=True):
        column = int((phi1 - left) / (right - left) * cells.shape[1])
        row = int((phi2 - low) / (high - low) * cells.shape[0])
        assert cells[row, column] == value
    assert (left, right, low, high) == pytest.approx((0.0, 360.0, 0.0, 360.0), abs=1e-6)


def test_what_is_no_even_grid_is_drawn_as_points():
    assert _even_grid(named("24-position").angles) is None
    assert (
        _even_grid(np.array([[0.0, 0.0], [0.0, 1.0], [0.0, 3.0], [1.0, 0.0], [1.0, 1.0], [1.0, 3.0]])) is None
    )
    assert _even_grid(np.repeat(grid((3, 2)).angles[:3], 2, axis=0)) is None
    assert _even_grid(named("16-cube").angles) is not None
    settings = study(named("24-position"), analysis=Analysis(("ax", "wy"), "local"))
    analysed = analyse(settings)
    drawn = maps(analysed.indices, analysed.joints, analysed.flagged)
    assert "the error that matters most" in drawn.caption
    assert drawn.svg.count("<image") <= 1  # the colour bar alone


@pytest.mark.slow
def test_same_analysis_same_bytes():
    settings = study(grid((4, 4)))
    analysed = analyse(settings)
    assert len({sensitivity_page(analysed, settings, told(analysed)) for _ in range(2)}) == 1
