"""The commands of a store, from a recording to a rerun, as somebody types them."""

import json
import re

import pytest

from inercal.cli import run
from inercal.examples import EXAMPLES, FOLDER

FILES = ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml")
CALIBRATE = ["calibrate", "imu", "ferraris.csv.gz", "--map", "ferraris-map.toml", "--study", "ferraris.toml"]


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with a recording and an empty store."""
    for name in FILES:
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INERCAL_STORE", str(tmp_path / "store"))
    assert run(["store", "init", "--quiet"]) == 0
    return tmp_path


def said(capsys, *words, code=0):
    """The JSON of a command."""
    capsys.readouterr()
    assert run([*words, "--json"]) == code
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_result_is_kept_shown_and_made_once_more(lab, capsys):
    """Kept by the command itself, with report; the rerun gives the same digits on the same machine."""
    assert run([*CALIBRATE, "--out", "cal.json", "--report", "cal.html", "--keep"]) == 0
    captured = capsys.readouterr()
    identity = re.search(r"result: (\w{10}) kept in", captured.err)[1]
    assert said(capsys, "keep", "cal.json")["result"]["new"] is False
    (row,) = said(capsys, "results", "--status", "ok")["result"]["results"]
    assert row["id"].startswith(identity)
    assert run(["show", identity, "--report", "again.html", "--out", "again.json"]) == 0
    assert (lab / "again.html").read_bytes() == (lab / "cal.html").read_bytes()
    first, again = (json.loads((lab / name).read_text()) for name in ("cal.json", "again.json"))
    assert first["parameters"] == again["parameters"]
    assert first["provenance"]["arguments"] == [
        *CALIBRATE,
        "--out",
        "cal.json",
        "--report",
        "cal.html",
        "--keep",
    ]
    (lab / "ferraris.csv.gz").unlink()
    rerun = said(capsys, "rerun", identity)
    assert rerun["result"]["sound"]
    assert {each["same"] for each in rerun["result"]["coefficients"]} == {"equal"}
    assert said(capsys, "store", "check")["result"]["faults"] == []


def test_a_rerun_that_changes_says_so(lab, capsys):
    """A result whose JSON said something else: what moved by more than u is named, exit code 1."""
    assert run([*CALIBRATE, "--out", "cal.json", "--quiet"]) == 0
    data = json.loads((lab / "cal.json").read_text())
    by_name = {row["name"]: row for row in data["parameters"]}
    by_name["K1_x"]["value"] += 5.0 * by_name["K1_x"]["u"]
    by_name["K1_y"]["value"] += 0.5 * by_name["K1_y"]["u"]
    (lab / "other.json").write_text(json.dumps(data))
    identity = said(capsys, "keep", "other.json")["result"]["id"]
    same = {
        row["name"]: row["same"] for row in said(capsys, "rerun", identity, code=1)["result"]["coefficients"]
    }
    assert (same["K1_x"], same["K1_y"], same["K1_z"]) == ("changed", "within u", "equal")


def test_files_above_and_by_absolute_path_are_found_again(lab, capsys, monkeypatch):
    """The folder of a rerun has the shape of the one in which the command ran."""
    (lab / "work").mkdir()
    monkeypatch.chdir(lab / "work")
    words = [
        "calibrate",
        "imu",
        "../ferraris.csv.gz",
        f"--map={lab}/ferraris-map.toml",
        "--study",
        "../ferraris.toml",
    ]
    assert run([*words, "--keep", "--quiet"]) == 0
    (row,) = said(capsys, "results")["result"]["results"]
    for name in FILES:
        (lab / name).unlink()
    assert said(capsys, "rerun", row["id"])["result"]["sound"]


def test_the_store_is_asked_for_before_the_work(lab, capsys, monkeypatch):
    """No store, options without --keep, no instrument: one sentence, and nothing is written."""
    monkeypatch.setenv("INERCAL_STORE", str(lab / "nowhere"))
    assert run([*CALIBRATE, "--keep", "--out", "cal.json"]) == 2
    assert "inercal store init" in capsys.readouterr().err
    assert run([*CALIBRATE, "--instrument", "17", "--out", "cal.json"]) == 2
    assert "--instrument: found without --keep" in capsys.readouterr().err
    monkeypatch.setenv("INERCAL_STORE", str(lab / "store"))
    study = (lab / "ferraris.toml").read_text()
    (lab / "ferraris.toml").write_text(re.sub(r"instrument = .*", "", study))
    assert run([*CALIBRATE, "--keep", "--out", "cal.json"]) == 2
    assert "maker, model, serial" in capsys.readouterr().err
    assert not (lab / "cal.json").exists()
    assert run(["selfcal", "--stream", "--study", "ferraris.toml", "--keep"]) == 2
    assert "with a stream" in capsys.readouterr().err


def test_lists_are_asked_by_instrument_day_and_status(lab, capsys):
    for k, serial in enumerate(("1", "2")):
        words = [*CALIBRATE, "--set", f"traceability.date=2026-0{k + 1}-15", "--keep", "--quiet"]
        assert run([*words, "--instrument", f"Maker, Model, {serial}"]) == 0
    serials = [row["serial"] for row in said(capsys, "instruments")["result"]["instruments"]]
    assert serials == ["1", "2"]

    def found(*words):
        return [row["instrument"]["serial"] for row in said(capsys, "results", *words)["result"]["results"]]

    assert found() == ["1", "2"]
    assert found("--instrument", "2") == ["2"]
    assert found("--since", "2026-02-01") == ["2"]
    assert found("--status", "suspect") == []
    for words, sentence in (
        (["--since", "yesterday"], "expected a day such as"),
        (["--status", "good"], "expected ok, suspect"),
        (["--instrument", "3"], "no such instrument"),
    ):
        assert run(["results", *words]) == 2
        assert sentence in capsys.readouterr().err


def test_a_result_is_superseded_once_with_a_reason(lab, capsys):
    for gravity in ("9.81 m/s^2", "9.82 m/s^2"):
        assert run([*CALIBRATE, "--set", f"site.gravity={gravity}", "--keep", "--quiet"]) == 0
    one, two = (row["id"][:8] for row in said(capsys, "results")["result"]["results"])
    said(capsys, "supersede", one, two, "--reason", "wrong gravity")
    assert run(["show", one]) == 0
    assert f"superseded by  {two}" in capsys.readouterr().out
    assert run(["supersede", one, two, "--reason", "again"]) == 2
    assert "already" in capsys.readouterr().err


WITH_RESULTS = {
    "calibrate imu", "calibrate strapdown", "calibrate turntable", "selfcal", "aoa", "allan", "temperature",
    "sensitivity", "compare", "validate",
    *(f"design {kind}" for kind in ("positions", "tolerances", "selfcal", "strapdown", "aoa")),
}  # fmt: skip


def test_every_command_with_a_result_can_keep_it(capsys):
    for words in WITH_RESULTS:
        assert run([*words.split(), "--help"]) == 0
        said = capsys.readouterr().out
        assert all(f"--{option}" in said for option in ("keep", "store", "instrument")), words


@pytest.mark.campaign
def test_every_result_is_kept_and_made_once_more(lab, capsys):
    """Results of all kinds, on what ships or is simulated: kept, and the same digits again."""
    for kind in ("turntable", "selfcal", "aoa", "strapdown"):
        item = ["--set", "item.serial=S1", "--set", "item.model=M"]
        assert run(["new", kind, "--set", "site.latitude=48 deg", *item, "--quiet"]) == 0
    for name in ("selfcal", "lasergyro", "thermal"):
        assert run(["examples", name, "--out", name, "--quiet"]) == 0
    small = ["--set", "positions.grid={phi1=6,phi2=6}"]
    assert run(["simulate", "turntable", "turntable.toml", *small, "--out", "tt.csv", "--quiet"]) == 0
    assert (
        run(["simulate", "aoa", "aoa.toml", "--set", "motion.duration=5 s", "--out", "m.csv", "--quiet"]) == 0
    )
    assert run([*CALIBRATE, "--out", "cal.json", "--quiet"]) == 0
    noise, sweep = (EXAMPLES[name].command(name).split()[1:] for name in ("lasergyro", "thermal"))
    commands = [
        ["calibrate", "turntable", "tt.csv", "--study", "turntable.toml"],
        ["selfcal", "selfcal/selfcal.csv.gz", "--study", "selfcal/selfcal.toml", "--instrument", "P1"],
        ["aoa", "m.csv", "--study", "aoa.toml"],
        [*noise, "--end", "60 s", "--instrument", "L1"],
        [*sweep, "--instrument", "T1"],
        ["sensitivity", "turntable.toml", *small],
        ["design", "positions", "turntable.toml", *small],
        ["design", "strapdown", "strapdown.toml"],
        ["compare", "cal.json", "cal.json"],
        ["validate"],
    ]
    for words in commands:
        assert run([*words, "--keep", "--quiet"]) in (0, 1), words
    capsys.readouterr()
    kept = said(capsys, "results")["result"]["results"]
    assert len(kept) == len(commands)
    for row in kept:
        if row["command"] != "validate":  # its date and times are its result
            assert said(capsys, "rerun", row["id"])["result"]["sound"], row["command"]


def test_copies_travel(lab, capsys):
    assert run([*CALIBRATE, "--keep", "--quiet"]) == 0
    assert run(["store", "export", "copy"]) == 0
    assert run(["store", "init", "--store", "other"]) == 0
    added = said(capsys, "store", "import", "copy", "--store", "other")["result"]
    assert (added["results"], added["there"]) == (1, 0)
    assert run(["store", "check", "--store", "other"]) == 0
    assert run(["store", "upgrade", "--store", "other"]) == 0
    assert run(["store", "init", "--store", "other"]) == 2
