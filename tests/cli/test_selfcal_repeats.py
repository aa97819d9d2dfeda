"""Repeat runs of a platform: several recordings with the same channels are combined, as for any instrument."""

import json
from pathlib import Path

import numpy as np
import pytest

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.systems.selfcal.platform.coefficients import NAMES

pytestmark = pytest.mark.usefixtures("undrawn")

SHORT = ["--set", 'plan.turns=[["x", "-60 deg"], ["z", "-90 deg"], ["x", "-60 deg"]]']
STUDY = FOLDER / "selfcal.toml"
RUNS = ["run1.npz", "run2.npz", "run3.npz"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Three simulated runs of one platform."""
    path = tmp_path_factory.mktemp("repeats")
    for seed, name in enumerate(RUNS, start=21):
        simulate = ["simulate", "selfcal", str(STUDY), *SHORT, "--seed", str(seed), "--out", str(path / name)]
        assert run([*simulate, "--quiet"]) == 0
    return path


@pytest.fixture(autouse=True)
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)


def told(capsys, *files):
    """The JSON object of runs calibrated together."""
    capsys.readouterr()
    assert (
        run(["selfcal", *files, "--study", str(STUDY), *SHORT, "--json", "--quiet", "--report", "r.html"])
        == 0
    )
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_three_runs_give_one_value_with_the_runs_beside_it(capsys):
    """The truth lies within 4.5 u of the combined values, which are known better than those of a single run."""
    one, all_three = told(capsys, RUNS[0]), told(capsys, *RUNS)
    assert [each["name"] for each in all_three["parameters"]] == list(NAMES)
    assert len(all_three["result"]["by_run"]["kg0_x"]["values"]) == 3
    assert "repeat runs" in Path("r.html").read_text()
    values, u = np.array([[each["value"], each["u"]] for each in all_three["parameters"]]).T
    assert np.abs((values - load_selfcal_study(STUDY).truth[:18]) / u).max() < 4.5
    single = np.array([each["u"] for each in one["parameters"]])
    assert np.median(u / single) < 0.8  # 1/sqrt(3), where the runs do not differ by more than their noise


@pytest.mark.parametrize(
    ("more", "words"),
    [(["--compare"], "--compare: found 3 runs"), (["--out", "h.csv"], "h.csv: found 3 runs, expected one")],
)
def test_what_is_of_one_run_alone(capsys, more, words):
    capsys.readouterr()
    assert run(["selfcal", *RUNS, "--study", str(STUDY), *SHORT, *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert words in captured.err
    assert not Path("h.csv").exists()
