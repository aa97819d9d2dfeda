"""The figures' style: the same drawing is the same text, and a long signal keeps its extremes."""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.faces.report.style import COLOURS, envelope, figure, plain_unit, power_of_ten, powers_of_ten, svg

DRAW = """
import numpy as np
from inercal.faces.report.style import figure, svg
with figure(4.0, 2.0) as page:
    axes = page.subplots()
    axes.plot(np.sin(np.arange(50)))
    axes.set_ylabel("$f$ [m/s²]")
    print(svg(page))
"""


def draw(_=None):
    with figure(4.0, 2.0) as page:
        axes = page.subplots()
        axes.plot(np.sin(np.arange(50)))
        axes.set_ylabel("$f$ [m/s²]")
        return svg(page)


def test_same_figure_same_text_in_every_process():
    other = subprocess.run([sys.executable, "-c", DRAW], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == draw().strip()


def test_an_svg_element_without_date_or_fonts():
    text = draw()
    assert text.startswith("<svg")
    assert text.rstrip().endswith("</svg>")
    for absent in ("<text", "font-family", "dc:date", "@import", "<image"):
        assert absent not in text


def test_threads_draw_the_same_and_leave_no_trace():
    before = dict(matplotlib.rcParams)
    with ThreadPoolExecutor(4) as pool:
        assert len(set(pool.map(draw, range(8)))) == 1
    assert dict(matplotlib.rcParams) == before


def test_others_settings_do_not_matter():
    plain = draw()
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 7, "axes.grid": True}):
        assert draw() == plain


def test_nothing_heavy_is_imported_before_it_is_needed():
    names = (
        "faces.report.html",
        "faces.report.inspection",
        "faces.report.style",
        "systems.imu.sections.figures",
        "systems.turntable.figures",
    )
    modules = ", ".join(f"inercal.{name}" for name in names)
    code = f"import sys, {modules}; print({{'matplotlib', 'jinja2', 'pyplot'}} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@given(st.lists(st.floats(-1e9, 1e9) | st.just(np.nan) | st.just(np.inf), max_size=300), st.integers(1, 40))
def test_envelope_keeps_extremes_and_is_short(values, pieces):
    values = np.array(values, dtype=float)
    t, shown = envelope(np.arange(len(values), dtype=float), values, pieces)
    assert len(t) == len(shown) <= max(2 * pieces, 0)
    known, kept = values[np.isfinite(values)], shown[np.isfinite(shown)]
    assert kept.size <= 2 * pieces
    assert (kept.size > 0) == (known.size > 0)
    if known.size:
        assert kept.min() == known.min()
        assert kept.max() == known.max()
    assert (np.diff(t) >= 0).all()


def test_envelope_leaves_gaps_where_values_are_missing():
    values = np.ones(10_000)
    values[3000:5000] = np.nan
    t, shown = envelope(np.arange(10_000.0), values, 100)
    inside = (t > 3100) & (t < 4900)
    assert np.isnan(shown[inside]).all()
    assert np.isfinite(shown[(t < 2900) | (t > 5100)]).all()


def test_powers_of_ten_in_words():
    with figure(3.0, 2.0) as page:
        axis = page.subplots().yaxis
        axis.axes.set_yscale("log")
        powers_of_ten(axis)
        texts = [axis.get_major_formatter()(value) for value in (1e-3, 1.0, 100.0, 1e6)]
    assert texts == ["10⁻³", "1", "100", "10⁶"]
    assert [power_of_ten(value) for value in (0.0, -0.01, -10.0)] == ["0", "−10⁻²", "−10"]


def test_units_with_powers():
    assert plain_unit("count/(m/s^2)") == "count/(m/s²)"
    assert plain_unit("a walk of 3 rad/sqrt(s)") == "a walk of 3 rad/√s"


@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_first_colours_differ_in_lightness_or_blue_yellow(pair):
    # what red-green blindness leaves: roughly lightness and blue against yellow
    def left(colour):
        r, g, b = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
        return np.array([(r + g) / 2, b])

    a, b = (left(COLOURS[k]) for k in pair)
    assert np.linalg.norm(a - b) > 30
