"""Pictures of a Ferraris calibration: what there is of each status, and the whole page."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from ferraris_sessions import SETTINGS, UNSURE, options_of, record_of

from inercal.faces.report.html import render
from inercal.foundation.findings import Status
from inercal.systems.imu.ferraris.calibration import calibrate_ferraris
from inercal.systems.imu.ferraris.figures import pictures

ALL = [
    "Coefficients and their uncertainties",
    "Sections",
    "Scatter of the positions",
    "Turns",
    "Correlation of the coefficients",
    "Where the uncertainty comes from",
]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ferraris", pytest.param("ferraris-si", marks=pytest.mark.campaign)])
def test_pictures_of_the_shipped_sessions(name):
    found = calibrate_ferraris(record_of(name), UNSURE, options_of(name))
    drawn = pictures(found)
    assert [picture.title for picture in drawn] == ALL
    assert all(picture.svg.startswith("<svg") and len(picture.svg) < 400_000 for picture in drawn)
    page = render(found.estimate, drawn, "Ferraris")
    assert page == render(found.estimate, pictures(found), "Ferraris")
    assert "least squares" in page


def test_a_missing_section_shows_those_there_are():
    record = record_of("ferraris")
    short = replace(record, labels=tuple("" if label == "y_a" else label for label in record.labels))
    found = calibrate_ferraris(short, SETTINGS, options_of("ferraris"))
    assert found.estimate.status is Status.TOO_FEW_INTERVALS
    (drawn,) = pictures(found)
    assert "the 8 of 9 sections shaded" in drawn.caption
    assert "Not found: y_a." in drawn.caption
    render(found.estimate, [drawn], "Ferraris")
