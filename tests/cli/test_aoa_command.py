"""``inercal aoa``: from a simulated file to angles, points, a result and a page; live and by every method."""

import io
import json
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from new_studies import FILL

from inercal.cli import aoa as command
from inercal.cli import run
from inercal.foundation.results.files import load
from inercal.systems.aoa import settings
from rows import for_each

pytestmark = pytest.mark.usefixtures("undrawn")

AOA = ["aoa", "model.csv", "--study", "aoa.toml"]
NAMES = ["b_g", "b_1", "b_2", "b_3", "dr_1", "dr_2", "dr_3", "zo_1", "zo_2", "zo_3", "k_g", "tau_g"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The study that `new` writes, a model that swings for 6 s, and one that pauses at four angles."""
    path = tmp_path_factory.mktemp("aoa")
    study, quick = path / "aoa.toml", ["--set", "motion.sample_rate=250 Hz", "--quiet"]
    assert run(["new", "aoa", "--out", str(study), "--quiet", *FILL]) == 0
    text = study.read_text().replace('"45(26) deg"', '"45 deg"').replace('"0(300) m"', '"0 m"')
    study.write_text(text)
    begin, end = text.index("[motion]"), text.index("[disturbances]")
    pauses = '[motion]\nkind = "pitch-pause"\nfirst = "0 deg"\nlast = "30 deg"\nstep = "10 deg"\n'
    (path / "pauses.toml").write_text(text[:begin] + pauses + text[end:])
    for name, seed, more in (("model", 4, ["--set", "motion.duration=6 s"]), ("pauses", 5, [])):
        of = path / ("aoa.toml" if name == "model" else "pauses.toml")
        out = path / f"{name}.csv"
        assert run(["simulate", "aoa", str(of), "--seed", str(seed), "--out", str(out), *more, *quick]) == 0
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


def table_of(path):
    """Titles of a CSV file without units, and its columns (k, n)."""
    titles = Path(path).read_text().split("\n", 1)[0].split(",")
    return [title.split(" ")[0] for title in titles], np.genfromtxt(path, delimiter=",", skip_header=1).T


def piped(monkeypatch, capsys, *arguments, log="model.csv"):
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


def test_choices_are_those_of_the_settings():
    """They stand here once more so that `--help` loads nothing."""
    for name in ("Static", "Centrifugal", "Tangential", "States"):
        assert get_args(getattr(command, name)) == get_args(getattr(settings, name))


# One recording.


def test_json_is_the_contract_and_holds_the_truth(capsys):
    code, data = told(capsys, *AOA)
    assert (code, data["command"], data["status"]["code"]) == (0, "aoa", "ok")
    assert [p["name"] for p in data["parameters"]] == NAMES == data["covariance"]["names"]
    assert {p["unit"] for p in data["parameters"]} == {"rad/s", "m/s^2", "m", "1", "s"}
    result = data["result"]
    assert result["method"] == "fusion 19"
    assert 0.1 < result["nis_mean"] == data["statistics"]["nis_mean"] < 2.0
    assert list(result["posterior"]) == NAMES
    for p in data["parameters"]:
        assert result["posterior"][p["name"]]["value"] == p["value"]
        assert result["posterior"][p["name"]]["u"] == p["u"]
    assert 0.0 < result["reference"]["rms_deg"] < result["reference"]["max_abs_deg"] < 0.1
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert data["timing_s"]["solve"] < data["timing_s"]["total"]
    assert sorted(Path(each["path"]).name for each in data["inputs"]) == ["aoa.toml", "model.csv"]
    assert {"accelerometer noise", "gyro noise", "lever arms"} <= {item["source"] for item in data["budget"]}


def test_samples_have_a_row_each(capsys):
    """Columns as agreed; the angle is the truth to a hundredth of a degree or so."""
    assert run([*AOA, "--out", "angles.csv", "--quiet"]) == 0
    assert capsys.readouterr().err == ""
    assert (
        Path("angles.csv")
        .read_text()
        .startswith("t [s],theta [deg],u_theta [deg],rate [deg/s],nis [1],status [1]\n")
    )
    _, (t, theta, u, *_) = table_of("angles.csv")
    titles, model = table_of("model.csv")
    np.testing.assert_array_equal(t, model[0])
    error = np.abs(theta - model[titles.index("theta_ref")])[500:]
    assert error.max() < 5.0 * u[500:].max()
    assert error.max() < 0.1


def test_smoothing_gives_another_and_surer_angle(capsys):
    code, causal = told(capsys, *AOA)
    assert code == 0
    for how in (["--smooth"], ["--set", "estimator.smooth=true"]):
        code, smoothed = told(capsys, *AOA, *how)
        assert (code, smoothed["result"]["method"]) == (0, "smoothed 19")
        assert smoothed["result"]["angle"]["u"]["median"] < causal["result"]["angle"]["u"]["median"]


@pytest.mark.parametrize("states", [8, 11, 15])
def test_fewer_states(states, capsys):
    code, data = told(capsys, *AOA, "--states", str(states))
    assert (code, data["result"]["method"]) == (0, f"fusion {states}")
    assert len(data["parameters"]) == {8: 5, 11: 8, 15: 8}[states]


@pytest.mark.parametrize(
    ("option", "choices"),
    [
        ("--static", get_args(settings.Static)),
        ("--centrifugal", get_args(settings.Centrifugal)),
        ("--tangential", get_args(settings.Tangential)),
    ],
)
def test_every_choice_of_the_paper(option, choices, capsys):
    """The others as the study says: improved, mechanical, dual if it says nothing; no coefficients are found."""
    for choice in choices:
        code, data = told(capsys, *AOA, option, choice)
        assert code == 0
        assert choice in data["result"]["method"]
        assert data["parameters"] == []
        assert data["result"]["posterior"] == {}
        assert data["result"]["reference"]["max_abs_deg"] < 20.0


def test_a_study_asks_for_the_paper_as_options_do(capsys):
    """Options are keys of the study: the same digits, and the same keys in the provenance."""
    by_option = told(capsys, *AOA, "--static", "segmented")[1]
    keys = ["--set", "estimator.kind=paper", "--set", "methods.static=segmented"]
    by_key = told(capsys, *AOA, *keys)[1]
    assert by_key["result"] == by_option["result"]
    assert by_key["provenance"]["settings"] == by_option["provenance"]["settings"]
    assert by_key["provenance"]["settings"]["estimator"]["kind"] == "paper"
    by_fusion = told(capsys, *AOA, *keys, "--states", "8")[1]
    assert by_fusion["result"]["method"] == "fusion 8"


def test_choices_combine_and_beat_nothing_done(capsys):
    """Untreated, the lever arms of 10 deg at 1 Hz cost degrees; the paper's best way leaves hundredths."""
    none = ["--centrifugal", "none", "--tangential", "none"]
    worst = told(capsys, *AOA, "--static", "improved", *none)[1]["result"]
    best = told(capsys, *AOA, "--static", "improved", "--centrifugal", "mechanical", "--tangential", "dual")[
        1
    ]["result"]
    assert worst["reference"]["max_abs_deg"] > 20.0 * best["reference"]["max_abs_deg"]


def test_compare_sets_methods_side_by_side(capsys):
    assert run([*AOA, "--compare", "--out", "compared.json", "--quiet"]) == 0
    printed = capsys.readouterr().out
    compare = load("compared.json").result["compare"]
    assert {"fusion 8", "smoothed 8", "smoothed 19"} <= set(compare)
    assert len(compare) > 3
    assert "Methods side by side" in printed
    for name in compare:
        assert name in printed


def test_points_have_a_row_each(capsys):
    """The pauses at 0, 10, 20 and 30 degrees, with the numbers of the record."""
    pauses = ["aoa", "pauses.csv", "--study", "pauses.toml"]
    assert run([*pauses, "--points", "--out", "points.csv", "--quiet"]) == 0
    assert "Points" in capsys.readouterr().out
    titles, columns = table_of("points.csv")
    found = dict(zip(titles, columns, strict=True))
    np.testing.assert_allclose(found["theta"], [0.0, 10.0, 20.0, 30.0], atol=0.05)
    number = dict(zip(*table_of("pauses.csv"), strict=True))["point"]
    assert found["point"].tolist() == np.unique(number[number > 0]).tolist()
    code, data = told(capsys, *pauses)
    assert (code, len(data["result"]["points"])) == (0, 4)
    assert run(pauses) == 0
    assert "\nPoints\n" not in capsys.readouterr().out


def test_a_bad_verdict_is_exit_code_one_and_still_the_whole_object(capsys):
    code, data = told(capsys, *AOA, "--set", "noise.accelerometer=1e-6 g", "--set", "noise.gyro=0.002 deg/s")
    assert code == 1
    assert data["status"]["code"] == "inconsistent"
    assert "posterior" in data["result"]


def test_the_result_of_one_run_is_the_prior_of_the_next(capsys):
    """The second run knows the biases as well as the first at its end, and better than the study at the start."""
    rows = [line.rsplit(",", 1)[0] for line in Path("model.csv").read_text().splitlines()]
    Path("bare.csv").write_text("\n".join(rows) + "\n")  # without theta_ref
    bare = ["aoa", "bare.csv", *AOA[2:]]
    assert run([*bare, "--out", "run1.json", "--quiet"]) == 0
    code, data = told(capsys, *bare, "--set", "estimator.prior=run1.json")
    assert code == 0
    before = {p["name"]: p["u"] for p in json.loads(Path("run1.json").read_text())["parameters"]}
    for p in data["parameters"]:
        assert p["u"] <= before[p["name"]] * (1.0 + 1e-9)
        assert data["result"]["posterior"][p["name"]]["prior"] <= before[p["name"]] * (1.0 + 1e-6)
    assert [each["path"] for each in data["inputs"]] == ["bare.csv", "aoa.toml", "run1.json"]


def test_files_with_distinct_channels_are_one_record(capsys):
    rows = [line.split(",") for line in Path("model.csv").read_text().splitlines()]
    titles = [title.split(" ")[0] for title in rows[0]]
    for name, chosen in (("acc", ("t", "a1", "a2", "a3", "theta_ref")), ("gyro", ("t", "gyro"))):
        places = [titles.index(each) for each in chosen]
        Path(f"{name}.csv").write_text("".join(",".join(row[k] for k in places) + "\n" for row in rows))
    apart = told(capsys, "aoa", "acc.csv", "gyro.csv", *AOA[2:])[1]
    whole = told(capsys, *AOA)[1]
    for key in ("max_abs_deg", "rms_deg"):
        assert apart["result"]["reference"][key] == pytest.approx(whole["result"]["reference"][key], rel=1e-9)


# Live.


def test_an_alarm_is_said_while_the_stream_goes_on(capsys, monkeypatch):
    stream = ["aoa", "--stream", *AOA[2:], "--states", "8", "--set", "noise.accelerometer=1e-6 g"]
    stream += ["--set", "band.low_pass=none", "--set", "estimator.snap=1e7 rad^2/s^7"]
    code, out, err = piped(monkeypatch, capsys, *stream)
    assert (code, out.count("\n")) == (1, 1501)
    assert err.count("excess_scatter: NIS is ") == 1
    assert "the stream contradicts the model: mean NIS" in err


# What is refused.


@for_each(
    ("arguments", "words"),
    [
        ([*AOA, "--static", "kalman"], ["kalman", "improved"]),
        ([*AOA, "--states", "9"], ["9", "19"]),
        ([*AOA, "--smooth", "--static", "segmented"], ["--smooth", "--static"]),
        ([*AOA, "--states", "8", "--tangential", "dual"], ["--states", "--tangential"]),
        ([*AOA, "--stream", "--smooth"], ["--smooth", "stream"]),
        ([*AOA, "--stream", "--points"], ["--points", "stream"]),
        ([*AOA, "--stream", "--centrifugal", "decision"], ["--centrifugal", "stream", "fusion", "files"]),
        ([*AOA, "--stream", "--set", "estimator.smooth=true"], ["aoa.toml", "estimator.smooth", "past"]),
        ([*AOA, "--stream", "--set", "estimator.kind=paper"], ["aoa.toml", "estimator.kind", "files"]),
        (["aoa", "model.csv", "pauses.csv", *AOA[2:]], ["pauses.csv", "model.csv", "estimator.prior"]),
        ([*AOA, "--set", "sensors.a1.axis=+y"], ["sensors.a1.axis", "+y"]),
        ([*AOA, "--set", "estimator.prior=none.json"], ["none.json"]),
        ([*AOA, "--set", "estimator.prior=p.json", "--out", "p.json"], ["p.json", "is an input"]),
        ([*AOA, "--set", "model.roll=90 deg"], ["aoa.toml", "model.roll", "90 deg"]),
        ([*AOA, "--set", "model.roll=90 deg", "--stream"], ["aoa.toml", "model.roll", "90 deg"]),
        ([*AOA, "--set", "estimator.stats=8"], ["estimator.stats", "states"]),
        (["aoa", "gyro_only.csv", *AOA[2:]], ["gyro_only.csv", "accelerometer", "a1"]),
        (["aoa", "one_axis.csv", *AOA[2:]], ["one_axis.csv", "a2"]),
        (["aoa", "counts.csv", *AOA[2:]], ["counts.csv", "a1 is in count", "sensors.a1", "scale"]),
        (["aoa", "counts.csv", *AOA[2:], "--stream"], ["counts.csv", "a1 is in count", "scale"]),
        (["aoa", "one_axis.csv", *AOA[2:], "--stream"], ["one_axis.csv", "a2"]),
        (["aoa", "ten.csv", *AOA[2:]], ["ten.csv", "10 rows"]),
    ],
)
def test_bad_input_is_one_sentence_and_nothing_is_written(arguments, words, capsys, folder):
    text = Path("model.csv").read_text()
    rows = [line.split(",") for line in text.splitlines()]
    if not Path("ten.csv").exists():
        Path("gyro_only.csv").write_text("".join(f"{row[0]},{row[4]}\n" for row in rows))
        Path("one_axis.csv").write_text("".join(f"{row[0]},{row[1]},{row[3]},{row[4]}\n" for row in rows))
        Path("counts.csv").write_text(text.replace("a1 [g]", "a1 [count]"))
        Path("ten.csv").write_text("".join(",".join(row) + "\n" for row in rows[:11]))
    before = sorted(path.name for path in folder.iterdir())
    for more in ([], ["--json"] if "--stream" not in arguments else []):
        capsys.readouterr()
        assert run([*arguments, *more]) == 2
        said_once(capsys.readouterr(), *words)
    assert sorted(path.name for path in folder.iterdir()) == before
