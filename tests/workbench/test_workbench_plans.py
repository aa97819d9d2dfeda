"""Plans as lines: they come back as they were, and what a search wrote becomes the plan of the study."""

import numpy as np
import pytest

from inercal.bench.workbench.pages.form import lines_of, named, with_found, with_lines
from inercal.examples import FOLDER
from inercal.faces.python.study import read_study, verticals
from inercal.faces.studies.text import with_keys
from inercal.foundation.errors import InputError
from inercal.systems.listed import SYSTEMS

FILES = {
    "turntable": "gyro.toml",
    "selfcal": "selfcal.toml",
    "strapdown": "strapdown.toml",
    "aoa": "sting.toml",
}

PLANS = {kind: SYSTEMS[kind].plan for kind in FILES}


@pytest.fixture
def study(tmp_path):
    def read(kind, text):
        (tmp_path / "study.toml").write_text(text)
        return read_study(kind, tmp_path / "study.toml")

    return read


@pytest.mark.parametrize("kind", FILES)
def test_lines_of_a_plan_make_the_same_plan(kind, study):
    before = (FOLDER / FILES[kind]).read_text()
    for keys in list(named(PLANS[kind]).values()) or [{}]:
        text = with_keys(before, keys)
        lines = lines_of(study(kind, text))
        again = with_lines(PLANS[kind], text, lines)
        assert lines_of(study(kind, again)) == lines
        np.testing.assert_allclose(verticals(study(kind, text)), verticals(study(kind, again)), atol=1e-9)


def test_a_line_that_is_none_is_refused_and_one_added_is_there(study):
    text = (FOLDER / "selfcal.toml").read_text()
    with pytest.raises(InputError, match="no line"):
        with_lines(PLANS["selfcal"], text, " \n")
    added = with_lines(PLANS["selfcal"], text, "z, 180 deg\nrest, 5 s\n\nx, -90 deg, 2 deg/s")
    assert lines_of(study("selfcal", added)).splitlines() == [
        "z, 180 deg",
        "rest, 5 s",
        "x, -90 deg, 2 deg/s",
    ]
    text = (FOLDER / "sting.toml").read_text()
    with pytest.raises(InputError, match="name, axis, place"):
        with_lines(PLANS["aoa"], text, "a1, +x")
    fewer = with_lines(PLANS["aoa"], text, "a1, -z, -0.2 m\na2, +x, 0.3 m")
    assert study("aoa", fewer).settings.layout.names == ("a1", "a2")


def test_what_a_search_wrote_becomes_the_plan(study):
    table = with_found(
        PLANS["turntable"], (FOLDER / "gyro.toml").read_text(), "phi1 [deg],phi2 [deg]\n0,90\n45,10\n"
    )
    assert lines_of(study("turntable", table)) == "0, 90\n45, 10"
    found = '# found\n[plan]\nturns = [\n    ["x", "30 deg"],\n]\nrate = "2 deg/s"\n'
    plan = study(
        "selfcal", with_found(PLANS["selfcal"], (FOLDER / "selfcal.toml").read_text(), found)
    ).settings.plan
    np.testing.assert_allclose(np.degrees([plan.rate, plan.moves[0].angle]), [2.0, 30.0])
