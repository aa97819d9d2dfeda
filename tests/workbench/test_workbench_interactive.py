"""Figures that zoom are of the same marks as pictures of a page."""

import json

import numpy as np
import pytest

from inercal.bench.workbench.interactive import figure
from inercal.faces.report.marks import Area, Axis, Bars, Dots, Level, Line, Note, Panel, Strips


def test_every_mark_is_a_trace_or_a_shape():
    x = np.array([0.0, 1.0, np.nan])
    panels = [
        Panel([Line(x, x, "line", width=1.0), Area(x, x - 1.0, x + 1.0, "band")], y=Axis("acc [m/s²]")),
        Panel(
            [Level(0.0), Dots([2.0], [3.0], "dots", words=["pose 1"])],
            Axis("time [s]", limits=(0.0, 9.0)),
            Axis("off"),
        ),
    ]
    over = [Strips([(0.0, 1.0), (2.0, 3.0)]), Level(4.0, upright=True), Note((4.0, 1.0), "here")]
    made = figure(panels, 100.0, over)
    json.dumps(made, allow_nan=False)
    line, low, high, dots = made["data"]
    assert (line["x"], line["y"], line["yaxis"]) == ([0.0, 1.0, None],) * 2 + ("y",)
    assert line["hovertemplate"].endswith("m/s²")
    assert (low["y"], high["y"], high["fill"]) == ([-1.0, 0.0, None], [1.0, 2.0, None], "tonexty")
    assert (dots["customdata"], dots["yaxis"]) == (["pose 1"], "y2")
    assert [each["name"] for each in made["data"] if each["showlegend"]] == ["line", "band", "dots"]
    layout = made["layout"]
    assert [(each["type"], each["x0"], each["x1"]) for each in layout["shapes"]] == [
        ("rect", 0.0, 1.0),
        ("rect", 2.0, 3.0),
        ("line", 4.0, 4.0),
    ]
    assert [each["text"] for each in layout["annotations"]] == ["here"]
    assert (layout["xaxis"]["range"], layout["xaxis"]["title"]["text"]) == ([0.0, 9.0], "time [s]")
    assert (layout["yaxis"]["zeroline"], layout["yaxis2"]["zeroline"]) == (False, True)
    assert layout["yaxis"]["domain"][0] > layout["yaxis2"]["domain"][1] - 1e-9  # the first above


def test_a_mark_that_the_screen_does_not_have_is_no_silent_gap():
    with pytest.raises(TypeError, match="found a Bars"):
        figure([Panel([Bars([0], [0.0], [1.0])])], 100.0)
