"""``inercal selfcal`` and ``inercal design selfcal``: from a simulated file to coefficients, histories and a page."""

import io
import json
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from new_studies import FILL
from paper_study import TRUTH

from inercal.cli import run
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.results.files import load
from inercal.systems.selfcal.estimators import KINDS
from inercal.systems.selfcal.platform.coefficients import NAMES
from rows import for_each

pytestmark = pytest.mark.usefixtures("undrawn")

SELFCAL = ["selfcal", "platform.csv", "--study", "selfcal.toml"]
#: what the paper's path at the nominal noise tells least of
UNSEEN = ("ds_z", "do_y")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The study of the paper at the best path, its simulated recording, and a piece of it."""
    path = tmp_path_factory.mktemp("selfcal")
    study, out = path / "selfcal.toml", path / "platform.csv"
    assert run(["new", "selfcal", "--out", str(study), "--quiet", *FILL]) == 0
    text = study.read_text().replace('"45(26) deg"', '"40 deg"').replace('"0(300) m"', '"0 m"')
    turns = next(line for line in text.splitlines() if line.startswith("turns = [["))
    study.write_text(text.replace(turns, 'path = "best"') + '\n[model]\nstates = "paper"\n')
    assert run(["simulate", "selfcal", str(study), "--seed", "8", "--out", str(out), "--quiet"]) == 0
    rows = out.read_text().splitlines(keepends=True)
    (path / "short.csv").write_text("".join(rows[:400]))
    return path


@pytest.fixture(autouse=True)
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)


def told(capsys, *arguments):
    """The JSON object of a command that is done, and its exit code."""
    capsys.readouterr()
    code = run([*arguments, "--json", "--quiet"])
    captured = capsys.readouterr()
    assert captured.err == ""
    return code, json.loads(captured.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))


def values_and_u(data):
    """Values (p,) and u (p,) of a JSON object."""
    return np.array([[p["value"], p["u"]] for p in data["parameters"]]).T


def piped(monkeypatch, capsys, *arguments, log="platform.csv"):
    """Exit code, standard output and error of a command with the recording as its standard input."""
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(Path(log).read_bytes())))
    capsys.readouterr()
    code = run(list(arguments))
    return code, *capsys.readouterr()


def said_once(captured, *words):
    """Standard output is empty, standard error one line of the right form that holds the words."""
    assert captured.out == ""
    (line,) = [line for line in captured.err.splitlines() if "make kernels" not in line]
    assert line.startswith("inercal: error: ")
    for word in words:
        assert word in line


# One recording.


def test_json_is_the_contract_and_holds_the_truth(capsys):
    code, data = told(capsys, *SELFCAL)
    assert (code, data["command"], data["status"]["code"]) == (0, "selfcal", "ok")
    assert [p["name"] for p in data["parameters"]] == list(NAMES) == data["covariance"]["names"]
    values, u = values_and_u(data)
    assert np.abs((values - TRUTH[:18]) / u).max() < 4.5
    assert {p["unit"] for p in data["parameters"]} == {"rad/s", "rad", "m/s^2", "1"}
    result = data["result"]
    assert result["filter"] == "error-state"
    assert list(result["bounds"]) == list(NAMES)
    assert result["at_prior"] == []
    # what is uncertain beside the recording may only add to the bound
    assert (u > 0.97 * np.array(list(result["bounds"].values()))).all()
    assert 0.0 < data["timing_s"]["step"] < 1e-2
    assert set(data["timing_s"]) == {"read", "solve", "total", "step"}
    assert data["timing_s"]["solve"] < data["timing_s"]["total"]
    assert sorted(Path(each["path"]).name for each in data["inputs"]) == ["platform.csv", "selfcal.toml"]
    assert abs(data["statistics"]["nis_mean"] - 6.0) < 5.0 * np.sqrt(12.0 / 2700.0)


def test_histories_end_with_the_estimate(capsys):
    """Each row is what was known then: the first the prior, the last what the command says."""
    code, data = told(capsys, *SELFCAL, "--out", "history.csv")
    assert code == 0
    found = np.genfromtxt("history.csv", delimiter=",", names=None, skip_header=1)
    titles = Path("history.csv").read_text().split("\n", 1)[0].split(",")
    assert titles[:4] == ["t [s]", "th_x [rad]", "th_y [rad]", "th_z [rad]"]
    last = dict(zip(titles, found[-1].tolist(), strict=True))
    for p in data["parameters"]:
        assert last[f"{p['name']} [{p['unit']}]"] == pytest.approx(p["value"], rel=1e-14)
    first = dict(zip(titles, found[0].tolist(), strict=True))
    assert first["u_ka1_y [1]"] == pytest.approx(1500e-6)
    assert np.isnan(first["nis_mean [1]"])
    # the attitude is that of the encoders, to their noise
    platform = np.genfromtxt("platform.csv", delimiter=",", skip_header=1)
    assert np.abs(found[:, 1:4] - np.radians(platform[:, 4:7])).max() < np.radians(10.0 / 3600.0)


@pytest.mark.slow
def test_any_estimator_can_be_chosen_and_they_agree(capsys):
    """Recursive filters and the batch within 0.02 u of each other on one recording."""
    _, data = told(capsys, *SELFCAL)
    values, u = values_and_u(data)
    for kind in ("svd-qukf", "gimbal-ukf", "map"):
        code, other = told(capsys, *SELFCAL, "--filter", kind)
        assert (code, other["result"]["filter"]) == (0, kind)
        assert np.abs((values_and_u(other)[0] - values) / u).max() < 0.02


@pytest.mark.slow
def test_compare_sets_all_estimators_side_by_side(capsys):
    assert run([*SELFCAL, "--compare", "--out", "compared.json"]) == 0
    printed = capsys.readouterr().out
    for words in ("Filters side by side", "Errors in percent of the truth", "time of a row [µs]", *KINDS):
        assert words in printed
    compared = load("compared.json")
    compare = compared.result["compare"]
    assert set(compare) == set(KINDS) - {"error-state"}
    for kind in ("svd-qukf", "map"):
        assert compare[kind]["status"] == "ok"
        assert compared.timing[f"step {kind}"] > 0.0
        assert list(compare[kind]["parameters"]) == list(NAMES)


@pytest.mark.slow
def test_a_bad_verdict_is_exit_code_one_and_still_the_whole_object(capsys):
    code, data = told(capsys, *SELFCAL, "--set", "noise.accelerometer=1 ug")
    assert (code, data["status"]["code"]) == (1, "inconsistent")
    assert len(data["parameters"]) == 18
    code, data = told(capsys, "selfcal", "short.csv", *SELFCAL[2:])
    assert (code, data["status"]["code"]) == (1, "unobservable")
    assert {"do_y", "ka1_z"} <= set(data["result"]["at_prior"])


def test_a_calibration_is_applied_to_its_recording(capsys):
    assert run([*SELFCAL, "--out", "cal.json", "--quiet"]) == 0
    assert run(["apply", "cal.json", "platform.csv", "--out", "corrected.csv", "--quiet"]) == 0
    columns = np.genfromtxt("corrected.csv", delimiter=",", skip_header=2)
    size = np.linalg.norm(columns[:, 7:10], axis=1)
    settings = load_selfcal_study("selfcal.toml")
    # 10 ug of noise and what is left of the coefficients, but no longer 500 ppm
    assert np.abs(size / settings.site.gravity - 1.0).max() < 60e-6


# Live.


def test_numbers_that_nobody_needs_are_not_said_to_be_missing(capsys, monkeypatch):
    """The last row has no rate, the first no accelerometers: none is needed. A rate amid the rows is."""
    header, *rows = Path("short.csv").read_text().splitlines()
    whole = [header, *rows[:-1], re.sub(r"^([^,]*),[^,]*,[^,]*,[^,]*,", r"\1,,,,", rows[-1])]
    flawed = whole.copy()
    flawed[50] = re.sub(r"^([^,]*),[^,]*,", r"\1,,", flawed[50])
    for lines, said in ((whole, []), (flawed, ["nan: wc_x"])):
        Path("log.csv").write_text("\n".join(lines) + "\n")
        assert run(["inspect", "log.csv"]) == 0
        out = capsys.readouterr().out
        assert ("nothing suspicious" in out) == (not said)
        # a table of the whole file counts both places of a channel
        assert out.count("nan: ") == len(said)
        code, _, err = piped(monkeypatch, capsys, "selfcal", "--stream", *SELFCAL[2:], log="log.csv")
        assert code == 0
        assert [line.split(": missing")[0] for line in err.splitlines() if line.startswith("nan")] == said


# What is refused.


@for_each(
    ("arguments", "words"),
    [
        ([*SELFCAL, "--filter", "kalman"], ["kalman", "error-state"]),
        ([*SELFCAL, "--stream", "--filter", "map"], ["filter.kind", "map", "error-state"]),
        ([*SELFCAL, "--stream", "--set", "rig.heading=unknown"], ["rig.heading", "stream"]),
        ([*SELFCAL, "--set", "noise.encoder=0 arcsec"], ["noise.encoder", "0 arcsec"]),
        ([*SELFCAL, "--set", "filter.kid=map"], ["filter.kid", "kind"]),
        (["selfcal", "no_wc.csv", *SELFCAL[2:]], ["no_wc.csv", "wc_x"]),
        (["selfcal", "radians.csv", *SELFCAL[2:]], ["radians.csv", "degrees and radians"]),
        (["selfcal", "three.csv", *SELFCAL[2:]], ["three.csv", "rows"]),
        (["design", "selfcal", "selfcal.toml", "--out", "plan.csv"], ["plan.csv", ".toml"]),
        (["design", "selfcal", "none.toml"], ["none.toml"]),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_written(arguments, words, capsys, folder):
    text = Path("short.csv").read_text()
    lines = text.splitlines()
    Path("no_wc.csv").write_text(
        "\n".join(",".join(f.split(",")[:1] + f.split(",")[4:]) for f in lines) + "\n"
    )
    Path("radians.csv").write_text(
        text.replace("th_x [deg],th_y [deg],th_z [deg]", "th_x [rad],th_y [rad],th_z [rad]")
    )
    Path("three.csv").write_text("\n".join(lines[:4]) + "\n")
    before = sorted(path.name for path in folder.iterdir())
    for more in ([], ["--json"] if "--stream" not in arguments else []):
        capsys.readouterr()
        assert run([*arguments, *more]) == 2
        said_once(capsys.readouterr(), *words)
    assert sorted(path.name for path in folder.iterdir()) == before


# Path design.

QUICK = ["--set", "design.turns=3", "--set", "design.angle=90 deg"]


def test_a_designed_path_goes_into_a_study_and_keeps_what_it_promised(capsys):
    """The written [plan], in the place of the study's, gives the bounds that the design predicts."""
    code, data = told(capsys, "design", "selfcal", "selfcal.toml", *QUICK, "--out", "plan.toml")
    assert (code, data["command"]) == (0, "design selfcal")
    result = data["result"]
    assert set(result) >= {"turns", "rank", "condition", "d_efficiency", "predicted", "compare"}
    assert list(result["predicted"]) == list(NAMES)
    plan = tomllib.loads(Path("plan.toml").read_text())["plan"]
    assert plan["turns"] == result["turns"]
    text = Path("selfcal.toml").read_text()
    begin, end = text.index("[plan]"), text.index("[truth]")
    Path("designed.toml").write_text(text[:begin] + Path("plan.toml").read_text() + "\n" + text[end:])
    assert run(["simulate", "selfcal", "designed.toml", "--out", "designed.csv", "--quiet"]) == 0
    code, found = told(capsys, "selfcal", "designed.csv", "--study", "designed.toml")
    assert code == 0
    predicted = np.array(list(result["predicted"].values()))
    np.testing.assert_allclose(list(found["result"]["bounds"].values()), predicted, rtol=0.03)


def test_a_design_is_printed_and_drawn(capsys):
    assert (
        run(["design", "selfcal", "selfcal.toml", *QUICK, "--report", "design.html", "--out", "design.json"])
        == 0
    )
    captured = capsys.readouterr()
    assert "up to 3 turns of multiples of 90 deg in 540 s" in captured.out
    assert "design.html" in captured.err
    assert Path("design.html").read_text("utf-8").lstrip().lower().startswith("<!doctype html>")
    assert json.loads(Path("design.json").read_text())["result"]["compare"][0]["name"] == "found"
