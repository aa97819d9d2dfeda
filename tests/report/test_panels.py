"""The grammar of pictures: marks become drawings that are what their data say, and axes count and measure."""

import re

import numpy as np
import pytest

from inercal.faces.report.cells import small
from inercal.faces.report.coefficients import limits
from inercal.faces.report.marks import (
    Area,
    Axis,
    Bars,
    Cells,
    Colours,
    Dots,
    Level,
    Line,
    Note,
    Panel,
    Strips,
)
from inercal.faces.report.panels import draw, symlog_ticks
from inercal.faces.report.rig import DrawnTriad, DrawnTurn, rig


def words(picture):
    return re.findall(r"<!-- (.*?) -->", picture.svg)


def test_every_mark_is_drawn():
    x, edges = np.arange(3.0), np.arange(4.0)
    marks = [
        Line(x, x, "line"),
        Dots(x, x, "dots", up=x),
        Area(x, x, x + 1.0, "band"),
        Area(edges, x, x + 1.0, steps=True),
        Strips((0.0, 1.0)),
        Level(1.0, "level"),
        Bars(x, 0.0 * x, x, "bars"),
        Note((1.0, 1.0), "here"),
    ]
    drawn = draw("A title", "What it is.", [[Panel(marks, Axis("across"), Axis("up"), "head")]], 2.0)
    assert (drawn.title, drawn.caption) == ("A title", "What it is.")
    assert {"line", "dots", "band", "level", "bars", "here", "across", "up", "head"} <= set(words(drawn))
    assert drawn.figure.axes[0].get_title() == "head"


def test_small_panels_are_of_the_same_marks():
    """Names above in their colours, numbers below the last row; a mark that they do not have is no silent gap."""
    x, along = np.arange(3.0), Axis("across", limits=(0.0, 2.0))
    marks = [
        Line(x, x, "line"),
        Dots(x, x, "dots"),
        Area(x, x, x + 1.0, "band"),
        Strips((0.0, 1.0)),
        Level(1.0, "level"),
        Level(1.0, upright=True),
        Bars(x, 0.0 * x, x, "bars", upright=True),
    ]
    rows = Panel([Bars([0, 1, 1], [0.0, 0.0, 1.5], [2.0, 1.0, 2.0])], along, Axis(names=["first", "second"]))
    panels = [Panel(marks, along, Axis("up", limits=(0.0, 3.0)), "head"), rows]
    drawn = small("A title", "What it is.", panels, 1.0)
    assert (drawn.title, drawn.caption) == ("A title", "What it is.")
    found = words(drawn)
    assert {"line", "dots", "band", "level", "bars", "up", "head", "first", "second"} <= set(found)
    assert found.count("across") == 1
    heights = {text.get_text(): text.get_position()[1] for text in drawn.figure.axes[0].texts}
    assert heights["up"] > heights["first"] > heights["second"]
    with pytest.raises(TypeError, match="found a Cells"):
        small("", "", [Panel([Cells(np.eye(2), (0.0, 1.0, 0.0, 1.0))], along, along)], 1.0)


def test_rows_are_counted_from_the_top():
    drawn = limits("Limits", "", ["a", "b", "c"], np.array([0.5, -3.0, np.nan]), np.ones(3), "off")
    axes = drawn.figure.axes[0]
    low, high = axes.get_ylim()
    assert low > high
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["a", "b", "c"]
    assert axes.get_xlim()[0] < -4.0 < 4.0 < axes.get_xlim()[1]


def test_panels_with_the_same_colours_share_one_scale():
    colours = Colours("Blues", 0.0, 1.0, "share")
    cells = Cells(np.eye(2), (-0.5, 1.5, -0.5, 1.5), [["1", ""], ["", "1"]])
    panels = [Panel([cells], colours=colours), Panel([cells], colours=colours)]
    drawn = draw("Cells", "", [panels], 2.0)
    assert len(drawn.figure.axes) == 3
    assert words(drawn).count("share") == 1


@pytest.mark.parametrize(
    ("reach", "ticks"), [(5.0, [-1, 0, 1]), (2000.0, [-1000, -100, -10, -1, 0, 1, 10, 100, 1000])]
)
def test_ticks_on_both_sides_of_zero(reach, ticks):
    assert symlog_ticks(1.0, (-reach, reach)) == ticks


def test_the_arrow_of_a_joint_turns_right_handed_about_its_axis():
    """Seen from the south-east and above, a turn about up runs counterclockwise on the paper."""
    drawn = rig("Rig", "", [DrawnTurn("up", np.array([0.0, 0.0, 1.0]))], DrawnTriad("xyz", np.eye(3)))
    x, y = next(line.get_data() for line in drawn.figure.axes[0].lines if len(line.get_xdata()) == 60)
    area = 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    middle = (np.mean(x), np.mean(y))
    area -= 0.5 * (middle[0] * (y[-1] - y[0]) - middle[1] * (x[-1] - x[0]))
    assert area > 0.0
    assert {"up +", "north", "west", "x", "y", "z"} <= set(words(drawn))
